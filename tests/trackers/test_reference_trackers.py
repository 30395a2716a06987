"""The reference trackers."""

import numpy as np
import pytest

from pftrack_sim import trackers
from pftrack_sim.core.errors import TrackerError
from pftrack_sim.trackers.reference import Oracle
from tests.trackers.following import followed_boxes

IMAGE = np.zeros((60, 80, 3), np.uint8)
BOX = np.array([10.5, 10, 20, 30])


def test_stay_repeats_the_first_box():
    assert followed_boxes("stay", [IMAGE] * 4, BOX).tolist() == [BOX.tolist()] * 3


def test_only_the_oracles_need_the_truth():
    receivers: list[str] = []
    for name in trackers.names():
        try:
            tracker = trackers.make(name)
        except TrackerError:
            continue  # it needs model files or another wheel
        if isinstance(tracker, trackers.NeedsTruth):
            receivers.append(name)
    assert receivers == ["oracle", "oracle-visible"]


def started(name: str) -> Oracle:
    tracker = trackers.make(name)
    assert isinstance(tracker, Oracle)
    tracker.init(IMAGE, BOX)
    return tracker


def test_oracle_returns_the_truth():
    tracker = started("oracle")
    assert tracker.update(IMAGE).box.tolist() == BOX.tolist()
    moved = np.array([-5.0, 12, 18, 31])
    tracker.receive_truth(moved, 1.0)
    moved += 100  # it keeps no reference
    assert tracker.update(IMAGE).box.tolist() == [-5.0, 12, 18, 31]


@pytest.mark.parametrize("gone", [[np.nan] * 4, [5.0, 5, 0, 0], [5.0, 5, 0, 9], [np.inf, 1, 2, 3]])
def test_oracle_repeats_the_last_box_without_a_target(gone: list[float]):
    tracker = started("oracle")
    tracker.receive_truth(np.array([1.0, 2, 3, 4]), 1.0)
    tracker.receive_truth(np.array(gone), 0.0)
    assert tracker.update(IMAGE).box.tolist() == [1, 2, 3, 4]


def test_init_resets_the_oracle():
    tracker = started("oracle")
    tracker.receive_truth(np.array([1.0, 2, 3, 4]), 1.0)
    tracker.init(IMAGE, BOX)
    assert tracker.update(IMAGE).box.tolist() == BOX.tolist()


def test_the_visible_oracle_reports_an_occlusion_while_less_than_a_tenth_is_visible():
    tracker = started("oracle-visible")
    seen, hidden = np.array([1.0, 2, 3, 4]), np.array([5.0, 6, 7, 8])
    for box, fraction, expected in (
        (seen, 0.1, (seen, 1.0)),
        (hidden, 0.09, (seen, 0.0)),
        (hidden, 0.5, (hidden, 1.0)),
    ):
        tracker.receive_truth(box, fraction)
        estimate = tracker.update(IMAGE)
        assert (estimate.box.tolist(), estimate.confidence) == (expected[0].tolist(), expected[1])
        assert estimate.occluded == (fraction < 0.1)
