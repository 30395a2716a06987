"""Rotations as vectors, and the pose of the camera at any instant of one frame."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.core.types import FloatArray

# Written out, as scipy.spatial.transform.Rotation goes through quaternions: the last bits of every frame and box under
# blur or rolling shutter would differ, and its logarithm takes 3.5 times as long.


def exp_so3(vectors: ArrayLike) -> FloatArray:
    """`(..., 3, 3)` rotations of `(..., 3)` rotation vectors [rad], by Rodrigues' formula."""
    vector = np.asarray(vectors, dtype=np.float64)
    angle = np.sqrt(np.einsum("...i,...i->...", vector, vector))[..., None, None]
    cross = np.zeros((*vector.shape[:-1], 3, 3))
    cross[..., 0, 1], cross[..., 0, 2], cross[..., 1, 2] = -vector[..., 2], vector[..., 1], -vector[..., 0]
    cross -= np.swapaxes(cross, -1, -2)
    # sin(a) / a and (1 - cos(a)) / a^2, without a division by zero.
    first = np.sinc(angle / np.pi)
    second = 0.5 * np.sinc(0.5 * angle / np.pi) ** 2
    return np.eye(3) + first * cross + second * (cross @ cross)


def log_so3(rotations: ArrayLike) -> FloatArray:
    """`(..., 3)` rotation vectors [rad] of `(..., 3, 3)` rotations by less than pi."""
    rotation = np.asarray(rotations, dtype=np.float64)
    axis = 0.5 * np.stack(
        [
            rotation[..., 2, 1] - rotation[..., 1, 2],
            rotation[..., 0, 2] - rotation[..., 2, 0],
            rotation[..., 1, 0] - rotation[..., 0, 1],
        ],
        axis=-1,
    )
    sine = np.sqrt(np.einsum("...i,...i->...", axis, axis))
    cosine = 0.5 * (np.trace(rotation, axis1=-2, axis2=-1) - 1.0)
    angle = np.arctan2(sine, cosine)
    return axis * np.where(sine > 1e-12, angle / np.maximum(sine, 1e-12), 1.0)[..., None]


class CameraTrajectory:
    """Camera poses during one frame, interpolated linearly in position and rotation vector.

    Args:
        times_s: `(N,)` instants, ascending.
        poses: `(N, 4, 4)` T_world_camera at these.
    """

    def __init__(self, times_s: ArrayLike, poses: ArrayLike) -> None:
        self.times_s = np.asarray(times_s, dtype=np.float64)
        self.poses = np.asarray(poses, dtype=np.float64)
        self._reference = self.poses[len(self.times_s) // 2, :3, :3]
        self._rotation_vectors = log_so3(self._reference.T @ self.poses[:, :3, :3])

    def rotations(self, times_s: ArrayLike) -> FloatArray:
        """`(..., 3, 3)` camera rotations at `(...,)` instants."""
        times = np.asarray(times_s, dtype=np.float64)
        vectors = [np.interp(times, self.times_s, self._rotation_vectors[:, axis]) for axis in range(3)]
        return self._reference @ exp_so3(np.stack(vectors, axis=-1))

    def positions(self, times_s: ArrayLike) -> FloatArray:
        """`(..., 3)` camera positions [m] at `(...,)` instants."""
        times = np.asarray(times_s, dtype=np.float64)
        return np.stack([np.interp(times, self.times_s, self.poses[:, axis, 3]) for axis in range(3)], axis=-1)

    def times_between(self, most_turn: float) -> FloatArray:
        """`times_s`, and instants in between, evenly, where the camera turns by more than `most_turn` [rad]."""
        turns = np.linalg.norm(np.diff(self._rotation_vectors, axis=0), axis=1)
        if not np.any(turns > most_turn):
            return self.times_s
        parts = int(np.ceil(turns.max() / most_turn))
        places = np.arange(parts * len(turns) + 1) / parts
        return np.interp(places, np.arange(len(self.times_s)), self.times_s)

    def at(self, times_s: ArrayLike) -> FloatArray:
        """`(..., 4, 4)` T_world_camera at `(...,)` instants."""
        times = np.asarray(times_s, dtype=np.float64)
        poses = np.zeros((*times.shape, 4, 4))
        poses[..., :3, :3], poses[..., :3, 3], poses[..., 3, 3] = self.rotations(times), self.positions(times), 1.0
        return poses
