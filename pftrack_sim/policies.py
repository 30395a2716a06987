"""Trackers and controllers as policies of the environments: observation in, action out.

    policy = TrackingPolicy(trackers.make("ko2012"))
    action = policy(observation)

A policy notices the first frame of an episode by itself (`observation["first"]`) and starts its tracker there.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.controllers import Controller, Rig
from pftrack_sim.errors import TrackerError
from pftrack_sim.records import Estimate, Tracker, Truth
from pftrack_sim.scenario import ResolvedScenario
from pftrack_sim.trackers import NeedsTruth


def rig_of(settings: ResolvedScenario) -> Rig:
    """What a controller may know of the robot and the task of a scenario."""
    robot, camera = settings.robot, settings.camera
    return Rig(
        (camera.width_px, camera.height_px),
        math.radians(camera.fovy_deg),
        camera.rate_hz,
        robot.max_speed_m_s,
        math.radians(robot.max_turn_deg_s),
        math.radians(robot.max_pan_deg_s),
        math.radians(robot.max_tilt_deg_s),
        settings.follow.distance_m,
    )


class TrackingPolicy:
    """A tracker as the policy of `Track-v0`.

    Args:
        tracker: Any `records.Tracker`.
    """

    def __init__(self, tracker: Tracker) -> None:
        self.tracker = tracker
        self.estimate: Estimate | None = None

    def __call__(self, observation: Mapping[str, Any], info: Mapping[str, Any] | None = None) -> NDArray[np.float64]:
        """The box of the frame in the observation.

        Args:
            observation: An observation of one of the environments.
            info: The information that came with it: read only by trackers that ask for the truth (`oracle`).

        Returns:
            `(4,)` box x, y, w, h [px]; `self.estimate` holds it with its confidence.

        Raises:
            TrackerError: The tracker asks for the truth, and no `info` was passed.
        """
        image = observation["image"]
        if isinstance(self.tracker, NeedsTruth):
            if info is None:
                raise TrackerError("this tracker asks for the truth: call the policy with (observation, info)")
            truth: Truth = info["truth"]
            self.tracker.tell(truth.box)
        if observation["first"]:
            box = np.asarray(observation["init_box"], dtype=np.float64)
            self.tracker.init(image, box)
            self.estimate = Estimate(box)
        else:
            self.estimate = self.tracker.update(image)
        return np.array(self.estimate.box)


class FollowPolicy:
    """A tracker and a controller as the policy of `Follow-v0`.

    Args:
        tracker: Any `records.Tracker`.
        controller: Any `controllers.Controller`.
        rig: What the controller may know of the robot, see `rig_of`; None knows nothing but the size of the image.
    """

    def __init__(self, tracker: Tracker, controller: Controller, rig: Rig | None = None) -> None:
        self.tracking = TrackingPolicy(tracker)
        self.controller = controller
        self._rig = rig

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
        if observation["first"]:
            height_px, width_px = observation["image"].shape[:2]
            self.controller.reset(self._rig if self._rig is not None else Rig((width_px, height_px)))
        return self.controller.act(self.tracking.estimate, observation["proprio"])


class TrackAndFollowPolicy(FollowPolicy):
    """A tracker and a controller as the policy of `TrackAndFollow-v0`."""

    def __call__(  # pyright: ignore[reportIncompatibleMethodOverride]
        self, observation: Mapping[str, Any], info: Mapping[str, Any] | None = None
    ) -> dict[str, NDArray[np.float64]]:
        """`{"box": (4,) box [px], "command": (4,) in [-1, 1]}`."""
        command = super().__call__(observation, info)
        assert self.estimate is not None
        return {"box": np.array(self.estimate.box), "command": command}
