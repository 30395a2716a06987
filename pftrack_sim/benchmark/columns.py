"""An episode as a Parquet file: a row for every tracker and frame, and in its metadata what sums it up.

One file holds all that one unit of work found, so that it is there whole or not at all. Truth is repeated for each
tracker, which the compression takes back.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import duckdb
import numpy as np

from pftrack_sim.benchmark.tracker_runner import TrackerRunner
from pftrack_sim.core.errors import RunError
from pftrack_sim.core.records import Truth

METADATA_KEY = "pftrack_sim"
NOT_COMPARED = ("ms",)
"""Columns of wall-clock time: everything else is the same in every run of a plan."""

_TRUTH_NUMBERS = ("time_s", "state", "visible_fraction", "truncation", "distance_m", "image_motion_px", "luminance")
_TRUTH_LISTS = ("box", "amodal_box", "visible_box", "swept_box", "T_world_camera", "T_world_target", "K", "distortion")

Columns = Mapping[str, np.ndarray]


def truth_columns(truths: Sequence[Truth]) -> dict[str, np.ndarray]:
    """The target's truths, a row for each frame."""
    columns: dict[str, np.ndarray] = {"frame": np.arange(len(truths))}
    for key in _TRUTH_NUMBERS:
        columns[key] = column([getattr(truth, key) for truth in truths])
    columns["scored"] = np.array([truth.scored for truth in truths])
    columns["occluders"] = _lists([list(truth.occluders) for truth in truths])
    for key in _TRUTH_LISTS:
        columns[key] = _lists([getattr(truth, key).ravel().tolist() for truth in truths])
    return columns


def estimate_columns(runner: TrackerRunner, overlap: np.ndarray, centre_error_px: np.ndarray) -> dict[str, np.ndarray]:
    """What one tracker said, a row for each frame."""
    said = runner.estimates
    return {
        "tracker": np.array([runner.spec.label] * len(said), dtype=object),
        "frame": np.arange(len(said)),
        "status": np.array(runner.statuses, dtype=object),
        "estimate": _lists(runner.boxes.tolist()),
        "confidence": np.array([np.nan if one is None else one.confidence for one in said], dtype=np.float64),
        "estimate_occluded": np.array([one is not None and one.occluded for one in said]),
        "answered": np.array([one is not None for one in said]),
        "overlap": overlap,
        "centre_error_px": centre_error_px,
        "ms": np.array(runner.ms, dtype=np.float64),
    }


def write_episode(
    path: Path, key: Mapping[str, str | int], truth: Columns, said: Sequence[Columns], sums: Mapping[str, Any]
) -> None:
    """Write an episode's file.

    Args:
        path: File to write; nobody reads it under this name.
        key: Scenario, condition, seed and so on: the same in every row.
        truth: From `truth_columns`.
        said: From `estimate_columns`, one for each tracker.
        sums: Goes into the metadata, with the digest of the rows.

    Raises:
        RunError: It cannot be written.
    """
    names = list(said[0])
    answers = {name: np.concatenate([one[name] for one in said]) for name in names}
    answers["place"] = np.repeat(np.arange(len(said)), [len(one["frame"]) for one in said])
    keys = ", ".join(f"{_text(value)} AS {name}" for name, value in key.items())
    rows = (
        f"SELECT {keys}, answers.tracker, truth.* REPLACE ({_casts(truth)}), "
        f"answers.* EXCLUDE (tracker, frame, place) REPLACE ({_casts(answers)}) "
        "FROM answers JOIN truth USING (frame) ORDER BY answers.place, frame"
    )
    with duckdb.connect(config={"threads": 1}) as database:
        database.register("truth", dict(truth))
        database.register("answers", answers)
        try:
            database.execute(f"CREATE TEMP TABLE rows AS {rows}")
            metadata = {**sums, "content_sha256": content_digest(database, "rows")}
            database.execute(
                f"COPY rows TO {_text(path)} (FORMAT parquet, COMPRESSION zstd, "
                f"KV_METADATA {{{METADATA_KEY}: {_text(json.dumps(metadata))}}})"
            )
        except duckdb.Error as error:
            raise RunError(f"cannot write {path}: {error}") from None


def _casts(columns: Columns) -> str:
    """The types of lists, which a file without any entry in them would not have."""
    types = dict.fromkeys((*_TRUTH_LISTS, "estimate"), "DOUBLE[]") | {"occluders": "VARCHAR[]"}
    return ", ".join(f"{name}::{kind} AS {name}" for name, kind in types.items() if name in columns)


def read_metadata(database: duckdb.DuckDBPyConnection, paths: Sequence[Path]) -> Iterable[tuple[Path, dict[str, Any]]]:
    """What sums up each of some episode files.

    Raises:
        RunError: One of them is no episode's file.
    """
    listed = ", ".join(_text(path) for path in paths)
    try:
        found = database.execute(
            f"SELECT file_name, decode(value) FROM parquet_kv_metadata([{listed}]) WHERE decode(key) = '{METADATA_KEY}'"
        ).fetchall()
    except duckdb.Error as error:
        raise RunError(f"not an episode's file: {error}") from None
    by_path = {Path(name): json.loads(text) for name, text in found}
    for path in paths:
        if path not in by_path:
            raise RunError(f"{path}: not an episode's file")
        yield path, by_path[path]


def content_digest(database: duckdb.DuckDBPyConnection, source: str) -> str:
    """SHA-256 of the rows of a table, in the order of the rows, without what the clock says.

    Args:
        database: Where the table is.
        source: Its name, or a function that reads it.
    """
    digest = hashlib.sha256()
    table = database.execute(f"SELECT * FROM {source}").fetchnumpy()
    for name in sorted(table):
        if name not in NOT_COMPARED:
            digest.update(name.encode() + b"\0")
            digest.update(_bytes(table[name]))
    return digest.hexdigest()


def _bytes(values: np.ndarray) -> bytes:
    """The same bytes for the same values, whether they come from memory or from a file."""
    if values.dtype == object and len(values):
        if isinstance(values[0], str):
            return json.dumps(list(values)).encode()
        rows = [None if row is None else list(row) for row in np.ma.filled(values, None)]
        if any(isinstance(one, str) for row in rows for one in row or ()):
            return json.dumps(rows).encode()
        lengths = np.array([-1 if row is None else len(row) for row in rows], dtype="<i8").tobytes()
        return lengths + _bytes(np.array([number for row in rows for number in row or ()], dtype=np.float64))
    numbers = np.array(np.ma.getdata(values), dtype="<f8")
    numbers[np.isnan(numbers)] = np.nan
    return numbers.tobytes()


def column(values: Sequence[Any]) -> np.ndarray:
    """Values as a column; text and None stay objects."""
    if any(isinstance(value, str) or value is None for value in values):
        return np.array(values, dtype=object)
    return np.array(values)


def _lists(rows: Sequence[Sequence[Any]]) -> np.ndarray:
    # Filled by hand: numpy would make a table out of rows of equal length. What is not there is NULL, no list of NaN.
    made = np.empty(len(rows), dtype=object)
    for index, row in enumerate(rows):
        made[index] = None if any(number != number for number in row) else list(row)
    return made


def _text(value: object) -> str:
    """A value as SQL writes it."""
    return str(value) if isinstance(value, int) else "'" + str(value).replace("'", "''") + "'"
