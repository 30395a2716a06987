"""Template matching and mean shift on synthetic images."""

import numpy as np
import pytest

from pftrack_sim.core.boxes import centre
from tests.trackers.following import Scene, follow


def test_ncc_finds_a_patch_exactly_under_any_brightness(scene: Scene):
    images, truth = scene
    # Half the contrast is the same patch to a correlation without mean; rounding makes it a little less than alike.
    shown = [images[0], *(image // 2 + 30 for image in images[1:])]
    for estimate, box in zip(follow("ncc", shown, truth[0] + [0.25, 0.5, 0, 0]), truth[1:], strict=True):
        assert np.allclose(estimate.box - box, [0.25, 0.5, 0, 0], rtol=0, atol=1e-9)
        assert estimate.confidence > 0.9


def test_ncc_searches_within_its_distance(scene: Scene):
    images, truth = scene
    for search, reached in ((0.0, 0.0), (0.1, 3.0), (2.0, truth[-1, 0] - truth[0, 0])):
        moved = follow("ncc", [images[0], images[-1]], truth[0], search=search)[0].box - truth[0]
        assert np.abs(moved[:2]).max() <= np.ceil(search * np.sqrt(20 * 32))
        assert search < 2 or moved[0] == reached


@pytest.mark.parametrize(("first", "then"), [(0, 0), (255, 255), (0, 255)])
def test_ncc_of_a_uniform_patch_stays_with_confidence_zero(first: int, then: int, scene: Scene):
    box = [30.0, 20, 20, 30]
    uniform = [np.full((90, 120, 3), grey, np.uint8) for grey in (first, then)]
    estimate, later = follow("ncc", [*uniform, scene[0][0]], box)
    assert (estimate.box.tolist(), estimate.confidence) == (box, 0.0)
    assert later.box.tolist() == box


def disc(x: float, y: float, radius: float) -> np.ndarray:
    """A red disc on grey, which has no hue, with its centre at `x, y`."""
    rows, columns = np.mgrid[:120, :160] + 0.5
    image = np.empty((120, 160, 3), np.uint8)
    image[:] = (90, 95, 100)
    image[np.hypot(columns - x, rows - y) < radius] = (220, 30, 40)
    return image


@pytest.mark.parametrize("name", ["opencv-meanshift", "opencv-camshift"])
def test_a_coloured_disc_is_followed(name: str):
    middles = [np.array([40 + 4 * step, 50 + 2 * step]) for step in range(12)]
    found = follow(name, [disc(*middle, 15) for middle in middles], [25.0, 35, 30, 30])
    for estimate, middle in zip(found, middles[1:], strict=True):
        assert np.abs(centre(estimate.box) - middle).max() < 4
        assert estimate.confidence > 0.5


def test_camshift_follows_the_size_and_meanshift_does_not():
    growing = [disc(80, 60, radius) for radius in range(12, 30)]
    kept, grown = (
        follow(name, growing, [68.0, 48, 24, 24])[-1].box[2] for name in ("opencv-meanshift", "opencv-camshift")
    )
    assert kept == 24
    assert 45 < grown < 75


@pytest.mark.parametrize("name", ["opencv-meanshift", "opencv-camshift"])
def test_without_the_colour_the_last_box_is_repeated_with_confidence_zero(name: str):
    box = [25.5, 35.25, 30, 30]
    coloured, grey = disc(40, 50, 15), np.full((120, 160, 3), 128, np.uint8)
    for first, then in ((coloured, grey), (grey, coloured), (grey, grey)):
        (estimate,) = follow(name, [first, then], box)
        assert (estimate.box.tolist(), estimate.confidence) == (box, 0.0)
