"""Trackers and controllers as policies of the environments: observation in, action out.

    policy = TrackingPolicy(trackers.make("ko2012"))
    action = policy(observation)

A policy starts its tracker in the frame in which the target is selected (`observation["first"]`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from pftrack_sim.controllers import Controller, RobotParameters
from pftrack_sim.core.arguments import checked
from pftrack_sim.core.errors import ParameterError, TrackerError, UnknownNameError
from pftrack_sim.core.records import Estimate, Image, Tracker
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scenario import ResolvedScenario
from pftrack_sim.scenario.camera import CAMERA
from pftrack_sim.trackers import NeedsDetections, NeedsTruth
from pftrack_sim.trackers.base import as_estimate

PAPER_MS: Mapping[str, float] = MappingProxyType(
    {"ko2012": 100.0, "lee2012": 55.0, "lee2012-color": 7.0, "lee2012-color-hog": 13.0}
)
"""Time per frame that the papers print for their trackers, on their machines [ms]."""

NO_ESTIMATE = Estimate(np.zeros(4), confidence=0.0)
"""Estimate before the target is selected."""

_TOLERANCE_S = 1e-9
"""Times are quotients of counts: a result due exactly with a frame is ready for it."""


@checked
def robot_parameters(settings: ResolvedScenario, latency_ms: float = 0.0) -> RobotParameters:
    """Parameters of the robot, the camera and the task that a controller may use.

    Args:
        settings: The resolved scenario.
        latency_ms: Time that the tracker takes per frame: the controller is called as often as the tracker answers.
    """
    robot, camera = settings.robot, settings.viewing.camera
    height_m, pan_rad, tilt_rad = _mounting(settings)
    return RobotParameters(
        (camera.width_px, camera.height_px),
        2.0 * camera.half_view_rad[1],
        camera.rate_hz / frames_per_result(latency_ms, camera.rate_hz),
        robot.max_speed_m_s,
        math.radians(robot.max_turn_deg_s),
        math.radians(robot.max_pan_deg_s),
        math.radians(robot.max_tilt_deg_s),
        settings.follow.distance_m,
        height_m,
        robot.range_finder.field_deg,
        robot.range_finder.range_m,
        pan_rad,
        tilt_rad,
    )


def _mounting(settings: ResolvedScenario) -> tuple[float, float, float]:
    """Height of the camera that is looked through, and pan and tilt of its axis off the head's, with the head at rest.

    A head that tilts turns the axis of a camera that looks aside; that is not told.
    """
    first = settings.camera
    if settings.viewed == CAMERA:
        return first.height_m, 0.0, 0.0
    tilt = math.radians(first.tilt_deg)
    pose = settings.T_camera(settings.viewed)
    (x, y, z), (_, down_m, ahead_m) = pose[:3, 2].tolist(), pose[:3, 3].tolist()
    forward, up = z * math.cos(tilt) + y * math.sin(tilt), z * math.sin(tilt) - y * math.cos(tilt)
    pan_rad, tilt_rad = math.atan2(-x, forward), math.asin(min(max(up, -1.0), 1.0)) - tilt
    return first.height_m - down_m * math.cos(tilt) + ahead_m * math.sin(tilt), pan_rad, tilt_rad


def frames_per_result(latency_ms: float, rate_hz: float) -> int:
    """Number of camera frames from one result of a tracker to the next, without frame loss.

    >>> frames_per_result(0.0, 30.0), frames_per_result(33.0, 30.0), frames_per_result(55.0, 30.0)
    (1, 1, 2)
    """
    return max(1, math.ceil(1e-3 * latency_ms * rate_hz - 1e-9))


class TrackingPolicy:
    """Any `records.Tracker` as the policy of `Track-v0`.

    Args:
        tracker: The tracker.
        target: Name in `info["targets"]`; None: the target of the observation.
        camera: Name in `info["cameras"]`; None: the one of the observation's `image`.

    With a name it starts where that target can first be seen by that camera.
    """

    @checked
    def __init__(self, tracker: Tracker, target: str | None = None, camera: str | None = None) -> None:
        self.tracker, self._target, self._camera = tracker, target, camera
        self.reset()

    def reset(self) -> None:
        """Begin an episode. Needed only where the target is not visible in the first frame."""
        self.estimate: Estimate | None = None
        self._started = False

    def __call__(self, observation: Mapping[str, Any], info: Mapping[str, Any] | None = None) -> FloatArray:
        """Return the box of the frame in the observation.

        Args:
            observation: An observation of one of the environments.
            info: The information that came with it; read only for trackers that need the truth (`oracle`) or
                detections, and where the observation has no image.

        Returns:
            `(4,)` box x, y, w, h [px], zeros before the target is selected; `self.estimate` holds the whole estimate.

        Raises:
            TrackerError: The tracker needs the truth or detections, and no `info` was passed; or it needs images, and
                the environment was made with `image=False`.
        """
        if self._target is not None or self._camera is not None:
            observation, info = self._as_main(observation, info)
        if isinstance(self.tracker, NeedsTruth):
            if info is None:
                raise TrackerError("this tracker needs the truth: call the policy with (observation, info)")
            self.tracker.receive_truth(info["truth"].box, info["truth"].visible_fraction)
        if isinstance(self.tracker, NeedsDetections):
            if info is None:
                raise TrackerError("this tracker follows detections: call the policy with (observation, info)")
            self.tracker.receive_detections(info["detections"])
        if "image" not in observation and not isinstance(self.tracker, (NeedsTruth, NeedsDetections)):
            raise TrackerError("this tracker needs images: make the environment without image=False")
        image = _image(observation, info)
        if observation["first"]:
            box = np.asarray(observation["init_box"], dtype=np.float64)
            self.tracker.init(image, box)
            self.estimate = Estimate(box)
            self._started = True
        else:
            self.estimate = as_estimate(self.tracker.update(image)) if self._started else NO_ESTIMATE
        return np.array(self.estimate.box)

    def _as_main(
        self, observation: Mapping[str, Any], info: Mapping[str, Any] | None
    ) -> tuple[Mapping[str, Any], Mapping[str, Any]]:
        """What is told of its camera and target, as if the episode were about them."""
        name, camera = self._target, self._camera
        if info is None:
            raise TrackerError(f"to follow {name or camera!r}, call the policy with (observation, info)")
        if info["frame"] == 0:
            self.reset()
        if camera is not None:
            cameras = info.get("cameras", {})
            if camera not in cameras:
                raise UnknownNameError("camera", camera, cameras)
            info = {**info, **cameras[camera]}
            images = observation.get("images", {})
            observation = {**observation, "image": images[camera]} if images else observation
        if name is not None and name not in info["targets"]:
            raise UnknownNameError("target", name, info["targets"])
        truth = info["truth"] if name is None else info["targets"][name]
        first = not self._started and truth.scored
        return {**observation, "first": int(first), "init_box": truth.box}, {**info, "truth": truth}


def _image(observation: Mapping[str, Any], info: Mapping[str, Any] | None) -> Image:
    """The image of an observation; a black one, for trackers that do not look at it, where it has none."""
    if "image" in observation:
        return observation["image"]
    if info is None:
        raise TrackerError("the observation has no image: call the policy with (observation, info)")
    width_px, height_px = info["image_size_px"]
    return np.zeros((height_px, width_px, 3), dtype=np.uint8)


class FollowPolicy:
    """A tracker and a controller as the policy of `Follow-v0`.

    Args:
        tracker: Any `records.Tracker`.
        controller: Any `controllers.Controller`.
        robot: What the controller may know of the robot, see `robot_parameters`; None: the size of the image only.
    """

    @checked
    def __init__(self, tracker: Tracker, controller: Controller, robot: RobotParameters | None = None) -> None:
        self.tracking = TrackingPolicy(tracker)
        self.controller = controller
        self._robot = robot
        self._started = False

    def reset(self) -> None:
        """Begin an episode. Needed only where the target is not visible in the first frame."""
        self.tracking.reset()
        self._started = False

    @property
    def estimate(self) -> Estimate | None:
        """Latest estimate of the tracker."""
        return self.tracking.estimate

    def __call__(self, observation: Mapping[str, Any], info: Mapping[str, Any] | None = None) -> FloatArray:
        """Return the `(4,)` command forward, turn, pan, tilt in [-1, 1]; arguments as in `TrackingPolicy`."""
        self.tracking(observation, info)
        assert self.tracking.estimate is not None
        if observation["first"] or not self._started:
            height_px, width_px = _image(observation, info).shape[:2]
            self.controller.reset(self._robot or RobotParameters((width_px, height_px)))
            self._started = True
        return self.controller.act(self.tracking.estimate, observation["proprio"])


class TrackAndFollowPolicy(FollowPolicy):
    """A tracker and a controller as the policy of `TrackAndFollow-v0`."""

    def __call__(  # pyright: ignore[reportIncompatibleMethodOverride]
        self, observation: Mapping[str, Any], info: Mapping[str, Any] | None = None
    ) -> dict[str, Any]:
        """Return `{"box": (4,) box [px], "command": (4,) in [-1, 1]}`."""
        command = super().__call__(observation, info)
        assert self.estimate is not None
        return {"box": np.array(self.estimate.box), "command": command}


class LatencyWrapper:
    """Charges the processing time of a policy to the simulation, as a policy of `TrackAndFollow-v0`.

    An idle policy takes the frame that arrives, is busy for `latency_ms` of simulated time, and skips the frames that
    arrive meanwhile. Its command reaches the robot when it is ready, also between frames. Its box answers a frame if
    it is ready within one camera period (the real-time experiment of Kristan et al. 2017, "The visual object tracking
    VOT2017 challenge results"); otherwise the latest finished box does. Times are those of the frames
    (`info["time_s"]`), so frames that are lost on the way do not make the policy slower. With 0 ms the actions are
    those of the policy itself, to the bit.

    Args:
        policy: The policy.
        latency_ms: Time it takes for a frame.
        rate_hz: Frames per second of the camera.

    Raises:
        ParameterError: A negative latency or a rate that is not positive.
    """

    def __init__(self, policy: TrackAndFollowPolicy, latency_ms: float, rate_hz: float) -> None:
        if not (math.isfinite(latency_ms) and latency_ms >= 0.0):
            raise ParameterError(f"latency must be 0 ms or more, got {latency_ms!r}")
        if not (math.isfinite(rate_hz) and rate_hz > 0.0):
            raise ParameterError(f"rate_hz must be positive, got {rate_hz!r}")
        self.policy = policy
        self._latency_s = 1e-3 * latency_ms
        self._period_s = 1.0 / rate_hz
        self.reset()

    def reset(self) -> None:
        """Begin an episode."""
        self.policy.reset()
        self.estimate: Estimate | None = None
        """Latest finished estimate."""
        self._action: dict[str, Any] | None = None
        self._pending: tuple[dict[str, Any], Estimate] | None = None
        self._ready_s = 0.0

    def __call__(self, observation: Mapping[str, Any], info: Mapping[str, Any]) -> dict[str, Any]:
        """Return `{"box": (4,) [px], "command": (4,) in [-1, 1], "late_s": time until the command is given}`."""
        time_s = float(info["time_s"])
        if self._pending is not None and self._ready_s <= time_s + _TOLERANCE_S:
            self._finish()
        if self._pending is None or observation["first"]:
            action = self.policy(observation, info)
            assert self.policy.estimate is not None
            self._pending, self._ready_s = (action, self.policy.estimate), time_s + self._latency_s
            if self._action is None or observation["first"]:
                # The selected box itself is known at once; a command for it takes the latency.
                held = self._action["command"] if self._action is not None else np.zeros(4)
                self._action, self.estimate = {"box": action["box"], "command": held}, self.policy.estimate
        assert self._action is not None
        assert self._pending is not None
        late_s = self._ready_s - time_s
        if late_s <= self._period_s + _TOLERANCE_S:
            self._finish()
            late_s = min(late_s, self._period_s)
            return {**self._action, "late_s": late_s} if late_s > _TOLERANCE_S else dict(self._action)
        return {**self._action, "command": self._pending[0]["command"], "late_s": late_s}

    def _finish(self) -> None:
        assert self._pending is not None
        (self._action, self.estimate), self._pending = self._pending, None
