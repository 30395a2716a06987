"""The reference trackers."""

import numpy as np
import pytest

from pftrack_sim import trackers
from pftrack_sim.core.errors import TrackerError

IMAGE = np.zeros((60, 80, 3), np.uint8)
BOX = np.array([10.5, 10, 20, 30])


def test_stay_repeats_the_first_box():
    tracker = trackers.make("stay")
    tracker.init(IMAGE, BOX)
    assert [tracker.update(IMAGE).box.tolist() for _ in range(3)] == [BOX.tolist()] * 3


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


def test_oracle_returns_the_truth():
    tracker = trackers.make("oracle")
    assert isinstance(tracker, trackers.NeedsTruth)
    tracker.init(IMAGE, BOX)
    assert tracker.update(IMAGE).box.tolist() == BOX.tolist()
    moved = np.array([-5.0, 12, 18, 31])
    tracker.receive_truth(moved, 1.0)
    moved += 100  # it keeps no reference
    assert tracker.update(IMAGE).box.tolist() == [-5.0, 12, 18, 31]


@pytest.mark.parametrize("gone", [[np.nan] * 4, [5.0, 5, 0, 0], [5.0, 5, 0, 9], [np.inf, 1, 2, 3]])
def test_oracle_repeats_the_last_box_without_a_target(gone: list[float]):
    tracker = trackers.make("oracle")
    assert isinstance(tracker, trackers.NeedsTruth)
    tracker.init(IMAGE, BOX)
    tracker.receive_truth(np.array([1.0, 2, 3, 4]), 1.0)
    tracker.receive_truth(np.array(gone), 0.0)
    assert tracker.update(IMAGE).box.tolist() == [1, 2, 3, 4]


def test_init_resets_the_oracle():
    tracker = trackers.make("oracle")
    assert isinstance(tracker, trackers.NeedsTruth)
    tracker.receive_truth(np.array([1.0, 2, 3, 4]), 1.0)
    tracker.init(IMAGE, BOX)
    assert tracker.update(IMAGE).box.tolist() == BOX.tolist()


def test_the_visible_oracle_reports_an_occlusion_while_less_than_a_tenth_is_visible():
    tracker = trackers.make("oracle-visible")
    assert isinstance(tracker, trackers.NeedsTruth)
    tracker.init(IMAGE, BOX)
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
