"""A requested occlusion is in the truth of the frames, with its begin and duration."""

from typing import Any

import numpy as np
import pytest

from pftrack_sim import scenario
from pftrack_sim.core.errors import ScenarioError
from pftrack_sim.core.records import Truth
from pftrack_sim.simulation.simulation import Simulation

AT_S, DURATION_S, RATE_HZ = 3.0, 1.0, 15.0


def walk(kind: str, seed: int, **occluder: Any) -> dict[str, Any]:
    """A walk across the open square with the robot beside, without distractors, and one occlusion."""
    return {
        "title": "one occlusion",
        "duration_s": 5.5,
        "place": {"kind": "plaza", "clutter": 0.0},
        "robot": {"route": {"kind": "beside", "distance_m": 3.6, "lead_m": -0.4}},
        "camera": {"width_px": 240, "height_px": 180, "rate_hz": RATE_HZ},
        "lights": {"shadows": False},
        "target": {"path_m": [[4.0, 1.0], [20.0, 1.0]], "speed_m_s": 1.1 + 0.05 * seed},
        "distractors": {"count": 0},
        "occluders": [{"kind": kind, "at_s": AT_S, "duration_s": DURATION_S, **occluder}],
    }


def truths(tree: dict[str, Any], seed: int) -> list[Truth]:
    with Simulation(scenario.load(tree), image=False) as simulation:
        frame = simulation.reset(seed)
        observed = [frame.truth]
        for _ in range(simulation.settings.frame_count - 1):
            observed.append(simulation.advance().truth)
    return observed


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize(
    ("kind", "name", "late_s"), [("pillar", "occluder-pillar-1", 0.15), ("walker", "crosser-1", 0.25)]
)
def test_a_full_occlusion_covers_half_of_the_body_at_its_begin_and_end(kind: str, name: str, late_s: float, seed: int):
    observed = truths(walk(kind, seed), seed)
    fraction = np.array([truth.visible_fraction for truth in observed])
    hidden = np.flatnonzero(fraction < 0.5)
    # The centre line is covered from at_s on; half of the body is, when it is as wide to the left as to the right.
    # An arm or a leg put forward shifts that by a few frames, and one walker is slighter than another.
    assert hidden[0] / RATE_HZ == pytest.approx(AT_S, abs=late_s)
    assert (hidden[-1] + 1) / RATE_HZ == pytest.approx(AT_S + DURATION_S, abs=late_s)
    assert (np.diff(hidden) == 1).all()
    middle = observed[round((AT_S + 0.5 * DURATION_S) * RATE_HZ)]
    assert fraction[hidden].min() < 0.2
    assert middle.occluders[0] == name
    away = round(1.4 * RATE_HZ)
    outside = np.r_[fraction[: hidden[0] - away], fraction[hidden[-1] + away :]]
    assert (outside > 0.98).all()


@pytest.mark.parametrize("share", [0.35, 0.6])
@pytest.mark.parametrize("kind", ["wall", "boxes"])
def test_a_low_occluder_covers_the_requested_share_of_the_height(kind: str, share: float):
    observed = truths(walk(kind, 0, share=share), 0)
    middle = observed[round((AT_S + 0.5 * DURATION_S) * RATE_HZ)]
    assert middle.occluders[0] == f"occluder-{kind}-1"
    shown = middle.visible_box[3] / middle.amodal_box[3]
    assert shown == pytest.approx(1.0 - share, abs=0.06)
    before = observed[round((AT_S - 1.0) * RATE_HZ)]
    assert before.visible_fraction > 0.98


def test_an_impossible_occlusion_is_an_error_with_the_reason():
    tree = walk("pillar", 0)
    tree["robot"] = {"route": {"kind": "trail", "distance_m": 3.5}}
    with pytest.raises(ScenarioError, match=r"occluders\.0.*walker"):
        truths(tree, 0)
