"""Episodes on the same frames, by hand."""

import numpy as np

from pftrack_sim.score import Arm, overlaps_on_common_frames

TIMES = np.arange(6) / 10.0
FULL = Arm(TIMES, np.array([1.0, 0.9, 0.8, 0.2, 0.1, 0.0]), np.array([False, True, True, True, True, True]))


def test_frames_that_one_arm_lacks_count_in_none():
    # Without them the second arm would seem better than the first.
    covered = Arm(TIMES, np.array([1.0, 0.9, 0.8, 0.2, 0.0, 0.0]), np.array([False, True, True, False, False, False]))
    assert overlaps_on_common_frames([FULL, covered]).tolist() == [0.8500000000000001] * 2


def test_only_frames_after_the_event_count():
    assert overlaps_on_common_frames([FULL], 0.3).tolist() == [np.mean([0.2, 0.1, 0.0])]


def test_a_delivered_frame_counts_until_the_next():
    some = [0, 1, 4]
    lossy = Arm(TIMES[some], np.array([1.0, 0.9, 0.1]), np.array([False, True, True]))
    full, held = overlaps_on_common_frames([FULL, lossy])
    assert full == np.mean(FULL.overlap[1:])
    assert held == np.mean([0.9, 0.9, 0.9, 0.1, 0.1])


def test_after_the_end_of_an_episode_nothing_is_held():
    ended = Arm(TIMES[:3], FULL.overlap[:3], FULL.counted[:3])
    assert overlaps_on_common_frames([FULL, ended])[0] == np.mean(FULL.overlap[1:4])


def test_without_a_common_frame_there_is_no_mean():
    other = Arm(TIMES, FULL.overlap, ~FULL.counted)
    assert np.isnan(overlaps_on_common_frames([FULL, other])).all()
