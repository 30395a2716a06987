"""The dry run: an episode of robot and target alone, to know where camera and target will be."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.agents.clock import Clock
from pftrack_sim.agents.pedestrians.crowd import Crowd
from pftrack_sim.agents.pedestrians.obstacle_map import Xy
from pftrack_sim.agents.robot.robot import Robot
from pftrack_sim.core.types import FloatArray


class Sample(NamedTuple):
    """Optical centre without vibration, and centre line of the target and centre of the robot on the ground [m]."""

    time_s: float
    camera_m: tuple[float, float, float]
    target_m: Xy
    robot_m: Xy


class _Recording:
    """Samples as far as they have been needed."""

    def __init__(self, samples: Iterable[Sample]) -> None:
        self._coming, self._rows, self._table = iter(samples), list[tuple[float, ...]](), np.empty((0, 8))

    def until(self, time_s: float) -> FloatArray:
        """`(T, 8)` times and x, y, z of the camera, x, y of target and robot, up to the first one after a time."""
        while not self._rows or self._rows[-1][0] <= time_s:
            sample = next(self._coming, None)
            if sample is None:
                break
            self._rows.append((sample.time_s, *sample.camera_m, *sample.target_m, *sample.robot_m))
        if len(self._table) < len(self._rows):
            self._table = np.array(self._rows)
            self._table.setflags(write=False)
        return self._table[: int(np.searchsorted(self._table[:, 0], time_s, side="right")) + 1]


@dataclass(frozen=True)
class DryRun:
    """Where camera, target and robot are over an episode, or its first part; simulated when it is asked for.

    Attributes:
        end_s: When it ends.
    """

    _recording: _Recording
    target_height_m: float
    end_s: float

    @classmethod
    def of(cls, samples: Iterable[Sample], target_height_m: float, end_s: float) -> DryRun:
        """The run of samples with rising times, from time 0 on."""
        return cls(_Recording(samples), target_height_m, end_s)

    def until(self, time_s: float) -> DryRun:
        """The part up to a time."""
        return replace(self, end_s=min(time_s, self.end_s))

    @property
    def times_s(self) -> FloatArray:
        """`(T,)` times of all samples, up to the first one after the end."""
        return self._recording.until(self.end_s)[:, 0]

    @property
    def camera_m(self) -> FloatArray:
        """`(T, 3)` optical centre without vibration, world frame."""
        return self._recording.until(self.end_s)[:, 1:4]

    @property
    def target_m(self) -> FloatArray:
        """`(T, 2)` centre line of the target on the ground."""
        return self._recording.until(self.end_s)[:, 4:6]

    @property
    def robot_m(self) -> FloatArray:
        """`(T, 2)` centre of the robot on the ground."""
        return self._recording.until(self.end_s)[:, 6:]

    def at(self, times_s: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Camera `(N, 3)` and target `(N, 2)` at given times, linearly interpolated."""
        places = self._interpolated(times_s)
        return places[:, :3], places[:, 3:5]

    def robot_at(self, times_s: ArrayLike) -> FloatArray:
        """Robot `(N, 2)` at given times, linearly interpolated."""
        return self._interpolated(times_s)[:, 5:]

    def _interpolated(self, times_s: ArrayLike) -> FloatArray:
        times = np.atleast_1d(np.asarray(times_s, dtype=np.float64))
        known = self._recording.until(float(times.max(initial=0.0)))
        columns: list[FloatArray] = [np.interp(times, known[:, 0], column) for column in known[:, 1:].T]
        return np.stack(columns, axis=1)


def simulated(model: mujoco.MjModel, clock: Clock, robot: Robot, crowd: Crowd) -> Iterator[Sample]:
    """Let the robot follow its script; a sample at the start and at every control tick, without an end.

    The robot must not be used for anything else while samples are taken.
    """
    data, tick = mujoco.MjData(model), 0
    crowd.reset()
    robot.reset(data)
    while True:
        state = robot.scene_state(data, clock.time_s(tick))
        if tick > 0:
            crowd.tick(clock.tick_s, state.time_s, *state.places_m)
        x, y, z = state.T_world_camera[:3, 3].tolist()
        yield Sample(state.time_s, (x, y, z), crowd.target_m, state.robot_pose[:2])
        robot.update(clock.tick_s, state, crowd)
        robot.step(data)
        tick += 1
