"""Deguchi, Kawanaka & Okatani 2004: mean shift with a particle filter beside it."""

from collections.abc import Callable
from functools import partial

import cv2
import numpy as np
import pytest

from pftrack_sim.core import boxes
from tests.trackers.following import Scene, follow

run = partial(follow, "deguchi2004")


def covered(images: list[np.ndarray], first: int, last: int) -> list[np.ndarray]:
    """The images with a grey screen over everything in frames first..last-1."""
    grey = np.random.default_rng(0).integers(90, 130, (*images[0].shape[:2], 1), dtype=np.uint8)
    return [image if not first <= k < last else np.repeat(grey, 3, axis=2) for k, image in enumerate(images)]


def test_mean_shift_alone_follows_without_random_numbers(make_scene: Callable[..., Scene]):
    images, truth = make_scene(count=20, step_px=1.5)
    first, second = (run(images, truth[0], seed=seed) for seed in (0, 1))
    assert [one.box.tolist() for one in first] == [one.box.tolist() for one in second]
    assert not any(one.occluded for one in first)
    assert boxes.pairwise_iou(np.array([one.box for one in first]), truth[1:]).mean() > 0.6


def test_the_particles_take_over_under_a_cover_and_hand_back(make_scene: Callable[..., Scene]):
    images, truth = make_scene(count=26, step_px=0.5)
    found = run(covered(images, 8, 14), truth[0])
    assert [one.occluded for one in found[7:13]] == [True] * 6
    assert not any(one.occluded for one in found[-5:])
    assert boxes.pairwise_iou(np.array([one.box for one in found[-5:]]), truth[-5:]).min() > 0.5


def test_a_jump_out_of_the_box_is_found_by_the_particles(make_scene: Callable[..., Scene]):
    """Mean shift without particles sees nothing of the target beyond the box."""
    images, truth = make_scene(count=20, step_px=1.0, width=240)
    shown, where = [*images[:5], *[np.roll(image, 30, axis=1) for image in images[5:]]], truth.copy()
    where[5:, 0] += 30
    wide = run(shown, truth[0], sigma_centre=1.0, particle_count=300)
    blind = run(shown, truth[0], sigma_centre=0.0)
    assert boxes.iou(wide[-1].box, where[-1]) > 0.5
    assert boxes.iou(blind[-1].box, where[-1]) < 0.2


@pytest.mark.parametrize("growth", [0.8, 1.25])
def test_the_size_follows_the_target(growth: float):
    image = np.full((200, 200, 3), (30, 90, 40), np.uint8)
    shown: list[np.ndarray] = []
    for size in np.linspace(1.0, growth, 30):
        axes = (round(20 * size), round(30 * size))
        shown.append(cv2.ellipse(image.copy(), (100, 100), axes, 0, 0, 360, (200, 40, 60), -1))
    found = run(shown, np.array([78.0, 67, 44, 66]))
    ratio = found[-1].box[3] / 66
    assert abs(ratio - growth) < 0.5 * abs(1 - growth)
