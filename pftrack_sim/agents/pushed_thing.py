"""A thing that is pushed: its way, and where it is on it at each time."""

from __future__ import annotations

import math

import cv2
import numpy as np

from pftrack_sim.agents.gait.posture import PLAIN
from pftrack_sim.agents.path import Path
from pftrack_sim.agents.pedestrians.obstacle_map import Xy
from pftrack_sim.agents.pedestrians.outline import Outline
from pftrack_sim.core.types import FloatArray

_GRAIN_M = 0.02  # Length of the pieces of a way
_COARSE_M = 0.05  # A robot that drives beside it follows it this closely, and rounds its corners


class PushedWay(Path):
    """The way of a thing that physics moves, with a sharp corner where it bounces, and its poses along it.

    Args:
        sample_s: Time from one pose to the next.
        positions_m: `(T, 3)` of its middle, world frame.
        quaternions: `(T, 4)` of its body, scalar first.
        pushed_s: When it was pushed.
        yaw_rad: Where its front is at first, and its path leads if it never moves.
    """

    def __init__(
        self,
        sample_s: float,
        positions_m: FloatArray,
        quaternions: FloatArray,
        pushed_s: tuple[float, ...],
        yaw_rad: float,
    ) -> None:
        self._sample_s, self._positions, self.pushed_s = sample_s, positions_m, pushed_s
        # A quaternion and its negative are the same rotation: neighbours are of one sign.
        turns = (quaternions[1:] * quaternions[:-1]).sum(axis=1) < 0.0
        self._quaternions = quaternions.copy()
        self._quaternions[1:][np.logical_xor.accumulate(turns)] *= -1.0
        steps = np.hypot(*np.diff(positions_m[:, :2], axis=0).T)
        moved = np.concatenate([[0.0], np.cumsum(steps)])
        kept = np.unique(np.floor(moved / _GRAIN_M), return_index=True)[1]
        kept = np.unique([*kept, len(moved) - 1])
        points, marks = positions_m[kept, :2], moved[kept]
        if moved[-1] < _GRAIN_M:
            points = points[0] + np.array([[0.0, 0.0], [math.cos(yaw_rad), math.sin(yaw_rad)]])
            marks = np.array([0.0, 1.0])
        super().__init__(points, corner_m=0.0)
        along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
        self._s_m: FloatArray = np.asarray(np.interp(moved, marks, along), dtype=np.float64)

    @property
    def speed_m_s(self) -> float:
        """Its mean speed."""
        return self.length_m / (self._sample_s * (len(self._s_m) - 1))

    def s_at(self, time_s: float) -> float:
        """Arc length at a time [m]."""
        index, share = self._sample(time_s)
        begin_m, end_m = self._s_m[index : index + 2].tolist()
        return begin_m + share * (end_m - begin_m)

    def velocity_m_s(self, time_s: float) -> tuple[float, float]:
        """Velocity on the ground, x and y."""
        index, _ = self._sample(time_s)
        x, y = ((self._positions[index + 1, :2] - self._positions[index, :2]) / self._sample_s).tolist()
        return x, y

    def at_time(self, time_s: float) -> tuple[FloatArray, FloatArray]:
        """`(3,)` position of its middle [m] and `(4,)` quaternion; after the last sample it stays."""
        index, share = self._sample(time_s)
        # In this form of the mean, what lies still has the same bits at all times.
        place, following = self._positions[index : index + 2]
        turned, turns = self._quaternions[index : index + 2]
        quaternion = turned + share * (turns - turned)
        return place + share * (following - place), quaternion / np.linalg.norm(quaternion)

    def offset(self, left_m: float) -> Path:
        """The way beside it of a robot, which does not turn on the spot where the thing bounces."""
        points = cv2.approxPolyDP(self.points_m.astype(np.float32), _COARSE_M, closed=False)
        return Path(points.reshape(-1, 2).astype(np.float64)).offset(left_m)

    def _sample(self, time_s: float) -> tuple[int, float]:
        """Index of the sample before a time, and the share of the way to the next one."""
        place = min(max(time_s / self._sample_s, 0.0), len(self._s_m) - 1.0)
        index = min(math.floor(place), len(self._s_m) - 2)
        return index, place - index


class PushedWalk:
    """A thing on its way, as a `TargetWalk` is of a person: nothing stops it but what its simulation knew.

    Attributes:
        s_m: Arc length on the way.
        state: x, y [m] and vx, vy [m/s].
        tracked_m: x, y of the thing.
        heading_rad: Direction in which it moves, or moved last.
    """

    posture = PLAIN
    outline = Outline()

    def __init__(self, way: PushedWay) -> None:
        self._way, self._time_s = way, 0.0
        self._update_state()

    def update(self, dt_s: float, robot: tuple[float, float, float, float], camera_m: Xy) -> None:
        """Move on by a tick."""
        self._time_s += dt_s
        self._update_state()

    def predicted(self, ahead_s: float) -> tuple[float, float]:
        """x, y [m] after a time."""
        x, y, _ = self._way.at_time(self._time_s + ahead_s)[0].tolist()
        return x, y

    def _update_state(self) -> None:
        way = self._way
        self.s_m = way.s_at(self._time_s)
        self.heading_rad = way.pose(self.s_m)[2]
        self.tracked_m = self.predicted(0.0)
        self.state = (*self.tracked_m, *way.velocity_m_s(self._time_s))
