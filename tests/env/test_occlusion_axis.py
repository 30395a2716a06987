"""The occlusion axis: in every scenario, the truth contains the requested occlusions, with their begin and duration."""

from typing import Any

import numpy as np
import observing
import pytest
from observing import CALM, PLACES, on_axis

from pftrack_sim.core.records import Truth
from pftrack_sim.scenario.axes import OcclusionAxis
from pftrack_sim.scene.occluders import axis_occluders

AT_S, RATE_HZ, FRAMES = 2.6, 30.0, 2
CLEAR: dict[str, Any] = {**CALM, "camera.width_px": 240, "camera.height_px": 180}
NEXT_TO_PILLARS_AT_S = 3.1
"""In the warehouse: the pillars of the place are not in the line of sight around this time."""


def truths(name: str, until_s: float, seed: int = 3, from_s: float = 0.0, **axis: Any) -> list[Truth]:
    """Truth of the target from a time on, with these keys of the axis."""
    return observing.truths(name, CLEAR | on_axis("occlusion", **axis), seed, from_s, until_s)


def assert_as_requested(observed: list[Truth], spans_s: tuple[tuple[float, float], ...], share: float):
    """Half covered and uncovered within two frames of the request; the requested share in between, nothing else."""
    times, fraction = np.array([(one.time_s, one.visible_fraction) for one in observed[1:]]).T
    covered = fraction < 1.0 - 0.5 * share
    ramp_s = 0.35
    clear = np.ones(len(times), dtype=bool)
    for begin_s, length_s in spans_s:
        requested = (times >= begin_s) & (times < begin_s + length_s)
        wide = (times >= begin_s - ramp_s) & (times < begin_s + length_s + ramp_s)
        hidden = times[covered & wide]
        assert hidden[0] == pytest.approx(begin_s, abs=(FRAMES + 0.5) / RATE_HZ)
        assert hidden[-1] == pytest.approx(begin_s + length_s - 1.0 / RATE_HZ, abs=(FRAMES + 0.5) / RATE_HZ)
        assert len(hidden) == pytest.approx(requested.sum(), abs=2 * FRAMES)
        inner = (times >= begin_s + ramp_s) & (times < begin_s + length_s - ramp_s)
        assert np.abs(fraction[inner] - (1.0 - share)).max() <= 0.1
        clear &= ~wide
    assert (fraction[clear] > 0.9).all()


@pytest.mark.parametrize("name", PLACES)
@pytest.mark.parametrize("kind", ["pillar", "wall", "stranger", "lookalike"])
def test_occlusions_are_equal_in_every_scenario(name: str, kind: str):
    at_s = NEXT_TO_PILLARS_AT_S if name == "easy/warehouse" else AT_S
    share = 0.5 if kind == "wall" else 1.0
    observed = truths(name, at_s + 1.5, from_s=at_s - 0.5, kind=kind, duration_s=1.0, end_s=at_s + 1.0, share=share)
    assert_as_requested(observed, ((at_s, 1.0),), share)
    middle = observed[round(1.0 * RATE_HZ)]
    assert middle.occluders[0] == {"pillar": "cabinet-1", "wall": "cart-1"}.get(kind, "crosser-1")


@pytest.mark.parametrize("share", [0.3, 0.7])
def test_a_low_cart_covers_the_requested_share(share: float):
    observed = truths(
        "easy/corridor", AT_S + 1.4, from_s=AT_S - 0.4, kind="wall", duration_s=1.0, end_s=AT_S + 1.0, share=share
    )
    assert_as_requested(observed, ((AT_S, 1.0),), share)


def test_severity_scales_the_duration_of_successive_occlusions():
    axis = OcclusionAxis(severity=1.6, duration_s=0.5, count=2, every_s=2.0, end_s=3.2)
    assert np.array(axis.spans_s) == pytest.approx(np.array([(2.4, 0.8), (4.4, 0.8)]))
    given = axis.model_dump()
    observed = truths("easy/plaza-walk", 5.8, from_s=1.9, **given)
    assert_as_requested(observed, axis.spans_s, 1.0)
    assert {one.occluders[0] for one in observed if one.visible_fraction < 0.2} == {"cabinet-1", "cabinet-2"}


def test_without_a_gap_one_occlusion_begins_as_the_other_ends():
    observed = truths("easy/corridor", 4.4, from_s=1.8, count=2, every_s=0.8, duration_s=0.8, end_s=3.2)
    times, fraction = np.array([(one.time_s, one.visible_fraction) for one in observed]).T
    hidden = times[fraction < 0.5]
    assert hidden[0] == pytest.approx(2.4, abs=(FRAMES + 0.5) / RATE_HZ)
    assert hidden[-1] == pytest.approx(4.0 - 1.0 / RATE_HZ, abs=(FRAMES + 0.5) / RATE_HZ)
    # Both edges are on the target's centre line at once: most of the target is always covered.
    assert fraction[(times > 2.75) & (times < 3.65)].max() < 0.5


@pytest.mark.parametrize("kind", ["pillar", "stranger"])
def test_what_follows_the_end_is_the_same_at_every_severity(kind: str):
    common = {"kind": kind, "end_s": 3.0, "from_s": 2.8}
    short, long = (truths("easy/corridor", 4.0, severity=severity, **common)[1:] for severity in (0.5, 2.0))
    boxes = [[one.box.tolist() for one in arm if one.time_s >= 3.0] for arm in (short, long)]
    assert boxes[0] == boxes[1]
    assert len(boxes[0]) >= 29


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"severity": 7.0}, "would begin before 0 s"),
        ({"severity": 2.0, "count": 2, "every_s": 1.5}, "at least the 2.6 s"),
    ],
)
def test_covers_that_do_not_fit_are_refused(given: dict[str, Any], words: str):
    with pytest.raises(ValueError, match=words):
        OcclusionAxis(**given)


def test_without_occlusions_the_truth_is_the_base_to_the_bit():
    assert truths("easy/plaza-walk", 0.3, count=0) == truths("easy/plaza-walk", 0.3, severity=0.0)


@pytest.mark.parametrize(
    "route",
    [
        {"kind": "still", "start_m": [7.0, -5.0], "heading_deg": 90.0},
        {"kind": "waypoints", "points_m": [[3.0, -2.5], [20.0, -2.5]], "speed_m_s": 1.0},
        {"kind": "beside", "distance_m": 3.0, "side": "left", "lead_m": -0.5},
    ],
    ids=lambda route: route["kind"],
)
def test_occlusions_are_equal_on_every_route(route: dict[str, Any]):
    axis = on_axis("occlusion", kind="pillar", duration_s=1.0, end_s=AT_S + 1.0)
    overrides = {**CLEAR, **axis, "robot.route": route, "place.clutter": 0.0}
    observed = observing.truths("easy/plaza-walk", overrides, 3, AT_S - 0.5, AT_S + 1.5)
    assert_as_requested(observed, ((AT_S, 1.0),), 1.0)


def test_a_lookalike_wears_the_targets_clothes_and_a_stranger_others():
    for kind, similarity in (("lookalike", 1.0), ("stranger", 0.0)):
        (walker,) = axis_occluders(OcclusionAxis.model_validate({"kind": kind, "severity": 1.0}))
        assert walker.similarity == similarity
