"""A run of the episode without pictures, to find out where camera and target will be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.core.errors import ParameterError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class DryRun:
    """Where camera, target and robot are over one episode.

    Attributes:
        times_s: `(T,)` rising.
        camera_m: `(T, 3)` unshaken optical centre, world frame.
        target_m: `(T, 2)` target's centre line on the ground.
        robot_m: `(T, 2)` robot's centre on the ground.
        target_height_m: Body height of the target.
    """

    times_s: Array
    camera_m: Array
    target_m: Array
    robot_m: Array
    target_height_m: float

    @classmethod
    def of(
        cls,
        times_s: ArrayLike,
        camera_m: ArrayLike,
        target_m: ArrayLike,
        robot_m: ArrayLike | None,
        target_height_m: float,
    ) -> DryRun:
        """A rehearsal from anything array-like; without `robot_m` the robot is below its camera.

        Raises:
            ParameterError: The arrays do not fit together.
        """
        times, camera = np.array(times_s, dtype=np.float64), np.array(camera_m, dtype=np.float64)
        target = np.array(target_m, dtype=np.float64)
        robot = camera[:, :2].copy() if robot_m is None else np.array(robot_m, dtype=np.float64)
        count = len(times)
        shapes = (camera.shape, target.shape, robot.shape)
        if count < 2 or shapes != ((count, 3), (count, 2), (count, 2)) or (np.diff(times) <= 0.0).any():
            raise ParameterError(
                f"a rehearsal needs rising times (T,), T >= 2, camera (T, 3), target (T, 2) and robot (T, 2); "
                f"got {times.shape} and {', '.join(map(str, shapes))}"
            )
        for array in (times, camera, target, robot):
            array.setflags(write=False)
        return cls(times, camera, target, robot, float(target_height_m))

    def until(self, time_s: float) -> DryRun:
        """The part up to the first instant after a time."""
        count = max(2, int(np.searchsorted(self.times_s, time_s, side="right")) + 1)
        return DryRun.of(
            self.times_s[:count],
            self.camera_m[:count],
            self.target_m[:count],
            self.robot_m[:count],
            self.target_height_m,
        )

    def at(self, times_s: ArrayLike) -> tuple[Array, Array]:
        """Camera `(N, 3)` and target `(N, 2)` at given times, in between by straight lines."""
        wanted = np.atleast_1d(np.asarray(times_s, dtype=np.float64))
        camera = np.stack([np.interp(wanted, self.times_s, column) for column in self.camera_m.T], axis=1)
        target = np.stack([np.interp(wanted, self.times_s, column) for column in self.target_m.T], axis=1)
        return camera, target
