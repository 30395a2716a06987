"""The dry run: an episode of robot and target alone, to know where camera and target will be."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.agents.clock import Clock
from pftrack_sim.agents.pedestrians.crowd import Crowd
from pftrack_sim.agents.robot.robot import Robot
from pftrack_sim.core.types import FloatArray


@dataclass(frozen=True)
class DryRun:
    """Where camera, target and robot are over one episode, or its first part.

    Attributes:
        times_s: `(T,)` rising.
        camera_m: `(T, 3)` optical centre without vibration, world frame.
        target_m: `(T, 2)` centre line of the target on the ground.
        robot_m: `(T, 2)` centre of the robot on the ground.
        rest: How a first part goes on; None where nothing is left.
    """

    times_s: FloatArray
    camera_m: FloatArray
    target_m: FloatArray
    robot_m: FloatArray
    target_height_m: float
    rest: Rest | None = None

    @property
    def end_s(self) -> float:
        """Time of the last sample of the whole run."""
        return float(self.times_s[-1]) if self.rest is None else self.rest.end_s

    def whole(self) -> DryRun:
        """The whole run, of which this may be the first part."""
        return self if self.rest is None else self.rest.finish()

    def until(self, time_s: float) -> DryRun:
        """The part up to the first sample after a time; itself where it is a first part that ends before."""
        if self.rest is not None and time_s >= self.times_s[-1]:
            return self
        count = max(2, int(np.searchsorted(self.times_s, time_s, side="right")) + 1)
        times, camera, target, robot = self.times_s, self.camera_m, self.target_m, self.robot_m
        return DryRun(times[:count], camera[:count], target[:count], robot[:count], self.target_height_m)

    def at(self, times_s: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Camera `(N, 3)` and target `(N, 2)` at given times, linearly interpolated."""
        return self._interpolated(times_s, self.camera_m), self._interpolated(times_s, self.target_m)

    def robot_at(self, times_s: ArrayLike) -> FloatArray:
        """Robot `(N, 2)` at given times, linearly interpolated."""
        return self._interpolated(times_s, self.robot_m)

    def _interpolated(self, times_s: ArrayLike, track: FloatArray) -> FloatArray:
        times = np.atleast_1d(np.asarray(times_s, dtype=np.float64))
        columns: list[FloatArray] = [np.interp(times, self.times_s, column) for column in track.T]
        return np.stack(columns, axis=1)


@dataclass(frozen=True)
class Rest:
    """What follows the first part of a dry run.

    Attributes:
        end_s: Time of the last sample.
        finish: Gives the whole run.
    """

    end_s: float
    finish: Callable[[], DryRun]


def dry_run(
    model: mujoco.MjModel,
    clock: Clock,
    robot: Robot,
    crowd: Crowd,
    until_s: float,
    target_height_m: float,
    first_s: float | None = None,
) -> DryRun:
    """Let the robot follow its script up to a time, and record camera, target and robot at every control tick.

    With `first_s` the run is simulated up to that time, and the rest only when it is asked for; the robot must not be
    used for anything else before.
    """
    recording = _Recording(model, clock, robot, crowd, target_height_m)
    recording.go_on(until_s if first_s is None else first_s)
    found = recording.so_far()
    if found.times_s[-1] > until_s:
        return found

    def finish() -> DryRun:
        recording.go_on(until_s)
        return recording.so_far()

    tick = len(found.times_s)
    while clock.time_s(tick) <= until_s:
        tick += 1
    return replace(found, rest=Rest(clock.time_s(tick), finish))


class _Recording:
    """A dry run that can go on."""

    def __init__(self, model: mujoco.MjModel, clock: Clock, robot: Robot, crowd: Crowd, target_height_m: float) -> None:
        self._clock, self._robot, self._crowd, self._target_height_m = clock, robot, crowd, target_height_m
        self._data = mujoco.MjData(model)
        crowd.reset()
        robot.reset(self._data)
        self._states, self._target_m = [robot.scene_state(self._data, 0.0)], [crowd.target_m]

    def go_on(self, until_s: float) -> None:
        """Simulate up to the first sample after a time."""
        clock, robot, crowd, data, states = self._clock, self._robot, self._crowd, self._data, self._states
        while states[-1].time_s <= until_s:
            robot.update(clock.tick_s, states[-1], crowd)
            robot.step(data)
            states.append(robot.scene_state(data, clock.time_s(len(states))))
            crowd.tick(clock.tick_s, states[-1].time_s, *states[-1].places_m)
            self._target_m.append(crowd.target_m)

    def so_far(self) -> DryRun:
        """What has been recorded."""
        return DryRun(
            np.array([state.time_s for state in self._states]),
            np.array([state.T_world_camera[:3, 3] for state in self._states]),
            np.array(self._target_m),
            np.array([state.robot_pose[:2] for state in self._states]),
            self._target_height_m,
        )
