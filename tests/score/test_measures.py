"""One row per episode, from the frames."""

import math

import numpy as np
import pytest

from pftrack_sim import score
from pftrack_sim.core.errors import ParameterError

TRUTH = np.tile([10.0, 10.0, 20.0, 40.0], (8, 1))
SAID = TRUTH + np.array([0, 0, 2, 4, 100, 100, 5, 2])[:, None] * [1, 0, 0, 0]
VISIBLE = [1.0, 1.0, 1.0, 0.2, 0.0, 0.9, 1.0, 1.0]
SCORED = np.array(VISIBLE) > 0.0
MS = [50.0, 1, 2, 3, 4, 5, 6, 7]
TIMES = np.arange(8) / 10.0


def row(ms: list[float] = MS) -> score.Measures:
    return score.measure(score.frame_scores(SAID, TRUTH), SCORED, VISIBLE, ms, TIMES)


def test_everything_agrees_with_the_parts():
    overlap = score.frame_scores(SAID, TRUTH).overlap
    counted = np.array([False, True, True, True, False, True, True, True])
    got = row()
    assert got.frames == 6
    assert got.mean_overlap == pytest.approx(overlap[counted].mean())
    assert got.auc == score.area_under_success(overlap[counted])
    assert (got.sr_50, got.sr_75) == (5 / 6, 3 / 6)
    assert (got.occlusions, got.recovered, got.recovery_s) == (1, 1.0, pytest.approx(0.1))
    assert got.recovered_2s == 1.0
    assert got.lost_for_good == 0.0
    assert got.drift_per_s == pytest.approx(1.0)  # 0, 2 and 4 px of 20 in tenths of a second
    assert got.ms_median == 4.0
    assert got.ms_p95 == pytest.approx(np.percentile(MS[1:], 95))


def test_the_time_is_that_of_frames_with_an_answer():
    assert row([50.0, 1, 2, *[math.nan] * 5]).ms_median == 1.5
    unanswered = row([math.nan] * 8)
    assert all(math.isnan(one) for one in (unanswered.ms_median, unanswered.ms_max, unanswered.ms_max_frame))
    assert math.isnan(row([math.nan] * 8).ms_p95)


def test_a_tracker_that_never_answers():
    got = score.measure(score.frame_scores(np.full_like(SAID, math.nan), TRUTH), SCORED, VISIBLE, MS, TIMES)
    assert (got.mean_overlap, got.auc, got.normalised_precision, got.lost_for_good) == (0.0, 0.0, 0.0, 1.0)
    assert got.recovered == 0.0
    assert math.isnan(got.recovery_s)
    assert math.isnan(got.drift_per_s)


def test_nothing_to_see_is_nan():
    got = score.measure(score.frame_scores(SAID, TRUTH), [False] * 8, [0.0] * 8, MS, TIMES)
    assert got.frames == 0
    assert math.isnan(got.mean_overlap)


def test_times_must_rise():
    with pytest.raises(ParameterError, match="time_s"):
        score.measure(score.frame_scores(SAID, TRUTH), SCORED, VISIBLE, MS, np.zeros(8))
