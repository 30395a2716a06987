"""Where everything was a moment ago: the world at any instant of a frame's exposure.

The world is known at every frame. In between, positions go straight and turns are even, from frame to frame; before
the first frame everything stood still.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.camera import rotations as turns

Array = NDArray[np.float64]

_STILL = 1e-9
"""A geom whose position and axes changed by less has not moved."""


@dataclass(frozen=True, eq=False)
class _Moment:
    time_s: float
    positions: Array
    rotations: Array
    bodies: Array
    camera: Array
    people: Array


class PoseHistory:
    """The world during the last frames.

    Args:
        span_s: How far back it will be asked.
    """

    def __init__(self, span_s: float) -> None:
        self._span_s = span_s
        self._moments: list[_Moment] = []

    def remember(self, data: mujoco.MjData, time_s: float, T_world_camera: Array, T_world_people: Array) -> None:
        """Note how things are now; instants are asked for relative to this one.

        Args:
            data: Positions, up to date.
            time_s: Since the start of the episode.
            T_world_camera: `(4, 4)` camera pose without the mount's vibration.
            T_world_people: `(P, 4, 4)` root poses.
        """
        self._moments.append(
            _Moment(
                time_s,
                data.geom_xpos.copy(),
                data.geom_xmat.reshape(-1, 3, 3).copy(),
                data.xpos.copy(),
                np.array(T_world_camera),
                np.array(T_world_people),
            )
        )
        while len(self._moments) > 1 and self._moments[1].time_s <= time_s - self._span_s:
            del self._moments[0]
        self._times = np.array([moment.time_s for moment in self._moments]) - time_s
        positions = np.stack([moment.positions for moment in self._moments])
        rotations = np.stack([moment.rotations for moment in self._moments])
        stirred = np.abs(positions - positions[-1]).max(axis=(0, 2)) > _STILL
        stirred |= np.abs(rotations - rotations[-1]).max(axis=(0, 2, 3)) > _STILL
        self.moving: NDArray[np.intp] = np.flatnonzero(stirred)
        """Ids of the geoms that moved."""
        self._positions, self._rotations = positions[:, self.moving], rotations[:, self.moving]
        self._turns = _steps(self._rotations)
        self._known: dict[float, tuple[Array, Array]] = {}

    def write(self, data: mujoco.MjData, when_s: ArrayLike) -> None:
        """Put the moving geoms where they were.

        Args:
            data: Its `geom_xpos` and `geom_xmat` are set; it is one of the model remembered, at rest or of another
                instant.
            when_s: One instant, or `(moving,)` one for each moving geom; <= 0.
        """
        latest = self._moments[-1]
        data.geom_xpos[:], data.geom_xmat[:] = latest.positions, latest.rotations.reshape(-1, 9)
        if self.moving.size:
            positions, rotations = self.geoms(when_s)
            data.geom_xpos[self.moving] = positions
            data.geom_xmat[self.moving] = rotations.reshape(-1, 9)

    def geoms(self, when_s: ArrayLike) -> tuple[Array, Array]:
        """`(moving, 3)` positions [m] and `(moving, 3, 3)` rotations of the moving geoms.

        Args:
            when_s: One instant, or `(moving,)` one for each; <= 0.
        """
        if len(self._times) == 1:
            return self._positions[0], self._rotations[0]
        if isinstance(when_s, float):
            # The same few instants are asked for again and again.
            if when_s not in self._known:
                self._known[when_s] = self._geoms(when_s)
            return self._known[when_s]
        return self._geoms(when_s)

    def _geoms(self, when_s: ArrayLike) -> tuple[Array, Array]:
        place, share = self._place(np.broadcast_to(np.asarray(when_s, dtype=np.float64), self.moving.shape))
        every = np.arange(len(self.moving))
        before, after = self._positions[place, every], self._positions[place + 1, every]
        turned = turns.matrices(share[:, None] * self._turns[place, every])
        return before + share[:, None] * (after - before), self._rotations[place, every] @ turned

    def cameras(self, when_s: Array) -> Array:
        """`(N, 4, 4)` poses of the camera, without vibration, at `(N,)` instants."""
        return self._between(np.stack([moment.camera for moment in self._moments]), when_s)

    def people(self, when_s: float) -> Array:
        """`(P, 4, 4)` root poses at an instant."""
        poses = np.stack([moment.people for moment in self._moments])
        people = [self._between(poses[:, person], np.array([when_s]))[0] for person in range(poses.shape[1])]
        return np.stack(people)

    def bodies(self, when_s: float) -> Array:
        """`(nbody, 3)` positions of all bodies at an instant [m]."""
        places = np.stack([moment.bodies for moment in self._moments])
        if len(places) == 1:
            return places[0]
        place, share = self._place(np.array(when_s))
        return np.asarray(places[place] + share * (places[place + 1] - places[place]))

    def _between(self, poses: Array, when_s: Array) -> Array:
        if len(poses) == 1:
            return np.broadcast_to(poses[0], (len(when_s), 4, 4))
        place, share = self._place(when_s)
        turned = turns.matrices(share[:, None] * _steps(poses[:, :3, :3])[place])
        found = poses[place].copy()
        found[:, :3, :3] = poses[place, :3, :3] @ turned
        found[:, :3, 3] += share[:, None] * (poses[place + 1, :3, 3] - poses[place, :3, 3])
        return found

    def _place(self, when_s: Array) -> tuple[NDArray[np.intp], Array]:
        """Index of the moment before each instant, and the share of the way to the next."""
        place = np.clip(np.searchsorted(self._times, when_s, side="right") - 1, 0, len(self._times) - 2)
        share = (when_s - self._times[place]) / (self._times[place + 1] - self._times[place])
        return place, np.clip(share, 0.0, 1.0)


def _steps(rotations: Array) -> Array:
    """`(N - 1, ..., 3)` rotation vectors from each of `(N, ..., 3, 3)` rotations to the next, in its own axes."""
    return turns.vectors(np.swapaxes(rotations[:-1], -1, -2) @ rotations[1:])
