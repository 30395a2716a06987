"""The stream axis in episodes: frames that are delivered, and what does not depend on those that are lost."""

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from observing import SMALL, on_axis

from pftrack_sim import scenario
from pftrack_sim.camera.sensor import compress
from pftrack_sim.core.records import Frame
from pftrack_sim.simulation.simulation import Simulation

SHORT = {**SMALL, "duration_s": 1.0, "camera.rate_hz": 10.0, "occluders": []}
LOSSY = on_axis("stream", severity=1, jpeg_quality=100, dropped_share=0.5)


def episode(changed: dict[str, Any]) -> list[Frame]:
    with Simulation(scenario.load("corridor", {**SHORT, **changed})) as simulation:
        return [simulation.reset(4), *(simulation.advance() for _ in range(simulation.frame_count - 1))]


@pytest.fixture(scope="module")
def base() -> list[Frame]:
    return episode({})


def test_delivered_frames_are_camera_frames_with_their_truth(base: list[Frame]):
    shown = episode(LOSSY)
    taken = {frame.time_s: frame for frame in base}
    assert 2 <= len(shown) < len(base)
    assert [frame.index for frame in shown] == list(range(len(shown)))
    assert all(one.time_s < two.time_s for one, two in itertools.pairwise(shown))
    for frame in shown:
        twin = taken[frame.time_s]
        assert frame.truth.time_s == frame.time_s
        assert (frame.truth.box == twin.truth.box).all()
        assert (frame.truth.T_world_target == twin.truth.T_world_target).all()
        # JPEG at its best is off by a few levels; the frame before or after is off by far more.
        assert np.abs(frame.image.astype(int) - twin.image).mean() < 4.0


def test_noise_does_not_depend_on_lost_frames():
    noisy = {"axes.noise.severity": 1.0}
    taken = {frame.time_s: frame for frame in episode(noisy)}
    for frame in episode(noisy | LOSSY):
        assert np.array_equal(frame.image, compress(taken[frame.time_s].image, 100))


def test_truth_and_exposure_do_not_depend_on_lost_frames():
    optics = {f"axes.{axis}.severity": 2.0 for axis in ("blur", "rolling_shutter", "light", "noise", "jitter")}
    light = on_axis("light", auto_exposure=True, auto_white_balance=True, at_s=0.1, exposure_lag_s=0.2)
    stream = on_axis("stream", severity=1.0, rate_hz=SHORT["camera.rate_hz"])
    common = {**optics, **light, **stream, "duration_s": 1.5}
    complete = {frame.time_s: frame for frame in episode({**common, "axes.stream.dropped_share": 0.0})}
    lossy = episode({**common, "axes.stream.dropped_share": 0.5})
    assert 3 < len(lossy) < len(complete)
    for frame in lossy:
        twin = complete[frame.time_s]
        # The motion in the image is between frames that are shown.
        mine, theirs = ([replace(one, image_motion_px=0.0) for one in both.people] for both in (frame, twin))
        assert mine == theirs
        assert np.array_equal(frame.image, twin.image)


def test_the_command_is_held_while_frames_are_lost():
    lossy = {**LOSSY, "duration_s": 2.0}
    forward = np.array([0.5, 0.2, 0.0, 0.0])
    with Simulation(scenario.load("corridor", {**SHORT, "duration_s": 2.0})) as simulation:
        simulation.reset(4)
        poses = {0.0: simulation.world.robot_pose()}
        for _ in range(12):
            time_s = simulation.advance(forward).time_s
            poses[time_s] = simulation.world.robot_pose()
    with Simulation(scenario.load("corridor", {**SHORT, **lossy})) as simulation:
        simulation.reset(4)
        gaps = []
        last_s = 0.0
        while (frame := simulation.advance(forward)).time_s <= 1.2:
            assert simulation.world.robot_pose() == poses[frame.time_s]
            gaps.append(round(10.0 * (frame.time_s - last_s)))
            last_s = frame.time_s
    assert max(gaps) > 1


@pytest.mark.slow
def test_the_error_grows_as_the_jpeg_quality_falls(base: list[Frame]):
    errors = []
    for quality in (95, 60, 20, 5):
        coded = episode(on_axis("stream", severity=1, jpeg_quality=quality, dropped_share=0.0, rate_hz=10.0))
        assert len(coded) == len(base)
        errors.append(np.mean([np.square(a.image.astype(float) - b.image) for a, b in zip(coded, base, strict=True)]))
    assert (np.diff(errors) > 0.0).all()
    assert errors[-1] > 4.0 * errors[0]
