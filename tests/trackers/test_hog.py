"""HOG against known patterns and OpenCV's filters."""

import cv2
import numpy as np
import pytest

from pftrack_sim.trackers.features.hog import CELL_COLUMNS, CELL_ROWS, COLUMNS, DIRECTION_COUNT, ROWS, SIZE, hog

WHOLE = np.array([[0.0, 0.0, COLUMNS, ROWS]])


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
