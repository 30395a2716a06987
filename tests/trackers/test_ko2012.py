"""The methods of Ko et al. 2012."""

from collections.abc import Callable
from functools import partial

import cv2
import numpy as np
import pytest

from pftrack_sim import trackers
from pftrack_sim.core import boxes
from tests.trackers.following import Scene, follow, followed_boxes

run = partial(followed_boxes, "ko2012")


@pytest.mark.parametrize("seed", range(3))
def test_the_paper_s_values_track_motion_within_their_noise(make_scene: Callable[..., Scene], seed: int):
    """Linear weights hardly differ, so that particles drawn by them walk at random."""
    images, truth = make_scene(count=90, width=160, height=120, step_px=1.0)
    overlaps = [
        boxes.pairwise_iou(run(images, truth[0], preset="paper", seed=seed, likelihood=form), truth[1:]).mean()
        for form in ("exponential", "linear")
    ]
    assert overlaps[0] > 0.8
    assert overlaps[1] < 0.7


@pytest.mark.parametrize("followed", [True, False])
def test_a_target_is_found_after_a_cover_whether_or_not_the_turning_camera_follows_it(followed: bool):
    """While the state is kept the scene moves 7 px a frame, in all more than the noise of a held frame."""
    rng = np.random.default_rng(0)
    world = cv2.resize(rng.integers(60, 190, (14, 72, 3), dtype=np.uint8), (640, 120), interpolation=cv2.INTER_CUBIC)
    target = np.zeros((36, 24, 3), np.uint8)
    target[:18, :, 0], target[18:, :, 2] = 255, 255
    images = []
    for index in range(16):
        left = 7 * max(index - 3, 0)
        image = np.ascontiguousarray(world[:, left : left + 320])
        x = 200 if followed else 200 - left
        if index < 4 or index > 12:
            image[40:76, x : x + 24] = target
        images.append(image)
    first, last = np.array([200.0, 40, 24, 36]), np.array([float(x), 40, 24, 36])
    overlaps = [boxes.iou(run(images, first, camera_motion=used)[-1], last) for used in (True, False)]
    assert overlaps[0] > 0.7
    assert (overlaps[1] > 0.7) == followed


def test_a_jump_is_rejected(make_scene: Callable[..., Scene]):
    """Eq. 13: the previous state is kept and reported as occluded."""
    images, truth = make_scene(count=3)
    for estimate in follow("ko2012", images, truth[0], hold_distance=1e-6):
        assert estimate.occluded
        assert np.allclose(estimate.box, truth[0], rtol=0, atol=1e-12)


@pytest.mark.parametrize("frames", [10, 300])
def test_a_covered_target_is_waited_for_where_it_was(make_scene: Callable[..., Scene], frames: int):
    """The state is kept while the similarity is low, for ten seconds too: particles do not leave with the cover."""
    images, truth = make_scene(count=20, step_px=0.5)
    grey = np.random.default_rng(0).integers(90, 130, (*images[0].shape[:2], 1), dtype=np.uint8)
    shown = [*images[:10], *[np.repeat(grey, 3, axis=2)] * frames, *images[10:]]
    found = follow("ko2012", shown, truth[0])
    covered = found[9 : 9 + frames]
    assert all(one.occluded for one in covered)
    assert all(np.array_equal(one.box, found[8].box) for one in covered)
    assert not found[9 + frames].occluded
    assert boxes.pairwise_iou(np.array([one.box for one in found[-5:]]), truth[-5:]).min() > 0.6


@pytest.mark.parametrize("redraw", ["weights", "estimate"])
def test_the_top_one_mean_is_a_particle(scene: Scene, redraw: str):
    images, truth = scene
    for estimate in follow("ko2012", images, truth[0], top_count=1, particles=True, redraw=redraw):
        assert estimate.particles is not None
        assert np.abs(estimate.particles - estimate.box).max(axis=1).min() < 1e-9


@pytest.mark.parametrize(("alone", "alpha"), [("ko2012-hsv-kernel", 0.0), ("ko2012-cslbp", 1.0)])
@pytest.mark.parametrize("likelihood", ["linear", "exponential"])
def test_a_method_of_one_histogram_is_the_proposed_one_without_the_other(
    alone: str, alpha: float, likelihood: str, scene: Scene
):
    images, truth = scene
    found = []
    for name, given in ((alone, {}), ("ko2012", {"alpha": alpha})):
        found.append(follow(name, images, truth[0], seed=2, likelihood=likelihood, **given))
    for one, other in zip(*found, strict=True):
        assert np.allclose(one.box, other.box, rtol=0, atol=1e-6)
        assert one.confidence == pytest.approx(other.confidence, abs=1e-9)


def test_each_histogram_has_its_own_lambda(scene: Scene):
    images, truth = scene
    changes = ({}, {"lambda_colour": 90.0}, {"lambda_texture": 90.0})
    same, other, sharper = (followed_boxes("ko2012-cslbp", images, truth[0], **given).tolist() for given in changes)
    assert same == other != sharper


@pytest.mark.parametrize("name", ["ko2012-rgb", "ko2012-hsv"])
def test_corners_count_only_without_a_kernel(name: str):
    """A change in a corner, outside the inscribed ellipse, has an effect only without the kernel.

    Of the box's 48 x 24 points 6 x 3 change the bin of every channel: the coefficient is sqrt(1 - 1/64) exactly.
    """
    image = np.full((80, 80, 3), (200, 40, 80), np.uint8)
    changed = image.copy()
    changed[10:16, 10:16] = (60, 150, 90)
    confidences = {}
    for one in (name, "ko2012-hsv-kernel"):
        tracker = trackers.make(one, sigma_centre=0, sigma_size=0)
        tracker.init(image, np.array([10.0, 10, 48, 48]))
        confidences[one] = tracker.update(changed).confidence
    assert confidences["ko2012-hsv-kernel"] == pytest.approx(1, abs=1e-6)
    assert confidences[name] == pytest.approx(np.sqrt(63 / 64), abs=1e-6)


def test_correlated_size_noise_keeps_the_shape(scene: Scene):
    images, truth = scene
    found = run(images, truth[0], size_correlation=1.0, sigma_size=0.05, sigma_unit="box")
    assert np.ptp(found[:, 2]) > 0.1
    assert np.allclose(found[:, 2] / found[:, 3], truth[0, 2] / truth[0, 3], rtol=0, atol=1e-3)
