"""HOG against known patterns and a reference implementation of the equations."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pftrack_sim.trackers.features.hog import CELL_COLUMNS, CELL_ROWS, COLUMNS, DIRECTION_COUNT, ROWS, SIZE, hog

WHOLE = np.array([[0.0, 0.0, COLUMNS, ROWS]])


def reference_hog(grey: np.ndarray, box: np.ndarray) -> tuple[np.ndarray, float]:
    """Equations 2 to 5, pixel by pixel in plain numpy.

    Returns:
        The descriptor, not normalised, and how near (in radians) the nearest gradient is to a border between bins.
    """
    x, y, w, h = box
    patch = np.empty((ROWS, COLUMNS))
    for i in range(ROWS):
        for j in range(COLUMNS):
            v = np.clip(y + (i + 0.5) * h / ROWS - 0.5, 0, grey.shape[0] - 1)
            u = np.clip(x + (j + 0.5) * w / COLUMNS - 0.5, 0, grey.shape[1] - 1)
            top, left = int(v), int(u)
            down, right = min(top + 1, grey.shape[0] - 1), min(left + 1, grey.shape[1] - 1)
            above = grey[top, left] * (1 - (u - left)) + grey[top, right] * (u - left)
            below = grey[down, left] * (1 - (u - left)) + grey[down, right] * (u - left)
            patch[i, j] = above * (1 - (v - top)) + below * (v - top)
    row = np.array([1, 4, 6, 4, 1]) / 16
    padded = np.pad(patch, 2, mode="edge")
    smooth = np.array(
        [[(padded[i : i + 5, j : j + 5] * np.outer(row, row)).sum() for j in range(COLUMNS)] for i in range(ROWS)]
    )
    padded = np.pad(smooth, 1, mode="edge")
    gx, gy = padded[1:-1, 2:] - padded[1:-1, :-2], padded[2:, 1:-1] - padded[:-2, 1:-1]
    angle = np.arctan2(gy, gx)
    angle = np.where(angle < 0, angle + 2 * np.pi, angle)
    turns = angle / (2 * np.pi / DIRECTION_COUNT)
    out = np.zeros((CELL_ROWS, CELL_COLUMNS, DIRECTION_COUNT))
    for i in range(ROWS):
        for j in range(COLUMNS):
            out[i // 4, j // 4, round(turns[i, j]) % DIRECTION_COUNT] += np.hypot(gx[i, j], gy[i, j])
    return out.ravel(), float(np.abs(turns % 1 - 0.5).min() * np.pi / 4)


@pytest.mark.slow
@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1), st.floats(-20, 60), st.floats(-20, 60), st.floats(1, 90), st.floats(1, 90))
def test_hog_agrees_with_a_reference_implementation(seed: int, x: float, y: float, w: float, h: float):
    grey = np.random.default_rng(seed).integers(0, 256, (55, 60), dtype=np.uint8)
    box = np.array([x, y, w, h])
    slow, margin = reference_hog(grey, box)
    found = hog(grey, box[None])[0]
    if slow.sum() < 1.0:  # a box wholly in one grey, but for rounding
        return
    # A gradient on the border between two directions may fall either way in single precision.
    tolerance = 1e-5 if margin > 1e-4 else 0.02
    assert np.allclose(found, slow / slow.sum(), rtol=0, atol=tolerance)


@pytest.mark.slow
def test_the_blur_is_that_of_opencv():
    """The descriptor of a patch equals that of the gradients of OpenCV's blur, cell by cell."""
    grey = np.random.default_rng(3).integers(0, 256, (ROWS, COLUMNS), dtype=np.uint8)
    kernel = np.array([1, 4, 6, 4, 1]) / 16
    smooth = cv2.sepFilter2D(grey.astype(np.float64), -1, kernel, kernel, borderType=cv2.BORDER_REPLICATE)
    gx = cv2.filter2D(smooth, -1, np.array([[-1.0, 0, 1]]), borderType=cv2.BORDER_REPLICATE)
    gy = cv2.filter2D(smooth, -1, np.array([[-1.0], [0], [1]]), borderType=cv2.BORDER_REPLICATE)
    lengths = np.hypot(gx, gy)
    cells = lengths.reshape(CELL_ROWS, 4, CELL_COLUMNS, 4).sum(axis=(1, 3)) / lengths.sum()
    found = hog(grey, WHOLE)[0].reshape(CELL_ROWS, CELL_COLUMNS, DIRECTION_COUNT).sum(axis=2)
    assert np.allclose(found, cells, rtol=0, atol=1e-6)


@pytest.mark.parametrize("direction", range(DIRECTION_COUNT))
def test_a_linear_gradient_has_one_direction(direction: int):
    angle = direction * np.pi / 4
    v, u = np.mgrid[:80, :80] - 40.0
    grey = np.round(127 + 2.0 * (u * np.cos(angle) + v * np.sin(angle))).astype(np.uint8)
    found = hog(grey, np.array([[16.0, 8, 48, 64]])).reshape(-1, DIRECTION_COUNT)
    # Repeating the edge of the box bends the gradients there; those of the inner cells are the slope's.
    inner = found.reshape(CELL_ROWS, CELL_COLUMNS, DIRECTION_COUNT)[1:-1, 1:-1]
    assert inner[..., direction].sum() > 0.99 * inner.sum()


def test_the_sides_of_a_bright_square_are_in_their_cells():
    grey = np.zeros((ROWS, COLUMNS), np.uint8)
    grey[8:16, 4:12] = 200
    found = hog(grey, WHOLE)[0].reshape(CELL_ROWS, CELL_COLUMNS, DIRECTION_COUNT)
    middle = slice(2, 4)
    sides = found.sum(axis=(0, 1))
    assert found[middle, :2, 0].sum() > 0.9 * sides[0]  # dark to bright towards the right: the left side
    assert found[middle, 2:, 4].sum() > 0.9 * sides[4]
    assert found[:3, 1:3, 2].sum() > 0.9 * sides[2]
    assert found[3:, 1:3, 6].sum() > 0.9 * sides[6]
    assert np.allclose(sides[[0, 2]], sides[[4, 6]], rtol=0, atol=1e-6)
    assert np.allclose(found, found[:, ::-1][..., [4, 3, 2, 1, 0, 7, 6, 5]], rtol=0, atol=1e-6)


def test_brightness_and_contrast_have_no_effect():
    grey = np.random.default_rng(1).integers(0, 100, (60, 60), dtype=np.uint8)
    box = np.array([[5.0, 6, 40, 44]])
    assert np.allclose(hog(grey, box), hog(2 * grey + 30, box), rtol=0, atol=1e-5)


def test_descriptors_sum_to_one_or_are_zero():
    grey = np.random.default_rng(1).integers(0, 255, (60, 60), dtype=np.uint8)
    boxes = np.array([[5.0, 6, 40, 44], [-500, 6, 40, 44], [50, 50, 300, 300], [10, 10, 0.5, 0.5]])
    found = hog(grey, boxes)
    assert found.shape == (4, SIZE)
    assert np.allclose(found.sum(axis=1)[[0, 2, 3]], 1, rtol=0, atol=1e-6)
    assert not hog(np.full((60, 60), 77, np.uint8), boxes).any()


def test_descriptors_are_invariant_to_whole_pixel_shifts():
    grey = np.random.default_rng(2).integers(0, 255, (90, 90), dtype=np.uint8)
    moved = np.roll(grey, (7, 5), axis=(0, 1))
    box = np.array([[20.25, 21.5, 33, 41]])
    assert np.allclose(hog(grey, box), hog(moved, box + np.array([5, 7, 0, 0])), rtol=0, atol=1e-5)
