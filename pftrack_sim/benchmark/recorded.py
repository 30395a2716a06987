"""Trackers on recorded sequences: the same contest, with images from a folder and boxes drawn by hand."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pftrack_sim import score
from pftrack_sim.benchmark.plan import TrackerSpec
from pftrack_sim.benchmark.tracker_runner import TrackerRun, enter
from pftrack_sim.benchmark.video import VideoWriter
from pftrack_sim.core.errors import ParameterError, RunError
from pftrack_sim.core.records import Estimate
from pftrack_sim.formats import RecordedSequence
from pftrack_sim.render.overlay import draw_recorded
from pftrack_sim.score import Summary

VIDEO_RATE_HZ = 25.0
"""Of the videos: folders of images do not say how fast they were taken."""


@dataclass(frozen=True)
class RecordedResult:
    """What one tracker scored on one sequence with one seed."""

    sequence: str
    tracker: str
    seed: int
    summary: Summary
    failure: str | None


def evaluate(
    sequences: Sequence[RecordedSequence],
    trackers: Sequence[str | TrackerSpec],
    seeds: Sequence[int],
    *,
    video: Path | None = None,
    on_frame: Callable[[], None] = lambda: None,
) -> list[RecordedResult]:
    """Run every tracker on every sequence with every seed.

    A tracker starts at the first frame with truth; frames without truth are shown and not scored.

    Args:
        sequences: As `formats.read_sequence` gives them.
        trackers: Trackers with their presets and parameters; a name alone is one without any.
        seeds: Seeds of the trackers.
        video: Where to show every tracker's boxes and, of one that gives them, particles at the first seed, with the
            truth: as `video_paths` takes it.
        on_frame: Called for every frame, tracker and seed.

    Raises:
        UnknownNameError: An unknown tracker.
        TrackerError: A tracker that needs what is not there.
        SequenceError: An image cannot be read.
        ParameterError: No such preset or parameter, or a video's name that cannot be.
        RunError: A video cannot be written.
    """
    # Mistakes in names or presets are told before anything is written.
    enter(trackers, seed=0)
    videos = [None] * len(sequences) if video is None else video_paths(sequences, video)
    results: list[RecordedResult] = []
    for sequence, path in zip(sequences, videos, strict=True):
        entries = [(seed, entry) for seed in seeds for entry in enter(trackers, seed=seed)]
        known = np.isfinite(sequence.truth[:, 0])
        _play(sequence, known, entries, path, on_frame)
        for seed, entry in entries:
            overlap = score.overlaps(entry.boxes, sequence.truth)
            error = score.centre_errors(entry.boxes, sequence.truth)
            summary = score.summarise(overlap, error, known, np.array(entry.ms))
            results.append(RecordedResult(sequence.name, entry.name, seed, summary, entry.failure))
    return results


def video_paths(sequences: Sequence[RecordedSequence], video: Path) -> list[Path]:
    """The file of each sequence's video.

    Args:
        sequences: What is shown.
        video: For one sequence a file ending in `.mp4`; otherwise a folder, in which each is named as its sequence.

    Raises:
        ParameterError: One file for several sequences, or two sequences of one name.
        RunError: The folder is a file.
    """
    if video.suffix.lower() == ".mp4" and not video.is_dir():
        if len(sequences) != 1:
            raise ParameterError(
                f"one video holds one sequence, got {len(sequences)}: give a folder instead of {str(video)!r}"
            )
        return [video]
    if video.exists() and not video.is_dir():
        raise RunError(f"{video} is neither a folder nor a name that ends in .mp4")
    names = [one.name for one in sequences]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ParameterError(
            f"several sequences are called {', '.join(twice)}: their videos would take each other's name"
        )
    return [video / f"{name}.mp4" for name in names]


def _play(
    sequence: RecordedSequence,
    known: np.ndarray,
    entries: Sequence[tuple[int, TrackerRun]],
    video: Path | None,
    on_frame: Callable[[], None],
) -> None:
    """Show every frame to every tracker, and those of the first seed to whoever watches."""
    with ExitStack() as open_files:
        writer = None if video is None else open_files.enter_context(VideoWriter(video, VIDEO_RATE_HZ))
        for index in range(len(sequence)):
            image = sequence.image(index)
            said: dict[str, Estimate] = {}
            for seed, entry in entries:
                estimate = entry.see(image, sequence.truth[index], bool(known[index]))
                if estimate is not None and seed == entries[0][0]:
                    said[entry.name] = estimate
                on_frame()
            if writer is not None:
                caption = f"{sequence.name}   frame {index + 1} of {len(sequence)}"
                writer.add(draw_recorded(image, sequence.truth[index], said, caption=caption))
