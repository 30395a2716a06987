"""Pose history: positions and rotations of everything at any instant of a frame's exposure.

Poses are known at every frame of the camera. In between, positions and rotation vectors are interpolated linearly;
before the first frame everything stood still.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.camera.trajectory import exp_so3, log_so3
from pftrack_sim.core.types import FloatArray, IntArray

_STILL = 1e-9  # A geom whose position [m] and axes changed by less has not moved


@dataclass(frozen=True, eq=False)
class _Snapshot:
    time_s: float
    positions: FloatArray
    rotations: FloatArray
    bodies: FloatArray
    camera: FloatArray
    people: FloatArray


class PoseHistory:
    """Poses during the last `span_s`. Instants are relative to the latest frame, hence <= 0."""

    def __init__(self, span_s: float) -> None:
        self._span_s = span_s
        self._snapshots: list[_Snapshot] = []

    def append(
        self, data: mujoco.MjData, time_s: float, T_world_camera: FloatArray, T_world_people: FloatArray
    ) -> None:
        """Append the poses of a frame: `(4, 4)` of the camera without shake, and `(P, 4, 4)` root poses of people."""
        geoms = data.geom_xpos.copy(), data.geom_xmat.reshape(-1, 3, 3).copy()
        roots = np.array(T_world_camera), np.array(T_world_people)
        self._snapshots.append(_Snapshot(time_s, *geoms, data.xpos.copy(), *roots))
        while len(self._snapshots) > 1 and self._snapshots[1].time_s <= time_s - self._span_s:
            del self._snapshots[0]
        self._times = np.array([snapshot.time_s for snapshot in self._snapshots]) - time_s
        all_positions = np.stack([snapshot.positions for snapshot in self._snapshots])
        all_rotations = np.stack([snapshot.rotations for snapshot in self._snapshots])
        moved = np.abs(all_positions - all_positions[-1]).max(axis=(0, 2)) > _STILL
        moved |= np.abs(all_rotations - all_rotations[-1]).max(axis=(0, 2, 3)) > _STILL
        self.moving: IntArray = np.flatnonzero(moved)
        """Ids of the geoms that moved."""
        self._positions, self._rotations = all_positions[:, self.moving], all_rotations[:, self.moving]
        self._steps = _rotation_steps(self._rotations)

    def instants(self, span_s: float, count: int) -> FloatArray:
        """Instants in the last `span_s`, between which everything moves evenly: `count` of them, and the frames."""
        within = self._times[self._times > -span_s]
        return np.union1d(np.linspace(-span_s, 0.0, count), within) if span_s else np.zeros(1)

    def write(self, data: mujoco.MjData, when_s: ArrayLike) -> None:
        """Set `geom_xpos` and `geom_xmat` of all geoms at one instant, or at `(moving,)` instants of moving ones."""
        latest = self._snapshots[-1]
        data.geom_xpos[:], data.geom_xmat[:] = latest.positions, latest.rotations.reshape(-1, 9)
        if self.moving.size:
            positions, rotations = self.geoms(when_s)
            data.geom_xpos[self.moving] = positions
            data.geom_xmat[self.moving] = rotations.reshape(-1, 9)

    def geoms(self, when_s: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """`(..., moving, 3)` positions [m] and `(..., moving, 3, 3)` rotations of the moving geoms.

        Instants are one, `(moving,)`, or of a shape that ends on moving or 1.
        """
        when = np.asarray(when_s, dtype=np.float64)
        shape = np.broadcast_shapes(when.shape, self.moving.shape)
        if len(self._times) == 1:
            still = self._positions[0], self._rotations[0]
            return np.broadcast_to(still[0], (*shape, 3)), np.broadcast_to(still[1], (*shape, 3, 3))
        index, share = self._locate(np.broadcast_to(when, shape))
        geoms = np.arange(len(self.moving))
        before, after = self._positions[index, geoms], self._positions[index + 1, geoms]
        step = exp_so3(share[..., None] * self._steps[index, geoms])
        return before + share[..., None] * (after - before), self._rotations[index, geoms] @ step

    def poses(self, when_s: FloatArray) -> FloatArray:
        """`(N, 3, ngeom, 4)` rotations and positions [m] of all geoms at `(N,)` instants."""
        latest = self._snapshots[-1]
        still = np.concatenate([latest.rotations, latest.positions[:, :, None]], axis=2).transpose(1, 0, 2)
        poses = np.repeat(still[None], len(when_s), axis=0)
        positions, rotations = self.geoms(when_s[:, None])
        poses[:, :, self.moving, :3] = rotations.transpose(0, 2, 1, 3)
        poses[:, :, self.moving, 3] = positions.transpose(0, 2, 1)
        return poses

    def cameras(self, when_s: FloatArray) -> FloatArray:
        """`(N, 4, 4)` camera poses without camera shake at `(N,)` instants."""
        return self._interpolate_poses(np.stack([snapshot.camera for snapshot in self._snapshots]), when_s)

    def people(self, when_s: float) -> FloatArray:
        """`(P, 4, 4)` root poses at an instant."""
        poses, instant = np.stack([snapshot.people for snapshot in self._snapshots]), np.array([when_s])
        return np.stack([self._interpolate_poses(poses[:, index], instant)[0] for index in range(poses.shape[1])])

    def bodies(self, when_s: float) -> FloatArray:
        """`(nbody, 3)` positions of all bodies at an instant [m]."""
        positions = np.stack([snapshot.bodies for snapshot in self._snapshots])
        if len(positions) == 1:
            return positions[0]
        index, share = self._locate(np.array(when_s))
        return np.asarray(positions[index] + share * (positions[index + 1] - positions[index]))

    def _interpolate_poses(self, poses: FloatArray, when_s: FloatArray) -> FloatArray:
        """`(N, 4, 4)` poses at `(N,)` instants, from `(T, 4, 4)` poses at the frames."""
        if len(poses) == 1:
            return np.broadcast_to(poses[0], (len(when_s), 4, 4))
        index, share = self._locate(when_s)
        step = exp_so3(share[:, None] * _rotation_steps(poses[:, :3, :3])[index])
        interpolated = poses[index].copy()
        interpolated[:, :3, :3] = poses[index, :3, :3] @ step
        interpolated[:, :3, 3] += share[:, None] * (poses[index + 1, :3, 3] - poses[index, :3, 3])
        return interpolated

    def _locate(self, when_s: FloatArray) -> tuple[IntArray, FloatArray]:
        """Index of the frame before each instant, and the share of the time to the next frame."""
        index = np.clip(np.searchsorted(self._times, when_s, side="right") - 1, 0, len(self._times) - 2)
        share = (when_s - self._times[index]) / (self._times[index + 1] - self._times[index])
        return index, np.clip(share, 0.0, 1.0)


def _rotation_steps(rotations: FloatArray) -> FloatArray:
    """`(T - 1, ..., 3)` rotation vectors between consecutive `(T, ..., 3, 3)` rotations, in the axes of the first."""
    return log_so3(np.swapaxes(rotations[:-1], -1, -2) @ rotations[1:])
