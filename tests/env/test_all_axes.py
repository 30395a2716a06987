"""All axes in episodes: severity 0 changes nothing, pixel axes change no truth, all work together, seeds repeat."""

import hashlib
from collections.abc import Collection
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from observing import TINY

from pftrack_sim import scenario
from pftrack_sim.core import boxes
from pftrack_sim.core.errors import ScenarioError
from pftrack_sim.core.records import Frame
from pftrack_sim.scenario.axes import axes_by_name
from pftrack_sim.simulation.simulation import Simulation

SMALL = {**TINY, "camera.rate_hz": 10.0, "duration_s": 0.5}
PARAMETERS: dict[str, dict[str, Any]] = {
    "jitter": {"wind_rms_deg": 2.0},
    "occlusion": {"kind": "stranger", "end_s": 3.0},
    "distractors": {"count": 4, "at_s": 1.0},
    "target": {"manoeuvres": ["run"], "at_s": 0.0, "range_m": 1.0},
    "light": {"auto_exposure": True, "auto_white_balance": True, "dim_ev": 3.0, "at_s": 0.1, "exposure_lag_s": 0.2},
    "noise": {"gain": 9.0},
    "stream": {"jpeg_quality": 20, "dropped_share": 0.4, "rate_hz": 8.0},
    "blur": {"exposure_ms": 25.0},
    "rolling_shutter": {"readout_ms": 25.0},
    "distortion": {"k1": -0.2, "p1": 0.01},
    "detector": {"false_alarms": 3.0},
}
"""Of every axis parameters that are not its defaults."""
PIXEL_AXES = ("light", "noise", "stream")
"""Axes that change pixels only, where the stream delivers every frame."""
EVERY_FRAME = {"axes.stream.dropped_share": 0.0, "axes.stream.rate_hz": 10.0}


def at(severity: float, axes: Collection[str]) -> dict[str, Any]:
    given = {f"axes.{axis}.{key}": value for axis in axes for key, value in PARAMETERS[axis].items()}
    return {**given, **{f"axes.{axis}.severity": severity for axis in axes}}


def frames(overrides: dict[str, Any], name: str = "corridor", runs: int = 1) -> list[Frame]:
    """The frames of an episode, the last time it was run."""
    shown: list[Frame] = []
    with Simulation(scenario.load(name, {**SMALL, **overrides})) as simulation:
        for _ in range(runs):
            shown = [simulation.reset(5)]
            shown += [simulation.advance() for _ in range(simulation.frame_count - 1)]
    return shown


def digest(shown: list[Frame]) -> str:
    return hashlib.sha256(b"".join(frame.image.tobytes() for frame in shown)).hexdigest()


def assert_same(one: list[Frame], other: list[Frame]) -> None:
    assert digest(one) == digest(other)
    assert [frame.people for frame in one] == [frame.people for frame in other]


@pytest.fixture(scope="module")
def base() -> list[Frame]:
    return frames({})


def test_every_axis_has_parameters_here():
    assert [*PARAMETERS] == [*axes_by_name()]


@pytest.mark.parametrize("axis", PARAMETERS)
def test_severity_zero_is_the_base_whatever_the_parameters(axis: str, base: list[Frame]):
    assert_same(frames(at(0.0, [axis])), base)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["plaza-walk", "warehouse", "street-night"])
def test_severity_zero_of_all_axes_is_the_base_to_the_bit(name: str):
    longer = {"duration_s": 1.2, "camera.rate_hz": 30.0}
    assert_same(frames({**longer, **at(0.0, PARAMETERS)}, name), frames(longer, name))


@pytest.mark.parametrize("axis", ["jitter", *PIXEL_AXES, "blur", "rolling_shutter", "distortion"])
def test_episodes_differ_from_the_base_and_are_repeatable(axis: str, base: list[Frame]):
    once = frames(at(1.0, [axis]))
    assert digest(once) != digest(base)
    assert_same(frames(at(1.0, [axis]), runs=2), once)


def assert_only_pixels_differ(changed: list[Frame], plain: list[Frame]) -> None:
    assert digest(changed) != digest(plain)
    for mine, theirs in zip(changed, plain, strict=True):
        # The luminance is that of the pixels.
        assert [replace(one, luminance=0.0) for one in mine.people] == [
            replace(one, luminance=0.0) for one in theirs.people
        ]


def test_pixel_axes_change_no_truth_beside_all_others():
    others = [axis for axis in PARAMETERS if axis not in PIXEL_AXES]
    assert_only_pixels_differ(frames({**at(1.0, PARAMETERS), **EVERY_FRAME}), frames(at(1.0, others)))


@pytest.mark.parametrize(
    ("name", "duration_s"),
    [("corridor", 1.0), *(pytest.param(name, 3.0, marks=pytest.mark.slow) for name in ("plaza-walk", "warehouse"))],
)
def test_all_axes_at_severity_two_at_once(name: str, duration_s: float):
    hard = {**{f"axes.{axis}.severity": 2.0 for axis in PARAMETERS}, "duration_s": duration_s, "camera.rate_hz": 30.0}
    shown = frames(hard, name)
    assert len(shown) > 5
    times = [frame.time_s for frame in shown]
    assert times == sorted(set(times))
    for frame in shown:
        for truth in frame.people:
            assert np.isfinite(truth.box).all()
            assert 0.0 <= truth.visible_fraction <= 1.0
            assert 0.0 <= truth.truncation <= 1.0
            assert truth.time_s == frame.time_s
            amodal, swept = (
                np.concatenate([box[:2], -box[:2] - box[2:]]) for box in (truth.amodal_box, truth.swept_box)
            )
            assert (swept <= amodal + 1e-9).all()
            if truth.state == "visible":
                assert 0.0 <= truth.luminance <= 1.0
                assert boxes.area(truth.visible_box) > 0
                inside = truth.visible_box[:2] >= truth.amodal_box[:2] - 1.5
                reach = truth.visible_box[:2] + truth.visible_box[2:]
                assert inside.all()
                assert (reach <= truth.amodal_box[:2] + truth.amodal_box[2:] + 1.5).all()
    assert_same(frames(hard, name), shown)


@pytest.mark.parametrize("axis", ["blur", "rolling_shutter", "distortion"])
def test_optical_axes_do_not_change_the_world(axis: str, base: list[Frame]):
    # Taken a moment earlier, of the very same walk.
    for mine, theirs in zip(frames(at(1.0, [axis])), base, strict=True):
        assert mine.time_s == theirs.time_s
        assert np.linalg.norm(mine.truth.T_world_target[:3, 3] - theirs.truth.T_world_target[:3, 3]) < 0.06
        assert axis == "distortion" or np.array_equal(mine.truth.distortion, np.zeros(5))


def test_a_severity_may_depend_on_the_seed():
    drawn = {**SMALL, "axes.distortion.severity": {"choice": [0.0, 1.0, 2.0]}}
    with Simulation(scenario.load("corridor", drawn)) as simulation:
        first = [simulation.reset(seed) for seed in range(4)]
    assert {one.image.shape for one in first} == {(72, 96, 3)}
    k1 = {float(one.truth.distortion[0]) for one in first}
    assert len(k1) > 1
    assert k1 <= {0.0, -0.125, -0.25}


def test_a_lens_that_is_not_invertible_is_a_scenario_error():
    folded = scenario.load("corridor", {"axes.distortion": {"k1": -1.5, "k2": 0.0}})
    with (
        Simulation(folded) as simulation,
        pytest.raises(ScenarioError, match=r"axes\.distortion: the lens .* is not invertible"),
    ):
        simulation.reset(0)
