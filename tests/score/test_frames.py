"""A box that keeps its shape, and episodes on the same frames, by hand."""

import numpy as np
import pytest

from pftrack_sim.core.errors import ParameterError
from pftrack_sim.score import Arm, frame_scores, overlaps_on_common_frames
from pftrack_sim.score.frames import fixed_size_overlaps, misread_boxes

RNG = np.random.default_rng(5)
BOXES = np.column_stack([RNG.uniform(0, 400, (200, 2)), RNG.uniform(30, 90, 200), RNG.uniform(100, 130, 200)])
SEEN = np.ones(200, dtype=bool)


def test_no_box_of_the_first_shape_overlaps_more():
    best = fixed_size_overlaps(BOXES, SEEN)
    for _ in range(20):
        centres = BOXES[:, :2] + 0.5 * BOXES[:, 2:] + RNG.normal(0.0, 10.0, (200, 2))
        estimates = np.column_stack([centres - 0.5 * BOXES[0, 2:], np.tile(BOXES[0, 2:], (200, 1))])
        assert (frame_scores(estimates, BOXES).overlap <= best + 1e-12).all()
    moving = BOXES.copy()
    moving[:, 2:] = moving[0, 2:]
    assert fixed_size_overlaps(moving, SEEN) == pytest.approx(1.0)


def test_scale_and_place_of_the_boxes_do_not_matter():
    moved = 3.0 * BOXES + np.array([7.0, -40.0, 0.0, 0.0])
    assert fixed_size_overlaps(moved, SEEN) == pytest.approx(fixed_size_overlaps(BOXES, SEEN))


def test_the_first_visible_frame_gives_the_shape():
    late = np.concatenate([np.full((3, 4), np.nan), BOXES, np.zeros((2, 4))])
    scored = np.concatenate([[False] * 3, SEEN, [False] * 2])
    assert np.array_equal(fixed_size_overlaps(late, scored)[3:-2], fixed_size_overlaps(BOXES, SEEN))
    assert not fixed_size_overlaps(BOXES, ~SEEN).any()
    with pytest.raises(ParameterError, match=r"\(200, 4\) and \(3,\)"):
        fixed_size_overlaps(BOXES, [True] * 3)


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


CONVENTIONS = {
    "x, y, w, h": lambda x, y, w, h: [x, y, w, h],
    "corners x1, y1, x2, y2": lambda x, y, w, h: [x, y, x + w, y + h],
    "centre x, centre y, w, h": lambda x, y, w, h: [x + w / 2, y + h / 2, w, h],
    "y, x, h, w": lambda x, y, w, h: [y, x, h, w],
    "shares of the image's sides": lambda x, y, w, h: [x / 320, y / 240, w / 320, h / 240],
}


@pytest.mark.parametrize("name", CONVENTIONS)
def test_boxes_in_another_convention_are_told_from_wrong_ones(name: str):
    truth = np.array([[80.0 + k, 60.0, 30.0, 90.0] for k in range(12)])
    answered = np.array([CONVENTIONS[name](*box) for box in truth + 2.0])
    said = misread_boxes(answered, truth, (320, 240))
    assert said is None if name == "x, y, w, h" else f"if they are {name}," in str(said)
    assert misread_boxes(truth + 200.0, truth, (320, 240)) is None, "wrong in every convention"
    assert misread_boxes(np.full((3, 4), np.nan), truth[:3], (320, 240)) is None
    assert misread_boxes(np.tile([-1e308, -1e308, 1e308, 1e308], (3, 1)), truth[:3], (320, 240)) is None
