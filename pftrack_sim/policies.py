"""Trackers and controllers as policies of the environments: observation in, action out.

    policy = TrackingPolicy(trackers.make("ko2012"))
    action = policy(observation)

A policy notices the frame in which the target is selected by itself (`observation["first"]`) and starts its tracker
there.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.controllers import Controller, RobotParameters
from pftrack_sim.core.errors import ParameterError, TrackerError
from pftrack_sim.core.records import Estimate, Tracker, Truth
from pftrack_sim.scenario import ResolvedScenario
from pftrack_sim.trackers import NeedsTruth

PAPER_MS: Mapping[str, float] = MappingProxyType(
    {"ko2012": 100.0, "lee2012": 55.0, "lee2012-color": 7.0, "lee2012-color-hog": 13.0}
)
"""Time for a frame that the papers print for their trackers, on their machines."""

NOTHING = Estimate(np.zeros(4), confidence=0.0)
"""What is said before there is a target."""


def rig_of(settings: ResolvedScenario, latency_ms: float = 0.0) -> RobotParameters:
    """What a controller may know of the robot and the task of a scenario.

    Args:
        settings: The scenario, every range drawn.
        latency_ms: The tracker's time for a frame: the controller is called as often as it answers.
    """
    robot, camera = settings.robot, settings.camera
    return RobotParameters(
        (camera.width_px, camera.height_px),
        math.radians(camera.fovy_deg),
        camera.rate_hz / frames_taken(latency_ms, camera.rate_hz),
        robot.max_speed_m_s,
        math.radians(robot.max_turn_deg_s),
        math.radians(robot.max_pan_deg_s),
        math.radians(robot.max_tilt_deg_s),
        settings.follow.distance_m,
    )


def frames_taken(latency_ms: float, rate_hz: float) -> int:
    """Every how many frames a tracker that thinks so long takes one.

    >>> frames_taken(0.0, 30.0), frames_taken(33.0, 30.0), frames_taken(55.0, 30.0), frames_taken(100.0, 30.0)
    (1, 1, 2, 3)
    """
    return max(1, math.ceil(1e-3 * latency_ms * rate_hz - 1e-9))


class TrackingPolicy:
    """A tracker as the policy of `Track-v0`.

    Args:
        tracker: Any `records.Tracker`.
    """

    def __init__(self, tracker: Tracker) -> None:
        self.tracker = tracker
        self.reset()

    def reset(self) -> None:
        """An episode begins. Only needed where the target is not there to be selected from the start."""
        self.estimate: Estimate | None = None
        self._started = False

    def __call__(self, observation: Mapping[str, Any], info: Mapping[str, Any] | None = None) -> NDArray[np.float64]:
        """The box of the frame in the observation.

        Args:
            observation: An observation of one of the environments.
            info: The information that came with it: read only by trackers that ask for the truth (`oracle`).

        Returns:
            `(4,)` box x, y, w, h [px]; `self.estimate` holds it with its confidence. Zeros before there is a target.

        Raises:
            TrackerError: The tracker asks for the truth, and no `info` was passed.
        """
        image = observation["image"]
        if isinstance(self.tracker, NeedsTruth):
            if info is None:
                raise TrackerError("this tracker asks for the truth: call the policy with (observation, info)")
            truth: Truth = info["truth"]
            self.tracker.receive_truth(truth.box)
        if observation["first"]:
            box = np.asarray(observation["init_box"], dtype=np.float64)
            self.tracker.init(image, box)
            self.estimate = Estimate(box)
            self._started = True
        else:
            self.estimate = self.tracker.update(image) if self._started else NOTHING
        return np.array(self.estimate.box)


class FollowPolicy:
    """A tracker and a controller as the policy of `Follow-v0`.

    Args:
        tracker: Any `records.Tracker`.
        controller: Any `controllers.Controller`.
        rig: What the controller may know of the robot, see `rig_of`; None knows nothing but the size of the image.
    """

    def __init__(self, tracker: Tracker, controller: Controller, rig: RobotParameters | None = None) -> None:
        self.tracking = TrackingPolicy(tracker)
        self.controller = controller
        self._rig = rig
        self._begun = False

    def reset(self) -> None:
        """An episode begins. Only needed where the target is not there to be selected from the start."""
        self.tracking.reset()
        self._begun = False

    @property
    def estimate(self) -> Estimate | None:
        """What the tracker said last."""
        return self.tracking.estimate

    def __call__(self, observation: Mapping[str, Any], info: Mapping[str, Any] | None = None) -> NDArray[np.float64]:
        """The command that answers the observation.

        Args:
            observation: An observation of one of the environments.
            info: The information that came with it, as in `TrackingPolicy`.

        Returns:
            `(4,)` forward, turn, pan, tilt in [-1, 1].
        """
        self.tracking(observation, info)
        assert self.tracking.estimate is not None
        if observation["first"] or not self._begun:
            height_px, width_px = observation["image"].shape[:2]
            self.controller.reset(self._rig if self._rig is not None else RobotParameters((width_px, height_px)))
            self._begun = True
        return self.controller.act(self.tracking.estimate, observation["proprio"])


class TrackAndFollowPolicy(FollowPolicy):
    """A tracker and a controller as the policy of `TrackAndFollow-v0`."""

    def __call__(  # pyright: ignore[reportIncompatibleMethodOverride]
        self, observation: Mapping[str, Any], info: Mapping[str, Any] | None = None
    ) -> dict[str, Any]:
        """`{"box": (4,) box [px], "command": (4,) in [-1, 1]}`."""
        command = super().__call__(observation, info)
        assert self.estimate is not None
        return {"box": np.array(self.estimate.box), "command": command}


class LatencyWrapper:
    """Charges a policy's thinking to the simulation, as a policy of `TrackAndFollow-v0`.

    The policy takes a frame when it is idle, thinks for `latency_ms` of simulated time, and skips the frames that
    arrive meanwhile. Its command reaches the robot when it is ready, within the frame. Its box counts for a frame if it
    is ready before the next one arrives (as in the real-time experiment of Kristan et al. 2017, "The visual object
    tracking VOT2017 challenge results"); where it is not, the last one that was ready answers. With 0 ms it is the
    policy itself, to the bit.

    Args:
        policy: What thinks.
        latency_ms: For how long.
        rate_hz: Frames per second.

    Raises:
        ParameterError: A negative latency or a rate that is not positive.
    """

    def __init__(self, policy: TrackAndFollowPolicy, latency_ms: float, rate_hz: float) -> None:
        if not (math.isfinite(latency_ms) and latency_ms >= 0.0):
            raise ParameterError(f"latency must be 0 ms or more, got {latency_ms!r}")
        if not (math.isfinite(rate_hz) and rate_hz > 0.0):
            raise ParameterError(f"rate_hz must be positive, got {rate_hz!r}")
        self.policy = policy
        self._frames = 1e-3 * latency_ms * rate_hz
        self._every = frames_taken(latency_ms, rate_hz)
        self._frame_s = 1.0 / rate_hz
        self.reset()

    def reset(self) -> None:
        """An episode begins."""
        self.policy.reset()
        self.estimate: Estimate | None = None
        """What was said last, as old as it is."""
        self._since = 0
        self._thought: tuple[dict[str, Any], Estimate] | None = None
        self._said: dict[str, Any] | None = None

    def __call__(self, observation: Mapping[str, Any], info: Mapping[str, Any] | None = None) -> dict[str, Any]:
        """`{"box": (4,) [px], "command": (4,) in [-1, 1], "late_s": when in the frame the command is given}`."""
        if self._thought is None:
            action = self.policy(observation, info)
            assert self.policy.estimate is not None
            self._thought, self._since = (action, self.policy.estimate), 0
            if self._said is None:
                # The user's own selection is there at once; to act on it takes its time.
                self._said = {"box": action["box"], "command": np.zeros(4)}
                self.estimate = self.policy.estimate
        late = 0.0
        self._since += 1
        if self._since >= self._every:
            late = min(max(self._frames - (self._every - 1), 0.0), 1.0) * self._frame_s
            (self._said, self.estimate), self._thought = self._thought, None
        assert self._said is not None
        return {**self._said, "late_s": late} if late > 0.0 else dict(self._said)
