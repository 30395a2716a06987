"""Downsampled regions of an image."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pftrack_sim.trackers.features.image_region import block_means, block_size, shrink


@pytest.mark.parametrize("block", [(3.0, 3.0), (1.0, 2.0), (1.0, 1.0)])
def test_whole_blocks_are_means_and_boxes_map_back(block: tuple[float, float]):
    image = np.random.default_rng(0).integers(0, 256, (200, 180, 3), dtype=np.uint8)
    box = np.array([41.0, 33, 48, 72])
    part = block_means(image, box[None], block)
    assert part.step.tolist() == list(block)
    x, y = (int(one) for one in part.origin)
    width, height = (int(one) for one in block)
    rows, columns = part.pixels.shape[:2]
    cut = image[y : y + height * rows, x : x + width * columns].astype(np.float64)
    means = cut.reshape(rows, height, columns, width, 3).mean(axis=(1, 3))
    assert np.abs(part.pixels - means).max() <= 0.5 + 1e-9
    local = part.to_region(box[None])[0]
    assert np.allclose(local[:2] * block + part.origin, box[:2], rtol=0, atol=1e-12)
    assert np.allclose(local[2:] * block, box[2:], rtol=0, atol=1e-12)
    assert (local[:2] >= 0).all()
    assert (local[:2] + local[2:] <= [columns, rows]).all()


@given(st.floats(1, 9), st.floats(1, 9), st.floats(-20, 90), st.floats(-20, 90))
def test_fractional_blocks_are_area_integrals(width: float, height: float, x: float, y: float):
    """Against the linearly interpolated integral image, the exact integral of a piecewise constant image."""
    image = np.random.default_rng(1).integers(0, 256, (61, 83, 3), dtype=np.uint8)
    part = block_means(image, np.array([[x, y, 20.0, 25]]), (width, height))
    rows, columns = part.pixels.shape[:2]
    ends_x = part.origin[0] + np.arange(columns + 1) * width
    ends_y = part.origin[1] + np.arange(rows + 1) * height
    for channel in range(3):
        total = np.pad(image[..., channel].astype(np.float64).cumsum(0).cumsum(1), ((1, 0), (1, 0)))
        down = np.array([np.interp(ends_y, np.arange(62), column) for column in total.T])
        both = np.array([np.interp(ends_x, np.arange(84), row) for row in down.T])
        means = np.diff(np.diff(both, axis=0), axis=1) / (width * height)
        assert np.abs(part.pixels[..., channel] - means).max() <= 0.51


@given(st.integers(1, 60), st.integers(1, 60), st.floats(-90, 90), st.floats(-90, 90), st.floats(0.1, 500))
def test_a_region_has_at_least_one_block_inside_the_image(width: int, height: int, x: float, y: float, side: float):
    image = np.zeros((height, width, 3), np.uint8)
    size = np.array([side, side])
    part = block_means(image, np.array([[x, y, side, side]]), block_size(size, size, (16, 24)))
    assert part.pixels.size > 0
    assert (part.origin >= 0).all()
    assert (part.origin + part.step * part.pixels.shape[1::-1] <= np.array([width, height]) + 1e-9).all()


def test_a_box_has_about_as_many_blocks_as_points():
    for factor in np.geomspace(0.2, 5, 40):
        first = np.array([160.0, 240])
        width, height = block_size(first, factor * first, (16, 24))
        assert 0.7 < factor * 160 / width / 16 < 1.42
        assert width == height
    small = np.array([3.0, 4])
    assert block_size(small, small, (16, 24)) == (1, 1)


@given(st.integers(1, 90), st.integers(1, 90), st.integers(1, 60), st.integers(1, 60))
def test_a_shrunk_image_equals_that_of_opencv(width: int, height: int, columns: int, rows: int):
    image = np.random.default_rng(0).integers(0, 256, (height, width, 3), dtype=np.uint8)
    found = shrink(image, (columns, rows))
    expected = cv2.resize(image, (columns, rows), interpolation=cv2.INTER_AREA)
    # One level, where a processor rounds products and sums together.
    assert np.abs(found.astype(int) - expected.astype(int)).max() <= 1
