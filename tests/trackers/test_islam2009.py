"""Islam, Oh & Lee 2009: shape by distance transforms."""

from functools import partial

import cv2
import numpy as np
import pytest

from pftrack_sim import trackers
from pftrack_sim.trackers.relatives.islam2009 import edge_distances
from tests.trackers.following import Scene, follow

run = partial(follow, "islam2009")


def test_the_first_box_has_similarity_one_and_shape_ignores_colour(scene: Scene):
    images, truth = scene
    still = {"sigma_centre": 0, "sigma_size": 0, "colour_share": 0.0}
    assert run([images[0]] * 2, truth[0], **still)[0].confidence == pytest.approx(1, abs=1e-5)
    grey = np.repeat(cv2.cvtColor(images[0], cv2.COLOR_RGB2GRAY)[..., None], 3, axis=2)
    assert run([images[0], grey], truth[0], **still)[0].confidence > 0.95  # blocks are rounded in each channel
    assert run([images[0], grey], truth[0], **{**still, "colour_share": 1.0})[0].confidence < 0.5


def test_shape_is_compared_at_one_size():
    """Twice the image and twice the box are the same target."""
    rng = np.random.default_rng(3)
    image = cv2.resize(rng.integers(0, 255, (8, 10, 3), dtype=np.uint8), (200, 160), interpolation=cv2.INTER_CUBIC)
    large = cv2.resize(image, None, fx=2, fy=2, interpolation=cv2.INTER_NEAREST)
    box, still = np.array([60.0, 40, 64, 80]), {"sigma_centre": 0, "sigma_size": 0}
    tracker = trackers.make("islam2009", **still)
    tracker.init(image, box)
    placed = trackers.make("islam2009", **still)
    placed.init(large, 2 * box)
    assert np.allclose(placed.template, tracker.template, rtol=0, atol=1e-5)


def test_a_target_without_edges_gives_finite_estimates():
    image = np.full((60, 80, 3), 90, np.uint8)
    for estimate in run([image] * 4, np.array([20.0, 20, 16, 24]), colour_share=0.0):
        assert np.isfinite(estimate.box).all()
        assert estimate.confidence == 0.0


def step(column: int) -> np.ndarray:
    image = np.zeros((40, 60, 3), np.uint8)
    image[:, column:] = 200
    return image


def test_distances_grow_with_the_distance_to_the_edge_up_to_the_cap():
    distances = edge_distances(step(30), (50, 100), 10.0)
    row = distances[20].astype(int)
    edge = int(row.argmin())
    assert row[edge] == 0
    assert abs(edge - 29.5) <= 1
    away = np.abs(np.arange(60) - edge)
    assert np.abs(row - np.minimum(away / 10, 1) * 255).max() <= 0.05 * 255


def test_distances_move_with_the_edge_and_do_not_depend_on_brightness():
    moved = edge_distances(step(33), (50, 100), 10.0)
    assert np.array_equal(moved[:, 10:50], edge_distances(step(30), (50, 100), 10.0)[:, 7:47])
    assert np.array_equal(moved, edge_distances(step(33) // 2 + 40, (50, 100), 10.0))


def test_an_image_without_edges_is_far_from_them_everywhere():
    assert (edge_distances(np.full((8, 9, 3), 70, np.uint8), (50, 100), 4.0) == 255).all()
