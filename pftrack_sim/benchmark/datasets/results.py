"""Result files of public toolkits: written from a run, and scored against a data set."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pftrack_sim import score
from pftrack_sim.benchmark.asked.plan import TrackerSpec
from pftrack_sim.benchmark.datasets.export import sequence_names
from pftrack_sim.benchmark.datasets.recorded import RecordedResult, misread_of, rate_of
from pftrack_sim.benchmark.kept.files import write_bytes
from pftrack_sim.benchmark.keys import distinct_slugs
from pftrack_sim.benchmark.reading.store import RunStore
from pftrack_sim.benchmark.running.results import track_table, tracks_of
from pftrack_sim.core.boxes import pairwise_iou
from pftrack_sim.core.errors import ParameterError, RunError, SequenceError
from pftrack_sim.core.types import FloatArray
from pftrack_sim.formats import find_sequences, read_sequence
from pftrack_sim.formats.files import read_text
from pftrack_sim.formats.mot import read_people
from pftrack_sim.formats.results import (
    ResultFile,
    TrackerResult,
    check_format,
    find_results,
    read_result,
    result_files,
)
from pftrack_sim.score.episode import Measures
from pftrack_sim.score.frames import FrameScores, first_scored, misread_boxes
from pftrack_sim.score.multi_object import Tracks, multi_object
from pftrack_sim.score.protocols import PROTOCOLS, TrackedSequence
from pftrack_sim.score.statistics import Comparison

_COLUMNS = ("status", "estimate", "ms", "confidence", "tracks")


def export_results(run: RunStore, out: Path, form: str, *, on_result: Callable[[], None] = lambda: None) -> list[Path]:
    """Write the estimates of a run as result files of a public toolkit.

    The sequences have the names that `export` gives them.

    Args:
        run: A finished run in open loop.
        out: Folder of the results; files of the same trackers and sequences in it are replaced.
        form: `"otb"`, `"got10k"`, `"vot"` or `"mot"`.
        on_result: Called after every result.

    Returns:
        The files.

    Raises:
        UnknownNameError: No such format.
        RunError: The run is not finished or drove the robot, so that no data set has its frames; a file cannot be
            read or written.
    """
    chosen = check_format(form)
    if run.plan.kind != "open":
        raise RunError(f"{run.path} is a run in closed loop: each tracker saw frames of its own, which no data set has")
    if not run.finished:
        raise RunError(f"{run.path} is not finished: run the same command again first")
    if out.exists() and not out.is_dir():
        raise RunError(f"{out} is not a folder")
    names = sequence_names(run.plan)
    trackers = distinct_slugs(run.plan.labels)
    written: list[Path] = []
    for result in run.results:
        table = run.frame_columns(result, _COLUMNS)
        sequence, tracker = names[run.episode_of(result).number], trackers[result.label]
        for name, text in result_files(chosen, tracker, sequence, _tracker_result(table)):
            write_bytes(out / name, text.encode())
            written.append(out / name)
        on_result()
    if chosen == "vot":
        written.append(
            _describe_trackers(out / "trackers.ini", {trackers[one.label]: one for one in run.plan.trackers})
        )
    return written


def _describe_trackers(path: Path, trackers: Mapping[str, TrackerSpec]) -> Path:
    """Add trackers to the list that the VOT toolkit reads; those that are in it already stay as they are."""
    text = read_text(path) if path.exists() else ""
    for name, spec in trackers.items():
        if f"[{name}]" not in text.split():
            command = f"pftrack-sim trax {shlex.quote(spec.base_label)}"
            text += f"[{name}]\nlabel = {spec.label}\nprotocol = trax\ncommand = {command}\n\n"
    write_bytes(path, text.encode())
    return path


def _tracker_result(table: Mapping[str, Any]) -> TrackerResult:
    statuses = np.asarray(table["status"]).tolist()
    rows = [np.full(4, np.nan) if row is None else row for row in table["estimate"]]
    confidence = np.asarray(table["confidence"], dtype=np.float64)
    first = statuses.index("init") if "init" in statuses else len(statuses) - 1
    ms = np.asarray(table["ms"], dtype=np.float64)
    people = track_table(table["tracks"]) if any(row is not None for row in table["tracks"]) else None
    return TrackerResult(np.array(rows, dtype=np.float64).reshape(-1, 4), ms, confidence, first, people)


@dataclass(frozen=True, eq=False, kw_only=True)
class ScoredResult(RecordedResult):
    """Scores of one result file.

    Attributes:
        summary: All measures; an occlusion is a span of frames without a true box.
        rate_hz: Frames per second of the sequence; 25 where its layout does not tell.
    """

    summary: Measures
    frames: FrameScores
    rate_hz: float


@dataclass(frozen=True)
class Scored:
    """Scores of result files.

    Attributes:
        results: Each tracker on each sequence, with the number of the repetition as the seed.
        benchmark: For each tracker what the scorer of the data set's own benchmark computes; see `score.protocols` and
            `score.multi_object`. Empty where the layout has none.
        comparisons: Pairs of trackers by the mean overlap of the sequences that both have.
    """

    results: list[ScoredResult]
    benchmark: dict[str, dict[str, float]]
    comparisons: list[Comparison]

    @property
    def misread(self) -> list[str]:
        """See `misread_of`."""
        return misread_of(self.results)


def score_results(
    results: Path,
    dataset: Path,
    *,
    layout: str | None = None,
    form: str | None = None,
) -> Scored:
    """Score result files that any toolkit wrote with the measures of this package, and with the benchmark's own.

    Args:
        results: Folder of the results.
        dataset: Folder of the data set, or of one sequence.
        layout: Of the data set; None finds it out.
        form: Format of the results; None finds it out.

    Raises:
        UnknownNameError: No such layout or format.
        SequenceError: The data set or a result cannot be read, or they do not fit.
        ParameterError: Sequences of the data set have the same name or different layouts.
    """
    chosen = None if form is None else check_format(form)
    found = find_sequences(dataset, layout)
    folders = {folder.resolve().name: folder for folder, _ in found}
    layouts = {name for _, name in found}
    if len(folders) != len(found) or len(layouts) != 1:
        raise ParameterError(f"{dataset}: sequences need different names and one layout; choose with --format")
    known = layouts.pop()
    files = find_results(results, folders, chosen)
    sequences = {name: read_sequence(folders[name], known) for name in {file.sequence for file in files}}
    sizes = {name: sequence.image(0).shape[1::-1] for name, sequence in sequences.items()}
    scored: list[ScoredResult] = []
    tracked: dict[str, list[TrackedSequence]] = {}
    people: dict[str, list[tuple[Tracks, Tracks]]] = {}
    for file in files:
        sequence = sequences[file.sequence]
        content = read_result(file, sequence.start + len(sequence), known)
        truth = np.concatenate([np.full((sequence.start, 4), np.nan), sequence.truth])
        boxes = content.boxes if content.rows is None else _target_boxes(content.rows, content.boxes, truth)
        one = _scored(file, boxes, truth, np.where(content.ms > 0.0, content.ms, np.nan), rate_of(sequence))
        after = first_scored(np.isfinite(truth[:, 0])) + 1
        scored.append(replace(one, misread=misread_boxes(boxes[after:], truth[after:], sizes[file.sequence])))
        if known in PROTOCOLS:
            width, height = sizes[file.sequence]
            tracked.setdefault(file.tracker, []).append(TrackedSequence(boxes, truth, (width, height)))
        elif known == "mot":
            estimated = content.rows if content.rows is not None else _single_track(boxes)
            pair = (_tracks(read_people(folders[file.sequence]), file), _tracks(estimated, file))
            people.setdefault(file.tracker, []).append(pair)
    benchmark = {tracker: PROTOCOLS[known](runs) for tracker, runs in tracked.items()}
    benchmark |= {tracker: multi_object(pairs) for tracker, pairs in people.items()}
    return Scored(scored, benchmark, _compare(scored, list(sequences)))


def _scored(file: ResultFile, boxes: FloatArray, truth: FloatArray, ms: FloatArray, rate_hz: float) -> ScoredResult:
    frames, seen = score.frame_scores(boxes, truth), np.isfinite(truth[:, 0])
    found = score.measure(frames, seen, seen.astype(np.float64), ms, np.arange(len(truth)) / rate_hz)
    return ScoredResult(
        sequence=file.sequence,
        tracker=TrackerSpec(name=file.tracker),
        seed=file.repetition,
        summary=found,
        error=None,
        frames=frames,
        rate_hz=rate_hz,
    )


def _target_boxes(rows: FloatArray, single: FloatArray, truth: FloatArray) -> FloatArray:
    """Boxes of the target of several tracks: the one that overlaps its first true box most."""
    if np.isfinite(single).any() or not len(rows):
        return single
    first = int(np.argmax(np.isfinite(truth[:, 0])))
    there = rows[rows[:, 0] == first]
    boxes = np.full(truth.shape, np.nan)
    if len(there):
        overlap = pairwise_iou(there[:, 2:], truth[first])
        mine = rows[rows[:, 1] == there[int(np.argmax(overlap)), 1]]
        boxes[mine[:, 0].astype(int)] = mine[:, 2:]
    return boxes


def _single_track(boxes: FloatArray) -> FloatArray:
    """Rows of one identity."""
    kept = np.flatnonzero(np.isfinite(boxes).all(axis=1))
    return np.column_stack([kept.astype(np.float64), np.ones(len(kept)), boxes[kept]])


def _tracks(rows: FloatArray, file: ResultFile) -> Tracks:
    try:
        return tracks_of(rows)
    except ParameterError as error:
        raise SequenceError(f"{file.path}: {error}") from None


def _compare(results: Sequence[RecordedResult], sequences: Sequence[str]) -> list[Comparison]:
    """Compare trackers in pairs: a sequence is the unit, the mean of its repetitions the score."""
    overlaps: dict[str, dict[str, list[float]]] = {}
    for one in results:
        overlaps.setdefault(one.tracker.label, {}).setdefault(one.sequence, []).append(one.summary.mean_overlap)
    if len(overlaps) < 2 or len(sequences) < 2:
        return []
    rows = {
        tracker: [float(np.mean(by_sequence[name])) if name in by_sequence else np.nan for name in sequences]
        for tracker, by_sequence in overlaps.items()
    }
    return score.compare(rows, (0.0, 1.0))


def score_text(value: float) -> str:
    """A score of a benchmark as people read it: a share with four decimals, or a count.

    >>> score_text(0.5), score_text(12.0)
    ('0.5000', '12')
    """
    return f"{value:.0f}" if value.is_integer() and abs(value) > 1.0 else f"{value:.4f}"
