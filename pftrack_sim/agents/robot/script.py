"""The robot's script in open-loop episodes: where it starts, where it drives, where its camera looks."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.agents.path import Path
from pftrack_sim.agents.robot import gaze, steering
from pftrack_sim.scenario import model as scenario
from pftrack_sim.scenario.axes import TargetAxis

GAP_S = 0.8
"""Time constant at which a gap to where the robot should be is closed."""

BRAKE_M_S2 = 0.8
"""Deceleration to a stop at the end of a route."""

_TURN_AWAY_S = 0.35
_COME_BACK_S = 0.1
"""How long the camera needs to turn so far that the target leaves the view, and until a part of it is back."""

_BODY_RAD = math.radians(14.0)
"""Half the width of a body, and room to spare."""

_SAMPLE_M = 0.1
_FAR_M = 1e4


class Start(NamedTuple):
    """Where the robot stands at time 0.

    Attributes:
        x_m: Middle of the axle, world frame.
        y_m: Middle of the axle, world frame.
        heading_rad: Counter-clockwise from +x.
        pan_rad: Where the head looks, counter-clockwise from straight ahead; None is the rest of its mount.
    """

    x_m: float
    y_m: float
    heading_rad: float
    pan_rad: float | None = None


class Script:
    """A driver who knows the route, and a lazy operator at the camera.

    Args:
        robot: Route, gaze and limits.
        target: The target's path.
        target_speed_m_s: How fast the target walks at the start.
        axis: How the distance to the target swings, and when the camera turns away from it; None for never.
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
        self._away_rad = half + _BODY_RAD + gaze.DEAD_ZONE_RAD
        self._robot = robot
        self._target = target
        self._target_speed_m_s = target_speed_m_s
        self._lane = _Lane.of(robot.route, target)
        self._limits = steering.Limits(robot.max_speed_m_s, math.radians(robot.max_turn_deg_s))
        self.reset()

    def reset(self) -> None:
        """Back to the start of the episode."""
        self._s_m = self._lane.start_m if self._lane is not None else 0.0
        self._seen: tuple[float, float] | None = None

    def start_pose(self) -> Start:
        """Where the robot starts: on its route, facing along it.

        With gaze `"target"` the camera looks at the target from the first frame on.
        """
        route = self._robot.route
        if isinstance(route, scenario.StillRoute):
            x, y, heading = *route.start_m, math.radians(route.heading_deg)
        else:
            assert self._lane is not None
            x, y, heading = (float(v) for v in self._lane.path.at(self._lane.start_m))
        if self._robot.gaze == "forward":
            return Start(x, y, heading)
        target_x, target_y, _ = (float(v) for v in self._target.at(0.0))
        pan = math.remainder(math.atan2(target_y - y, target_x - x) - heading, 2.0 * math.pi)
        return Start(x, y, heading, pan)

    def command(self, time_s: float, pose: tuple[float, float, float], target_s_m: float) -> tuple[float, float]:
        """Where to drive in the coming tick.

        Args:
            time_s: Since the start of the episode; never goes back without `reset`.
            pose: x, y [m] and heading [rad] of the robot.
            target_s_m: How far along its path the target is.

        Returns:
            Forward speed [m/s] and turn rate [rad/s].
        """
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
                turn = 2.0 * math.pi / self._axis.period_s
                target_s_m += self._axis.swing_m * math.sin(turn * time_s)
                speed += self._axis.swing_m * turn * math.cos(turn * time_s)
            wanted, rate = lane.abreast(target_s_m)
            forward = rate * speed + (wanted - self._s_m) / GAP_S
        return steering.follow(lane.path, self._s_m, pose, forward, self._limits)

    def gaze(
        self, T_world_camera: NDArray[np.float64], target_m: ArrayLike, tick_s: float, time_s: float = 0.0
    ) -> tuple[float, float]:
        """How to move the head in the coming tick.

        Args:
            T_world_camera: `(4, 4)` where the camera is and looks now.
            target_m: `(2,)` x, y of the target.
            tick_s: Length of the tick.
            time_s: Since the start of the episode.

        Returns:
            Pan and tilt rate [rad/s].
        """
        if self._robot.gaze == "forward":
            return 0.0, 0.0
        wanted = np.asarray(target_m, dtype=np.float64)
        begin_s = self._axis.leave_at_s
        if self._axis.away_s > 0.0 and begin_s - _TURN_AWAY_S <= time_s < begin_s + self._axis.away_s - _COME_BACK_S:
            # To the right or left of the target, as if it had gone off to the other side.
            way = wanted - T_world_camera[:2, 3]
            cos, sin = math.cos(self._away_rad), math.sin(self._away_rad)
            wanted = T_world_camera[:2, 3] + np.array([cos * way[0] - sin * way[1], sin * way[0] + cos * way[1]])
        return gaze.rates(T_world_camera, wanted, tick_s)

    def _target_speed(self, time_s: float, target_s_m: float) -> float:
        """Speed of the target along its path since the last tick [m/s]."""
        before, self._seen = self._seen, (time_s, target_s_m)
        if before is None or time_s <= before[0]:
            return self._target_speed_m_s
        return (target_s_m - before[1]) / (time_s - before[0])


class _Lane:
    """The robot's own path, and where on it the robot should be for each place of the target on the target's path.

    Attributes:
        path: The robot's.
        start_m: Arc length at which it starts.
    """

    def __init__(self, path: Path, target_s_m: NDArray[np.float64], s_m: NDArray[np.float64]) -> None:
        self.path = path
        # Both paths go on straight at their ends, so there one metre is one metre.
        self._target_s_m = np.concatenate([target_s_m[:1] - _FAR_M, target_s_m, target_s_m[-1:] + _FAR_M])
        self._s_m = np.concatenate([s_m[:1] - _FAR_M, s_m, s_m[-1:] + _FAR_M])
        self.start_m = self.abreast(0.0)[0]

    @classmethod
    def of(cls, route: scenario.Route, target: Path) -> _Lane | None:
        """The lane of a route; None when it stands still."""
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
        places = np.empty(len(samples))
        near = path.project(points[0], 0.0)
        for index, point in enumerate(points):
            # Inside a bend sharper than the offset the point abreast runs backwards: there the robot waits.
            near = max(near, path.project(point, near))
            places[index] = near
        return cls(path, samples - lead, places)

    def abreast(self, target_s_m: float) -> tuple[float, float]:
        """Where the robot should be [m], and how far it goes per metre of the target, averaged over half a metre."""
        around = target_s_m + np.array([-0.25, 0.0, 0.25])
        low, here, high = np.interp(around, self._target_s_m, self._s_m)
        return float(here), float(high - low) / 0.5
