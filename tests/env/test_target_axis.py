"""The target axis: manoeuvres, scale and leaving the view, measured from the truth of the frames."""

from typing import Any

import numpy as np
import observing
import pytest
from observing import CALM, PLACES, on_axis

from pftrack_sim.core.records import Truth
from pftrack_sim.scenario.axes import TargetAxis

RATE_HZ = 30.0
ONLY_MANOEUVRES: dict[str, Any] = {"faster_m_s": 0.0, "range_m": 0.0, "leave_s": 0.0, "at_s": 0.5}


def truths(until_s: float, name: str = "easy/plaza-walk", from_s: float = 0.0, **axis: Any) -> list[Truth]:
    return observing.truths(name, CALM | on_axis("target", **axis), 3, from_s, until_s)


def speeds(observed: list[Truth]) -> np.ndarray:
    """`(T - 1,)` over the ground, smoothed over a quarter of a second: hips sway as they walk."""
    places = np.array([one.T_world_target[:2, 3] for one in observed])
    return np.convolve(np.hypot(*np.diff(places, axis=0).T) * RATE_HZ, np.ones(8) / 8.0, mode="valid")


def test_running_reaches_its_speed_and_returns_to_walking():
    observed = truths(5.5, manoeuvres=["run"], run_m_s=2.5, per_minute=6, **ONLY_MANOEUVRES)
    speed = speeds(observed)
    walking = speed[:10].mean()
    assert speed.max() == pytest.approx(2.5, abs=0.1)
    assert speed[-8:].mean() == pytest.approx(walking, abs=0.1)


def test_a_stopped_target_stands_still():
    speed = speeds(truths(3.5, manoeuvres=["stop"], per_minute=6, **ONLY_MANOEUVRES))
    assert speed[round(1.6 * RATE_HZ) : round(2.2 * RATE_HZ)].max() < 0.05
    assert speed[-1] > 0.8


def test_a_crouch_lowers_the_amodal_box_and_rises_again():
    route = {"robot.route": {"kind": "still", "start_m": [4.0, -4.5], "heading_deg": 90.0}}
    axis = on_axis("target", manoeuvres=["crouch"], **ONLY_MANOEUVRES)
    observed = observing.truths("easy/plaza-walk", CALM | route | axis, 3, 0.0, 4.33)
    # Height in metres, independent of the distance.
    height = np.array([one.amodal_box[3] * one.distance_m for one in observed])
    upright, down = height[:12].mean(), height[round(2.8 * RATE_HZ)]
    assert down < 0.8 * upright
    assert height[-5:].mean() == pytest.approx(upright, rel=0.06)


def test_a_turning_target_walks_back_and_then_continues():
    observed = truths(6.8, name="easy/corridor", manoeuvres=["turn"], per_minute=6, **ONLY_MANOEUVRES)
    ahead = np.array([one.T_world_target[:3, 0] for one in observed])
    back = round(3.2 * RATE_HZ)
    assert ahead[0, 0] > 0.9
    assert ahead[back, 0] < -0.9
    assert ahead[-1, 0] > 0.9
    x = np.array([one.T_world_target[0, 3] for one in observed])
    assert x[round(2.2 * RATE_HZ)] - x[round(4.3 * RATE_HZ)] > 0.6
    assert x[-1] > x[round(4.3 * RATE_HZ)] + 0.3


@pytest.mark.parametrize("name", PLACES)
def test_the_target_leaves_the_view_for_the_requested_time(name: str):
    requested = {"per_minute": 0.0, "range_m": 0.0, "faster_m_s": 0.0, "leave_at_s": 1.5, "leave_s": 0.8}
    observed = truths(3.2, name, **requested)
    out = np.array([one.state == "out_of_view" for one in observed])
    times = np.flatnonzero(out) / RATE_HZ
    assert times[0] == pytest.approx(1.5, abs=0.2)
    assert len(times) / RATE_HZ == pytest.approx(0.8, abs=0.3)
    assert observed[0].state == "visible"
    assert observed[-1].state != "out_of_view"


def test_the_distance_to_the_target_varies_by_the_requested_range():
    def spread(range_m: float) -> float:
        requested = {"per_minute": 0.0, "leave_s": 0.0, "faster_m_s": 0.0, "range_m": range_m, "period_s": 10.0}
        distance = [one.distance_m for one in truths(13.5, name="easy/corridor", from_s=4.0, **requested)][1:]
        return max(distance) - min(distance)

    assert spread(0.4) == pytest.approx(0.8, abs=0.15)
    assert spread(0.0) < 0.15


def test_severity_scales_walking_speed_and_rate_of_manoeuvres():
    assert TargetAxis(severity=2.0).every_s == 0.5 * TargetAxis(severity=1.0).every_s
    assert TargetAxis().every_s == float("inf")
    observed = truths(1.5, severity=2.0, faster_m_s=0.2, per_minute=0.0, leave_s=0.0)
    base = truths(1.5, severity=0.0)
    assert speeds(observed).mean() - speeds(base).mean() == pytest.approx(0.4, abs=0.05)
