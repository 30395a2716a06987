"""Yang, Duraiswami & Davis 2005: a cascade of observations on quasi-random particles."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from pftrack_sim.trackers.features.image_region import crop
from pftrack_sim.trackers.relatives.yang2005 import STAGES, CascadeRegion, Yang2005, orientation_channels
from tests.trackers.following import Scene, made

ALL = {"keep_colour": 1.0, "keep_orientation": 1.0, "keep_haar": 1.0}


def cascade(scene: Scene, particles: np.ndarray, **given: Any) -> tuple[Yang2005, CascadeRegion]:
    """A tracker of the first box, and what it sees in the second frame."""
    images, truth = scene
    tracker = made(Yang2005, **given)
    tracker.init(images[0], truth[0])
    return tracker, tracker.observe(images[1], np.concatenate([particles, truth[1:2]]))


def log_likelihood(scene: Scene, particles: np.ndarray, **given: Any) -> np.ndarray:
    tracker, seen = cascade(scene, particles, **given)
    return tracker.log_likelihood(seen, particles)


def spread(box: np.ndarray, count: int) -> np.ndarray:
    noise = np.random.default_rng(0).normal(0, 6, (count, 2))
    return np.concatenate([box[:2] + noise, np.tile(box[2:], (count, 1))], axis=1)


def test_every_stage_sees_the_share_that_the_one_before_left(scene: Scene):
    particles = spread(scene[1][1], 200)
    kept = {"keep_colour": 0.4, "keep_orientation": 0.5, "keep_haar": 0.25}
    tracker, seen = cascade(scene, particles, **kept)
    total, observed = tracker.survivors(seen, particles)
    assert [len(observed[stage]) for stage in STAGES] == [200, 80, 40, 10]
    assert np.isfinite(total).sum() == 10
    for before, after in pairwise(STAGES):
        assert set(observed[after]) < set(observed[before])


def test_survivors_have_the_likelihood_that_they_have_without_a_cascade(scene: Scene):
    particles = spread(scene[1][1], 120)
    pruned = log_likelihood(scene, particles)
    full = log_likelihood(scene, particles, **ALL)
    alive = np.isfinite(pruned)
    assert np.allclose(pruned[alive], full[alive], rtol=0, atol=1e-9)
    assert full[alive].mean() > full[~alive].mean()


def test_one_particle_survives_the_smallest_shares(scene: Scene):
    particles = spread(scene[1][1], 3)
    least = {"keep_colour": 0.01, "keep_orientation": 0.01, "keep_haar": 0.01}
    assert np.isfinite(log_likelihood(scene, particles, **least)).sum() == 1


def test_the_true_box_is_more_similar_than_its_neighbours(scene: Scene):
    truth = scene[1][1]
    tracker, seen = cascade(scene, spread(truth, 5))
    assert tracker.similarity(seen, truth) > 0.95
    for shift in ([6, 0, 0, 0], [0, 8, 0, 0], [0, 0, 10, 0], [0, 0, 0, -12]):
        assert tracker.similarity(seen, truth + shift) < 0.8 * tracker.similarity(seen, truth)


def test_haar_features_compare_halves_and_thirds_of_the_box_and_of_its_quarters():
    image, box = np.zeros((48, 48, 3), np.uint8), np.array([[0.0, 0, 48, 48]])
    image[24:, 32:40] = 255  # the middle third of the lower right quarter
    whole, *others, quarter = CascadeRegion(crop(image, box)).features("haar", box)[0].reshape(5, 3)
    assert np.allclose(whole, [-1 / 6, -1 / 6, -1 / 8], rtol=0, atol=1e-9)
    assert np.allclose(others, 0.0, rtol=0, atol=1e-9)
    assert np.allclose(quarter, [0.0, 0.0, 1.0], rtol=0, atol=1e-9)


def ramp(direction_deg: float) -> np.ndarray:
    """Brightness that grows along a direction (y down)."""
    v, u = np.mgrid[:40, :40] - 20.0
    angle = np.radians(direction_deg)
    return (128 + 4 * (u * np.cos(angle) + v * np.sin(angle))).clip(0, 255).astype(np.uint8)


@pytest.mark.parametrize("direction", [10, 33, 80, 100, 170])
def test_a_ramp_lies_in_the_channel_of_its_direction_whichever_way_it_goes(direction: int):
    for turned in (direction, direction + 180):
        energy = orientation_channels(ramp(turned), 8)[5:-5, 5:-5].sum(axis=(0, 1))
        assert int(energy.argmax()) == int(direction * 8 / 180)
        assert energy.max() > 0.6 * energy.sum()


def test_channels_hold_the_magnitude_of_the_gradient_and_nothing_else():
    image = np.random.default_rng(0).integers(0, 255, (20, 30), dtype=np.uint8)
    channels = orientation_channels(image, 5)
    assert channels.shape == (20, 30, 5)
    assert ((channels > 0).sum(axis=2) <= 1).all()
    # The mask of Sobel weighs a slope by eight.
    assert np.allclose(orientation_channels(ramp(0), 5).sum(axis=2)[5:-5, 5:-5], 8 * 4, rtol=0, atol=1e-4)
    assert not orientation_channels(np.full((6, 7), 9, np.uint8), 5).any()
