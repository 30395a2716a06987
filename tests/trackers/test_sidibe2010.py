"""sidibe2010: colour, and saliency: what differs from the rest of the image."""

import numpy as np
import pytest

from pftrack_sim.trackers.relatives.sidibe2010 import Sidibe2010, spectral_residual
from tests.trackers.following import Scene, follow, made


def test_saliency_distinguishes_a_target_from_a_patch_of_its_colours():
    """The target is one stripe in a calm place; the other patch, of equal colours, lies in a field of stripes."""
    image = np.full((120, 200, 3), 120, np.uint8)
    image[40:80, 30:50] = (200, 60, 60)
    image[:, 100:] = (120, 120, 120)
    for x in range(100, 200, 30):
        image[:, x : x + 20] = (200, 60, 60)
    both = np.array([[30.0, 40, 20, 40], [130.0, 40, 20, 40]])
    tracker = made(Sidibe2010)
    tracker.init(image, both[0])
    colour, saliency = tracker.similarities(tracker.observe(image, both), both)
    assert np.allclose(colour, 1.0, rtol=0, atol=1e-9)
    assert saliency[0] == pytest.approx(1.0, abs=1e-9)
    assert saliency[1] < 0.98


def test_without_weight_a_likelihood_has_no_effect(scene: Scene):
    images, truth = scene
    confidences = []
    for cells in (2, 8):
        found = follow("sidibe2010", images, truth[0], lambda_saliency=0, cells=cells)
        confidences.append([one.confidence for one in found])
    assert confidences[0] == confidences[1]


SIZE, BLUR_PX = (64, 48), 1.5


def blotched(odd: tuple[int, int] | None = (300, 200)) -> np.ndarray:
    """A grey texture with one red blotch of 40x40 px at x, y."""
    image = np.repeat(np.random.default_rng(0).integers(100, 140, (480, 640, 1), dtype=np.uint8), 3, axis=2)
    if odd is not None:
        image[odd[1] : odd[1] + 40, odd[0] : odd[0] + 40] = (180, 60, 60)
    return image


@pytest.mark.parametrize("odd", [(300, 200), (0, 0), (600, 440), (40, 400)])
def test_the_odd_one_is_most_salient_wherever_it_is(odd: tuple[int, int]):
    found = spectral_residual(blotched(odd), SIZE, BLUR_PX)
    assert found.shape == (48, 64)
    assert found.max() == pytest.approx(1.0, abs=1e-9)
    row, column = np.unravel_index(found.argmax(), found.shape)
    assert odd[0] <= 10 * column + 5 <= odd[0] + 40
    assert odd[1] <= 10 * row + 5 <= odd[1] + 40


def test_brightness_and_contrast_have_no_effect():
    """Blocks as large as those that the image is reduced by, of even values: halving them is exact."""
    image = 2 * np.random.default_rng(0).integers(20, 100, (48, 64, 3), dtype=np.uint8).repeat(10, 0).repeat(10, 1)
    first, second = (spectral_residual(one, SIZE, BLUR_PX) for one in (image, image // 2 + 30))
    assert np.abs(first - second).max() < 1e-3


@pytest.mark.parametrize("colour", [0, 100, 255])
def test_nothing_is_salient_in_a_uniform_image(colour: int):
    assert not spectral_residual(np.full((48, 64, 3), colour, np.uint8), SIZE, BLUR_PX).any()
