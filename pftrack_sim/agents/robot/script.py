"""The robot's script in open-loop episodes: start pose, route and gaze."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pftrack_sim.agents.path import Path
from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap, Xy
from pftrack_sim.agents.robot.head import GAZE_DEAD_ZONE_RAD, Events, Head
from pftrack_sim.agents.robot.lane import BRAKE_M_S2, Lane, Nearness
from pftrack_sim.core.random_streams import stream
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scenario import robot as scenario
from pftrack_sim.scenario.axes import TargetAxis
from pftrack_sim.scenario.camera import Camera
from pftrack_sim.scenario.people import GAZE_M
from pftrack_sim.scene.layout import WalkableArea

_BRAKE_S = 1.2  # Time that the base needs to brake from a walking speed, before it turns on the spot
_STOP_GAP_M = 2.0  # A stop ends when the target has gone on by this much
_NEAREST_M = 1.3  # Never driven nearer to the target than this
_GAP_TIME_CONSTANT_S = 0.8  # Time constant at which the robot closes a gap to its place abreast of the target
_TURN_AWAY_S = 0.35  # Time that the camera needs until the target has left the view
_COME_BACK_S = 0.1  # Time until a part of the target is back in the view
_CHECK_M = 0.1
_NEAR_M = 0.25  # Farther along its route the robot never gets in a tick
_BODY_RAD = math.radians(14.0)  # Half the angular width of a person, with a margin


class StartPose(NamedTuple):
    """Middle of the axle and heading in the world frame; the pan is None at the rest of the mount."""

    x_m: float
    y_m: float
    heading_rad: float
    pan_rad: float | None = None


class Stops:
    """When the base stands, and how it turns there."""

    def __init__(self, operator: scenario.Operator, seed: int) -> None:
        rng = stream(seed, "operator", "stops")
        self._events = Events(operator.stops_per_minute, _BRAKE_S + operator.stop_s, rng)
        self._turn_rad = math.radians(operator.stop_turn_deg)

    def turn_rad_s(self, time_s: float) -> float | None:
        """Turn rate in a stop: one period of a sine, out and back, once the base stands. None: no stop."""
        event = self._events.at(time_s)
        if event is None:
            return None
        length = event.length_s - _BRAKE_S
        since = time_s - event.begin_s - _BRAKE_S
        if self._turn_rad == 0.0 or since <= 0.0 or length <= 0.0:
            return 0.0
        # Half a period of A sin(2 pi t / T) turns by A T / pi.
        amplitude = math.pi * math.copysign(self._turn_rad, event.size) / length
        return amplitude * math.sin(2.0 * math.pi * since / length)


class Script:
    """Drives a route relative to the target's path, and keeps the camera on the target.

    Args:
        axis: Variation of the distance to the target, and times at which the camera turns away from it.
        camera: Its field of view decides how far the camera must turn to lose the target.
        layout: Walls and furniture that the operator's swings keep clear of; None for none.
        seed: Of the operator's random streams.
        gaze_m: Height of the point of the target that the camera is turned to.

    Raises:
        ParameterError: There is no room for the operator's swings.
    """

    def __init__(
        self,
        robot: scenario.Robot,
        target: Path,
        target_speed_m_s: float,
        axis: TargetAxis | None = None,
        camera: Camera | None = None,
        layout: WalkableArea | None = None,
        seed: int = 0,
        gaze_m: float = GAZE_M,
    ) -> None:
        self._axis = axis or TargetAxis()
        half, half_v = (camera or Camera()).half_view_rad
        self._away_rad = half + _BODY_RAD + GAZE_DEAD_ZONE_RAD
        self._robot = robot
        self._target = target
        self._target_speed_m_s = target_speed_m_s
        operator, head_limits = robot.operator, (math.radians(robot.max_pan_deg_s), math.radians(robot.max_tilt_deg_s))
        self._head = Head(operator, (half, half_v), head_limits, seed, gaze_m)
        self._stops, self._nearness = Stops(operator, seed), Nearness(operator, seed)
        lane = Lane.of(robot, target)
        if lane is not None and layout is not None:
            lane = lane.swung(target_speed_m_s, ObstacleMap(layout), seed)
        self._lane = lane
        self.reset()

    @property
    def drives(self) -> bool:
        """Whether the robot has a way to drive."""
        return self._lane is not None

    def reset(self) -> None:
        """Return to the start of the episode."""
        self._s_m = self._lane.start_m if self._lane is not None else 0.0
        self._last_target: tuple[float, float] | None = None
        self._head.reset()

    def obstacle(self, layout: WalkableArea, duration_s: float) -> tuple[str, float, float] | None:
        """The first footprint that the robot would run into, and x, y [m] where it would; None if the way is clear."""
        if self._lane is None or not layout.footprints:
            return None
        route = self._robot.route
        if isinstance(route, scenario.WaypointRoute):
            end_m = min(self._lane.path.length_m, route.speed_m_s * duration_s)
        else:
            end_m = self._lane.abreast(min(self._target.length_m, self._target_speed_m_s * duration_s))[0]
        way = np.arange(self._lane.start_m, max(end_m, self._lane.start_m) + _CHECK_M, _CHECK_M)
        points = np.stack(self._lane.path.at(way)[:2])
        distances = ObstacleMap(layout).distances(points)[:, : len(layout.footprints)]
        hits = np.flatnonzero(distances.min(axis=1) < self._robot.half_width_m)
        if len(hits) == 0:
            return None
        first = int(hits[0])
        nearest = layout.footprints[int(np.argmin(distances[first]))]
        return nearest.name, float(points[0, first]), float(points[1, first])

    def start_pose(self) -> StartPose:
        """Pose at time 0: on the route, facing along it; with gaze `"target"` the camera looks at the target."""
        route = self._robot.route
        if isinstance(route, scenario.StillRoute):
            x, y, heading = *route.start_m, math.radians(route.heading_deg)
        else:
            assert self._lane is not None
            x, y, heading = self._lane.path.pose(self._lane.start_m)
        if self._robot.gaze == "forward":
            return StartPose(x, y, heading)
        target_x, target_y, _ = self._target.pose(0.0)
        pan = math.remainder(math.atan2(target_y - y, target_x - x) - heading, 2.0 * math.pi)
        return StartPose(x, y, heading, pan)

    def drive(self, time_s: float, pose: tuple[float, float, float], target_s_m: float) -> tuple[float, float]:
        """Forward speed [m/s] and turn rate [rad/s] for the coming tick, from x, y [m], heading [rad] of the robot."""
        speed = self._target_speed(time_s, target_s_m)
        lane, turn = self._lane, self._stops.turn_rad_s(time_s)
        if lane is None:
            return 0.0, turn or 0.0
        self._s_m = lane.path.project(pose[:2], self._s_m, _NEAR_M)
        route = self._robot.route
        if isinstance(route, scenario.WaypointRoute):
            left, gap_m = lane.path.length_m - self._s_m, 0.0
            forward = min(route.speed_m_s, math.sqrt(2.0 * BRAKE_M_S2 * max(left - 0.01, 0.0)))
        else:
            if self._axis.on:
                rate = 2.0 * math.pi / self._axis.period_s
                target_s_m += self._axis.swing_m * math.sin(rate * time_s)
                speed += self._axis.swing_m * rate * math.cos(rate * time_s)
            if isinstance(route, scenario.TrailRoute):
                factor, rate = self._nearness.at(time_s)
                nearest_m = min(_NEAREST_M, route.distance_m)
                target_s_m += route.distance_m - max(factor * route.distance_m, nearest_m)
                speed -= rate * route.distance_m
            wanted_m, ratio = lane.abreast(target_s_m)
            gap_m = wanted_m - self._s_m
            forward = ratio * speed + gap_m / _GAP_TIME_CONSTANT_S
        if turn is not None and gap_m < _STOP_GAP_M:
            return 0.0, turn
        return lane.follow(self._s_m, pose, forward)

    def gaze(self, T_world_camera: FloatArray, target_m: Xy, tick_s: float, time_s: float = 0.0) -> tuple[float, float]:
        """Pan, tilt rate [rad/s] for the coming tick, from a `(4, 4)` camera pose and x, y of the target."""
        if self._robot.gaze == "forward":
            return 0.0, 0.0
        begin_s = self._axis.leave_at_s
        if self._axis.away_s > 0.0 and begin_s - _TURN_AWAY_S <= time_s < begin_s + self._axis.away_s - _COME_BACK_S:
            # To one side of the target, as if it had gone to the other side.
            x, y = T_world_camera[:2, 3].tolist()
            right, up = target_m[0] - x, target_m[1] - y
            cos, sin = math.cos(self._away_rad), math.sin(self._away_rad)
            target_m = x + (cos * right - sin * up), y + (sin * right + cos * up)
        return self._head.rates(T_world_camera, target_m, tick_s, time_s)

    def _target_speed(self, time_s: float, target_s_m: float) -> float:
        """Speed of the target along its path since the last tick [m/s]."""
        last, self._last_target = self._last_target, (time_s, target_s_m)
        if last is None or time_s <= last[0]:
            return self._target_speed_m_s
        return (target_s_m - last[1]) / (time_s - last[0])
