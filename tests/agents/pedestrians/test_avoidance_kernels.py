"""The kernels of the avoidance take the steps of the formulas on arrays, to the bit."""

import numpy as np

from pftrack_sim.agents.pedestrians import kernels
from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap
from pftrack_sim.scene.layout import Footprint, WalkableArea


def test_distances_from_rectangles():
    rng = np.random.default_rng(0)
    footprints = [
        Footprint(f"thing-{i}", tuple(rng.normal(0, 4, 2)), tuple(rng.uniform(0.1, 2, 2)), rng.uniform(-3, 3))
        for i in range(12)
    ]
    obstacles = ObstacleMap(WalkableArea((-9.0, -8.0, 7.0, 8.0), tuple(footprints), ()))
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


def test_closest_approach():
    rng = np.random.default_rng(1)
    people, state = 5, rng.normal(0.0, 2.0, (4, 9))
    state[2:, 3] = 0.0
    heading, extra, weight = rng.uniform(-3.0, 3.0, people), rng.uniform(0.0, 0.3, 9), rng.choice([1.0, 1.7], 9)
    facing = np.array([np.cos(heading), np.sin(heading)])
    logarithm, factor, nearest = kernels.closest_approach(state, facing, extra, weight)
    offset = state[:2, :people, None] - state[:2, None]
    offset[0] += np.eye(people, 9) * kernels.SENTINEL_M
    distance = np.sqrt(offset[0] * offset[0] + offset[1] * offset[1])
    for found, expected in zip(kernels.offsets_between(state, people), (offset, distance), strict=True):
        np.testing.assert_array_equal(found, expected)
    velocity = state[2:, :people, None] - state[2:, None]
    speed2 = velocity[0] * velocity[0] + velocity[1] * velocity[1] + 1e-4
    closing = offset[0] * velocity[0] + offset[1] * velocity[1]
    ahead = np.minimum(np.maximum(-closing / speed2, 0.0), kernels.LOOKAHEAD_S)
    assert 0.2 < (ahead > 0.0).mean() < 0.8
    expected = offset + velocity * ahead
    bias = np.where(ahead > 0.0, kernels.PASS_RIGHT_M, 0.0) / np.sqrt(speed2)
    expected[0] += velocity[1] * bias
    expected[1] -= velocity[0] * bias
    np.testing.assert_array_equal(nearest, expected)
    miss = np.sqrt(expected[0] * expected[0] + expected[1] * expected[1]) + 1e-6
    close = np.minimum((kernels.FORCE_RADIUS_M + extra - miss) / kernels.FORCE_RANGE_M, 1.5)
    np.testing.assert_array_equal(logarithm, close - ahead / kernels.FORCE_DECAY_S)
    in_front = -(offset[0] * facing[0][:, None] + offset[1] * facing[1][:, None]) / distance
    seen = kernels.WEIGHT_BEHIND + (1.0 - kernels.WEIGHT_BEHIND) * 0.5 * (1.0 + in_front)
    np.testing.assert_array_equal(factor, np.maximum(seen, weight - 1.0) * weight / miss)
