"""The kernels of the avoidance take the steps of the formulas on arrays, to the bit."""

from typing import NamedTuple

import numpy as np
import pytest
from numpy_avoidance import People, moved, turned

from pftrack_sim.agents.pedestrians import kernels
from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap
from pftrack_sim.agents.pedestrians.reactive import ReactivePedestrians
from pftrack_sim.scene.layout import Footprint, WalkableArea


class Goals(NamedTuple):
    """What a `GoalManager` tells of all pedestrians."""

    waypoint_m: np.ndarray
    desired_speed_m_s: np.ndarray
    pace: np.ndarray


def map_of(rng: np.random.Generator, count: int) -> ObstacleMap:
    footprints = [
        Footprint(f"thing-{i}", tuple(rng.normal(0, 4, 2)), tuple(rng.uniform(0.1, 2, 2)), rng.uniform(-3, 3))
        for i in range(count)
    ]
    return ObstacleMap(WalkableArea((-9.0, -8.0, 7.0, 8.0), tuple(footprints), ()))


def test_distances_from_rectangles():
    rng = np.random.default_rng(0)
    obstacles = map_of(rng, 12)
    points = rng.normal(0.0, 5.0, (2, 200))
    distance, away = obstacles.distances(points)
    x, y = points[:, :, None] - obstacles._centre[:, None]
    cos, sin = obstacles._cos, obstacles._sin
    local = np.array([cos * x + sin * y, cos * y - sin * x])
    over = np.abs(local) - obstacles._half[:, None]
    outside = np.maximum(over, 0.0)
    length = np.hypot(*outside)
    inside = length <= 0.0
    assert 20 < inside.sum() < inside.size / 2
    np.testing.assert_array_equal(distance, np.where(inside, over.max(axis=0), length))
    nearer = np.where(inside, np.array([over[0] > over[1], over[0] <= over[1]]), outside)
    u, v = np.copysign(nearer / np.where(inside, 1.0, length), local)
    np.testing.assert_array_equal(away, np.array([cos * u - sin * v, sin * u + cos * v]))


@pytest.mark.parametrize(("people", "footprints", "spread_m"), [(1, 2, 1.0), (6, 9, 1.5), (12, 110, 4.0), (3, 5, 0.4)])
def test_a_tick_of_the_reactive_pedestrians(people: int, footprints: int, spread_m: float):
    rng = np.random.default_rng(people)
    obstacles = map_of(rng, footprints)
    total, dt = people + 4, 1.0 / 30.0
    state, vehicle = rng.normal(0.0, spread_m, (4, total)), people + 2
    state[2:, -1] = 0.0
    heading, waypoints = rng.uniform(-3.0, 3.0, vehicle), rng.normal(0.0, 3.0, (2, vehicle))
    goals = Goals(waypoints, rng.uniform(0.0, 1.5, vehicle), rng.choice([0.0, 0.7, 1.0], vehicle))
    waiting = rng.random(people) < 0.3
    reactive = ReactivePedestrians(
        obstacles, range(people), waiting.tolist(), range(people, vehicle), range(vehicle, total)
    )
    for _ in range(40):
        own = People(
            state,
            vehicle,
            heading[:people],
            waypoints[:, :people],
            (goals.desired_speed_m_s * goals.pace)[:people],
            waiting,
        )
        expected = state.copy()
        expected[:, :people] = moved(dt, own, obstacles)
        reactive.update(dt, state, heading, goals)
        np.testing.assert_array_equal(state, expected)
        velocity = state[2:, :vehicle]
        expected = turned(dt, velocity, heading)
        kernels.turn(dt, velocity, np.arctan2(velocity[1], velocity[0]), heading)
        np.testing.assert_array_equal(heading, expected)
