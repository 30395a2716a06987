"""Evaluate trackers on recorded sequences with annotated boxes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from pftrack_sim import score
from pftrack_sim.benchmark.asked.plan import TrackerSpec
from pftrack_sim.benchmark.running.rollout import Sink, recorded, rollout
from pftrack_sim.benchmark.running.sinks import error_text, picture, video_writer
from pftrack_sim.benchmark.running.tracker_runner import Isolation, TrackerRunner, check_trackers, make_runners
from pftrack_sim.core import boxes, random_streams
from pftrack_sim.core.boxes import Box
from pftrack_sim.core.errors import ParameterError, RunError, TrackerError
from pftrack_sim.formats import RecordedSequence
from pftrack_sim.score import Summary
from pftrack_sim.score.frames import misread_boxes
from pftrack_sim.trackers.isolation import Limits, TrackerProcesses

MAX_BOX_NOISE = 0.5
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


def evaluate(
    sequences: Sequence[RecordedSequence],
    trackers: Sequence[str | TrackerSpec],
    seeds: Sequence[int],
    *,
    box_noise: float = 0.0,
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
        video: Where to write the annotated and estimated boxes and particles at the first seed; see `video_paths`.
        isolation: Which trackers run in a process of their own.
        limits: Limits of those.
        on_frame: Called after every frame of a sequence.

    Raises:
        UnknownNameError: An unknown tracker.
        TrackerError: A tracker whose requirements are missing, or that follows detections where a sequence has none.
        SequenceError: An image cannot be read.
        ParameterError: No such preset or parameter, an impossible name of a video, or noise outside [0, 0.5].
        RunError: A video cannot be written.
    """
    # Wrong names and presets are reported before anything is written.
    if not 0.0 <= box_noise <= MAX_BOX_NOISE:
        raise ParameterError(f"box noise must be a share of the sides in [0, {MAX_BOX_NOISE}], got {box_noise:g}")
    limits = limits or Limits()
    specs = [one if isinstance(one, TrackerSpec) else TrackerSpec(name=one) for one in trackers]
    videos = [None] * len(sequences) if video is None else video_paths(sequences, video)
    results: list[RecordedResult] = []
    with TrackerProcesses() as processes:
        check_trackers(specs, isolation, limits, processes)
        made = partial(make_runners, specs, isolation=isolation, limits=limits, processes=processes)
        for sequence, path in zip(sequences, videos, strict=True):
            by_seed = {seed: made(seed=seed) for seed in seeds}
            _check_detections(sequence, [one for runners in by_seed.values() for one in runners])
            for seed, runners in by_seed.items():
                for runner in runners:
                    runner.start_from = partial(_perturbed, seed=seed, share=box_noise)
            _run(sequence, list(by_seed.values()), path, on_frame)
            scored = np.isfinite(sequence.truth[:, 0])
            for seed, runners in by_seed.items():
                for runner in runners:
                    frames = score.frame_scores(runner.boxes, sequence.truth)
                    summary = score.summarise(frames, scored, np.array(runner.ms))
                    summary = replace(summary, ms_reported=runner.ms_reported)
                    said = error_text(runner) if runner.error else ""
                    # Frame 0 has the given box.
                    misread = misread_boxes(runner.boxes[1:], sequence.truth[1:], sequence.image(0).shape[1::-1])
                    results.append(
                        RecordedResult(sequence.name, runner.spec, seed, summary, runner.error, said, misread)
                    )
    return results


def _perturbed(box: Box, *, seed: int, share: float) -> Box:
    """`(4,)` box [px] whose centre and sides are off by up to a share of the sides, by the seed."""
    if share == 0.0:
        return box
    offsets = random_streams.stream(seed, "first_box").uniform(-share, share, 4)
    sides = box[2:] * (1.0 + offsets[2:])
    return np.concatenate([boxes.centre(box) + offsets[:2] * box[2:] - 0.5 * sides, sides])


def _check_detections(sequence: RecordedSequence, runners: Sequence[TrackerRunner]) -> None:
    """Refuse trackers that follow detections where there are none."""
    if sequence.detections is None and (needing := [one for one in runners if one.needs_detections]):
        for runner in runners:
            runner.close()
        raise TrackerError(
            f"{needing[0].spec.base_label} follows detections, and {sequence.name} has none: the MOT layout holds them "
            "in det/det.txt"
        )


def _run(
    sequence: RecordedSequence,
    by_seed: Sequence[Sequence[TrackerRunner]],
    video: Path | None,
    on_frame: Callable[[], None],
) -> None:
    """Show every frame to every tracker, and film those of the first seed."""
    sinks: list[Sink] = [lambda step: on_frame()]
    runners = [one for runners in by_seed for one in runners]
    with ExitStack() as opened:
        for runner in runners:
            opened.callback(runner.close)
        if video is not None:
            add = opened.enter_context(video_writer(video, rate_of(sequence)))
            sinks.append(lambda step: add(picture(step.sample, by_seed[0]), step.sample.time_s))
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
