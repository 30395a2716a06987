"""A tracker's result in an episode as a Parquet file: a row per frame with truth and estimate, scores in the metadata.

The file is named by its key, and holds the truth of the episode, so that it says everything about itself.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, cast

import duckdb
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.benchmark.asked.plan import AskedResult, TrackerSpec
from pftrack_sim.benchmark.kept.files import query_deadline, sql_text
from pftrack_sim.benchmark.keys import digest
from pftrack_sim.benchmark.running.people_scores import track_rows
from pftrack_sim.benchmark.running.tracker_runner import TrackerRunner
from pftrack_sim.core.errors import RunError
from pftrack_sim.core.inputs import is_file, parse_json
from pftrack_sim.core.proprioception import PROPRIO_NAMES, RANGES
from pftrack_sim.core.records import Truth
from pftrack_sim.core.text import one_line
from pftrack_sim.core.types import FloatArray

METADATA_KEY = "pftrack_sim"
_DIGEST_KEY = "metadata_sha256"
MAX_BYTES = 1 << 30
"""Largest file that is read."""

NOT_IN_DIGEST = ("ms",)
"""Columns of wall-clock time: all others are the same in every run of a plan."""

SENSORS = (*PROPRIO_NAMES[: RANGES.start], "ranges_m")
"""Columns of the robot's proprioception in closed loop; `ranges_m` is the scan along `RANGE_ANGLES_RAD`."""

_PERSON: Mapping[str, str] = MappingProxyType(
    {
        "person": "VARCHAR",
        "state": "VARCHAR",
        "amodal_box": "FLOAT[]",
        "visible_box": "FLOAT[]",
        **dict.fromkeys(("visible_fraction", "truncation", "distance_m", "x_m", "y_m", "heading_rad"), "FLOAT"),
    }
)
"""Fields of an entry of the column `people`; the pose is that on the ground."""
_PEOPLE = "SELECT {}, unnest(people, max_depth := 2) FROM {}"
"""Query for a row per person: columns to repeat, and the table."""

_TRUTH_NUMBERS = ("time_s", "state", "visible_fraction", "truncation", "distance_m", "image_motion_px", "luminance")
_TRUTH_LISTS = ("box", "amodal_box", "visible_box", "swept_box", "T_world_camera", "T_world_target", "K", "distortion")
_CASTS = dict.fromkeys((*_TRUTH_LISTS, "estimate", "tracks"), "DOUBLE[]") | {
    "occluders": "VARCHAR[]",
    "ranges_m": "FLOAT[]",
}
"""Types of lists: a file without any entry in them would have none."""

Column = NDArray[Any]
Columns = Mapping[str, Column]


def identity_columns(tracker: TrackerSpec, latency_ms: float) -> dict[str, str | float | None]:
    """What identifies a tracker in tables, with the latency charged in an episode; `label` is for people."""
    return {
        "tracker": tracker.name,
        "preset": tracker.preset,
        "params": json.dumps(tracker.params, sort_keys=True),
        "controller": tracker.controller,
        "latency_ms": latency_ms,
        "label": tracker.label,
    }


def truth_columns(truths: Sequence[Truth]) -> dict[str, Column]:
    """Truths of the target, one row per frame."""
    columns: dict[str, Column] = {"frame": np.arange(len(truths))}
    for key in _TRUTH_NUMBERS:
        columns[key] = column([getattr(truth, key) for truth in truths])
    columns["scored"] = np.array([truth.scored for truth in truths])
    columns["occluders"] = _lists([list(truth.occluders) for truth in truths])
    for key in _TRUTH_LISTS:
        columns[key] = _lists([getattr(truth, key).ravel().tolist() for truth in truths])
    return columns


class PeopleLog:
    """Everybody in view of an episode, in single precision."""

    def __init__(self) -> None:
        self._frames: list[int] = []
        self._text: list[tuple[str, str]] = []
        self._numbers: list[NDArray[np.float32]] = []

    def add(self, frame: int, people: Sequence[Truth]) -> None:
        """Add the people of a frame."""
        for one in people:
            pose = one.T_world_target
            ground = pose[0, 3], pose[1, 3], math.atan2(pose[1, 0], pose[0, 0])
            rest = one.visible_fraction, one.truncation, one.distance_m, *ground
            self._frames.append(frame)
            self._text.append((one.name, one.state))
            self._numbers.append(np.array([*one.amodal_box, *one.visible_box, *rest], dtype=np.float32))

    def columns(self) -> dict[str, Column]:
        """`(N,)` columns, a row per person and frame: the frame, the place in the list, and the fields of `people`."""
        numbers = np.array(self._numbers, dtype=np.float32).reshape(len(self._frames), -1)
        boxes = [_lists(numbers[:, place : place + 4].tolist()) for place in (0, 4)]
        text = [column(list(one)) for one in zip(*self._text, strict=True)]
        place = {"frame": np.array(self._frames), "place": np.arange(len(self._frames))}
        return {**place, **dict(zip(_PERSON, [*text, *boxes, *numbers[:, 8:].T], strict=True))}


def estimate_columns(runner: TrackerRunner, overlap: FloatArray, centre_error_px: FloatArray) -> dict[str, Column]:
    """Estimates of one tracker with their scores and everybody whom it follows, one row per frame."""
    estimates = runner.estimates
    return {
        "tracks": _lists(track_rows(runner)),
        "frame": np.arange(len(estimates)),
        "status": np.array(runner.statuses, dtype=object),
        "estimate": _lists(runner.boxes.tolist()),
        "confidence": np.array([np.nan if one is None else one.confidence for one in estimates], dtype=np.float64),
        "estimate_occluded": np.array([one is not None and one.occluded for one in estimates]),
        "answered": np.array([one is not None for one in estimates]),
        "overlap": overlap,
        "centre_error_px": centre_error_px,
        "ms": np.array(runner.ms, dtype=np.float64),
    }


def write_result(
    path: Path,
    identity: Mapping[str, str | int | float | None],
    truth: Columns,
    people: Columns,
    estimates: Columns,
    metadata: Mapping[str, Any],
) -> None:
    """Write the file of a result; the caller moves it to its name.

    Args:
        path: File to write.
        identity: Scenario, condition, seed, tracker and so on: the same in every row.
        truth: From `truth_columns`, and further columns with a row per frame.
        people: From `PeopleLog.columns`; every frame gets a list of them.
        estimates: From `estimate_columns`.
        metadata: Stored with the digest of the rows.

    Raises:
        RunError: It cannot be written.
    """
    fields = ", ".join(f"{name} := {name}::{kind}" for name, kind in _PERSON.items())
    rows = (
        f"SELECT identity.* REPLACE (controller::VARCHAR AS controller), truth.* REPLACE ({_casts(truth)}), "
        f"estimates.* EXCLUDE frame REPLACE ({_casts(estimates)}), listed AS people "
        "FROM identity, estimates JOIN truth USING (frame) JOIN "
        f"(SELECT frame, list(struct_pack({fields}) ORDER BY place) AS listed FROM people GROUP BY frame) "
        "USING (frame) ORDER BY frame"
    )
    tables = {
        "identity": {name: column([value]) for name, value in identity.items()},
        "truth": dict(truth),
        "people": dict(people),
        "estimates": dict(estimates),
    }
    with duckdb.connect(config={"threads": 1}) as database:
        for name, table in tables.items():
            database.register(name, table)
        try:
            database.execute(f"CREATE TEMP TABLE rows AS {rows}")
            whole = {**metadata, **content_digests(database, "rows")}
            text = json.dumps({**whole, _DIGEST_KEY: digest(whole)})
            database.execute(
                f"COPY rows TO {sql_text(path)} (FORMAT parquet, COMPRESSION zstd, "
                f"KV_METADATA {{{METADATA_KEY}: {sql_text(text)}}})"
            )
        except duckdb.Error as error:
            raise RunError(f"cannot write {path}: {error}") from None


def create_frame_views(database: duckdb.DuckDBPyConnection, files: Mapping[Path, AskedResult]) -> None:
    """Create `frames`, and `people` of everybody in view, which all trackers of an open loop share."""
    database.execute(f"CREATE VIEW frames AS SELECT * EXCLUDE people FROM {_parquet(files)}")
    firsts = {one.episode.number: path for path, one in reversed(list(files.items()))}
    label = "CASE WHEN kind = 'follow' THEN label END AS label"
    people = _PEOPLE.format(f"kind, scenario, condition, seed, {label}, frame, time_s", _parquet(firsts.values()))
    database.execute(f"CREATE VIEW people AS {people}")


def _parquet(files: Iterable[Path]) -> str:
    return f"read_parquet([{', '.join(map(sql_text, files))}], hive_partitioning = false)"


def _casts(columns: Columns) -> str:
    return ", ".join(f"{name}::{kind} AS {name}" for name, kind in _CASTS.items() if name in columns)


def read_metadata(
    database: duckdb.DuckDBPyConnection, files: Mapping[Path, AskedResult]
) -> Iterator[tuple[Path, dict[str, Any]]]:
    """Metadata of some results' files, verified: digest, key, number of rows.

    Raises:
        RunError: One of them is no result's file, is damaged, or is that of another result.
    """
    for path in files:
        if not is_file(path) or path.stat().st_size > MAX_BYTES:
            raise RunError(f"{path}: not an episode's file: not a regular file of at most {MAX_BYTES} bytes")
    listed = f"[{', '.join(sql_text(path) for path in files)}]"
    try:
        with query_deadline(database):
            query = f"SELECT file_name, num_rows FROM parquet_file_metadata({listed})"
            rows = {Path(name): count for name, count in database.execute(query).fetchall()}
            query = f"SELECT file_name, value FROM parquet_kv_metadata({listed}) WHERE key = '{METADATA_KEY}'::BLOB"
            found = {Path(name): value for name, value in database.execute(query).fetchall()}
    except duckdb.Error as error:
        raise RunError(f"not an episode's file: {one_line(str(error))}") from None
    for path, asked in files.items():
        yield path, _checked_metadata(path, found.get(path, b""), rows.get(path, 0), asked)


def _checked_metadata(path: Path, content: bytes, rows: int, asked: AskedResult) -> dict[str, Any]:
    try:
        read: object = parse_json(content)
    except ValueError:
        read = None
    if not isinstance(read, dict):
        raise RunError(f"{path}: not an episode's file: it has no metadata of a run")
    metadata = cast("dict[str, Any]", read)
    if metadata.pop(_DIGEST_KEY, None) != digest(metadata):
        raise RunError(f"{path}: its metadata do not have the digest they were written with")
    if metadata.get("key") != asked.key:
        scores = metadata.get("scores")
        tracker = cast("dict[str, Any]", scores).get("label") if isinstance(scores, dict) else None
        found = f"{metadata.get('scenario')} {metadata.get('condition')} seed {metadata.get('seed')}, {tracker}"
        raise RunError(
            f"{path}: is of another episode ({one_line(found)}), not of {asked.episode.name}, {asked.tracker.label}; "
            "remove it and the same command runs the episode again"
        )
    if rows != metadata.get("frames"):
        raise RunError(f"{path}: does not have every frame; remove it and the same command runs the episode again")
    return metadata


def content_digests(database: duckdb.DuckDBPyConnection, source: str) -> dict[str, str]:
    """SHA-256 of the rows of a table or table function, in their order.

    Returns:
        `content_sha256`, without the columns of wall-clock time, of people and of sensors; and `extras_sha256`
        of the latter two.
    """
    known = {str(row[0]) for row in database.execute(f"DESCRIBE FROM {source}").fetchall()}
    sensors = [name for name in SENSORS if name in known]
    apart = ["people"] if "people" in known else []
    excluded = f" EXCLUDE ({', '.join([*apart, *sensors])})" if apart or sensors else ""
    digests = {"content_sha256": _query_digest(database, f"SELECT *{excluded} FROM {source}")}
    if apart:
        people = _PEOPLE.format(", ".join(["label", "frame", *sensors]), source)
        digests["extras_sha256"] = _query_digest(database, people)
    return digests


def _query_digest(database: duckdb.DuckDBPyConnection, query: str) -> str:
    rows = hashlib.sha256()
    table = cast("Any", database.execute(query)).fetchnumpy()
    for name in sorted(table):
        if name not in NOT_IN_DIGEST:
            rows.update(name.encode() + b"\0")
            rows.update(_bytes(table[name]))
    return rows.hexdigest()


def _bytes(values: Any) -> bytes:
    """The same bytes for the same values, whether they come from memory or from a file."""
    if values.dtype == object and len(values):
        pairs = zip(np.ma.getdata(values), np.ma.getmaskarray(values), strict=True)
        listed: list[Any] = [None if masked else value for value, masked in pairs]
        if any(isinstance(value, str) for value in listed):
            return json.dumps(listed).encode()
        rows = [None if row is None else list(row) for row in listed]
        if any(isinstance(item, str) for row in rows for item in row or ()):
            return json.dumps(rows).encode()
        lengths = np.array([-1 if row is None else len(row) for row in rows], dtype="<i8").tobytes()
        return lengths + _bytes(np.array([number for row in rows for number in row or ()], dtype=np.float64))
    numbers = np.array(np.ma.getdata(values), dtype="<f8")
    numbers[np.isnan(numbers)] = np.nan
    return numbers.tobytes()


def column(values: Sequence[Any]) -> Column:
    """Values as a column; text, lists and None stay objects."""
    if any(isinstance(value, list) for value in values):
        return _lists(values)
    if any(isinstance(value, str) or value is None for value in values):
        return np.array(values, dtype=object)
    return np.array(values)


def _lists(rows: Sequence[Sequence[Any]]) -> Column:
    # Filled one by one: numpy would make a matrix of rows of equal length. A row with NaN becomes NULL.
    made = np.empty(len(rows), dtype=object)
    for index, row in enumerate(rows):
        made[index] = None if any(number != number for number in row) else list(row)
    return made
