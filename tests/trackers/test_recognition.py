"""A memory of the target judges estimates, and starts a tracker again where it finds a lost target."""

import cv2
import numpy as np
import pytest

from pftrack_sim import trackers
from pftrack_sim.benchmark import TrackerSpec
from pftrack_sim.core.boxes import iou
from pftrack_sim.core.errors import PftrackError
from pftrack_sim.trackers.recognition.search import ALIKE_FRAMES, SEARCH_AFTER, SURE_FRAMES, Doubt
from pftrack_sim.trackers.registry import recognises
from tests.trackers.following import follow

SIZE = np.array([24.0, 60.0])


def image(x: float | None, other: float | None = None) -> np.ndarray:
    """A target of three colours with its left side at x, and another of other colours; the same ground always."""
    rng = np.random.default_rng(0)
    ground = cv2.resize(rng.integers(60, 120, (12, 16, 3), dtype=np.uint8), (320, 240), interpolation=cv2.INTER_CUBIC)
    for left, colours in ((x, ((230, 180, 150), (200, 30, 40), (30, 40, 160))), (other, ((90, 60, 40),) * 3)):
        for part, colour in enumerate(colours if left is not None else ()):
            top = 80 + 20 * part
            ground[top : top + 20, int(left or 0) : int(left or 0) + 24] = colour
    return ground


def box(x: float) -> np.ndarray:
    return np.array([x, 80.0, *SIZE])


def test_a_judge_changes_confidence_alone():
    frames = [image(100.0 + k) for k in range(12)] + [image(None)] * 6
    found = {use: follow("ncc", frames, box(100.0), recognition=use) for use in ("none", "judge")}
    for one, judged in zip(found["none"], found["judge"], strict=True):
        assert np.array_equal(one.box, judged.box)
    assert min(one.confidence for one in found["judge"][:11]) > 0.9
    assert max(one.confidence for one in found["judge"][12:]) < 0.2
    assert all(one.occluded for one in found["judge"][12:])


@pytest.mark.parametrize(("name", "alone"), [("ncc", False), ("lee2012", False), ("ko2012", True), ("kwon2005", True)])
def test_a_lost_target_is_found_where_it_comes_back(name: str, alone: bool):
    """It is away for a second, and comes back beside another; particles that spread may find it alone."""
    frames = [image(100.0)] * 8 + [image(None, 180.0)] * 15 + [image(230.0, 180.0)] * 12
    overlaps = {
        use: iou(follow(name, frames, box(100.0), recognition=use)[-1].box, box(230.0)) for use in ("none", "search")
    }
    assert (overlaps["none"] > 0.1) is alone
    assert overlaps["search"] > 0.6


def test_nothing_is_found_where_the_target_is_not():
    estimates = follow("ncc", [image(100.0)] + [image(None, 180.0)] * 30, box(100.0), recognition="search")
    assert all(iou(one.box, box(180.0)) == 0.0 for one in estimates)
    assert all(one.occluded for one in estimates)


def test_a_doubt_lasts_until_the_target_is_sure_or_alike_for_long():
    doubt = Doubt(0.8, 0.9)
    seen: list[bool] = []
    for likeness in [0.95] * 3 + [0.7] + [0.85] * 8 + [0.95] * SURE_FRAMES + [0.7] + [0.85] * ALIKE_FRAMES:
        doubt.see(likeness)
        seen.append(bool(doubt))
    assert seen == [False] * 3 + [True] * (8 + SURE_FRAMES) + [False] + [True] * ALIKE_FRAMES + [False]


def test_a_doubt_searches_at_intervals_after_a_while():
    doubt, due = Doubt(), []
    for frame in range(1, 14):
        doubt.see(0.0)
        if (attempt := doubt.search(SEARCH_AFTER)) is not None:
            due.append((frame, attempt))
    assert due == [(6, 0), (9, 1), (12, 2)]


def test_trackers_search_in_closed_loop():
    driven = TrackerSpec(name="ko2012", controller="servo-avoid")
    assert driven.arguments == {"recognition": "search"}
    assert driven.label == "ko2012+servo-avoid"
    assert TrackerSpec(name="ko2012").arguments == {}
    assert TrackerSpec(name="ko2012", preset="paper", controller="servo-avoid").arguments == {}
    chosen = {"recognition": "none", "particle_count": 50}
    assert TrackerSpec(name="ko2012", controller="servo-avoid", params=chosen).arguments == chosen
    assert TrackerSpec(name="pftrack", controller="servo-avoid").arguments == {}


@pytest.mark.parametrize("name", trackers.names())
def test_those_that_recognise_have_the_parameter(name: str):
    try:
        trackers.make(name, recognition="judge")
        known = True
    except PftrackError:
        known = False
    assert recognises(name) == known
