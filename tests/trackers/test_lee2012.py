"""The method of Lee et al. 2012: its parts do what the equations say."""

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pftrack_sim import trackers
from pftrack_sim.core import boxes
from pftrack_sim.trackers.features.histogram import distance_layout, histogram, histograms
from pftrack_sim.trackers.features.image_region import block_means, block_size
from pftrack_sim.trackers.features.pixel_codes import hsv_joint_codes
from pftrack_sim.trackers.filters import ConstantVelocity
from pftrack_sim.trackers.papers.lee2012 import METHODS, Lee2012, Lee2012Parameters

Scene = tuple[list[np.ndarray], np.ndarray]
NAMES = sorted(METHODS)


def run(images: list[np.ndarray], box: np.ndarray, name: str = "lee2012", **given: Any) -> np.ndarray:
    tracker = trackers.make(name, **given)
    tracker.init(images[0], box)
    return np.array([tracker.update(image).box for image in images[1:]])


def test_paper_preset_holds_the_printed_values():
    printed = {
        "particle_count": 100,
        "noise_width": 2.5,
        "noise_height": 2.5,
        "noise_velocity_x": 6.5,
        "noise_velocity_y": 2.5,
        "noise_unit": "px",
        "alpha": 0.1,
        "sigma_colour": 0.4,
        "sigma_hog": 0.4,
        "learned_sigma_colour": 0.4,
        "learned_sigma_hog": 0.4,
        "window": 40,
    }
    assert {name: getattr(Lee2012Parameters(), name) for name in printed} == printed


def test_every_method_is_registered():
    assert set(METHODS) <= set(trackers.names())
    assert all(isinstance(trackers.make(name), Lee2012) for name in METHODS)


@pytest.mark.parametrize("name", NAMES)
def test_a_moving_target_is_followed_while_it_is_learnt(make_scene: Callable[..., Scene], name: str):
    images, truth = make_scene(count=70, step_px=1.0, width=160)
    found = run(images, truth[0], name)
    assert boxes.pairwise_iou(found, truth[1:])[-25:].mean() > 0.6


@pytest.mark.parametrize("preset", trackers.PRESETS)
@pytest.mark.parametrize("name", NAMES)
def test_same_seed_same_bits_and_init_forgets(make_scene: Callable[..., Scene], name: str, preset: str):
    """Past the frame from which it learns."""
    images, truth = make_scene(count=25)
    tracker = trackers.make(name, seed=4, preset=preset, window=8)

    def follow() -> list[tuple[Any, ...]]:
        tracker.init(images[0], truth[0])
        estimates = [tracker.update(image) for image in images[1:]]
        return [(*one.box, one.confidence) for one in estimates]

    first = follow()
    assert follow() == first
    other = run(images, truth[0], name, seed=5, preset=preset, window=8)
    assert not np.array_equal(other, np.array(first)[:, :4])


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("preset", trackers.PRESETS)
def test_twice_the_image_gives_twice_the_estimate(make_scene: Callable[..., Scene], name: str, seed: int, preset: str):
    """The preset `paper` has its noise in pixels, as printed, and so needs twice the noise."""
    images, truth = make_scene(count=25)
    doubled = [cv2.resize(image, None, fx=2, fy=2, interpolation=cv2.INTER_NEAREST) for image in images]
    numbers = Lee2012Parameters.from_preset(name, preset, {})
    noise = {key: value for key, value in numbers if key.startswith("noise_") and key != "noise_unit"}
    twice = {key: 2 * value for key, value in noise.items()} if numbers.noise_unit == "px" else {}
    small = run(images, truth[0], name, seed=seed, preset=preset, window=12)
    large = run(doubled, 2 * truth[0], name, seed=seed, preset=preset, window=12, **twice)
    assert np.abs(large - 2 * small).max() <= 2


def test_a_still_target_gives_full_confidence_and_no_noise_no_motion(scene: Scene):
    images, truth = scene
    for name in NAMES:
        tracker = trackers.make(
            name, noise_width=0, noise_height=0, noise_velocity_x=0, noise_velocity_y=0, start_spread=0, window=5
        )
        tracker.init(images[0], truth[0])
        for _ in range(9):
            estimate = tracker.update(images[0])
            assert np.allclose(estimate.box, truth[0], rtol=0, atol=1e-9)
            assert estimate.confidence == pytest.approx(1, abs=1e-3)
            assert not estimate.occluded


def test_learning_changes_nothing_before_its_frame_and_something_after(make_scene: Callable[..., Scene]):
    images, truth = make_scene(count=30)
    learnt, never = (run(images, truth[0], name, window=10) for name in ("lee2012", "lee2012-color-hog"))
    # The first frame and nine estimates make ten vectors: the tenth estimate is the first that is weighed by them.
    assert np.array_equal(learnt[:9], never[:9])
    assert not np.array_equal(learnt[9], never[9])


def test_checked_learns_from_what_resembles_the_target_only(make_scene: Callable[..., Scene]):
    images, truth = make_scene(count=20)
    blank = np.full_like(images[0], 30)
    for name, remembers in (("lee2012", False), ("lee2012-checked", True)):
        still = {"noise_unit": "box", "noise_velocity_x": 0.02, "noise_velocity_y": 0.02}
        tracker = trackers.make(name, preset="paper", window=10, learn_above=0.5, alpha=1.0, **still)
        tracker.init(images[0], truth[0])
        for image in images[1:]:
            tracker.update(image)
        at_target = tracker.update(images[-1]).confidence
        for _ in range(30):
            lost = tracker.update(blank).confidence
        assert at_target > 0.8
        assert (lost < 0.5) == remembers


def test_alpha_one_is_colour_alone(scene: Scene):
    images, truth = scene
    assert np.allclose(
        run(images, truth[0], "lee2012-color-hog", alpha=1.0), run(images, truth[0], "lee2012-color"), rtol=0, atol=1e-9
    )


def test_particles_come_when_asked_for_and_change_nothing(scene: Scene):
    images, truth = scene
    for wanted in (True, False):
        tracker = trackers.make("lee2012", particles=wanted, particle_count=37)
        tracker.init(images[0], truth[0])
        shown = tracker.update(images[1]).particles
        assert (shown.shape == (37, 4)) if shown is not None else not wanted
    assert np.array_equal(run(images, truth[0], particles=True), run(images, truth[0], particles=False))


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("colour", [0, 130, 255])
def test_nothing_to_see_is_survived(scene: Scene, name: str, colour: int):
    images, truth = scene
    tracker = trackers.make(name, window=4)
    blank = np.full_like(images[0], colour)
    tracker.init(blank, truth[0])
    for _ in range(8):
        assert np.isfinite(tracker.update(blank).box).all()
    tracker.init(images[0], truth[0])
    tracker.update(blank)
    assert np.isfinite(tracker.update(images[1]).box).all()


def test_constant_velocity_is_equation_9():
    dynamics = ConstantVelocity((2.5, 2.0, 6.5, 1.0))
    states = np.tile([10.0, 20, 30, 40, 3, -2], (200_000, 1))
    drawn = dynamics.draw(states, np.random.default_rng(0))
    assert (drawn[:, :2] == [13, 18]).all(), "a velocity's noise moves the position one frame later"
    noise = drawn[:, 2:] - states[:, 2:]
    reach = np.array(dynamics.reach)
    assert (np.abs(noise) <= reach).all()
    assert np.allclose(noise.mean(axis=0) / reach, 0, rtol=0, atol=0.01)
    assert np.allclose(noise.var(axis=0) / reach**2, 1 / 3, rtol=0, atol=0.01)
    assert (states == [10, 20, 30, 40, 3, -2]).all()


def test_colour_weights_are_equation_1():
    weights = distance_layout(24, 16, 1, 256).weights
    v, u = np.mgrid[:24, :16]
    distance = np.hypot(v - 11.5, u - 7.5)
    expected = 1 - (distance / distance.max()) ** 2
    assert np.allclose(weights / weights.sum(), expected / expected.sum(), rtol=0, atol=1e-12)
    assert weights[0, 0] == weights[-1, -1] == 0


def test_colour_histogram_against_opencv():
    """On a box of exactly 16x24 pixels; OpenCV's own three-dimensional histogram, one pixel at a time, weighted."""
    image = np.random.default_rng(0).integers(0, 256, (40, 30, 3), dtype=np.uint8)
    layout = distance_layout(24, 16, 1, 256)
    found = histogram(hsv_joint_codes(image, (8, 8, 4)), np.array([5.0, 7, 16, 24]), layout)
    hsv = cv2.cvtColor(image, cv2.COLOR_RGB2HSV_FULL)[7:31, 5:21]
    expected = np.zeros((8, 8, 4))
    for i in range(24):
        for j in range(16):
            one = cv2.calcHist([hsv[i : i + 1, j : j + 1]], [0, 1, 2], None, [8, 8, 4], [0, 256] * 3)
            expected += one * layout.weights[i, j]
    assert np.allclose(found, expected.ravel() / expected.sum(), rtol=0, atol=1e-7)


@settings(max_examples=30)
@given(st.floats(-30, 60), st.floats(-30, 60), st.floats(1, 80), st.floats(1, 80))
def test_many_histograms_are_one_and_one(x: float, y: float, w: float, h: float):
    codes = np.random.default_rng(1).integers(0, 256, (50, 60, 1), dtype=np.uint8)
    layout, box = distance_layout(24, 16, 1, 256), np.array([x, y, w, h])
    both = histograms(codes, np.array([box, [1.0, 2, 40, 40]]), layout)
    alone = histogram(codes, box, layout)
    share = both[0].sum()
    assert -1e-12 <= share <= 1 + 1e-12
    assert np.allclose(both[0], alone * share, rtol=0, atol=1e-12)
    assert both[1].sum() == pytest.approx(1, abs=1e-12)


@pytest.mark.parametrize("block", [(3.0, 3.0), (1.0, 2.0), (1.0, 1.0)])
def test_blocks_hold_means_and_boxes_stay_where_they_are(block: tuple[float, float]):
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
def test_blocks_of_broken_size_are_integrals_over_area(width: float, height: float, x: float, y: float):
    """Against the integral image, read between its points; there the integral of a piecewise constant image is."""
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
def test_some_of_the_image_is_always_left(width: int, height: int, x: float, y: float, side: float):
    image = np.zeros((height, width, 3), np.uint8)
    size = np.array([side, side])
    part = block_means(image, np.array([[x, y, side, side]]), block_size(size, size, (16, 24)))
    assert part.pixels.size > 0
    assert (part.origin >= 0).all()
    assert (part.origin + part.step * part.pixels.shape[1::-1] <= np.array([width, height]) + 1e-9).all()


def test_a_box_is_read_in_as_many_blocks_as_points_whatever_its_size():
    for factor in np.geomspace(0.2, 5, 40):
        first = np.array([160.0, 240])
        width, height = block_size(first, factor * first, (16, 24))
        assert 0.7 < factor * 160 / width / 16 < 1.42
        assert width == height
    small = np.array([3.0, 4])
    assert block_size(small, small, (16, 24)) == (1, 1)
