"""Obstacle map and visibility graph, against brute force."""

import itertools

import numpy as np
import pytest

from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap, VisibilityGraph
from pftrack_sim.scene.layout import Footprint, WalkableArea


def layout_of(rng: np.random.Generator, count: int) -> WalkableArea:
    footprints = tuple(
        Footprint(
            f"footprint-{i}",
            (float(rng.uniform(-8, 8)), float(rng.uniform(-8, 8))),
            (float(rng.uniform(0.1, 1.5)), float(rng.uniform(0.1, 1.5))),
            float(rng.uniform(-3, 3)),
        )
        for i in range(count)
    )
    return WalkableArea((-10.0, -10.0, 10.0, 10.0), footprints, ())


def inside(layout: WalkableArea, points: np.ndarray) -> np.ndarray:
    """Whether each of `(N, 2)` points is in a footprint or out of bounds."""
    x_min, y_min, x_max, y_max = layout.bounds_m
    hit = (points < (x_min, y_min)).any(axis=1) | (points > (x_max, y_max)).any(axis=1)
    for footprint in layout.footprints:
        cos, sin = np.cos(footprint.yaw_rad), np.sin(footprint.yaw_rad)
        local = (points - footprint.centre_m) @ np.array([(cos, -sin), (sin, cos)])
        hit |= (np.abs(local) < footprint.half_m).all(axis=1)
    return hit


@pytest.mark.parametrize("seed", range(3))
def test_distance_and_direction_lead_to_the_surface(seed: int) -> None:
    rng = np.random.default_rng(seed)
    layout = layout_of(rng, 6)
    obstacles = ObstacleMap(layout)
    points = rng.uniform(-10, 10, (300, 2))
    assert np.array_equal(obstacles.clearance_m(points) < 0.0, inside(layout, points))
    distance, away = obstacles.distances(points.T), obstacles.directions(points.T)
    assert np.abs(np.hypot(*away) - 1.0).max() <= 1e-9
    for thing in range(distance.shape[1]):
        step = distance[:, thing, None]
        foot = points - step * away[:, :, thing].T
        assert np.abs(obstacles.distances(foot.T)[:, thing]).max() <= 1e-6


@pytest.mark.parametrize("seed", range(3))
def test_blocked_walks_are_those_that_enter_a_rectangle(seed: int) -> None:
    rng = np.random.default_rng(seed)
    layout = layout_of(rng, 6)
    obstacles = ObstacleMap(layout)
    start, ends = rng.uniform(-9, 9, 2), rng.uniform(-9, 9, (100, 2))
    shares = np.linspace(0.0, 1.0, 2001)[:, None]
    brute = np.array([inside(layout, start + shares * (end - start)).any() for end in ends])
    blocked = obstacles.blocked(start, ends, 0.0)
    assert not (brute & ~blocked).any()
    # Sampling may miss a corner that is only just cut.
    assert (blocked & ~brute).sum() <= 1
    reverse = np.array([obstacles.blocked(end, start[None], 0.0)[0] for end in ends])
    assert np.array_equal(reverse, blocked)


@pytest.mark.parametrize("seed", range(4))
def test_routes_keep_clear_of_obstacles_and_are_as_long_both_ways(seed: int) -> None:
    rng = np.random.default_rng(seed)
    layout = layout_of(rng, 10)
    obstacles, found = ObstacleMap(layout), 0
    graph = VisibilityGraph(obstacles)
    shares = np.linspace(0.0, 1.0, 400)[:, None]
    for _ in range(20):
        ends = rng.uniform(-9.5, 9.5, (2, 2))
        if obstacles.clearance_m(ends).min() < 0.45:
            continue
        there, back = graph.shortest_route(ends[0], ends[1]), graph.shortest_route(ends[1], ends[0])
        assert (there is None) == (back is None)
        if there is None or back is None:
            continue
        found += 1
        points = np.vstack([ends[:1], there])
        for a, b in itertools.pairwise(points):
            assert obstacles.clearance_m(a + shares * (b - a)).min() >= 0.35
        lengths = [
            np.hypot(*np.diff(np.vstack([first, walk]), axis=0).T).sum()
            for first, walk in ((ends[:1], there), (ends[1:], back))
        ]
        assert abs(lengths[0] - lengths[1]) <= 1e-6
        assert lengths[0] >= np.hypot(*(ends[1] - ends[0])) - 1e-9
        if not obstacles.blocked(ends[0], ends[1:], 0.4)[0]:
            assert len(there) == 1
    assert found >= 3


def test_there_is_no_route_into_a_closed_room() -> None:
    walls = (
        Footprint("north", (0.0, 2.0), (2.1, 0.1)),
        Footprint("south", (0.0, -2.0), (2.1, 0.1)),
        Footprint("east", (2.0, 0.0), (0.1, 2.1)),
        Footprint("west", (-2.0, 0.0), (0.1, 2.1)),
    )
    graph = VisibilityGraph(ObstacleMap(WalkableArea((-6.0, -6.0, 6.0, 6.0), walls, ())))
    assert graph.shortest_route((-4.0, 0.0), (0.0, 0.0)) is None
    route = graph.shortest_route((-4.0, 0.0), (4.0, 0.0))
    assert route is not None
    assert len(route) >= 3
