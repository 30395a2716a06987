"""Motion of the reactive pedestrians: towards their next waypoints, with collision avoidance."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pftrack_sim.agents.gait.kinematics import wrapped
from pftrack_sim.agents.pedestrians import avoidance
from pftrack_sim.agents.pedestrians.goal_manager import GoalManager
from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap
from pftrack_sim.core.types import FloatArray

RELAXATION_S = 0.5  # Time constant of taking up the desired velocity (Helbing and Molnar 1995).
MAX_ACCELERATION_M_S2 = 2.6
MAX_TURN_RATE_RAD_S = math.radians(120.0)
MAX_SPEED_M_S = 2.0
_MAX_HEADING_OFFSET_RAD = 1.1  # Largest angle from the heading to the desired velocity; the rest is turned on the way.
_TURN_TIME_CONSTANT_S = 0.2
_MAX_BACKWARD_M_S = 0.15
_WAITING_FORCE_SHARE = 0.2  # Waiting positions are out of the way: waiting pedestrians give way only at close range.

# Distances restored by shifting positions where the barriers could not keep them.
_MIN_PERSON_DISTANCE_M = 0.47
_MIN_WALL_DISTANCE_M = 0.27


class ReactivePedestrians:
    """The pedestrians that react to others, as columns of a common state.

    Args:
        reactive: Columns of the reactive pedestrians, rising.
        waiting: Whether each of these stays at its waiting position.
        scripted: Columns of the pedestrians that do not react.
        vehicles: Columns of the robot and the carts, after all pedestrians.
    """

    def __init__(
        self,
        obstacles: ObstacleMap,
        reactive: Sequence[int],
        waiting: Sequence[bool],
        scripted: Sequence[int],
        vehicles: Sequence[int],
    ) -> None:
        self._obstacles = obstacles
        self.columns = np.array(reactive, dtype=np.intp)
        self._order = np.array([*reactive, *scripted, *vehicles], dtype=np.intp)
        count, total = len(reactive), len(self._order)
        reacts = np.arange(total) < count
        self._neighbours = avoidance.Neighbours(
            state=np.zeros((4, total)),
            extra_m=np.where(self._order >= vehicles[0], avoidance.VEHICLE_EXTRA_M, 0.0),
            weight=np.where(reacts, 1.0, avoidance.NON_REACTIVE_WEIGHT),
            share=np.where(reacts, 0.5, 1.0),
            reactive=count,
        )
        self._waiting = np.array(waiting, dtype=bool)
        self._force_share = np.where(self._waiting, _WAITING_FORCE_SHARE, 1.0)

    def update(self, dt_s: float, state: FloatArray, heading_rad: FloatArray, goals: GoalManager) -> None:
        """Move the reactive pedestrians by one tick.

        `state` `(4, C)` holds x, y [m], vx, vy [m/s] of everything that moves; the reactive columns are overwritten.
        `heading_rad` `(P,)` are the headings of the pedestrians.
        """
        neighbours = self._neighbours._replace(state=state.take(self._order, axis=1))
        own = neighbours.state[:, : len(self.columns)]
        position, velocity = own[:2], own[2:]
        heading = heading_rad[self.columns]
        facing = np.array([np.cos(heading), np.sin(heading)])
        desired = self._desired_velocity(position, heading, goals)
        distance, away = self._obstacles.distances(position)
        force = avoidance.social_force(neighbours, facing) + avoidance.wall_force(distance, away)
        acceleration = (desired - velocity) / RELAXATION_S + force * self._force_share
        velocity = velocity + acceleration * (_limit_factor(acceleration, MAX_ACCELERATION_M_S2) * dt_s)
        backward = np.maximum(-_MAX_BACKWARD_M_S - avoidance.dot(velocity, facing), 0.0)
        velocity = velocity * _limit_factor(velocity, MAX_SPEED_M_S) + backward * facing
        velocity = avoidance.person_barrier(neighbours, velocity)
        velocity = avoidance.wall_barrier(distance, away, velocity)
        state[:2, self.columns], state[2:, self.columns] = position + velocity * dt_s, velocity
        near_wall = bool(distance.min() < _MIN_WALL_DISTANCE_M + MAX_SPEED_M_S * dt_s)
        self._separate(dt_s, state, position, near_wall=near_wall)

    def _desired_velocity(self, position: FloatArray, heading: FloatArray, goals: GoalManager) -> FloatArray:
        """`(2, M)` velocities towards the next waypoints, along arcs that a walking body can turn."""
        offset = goals.waypoint_m[:, self.columns] - position
        error = wrapped(np.arctan2(offset[1], offset[0]) - heading)
        speed = (goals.desired_speed_m_s * goals.pace)[self.columns] * np.maximum(np.cos(error), 0.4)
        # Waiting pedestrians come to rest at their waiting position, and return to it after stepping aside.
        approach = np.minimum(np.maximum((np.sqrt(avoidance.dot(offset, offset)) - 0.15) / 0.8, 0.0), 1.0)
        speed = np.where(self._waiting, speed * approach, speed)
        direction = heading + np.minimum(np.maximum(error, -_MAX_HEADING_OFFSET_RAD), _MAX_HEADING_OFFSET_RAD)
        return speed * np.array([np.cos(direction), np.sin(direction)])

    def _separate(self, dt_s: float, state: FloatArray, start: FloatArray, *, near_wall: bool) -> None:
        """Shift people out of walls and out of each other where the barriers could not keep the least distances."""
        moved = False
        for _ in range(6):
            neighbours = self._neighbours._replace(state=state.take(self._order, axis=1))
            offset, distance = neighbours.offsets()
            lack = _MIN_PERSON_DISTANCE_M + neighbours.extra_m - distance
            crowded = lack.max() > 1e-6
            if not crowded and not near_wall:
                break
            position = neighbours.state[:2, : len(self.columns)]
            if crowded:
                push = np.maximum(lack, 0.0) * neighbours.share / np.maximum(distance, 1e-6)
                position = position + (push * offset).sum(axis=2)
            wall_distance, away = self._obstacles.distances(position)
            wall_lack = np.maximum(_MIN_WALL_DISTANCE_M - wall_distance, 0.0)
            if not crowded and wall_lack.max() <= 1e-6:
                break
            state[:2, self.columns] = position + (wall_lack * away).sum(axis=2)
            moved = near_wall = True
        if moved:
            state[2:, self.columns] = (state[:2, self.columns] - start) / dt_s


def turn(dt_s: float, velocity: FloatArray, heading_rad: FloatArray) -> None:
    """Turn `(N,)` headings in place towards `(2, N)` velocities, at no more than `MAX_TURN_RATE_RAD_S`."""
    error = wrapped(np.arctan2(velocity[1], velocity[0]) - heading_rad)
    share = np.minimum(np.sqrt(avoidance.dot(velocity, velocity)) / 0.4, 1.0)
    rate = np.maximum(share * error / _TURN_TIME_CONSTANT_S, -MAX_TURN_RATE_RAD_S)
    heading_rad += np.minimum(rate, MAX_TURN_RATE_RAD_S) * dt_s


def _limit_factor(vector: FloatArray, limit: float) -> FloatArray:
    """`(M,)` factors that shorten `(2, M)` vectors to a length."""
    return np.minimum(1.0, limit / np.sqrt(avoidance.dot(vector, vector) + 1e-9))
