"""Grey patches against OpenCV."""

import cv2
import numpy as np
import pytest

from pftrack_sim.trackers.features.patches import PatchSampler, grid_shape, sample_patches


def placements(count: int, seed: int = 0) -> np.ndarray:
    """`(N, 6)` turned and sheared templates in and partly outside an image of 60x50."""
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(-5, 65, count), rng.uniform(-5, 55, count), rng.normal(0, 15, (count, 4))])


def test_upright_patches_agree_with_opencv():
    grey = np.random.default_rng(2).integers(0, 256, (50, 60), dtype=np.uint8)
    columns, rows, x, y, w, h = 8, 12, 10.25, 6.5, 20.0, 30.0
    across = (x + (np.arange(columns) + 0.5) / columns * w - 0.5).astype(np.float32)
    down = (y + (np.arange(rows) + 0.5) / rows * h - 0.5).astype(np.float32)
    expected = cv2.remap(grey.astype(np.float32), *np.meshgrid(across, down), cv2.INTER_LINEAR)
    expected = (expected - expected.mean()) / expected.std()
    found = sample_patches(grey, np.array([[x + w / 2, y + h / 2, w, 0, 0, h]]), (rows, columns))[0]
    # OpenCV may round positions to a 32nd of a pixel.
    assert np.abs(found.reshape(rows, columns) - expected).max() < 0.15
    assert np.corrcoef(found, expected.ravel())[0, 1] > 0.999


def test_turned_patches_are_those_of_the_turned_image():
    grey = np.random.default_rng(2).integers(0, 256, (50, 60), dtype=np.uint8)
    upright = sample_patches(grey, np.array([[31.0, 24, 20, 0, 0, 30]]), (12, 8))
    turned = sample_patches(np.rot90(grey, -1).copy(), np.array([[50 - 24.0, 31, 0, 20, -30, 0]]), (12, 8))
    assert np.allclose(turned, upright, rtol=0, atol=1e-4)


def test_brightness_and_contrast_have_no_effect():
    grey = np.random.default_rng(1).integers(0, 100, (50, 60), dtype=np.uint8)
    placed = placements(10, seed=4)
    assert np.allclose(
        sample_patches(grey, placed, (6, 6)), sample_patches(2 * grey + 31, placed, (6, 6)), rtol=0, atol=1e-4
    )


def test_patches_of_a_uniform_image_are_zero():
    flat = np.full((50, 60), 77, np.uint8)
    assert (sample_patches(flat, placements(5), (6, 6)) == 0).all()


@pytest.mark.parametrize(("size", "count"), [((80, 160), 400), ((2, 2), 400), ((500, 3), 100), ((30, 20), 4)])
def test_the_grid_has_about_the_given_number_of_points(size: tuple[float, float], count: int):
    rows, columns = grid_shape(*size, count)
    assert rows >= 2
    assert columns >= 2
    assert 0.6 * count <= rows * columns <= 1.4 * count


def test_a_small_template_is_sampled_at_full_resolution():
    image = np.random.default_rng(1).integers(0, 256, (50, 60, 3), dtype=np.uint8)
    placed = placements(20)
    found = PatchSampler(image, (12.0, 14.0), (10, 9)).patches(placed)
    whole = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    assert np.allclose(found, sample_patches(whole, placed, (10, 9)), rtol=0, atol=1e-5)


def test_patches_do_not_depend_on_earlier_ones():
    image = np.random.default_rng(1).integers(0, 256, (200, 260, 3), dtype=np.uint8)
    upright = np.array([[130.0, 100.0, 40, 0, 0, 50], [60, 50, 40, 0, 0, 50], [250, 190, 40, 0, 0, 50]])
    fresh = [PatchSampler(image, (40.0, 50.0), (12, 10)).patches(one[None])[0] for one in upright]
    used = PatchSampler(image, (40.0, 50.0), (12, 10))
    for one, expected in zip([*upright, upright[0]], [*fresh, fresh[0]], strict=True):
        assert np.allclose(used.patches(one[None])[0], expected, rtol=0, atol=1e-5)


def test_a_large_template_is_not_aliased():
    """A coarse template averages stripes of one pixel and keeps the slow gradient below them."""
    slow = np.tile(np.linspace(60, 180, 240), (240, 1))
    stripes = np.where(np.arange(240) % 2, 50, -50)
    image = np.repeat((slow + stripes)[..., None], 3, axis=2).astype(np.uint8)
    placed = np.array([[120.0, 120, 200, 0, 0, 200]])
    found = PatchSampler(image, (200.0, 200.0), (10, 10)).patches(placed)[0]
    expected = sample_patches(slow.astype(np.uint8), placed, (10, 10))[0]
    assert np.abs(found - expected).max() < 0.1
