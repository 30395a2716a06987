"""Template matching and mean shift on synthetic images."""

import numpy as np
import pytest

from pftrack_sim import trackers
from tests.trackers.following import Scene


def test_ncc_finds_a_patch_exactly_under_any_brightness(scene: Scene):
    images, truth = scene
    tracker = trackers.make("ncc")
    tracker.init(images[0], truth[0] + [0.25, 0.5, 0, 0])
    # Half the contrast is the same patch to a correlation without mean; rounding makes it a little less than alike.
    for image, box in zip(images[1:], truth[1:], strict=True):
        estimate = tracker.update(image // 2 + 30)
        assert np.allclose(estimate.box - box, [0.25, 0.5, 0, 0], rtol=0, atol=1e-9)
        assert estimate.confidence > 0.9


def test_ncc_searches_within_its_distance(scene: Scene):
    images, truth = scene
    for search, reached in ((0.0, 0.0), (0.1, 3.0), (2.0, truth[-1, 0] - truth[0, 0])):
        tracker = trackers.make("ncc", search=search)
        tracker.init(images[0], truth[0])
        moved = tracker.update(images[-1]).box - truth[0]
        assert np.abs(moved[:2]).max() <= np.ceil(search * np.sqrt(20 * 32))
        assert search < 2 or moved[0] == reached


@pytest.mark.parametrize(("first", "then"), [(0, 0), (255, 255), (0, 255)])
def test_ncc_of_a_uniform_patch_stays_with_confidence_zero(first: int, then: int, scene: Scene):
    tracker = trackers.make("ncc")
    box = np.array([30.0, 20, 20, 30])
    tracker.init(np.full((90, 120, 3), first, np.uint8), box)
    estimate = tracker.update(np.full((90, 120, 3), then, np.uint8))
    assert estimate.box.tolist() == box.tolist()
    assert estimate.confidence == 0.0
    assert tracker.update(scene[0][0]).box.tolist() == box.tolist()


def disc(x: float, y: float, radius: float) -> np.ndarray:
    """A red disc on grey, which has no hue, with its centre at `x, y`."""
    rows, columns = np.mgrid[:120, :160] + 0.5
    image = np.empty((120, 160, 3), np.uint8)
    image[:] = (90, 95, 100)
    image[np.hypot(columns - x, rows - y) < radius] = (220, 30, 40)
    return image


@pytest.mark.parametrize("name", ["opencv-meanshift", "opencv-camshift"])
def test_a_coloured_disc_is_followed(name: str):
    tracker = trackers.make(name)
    tracker.init(disc(40, 50, 15), np.array([25.0, 35, 30, 30]))
    for step in range(1, 12):
        estimate = tracker.update(disc(40 + 4 * step, 50 + 2 * step, 15))
        centre = estimate.box[:2] + 0.5 * estimate.box[2:]
        assert np.abs(centre - [40 + 4 * step, 50 + 2 * step]).max() < 4
        assert estimate.confidence > 0.5


def test_camshift_follows_the_size_and_meanshift_does_not():
    widths = {}
    for name in ("opencv-meanshift", "opencv-camshift"):
        tracker = trackers.make(name)
        tracker.init(disc(80, 60, 12), np.array([68.0, 48, 24, 24]))
        for radius in range(13, 30):
            estimate = tracker.update(disc(80, 60, radius))
        widths[name] = estimate.box[2]
    assert widths["opencv-meanshift"] == 24
    assert 45 < widths["opencv-camshift"] < 75


@pytest.mark.parametrize("name", ["opencv-meanshift", "opencv-camshift"])
def test_without_the_colour_the_last_box_is_repeated_with_confidence_zero(name: str):
    box = np.array([25.5, 35.25, 30, 30])
    coloured, grey = disc(40, 50, 15), np.full((120, 160, 3), 128, np.uint8)
    for first, then in ((coloured, grey), (grey, coloured), (grey, grey)):
        tracker = trackers.make(name)
        tracker.init(first, box)
        estimate = tracker.update(then)
        assert estimate.box.tolist() == box.tolist()
        assert estimate.confidence == 0.0
