"""When each row of a frame is exposed, and where the camera is meanwhile.

A frame stamped t is exposed and read before t: a causal camera has nothing newer. The row at height y of H is exposed
from t - exposure - readout (1 - y / H) for as long as the exposure; the bottom row's exposure ends at t. All times here
count from the stamp, so they are <= 0.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.camera import rotations as turns
from pftrack_sim.camera.pinhole import in_camera

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Shutter:
    """The times of one camera's rows.

    Attributes:
        exposure_s: How long each row sees light.
        readout_s: From the top of the image to its bottom.
        rows: Height of the image [px].
    """

    exposure_s: float
    readout_s: float
    rows: int

    @property
    def instant(self) -> bool:
        """Whether the whole frame is taken at its stamp."""
        return self.exposure_s == 0.0 and self.readout_s == 0.0

    @property
    def window_s(self) -> float:
        """From the first light of the top row to the stamp."""
        return self.exposure_s + self.readout_s

    def row_s(self, y_px: ArrayLike) -> Array:
        """Mid-exposure of the rows at heights `y_px` [px]; beside the image, as if there were more rows."""
        share = np.asarray(y_px, dtype=np.float64) / self.rows
        return -0.5 * self.exposure_s - self.readout_s * (1.0 - share)

    @property
    def middle_s(self) -> float:
        """Mid-exposure of the middle row."""
        return -0.5 * self.window_s


class CameraTrajectory:
    """The camera's way through one frame: straight, and turning evenly, between instants close to each other.

    Args:
        times_s: `(N,)` instants, ascending.
        poses: `(N, 4, 4)` T_world_camera at these.
    """

    def __init__(self, times_s: ArrayLike, poses: ArrayLike) -> None:
        self.times_s = np.asarray(times_s, dtype=np.float64)
        self.poses = np.asarray(poses, dtype=np.float64)
        self._base = self.poses[len(self.times_s) // 2, :3, :3]
        self._turn = turns.vectors(self._base.T @ self.poses[:, :3, :3])

    @property
    def followed_s(self) -> Array:
        """Instants at which it is worth asking where moving points are: every second one."""
        return self.times_s[::2]

    def followed(self) -> Iterator[tuple[float, Array]]:
        """These, and the camera's pose at each."""
        for index in range(0, len(self.times_s), 2):
            yield float(self.times_s[index]), self.poses[index]

    def rotations(self, times_s: ArrayLike) -> Array:
        """`(..., 3, 3)` rotation of the camera at some instants."""
        times = np.asarray(times_s, dtype=np.float64)
        turned = np.stack([np.interp(times, self.times_s, self._turn[:, axis]) for axis in range(3)], axis=-1)
        return self._base @ turns.matrices(turned)

    def centres(self, times_s: ArrayLike) -> Array:
        """`(..., 3)` where the camera is at some instants [m]."""
        times = np.asarray(times_s, dtype=np.float64)
        return np.stack([np.interp(times, self.times_s, self.poses[:, axis, 3]) for axis in range(3)], axis=-1)

    def at(self, times_s: ArrayLike) -> Array:
        """`(..., 4, 4)` T_world_camera at some instants."""
        times = np.asarray(times_s, dtype=np.float64)
        poses = np.zeros((*times.shape, 4, 4))
        poses[..., :3, :3], poses[..., :3, 3], poses[..., 3, 3] = self.rotations(times), self.centres(times), 1.0
        return poses

    def pose(self, time_s: float) -> Array:
        """`(4, 4)` T_world_camera at an instant."""
        return self.at(time_s)


def slopes(points: Array, pose: Array, near_m: float) -> Array:
    """`(..., 2)` x / z and y / z of world points; NaN for those nearer than the near plane.

    Args:
        points: `(..., 3)` [m], world frame.
        pose: `(4, 4)` T_world_camera.
        near_m: Depth below which nothing is seen.
    """
    local = in_camera(points, pose)
    depth = local[..., 2:]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(depth >= near_m, local[..., :2] / depth, np.nan)


def meeting(shutter: Shutter, times_s: Array, seen_px: Array) -> Array:
    """When points are exposed that move in the image: at the mid-exposure of the row they are on just then.

    Args:
        shutter: The rows' times.
        times_s: `(N,)` instants, ascending, that hold every row's mid-exposure.
        seen_px: `(N, ..., 2)` where the points are at these [px].

    Returns:
        `(...,)` the first such instant; NaN for points that are NaN.
    """
    if len(times_s) == 1:
        return np.broadcast_to(times_s[0], seen_px.shape[1:-1])
    # Above 0 while the row is yet to be read, below once it has been; beside the image, the nearest row.
    ahead = shutter.row_s(np.clip(seen_px[..., 1], 0.0, shutter.rows)) - times_s.reshape(
        -1, *([1] * (seen_px.ndim - 2))
    )
    place = np.argmax(ahead[1:] <= 0.0, axis=0)
    before = np.take_along_axis(ahead, place[None], axis=0)[0]
    after = np.take_along_axis(ahead, place[None] + 1, axis=0)[0]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.clip(np.where(before > after, before / (before - after), 0.0), 0.0, 1.0)
    found = times_s[place] + share * (times_s[place + 1] - times_s[place])
    return np.where(np.isfinite(before) & np.isfinite(after), found, np.nan)


def along(times_s: Array, seen_px: Array, when_s: Array) -> Array:
    """Where points are at an instant of each one's own.

    Args:
        times_s: `(N,)` instants, ascending.
        seen_px: `(N, ..., 2)` where the points are at these [px].
        when_s: `(...,)` within them.

    Returns:
        `(..., 2)` [px]
    """
    if len(times_s) == 1:
        return seen_px[0]
    place = np.clip(np.searchsorted(times_s, when_s, side="right") - 1, 0, len(times_s) - 2)
    share = ((when_s - times_s[place]) / (times_s[place + 1] - times_s[place]))[..., None]
    before = np.take_along_axis(seen_px, place[None, ..., None], axis=0)[0]
    after = np.take_along_axis(seen_px, place[None, ..., None] + 1, axis=0)[0]
    return before + np.clip(share, 0.0, 1.0) * (after - before)
