"""The path that the scripted robot drives, the place on it that belongs to each of the target's, and its control."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from pftrack_sim.agents.path import Path
from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.random_streams import stream
from pftrack_sim.core.types import FloatArray, read_only
from pftrack_sim.scenario import robot as scenario

CLEARANCE_M = 0.2  # From the robot to a wall or a piece of furniture
_LEAST_SWING_SHARE = 1.0 / 3.0  # Swings with less room than this share of what was asked for are an error
_START_M = 1.0  # Way driven on the route before the first swing
_SAMPLE_M = 0.25
_CHORD_M = 0.4
_SMOOTHING_M = 1.2  # Ahead of a narrow place, over this distance, a swing narrows
_FAR_M = 1e4

BRAKE_M_S2 = 0.8  # Deceleration before a bend and at the end of a route
_CONVERGENCE_M = 0.5  # Distance driven in which a lateral error falls to 1/e (critically damped)
_LATERAL_ACCELERATION_M_S2 = 0.9  # Limit of the lateral acceleration in bends
_BEND_M = 0.05  # Bends are looked for in steps of this length
_PREVIEW_S = 0.2  # Curvature is taken this far ahead, to compensate the delay of motors and acceleration limit
_MAX_HEADING_ERROR_RAD = 1.2  # With a larger error of heading the robot turns on the spot


class Lane:
    """The robot's path, its arc length for each arc length of the target, and how fast its bends may be driven.

    Args:
        robot: Its limits and its operator.
        target_s_m: `(N,)` rising arc lengths of the target [m].
        s_m: `(N,)` arc lengths of the robot that belong to them [m].
    """

    def __init__(self, robot: scenario.Robot, path: Path, target_s_m: FloatArray, s_m: FloatArray) -> None:
        self.path, self._robot = path, robot
        # Both paths continue straight beyond their ends: there one metre is one metre.
        self._target_s_m = np.concatenate([target_s_m[:1] - _FAR_M, target_s_m, target_s_m[-1:] + _FAR_M])
        self._s_m = np.concatenate([s_m[:1] - _FAR_M, s_m, s_m[-1:] + _FAR_M])
        self.start_m = self.abreast(0.0)[0]
        # Highest speeds from which every bend ahead can be reached at its own speed.
        self._max_turn_rad_s = math.radians(robot.max_turn_deg_s)
        way = np.arange(0.0, path.length_m + _BEND_M, _BEND_M)
        bend = np.maximum(np.abs(curvature := path.curvature(way)), 1e-6)
        # A fifth of the turn rate is kept for corrections.
        speed = np.minimum(np.sqrt(_LATERAL_ACCELERATION_M_S2 / bend), 0.8 * self._max_turn_rad_s / bend)
        reached = np.minimum(speed, robot.max_speed_m_s) ** 2 + 2.0 * BRAKE_M_S2 * way
        squared = np.minimum.accumulate(reached[::-1])[::-1] - 2.0 * BRAKE_M_S2 * way
        self._bend_speeds: list[float] = np.sqrt(np.minimum(squared, robot.max_speed_m_s**2)).tolist()
        self._curvatures: list[float] = curvature.tolist()

    @classmethod
    def of(cls, robot: scenario.Robot, target: Path) -> Lane | None:
        """The lane of a robot's route; None for a robot that stands still."""
        route = robot.route
        if isinstance(route, scenario.StillRoute):
            return None
        if isinstance(route, scenario.WaypointRoute):
            return cls(robot, Path(route.points_m), np.zeros(1), np.zeros(1))
        if isinstance(route, scenario.TrailRoute):
            left, lead = route.offset_m, -route.distance_m
        else:
            left, lead = (route.distance_m if route.side == "left" else -route.distance_m), route.lead_m
        path, samples, s_m = _beside(target, left)
        return cls(robot, path, samples - lead, s_m)

    def swung(self, target_speed_m_s: float, obstacles: ObstacleMap, seed: int) -> Lane:
        """The lane with the operator's swings, as wide as the place allows.

        Beside the target, its distance changes too; the target's speed makes a length of the period of that change.

        Raises:
            ParameterError: There is hardly any room for them.
        """
        operator, route = self._robot.operator, self._robot.route
        end_m = max(self.path.length_m, self.start_m + _CHORD_M)
        s = np.linspace(self.start_m, end_m, 2 + math.ceil((end_m - self.start_m) / _CHORD_M))
        wanted = lateral_swing(operator, s - s[0], seed)
        if isinstance(route, scenario.BesideRoute):
            left_m = route.distance_m if route.side == "right" else -route.distance_m
            nearness = Nearness(operator, seed)
            factors = [nearness.at(way / target_speed_m_s)[0] for way in (s - s[0]).tolist()]
            wanted = wanted + left_m * (1.0 - np.array(factors))
        if not wanted.any():
            return self
        x, y, heading = self.path.at(s)
        normal = np.stack([-np.sin(heading), np.cos(heading)], axis=1)
        middle = np.stack([x, y], axis=1)
        clearance_m = self._robot.half_width_m + CLEARANCE_M
        offset = wanted * _room(middle, normal, wanted, obstacles, clearance_m)
        if np.abs(offset).max() < _LEAST_SWING_SHARE * np.abs(wanted).max():
            raise ParameterError(
                f"robot.operator.swing_m: the robot is to swing {np.abs(wanted).max():.2f} m wide of its route, but "
                f"walls and furniture leave {np.abs(offset).max():.2f} m with {clearance_m:g} m to each of them"
            )
        # Arcs between the middles of the chords: the largest radius that fits.
        points = middle + offset[:, None] * normal
        path = Path(points, corner_m=_FAR_M)
        way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
        way *= path.length_m / way[-1]
        last_m = float(self._target_s_m[-2])
        target_s = np.linspace(0.0, last_m, 1 + math.ceil(last_m / _SAMPLE_M))
        base_s = np.asarray(np.interp(target_s, self._target_s_m, self._s_m), dtype=np.float64)
        return Lane(self._robot, path, target_s, np.asarray(np.interp(base_s, s, way), dtype=np.float64))

    def abreast(self, target_s_m: float) -> tuple[float, float]:
        """Arc length abreast of the target [m], and its change per metre of the target, averaged over half a metre."""
        places = np.interp((target_s_m - 0.25, target_s_m, target_s_m + 0.25), self._target_s_m, self._s_m)
        low, here, high = places.tolist()
        return here, (high - low) / 0.5

    def follow(self, s_m: float, pose: tuple[float, float, float], speed_m_s: float) -> tuple[float, float]:
        """Speed [m/s] and turn rate [rad/s] that keep a differential drive on the path.

        The turn rate is the tracking law of Kanayama et al. 1990 ("A stable tracking control method for an autonomous
        mobile robot", ICRA, eq. 8), with the reference abreast of the robot, so that there is no error along the path:

            w = v (kappa + K_y y + K_theta sin e)

        with the path's curvature kappa, lateral error y and heading error e. For small errors y obeys, per metre
        driven, y'' + K_theta y' + K_y y = 0: critically damped with the length L when K_y = 1 / L^2, K_theta = 2 / L.

        `s_m` is the arc length of the point nearest to the robot, `pose` its x, y [m] and heading [rad]. A negative
        wanted speed counts as 0.
        """
        x, y, heading = self.path.pose(s_m)
        error = math.remainder(heading - pose[2], 2.0 * math.pi)
        if abs(error) > _MAX_HEADING_ERROR_RAD:
            return 0.0, math.copysign(0.6 * self._max_turn_rad_s, error)
        # Positive when the path is to the left of the robot.
        lateral = -math.sin(heading) * (x - pose[0]) + math.cos(heading) * (y - pose[1])
        speed = min(max(speed_m_s, 0.0), self._bend_speeds[self._row(s_m)]) * math.cos(error)
        curvature = self._curvatures[self._row(s_m + _PREVIEW_S * speed)]
        pull = max(-1.0, min(1.0, lateral / _CONVERGENCE_M)) / _CONVERGENCE_M
        turn = speed * (curvature + pull + 2.0 * math.sin(error) / _CONVERGENCE_M)
        return speed, max(-self._max_turn_rad_s, min(self._max_turn_rad_s, turn))

    def _row(self, s_m: float) -> int:
        return min(max(math.ceil(s_m / _BEND_M), 0), len(self._curvatures) - 1)


@lru_cache(maxsize=8)
def _beside(target: Path, left_m: float) -> tuple[Path, FloatArray, FloatArray]:
    """The path parallel to a target's, and `(N,)` arc lengths of the target with those abreast on it [m]; read-only.

    For the seeds of most scenarios it is the same.
    """
    path = target.offset(left_m)
    samples = np.linspace(0.0, target.length_m, 2 + math.ceil(target.length_m / _SAMPLE_M))
    x, y, heading = target.at(samples)
    points = np.stack([x - left_m * np.sin(heading), y + left_m * np.cos(heading)], axis=1)
    s_m = np.empty(len(samples))
    near = path.project(points[0], 0.0)
    for index, point in enumerate(points):
        # In a bend sharper than the offset the point abreast runs backwards: the robot waits there.
        near = max(near, path.project(point, near))
        s_m[index] = near
    return path, read_only(samples), read_only(s_m)


def _room(
    middle_m: FloatArray, normal: FloatArray, wanted_m: FloatArray, obstacles: ObstacleMap, clearance_m: float
) -> FloatArray:
    """`(N,)` shares in [0, 1] of the wanted offsets along the normals that are clear, smooth along the way."""
    shares, smoothing = np.linspace(0.0, 1.0, 16), round(_SMOOTHING_M / _CHORD_M)
    points = middle_m[:, None] + (shares * wanted_m[:, None])[..., None] * normal[:, None]
    clear = (obstacles.clearance_m(points) >= clearance_m).reshape(len(wanted_m), len(shares))
    # A place that the route itself passes closer is left to the route.
    free = np.logical_and.accumulate(clear, axis=1).sum(axis=1) - 1
    room = np.where(wanted_m == 0.0, 1.0, np.maximum(free, 0) / (len(shares) - 1))
    padded = np.pad(room, 2 * smoothing, mode="edge")
    narrowest: FloatArray = np.lib.stride_tricks.sliding_window_view(padded, 2 * smoothing + 1).min(axis=1)
    kernel: FloatArray = np.hanning(2 * smoothing + 3)[1:-1]
    return np.asarray(np.convolve(narrowest, kernel / kernel.sum(), mode="valid"), dtype=np.float64)


class Nearness:
    """Factor on the distance to the target over time: a sine of its logarithm, from 1 at the start."""

    def __init__(self, operator: scenario.Operator, seed: int) -> None:
        rng = stream(seed, "operator", "distance")
        self._omega = 2.0 * math.pi / (operator.distance_period_s * rng.uniform(0.8, 1.2))
        self._amplitude = math.copysign(0.5 * math.log(operator.distance_ratio), rng.random() - 0.5)

    def at(self, time_s: float) -> tuple[float, float]:
        """The factor, and its change per second."""
        phase = self._omega * time_s
        factor = math.exp(self._amplitude * math.sin(phase))
        return factor, factor * self._amplitude * self._omega * math.cos(phase)


def lateral_swing(operator: scenario.Operator, way_m: FloatArray, seed: int) -> FloatArray:
    """`(N,)` wanted offsets to the left of the route [m] at `(N,)` rising distances along it, from 0.

    Each swing has a width and a length of its own; in between, the offset follows a quintic with continuous curvature.
    """
    offsets = np.zeros(len(way_m))
    if operator.swing_m == 0.0:
        return offsets
    rng = stream(seed, "operator", "swing")
    side = 1.0 if rng.random() < 0.5 else -1.0
    low_m, low, high_m = _START_M, 0.0, _START_M
    while low_m < way_m[-1]:
        length, width = rng.uniform(0.8, 1.2), rng.uniform(0.5, 1.0)
        # The first leads from the route to one side: half as long as from side to side.
        high_m, high = low_m + length * operator.swing_every_m * (0.25 if low == 0.0 else 0.5), side * width
        inside = (way_m >= low_m) & (way_m < high_m)
        u = (way_m[inside] - low_m) / (high_m - low_m)
        offsets[inside] = low + (high - low) * u**3 * (10.0 - 15.0 * u + 6.0 * u * u)
        low_m, low, side = high_m, high, -side
    return operator.swing_m * offsets
