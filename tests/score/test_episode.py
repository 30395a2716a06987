"""Scores by hand."""

import dataclasses
import math
import warnings

import numpy as np
import pytest

from pftrack_sim import score
from pftrack_sim.core.errors import ParameterError

NAN = [math.nan] * 4
TRUTH = np.array([[0, 0, 10, 10], [0, 0, 10, 10], [0, 0, 10, 10], NAN, [0, 0, 10, 10], [0, 0, 10, 10]])
SAID = np.array([[0, 0, 10, 10], [5, 0, 10, 10], [0, 0, 10, 5], [0, 0, 10, 10], NAN, [100, 0, 10, 10]])
SCORED = np.array([True, True, True, False, True, True])
MS = [100.0, 1, 2, 3, 4, 5]


def test_overlaps_by_hand():
    assert np.allclose(score.frame_scores(SAID, TRUTH).overlap, [1, 1 / 3, 1 / 2, 0, 0, 0], rtol=0, atol=1e-12)


def test_no_overlap_is_above_one():
    box = [[55.57339453, 55.57339453, 1.0, 200.47253705]]
    assert score.frame_scores(box, box).overlap.tolist() == [1.0]


def test_centre_errors_by_hand():
    assert np.array_equal(
        score.frame_scores(SAID, TRUTH).centre_error_px, [0, 5, 2.5, math.nan, math.inf, 100], equal_nan=True
    )


def test_a_centre_is_inside_up_to_the_edge_of_the_true_box():
    truth = np.tile([10.0, 20.0, 40.0, 80.0], (5, 1))
    shifts = np.array([[0.0, 0.0], [20.0, 0.0], [20.5, 0.0], [0.0, -40.0], [0.0, -40.5]])
    estimates = np.concatenate([truth[:, :2] + shifts, truth[:, 2:]], axis=1)
    assert score.frame_scores(estimates, truth).centre_inside.tolist() == [True, True, False, True, False]


def test_summary_by_hand():
    summary = score.summarise(score.frame_scores(SAID, TRUTH), SCORED, MS)
    assert summary.frames == 4
    assert summary.mean_overlap == pytest.approx((1 / 3 + 1 / 2) / 4)
    assert (summary.success, summary.success_30) == (0.25, 0.5)  # an overlap of exactly 0.5 counts
    assert summary.centre_inside == 0.5  # a centre on the edge counts
    assert (summary.stay, summary.fixed_size) == (1.0, 1.0)
    assert math.isnan(summary.skill)
    assert summary.precision == 0.5
    assert summary.centre_error_median_px == pytest.approx((5 + 100) / 2)
    assert (summary.ms_median, summary.ms_max, summary.ms_max_frame) == (3, 5.0, 5)


def test_stay_and_fixed_size_follow_from_the_truth_by_hand():
    truth = np.array([NAN, [0, 0, 10, 10], [5, 0, 10, 10], [0, 0, 10, 20], [0, 0, 10, 25], NAN])
    scored = np.isfinite(truth[:, 0])
    perfect, missed = (
        score.summarise(score.frame_scores(said, truth), scored, MS) for said in (truth, SAID * math.nan)
    )
    assert perfect.stay == missed.stay == pytest.approx((1 / 3 + 1 / 2 + 10 / 25) / 3)
    assert perfect.fixed_size == missed.fixed_size == pytest.approx(2 / 3)
    assert perfect.skill == 1.0
    assert missed.skill == pytest.approx(-missed.stay / (1.0 - missed.stay))


def test_the_tracker_that_stays_has_the_skill_zero():
    truth = np.random.default_rng(0).uniform(10.0, 50.0, (20, 4))
    stay = score.summarise(score.frame_scores(np.tile(truth[0], (20, 1)), truth), np.ones(20, bool), np.ones(20))
    assert stay.mean_overlap == stay.stay
    assert stay.skill == 0.0


def test_the_given_box_does_not_count_even_when_it_comes_late():
    truth = np.array([NAN, NAN, [0, 0, 10, 10], [0, 0, 10, 10]])
    said = np.array([NAN, NAN, [0, 0, 10, 10], [0, 0, 10, 4]])
    summary = score.summarise(score.frame_scores(said, truth), [False, False, True, True], [1.0, 1, 50, 7])
    assert (summary.frames, summary.mean_overlap, summary.success_30, summary.ms_median) == (1, 0.4, 1.0, 7.0)


@pytest.mark.parametrize("scored", [[], [True], [False, False]])
def test_nothing_scored_is_nan_without_a_warning(scored: list[bool]):
    boxes = np.ones((len(scored), 4))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        summary = score.summarise(score.frame_scores(boxes, boxes), scored, np.ones(len(scored)))
    assert summary.frames == 0
    assert all(math.isnan(value) for key, value in dataclasses.asdict(summary).items() if key != "frames")


def test_arguments_are_not_edited():
    truth, said, scored = TRUTH.copy(), SAID.copy(), SCORED.copy()
    score.summarise(score.frame_scores(said, truth), scored, MS)
    assert np.array_equal(truth, TRUTH, equal_nan=True)
    assert np.array_equal(said, SAID, equal_nan=True)
    assert np.array_equal(scored, SCORED)


def test_shapes_that_do_not_fit_are_refused():
    with pytest.raises(ParameterError, match=r"\(2, 4\) and \(3, 4\)"):
        score.frame_scores(np.zeros((2, 4)), np.zeros((3, 4)))
    with pytest.raises(ParameterError, match="shape"):
        score.frame_scores(np.zeros(4), np.zeros(4))
    with pytest.raises(ParameterError, match="one number for each of 2 frames"):
        score.summarise(score.frame_scores(np.ones((2, 4)), np.ones((2, 4))), [True], [1.0])
    with pytest.raises(ParameterError, match=r"truth must be \(N, 4\) and scored \(N,\)"):
        score.stay_overlaps(np.ones((2, 4)), [True])


ALL_TRUE = np.tile([10.0, 10.0, 20.0, 40.0], (8, 1))
ALL_SAID = ALL_TRUE + np.array([0, 0, 2, 4, 100, 100, 5, 2])[:, None] * [1, 0, 0, 0]
VISIBLE = [1.0, 1.0, 1.0, 0.2, 0.0, 0.9, 1.0, 1.0]
SEEN = np.array(VISIBLE) > 0.0
TOOK_MS = [50.0, 1, 2, 3, 4, 5, 6, 7]
TIMES = np.arange(8) / 10.0


def row(ms: list[float] = TOOK_MS) -> score.Measures:
    return score.measure(score.frame_scores(ALL_SAID, ALL_TRUE), SEEN, VISIBLE, ms, TIMES)


def test_everything_agrees_with_the_parts():
    overlap = score.frame_scores(ALL_SAID, ALL_TRUE).overlap
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
    assert got.ms_p95 == pytest.approx(np.percentile(TOOK_MS[1:], 95))


def test_the_time_is_that_of_frames_with_an_answer():
    assert row([50.0, 1, 2, *[math.nan] * 5]).ms_median == 1.5
    unanswered = row([math.nan] * 8)
    assert all(math.isnan(one) for one in (unanswered.ms_median, unanswered.ms_max, unanswered.ms_max_frame))
    assert math.isnan(row([math.nan] * 8).ms_p95)


def test_a_tracker_that_never_answers():
    got = score.measure(score.frame_scores(np.full_like(ALL_SAID, math.nan), ALL_TRUE), SEEN, VISIBLE, TOOK_MS, TIMES)
    assert (got.mean_overlap, got.auc, got.normalised_precision, got.lost_for_good) == (0.0, 0.0, 0.0, 1.0)
    assert got.recovered == 0.0
    assert math.isnan(got.recovery_s)
    assert math.isnan(got.drift_per_s)


def test_nothing_to_see_is_nan():
    got = score.measure(score.frame_scores(ALL_SAID, ALL_TRUE), [False] * 8, [0.0] * 8, TOOK_MS, TIMES)
    assert got.frames == 0
    assert math.isnan(got.mean_overlap)


def test_times_must_rise():
    with pytest.raises(ParameterError, match="time_s"):
        score.measure(score.frame_scores(ALL_SAID, ALL_TRUE), SEEN, VISIBLE, TOOK_MS, np.zeros(8))
