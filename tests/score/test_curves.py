"""Curves by hand, and against the toolkits' formulas written out."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pftrack_sim import score
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.score import curves

OVERLAP = [1.0, 0.5, 0.75, 0.0, 0.49, 0.51]


def test_success_counts_more_than_the_threshold():
    assert score.success_curve(OVERLAP, [0.0, 0.5, 0.75, 1.0]).tolist() == [5 / 6, 3 / 6, 1 / 6, 0.0]
    assert curves.success_rate(OVERLAP) == 4 / 6  # at least the threshold: the papers' share of tracked frames
    assert curves.average_overlap(OVERLAP) == pytest.approx(3.25 / 6)


def test_area_is_the_mean_over_21_thresholds():
    # 1.0 exceeds 20 of them, 0.5 ten, 0.75 fifteen, 0 none, 0.49 ten (0 ... 0.45), 0.51 eleven (0 ... 0.5).
    assert score.area_under_success(OVERLAP) == pytest.approx((20 + 10 + 15 + 0 + 10 + 11) / 6 / 21)


@given(st.lists(st.floats(0, 1), min_size=1, max_size=60))
def test_curves_agree_with_the_toolkits_formulas(values: list[float]):
    overlap, errors = np.array(values), 60 * np.array(values)
    # GOT-10k: np.greater(ious[:, None], linspace(0, 1, 21)).mean(0); np.less_equal(ces[:, None], arange(51)).mean(0).
    assert np.abs(score.success_curve(overlap) - (overlap[:, None] > np.linspace(0, 1, 21)).mean(axis=0)).max() < 1e-12
    assert np.abs(score.precision_curve(errors) - (errors[:, None] <= np.arange(51)).mean(axis=0)).max() < 1e-12
    # The area between the curve and 0 is the mean overlap, to the width of a step.
    assert abs(score.area_under_success(overlap) - overlap.mean()) < 0.051


def test_precision_counts_the_threshold_itself():
    assert score.precision_curve([0.0, 20.0, 20.1, math.inf, math.nan], [0.0, 20.0, 1e9]).tolist() == [0.2, 0.4, 0.6]


def test_normalised_error_is_in_sizes_of_the_box():
    truth = np.array([[0, 0, 10, 40], [0, 0, 10, 40], [0, 0, 10, 40], [math.nan] * 4, [0, 0, 0, 4]], dtype=float)
    said = np.array([[3, 0, 10, 40], [0, 16, 10, 40], [math.nan] * 4, [0, 0, 1, 1], [0, 0, 1, 1]], dtype=float)
    errors = score.frame_scores(said, truth).normalised_error
    assert np.array_equal(np.round(errors, 12), [0.3, 0.4, math.inf, math.nan, math.nan], equal_nan=True)
    # 0.3 is within 21 of the 51 thresholds 0 ... 0.5, 0.4 within 11, a miss within none.
    assert curves.normalised_precision(errors[:3] - 1e-9) == pytest.approx((21 + 11) / 3 / 51)


def test_nothing_to_score_is_nan():
    assert np.isnan(score.success_curve([])).all()
    assert math.isnan(score.area_under_success([]))
    assert math.isnan(curves.average_overlap([]))
    assert math.isnan(curves.normalised_precision([]))


def test_tables_are_refused():
    with pytest.raises(ParameterError, match="shape"):
        score.success_curve([[0.1, 0.2]])
    with pytest.raises(ParameterError, match=r"\(N, 4\)"):
        score.frame_scores([[0, 0, 1]], [[0, 0, 1]])
