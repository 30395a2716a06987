"""`Track-v0`: the robot follows its script; `Follow-v0` and `TrackAndFollow-v0`: actions drive it."""

from __future__ import annotations

import math
from typing import Any, SupportsFloat, cast

import gymnasium as gym
import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.core import boxes
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.records import Estimate, Frame
from pftrack_sim.env.base import CameraEnv, Observation, checked_command
from pftrack_sim.env.spaces import BoundingBox


class TrackEnv(CameraEnv):
    """Track from a moving camera; the robot follows the scenario's script.

    Action: `(4,)` box x, y, w, h [px] of the target in the frame of the observation. Boxes may leave the image.

    Reward: overlap (intersection over union) of that box with the amodal box of the target in that frame, clipped to
    the image (Ko et al. 2012, eq. 14); 0 while the target is out of view.

    Information: `truth` and `people` of the frame in the observation; after a step also `overlap` (the reward) and
    `scored` of the frame that was answered: whether the target could be seen, so that the frame counts in a mean.

    End: truncated after the scenario's duration; never terminated.

    Raises:
        BoxError: An invalid box: NaN, infinite, a negative size, or not of shape (4,).
    """

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.action_space = BoundingBox(*self.image_size_px)

    def step(self, action: ArrayLike) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Score the box on the frame shown and return the next frame."""
        answer = Estimate(boxes.checked(action, what="action"))
        shown = self._current
        reward = boxes.iou(shown.truth.box, answer.box)
        frame = self._advance(None, answer)
        info = {**self._info(frame), "overlap": reward, "scored": shown.truth.scored}
        return self._observation(frame), reward, False, self._over, info


def following_reward(distance_error: float, bearing_error: float) -> float:
    """How well the target is followed, in [0, 1], from the absolute errors of distance and bearing over their limits.

    Active object tracking scores the errors of distance and bearing, each divided by its limit, and sums them (Luo et
    al. 2018, "End-to-end active object tracking via reinforcement learning"; Zhong et al. 2019, "AD-VAT: an asymmetric
    dueling mechanism for learning visual active tracking"). Here the sum falls off along a raised cosine, so that the
    reward is smooth at both ends and never negative.

    >>> following_reward(0.0, 0.0), following_reward(0.5, 0.5)
    (1.0, 0.0)
    """
    return 0.5 * (1.0 + math.cos(math.pi * min(1.0, distance_error + bearing_error)))


class FollowEnv(CameraEnv):
    """Follow the target with the robot.

    Action: `(4,)` command in [-1, 1]: forward speed, turn rate, pan rate, tilt rate, as shares of the robot's limits
    (`robot.max_speed_m_s` and so on); beyond the limits it is clipped, and the frames where it was are counted.

    Reward: `following_reward` of the distance on the ground between camera and target against `follow.distance_m`, and
    of the target's bearing off the optical axis, at the frame that the command leads to.

    Information: `truth`, `people`, and after a step `distance_m`, `bearing_rad`, `bystander_m` (from the robot to the
    nearest person but the target, on the ground), `collision` (name of what the robot touches, or None), `lost_s` (how
    long nothing of the target has been seen), `command` (as applied), `clipped` (how many commands of the episode went
    beyond the limits) and `outcome` (`"collision"`, `"lost"`, `"finished"`, or None while it goes on).

    End: terminated on collision or when the target is lost longer than `follow.lost_after_s`; truncated after the
    duration.

    Raises:
        CommandError: An action that is not four finite numbers.
    """

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.action_space: gym.Space[Any] = command_space()

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode at the initial pose of the scenario's script."""
        self._seen_s = 0.0
        self._clipped, self._exceeds = 0, False
        return super().reset(seed=seed, options=options)

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Drive until the next frame."""
        return self._drive(action, None)

    def _drive(
        self, action: ArrayLike, answer: Estimate | None, late_s: float = 0.0
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        given = checked_command(action)
        command = np.clip(given, -1.0, 1.0)
        frame = self._advance(command, answer, late_s)
        if self.simulation.command is command:
            self._exceeds = bool((command != given).any())
        self._clipped += self._exceeds
        follow = self.simulation.settings.follow
        distance_m, bearing_rad = distance_and_bearing(frame)
        if frame.truth.scored:
            self._seen_s = frame.time_s
        lost_s = frame.time_s - self._seen_s
        collision = self.simulation.collision()
        reward = following_reward(
            abs(distance_m - follow.distance_m) / follow.distance_limit_m,
            abs(bearing_rad) / math.radians(follow.bearing_limit_deg),
        )
        lost = lost_s > follow.lost_after_s
        outcome = "collision" if collision is not None else "lost" if lost else "finished" if self._over else None
        info = {
            **self._info(frame),
            "distance_m": distance_m,
            "bearing_rad": bearing_rad,
            "bystander_m": self.simulation.world.bystander_m(frame.truth.name),
            "collision": collision,
            "lost_s": lost_s,
            "command": self.simulation.command if self.simulation.command is not None else np.zeros(4),
            "clipped": self._clipped,
            "outcome": outcome,
        }
        return self._observation(frame), reward, outcome in ("collision", "lost"), self._over, info


class TrackAndFollowEnv(FollowEnv):
    """Track and follow at once, both scored on the same episode.

    Action: `{"box": (4,) box [px], "command": (4,) in [-1, 1]}`: the box answers the frame shown, the command drives. A
    third key, `"late_s"`, gives the time from the frame until the command is given; until then the one before stays in
    force, and a command due after the next frame is not given (`policies.LatencyWrapper` charges latency this way).

    Reward: mean of the overlap (as in `TrackEnv`) and the following reward (as in `FollowEnv`); `info["overlap"]` and
    `info["following"]` hold the two, `info["scored"]` whether the answered frame counts in a mean overlap.

    Raises:
        BoxError: The box is no box.
        CommandError: The command is not four finite numbers.
        ParameterError: The action has other keys.
    """

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.action_space = gym.spaces.Dict({"box": BoundingBox(*self.image_size_px), "command": command_space()})

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Score the box on the frame shown, drive, and return the next frame."""
        values = cast("dict[str, Any]", action if isinstance(action, dict) else {})
        if set(values) - {"late_s"} != {"box", "command"}:
            given = sorted(map(str, values)) if isinstance(action, dict) else repr(action)
            raise ParameterError(f"an action must be a dict with the keys 'box' and 'command', got {given}")
        answer = Estimate(boxes.checked(values["box"], what="action['box']"))
        late_s = _checked_late(values.get("late_s", 0.0))
        shown = self._current
        overlapping = boxes.iou(shown.truth.box, answer.box)
        observation, following, terminated, truncated, info = self._drive(values["command"], answer, late_s)
        info = {**info, "overlap": overlapping, "following": following, "scored": shown.truth.scored}
        return observation, 0.5 * (overlapping + following), terminated, truncated, info


def _checked_late(late_s: Any) -> float:
    seconds = float(late_s) if isinstance(late_s, SupportsFloat) and not isinstance(late_s, np.ndarray) else math.nan
    if not 0.0 <= seconds < math.inf:
        raise ParameterError(f"late_s must be 0 s or more, got {late_s!r}")
    return seconds


def command_space() -> gym.spaces.Box:
    """Forward speed, turn rate, pan rate, tilt rate, each in [-1, 1]."""
    return gym.spaces.Box(-1.0, 1.0, (4,), np.float32)


def distance_and_bearing(frame: Frame) -> tuple[float, float]:
    """Distance on the ground from camera to target [m], and the target's bearing off the optical axis [rad].

    Positive bearings are to the left.
    """
    camera = frame.truth.T_world_camera
    offset = frame.truth.T_world_target[:2, 3] - camera[:2, 3]
    axis = camera[:2, 2]
    bearing = math.atan2(axis[0] * offset[1] - axis[1] * offset[0], axis[0] * offset[0] + axis[1] * offset[1])
    return float(np.hypot(*offset)), bearing
