"""One unit of work: an episode is drawn once and shown to its trackers. It runs in any process, on any machine.

What it finds comes back as bytes, so that workers need no disk in common with whoever asked.
"""

from __future__ import annotations

import hashlib
import tempfile
import threading
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

import pftrack_sim
from pftrack_sim import score
from pftrack_sim.benchmark.columns import estimate_columns, truth_columns, write_episode
from pftrack_sim.benchmark.drive import drive
from pftrack_sim.benchmark.drive_log import Shown
from pftrack_sim.benchmark.plan import Episode, TrackerSpec
from pftrack_sim.benchmark.tracker_runner import Isolation, TrackerRun, enter
from pftrack_sim.benchmark.video import VideoWriter
from pftrack_sim.core.errors import RunError
from pftrack_sim.core.records import Estimate, Truth
from pftrack_sim.render.overlay import draw_frame
from pftrack_sim.simulation.simulation import Simulation
from pftrack_sim.trackers.isolation import Limits

# A process draws one episode at a time, however many threads a cluster gives it: OpenGL contexts belong to threads.
_drawing = threading.Lock()


@dataclass(frozen=True)
class Job:
    """An episode and how to run it.

    Attributes:
        episode: Which.
        trackers: Who is shown it.
        video: Whether to film it.
        backend: OpenGL backend.
        isolation: Which trackers get a process of their own.
        limits: What those may take.
        version: Of this package where the job was made.
    """

    episode: Episode
    trackers: tuple[TrackerSpec, ...]
    video: bool = False
    backend: str | None = None
    isolation: Isolation = "auto"
    limits: Limits = field(default_factory=Limits)
    version: str = pftrack_sim.__version__


@dataclass(frozen=True)
class Outcome:
    """What came of an episode.

    Attributes:
        table: Its Parquet file.
        video: Its MP4 file, or None.
        frames: Number of frames.
        rows: For each tracker its scores, as in `summary.parquet`.
    """

    table: bytes
    video: bytes | None
    frames: int
    rows: tuple[dict[str, Any], ...]


def play(job: Job, on_frame: Callable[[], None] = lambda: None) -> Outcome:
    """Run an episode.

    Args:
        job: What to run.
        on_frame: Called after every frame.

    Raises:
        RenderError: Nothing can draw.
        ScenarioError: The scenario contradicts itself at this seed.
        RunError: No room for its files, or another version of this package.
    """
    if job.version != pftrack_sim.__version__:
        raise RunError(f"a worker has pftrack-sim {pftrack_sim.__version__}, but {job.version} was asked for")
    with _drawing, ExitStack() as stack:
        try:
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="pftrack-sim-")))
        except OSError as error:
            raise RunError(f"cannot make a temporary folder: {error.strerror}") from None
        entries = enter(job.trackers, seed=job.episode.seed, isolation=job.isolation, limits=job.limits)
        for entry in entries:
            stack.callback(entry.close)
        video = folder / "episode.mp4" if job.video else None
        if job.episode.kind == "follow":
            shown = drive(job.episode, entries[0], video, job.backend, on_frame)
        else:
            simulation = stack.enter_context(Simulation(job.episode.scenario, backend=job.backend))
            shown = _show(simulation, job.episode.seed, entries, video, on_frame)
        rows = _write(folder / "episode.parquet", job.episode, shown)
        return Outcome(
            table=(folder / "episode.parquet").read_bytes(),
            video=video.read_bytes() if video is not None else None,
            frames=len(shown.truths),
            rows=tuple(rows),
        )


def _show(
    simulation: Simulation, seed: int, entries: list[TrackerRun], video: Path | None, on_frame: Callable[[], None]
) -> Shown:
    """Show every frame to every tracker."""
    truths: list[Truth] = []
    pixels = hashlib.blake2b(digest_size=16)
    frame = simulation.reset(seed)
    with ExitStack() as open_files:
        writer = None
        if video is not None:
            writer = open_files.enter_context(VideoWriter(video, simulation.settings.camera.rate_hz))
        while True:
            pixels.update(np.ascontiguousarray(frame.image).data)
            said: dict[str, Estimate] = {}
            for entry in entries:
                estimate = entry.see(frame.image, frame.truth.box, frame.truth.scored)
                if estimate is not None:
                    said[entry.name] = estimate
            truths.append(frame.truth)
            if writer is not None:
                writer.add(draw_frame(frame, said))
            on_frame()
            if len(truths) == simulation.frame_count:
                return Shown(truths, entries, pixels.hexdigest(), simulation.graphics)
            frame = simulation.advance()


def _write(path: Path, episode: Episode, shown: Shown) -> list[dict[str, Any]]:
    """Score every tracker and write the episode's file."""
    truths = shown.truths
    key: dict[str, str | int] = {
        "kind": episode.kind,
        "scenario": episode.scenario.name,
        "condition": episode.condition.name,
        "seed": episode.seed,
    }
    truth_boxes = np.array([getattr(one, episode.truth) for one in truths])
    scored = np.array([one.scored for one in truths])
    visible = np.array([one.visible_fraction for one in truths])
    times = np.array([one.time_s for one in truths])
    rate_hz = episode.scenario.resolve(episode.seed).camera.rate_hz
    rows: list[dict[str, Any]] = []
    tables: list[dict[str, np.ndarray]] = []
    for entry in shown.entries:
        frames = score.frame_scores(entry.boxes, truth_boxes)
        summary = score.measure(frames, scored, visible, np.array(entry.ms), times)
        tables.append(estimate_columns(entry, frames.overlap, frames.centre_error_px))
        said = {"failure": entry.failure, "printed": entry.printed}
        rows.append({**key, "tracker": entry.name, **summary.as_dict(), **shown.scores, **said})
    sums = {
        **key,
        "path": episode.path,
        "truth": episode.truth,
        "levels": dict(episode.condition.levels),
        "frames": len(truths),
        "rate_hz": rate_hz,
        "frames_digest": shown.pixels,
        "graphics": shown.graphics,
        "version": pftrack_sim.__version__,
        "trackers": rows,
    }
    write_episode(path, key, {**truth_columns(truths), **shown.columns}, tables, sums)
    return rows
