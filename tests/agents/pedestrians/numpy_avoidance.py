"""One tick of the reactive pedestrians by formulas on arrays, as the kernels take it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pftrack_sim.agents.pedestrians import kernels as k
from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap


class People(NamedTuple):
    """M reactive pedestrians, the first columns of a `(4, N)` state, and what they want."""

    state: np.ndarray
    vehicle: int
    heading: np.ndarray
    waypoint: np.ndarray
    speed: np.ndarray
    waiting: np.ndarray

    @property
    def extra(self) -> np.ndarray:
        return np.where(np.arange(self.state.shape[1]) >= self.vehicle, k.VEHICLE_EXTRA_M, 0.0)

    def offsets(self) -> tuple[np.ndarray, np.ndarray]:
        count = len(self.waiting)
        offset = self.state[:2, :count, None] - self.state[:2, None]
        offset[0] += np.eye(count, self.state.shape[1]) * k.SENTINEL_M
        return offset, np.sqrt(dot(offset, offset))


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[0] * b[0] + a[1] * b[1]


def wrapped(angle: np.ndarray) -> np.ndarray:
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


def moved(dt: float, people: People, obstacles: ObstacleMap) -> np.ndarray:
    """`(4, M)` state of the reactive pedestrians after a tick."""
    count = len(people.waiting)
    position, velocity = people.state[:2, :count], people.state[2:, :count]
    facing = np.array([np.cos(people.heading), np.sin(people.heading)])
    distance, away = obstacles.distances(position)
    force = social_force(people, facing) + wall_force(distance, away)
    share = np.where(people.waiting, k.WAITING_FORCE_SHARE, 1.0)
    acceleration = (desired_velocity(people) - velocity) / k.RELAXATION_S + force * share
    velocity = velocity + acceleration * (limit_factor(acceleration, k.MAX_ACCELERATION_M_S2) * dt)
    backward = np.maximum(-k.MAX_BACKWARD_M_S - dot(velocity, facing), 0.0)
    velocity = velocity * limit_factor(velocity, k.MAX_SPEED_M_S) + backward * facing
    velocity = wall_barrier(distance, away, person_barrier(people, velocity))
    near_wall = distance.min() < k.MIN_WALL_DISTANCE_M + k.MAX_SPEED_M_S * dt
    after = people.state.copy()
    after[:2, :count], after[2:, :count] = position + velocity * dt, velocity
    return separated(dt, people._replace(state=after), obstacles, position, near_wall=near_wall)[:, :count]


def desired_velocity(people: People) -> np.ndarray:
    offset = people.waypoint - people.state[:2, : len(people.waiting)]
    error = wrapped(np.arctan2(offset[1], offset[0]) - people.heading)
    speed = people.speed * np.maximum(np.cos(error), 0.4)
    approach = np.minimum(np.maximum((np.sqrt(dot(offset, offset)) - 0.15) / 0.8, 0.0), 1.0)
    speed = np.where(people.waiting, speed * approach, speed)
    direction = people.heading + np.clip(error, -k.MAX_HEADING_OFFSET_RAD, k.MAX_HEADING_OFFSET_RAD)
    return speed * np.array([np.cos(direction), np.sin(direction)])


def social_force(people: People, facing: np.ndarray) -> np.ndarray:
    count, state = len(people.waiting), people.state
    weight = np.where(np.arange(state.shape[1]) < count, 1.0, k.NON_REACTIVE_WEIGHT)
    offset, distance = people.offsets()
    velocity = state[2:, :count, None] - state[2:, None]
    speed2 = dot(velocity, velocity) + 1e-4
    ahead = np.minimum(np.maximum(-dot(offset, velocity) / speed2, 0.0), k.LOOKAHEAD_S)
    nearest = offset + velocity * ahead
    bias = np.where(ahead > 0.0, k.PASS_RIGHT_M, 0.0) / np.sqrt(speed2)
    nearest[0] += velocity[1] * bias
    nearest[1] -= velocity[0] * bias
    miss = np.sqrt(dot(nearest, nearest)) + 1e-6
    close = np.minimum((k.FORCE_RADIUS_M + people.extra - miss) / k.FORCE_RANGE_M, 1.5)
    in_front = -dot(offset, facing[..., None]) / distance
    seen = k.WEIGHT_BEHIND + (1.0 - k.WEIGHT_BEHIND) * 0.5 * (1.0 + in_front)
    factor = np.maximum(seen, weight - 1.0) * weight / miss
    strength = k.FORCE_M_S2 * np.exp(close - ahead / k.FORCE_DECAY_S) * factor
    return (strength * nearest).sum(axis=2)


def wall_force(distance: np.ndarray, away: np.ndarray) -> np.ndarray:
    close = np.minimum((k.WALL_DISTANCE_M - distance) / k.WALL_FORCE_RANGE_M, 0.5)
    return (k.WALL_FORCE_M_S2 * np.exp(close) * away).sum(axis=2)


def person_barrier(people: People, velocity: np.ndarray) -> np.ndarray:
    count, everybody = len(people.waiting), people.state[2:].copy()
    offset, distance = people.offsets()
    room = distance - (k.PERSON_DISTANCE_M + people.extra)
    if room.min() > 1.2:
        return velocity
    away = offset / distance
    share = np.where(np.arange(people.state.shape[1]) < count, 0.5, 1.0)
    for _ in range(3):
        everybody[:, :count] = velocity
        lack = -k.BARRIER_RATE_S * room - dot(away, velocity[..., None] - everybody[:, None])
        if lack.max() <= 1e-9:
            break
        velocity = velocity + (np.maximum(lack, 0.0) * share * away).sum(axis=2)
    return velocity


def wall_barrier(distance: np.ndarray, away: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    room, rows = distance - k.WALL_DISTANCE_M, np.arange(len(distance))
    if room.min() > 0.8:
        return velocity
    for _ in range(3):
        lack = -k.BARRIER_RATE_S * room - dot(away, velocity[..., None])
        worst = lack.argmax(axis=1)
        push = np.maximum(lack[rows, worst], 0.0)
        if not push.any():
            break
        velocity = velocity + push * away[:, rows, worst]
    return velocity


def separated(dt: float, people: People, obstacles: ObstacleMap, start: np.ndarray, *, near_wall: bool) -> np.ndarray:
    state, count = people.state, len(people.waiting)
    share, moved = np.where(np.arange(state.shape[1]) < count, 0.5, 1.0), False
    for _ in range(6):
        offset, distance = people.offsets()
        lack = k.MIN_PERSON_DISTANCE_M + people.extra - distance
        crowded = lack.max() > 1e-6
        if not crowded and not near_wall:
            break
        position = state[:2, :count]
        if crowded:
            push = np.maximum(lack, 0.0) * share / np.maximum(distance, 1e-6)
            position = position + (push * offset).sum(axis=2)
        distance, away = obstacles.distances(position)
        lack = np.maximum(k.MIN_WALL_DISTANCE_M - distance, 0.0)
        if not crowded and lack.max() <= 1e-6:
            break
        state[:2, :count] = position + (lack * away).sum(axis=2)
        moved = near_wall = True
    if moved:
        state[2:, :count] = (state[:2, :count] - start) / dt
    return state


def limit_factor(vector: np.ndarray, limit: float) -> np.ndarray:
    return np.minimum(1.0, limit / np.sqrt(dot(vector, vector) + 1e-9))


def turned(dt: float, velocity: np.ndarray, heading: np.ndarray) -> np.ndarray:
    """`(N,)` headings after a tick."""
    error = wrapped(np.arctan2(velocity[1], velocity[0]) - heading)
    rate = np.minimum(np.sqrt(dot(velocity, velocity)) / 0.4, 1.0) * error / k.TURN_TIME_CONSTANT_S
    return heading + np.clip(rate, -k.MAX_TURN_RATE_RAD_S, k.MAX_TURN_RATE_RAD_S) * dt
