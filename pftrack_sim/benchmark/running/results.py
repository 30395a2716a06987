"""Results of an episode: each tracker is scored, and the tables of its frames and of the frames themselves written."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from pftrack_sim import score
from pftrack_sim.benchmark.asked.plan import Episode
from pftrack_sim.benchmark.kept.tables import (
    OPENED,
    PERSON,
    Column,
    Columns,
    column,
    lists,
    people_columns,
    table_writer,
    truth_columns,
)
from pftrack_sim.benchmark.reading.summary import SCORES
from pftrack_sim.benchmark.running.sinks import TruthLog, nearest_look_alike
from pftrack_sim.benchmark.running.tracker_runner import TrackerRunner
from pftrack_sim.core.records import Truth
from pftrack_sim.core.types import FloatArray
from pftrack_sim.score.multi_object import Tracks, multi_object

_FRAMES = """
SELECT identity.*, truth.*, listed AS people FROM identity, truth JOIN
    (SELECT frame, list(struct_pack({}) ORDER BY place) AS listed FROM people GROUP BY frame) USING (frame)
ORDER BY frame
""".format(", ".join(f"{name} := {name}::{kind}" for name, kind in PERSON.items()))
_RESULT = "SELECT identity.*, estimates.* FROM identity, estimates ORDER BY frame"


def write_results(
    folder: Path,
    episode: Episode,
    log: TruthLog,
    runners: Sequence[TrackerRunner],
    course: Columns,
    metadata: Mapping[str, Any],
) -> tuple[dict[str, bytes], list[dict[str, Any]]]:
    """Score every tracker of an episode; `metadata` is what all results share, `folder` for temporary files.

    Returns:
        Contents of the tables by their paths in a run folder, and the scores of each tracker: a row of the summary.
    """
    truths, file = log.truths, folder / "table.parquet"
    true_boxes = np.array([getattr(truth, episode.truth) for truth in truths])
    scored = np.array([truth.scored for truth in truths])
    scored[: episode.first_frame] = False
    visible = np.array([truth.visible_fraction for truth in truths])
    times = np.array([truth.time_s for truth in truths])
    names = {
        "kind": episode.kind,
        "scenario": episode.spec.name,
        "condition": episode.condition.name,
        "seed": episode.seed,
    }
    drawn = {
        **truth_columns(truths),
        "scored": scored,
        "nearest_look_alike": np.array([nearest_look_alike(*one) for one in zip(truths, log.people, strict=True)]),
        **course,
    }
    people = people_columns(log.people)
    contents: dict[str, bytes] = {}
    rows: list[dict[str, Any]] = []
    with table_writer(truth=drawn, people=people) as write:
        driver = episode.trackers[0].label if episode.kind == "follow" else None
        write(file, _FRAMES, identity=_row({**names, "label": driver, "frames_key": episode.frames_key}))
        contents[episode.frames_table] = file.read_bytes()
        for asked, runner in zip(episode.results, runners, strict=True):
            spec, frames = runner.spec, score.frame_scores(runner.boxes, true_boxes)
            identity = {
                **names,
                "tracker": spec.name,
                "preset": spec.preset,
                "params": json.dumps(spec.params, sort_keys=True),
                "controller": spec.controller,
                "latency_ms": episode.latency_ms,
                "label": spec.label,
                "frames_key": episode.frames_key,
            }
            measures = score.measure(frames, scored, visible, np.array(runner.ms), times)
            measures = replace(measures, ms_reported=runner.ms_reported)
            row = {
                **identity,
                **asdict(measures),
                **people_scores(log.people, runner),
                **metadata,
                "error": runner.error,
                "printed": runner.printed,
                "key": asked.key,
            }
            estimates = {
                "time_s": times,
                **_estimate_columns(runner),
                "overlap": frames.overlap,
                "centre_error_px": frames.centre_error_px,
                "ms": np.array(runner.ms, dtype=np.float64),
            }
            write(file, _RESULT, {**row, OPENED: dict(runner.opened)}, identity=_row(identity), estimates=estimates)
            contents[asked.table] = file.read_bytes()
            rows.append(row)
    return contents, rows


def _row(values: Mapping[str, Any]) -> dict[str, Column]:
    return {name: column([value]) for name, value in values.items()}


def _estimate_columns(runner: TrackerRunner) -> dict[str, Column]:
    """Estimates of a tracker and everybody whom it follows: identity, x, y, w, h one after the other."""
    estimates = runner.estimates
    return {
        "frame": np.arange(len(estimates)),
        "status": np.array(runner.statuses, dtype=object),
        "estimate": lists(runner.boxes.tolist()),
        "confidence": np.array([np.nan if one is None else one.confidence for one in estimates], dtype=np.float64),
        "estimate_occluded": np.array([one is not None and one.occluded for one in estimates]),
        "answered": np.array([one is not None for one in estimates]),
        "tracks": lists(_track_rows(runner)),
    }


def people_scores(people: Sequence[Sequence[Truth]], runner: TrackerRunner) -> dict[str, float]:
    """HOTA, IDF1, MOTA and so on of a tracker in an episode; empty for a tracker of one person."""
    if all(one is None for one in runner.tracks):
        return {}
    seen = [(frame, one) for frame, there in enumerate(people) for one in there if one.state != "out_of_view"]
    numbers = {name: number for number, name in enumerate(dict.fromkeys(one.name for _, one in seen))}
    truth = [(frame, numbers[one.name], *one.box) for frame, one in seen]
    found = multi_object([(tracks_of(np.reshape(truth, (-1, 6))), tracks_of(track_table(_track_rows(runner))))])
    return {name: found[name] for name in SCORES}


def _track_rows(runner: TrackerRunner) -> list[list[float] | None]:
    """For each frame identity, x, y, w, h of everybody whom a tracker follows, one after the other."""
    return [
        None if one is None else np.column_stack([one.identities, one.boxes]).ravel().tolist() for one in runner.tracks
    ]


def track_table(rows: Sequence[Sequence[float] | None]) -> FloatArray:
    """`(M, 6)` frame, identity and box of the column `tracks`."""
    tables = [
        np.column_stack([np.full(len(row) // 5, float(frame)), np.reshape(row, (-1, 5))])
        for frame, row in enumerate(rows)
        if row is not None
    ]
    return np.concatenate([np.empty((0, 6)), *tables])


def tracks_of(table: FloatArray) -> Tracks:
    """Tracks of a table of frame, identity and box; raises ParameterError where an identity is twice in a frame."""
    return Tracks(table[:, 0].astype(np.int64), table[:, 1].astype(np.int64), table[:, 2:])
