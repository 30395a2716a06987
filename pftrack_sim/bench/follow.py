"""Closed loop: the tracker drives the camera. Overlap and following are scored on the same episode."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import duckdb
import numpy as np

from pftrack_sim import controllers, policies, score, trackers
from pftrack_sim.bench.naming import slug
from pftrack_sim.bench.plan import Episode, Plan
from pftrack_sim.bench.planning import make_plan
from pftrack_sim.bench.video import VideoWriter
from pftrack_sim.boxes import NO_BOX
from pftrack_sim.env import TrackAndFollowEnv
from pftrack_sim.env.base import checked_command
from pftrack_sim.errors import ParameterError, RunError
from pftrack_sim.records import Estimate
from pftrack_sim.render.overlay import draw_frame
from pftrack_sim.scenario import ScenarioLike
from pftrack_sim.score import following

LATENCY = "latency"
"""The stress axis that lives in the run and not in the scenario: milliseconds, for every tracker alike."""

FORMAT = 1


@dataclass(frozen=True)
class Drive:
    """One episode of a closed-loop plan.

    Attributes:
        episode: Scenario, condition and seed.
        tracker: Its name.
        controller: Its name.
        latency_ms: Charged for every frame that the tracker takes.
    """

    episode: Episode
    tracker: str
    controller: str
    latency_ms: float

    @property
    def name(self) -> str:
        """Unique within the plan and safe as a file's name."""
        return "__".join(
            [slug(self.episode.name), slug(self.tracker), slug(self.controller), f"latency-{self.latency_ms:g}ms"]
        )

    @property
    def key(self) -> dict[str, Any]:
        """What the episode is, for a table."""
        return {
            "scenario": self.episode.scenario.name,
            "condition": self.episode.condition.name,
            "seed": self.episode.seed,
            "tracker": self.tracker,
            "controller": self.controller,
            "latency_ms": self.latency_ms,
        }


@dataclass(frozen=True)
class Driven:
    """How one episode went.

    Attributes:
        drive: What was driven.
        overlap: How well the boxes agreed with the truth.
        following: How well the robot followed.
        outcome: `"finished"`, `"collision"` or `"lost"`.
        collision: What the robot touched, or None.
        clipped: Commands beyond the limits.
        failure: What went wrong in the tracker or the controller, and at which frame, or None. From there on the robot
            stands still.
        frames_digest: Of all pixels.
    """

    drive: Drive
    overlap: score.Summary
    following: following.Following
    outcome: str
    collision: str | None
    clipped: int
    failure: str | None
    frames_digest: str

    @property
    def row(self) -> dict[str, Any]:
        """One row of `summary.parquet`."""
        ended = {"outcome": self.outcome, "collided_with": self.collision, "clipped": self.clipped}
        scores = {key: value for key, value in self.overlap.as_dict().items() if key != "ms_median"}
        followed = {f"follow_{key}": value for key, value in self.following.as_dict().items()}
        return {**self.drive.key, **scores, **followed, **ended, "failure": self.failure, "frames": self.overlap.frames}


def make_drives(
    names: Sequence[ScenarioLike],
    tracker_names: Sequence[str],
    controller_names: Sequence[str],
    seeds: Sequence[int],
    *,
    axes: Mapping[str, Sequence[float]] | None = None,
    overrides: Mapping[str, Any] | None = None,
    latency_ms: Mapping[str, float] | None = None,
) -> tuple[Drive, ...]:
    """All combinations, each an episode of its own: what the tracker says changes what the camera sees.

    Args:
        names: Scenarios.
        tracker_names: Names for `trackers.make`.
        controller_names: Names for `controllers.make`.
        seeds: Root seeds.
        axes: Severities for each stress axis; the axis `latency` is in milliseconds and overrides `latency_ms`.
        overrides: Dotted keys set in every scenario.
        latency_ms: For each tracker that is charged for its time; the others are not.

    Raises:
        UnknownNameError: An unknown scenario, axis, tracker or controller.
        ParameterError: Nothing to run, something given twice, or a latency that is none.
    """
    levels = dict(axes or {})
    for_all = levels.pop(LATENCY, None)
    charged = dict(latency_ms or {})
    for name in charged:
        if name not in tracker_names:
            raise ParameterError(f"latency is given for {name!r}, which is not among {', '.join(tracker_names)}")
    for value in [*charged.values(), *(for_all or [])]:
        if not (np.isfinite(value) and value >= 0.0):
            raise ParameterError(f"a latency must be 0 ms or more, got {value!r}")
    if not controller_names or len(set(controller_names)) < len(controller_names):
        raise ParameterError(f"controllers must be given, and each once, got {', '.join(controller_names) or 'none'}")
    plan: Plan = make_plan(names, tracker_names, seeds, axes=levels, overrides=overrides)
    # Mistakes in names are told before anything is drawn.
    for name in tracker_names:
        trackers.make(name)
    for name in controller_names:
        controllers.make(name)
    return tuple(
        Drive(episode, tracker, controller, late)
        for episode in plan.episodes()
        for controller in controller_names
        for tracker in tracker_names
        for late in (for_all if for_all is not None else [charged.get(tracker, 0.0)])
    )


@dataclass
class _Log:
    """What one episode leaves behind, frame by frame."""

    columns: dict[str, list[Any]] = field(default_factory=dict[str, list[Any]])

    def add(self, **values: Any) -> None:
        for key, value in values.items():
            self.columns.setdefault(key, []).append(value)

    def array(self, key: str) -> np.ndarray:
        return np.array(self.columns[key])


def drive(
    one: Drive,
    *,
    video: Path | None = None,
    backend: str | None = None,
    on_frame: Callable[[], None] = lambda: None,
) -> tuple[Driven, dict[str, np.ndarray]]:
    """Drive one episode.

    Args:
        one: What to drive.
        video: MP4 to write, or None.
        backend: Renderer, by name.
        on_frame: Called after every frame.

    Returns:
        How it went, and a table with one row for each frame.
    """
    with ExitStack() as open_things:
        env = TrackAndFollowEnv(one.episode.scenario, backend=backend)
        open_things.callback(env.close)
        observation, info = env.reset(seed=one.episode.seed)
        settings, world = env.simulation.settings, env.simulation.world
        policy = policies.Late(
            policies.TrackAndFollowPolicy(
                trackers.make(one.tracker, seed=one.episode.seed),
                controllers.make(one.controller),
                policies.rig_of(settings, one.latency_ms),
            ),
            one.latency_ms,
            settings.camera.rate_hz,
        )
        writer = None
        if video is not None:
            writer = open_things.enter_context(VideoWriter(video, settings.camera.rate_hz))
        log, pixels = _Log(), hashlib.blake2b(digest_size=16)
        failure: str | None = None
        outcome: str | None = None
        while outcome is None:
            frame = env._current
            pixels.update(np.ascontiguousarray(frame.image).data)
            estimate: Estimate | None = None
            action: dict[str, Any] = {"box": np.zeros(4), "command": np.zeros(4)}
            if failure is None:
                try:
                    answer = policy(observation, info)
                    checked_command(answer["command"])
                    action, estimate = answer, policy.estimate
                except Exception as error:  # noqa: BLE001 - a stranger's tracker or controller may raise anything
                    failure = f"frame {frame.index}: {type(error).__name__}: {error}"
            box = NO_BOX if estimate is None else estimate.box
            before = {"box": box, "confidence": np.nan if estimate is None else estimate.confidence}
            said = {} if estimate is None else {one.tracker: estimate}
            truth, pose = frame.truth, world.robot_pose()
            if writer is not None:
                writer.add(draw_frame(frame, said))
            observation, _, _, _, info = env.step(action)
            outcome = info["outcome"]
            log.add(
                frame=frame.index,
                time_s=frame.time_s,
                robot_x_m=pose[0],
                robot_y_m=pose[1],
                robot_heading_rad=pose[2],
                pan_axis_rad=float(np.arctan2(*truth.T_world_camera[1::-1, 2])),
                target_x_m=truth.T_world_target[0, 3],
                target_y_m=truth.T_world_target[1, 3],
                state=truth.state,
                truth=truth.box,
                **before,
                overlap=score.overlaps(box[None], truth.box[None])[0],
                centre_error_px=score.centre_errors(box[None], truth.box[None])[0],
                command=info["command"],
                late_s=action.get("late_s", 0.0),
                distance_m=info["distance_m"],
                bearing_rad=info["bearing_rad"],
                seen=info["truth"].scored,
                arrived_s=info["time_s"],
                arrived_xy=world.robot_pose()[:2],
                following=info["following"],
            )
            on_frame()
        return _settle(one, settings.follow, env.simulation.frame_count, log, info, failure, pixels.hexdigest())


def _settle(
    one: Drive, task: Any, frames: int, log: _Log, info: Mapping[str, Any], failure: str | None, digest: str
) -> tuple[Driven, dict[str, np.ndarray]]:
    visible = log.array("state") == "visible"
    overlap = score.summarise(log.array("overlap"), log.array("centre_error_px"), visible, np.zeros(len(visible)))
    course = following.Course(
        log.array("arrived_s"),
        log.array("distance_m"),
        log.array("bearing_rad"),
        log.array("seen"),
        log.array("arrived_xy"),
        info["outcome"],
    )
    goal = following.Task(task.distance_m, task.distance_limit_m, float(np.deg2rad(task.bearing_limit_deg)), frames)
    driven = Driven(
        one,
        overlap,
        following.summarise(course, goal),
        info["outcome"],
        info["collision"],
        info["clipped"],
        failure,
        digest,
    )
    return driven, {key: _column(values) for key, values in log.columns.items()}


def run(
    drives: Sequence[Drive],
    path: Path,
    *,
    videos: str = "first",
    backend: str | None = None,
    on_frame: Callable[[], None] = lambda: None,
) -> list[Driven]:
    """Drive every episode and leave a run folder: `run.json`, `episodes/`, `summary.parquet`, `videos/`.

    Args:
        drives: From `make_drives`.
        path: Folder to make; absent or empty.
        videos: `"first"` (of the first seed), `"all"` or `"none"`.
        backend: Renderer, by name.
        on_frame: Called after every frame.

    Raises:
        RunError: The folder cannot be made or written.
        ParameterError: Another word for videos.
    """
    if videos not in ("first", "all", "none"):
        raise ParameterError(f"videos must be one of first, all, none, got {videos!r}")
    try:
        if path.exists() and (not path.is_dir() or any(path.iterdir())):
            raise RunError(f"{path} exists and is not an empty folder: choose another with --out")
        (path / "episodes").mkdir(parents=True)
    except OSError as error:
        raise RunError(f"cannot make the run folder {path}: {error.strerror}") from None
    results: list[Driven] = []
    for one in drives:
        wanted = videos == "all" or (videos == "first" and one.episode.seed == drives[0].episode.seed)
        video = path / "videos" / f"{one.name}.mp4" if wanted else None
        driven, table = drive(one, video=video, backend=backend, on_frame=on_frame)
        _write(path / "episodes" / f"{one.name}.parquet", table)
        results.append(driven)
    rows = [result.row for result in results]
    _write(path / "summary.parquet", {key: _column([row[key] for row in rows]) for key in rows[0]})
    record = {
        "format": FORMAT,
        "kind": "follow",
        "scenarios": {one.episode.scenario.name: one.episode.scenario.digest for one in drives},
        "episodes": [
            {**result.drive.key, "file": f"episodes/{result.drive.name}.parquet", "frames": result.frames_digest}
            for result in results
        ],
    }
    part = path / ".run.json.part"
    part.write_text(json.dumps(record, indent=2) + "\n", encoding="utf-8")
    os.replace(part, path / "run.json")
    return results


def _write(target: Path, table: Mapping[str, np.ndarray]) -> None:
    part = target.with_name(f".{target.name}.part")
    rows = dict(table)
    with duckdb.connect() as database:
        database.register("rows", rows)
        try:
            quoted = str(part).replace("'", "''")
            database.execute(f"COPY (SELECT * FROM rows) TO '{quoted}' (FORMAT parquet)")
            os.replace(part, target)
        except (OSError, duckdb.Error) as error:
            part.unlink(missing_ok=True)
            raise RunError(f"cannot write {target}: {error}") from None


def _column(values: Sequence[Any]) -> np.ndarray:
    if any(isinstance(value, (str, tuple, np.ndarray)) or value is None for value in values):
        # Filled by hand: numpy would make a table out of rows of equal length.
        column = np.empty(len(values), dtype=object)
        for index, value in enumerate(values):
            column[index] = list(value) if isinstance(value, (tuple, np.ndarray)) else value
        return column
    return np.array(values)
