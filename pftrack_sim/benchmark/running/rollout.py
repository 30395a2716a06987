"""The loops over the frames of an episode, simulated or recorded, open or closed loop.

Trackers estimate boxes in frames, a driver turns one tracker's boxes into robot commands, and sinks (files, scores,
progress) receive every frame. All commands use these loops.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim import policies
from pftrack_sim.benchmark.running.tracker_runner import TrackerRunner, fault_of
from pftrack_sim.controllers import Controller, RobotParameters
from pftrack_sim.core.boxes import Box
from pftrack_sim.core.errors import RunError, SequenceError
from pftrack_sim.core.records import Detections, Estimate, Frame, Image, TrackedBoxes, Truth
from pftrack_sim.env import TrackAndFollowEnv
from pftrack_sim.env.base import checked_command
from pftrack_sim.formats import RecordedSequence
from pftrack_sim.scenario import ResolvedScenario
from pftrack_sim.simulation.simulation import Simulation
from pftrack_sim.trackers.isolation import TrackerFault
from pftrack_sim.truth.detector import DetectionModel

Action: TypeAlias = Mapping[str, Any]
"""Action of `TrackAndFollow-v0`."""

NO_ACTION: Action = {"box": np.zeros(4), "command": np.zeros(4)}
"""Action after an error: the robot stands still."""


@dataclass(frozen=True, eq=False)
class Sample:
    """A frame of an episode.

    Attributes:
        time_s: Time since the first frame.
        image: `(H, W, 3)` uint8 RGB.
        true_box: `(4,)` box of the target [px]; NaN where it is unknown.
        visible_fraction: Share of the target that can be seen, in [0, 1]; 1 where a recording has a box.
        frame: The simulated frame with its truth; None for recordings.
        caption: Caption of pictures of it.
        observation: Observation of the environment in closed loop; in open loop its `proprio` alone, on request.
        info: Information that came with it, with `robot_pose` (x, y [m], heading [rad]) and `robot`; on request.
        detections: What a detector found in it, in open loop on request; None where there is none.
        action: In closed loop, for sinks: what answers it.
        after: Information about where the action led.
    """

    time_s: float
    image: Image
    true_box: Box
    visible_fraction: float
    frame: Frame | None = None
    caption: str = ""
    observation: Mapping[str, Any] = field(default_factory=dict[str, Any])
    info: Mapping[str, Any] = field(default_factory=dict[str, Any])
    detections: Detections | None = None
    action: Action | None = None
    after: Mapping[str, Any] | None = None


Sink: TypeAlias = Callable[[Sample], None]


def rollout(samples: Iterable[Sample], runners: Sequence[TrackerRunner], sinks: Sequence[Sink] = ()) -> None:
    """Show every frame to fresh trackers, in open loop, and then to sinks, in this order."""
    for sample in samples:
        for runner in runners:
            runner.step(sample.image, sample.true_box, sample.visible_fraction, sample.detections)
        for sink in sinks:
            sink(sample)


def drive(env: TrackAndFollowEnv, seed: int, act: Callable[[Sample], Action], sinks: Sequence[Sink] = ()) -> None:
    """Let `act`, which calls a tracker itself, answer each frame until the environment ends the episode."""
    observation, given = env.reset(seed=seed)
    info = {**given, **_robot(env.simulation)}
    while info.get("outcome") is None:
        sample = _sample(env.simulation.frame, observation=observation, info=info)
        action = act(sample)
        observation, _, _, _, given = env.step(dict(action))
        info = {**given, **_robot(env.simulation)}
        for sink in sinks:
            sink(replace(sample, action=action, after=info))


def simulated(
    simulation: Simulation, seed: int, *, until_s: float = math.inf, sensors: bool = False
) -> Iterator[Sample]:
    """Frames of an episode in which the robot follows its script, up to the one at `until_s`.

    With `sensors` they have proprioception, the robot and its pose.
    """

    def sample(frame: Frame) -> Sample:
        if not sensors:
            return _sample(frame)
        return _sample(frame, observation={"proprio": simulation.world.proprio()}, info=_robot(simulation))

    frame = simulation.reset(seed)
    yield sample(frame)
    last_s = until_s - 0.5 / simulation.settings.camera.rate_hz
    while frame.index + 1 < simulation.frame_count and frame.time_s < last_s:
        frame = simulation.advance()
        yield sample(frame)


def _robot(simulation: Simulation) -> dict[str, Any]:
    return {"robot_pose": simulation.world.robot_pose(), "robot": simulation.world.robot.drive}


def _sample(frame: Frame, **more: Any) -> Sample:
    return Sample(frame.time_s, frame.image, frame.truth.box, frame.truth.visible_fraction, frame, **more)


def detected(samples: Iterable[Sample], settings: ResolvedScenario, seed: int) -> Iterator[Sample]:
    """Frames of a simulation, drawn or kept, with what the scenario's detector finds in them."""
    model = DetectionModel(settings, seed)
    for sample in samples:
        assert sample.frame is not None
        yield replace(sample, detections=model.detect(sample.frame.people, sample.image))


def recorded(sequence: RecordedSequence, rate_hz: float) -> Iterator[Sample]:
    """Frames of a recorded sequence at a rate [Hz]; the target counts as visible where it has a box.

    Raises:
        SequenceError: An image cannot be read, or has another size than the first one.
    """
    shape: tuple[int, ...] | None = None
    for index, box in enumerate(sequence.truth):
        caption = f"{sequence.name}   frame {index + 1} of {len(sequence)}"
        image = sequence.image(index)
        shape = shape or image.shape
        if image.shape != shape:
            sizes = " and ".join(f"{width} x {height}" for height, width, _ in (shape, image.shape))
            raise SequenceError(f"{sequence.where(index)}: images of one sequence need one size, got {sizes}")
        found = sequence.detections[index] if sequence.detections is not None else None
        yield Sample(index / rate_hz, image, box, float(np.isfinite(box[0])), caption=caption, detections=found)


def shown_to(samples: Iterable[Sample], sink: Sink) -> Iterator[Sample]:
    """The same frames; each is shown to a sink first."""
    for sample in samples:
        sink(sample)
        yield sample


def backwards(samples: Iterable[Sample], folder: Path | None = None) -> Iterator[Sample]:
    """Frames of a simulation from the last one on, with their times and everybody's motion since the one shown before.

    Until the last one is there they are kept in a temporary file in `folder`.

    Raises:
        RunError: There is no space for all of them.
    """
    kept: list[tuple[Sample, tuple[Truth, ...]]] = []
    shape: tuple[int, ...] = ()
    with tempfile.TemporaryFile(dir=folder) as images:
        for sample in samples:
            assert sample.frame is not None
            shape = sample.image.shape
            try:
                images.write(np.ascontiguousarray(sample.image).data)
            except OSError as error:
                message = f"frames that are shown backwards need space for all of them: {error.strerror}"
                raise RunError(message) from None
            without_image = replace(sample, image=np.empty((0, 0, 3), np.uint8), frame=None)
            kept.append((without_image, tuple(sample.frame.people)))
        size, last_s = math.prod(shape), kept[-1][0].time_s
        motion_px = {one.name: 0.0 for one in kept[-1][1]}
        for index, (sample, seen) in enumerate(reversed(kept)):
            images.seek((len(kept) - 1 - index) * size)
            image = np.frombuffer(images.read(size), np.uint8).reshape(shape)
            time_s = last_s - sample.time_s
            people = tuple(
                replace(one, time_s=time_s, image_motion_px=motion_px.get(one.name, math.nan)) for one in seen
            )
            motion_px = {one.name: one.image_motion_px for one in seen}
            frame = Frame(index, time_s, image, people[0], people)
            yield replace(sample, time_s=time_s, image=image, frame=frame)


class Driver:
    """A tracker and a controller that drive the robot, with the tracker's latency on the frames' time.

    It is itself the tracker of the policy, which calls it only for the frames that the tracker takes. Errors of the
    tracker and of the controller are recorded in the runner; from there on the robot stands still.

    Args:
        robot: What the controller may know of the robot.
        latency_ms: Simulated time that the tracker takes for a frame.
    """

    def __init__(
        self, runner: TrackerRunner, controller: Controller, robot: RobotParameters, latency_ms: float, rate_hz: float
    ) -> None:
        self.tracks: TrackedBoxes | None = None
        self._runner = runner
        self._true_box: Box = np.zeros(4)
        self._visible_fraction = 1.0
        self._detections: Detections | None = None
        self._called = False
        policy = policies.TrackAndFollowPolicy(self, controller, robot)
        self._policy = policies.LatencyWrapper(policy, latency_ms, rate_hz)

    def __call__(self, sample: Sample) -> Action:
        """Return the action for a frame, and record the estimate that counts for it."""
        runner, self._called = self._runner, False
        if runner.error is not None:
            runner.record(None, "error")
            return NO_ACTION
        started = runner.started
        try:
            action = self._policy(sample.observation, sample.info)
            checked_command(action["command"])
        except TrackerFault as error:
            runner.fail(error)
            return NO_ACTION
        except Exception as error:  # noqa: BLE001 - a third-party controller may raise anything
            runner.fail(fault_of(error))
            return NO_ACTION
        if self._called:
            runner.record(self._policy.estimate, "ok" if started else "init", runner.took_ms)
        else:
            runner.record(self._policy.estimate if started else None, "busy" if started else "waiting")
        return action

    def receive_truth(self, box: ArrayLike, visible_fraction: float) -> None:
        """See `trackers.NeedsTruth`."""
        self._true_box, self._visible_fraction = np.asarray(box, dtype=np.float64), visible_fraction

    def receive_detections(self, detections: Detections) -> None:
        """See `trackers.NeedsDetections`."""
        self._detections = detections

    def init(self, image: Image, box: ArrayLike) -> None:
        """See `Tracker`."""
        self._true_box = np.asarray(box, dtype=np.float64)
        self.update(image)

    def update(self, image: Image) -> Estimate:
        """See `Tracker`."""
        self._called = True
        return self._runner.call(image, self._true_box, self._visible_fraction, self._detections)
