"""The loop over the frames of an episode, simulated or recorded, open or closed loop.

A source gives frames, trackers estimate boxes in them, a driver turns one tracker's boxes into robot commands, and
sinks (files, scores, progress) receive every step. All commands use this loop.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim import policies
from pftrack_sim.benchmark.tracker_runner import TrackerRunner
from pftrack_sim.controllers import Controller, RobotParameters
from pftrack_sim.core.boxes import Box
from pftrack_sim.core.records import Estimate, Frame, Image
from pftrack_sim.env import TrackAndFollowEnv
from pftrack_sim.env.base import checked_command
from pftrack_sim.formats import RecordedSequence
from pftrack_sim.simulation.simulation import Simulation
from pftrack_sim.trackers.isolation import TrackerFault

Action: TypeAlias = Mapping[str, Any]
"""Action of `TrackAndFollow-v0`."""

NO_ACTION: Action = {"box": np.zeros(4), "command": np.zeros(4)}
"""Action after a failure: the robot stands still."""


@dataclass(frozen=True, eq=False)
class Sample:
    """A frame of a source.

    Attributes:
        time_s: Time since the first frame.
        image: `(H, W, 3)` uint8 RGB.
        true_box: `(4,)` box of the target [px]; NaN where it is unknown.
        visible: Whether the target can be seen.
        frame: The simulated frame with its truth; None for recordings.
        caption: Caption of pictures of it.
        observation: Observation of the environment in closed loop.
        info: Information that came with it, with `robot_pose` (x, y [m], heading [rad]).
    """

    time_s: float
    image: Image
    true_box: Box
    visible: bool
    frame: Frame | None = None
    caption: str = ""
    observation: Mapping[str, Any] = field(default_factory=dict[str, Any])
    info: Mapping[str, Any] = field(default_factory=dict[str, Any])


@dataclass(frozen=True, eq=False)
class Step:
    """A sample, the action that answers it, and the information about where the action led; both None in open loop."""

    sample: Sample
    action: Action | None
    info: Mapping[str, Any] | None


Sink: TypeAlias = Callable[[Step], None]


class Source(Protocol):
    """Frames of one episode, in order."""

    def reset(self) -> Sample:
        """Start the episode and return its first frame."""
        ...

    def advance(self, action: Action | None) -> tuple[Sample | None, Mapping[str, Any] | None]:
        """Return the next frame, None at the end, and in closed loop the information about it."""
        ...


def rollout(
    source: Source, runners: Sequence[TrackerRunner], *, driver: Driver | None = None, sinks: Sequence[Sink] = ()
) -> None:
    """Run an episode to its end.

    Args:
        source: Where the frames come from.
        runners: Fresh trackers; each is shown every frame.
        driver: Drives the robot in closed loop; it then calls its tracker itself, and `runners` is ignored.
        sinks: Called after every frame, in this order.
    """
    sample: Sample | None = source.reset()
    while sample is not None:
        action = driver.act(sample) if driver is not None else None
        for runner in runners if driver is None else ():
            runner.step(sample.image, sample.true_box, sample.visible)
        following, info = source.advance(action)
        for sink in sinks:
            sink(Step(sample, action, info))
        sample = following


class SimulatedSource:
    """A scenario in which the robot follows its script.

    Args:
        simulation: The simulation.
        seed: Root seed of the episode.
        until_s: The frame at this time is the last one.
    """

    def __init__(self, simulation: Simulation, seed: int, *, until_s: float = math.inf) -> None:
        self._simulation, self._seed, self._until_s = simulation, seed, until_s

    def reset(self) -> Sample:
        """See `Source`."""
        return _simulated(self._simulation.reset(self._seed))

    def advance(self, action: Action | None) -> tuple[Sample | None, None]:
        """See `Source`."""
        shown, period_s = self._simulation.frame, 1.0 / self._simulation.settings.camera.rate_hz
        if shown.index + 1 == self._simulation.frame_count or shown.time_s >= self._until_s - 0.5 * period_s:
            return None, None
        return _simulated(self._simulation.advance()), None


class EnvironmentSource:
    """A scenario in which actions drive the robot; the episode ends as the environment says.

    Args:
        env: The environment.
        seed: Root seed of the episode.
    """

    def __init__(self, env: TrackAndFollowEnv, seed: int) -> None:
        self._env, self._seed = env, seed

    def reset(self) -> Sample:
        """See `Source`."""
        return self._sample(*self._env.reset(seed=self._seed))

    def advance(self, action: Action | None) -> tuple[Sample | None, Mapping[str, Any]]:
        """See `Source`."""
        observation, _, _, _, info = self._env.step(dict(action or NO_ACTION))
        sample = self._sample(observation, info)
        return (sample if info["outcome"] is None else None), sample.info

    def _sample(self, observation: Mapping[str, Any], info: Mapping[str, Any]) -> Sample:
        simulation = self._env.simulation
        posed = {**info, "robot_pose": simulation.world.robot_pose()}
        return _simulated(simulation.frame, observation=observation, info=posed)


def _simulated(frame: Frame, **more: Any) -> Sample:
    return Sample(frame.time_s, frame.image, frame.truth.box, frame.truth.scored, frame, **more)


class RecordedSource:
    """A recorded sequence; the target counts as visible where it has a box.

    Args:
        sequence: The sequence.
        rate_hz: Frames per second: folders of images do not tell.
    """

    def __init__(self, sequence: RecordedSequence, rate_hz: float) -> None:
        self._sequence, self._rate_hz = sequence, rate_hz
        self._index = 0

    def reset(self) -> Sample:
        """See `Source`."""
        self._index = 0
        return self._sample()

    def advance(self, action: Action | None) -> tuple[Sample | None, None]:
        """See `Source`."""
        self._index += 1
        return (self._sample() if self._index < len(self._sequence) else None), None

    def _sample(self) -> Sample:
        index, box = self._index, self._sequence.truth[self._index]
        caption = f"{self._sequence.name}   frame {index + 1} of {len(self._sequence)}"
        return Sample(
            index / self._rate_hz, self._sequence.image(index), box, bool(np.isfinite(box[0])), caption=caption
        )


class Driver:
    """A tracker and a controller that drive the robot, with the tracker's latency on the frames' time.

    Errors of the tracker and of the controller are recorded in the runner; from there on the robot stands still.

    Args:
        runner: The tracker.
        controller: The controller.
        robot: What the controller may know of the robot.
        latency_ms: Simulated time that the tracker takes for a frame.
        rate_hz: Frames per second of the camera.
    """

    def __init__(
        self, runner: TrackerRunner, controller: Controller, robot: RobotParameters, latency_ms: float, rate_hz: float
    ) -> None:
        self._runner = runner
        self._adapter = _RunnerAdapter(runner)
        policy = policies.TrackAndFollowPolicy(self._adapter, controller, robot)
        self._policy = policies.LatencyWrapper(policy, latency_ms, rate_hz)

    def act(self, sample: Sample) -> Action:
        """Return the action for a frame, and record the estimate that counts for it."""
        runner, self._adapter.called = self._runner, False
        if runner.failure is not None:
            runner.record(None, "failed")
            return NO_ACTION
        started = runner.started
        try:
            action = self._policy(sample.observation, sample.info)
            checked_command(action["command"])
        except TrackerFault as error:
            runner.fail(str(error))
            return NO_ACTION
        except Exception as error:  # noqa: BLE001 - a third-party controller may raise anything
            runner.fail(f"{type(error).__name__}: {error}")
            return NO_ACTION
        if self._adapter.called:
            runner.record(self._policy.estimate, "ok" if started else "init", runner.took_ms)
        else:
            runner.record(self._policy.estimate if started else None, "busy" if started else "waiting")
        return action


class _RunnerAdapter:
    """A tracker runner as the tracker of a policy, which calls it only for the frames that it takes."""

    def __init__(self, runner: TrackerRunner) -> None:
        self._runner = runner
        self._true_box: Box = np.zeros(4)
        self.called = False

    def receive_truth(self, box: ArrayLike) -> None:
        self._true_box = np.asarray(box, dtype=np.float64)

    def init(self, image: Image, box: ArrayLike) -> None:
        self._true_box = np.asarray(box, dtype=np.float64)
        self.update(image)

    def update(self, image: Image) -> Estimate:
        self.called = True
        return self._runner.call(image, self._true_box)
