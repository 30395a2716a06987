"""Evaluate trackers on recorded sequences with annotated boxes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from pftrack_sim import score
from pftrack_sim.benchmark.asked.from_names import check_run_axis
from pftrack_sim.benchmark.asked.plan import BOX_NOISE, START, TrackerSpec
from pftrack_sim.benchmark.running.rollout import Sink, recorded, rollout
from pftrack_sim.benchmark.running.sinks import error_text, latest, picture, video_writer
from pftrack_sim.benchmark.running.tracker_runner import Isolation, TrackerRunner, check_trackers, make_runners
from pftrack_sim.core.arguments import checked
from pftrack_sim.core.errors import ParameterError, RunError, TrackerError
from pftrack_sim.formats import RecordedSequence
from pftrack_sim.score import Summary
from pftrack_sim.score.frames import first_scored, misread_boxes
from pftrack_sim.trackers.isolation import Limits, TrackerProcesses

_RATE_HZ = 25.0


def rate_of(sequence: RecordedSequence) -> float:
    """Frames per second of a sequence; 25 where its layout does not tell."""
    return sequence.rate_hz or _RATE_HZ


@dataclass(frozen=True)
class RecordedResult:
    """Scores of one tracker on one sequence with one seed.

    `said` has its traceback and what it printed, `misread` what is wrong with its boxes, see `score.frames`.
    """

    sequence: str
    tracker: TrackerSpec
    seed: int
    summary: Summary
    error: str | None
    said: str = ""
    misread: str | None = None
    start: float = 0.0


def misread_of(results: Iterable[RecordedResult]) -> list[str]:
    """A sentence for each tracker whose first boxes fit the truth far better in another convention."""
    found = {one.tracker.label: one.misread for one in results if one.misread}
    return [f"{label}: {words}" for label, words in found.items()]


@checked
def evaluate(
    sequences: Sequence[RecordedSequence],
    trackers: Sequence[str | TrackerSpec],
    seeds: Sequence[int],
    *,
    box_noise: float = 0.0,
    starts: Sequence[float] = (0.0,),
    video: Path | None = None,
    isolation: Isolation = "never",
    limits: Limits | None = None,
    on_frame: Callable[[], None] = lambda: None,
) -> list[RecordedResult]:
    """Run every tracker on every sequence with every seed.

    A tracker starts at the first annotated frame; frames without a box are shown and not scored.

    Args:
        sequences: As `formats.read_sequence` gives them.
        trackers: Trackers; a name alone has no preset and parameters.
        seeds: Seeds of the trackers.
        box_noise: Trackers start from boxes whose centre and sides differ from the annotated ones by up to this share
            of the sides, in [0, 0.5], uniformly, another for each seed. All trackers of a seed have the same.
        starts: Shares of the sequence, in [0, 1), after which they start and scores begin.
        video: Where to write the annotated and estimated boxes and particles at the first seed; see `video_paths`.
        isolation: Which trackers run in a process of their own.
        limits: Limits of those.
        on_frame: Called after every frame of a sequence.

    Raises:
        UnknownNameError: An unknown tracker.
        TrackerError: A tracker whose requirements are missing, or that follows detections where a sequence has none.
        SequenceError: An image cannot be read.
        ParameterError: No such preset or parameter, an impossible name of a video, or noise or start.
        RunError: A video cannot be written.
    """
    # Wrong names and presets are reported before anything is written.
    check_run_axis(BOX_NOISE, [box_noise])
    check_run_axis(START, starts)
    if min(starts) < 0.0:
        raise ParameterError("recorded sequences are shown forward only: starts must be 0 or more")
    limits = limits or Limits()
    specs = [TrackerSpec.of(one) for one in trackers]
    videos = [None] * len(sequences) if video is None else video_paths(sequences, video)
    results: list[RecordedResult] = []
    with TrackerProcesses() as processes:
        check_trackers(specs, isolation, limits, processes)
        made = partial(make_runners, specs, isolation=isolation, limits=limits, processes=processes)
        for sequence, path in zip(sequences, videos, strict=True):
            arms = [(seed, start, round(start * len(sequence))) for seed in seeds for start in starts]
            runners = [made(seed=seed, box_noise=box_noise, first_frame=frame) for seed, _, frame in arms]
            _run(sequence, runners, path, on_frame)
            for (seed, start, first_frame), own in zip(arms, runners, strict=True):
                scored = np.isfinite(sequence.truth[:, 0])
                scored[:first_frame] = False
                for runner in own:
                    frames = score.frame_scores(runner.boxes, sequence.truth)
                    summary = score.summarise(frames, scored, np.array(runner.ms))
                    summary = replace(summary, ms_reported=runner.ms_reported)
                    said = error_text(runner) if runner.error else ""
                    # The first scored frame has the given box.
                    size, after = sequence.image(0).shape[1::-1], first_scored(scored) + 1
                    misread = misread_boxes(runner.boxes[after:], sequence.truth[after:], size)
                    results.append(
                        RecordedResult(sequence.name, runner.spec, seed, summary, runner.error, said, misread, start)
                    )
    return results


def _run(
    sequence: RecordedSequence,
    arms: Sequence[Sequence[TrackerRunner]],
    video: Path | None,
    on_frame: Callable[[], None],
) -> None:
    """Show every frame to every tracker, and film those of the first seed and start."""
    sinks: list[Sink] = [lambda _: on_frame()]
    runners = [one for runners in arms for one in runners]
    with ExitStack() as opened:
        for runner in runners:
            opened.callback(runner.close)
        if sequence.detections is None and (needing := [one for one in runners if one.needs_detections]):
            raise TrackerError(
                f"{needing[0].spec.base_label} follows detections, and {sequence.name} has none: the MOT layout holds "
                "them in det/det.txt"
            )
        if video is not None:
            add = opened.enter_context(video_writer(video, rate_of(sequence)))
            sinks.append(lambda sample: add(picture(sample, latest(arms[0])), sample.time_s))
        rollout(recorded(sequence, rate_of(sequence)), runners, sinks)


def video_paths(sequences: Sequence[RecordedSequence], video: Path) -> list[Path]:
    """The file of each sequence's video.

    Args:
        sequences: The sequences.
        video: For one sequence a file ending in `.mp4`; otherwise a folder, in which each is named after its sequence.

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
    names = [sequence.name for sequence in sequences]
    repeated = sorted({name for name in names if names.count(name) > 1})
    if repeated:
        raise ParameterError(f"several sequences are called {', '.join(repeated)}: each needs its own video's name")
    return [video / f"{name}.mp4" for name in names]
