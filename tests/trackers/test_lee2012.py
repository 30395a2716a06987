"""The methods of Lee et al. 2012."""

import math
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import pytest

from pftrack_sim import trackers
from pftrack_sim.core import boxes
from pftrack_sim.trackers.features.histogram import distance_layout, histogram
from pftrack_sim.trackers.features.online_feature import Normalisation, OnlineFeatureModel, OnlineFeatureParameters
from pftrack_sim.trackers.features.pixel_codes import hsv_joint_codes
from pftrack_sim.trackers.filters import ConstantVelocity
from pftrack_sim.trackers.papers.lee2012 import METHODS
from tests.trackers.following import Scene, followed_boxes

NAMES = sorted(METHODS)


def run(images: list[np.ndarray], box: np.ndarray, name: str = "lee2012", **given: Any) -> np.ndarray:
    return followed_boxes(name, images, box, **given)


def test_the_first_particles_are_all_over_the_image_or_around_the_box():
    image, box = np.zeros((120, 160, 3), np.uint8), np.array([100.0, 20, 20, 40])
    spans = {}
    for start in ("image", "box"):
        still = {"noise_width": 0.0, "noise_height": 0.0, "noise_velocity_x": 0.0, "noise_velocity_y": 0.0}
        tracker = trackers.make("lee2012", preset="paper", start=start, particle_count=1000, particles=True, **still)
        tracker.init(image, box)
        particles = tracker.update(image).particles
        assert particles is not None
        centres = particles[:, :2] + 0.5 * particles[:, 2:]
        assert np.array_equal(np.unique(particles[:, 2:], axis=0), [[20.0, 40.0]])
        spans[start] = np.concatenate([centres.min(axis=0), centres.max(axis=0)])
    assert np.abs(spans["image"] - [0, 0, 160, 120]).max() < 2.0
    assert np.abs(spans["box"] - [108, 36, 112, 44]).max() < 0.5


@pytest.mark.parametrize("name", NAMES)
def test_a_moving_target_is_followed_during_learning(make_scene: Callable[..., Scene], name: str):
    images, truth = make_scene(count=70, step_px=1.0, width=160)
    found = run(images, truth[0], name)
    assert boxes.pairwise_iou(found, truth[1:])[-25:].mean() > 0.6


def test_learning_has_an_effect_from_its_first_frame_only(make_scene: Callable[..., Scene]):
    images, truth = make_scene(count=30)
    learnt, never = (run(images, truth[0], name, window=10) for name in ("lee2012", "lee2012-color-hog"))
    # The first frame and nine estimates make ten vectors: the tenth estimate is the first that is weighed by them.
    assert np.array_equal(learnt[:9], never[:9])
    assert not np.array_equal(learnt[9], never[9])


@pytest.mark.parametrize("scale", ["length", "root"])
def test_learned_distances_have_the_range_of_those_to_the_first_frame(scale: Normalisation):
    """One sigma for (10) to (13) means something only then."""
    rng = np.random.default_rng(0)
    features = rng.dirichlet(np.full(50, 0.2), 60)
    plain = OnlineFeatureParameters(window=30, component_count=3, learned_scale=scale)
    learning = (plain, plain.model_copy(update={"anchored": True}))
    models = [OnlineFeatureModel(features[0], (0.4, 0.4), one) for one in learning]
    before = models[0].likelihood(features)
    for model in models:
        for feature in features[:30]:
            model.learn(feature)
    learned, product = (model.likelihood(features) for model in models)
    for likelihood in (before, learned):
        assert likelihood.max() <= 1 / math.sqrt(2 * math.pi * 0.4**2) + 1e-12
        assert 1.5 < likelihood.max() / likelihood.min() <= math.exp(1 / (2 * 0.4**2))
    assert np.allclose(product, before * learned, rtol=1e-12, atol=0)


def test_checked_learns_from_reliable_estimates_only(make_scene: Callable[..., Scene]):
    images, truth = make_scene(count=20)
    blank = np.full_like(images[0], 30)
    for name, remembers in (("lee2012", False), ("lee2012-checked", True)):
        still = {"noise_unit": "box", "noise_velocity_x": 0.02, "noise_velocity_y": 0.02}
        tracker = trackers.make(name, preset="paper", start="box", window=10, learn_above=0.5, alpha=1.0, **still)
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
    weights = distance_layout(24, 16, 256).weights
    v, u = np.mgrid[:24, :16]
    distance = np.hypot(v - 11.5, u - 7.5)
    expected = 1 - (distance / distance.max()) ** 2
    assert np.allclose(weights / weights.sum(), expected / expected.sum(), rtol=0, atol=1e-12)
    assert weights[0, 0] == weights[-1, -1] == 0


def test_colour_histogram_against_opencv():
    """On a box of exactly 16x24 pixels, against weighted three-dimensional histograms of single pixels by OpenCV."""
    image = np.random.default_rng(0).integers(0, 256, (40, 30, 3), dtype=np.uint8)
    layout = distance_layout(24, 16, 256)
    found = histogram(hsv_joint_codes(image), np.array([5.0, 7, 16, 24]), layout)
    hsv = cv2.cvtColor(image, cv2.COLOR_RGB2HSV_FULL)[7:31, 5:21]
    expected = np.zeros((8, 8, 4))
    for i in range(24):
        for j in range(16):
            one = cv2.calcHist([hsv[i : i + 1, j : j + 1]], [0, 1, 2], None, [8, 8, 4], [0, 256] * 3)
            expected += one * layout.weights[i, j]
    assert np.allclose(found, expected.ravel() / expected.sum(), rtol=0, atol=1e-7)
