"""Lens distortion, exposure and readout in episodes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pftrack_sim import scenario
from pftrack_sim.core.errors import ScenarioError
from pftrack_sim.core.records import Frame
from pftrack_sim.simulation.simulation import Simulation

SMALL: dict[str, Any] = {"camera.width_px": 160, "camera.height_px": 120, "lights.shadows": False}
AXES: dict[str, dict[str, Any]] = {
    "blur": {"exposure_ms": 25.0},
    "rolling_shutter": {"readout_ms": 30.0},
    "distortion": {"k1": -0.2, "p1": 0.01},
}
HARD = {f"axes.{axis}.severity": 2.0 for axis in (*AXES, "jitter")}


def frames(name: str, overrides: dict[str, Any], *, seed: int = 3, count: int = 5) -> list[Frame]:
    with Simulation(scenario.load(name, {**SMALL, **overrides})) as simulation:
        return [simulation.reset(seed), *(simulation.advance() for _ in range(count - 1))]


@pytest.mark.parametrize(
    "name",
    ["corridor", *(pytest.param(one, marks=pytest.mark.slow) for one in ("plaza-walk", "warehouse", "street-night"))],
)
def test_severity_zero_is_the_base_to_the_bit(name: str):
    base = frames(name, {}, count=3)
    off = {f"axes.{axis}": {**given, "severity": 0.0} for axis, given in AXES.items()}
    for mine, theirs in zip(frames(name, off, count=3), base, strict=True):
        assert mine.image.tobytes() == theirs.image.tobytes()
        assert mine.people == theirs.people


@pytest.mark.parametrize("axis", AXES)
def test_optical_axes_do_not_change_the_world(axis: str):
    base, changed = frames("corridor", {}, count=3), frames("corridor", {f"axes.{axis}": AXES[axis]}, count=3)
    assert not np.array_equal(base[-1].image, changed[-1].image)
    assert [one.time_s for one in base] == [one.time_s for one in changed]
    # Taken a moment earlier, of the very same walk.
    for mine, theirs in zip(changed, base, strict=True):
        moved = np.linalg.norm(mine.truth.T_world_target[:3, 3] - theirs.truth.T_world_target[:3, 3])
        assert moved < 0.06
        assert axis == "distortion" or np.array_equal(mine.truth.distortion, np.zeros(5))


@pytest.mark.parametrize("name", ["easy/plaza-walk", "easy/corridor"])
def test_everything_at_severity_two_at_once(name: str):
    for frame in frames(name, HARD):
        for truth in frame.people:
            assert np.isfinite(truth.box).all()
            assert np.isfinite(truth.amodal_box).all()
            assert np.isfinite(truth.swept_box).all()
            assert 0.0 <= truth.visible_fraction <= 1.0
            assert 0.0 <= truth.truncation <= 1.0
            mine, swept = (np.concatenate([box[:2], -box[:2] - box[2:]]) for box in (truth.amodal_box, truth.swept_box))
            assert (swept <= mine + 1e-9).all()
            if truth.state == "visible":
                seen = truth.visible_box
                assert (seen[:2] >= truth.amodal_box[:2] - 1.0).all()
                assert (seen[:2] + seen[2:] <= truth.amodal_box[:2] + truth.amodal_box[2:] + 1.0).all()
                assert 0.0 <= truth.luminance <= 1.0


def test_the_same_seed_gives_the_same_frames():
    for one, two in zip(frames("corridor", HARD, count=3), frames("corridor", HARD, count=3), strict=True):
        assert one.image.tobytes() == two.image.tobytes()
        assert one.people == two.people


def test_a_severity_may_depend_on_the_seed():
    drawn = {**SMALL, "axes.distortion.severity": {"choice": [0.0, 1.0, 2.0]}}
    with Simulation(scenario.load("corridor", drawn)) as simulation:
        first = [simulation.reset(seed) for seed in range(4)]
    assert {one.image.shape for one in first} == {(120, 160, 3)}
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
