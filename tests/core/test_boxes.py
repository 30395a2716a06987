"""Boxes: what is one, and the laws of overlap."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pftrack_sim.core import boxes
from pftrack_sim.core.errors import BoxError

place, size = st.floats(-200, 200), st.floats(0.01, 300)
box = st.tuples(place, place, size, size).map(np.array)
pixel_box = st.tuples(st.integers(0, 15), st.integers(0, 11), st.integers(1, 9), st.integers(1, 9))


@given(box, box)
def test_overlap_is_symmetric_and_in_range(one: np.ndarray, other: np.ndarray):
    forth = boxes.iou(one, other)
    assert 0 <= forth <= 1
    assert abs(forth - boxes.iou(other, one)) < 1e-12
    assert abs(boxes.iou(one, one) - 1) < 1e-9


@given(box, box, st.floats(0.1, 10), place, place)
def test_overlap_does_not_know_scale_or_place(one: np.ndarray, other: np.ndarray, scale: float, dx: float, dy: float):
    def moved(some: np.ndarray) -> np.ndarray:
        return (some + np.array([dx, dy, 0, 0])) * scale

    assert abs(boxes.iou(one, other) - boxes.iou(moved(one), moved(other))) < 1e-6


@given(pixel_box, pixel_box)
def test_overlap_agrees_with_counted_pixels(one: tuple[int, ...], other: tuple[int, ...]):
    masks = []
    for x, y, w, h in (one, other):
        mask = np.zeros((24, 28), bool)
        mask[y : y + h, x : x + w] = True
        masks.append(mask)
    counted = (masks[0] & masks[1]).sum() / (masks[0] | masks[1]).sum()
    assert abs(boxes.iou(one, other) - counted) < 1e-12


def test_overlap_of_what_is_no_box_is_zero():
    good = [0, 0, 5, 5]
    for bad in ([np.nan] * 4, [0, 0, np.inf, 5], [0, 0, 0, 0], [0, 0, -5, -5]):
        assert boxes.iou(good, bad) == boxes.iou(bad, good) == 0
    assert boxes.iou([0, 0, 0, 0], [0, 0, 0, 0]) == 0


@given(box, st.integers(1, 300), st.integers(1, 300))
def test_clip_is_the_part_inside(some: np.ndarray, width: int, height: int):
    x, y, w, h = boxes.clip(some, width, height)
    assert x >= 0 <= y
    assert x + w <= width + 1e-9
    assert y + h <= height + 1e-9
    assert w >= 0 <= h
    assert np.allclose(boxes.clip([x, y, w, h], width, height), [x, y, w, h], rtol=0, atol=1e-9)
    part = boxes.iou(some, [0, 0, width, height])
    union = boxes.area(some) + width * height - w * h
    assert abs(part * union - w * h) < 1e-6 * max(1.0, union)


def test_area_and_centre():
    assert boxes.area([3, 4, 5, 6]) == 30
    assert boxes.area([0, 0, -1, -1]) == boxes.area([np.nan] * 4) == boxes.area([0, 0, np.inf, 1]) == 0
    assert boxes.centre([1, 2, 10, 20]).tolist() == [6, 12]


def test_checked_gives_a_copy():
    given_box = np.array([1.0, 2, 3, 4])
    copy = boxes.checked(given_box)
    copy[0] = 9
    assert given_box[0] == 1
    assert boxes.checked((1, 2, 0, 0)).tolist() == [1, 2, 0, 0]


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        ([1, 2, 3], "shape"),
        ([[1, 2, 3, 4]], "shape"),
        ("box", "four numbers"),
        ([1, 2, "w", 4], "four numbers"),
        (None, "four numbers"),
        ([1, 2, np.nan, 4], "finite"),
        ([1, 2, -3, 4], "w=-3"),
        ([1 + 2j, 2, 3, 4], "four numbers"),
        (np.array([1 + 2j, 2, 3, 4]), "four numbers"),
        (["1", "2", "3", "4"], "four numbers"),
        ([True, 1, 5, 5], "four numbers"),
        ((1, 2.5, np.True_, 5), "four numbers"),
        (np.array([True, True, True, True]), "four numbers"),
        (np.ma.masked_array([1.0, 2.0, 3.0, 4.0], [False, True, False, False]), "four numbers"),
    ],
)
def test_checked_refuses_what_is_no_box(bad: Any, words: str):
    with pytest.raises(BoxError, match=words):
        boxes.checked(bad)


def test_the_shared_constant_cannot_be_edited():
    with pytest.raises(ValueError, match="read-only"):
        boxes.NO_BOX[0] = 1


def test_the_overlap_of_two_boxes_is_that_of_many_to_the_bit():
    rng = np.random.default_rng(0)
    first, second = (rng.normal(20.0, 30.0, (500, 4)) for _ in range(2))
    second[::7] = first[::7]
    first[3], first[5, 2], second[8, 0], second[9, 2:] = 0.0, np.nan, np.inf, 0.0
    many = boxes.pairwise_iou(first, second).tolist()
    assert [boxes.iou(one, other) for one, other in zip(first, second, strict=True)] == many
    assert 50 < np.count_nonzero(many) < 500
