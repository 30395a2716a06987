"""All axes: severity 0 changes nothing, pixel axes change no truth, all work together."""

import hashlib
import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pftrack_sim import scenario
from pftrack_sim.core import boxes
from pftrack_sim.core.records import Frame
from pftrack_sim.scenario.axes import axes_by_name
from pftrack_sim.simulation.simulation import Simulation

SMALL: dict[str, Any] = {"camera.width_px": 96, "camera.height_px": 72, "lights.shadows": False, "duration_s": 1.2}
BRIEF: dict[str, Any] = {"camera.rate_hz": 10.0, "duration_s": 0.5}
AXES = list(axes_by_name())


def frames(name: str, overrides: dict[str, Any], seed: int = 5) -> list[Frame]:
    with Simulation(scenario.load(name, {**SMALL, **overrides})) as simulation:
        shown = [simulation.reset(seed)]
        shown += [simulation.advance() for _ in range(simulation.frame_count - 1)]
    return shown


PIXEL_AXES: dict[str, dict[str, Any]] = {
    "noise": {},
    "light": {"auto_exposure": True, "auto_white_balance": True, "at_s": 0.1, "exposure_lag_s": 0.2},
    "stream": {"dropped_share": 0.0, "rate_hz": 10.0, "jpeg_quality": 30},
}
"""Axes that change pixels only; the stream delivers every frame."""


def severity_one(*axes: str) -> dict[str, Any]:
    given = {f"axes.{axis}.{key}": value for axis in axes for key, value in PIXEL_AXES.get(axis, {}).items()}
    return {**given, **{f"axes.{axis}.severity": 1.0 for axis in axes}}


def assert_only_pixels_differ(changed: list[Frame], plain: list[Frame]) -> None:
    assert digest(changed) != digest(plain)
    for mine, theirs in zip(changed, plain, strict=True):
        # The luminance is that of the pixels.
        assert [replace(one, luminance=0.0) for one in mine.people] == [
            replace(one, luminance=0.0) for one in theirs.people
        ]


@pytest.mark.slow
def test_each_pair_of_pixel_axes_changes_no_truth():
    plain = frames("plaza-walk", BRIEF)
    for pair in itertools.combinations(PIXEL_AXES, 2):
        assert_only_pixels_differ(frames("plaza-walk", {**BRIEF, **severity_one(*pair)}), plain)


@pytest.mark.parametrize("axis", [axis for axis in AXES if axis not in PIXEL_AXES])
def test_pixel_axes_change_no_truth_beside_another_axis(axis: str):
    alone = frames("corridor", {**BRIEF, **severity_one(axis)})
    assert_only_pixels_differ(frames("corridor", {**BRIEF, **severity_one(axis, *PIXEL_AXES)}), alone)


def digest(shown: list[Frame]) -> str:
    return hashlib.sha256(b"".join(frame.image.tobytes() for frame in shown)).hexdigest()


def assert_same(one: list[Frame], other: list[Frame]) -> None:
    assert digest(one) == digest(other)
    assert [frame.people for frame in one] == [frame.people for frame in other]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["plaza-walk", "corridor", "warehouse", "street-night"])
def test_severity_zero_of_all_axes_is_the_base_to_the_bit(name: str):
    assert_same(frames(name, {f"axes.{axis}.severity": 0.0 for axis in AXES}), frames(name, {}))


@pytest.mark.slow
@pytest.mark.parametrize("axis", AXES)
def test_severity_zero_is_the_base_whatever_the_parameters(axis: str):
    kind = axes_by_name()[axis]
    headline = kind.headline
    # Some headlines are worked out from several parameters.
    given = {f"axes.{axis}.{headline}": getattr(kind(), headline)} if headline in kind.model_fields else {}
    assert_same(frames("corridor", {**given, f"axes.{axis}.severity": 0.0}), frames("corridor", {}))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["plaza-walk", "warehouse"])
def test_all_axes_at_severity_two_at_once(name: str):
    shown = frames(name, {**{f"axes.{axis}.severity": 2.0 for axis in AXES}, "duration_s": 3.0})
    assert len(shown) > 5
    times = [frame.time_s for frame in shown]
    assert times == sorted(set(times))
    for frame in shown:
        for truth in frame.people:
            assert 0.0 <= truth.visible_fraction <= 1.0
            assert truth.time_s == frame.time_s
            if truth.state == "visible":
                assert np.isfinite(truth.visible_box).all()
                assert boxes.area(truth.visible_box) > 0
                inside = truth.visible_box[:2] >= truth.amodal_box[:2] - 1.5
                reach = truth.visible_box[:2] + truth.visible_box[2:]
                assert inside.all()
                assert (reach <= truth.amodal_box[:2] + truth.amodal_box[2:] + 1.5).all()
    again = frames(name, {**{f"axes.{axis}.severity": 2.0 for axis in AXES}, "duration_s": 3.0})
    assert_same(shown, again)
