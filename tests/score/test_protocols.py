"""Scores of public benchmarks: cases worked out by hand, and laws. `tests/benchmark/test_toolkits.py` has the tools."""

import numpy as np
import pytest

from pftrack_sim.core.errors import ParameterError
from pftrack_sim.score.protocols import PROTOCOLS, TrackedSequence, from_anchors, got10k, otb, raster_overlaps, vot

SIZE = (100, 80)
NAN = [np.nan] * 4


def sequence(estimates: list[list[float]], truth: list[list[float]]) -> TrackedSequence:
    return TrackedSequence(np.array(estimates, dtype=float), np.array(truth, dtype=float), SIZE)


def random_sequence(seed: int, count: int = 40) -> TrackedSequence:
    rng = np.random.default_rng(seed)
    truth = np.column_stack([rng.uniform(0, 60, (count, 2)), rng.uniform(4, 20, (count, 2))])
    estimates = truth + rng.normal(0, 3, truth.shape)
    estimates[:, 2:] = np.abs(estimates[:, 2:])
    truth[10:13], estimates[20] = np.nan, np.nan
    return TrackedSequence(estimates, truth, SIZE)


@pytest.mark.parametrize("name", PROTOCOLS)
def test_true_boxes_score_as_high_as_the_scorer_allows(name: str):
    one = random_sequence(0)
    perfect = PROTOCOLS[name]([TrackedSequence(one.truth, one.truth, SIZE)])
    best = {"success": 37 / 40 * 20 / 21, "precision": 37 / 40, "success_50": 37 / 40, "tracked_accuracy": 36 / 37}
    best["robustness"] = 36 / 37
    for measure, value in perfect.items():
        assert value == pytest.approx(best.get(measure, 1.0)), measure


@pytest.mark.parametrize("name", PROTOCOLS)
def test_missing_every_frame_scores_nothing(name: str):
    truth = random_sequence(1).truth[:10]
    missed = PROTOCOLS[name]([TrackedSequence(np.full_like(truth, np.nan), truth, SIZE)])
    given = {"success": 0.1 * 20 / 21, "precision": 0.1, "success_50": 0.1}
    assert missed == pytest.approx({measure: given.get(measure, 0.0) for measure in missed})


def test_got10k_clips_both_boxes_and_counts_frames_not_sequences():
    truth = [[0, 0, 10, 10]] * 3
    # The third estimate lies half outside the image; clipped it is the truth, whose size it keeps.
    one = sequence([[0, 0, 10, 10], [50, 50, 5, 5], [-10, 0, 10, 10]], truth)
    other = sequence([[0, 0, 1, 1], *[[0, 0, 10, 10]] * 4], [[0, 0, 10, 10]] * 5)
    assert got10k([one]) == {"ao": 0.5, "sr_50": 0.5, "sr_75": 0.5}
    assert got10k([one, other])["ao"] == pytest.approx(5 / 6)


def test_otb_is_the_mean_of_sequences_and_gives_the_first_box():
    one = sequence([NAN, [0, 0, 10, 10]], [[5, 5, 10, 10], [0, 0, 10, 10]])
    other = sequence([NAN] * 4, [[5, 5, 10, 10]] * 4)
    assert otb([one])["success_50"] == 1.0
    assert otb([one, other])["success_50"] == pytest.approx((1 + 0.25) / 2)


def test_vot_weights_accuracy_by_length_and_rewards_a_miss_of_an_absent_target():
    one = sequence([NAN, [0, 0, 10, 10], NAN], [[5, 5, 10, 10], [0, 0, 10, 10], NAN])
    other = sequence([NAN] * 6, [[5, 5, 10, 10]] * 6)
    assert vot([one])["accuracy"] == 1.0
    assert vot([one, other])["accuracy"] == pytest.approx(3 / 9)
    assert vot([one, other])["robustness"] == pytest.approx(0.25)


def test_runs_from_anchors_end_at_the_failure():
    whole, lost = np.full(31, 0.8), np.concatenate([np.full(11, 0.6), np.full(20, 0.1)])
    once = from_anchors([[whole]], (20, 31))
    assert once == pytest.approx({"accuracy": 0.8 * 30 / 31, "robustness": 1.0, "eao": 0.8})
    found = from_anchors([[whole, lost]], (20, 21))
    assert found["accuracy"] == pytest.approx((0.8 * 30 + 0.6 * 10) / 42)
    assert found["robustness"] == pytest.approx(42 / 62)
    assert found["eao"] == pytest.approx((0.8 + 0.6 * 10 / 20) / 2)
    assert from_anchors([[np.zeros(12)]], (1, 5)) == from_anchors([[np.full(12, 0.05)]], (1, 5))
    # Nine frames are no failure, and a short run says nothing of longer ones.
    assert from_anchors([[np.zeros(9)]], (1, 9))["robustness"] == 1.0
    assert from_anchors([[whole, np.full(9, 0.2)]], (20, 31))["eao"] == pytest.approx(0.8)


@pytest.mark.parametrize("seed", range(5))
def test_raster_overlap_is_that_of_drawn_masks(seed: int):
    rng = np.random.default_rng(seed)
    boxes = np.column_stack([rng.uniform(-20, 90, (60, 2)), rng.uniform(2, 40, (60, 2))])
    masks = np.zeros((60, SIZE[1], SIZE[0]), dtype=bool)
    for mask, box in zip(masks, np.round(boxes).astype(int), strict=True):
        x, y, w, h = box.tolist()
        mask[max(y, 0) : max(y + h, 0), max(x, 0) : max(x + w, 0)] = True
    first, second = masks[:30], masks[30:]
    union = (first | second).sum(axis=(1, 2))
    expected = np.where(union > 0, (first & second).sum(axis=(1, 2)) / np.maximum(union, 1), 0.0)
    np.testing.assert_allclose(raster_overlaps(boxes[:30], boxes[30:], SIZE), expected, atol=1e-12)


def test_raster_overlap_of_nothing():
    boxes = np.array([NAN, NAN, [0, 0, 10, 10]])
    assert raster_overlaps(boxes, np.array([NAN, [5, 5, 9, 9], NAN]), SIZE).tolist() == [1, 0, 0]
    # Halves are rounded to even numbers: 10.5 is 10, 11.5 is 12.
    assert raster_overlaps(np.array([[10.5, 0, 4, 4]]), np.array([[10, 0, 4, 4]]), SIZE).tolist() == [1]
    assert raster_overlaps(np.array([[11.5, 0, 4, 4]]), np.array([[12, 0, 4, 4]]), SIZE).tolist() == [1]


def test_boxes_that_do_not_fit_are_refused():
    with pytest.raises(ParameterError, match="no frame has a true box"):
        sequence([NAN], [NAN])
    with pytest.raises(ParameterError, match=r"must both be \(N, 4\)"):
        sequence([NAN], [[0, 0, 1, 1]] * 2)
