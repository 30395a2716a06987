"""Distance transform of edges."""

import numpy as np

from pftrack_sim.trackers.features.edges import edge_distances


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
