"""What an episode leaves behind when it was shown or driven, and how a drive is scored."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pftrack_sim.benchmark.columns import column
from pftrack_sim.benchmark.tracker_runner import TrackerRun
from pftrack_sim.core.records import Truth
from pftrack_sim.score import following


@dataclass(frozen=True, eq=False)
class Shown:
    """An episode that is over.

    Attributes:
        truths: The target's, frame by frame.
        entries: What each tracker said.
        pixels: Digest of all of them.
        graphics: What drew them.
        columns: More columns of the episode's table, a row for each frame.
        scores: More columns of the summary.
    """

    truths: list[Truth]
    entries: list[TrackerRun]
    pixels: str
    graphics: str
    columns: Mapping[str, np.ndarray] = field(default_factory=dict[str, np.ndarray])
    scores: Mapping[str, Any] = field(default_factory=dict[str, Any])


class Log:
    """A drive, frame by frame. Places are those when a frame was drawn; `after_*` is where its command led."""

    def __init__(self) -> None:
        self._columns: dict[str, list[Any]] = {}

    def add(
        self,
        truth: Truth,
        pose: Sequence[float],
        action: Mapping[str, Any],
        info: Mapping[str, Any],
        then: Sequence[float],
    ) -> None:
        """Write down a frame.

        Args:
            truth: Of the frame.
            pose: The robot's x, y [m] and heading [rad] when it was drawn.
            action: What answered it.
            info: What the step said.
            then: The robot's pose after it.
        """
        camera, late_s = truth.T_world_camera, float(action.get("late_s", 0.0))
        forward, turn, pan, tilt = info["command"]
        row = {
            "robot_x_m": pose[0],
            "robot_y_m": pose[1],
            "robot_heading_rad": pose[2],
            "gaze_rad": math.atan2(camera[1, 2], camera[0, 2]),
            "target_x_m": truth.T_world_target[0, 3],
            "target_y_m": truth.T_world_target[1, 3],
            "command_forward": forward,
            "command_turn": turn,
            "command_pan": pan,
            "command_tilt": tilt,
            "late_s": late_s if late_s <= info["time_s"] - truth.time_s + 1e-9 else 0.0,
            "after_s": info["time_s"],
            "after_x_m": then[0],
            "after_y_m": then[1],
            "after_distance_m": info["distance_m"],
            "after_bearing_rad": info["bearing_rad"],
            "after_seen": info["truth"].scored,
            "following": info["following"],
        }
        for name, value in row.items():
            self._columns.setdefault(name, []).append(value)

    def table(self) -> dict[str, np.ndarray]:
        """`(N,)` columns."""
        return {name: column(values) for name, values in self._columns.items()}

    def scores(self, task: Any, frames: int, info: Mapping[str, Any]) -> dict[str, Any]:
        """How well it followed, as columns of the summary.

        Args:
            task: The scenario's `follow` section.
            frames: Of a full episode.
            info: What the last step said.
        """
        done = self.table()
        course = following.DrivenPath(
            done["after_s"],
            done["after_distance_m"],
            done["after_bearing_rad"],
            done["after_seen"],
            np.stack([done["after_x_m"], done["after_y_m"]], axis=1),
            info["outcome"],
        )
        limit_rad = float(np.deg2rad(task.bearing_limit_deg))
        goal = following.FollowTask(task.distance_m, task.distance_limit_m, limit_rad, frames)
        scored = following.summarise(course, goal).as_dict()
        ended = {"outcome": info["outcome"], "collided_with": info["collision"], "clipped": info["clipped"]}
        return {**{f"follow_{key}": value for key, value in scored.items()}, **ended}
