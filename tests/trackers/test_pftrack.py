"""The tracker `pftrack` and its parts."""

from collections.abc import Callable
from functools import partial

import cv2
import numpy as np
import pytest

from pftrack_sim import trackers
from pftrack_sim.core import boxes
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.trackers.features.camera_motion import CameraMotion
from pftrack_sim.trackers.pftrack.correlation import CorrelationFilter
from pftrack_sim.trackers.pftrack.hog_map import CHANNELS, DIRECTIONS, hog_map
from pftrack_sim.trackers.pftrack.scale import ScaleFilter, core
from pftrack_sim.trackers.recognition.colour import ColourModel
from pftrack_sim.trackers.recognition.parts import PartColours, describe
from pftrack_sim.trackers.recognition.pyramid import ImagePyramid
from tests.trackers.following import Scene, follow


def texture(width: int, height: int, seed: int = 0, grain: int = 6) -> np.ndarray:
    """Smooth coloured noise, `(height, width, 3)` uint8."""
    coarse = np.random.default_rng(seed).integers(0, 255, (height // grain + 2, width // grain + 2, 3), dtype=np.uint8)
    return cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)


run = partial(follow, "pftrack")


def test_a_patch_at_the_image_s_own_scale_is_the_image():
    image = texture(64, 48)
    pyramid = ImagePyramid(image)
    assert np.array_equal(pyramid.patch(np.array([20.0, 15]), 10.0, 10), image[10:20, 15:25])
    assert np.array_equal(pyramid.patch(np.array([32.0, 24]), 48.0, 48), image[:, 8:56])
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    found = pyramid.grey_patches(np.array([20.0, 15]), np.array([[16.0, 10.0]]), (10, 16))
    assert np.array_equal(found[0], grey[10:20, 12:28])


@pytest.mark.parametrize("factor", [2, 4])
def test_a_patch_at_a_coarser_scale_is_the_mean_of_blocks(factor: int):
    image = texture(64, 48)
    count = 32 // factor
    patch = ImagePyramid(image).patch(np.array([32.0, 24]), 32.0, count)
    means = image[8:40, 16:48].reshape(count, factor, count, factor, 3).mean(axis=(1, 3))
    assert np.abs(patch - means).max() <= 1


@pytest.mark.parametrize("side", [9.0, 37.0, 150.0])
def test_a_patch_does_not_depend_on_those_before(side: float):
    image, places = texture(320, 240), np.random.default_rng(0).uniform(-20, 330, (30, 2))
    pyramid = ImagePyramid(image)
    for place in places:
        alone, beside = (one.patch(place, side, 16).astype(int) for one in (ImagePyramid(image), pyramid))
        assert np.abs(alone - beside).max() <= 1


def test_a_uniform_patch_has_no_gradients_and_an_edge_has_its_direction():
    out, window = np.empty((CHANNELS, 6, 5), np.float32), np.ones((6, 5), np.float32)
    hog_map(np.full((24, 20), 90, np.uint8), window, out)
    assert np.abs(out).max() == 0.0
    edge = np.full((24, 20), 40, np.uint8)
    edge[:, 10:] = 200
    hog_map(edge, window, out)
    assert out[:DIRECTIONS].sum(axis=(1, 2)).argmax() == 0
    assert np.abs(out[1:DIRECTIONS]).max() == 0.0
    hog_map(
        np.ascontiguousarray(edge.T[:20, :20]), np.ones((5, 5), np.float32), out := np.empty((CHANNELS, 5, 5), "f4")
    )
    assert out[:DIRECTIONS].sum(axis=(1, 2)).argmax() in (DIRECTIONS // 2, DIRECTIONS // 2 + 1)


def test_gradient_maps_are_independent_of_contrast():
    grey = cv2.cvtColor(texture(32, 32), cv2.COLOR_RGB2GRAY) // 2
    full, faint = (np.empty((CHANNELS, 8, 8), np.float32) for _ in range(2))
    hog_map(grey, np.ones((8, 8), np.float32), full)
    hog_map(2 * grey, np.ones((8, 8), np.float32), faint)
    assert np.abs(full - faint).max() < 0.05


@pytest.mark.parametrize("size", [(320, 240), (641, 480), (90, 60)])
@pytest.mark.parametrize("moved", [(6.0, -9.0), (-15.0, 4.0), (0.0, 0.0)])
def test_the_shift_of_the_image_is_found(size: tuple[int, int], moved: tuple[float, float]):
    width, height = size
    large = texture(width + 60, height + 60, seed=2)
    x, y = (round(v) for v in moved)
    first, then = large[30 : 30 + height, 30 : 30 + width], large[30 - y : 30 - y + height, 30 - x : 30 - x + width]
    camera = CameraMotion(certainty_min=0.05)
    assert camera.shift(np.ascontiguousarray(first)).tolist() == [0.0, 0.0]
    found = camera.shift(np.ascontiguousarray(then))
    assert np.abs(found - moved).max() < max(width / 128, 1.0)


def test_an_unrelated_image_has_no_shift():
    camera = CameraMotion(certainty_min=0.3)
    camera.shift(texture(160, 120, seed=1))
    assert camera.shift(texture(160, 120, seed=2)).tolist() == [0.0, 0.0]


@pytest.mark.parametrize("value", [0, 120])
def test_a_uniform_image_has_no_shift(value: int):
    camera = CameraMotion(certainty_min=0.0)
    for _ in range(3):
        assert camera.shift(np.full((120, 160, 3), value, np.uint8)).tolist() == [0.0, 0.0]


@pytest.mark.parametrize("moved", [(0, 0), (3, -2), (-4, 1)])
def test_the_response_s_peak_moves_with_the_target(moved: tuple[int, int]):
    image = texture(200, 200, seed=3)
    subject = CorrelationFilter(cells=20, size=(8.0, 8.0), sigma=1.0, ridge=0.001)
    subject.learn(subject.spectrum(np.ascontiguousarray(image[60:140, 60:140])), 1.0)
    top, left = 60 - 4 * moved[1], 60 - 4 * moved[0]
    response = subject.respond(subject.spectrum(np.ascontiguousarray(image[top : top + 80, left : left + 80])))
    row, column = divmod(int(response.argmax()), 20)
    assert (column - 10, row - 10) == moved


def test_a_wider_search_window_weakens_a_distant_target_less():
    """A target one of its sides from the window's centre."""
    image = texture(240, 240, seed=3)
    kept = {}
    for power in (1.0, 0.5):
        subject = CorrelationFilter(cells=30, size=(8.0, 8.0), sigma=1.0, ridge=0.001, search_window=power)
        subject.learn(subject.spectrum(np.ascontiguousarray(image[60:180, 60:180])), 1.0)
        near, far = (
            subject.respond(subject.spectrum(np.ascontiguousarray(image[60:180, left : left + 120]), searched=True))
            for left in (60, 28)
        )
        assert divmod(int(far.argmax()), 30) == (15, 23)
        kept[power] = float(far.max() / near.max())
    assert kept[0.5] > kept[1.0] + 0.1


def test_colours_of_the_target_alone_score_high():
    patch = np.full((80, 80, 3), (40, 90, 160), np.uint8)
    patch[20:60, 30:50] = (200, 60, 30)
    model = ColourModel()
    assert np.allclose(model.respond(patch, 20, 40)[40, 40], 0.5, rtol=0, atol=1e-6), "nothing is learnt yet"
    model.learn(patch, 20, 40, 0.04)
    response = model.respond(np.roll(patch, (7, -5), (0, 1)), 20, 40)
    peak = np.array(np.unravel_index(response.argmax(), response.shape))
    assert np.abs(peak - (47, 35)).max() <= 2
    assert response.max() > 0.95
    assert response[5, 70] < 0.05


@pytest.mark.parametrize("zoom", [0.94, 1.0, 1.06])
def test_a_change_of_size_is_found(zoom: float):
    image = texture(240, 240, seed=4)
    subject = ScaleFilter(np.array([40.0, 70]), count=17, step=1.02, cells=36)
    centre = np.array([120.0, 120])
    subject.learn(ImagePyramid(image), centre, 1.0, 0.025)
    matrix = np.array([[zoom, 0, 119.5 * (1 - zoom)], [0, zoom, 119.5 * (1 - zoom)]])
    zoomed = cv2.warpAffine(image, matrix, (240, 240), borderMode=cv2.BORDER_REFLECT)
    assert subject.factor(ImagePyramid(zoomed), centre, 1.0) == pytest.approx(zoom, abs=0.012)


def walking_off(count: int = 30, ratio: float = 0.97) -> Scene:
    """An elongated target that fills half of its box's width shrinks before a scene that rests."""
    images, truth = [], []
    background, coat = texture(320, 240, seed=7, grain=15) // 3 + 80, texture(60, 160, seed=8, grain=15)
    for index in range(count):
        height = 150 * ratio**index
        shape = (max(round(0.2 * height), 2), round(height))
        image = background.copy()
        person = cv2.resize(coat, shape, interpolation=cv2.INTER_AREA)
        half = (shape[0] // 2, shape[1] // 2)
        body = cv2.ellipse(np.zeros(shape[::-1], np.uint8), half, half, 0, 0, 360, 1, -1)
        left, top = 160 - half[0], 120 - half[1]
        region = image[top : top + shape[1], left : left + shape[0]]
        region[body > 0] = person[body > 0]
        images.append(image)
        truth.append([160 - 0.2 * height, 120 - 0.5 * height, 0.4 * height, height])
    return images, np.array(truth)


def test_a_person_who_walks_off_before_a_scene_that_rests_becomes_smaller():
    images, truth = walking_off()
    ratio = {share: run(images, truth[0], scale_core=share)[-1].box[3] / truth[-1, 3] for share in (0.4, 1.0)}
    assert ratio[0.4] < 1.25
    assert ratio[1.0] > 1.5


def test_a_square_box_is_compared_whole_and_an_elongated_one_in_its_middle():
    np.testing.assert_allclose(core(np.array([50.0, 50]), 0.4), [50, 50])
    np.testing.assert_allclose(core(np.array([40.0, 80]), 0.4), [25, 80])
    np.testing.assert_allclose(core(np.array([80.0, 40]), 0.4), [80, 25])
    np.testing.assert_allclose(core(np.array([20.0, 100]), 0.4), [8, 100])
    np.testing.assert_allclose(core(np.array([20.0, 100]), 1.0), [20, 100])


def test_the_size_of_a_blurred_target_is_kept():
    """A scene that rests, blurred as by motion from the eighth image on: its measured size changes."""
    sharp = texture(320, 240, seed=6, grain=8)
    images = [sharp] * 7 + [cv2.blur(sharp, (15, 1))] * 6
    width: dict[float, np.ndarray] = {}
    for unsure in (0.0, 0.4, 0.7):
        found = run(images, (140, 90, 40, 60), scale_unsure=unsure, scale_sure=min(2 * unsure, 1.0))
        assert min(one.confidence for one in found[:6]) > 0.9
        assert max(one.confidence for one in found[6:]) < min(one.confidence for one in found[:6]) - 0.1
        width[unsure] = np.array([one.box[2] for one in found])
    change = {unsure: float(np.abs(np.log(widths[6:] / widths[5])).max()) for unsure, widths in width.items()}
    assert change[0.0] > 0.04
    assert change[0.4] < 0.8 * change[0.0]
    assert change[0.7] == 0.0


def test_an_occluded_target_is_waited_for(make_scene: Callable[..., Scene]):
    images, truth = make_scene(count=16, step_px=0.0)
    covered = list(images)
    for index in range(8, 12):
        image = images[index].copy()
        x, y, w, h = (int(v) for v in truth[index])
        image[y - 4 : y + h + 4, x - 4 : x + w + 4] = (20, 200, 20)
        covered[index] = image
    found = run(covered, truth[0])
    assert [one.occluded for one in found] == [7 <= index < 11 for index in range(15)]
    assert all(boxes.iou(one.box, truth[0]) > 0.8 for one in found)
    assert max(one.confidence for one in found[7:11]) < 0.6 < min(one.confidence for one in found[11:])


@pytest.mark.parametrize("shape", [(16, 16), (1, 1), (3, 200)])
def test_small_images_are_accepted(shape: tuple[int, int]):
    images = [np.random.default_rng(k).integers(0, 255, (*shape, 3), dtype=np.uint8) for k in range(4)]
    for box in ((0, 0, 1, 1), (-3, -3, 9, 9), (-50, -50, 400, 400)):
        assert all(boxes.area(one.box) > 0 for one in run(images, box))


def test_parameters_out_of_range_are_refused():
    with pytest.raises(ParameterError, match="cells"):
        trackers.make("pftrack", cells=2)
    with pytest.raises(ParameterError, match="padding"):
        trackers.make("pftrack", paddin=2)


def dressed(top: tuple[int, int, int], trousers: tuple[int, int, int]) -> np.ndarray:
    """A person of 24 x 72 px in two colours, `(72, 24, 3)` uint8."""
    person = texture(24, 72, seed=9) // 8
    person[:12] += np.uint8(150)
    person[12:36] += np.asarray(top, np.uint8)
    person[36:] += np.asarray(trousers, np.uint8)
    return person


BLUE_BEIGE, BEIGE_BLUE = dressed((40, 80, 190), (190, 170, 120)), dressed((190, 170, 120), (40, 80, 190))


def scene_of(*people: tuple[np.ndarray, int]) -> np.ndarray:
    """People at columns of a grey street, `(240, 320, 3)` uint8."""
    image = texture(320, 240, seed=7, grain=15) // 4 + 90
    for person, column in people:
        image[90:162, column : column + 24] = person
    return image


def test_parts_tell_clothes_in_another_order_apart_and_stand_a_change_of_light():
    size = np.array([24.0, 72])

    def described(person: np.ndarray) -> np.ndarray:
        return describe(ImagePyramid(scene_of((person, 100))), np.array([112.0, 126]), size)

    parts = described(BLUE_BEIGE)
    np.testing.assert_allclose(parts.sum(axis=1), 1.0, rtol=0, atol=1e-5)
    target = PartColours(parts)
    own = target.likeness(parts)
    assert target.likeness(described((BLUE_BEIGE * 0.9).astype(np.uint8))) > 0.8 * own
    assert target.likeness(described(BEIGE_BLUE)) < 0.6 * own
    for _ in range(200):
        target.learn(parts, 1.0)
    assert target.likeness(parts) == pytest.approx(1.0, abs=0.02), "a share of what is usual"


def test_a_person_in_other_clothes_is_not_taken_for_the_target():
    """The target walks out of the image behind another who stays."""
    images = [scene_of((BLUE_BEIGE, 100))] * 8
    images += [scene_of((BLUE_BEIGE, 100 + 4 * k), (BEIGE_BLUE, 160)) for k in range(16)]
    images += [scene_of((BEIGE_BLUE, 160))] * 20
    found = run(images, (100, 90, 24, 72))
    assert min(one.confidence for one in found[:7]) > 0.8
    assert all(one.occluded and one.confidence < 0.2 for one in found[-15:])


def test_a_lost_target_is_found_elsewhere():
    images = [scene_of((BLUE_BEIGE, 40))] * 8 + [scene_of((BEIGE_BLUE, 40))] * 10
    images += [scene_of((BEIGE_BLUE, 40), (BLUE_BEIGE, 250))] * 10
    last = {after: run(images, (40, 90, 24, 72), search_after=after)[-1] for after in (0, 6)}
    truth = np.array([250.0, 90, 24, 72])
    assert boxes.iou(last[6].box, truth) > 0.6
    assert last[6].confidence > 0.6
    assert last[0].occluded
    assert boxes.iou(last[0].box, truth) == 0.0
