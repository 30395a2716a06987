"""The robot's script in open-loop episodes: start pose, route and gaze."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.agents.path import Path
from pftrack_sim.agents.robot.control_laws import (
    BRAKE_M_S2,
    GAZE_DEAD_ZONE_RAD,
    DriveLimits,
    follow_path,
    gaze_rates,
)
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scenario import model as scenario
from pftrack_sim.scenario.axes import TargetAxis

GAP_TIME_CONSTANT_S = 0.8  # Time constant at which the robot closes a gap to its place abreast of the target
_TURN_AWAY_S = 0.35  # Time that the camera needs until the target has left the view
_COME_BACK_S = 0.1  # Time until a part of the target is back in the view
_BODY_RAD = math.radians(14.0)  # Half the angular width of a person, with a margin
_SAMPLE_M = 0.1
_FAR_M = 1e4


class StartPose(NamedTuple):
    """Middle of the axle and heading in the world frame; the pan is None at the rest of the mount."""

    x_m: float
    y_m: float
    heading_rad: float
    pan_rad: float | None = None


class Script:
    """Drives a route relative to the target's path, and keeps the camera on the target.

    Args:
        axis: Variation of the distance to the target, and times at which the camera turns away from it.
        camera: Its field of view decides how far the camera must turn to lose the target.
    """

    def __init__(
        self,
        robot: scenario.Robot,
        target: Path,
        target_speed_m_s: float,
        axis: TargetAxis | None = None,
        camera: scenario.Camera | None = None,
    ) -> None:
        self._axis = axis or TargetAxis()
        view = camera or scenario.Camera()
        half = math.atan(math.tan(math.radians(0.5 * view.fovy_deg)) * view.width_px / view.height_px)
        self._away_rad = half + _BODY_RAD + GAZE_DEAD_ZONE_RAD
        self._robot = robot
        self._target = target
        self._target_speed_m_s = target_speed_m_s
        self._lane = _Lane.of(robot.route, target)
        self._limits = DriveLimits(robot.max_speed_m_s, math.radians(robot.max_turn_deg_s))
        self.reset()

    def reset(self) -> None:
        """Return to the start of the episode."""
        self._s_m = self._lane.start_m if self._lane is not None else 0.0
        self._last_target: tuple[float, float] | None = None

    def start_pose(self) -> StartPose:
        """Pose at time 0: on the route, facing along it; with gaze `"target"` the camera looks at the target."""
        route = self._robot.route
        if isinstance(route, scenario.StillRoute):
            x, y, heading = *route.start_m, math.radians(route.heading_deg)
        else:
            assert self._lane is not None
            x, y, heading = (float(v) for v in self._lane.path.at(self._lane.start_m))
        if self._robot.gaze == "forward":
            return StartPose(x, y, heading)
        target_x, target_y, _ = (float(v) for v in self._target.at(0.0))
        pan = math.remainder(math.atan2(target_y - y, target_x - x) - heading, 2.0 * math.pi)
        return StartPose(x, y, heading, pan)

    def drive(self, time_s: float, pose: tuple[float, float, float], target_s_m: float) -> tuple[float, float]:
        """Forward speed [m/s] and turn rate [rad/s] for the coming tick, from x, y [m], heading [rad] of the robot."""
        speed = self._target_speed(time_s, target_s_m)
        lane = self._lane
        if lane is None:
            return 0.0, 0.0
        self._s_m = lane.path.project(pose[:2], self._s_m)
        route = self._robot.route
        if isinstance(route, scenario.WaypointRoute):
            left = lane.path.length_m - self._s_m
            forward = min(route.speed_m_s, math.sqrt(2.0 * BRAKE_M_S2 * max(left - 0.01, 0.0)))
        else:
            if self._axis.on:
                rate = 2.0 * math.pi / self._axis.period_s
                target_s_m += self._axis.swing_m * math.sin(rate * time_s)
                speed += self._axis.swing_m * rate * math.cos(rate * time_s)
            wanted_m, ratio = lane.abreast(target_s_m)
            forward = ratio * speed + (wanted_m - self._s_m) / GAP_TIME_CONSTANT_S
        return follow_path(lane.path, self._s_m, pose, forward, self._limits)

    def gaze(
        self, T_world_camera: FloatArray, target_m: ArrayLike, tick_s: float, time_s: float = 0.0
    ) -> tuple[float, float]:
        """Pan, tilt rate [rad/s] for the coming tick, from a `(4, 4)` camera pose and `(2,)` x, y of the target."""
        if self._robot.gaze == "forward":
            return 0.0, 0.0
        point = np.asarray(target_m, dtype=np.float64)
        begin_s = self._axis.leave_at_s
        if self._axis.away_s > 0.0 and begin_s - _TURN_AWAY_S <= time_s < begin_s + self._axis.away_s - _COME_BACK_S:
            # To one side of the target, as if it had gone to the other side.
            offset = point - T_world_camera[:2, 3]
            cos, sin = math.cos(self._away_rad), math.sin(self._away_rad)
            rotated = np.array([cos * offset[0] - sin * offset[1], sin * offset[0] + cos * offset[1]])
            point = T_world_camera[:2, 3] + rotated
        return gaze_rates(T_world_camera, point, tick_s)

    def _target_speed(self, time_s: float, target_s_m: float) -> float:
        """Speed of the target along its path since the last tick [m/s]."""
        last, self._last_target = self._last_target, (time_s, target_s_m)
        if last is None or time_s <= last[0]:
            return self._target_speed_m_s
        return (target_s_m - last[1]) / (time_s - last[0])


class _Lane:
    """The robot's path, and its arc length for each arc length of the target.

    Args:
        target_s_m: `(N,)` rising arc lengths of the target [m].
        s_m: `(N,)` arc lengths of the robot that belong to them [m].
    """

    def __init__(self, path: Path, target_s_m: FloatArray, s_m: FloatArray) -> None:
        self.path = path
        # Both paths continue straight beyond their ends: there one metre is one metre.
        self._target_s_m = np.concatenate([target_s_m[:1] - _FAR_M, target_s_m, target_s_m[-1:] + _FAR_M])
        self._s_m = np.concatenate([s_m[:1] - _FAR_M, s_m, s_m[-1:] + _FAR_M])
        self.start_m = self.abreast(0.0)[0]

    @classmethod
    def of(cls, route: scenario.Route, target: Path) -> _Lane | None:
        """The lane of a route; None for a robot that stands still."""
        if isinstance(route, scenario.StillRoute):
            return None
        if isinstance(route, scenario.WaypointRoute):
            return cls(Path(route.points_m), np.zeros(1), np.zeros(1))
        if isinstance(route, scenario.TrailRoute):
            left, lead = route.offset_m, -route.distance_m
        else:
            left, lead = (route.distance_m if route.side == "left" else -route.distance_m), route.lead_m
        path = target.offset(left)
        samples = np.linspace(0.0, target.length_m, 2 + math.ceil(target.length_m / _SAMPLE_M))
        x, y, heading = target.at(samples)
        points = np.stack([x - left * np.sin(heading), y + left * np.cos(heading)], axis=1)
        s_m = np.empty(len(samples))
        near = path.project(points[0], 0.0)
        for index, point in enumerate(points):
            # In a bend sharper than the offset the point abreast runs backwards: the robot waits there.
            near = max(near, path.project(point, near))
            s_m[index] = near
        return cls(path, samples - lead, s_m)

    def abreast(self, target_s_m: float) -> tuple[float, float]:
        """Arc length abreast of the target [m], and its change per metre of the target, averaged over half a metre."""
        around = target_s_m + np.array([-0.25, 0.0, 0.25])
        low, here, high = np.interp(around, self._target_s_m, self._s_m)
        return float(here), float(high - low) / 0.5
