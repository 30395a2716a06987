"""Pedestrians and carts that cover the line of sight from the camera to the target at a given time.

Their trajectory is defined in the frame of the line of sight, which is known only while the episode runs: during the
cover, the mover stays at a share of the distance and moves across the line of sight, from one half width on one side to
one half width on the other. Approach and exit join this part with continuous position, velocity and acceleration.

Movers read and write `(4,)` columns x, y [m], vx, vy [m/s] of the crowd's state. In all phases except `SCRIPTED`,
pedestrians are moved as reactive ones.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum, auto
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from pftrack_sim.agents.pedestrians.avoidance import BARRIER_RATE_S, WALL_DISTANCE_M
from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap, Xy
from pftrack_sim.agents.pedestrians.target import Walk
from pftrack_sim.core.types import BoolArray, FloatArray

WALKER_HALF_WIDTH_M = 0.22  # Effective half width of a person, averaged over viewing directions.
CAMERA_DISTANCE_M = 0.75  # Least distances along the line of sight from the camera and from the target.
TARGET_DISTANCE_M = 0.65
_EXIT_RAMP_S = 1.0
_EXIT_MARGIN_M = 0.9
_EXIT_LIMIT_S = 3.0
_WALKING_SPEED_M_S = 1.25
_LINEAR_SHARE = 0.15  # Share of the way across at constant speed where the edges pass faster than the middle.

# Crossing pedestrians and carts; the distances hold before and after the cover.
_CROSSING_SPEED_LIMIT_M_S = 2.8
_CROSSING_TARGET_DISTANCE_M = 0.55
_CROSSING_ROBOT_DISTANCE_M = 0.7
_CART_SPEED_LIMIT_M_S = 3.2
_CART_BRAKING_M_S2 = 1.2
_CART_WALL_DISTANCE_M = 0.5
_CART_TARGET_DISTANCE_M = 0.85
_CART_ROBOT_DISTANCE_M = 0.9
_CART_YAW_TIME_CONSTANT_S = 0.25


@dataclass(frozen=True)
class Crossing:
    """Time and place of one cover of the line of sight.

    Attributes:
        at_s: Time at which the target's centre line becomes covered.
        duration_s: Time for which it stays covered.
        depth: Position on the line of sight as a share of the distance from the camera (0) to the target (1).
        side: Side from which the mover enters, seen from the camera: 1 left, -1 right.
        waiting_m: x, y of its waiting position [m], world frame.
        lead_s: Time before `at_s` at which it starts to move.
        half_width_m: Half of the width that covers the line of sight.
        edge_m_s: Speed across the line of sight while an edge passes it, slower in between; None for one constant
            speed, which covers and uncovers the target gradually.
    """

    at_s: float
    duration_s: float
    depth: float
    side: Literal[-1, 1]
    waiting_m: Xy
    lead_s: float
    half_width_m: float = WALKER_HALF_WIDTH_M
    edge_m_s: float | None = None

    @cached_property
    def start_s(self) -> float:
        """Time at which the mover starts to move."""
        return self.at_s - self.lead_s

    @cached_property
    def until_s(self) -> float:
        """Time at which the target's centre line is uncovered."""
        return self.at_s + self.duration_s

    @cached_property
    def rate_m_s(self) -> float:
        """Speed across the line of sight at the beginning and the end of the cover."""
        return max(2.0 * self.half_width_m / self.duration_s, self.edge_m_s or 0.0)

    def lateral_m(self, before_s: float) -> float:
        """Offset from the line of sight during the cover, at `before_s` before its middle; an odd function.

        It is a power of the time, with `rate_m_s` at both ends, and a linear part, so that the mover never stands.
        """
        half_s = 0.5 * self.duration_s
        steepness = self.rate_m_s * half_s / self.half_width_m
        if steepness <= 1.0 + 1e-9:
            return self.half_width_m * before_s / half_s
        power = (steepness - _LINEAR_SHARE) / (1.0 - _LINEAR_SHARE)
        share = before_s / half_s
        return self.half_width_m * share * (_LINEAR_SHARE + (1.0 - _LINEAR_SHARE) * abs(share) ** (power - 1.0))


class OcclusionTrajectory:
    """The trajectory of one crossing, evaluated while the episode runs."""

    def __init__(self, crossing: Crossing) -> None:
        self.crossing = crossing
        self._updates = 0
        self._reference: Xy = (0.0, 0.0)
        self._reference_velocity: Xy = (0.0, 0.0)
        self._begin_s: float | None = None
        self._offset: Xy = (0.0, 0.0)
        self._offset_rate: Xy = (0.0, 0.0)
        self._exit_rate_m_s: float | None = None

    def update(
        self,
        dt_s: float,
        time_s: float,
        camera_m: Xy,
        target_m: Xy,
        position_m: Xy,
        velocity_m_s: Xy,
        reach_m: float = 0.0,
    ) -> Xy | None:
        """Position of the mover [m] at the end of a tick, or None while it waits.

        Camera and target are on the ground then, position and velocity those of the mover at the beginning of the tick.
        A mover that starts in the first two updates is already moving, with the line of sight. `reach_m` is how much
        farther the target reaches towards the camera than a person on foot.
        """
        ux, uy, along = _point_on_sight(self.crossing.depth, camera_m, target_m, reach_m)
        lateral = self._lateral_m(time_s)
        reference = camera_m[0] + along * ux - lateral * uy, camera_m[1] + along * uy + lateral * ux
        before, self._reference = self._reference, reference
        if self._updates == 0:
            before, dt_s = reference, 0.0
        else:
            self._reference_velocity = ((reference[0] - before[0]) / dt_s, (reference[1] - before[1]) / dt_s)
        self._updates += 1
        if self._begin_s is None:
            if time_s < self.crossing.start_s:
                return None
            self._begin_s = time_s - dt_s
            self._offset = (position_m[0] - before[0], position_m[1] - before[1])
            if self._updates > 2:
                vx, vy = self._reference_velocity
                self._offset_rate = (velocity_m_s[0] - vx, velocity_m_s[1] - vy)
        span = self.crossing.at_s - self._begin_s
        if time_s >= self.crossing.at_s or span <= 0.0:
            return reference
        # The offset from the reference decays by a quintic, from its initial value and rate to zero.
        x = (time_s - self._begin_s) / span
        offset = 1.0 - x**3 * (10.0 - 15.0 * x + 6.0 * x * x)
        rate = span * (x - x**3 * (6.0 - 8.0 * x + 3.0 * x * x))
        return (
            reference[0] + offset * self._offset[0] + rate * self._offset_rate[0],
            reference[1] + offset * self._offset[1] + rate * self._offset_rate[1],
        )

    def finished(self, time_s: float) -> bool:
        """Whether the mover is clear of the line of sight after the cover."""
        over_s = time_s - self.crossing.until_s
        if over_s <= 0.0:
            return False
        clear = abs(self._lateral_m(time_s)) > self.crossing.half_width_m + _EXIT_MARGIN_M
        return clear or over_s > _EXIT_LIMIT_S

    def _lateral_m(self, time_s: float) -> float:
        """Offset to the left of the line of sight."""
        crossing = self.crossing
        half, rate = crossing.half_width_m, crossing.rate_m_s
        over_s = time_s - crossing.until_s
        if over_s <= 0.0:
            if crossing.edge_m_s is None or time_s <= crossing.at_s:
                return crossing.side * (half - rate * (time_s - crossing.at_s))
            return crossing.side * crossing.lateral_m(-over_s - 0.5 * crossing.duration_s)
        if self._exit_rate_m_s is None:
            # The speed at the end of the cover includes `rate`; the exit rate makes it that of walking.
            speed = math.hypot(*self._reference_velocity)
            self._exit_rate_m_s = min(max(rate + _WALKING_SPEED_M_S - speed, 0.55), 1.4)
        x = min(over_s / _EXIT_RAMP_S, 1.0)
        ramped = _EXIT_RAMP_S * (x**3 - 0.5 * x**4) + max(over_s - _EXIT_RAMP_S, 0.0)
        return -crossing.side * (half + rate * over_s + (self._exit_rate_m_s - rate) * ramped)


def _point_on_sight(depth: float, camera_m: Xy, target_m: Xy, reach_m: float) -> tuple[float, float, float]:
    """Unit vector x, y of the line of sight, and the distance along it at which to cross [m]."""
    dx, dy = target_m[0] - camera_m[0], target_m[1] - camera_m[1]
    distance = math.hypot(dx, dy)
    if distance < 1e-6:
        return 1.0, 0.0, 0.0
    farthest = distance - reach_m - TARGET_DISTANCE_M
    if farthest < CAMERA_DISTANCE_M:
        return dx / distance, dy / distance, 0.5 * (distance - reach_m)
    return dx / distance, dy / distance, min(max(depth * distance, CAMERA_DISTANCE_M), farthest)


class Phase(Enum):
    """Phases in their order: at the waiting position, on the way to the script (oncoming only), in it, after it."""

    WAITING = auto()
    APPROACHING = auto()
    SCRIPTED = auto()
    RELEASED = auto()


class Surroundings(NamedTuple):
    """Positions x, y [m] of camera and robot on the ground at the end of a tick, and the target there."""

    camera_m: Xy
    robot_m: Xy
    target: Walk

    @property
    def target_m(self) -> Xy:
        """x, y of the target [m]."""
        return self.target.state[:2]

    @property
    def reach_m(self) -> float:
        """How much farther the target reaches towards the camera than a person on foot."""
        (x, y), (target_x, target_y) = self.camera_m, self.target_m
        return self.target.outline.reach_m(self.target.heading_rad, math.atan2(y - target_y, x - target_x))

    def off_target(self, point_m: Xy, distance_m: float) -> Xy:
        """The point, or the nearest at that distance from the target, to which its outline adds."""
        outline = self.target.outline
        nearest_m = outline.nearest(self.target_m, self.target.heading_rad, point_m)
        return outside_circle(point_m, nearest_m, distance_m + outline.extra_m)


class _Crosser:
    """What covers the line of sight from the camera to the target once."""

    def __init__(self, crossing: Crossing, obstacles: ObstacleMap, state: FloatArray) -> None:
        self.crossing, self._obstacles = crossing, obstacles
        self.state, self.phase = state, Phase.WAITING
        self._trajectory = OcclusionTrajectory(crossing)

    def _wanted_m(self, dt_s: float, time_s: float, around: Surroundings) -> Xy | None:
        """Where the trajectory leads in a tick; None while it waits."""
        x, y, vx, vy = self.state.tolist()
        sight = around.camera_m, around.target_m
        return self._trajectory.update(dt_s, time_s, *sight, (x, y), (vx, vy), around.reach_m)


class CrossingPedestrian(_Crosser):
    """A pedestrian that crosses; it is released as soon as the target is uncovered and anything is in its way."""

    def update(self, dt_s: float, time_s: float, around: Surroundings) -> None:
        """Advance phase and state by one tick that ends at `time_s`."""
        if self.phase is Phase.RELEASED:
            return
        crossing, trajectory = self.crossing, self._trajectory
        if time_s + 3.0 * dt_s < crossing.start_s:
            return  # The start needs the trajectory of the last ticks.
        desired = self._wanted_m(dt_s, time_s, around)
        if desired is None:
            return
        self.phase = Phase.SCRIPTED
        if not crossing.at_s <= time_s <= crossing.until_s:
            detour = around.off_target(desired, _CROSSING_TARGET_DISTANCE_M)
            detour = outside_circle(detour, around.robot_m, _CROSSING_ROBOT_DISTANCE_M)
            # After the cover, timing does not matter: the pedestrian is released as soon as anything is in its way.
            if trajectory.finished(time_s) or (time_s > crossing.until_s and self._blocked(dt_s, desired, detour)):
                self.phase = Phase.RELEASED
                return
            desired = self._obstacles.pushed_out(detour, WALL_DISTANCE_M)
        step_towards(self.state, dt_s, desired, _CROSSING_SPEED_LIMIT_M_S)

    def _blocked(self, dt_s: float, desired: Xy, detour: Xy) -> bool:
        """Whether the target, the robot or an obstacle is in the way to the desired position."""
        if detour != desired:
            return True
        position = self.state[:2, None]
        vx, vy = (np.array(desired)[:, None] - position) / dt_s
        distance, (away_x, away_y) = self._obstacles.distances(position), self._obstacles.directions(position)
        opening = away_x * vx + away_y * vy
        return bool((opening < -BARRIER_RATE_S * (distance - WALL_DISTANCE_M)).any())


class Cart(_Crosser):
    """An omnidirectional cart that covers the line of sight once, keeps its broad side towards the camera, and stops.

    Attributes:
        yaw_rad: Direction of the line of sight on which it faces the camera.
    """

    def __init__(self, crossing: Crossing, obstacles: ObstacleMap, state: FloatArray) -> None:
        super().__init__(crossing, obstacles, state)
        self.yaw_rad, self._faces = 0.0, False
        state[:] = (*crossing.waiting_m, 0.0, 0.0)

    @property
    def position_m(self) -> Xy:
        """x, y [m], world frame."""
        return float(self.state[0]), float(self.state[1])

    def update(self, dt_s: float, time_s: float, around: Surroundings) -> None:
        """Advance phase and state by one tick that ends at `time_s`."""
        crossing, desired = self.crossing, self._wanted_m(dt_s, time_s, around)
        (camera_x, camera_y), (target_x, target_y) = around.camera_m, around.target_m
        sight_rad = math.atan2(target_y - camera_y, target_x - camera_x)
        if not self._faces:
            self.yaw_rad, self._faces = sight_rad, True
        if desired is None:
            return
        if self.phase is not Phase.RELEASED:
            self.phase = Phase.SCRIPTED
            turn_rad = math.remainder(sight_rad - self.yaw_rad, 2.0 * math.pi)
            self.yaw_rad += min(dt_s / _CART_YAW_TIME_CONSTANT_S, 1.0) * turn_rad
        else:
            x, y, vx, vy = self.state.tolist()
            speed = math.hypot(vx, vy)
            share = max(speed - _CART_BRAKING_M_S2 * dt_s, 0.0) / speed if speed > 0.0 else 0.0
            desired = x + share * vx * dt_s, y + share * vy * dt_s
        if not crossing.at_s <= time_s <= crossing.until_s:
            desired = around.off_target(desired, _CART_TARGET_DISTANCE_M)
            desired = outside_circle(desired, around.robot_m, _CART_ROBOT_DISTANCE_M)
            desired = self._obstacles.pushed_out(desired, _CART_WALL_DISTANCE_M)
        step_towards(self.state, dt_s, desired, _CART_SPEED_LIMIT_M_S)
        if self._trajectory.finished(time_s):
            self.phase = Phase.RELEASED


def crossing_track(
    crossing: Crossing, start_s: float, dt_s: float, camera_m: FloatArray, target_m: FloatArray
) -> FloatArray:
    """`(K, 2)` positions of a mover [m] until its crossing is finished, NaN afterwards.

    Camera and target are `(K, 2)` recorded positions on the ground at `start_s`, `start_s + dt_s`, ...
    """
    trajectory = OcclusionTrajectory(crossing)
    track = np.full((len(camera_m), 2), np.nan)
    for index, (camera, target) in enumerate(zip(camera_m.tolist(), target_m.tolist(), strict=True)):
        time_s = start_s + index * dt_s
        place = trajectory.update(dt_s, time_s, camera, target, crossing.waiting_m, (0.0, 0.0))
        track[index] = place or crossing.waiting_m
        if trajectory.finished(time_s):
            break
    return track


def at_different_depths(crossings: Sequence[Crossing]) -> tuple[Crossing, ...]:
    """The crossings, with depths changed where two at the same time would collide."""
    kept: list[Crossing] = []
    for crossing in crossings:
        depth = crossing.depth
        near = [k.depth for k in kept if k.at_s - 2.0 < crossing.until_s and crossing.at_s - 2.0 < k.until_s]
        if any(abs(depth - other) < 0.2 for other in near):
            options = [d for d in np.linspace(0.2, 0.9, 15) if all(abs(d - other) >= 0.2 for other in near)]
            depth = float(min(options, key=lambda d: abs(d - crossing.depth))) if options else depth
        kept.append(replace(crossing, depth=depth))
    return tuple(kept)


def covered_by_person(
    camera_m: FloatArray, target_m: FloatArray, person_m: FloatArray, half_width_m: float
) -> BoolArray:
    """`(..., T)` whether a person at `(..., T, 2)`, of a half width, is between camera and target `(T, 2)`."""
    sight = target_m - camera_m
    distance = np.maximum(np.hypot(*sight.T), 1e-9)
    offset = person_m - camera_m
    along = (offset * sight).sum(axis=-1) / distance
    across = (sight[:, 0] * offset[..., 1] - sight[:, 1] * offset[..., 0]) / distance
    return (np.abs(across) <= half_width_m) & (along > 0.0) & (along < distance)


def outside_circle(point_m: Xy, centre_m: Sequence[float], radius_m: float) -> Xy:
    """The point, or the nearest point on the circle if it is inside."""
    dx, dy = point_m[0] - centre_m[0], point_m[1] - centre_m[1]
    length = math.hypot(dx, dy)
    if length >= radius_m or length < 1e-9:
        return point_m
    return centre_m[0] + dx * radius_m / length, centre_m[1] + dy * radius_m / length


def step_towards(state: FloatArray, dt_s: float, desired: Xy, speed_limit_m_s: float) -> None:
    """Step towards a position, within a speed limit."""
    x, y = state[:2].tolist()
    dx, dy = desired[0] - x, desired[1] - y
    share = min(speed_limit_m_s * dt_s / max(math.hypot(dx, dy), 1e-9), 1.0)
    state[:] = x + share * dx, y + share * dy, share * dx / dt_s, share * dy / dt_s
