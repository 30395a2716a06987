"""Recorded motion of a base: what legs and rotors add to where a drive would carry the robot.

The recording is split: what is slower than a second in x, y and yaw is the way, which the robot's own drive replaces;
the rest, with roll, pitch and the height about its mean, is played at the episode's time, forth and back if it is
shorter.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pftrack_sim.agents.robot.sensors import ACCELEROMETER, GYRO
from pftrack_sim.camera.trajectory import log_so3
from pftrack_sim.core.errors import ParameterError, ScenarioError
from pftrack_sim.core.inputs import read_bytes
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scenario import ResolvedScenario

_MOST_BYTES = 1 << 26
_STEP_S, _WAY_S = 0.01, 1.0  # Step of the table; span of the mean that is the way
_DIFFERENCE_S = 0.02  # Turn rates and accelerations are differences over this time, either way
_SLOWEST_S, _LONGEST_S = 0.2, 3600.0  # Usual step of a recording that tells of shaking, and its length
_ANGLES = ("roll_deg", "pitch_deg", "yaw_deg"), ("roll_rad", "pitch_rad", "yaw_rad"), ("qw", "qx", "qy", "qz")


class BaseMotion:
    """The pose of a base relative to one that its drive carries level over the ground.

    Args:
        times_s: `(N,)` rising times.
        positions: `(N, 3)` of the base in the world [m], z up.
        angles: `(N, 3)` roll, pitch and yaw, applied in the order yaw, pitch, roll [rad].
    """

    def __init__(self, times_s: FloatArray, positions: FloatArray, angles: FloatArray) -> None:
        self._end_s = float(times_s[-1] - times_s[0])
        grid = np.arange(0.0, self._end_s + _STEP_S, _STEP_S)
        recorded = np.column_stack([positions, np.unwrap(angles, axis=0)])
        columns: list[FloatArray] = [np.interp(grid, times_s - times_s[0], column) for column in recorded.T]
        table = np.stack(columns, axis=1)
        table[:, 2] -= table[:, 2].mean()
        x, y, yaw = (_slow(table[:, column]) for column in (0, 1, 5))
        right, up, cos, sin = table[:, 0] - x, table[:, 1] - y, np.cos(yaw), np.sin(yaw)
        table[:, 0], table[:, 1], table[:, 5] = cos * right + sin * up, cos * up - sin * right, table[:, 5] - yaw
        self._grid, self._table = grid, table

    def pose(self, time_s: float) -> FloatArray:
        """`(4, 4)` pose at a time of the episode, in the axes of the level base: x forward, z up."""
        when = abs((time_s + self._end_s) % (2.0 * self._end_s) - self._end_s)
        values: list[FloatArray] = [np.interp(when, self._grid, column) for column in self._table.T]
        pose, now = np.eye(4), np.array(values)
        pose[:3, :3], pose[:3, 3] = rotation_of(now[3:]), now[:3]
        return pose

    def world_motion(self, robot_pose: tuple[float, float, float], time_s: float) -> FloatArray:
        """`(4, 4)` by which everything on a base at x, y [m] and heading [rad] moves in the world."""
        x, y, heading = robot_pose
        T_world_base = np.eye(4)
        T_world_base[:3, :3], T_world_base[:2, 3] = rotation_of(np.array([0.0, 0.0, heading])), (x, y)
        return T_world_base @ self.pose(time_s) @ np.linalg.inv(T_world_base)

    def felt(self, proprio: NDArray[np.float32], time_s: float) -> NDArray[np.float32]:
        """`(n,)` proprioception with what gyroscope and accelerometer feel of the motion."""
        before, now, after = (self.pose(time_s + step * _DIFFERENCE_S) for step in (-1, 0, 1))
        turn = log_so3(before[:3, :3].T @ after[:3, :3]) / (2.0 * _DIFFERENCE_S)
        pushed = (after[:3, 3] - 2.0 * now[:3, 3] + before[:3, 3]) / _DIFFERENCE_S**2
        found, upright = proprio.copy(), now[:3, :3].T
        found[GYRO] = upright @ proprio[GYRO] + turn
        found[ACCELEROMETER] = upright @ (proprio[ACCELEROMETER] + pushed)
        return found


def base_motion(settings: ResolvedScenario) -> BaseMotion | None:
    """The motion that a scenario's robot plays back; None for none.

    Raises:
        ScenarioError: Its file cannot be read as one.
    """
    robot = settings.robot
    if robot.motion is None:
        return None
    try:
        return _read(Path(robot.motion), robot.motion_digest)
    except ParameterError as error:
        raise ScenarioError(repr(settings.title), [f"robot.motion: {error}"]) from None


@lru_cache(maxsize=4)
def _read(path: Path, _digest: str) -> BaseMotion:
    """Read CSV with names of columns; the digest tells one content from another."""
    try:
        head, *lines = read_bytes(path, _MOST_BYTES).decode().splitlines()
        names = [name.strip() for name in head.split(",")]
        angles = next(one for one in _ANGLES if {*one} <= {*names})
        wanted = [names.index(name) for name in ("time_s", "x_m", "y_m", "z_m", *angles)]
        table = np.loadtxt(lines, delimiter=",", usecols=wanted, ndmin=2)
    except OSError as error:
        raise ParameterError(f"{path}: cannot be read: {error.strerror or error}") from None
    except (ValueError, StopIteration):
        forms = " or ".join(", ".join(one) for one in _ANGLES)
        raise ParameterError(f"{path}: needs columns time_s, x_m, y_m, z_m and {forms}, all of numbers") from None
    steps_s, finite = np.diff(table[:, 0]), np.isfinite(table).all()
    rises = finite and steps_s.min(initial=np.inf) > 0.0 and steps_s.sum() <= _LONGEST_S
    if not (steps_s.size and rises and np.median(steps_s) <= _SLOWEST_S):
        raise ParameterError(
            f"{path}: needs finite numbers and times that rise by up to {_SLOWEST_S:g} s a row, {_LONGEST_S:g} s in all"
        )
    turned = table[:, 4:]
    if angles[0] == "qw":
        turned = _angles_of(path, turned)
    return BaseMotion(table[:, 0], table[:, 1:4], np.radians(turned) if angles[0] == "roll_deg" else turned)


def _angles_of(path: Path, quaternions: FloatArray) -> FloatArray:
    """`(N, 3)` roll, pitch and yaw [rad] of `(N, 4)` quaternions, w first."""
    length = np.linalg.norm(quaternions, axis=1)
    if np.abs(length - 1.0).max() > 0.01:
        raise ParameterError(
            f"{path}: quaternions have the length 1, got {length[np.argmax(np.abs(length - 1.0))]:.3g}"
        )
    return Rotation.from_quat(quaternions, scalar_first=True).as_euler("xyz")


def rotation_of(angles: FloatArray) -> FloatArray:
    """`(3, 3)` rotation by roll, pitch and yaw [rad]: about x, then y, then z of the world."""
    return Rotation.from_euler("xyz", angles).as_matrix()


def _slow(column: FloatArray) -> FloatArray:
    """Mean over a second around each step; beyond its ends a column goes on point-symmetrically."""
    half = min(round(0.5 * _WAY_S / _STEP_S), len(column) - 1)
    before, after = 2.0 * column[0] - column[half:0:-1], 2.0 * column[-1] - column[-2 : -half - 2 : -1]
    window = np.full(2 * half + 1, 1.0 / (2 * half + 1))
    return np.convolve(np.concatenate([before, column, after]), window, mode="valid")
