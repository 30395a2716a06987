"""Ceilings of the scores of trackers whose box keeps its shape."""

import numpy as np
import pytest

from pftrack_sim.core.errors import ParameterError
from pftrack_sim.score import frame_scores
from pftrack_sim.score.reference import fixed_shape_ceiling

RNG = np.random.default_rng(5)
BOXES = np.column_stack([RNG.uniform(0, 400, (200, 2)), RNG.uniform(30, 90, 200), RNG.uniform(100, 130, 200)])
SEEN = np.ones(200, dtype=bool)


def test_a_box_that_keeps_its_shape_reaches_everything():
    moving = BOXES.copy()
    moving[:, 2:] = moving[0, 2:]
    ceiling = fixed_shape_ceiling(moving, SEEN)
    assert ceiling.mean_overlap == pytest.approx(1.0)
    assert ceiling.success == 1.0
    assert ceiling.frames == 199


def test_no_box_of_the_first_shape_overlaps_more():
    best = fixed_shape_ceiling(BOXES, SEEN).mean_overlap
    for _ in range(20):
        centres = BOXES[:, :2] + 0.5 * BOXES[:, 2:] + RNG.normal(0.0, 10.0, (200, 2))
        estimates = np.column_stack([centres - 0.5 * BOXES[0, 2:], np.tile(BOXES[0, 2:], (200, 1))])
        assert frame_scores(estimates, BOXES).overlap[1:].mean() <= best


def test_scale_and_place_of_the_boxes_do_not_matter():
    moved = 3.0 * BOXES + np.array([7.0, -40.0, 0.0, 0.0])
    assert fixed_shape_ceiling(moved, SEEN).mean_overlap == pytest.approx(fixed_shape_ceiling(BOXES, SEEN).mean_overlap)


def test_frames_without_the_target_are_left_out_and_the_first_visible_one_gives_the_shape():
    late = np.concatenate([np.full((3, 4), np.nan), BOXES, np.zeros((2, 4))])
    scored = np.concatenate([[False] * 3, SEEN, [False] * 2])
    assert fixed_shape_ceiling(late, scored) == fixed_shape_ceiling(BOXES, SEEN)


def test_a_target_seen_once_or_never_has_no_ceiling():
    for scored in (np.zeros(200, dtype=bool), np.arange(200) == 4):
        ceiling = fixed_shape_ceiling(BOXES, scored)
        assert ceiling.frames == 0
        assert np.isnan([ceiling.mean_overlap, ceiling.success]).all()


def test_lengths_must_agree():
    with pytest.raises(ParameterError, match=r"\(200, 4\) and \(3,\)"):
        fixed_shape_ceiling(BOXES, [True] * 3)
