"""Tables of an episode as Parquet files, a row per frame: the frames with the whole truth, and each tracker's result.

Trackers that saw the same frames share the table of the frames. A result's scores are in the metadata of its table.
"""

from __future__ import annotations

import contextlib
import json
import math
from collections import defaultdict
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeAlias, cast

import duckdb
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.benchmark.asked.plan import AskedResult
from pftrack_sim.benchmark.kept.files import query_deadline, sql_text
from pftrack_sim.core.errors import RunError
from pftrack_sim.core.inputs import is_file, parse_json
from pftrack_sim.core.records import Truth
from pftrack_sim.core.text import one_line

METADATA_KEY = "pftrack_sim"
OPENED = "opened"
"""Entry of a result's metadata: digests of the files that its tracker has loaded and opened, by name."""
CHUNK = 500
"""Results whose metadata are read at once."""
MAX_BYTES = 1 << 30
"""Largest file that is read."""

PERSON: Mapping[str, str] = MappingProxyType(
    {
        "person": "VARCHAR",
        "state": "VARCHAR",
        "amodal_box": "FLOAT[]",
        "visible_box": "FLOAT[]",
        **dict.fromkeys(("visible_fraction", "truncation", "distance_m", "x_m", "y_m", "heading_rad"), "FLOAT"),
    }
)
"""Fields of an entry of the column `people`; the pose is that on the ground."""

_TRUTH_NUMBERS = ("time_s", "state", "visible_fraction", "truncation", "distance_m", "image_motion_px", "luminance")
_TRUTH_LISTS = ("box", "amodal_box", "visible_box", "swept_box", "T_world_camera", "T_world_target", "K", "distortion")
# Types are given where a column may have no value: it would have none.
_CASTS = {
    **dict.fromkeys((*_TRUTH_LISTS, "estimate", "tracks"), "DOUBLE[]"),
    **dict.fromkeys(("controller", "label"), "VARCHAR"),
    "occluders": "VARCHAR[]",
    "ranges_m": "FLOAT[]",
}

Column: TypeAlias = NDArray[Any]
Columns: TypeAlias = Mapping[str, Column]


def truth_columns(truths: Sequence[Truth]) -> dict[str, Column]:
    """Truths of the target, one row per frame."""
    columns: dict[str, Column] = {"frame": np.arange(len(truths))}
    for key in _TRUTH_NUMBERS:
        columns[key] = column([getattr(truth, key) for truth in truths])
    columns["scored"] = np.array([truth.scored for truth in truths])
    columns["occluders"] = lists([list(truth.occluders) for truth in truths])
    for key in _TRUTH_LISTS:
        columns[key] = lists([getattr(truth, key).ravel().tolist() for truth in truths])
    return columns


def people_columns(frames: Sequence[Sequence[Truth]]) -> dict[str, Column]:
    """`(N,)` columns in single precision, a row per person and frame: frame, place in its list, fields of `PERSON`."""
    people = [one for there in frames for one in there]
    poses = [one.T_world_target for one in people]
    ground = [(pose[0, 3], pose[1, 3], math.atan2(pose[1, 0], pose[0, 0])) for pose in poses]
    numbers = np.array([(one.visible_fraction, one.truncation, one.distance_m, *at)
                        for one, at in zip(people, ground, strict=True)], dtype=np.float32)  # fmt: skip
    boxes = [np.array([getattr(one, name) for one in people], dtype=np.float32) for name in PERSON if "box" in name]
    fields = [
        column([one.name for one in people]),
        column([one.state for one in people]),
        *(lists(one.tolist()) for one in boxes),
        *numbers.reshape(-1, 6).T,
    ]
    frame = np.repeat(np.arange(len(frames)), [len(there) for there in frames])
    return {"frame": frame, "place": np.arange(len(people)), **dict(zip(PERSON, fields, strict=True))}


@contextlib.contextmanager
def table_writer(**tables: Columns) -> Generator[Callable[..., None]]:
    """Give a function that writes a query over these tables as a Parquet file; the caller moves it to its name.

    Its arguments: the file, the query, metadata as a tree to write with the digest of the rows, and more tables.
    """
    with duckdb.connect(config={"threads": 1}) as database:

        def write(path: Path, query: str, metadata: Mapping[str, Any] | None = None, **more: Columns) -> None:
            try:
                for name, columns in {**tables, **more}.items():
                    database.register(name, dict(columns))
                names = {row[0] for row in database.execute(f"DESCRIBE {query}").fetchall()}
                casts = ", ".join(f"{name}::{kind} AS {name}" for name, kind in _CASTS.items() if name in names)
                database.execute(f"CREATE OR REPLACE TEMP TABLE rows AS SELECT * REPLACE ({casts}) FROM ({query})")
                options = "FORMAT parquet, COMPRESSION zstd"
                if metadata is not None:
                    text = json.dumps({**metadata, "content_sha256": _content_digest(database)})
                    options += f", KV_METADATA {{{METADATA_KEY}: {sql_text(text)}}}"
                database.execute(f"COPY rows TO {sql_text(path)} ({options})")
            except duckdb.Error as error:
                raise RunError(f"cannot write {path}: {error}") from None

        yield write


def _content_digest(database: duckdb.DuckDBPyConnection) -> str:
    """SHA-256 of the rows of a result, without the wall-clock time: all else is the same in every run of a plan."""
    (row,) = database.execute(
        "SELECT sha256(string_agg(one::VARCHAR, '\n' ORDER BY frame)) FROM (SELECT * EXCLUDE ms FROM rows) AS one"
    ).fetchall()
    return str(row[0])


def parquet(files: Iterable[Path]) -> str:
    """Files of one kind as a table of SQL."""
    return f"read_parquet([{', '.join(map(sql_text, files))}], hive_partitioning = false)"


def read_metadata(folder: Path, results: Iterable[AskedResult]) -> Iterator[tuple[AskedResult, dict[str, Any]]]:
    """Metadata of results' tables in a run folder, read a few hundred at a time.

    Raises:
        RunError: One of them is no result's table, or that of another result.
    """
    waiting = iter(results)
    while chunk := list(islice(waiting, CHUNK)):
        yield from _read_chunk({folder / one.table: one for one in chunk})


def _read_chunk(files: Mapping[Path, AskedResult]) -> Iterator[tuple[AskedResult, dict[str, Any]]]:
    for path in files:
        if not is_file(path) or path.stat().st_size > MAX_BYTES:
            raise RunError(f"{path}: not a result's table: not a regular file of at most {MAX_BYTES} bytes")
    listed = f"[{', '.join(sql_text(path) for path in files)}]"
    query = f"SELECT file_name, value FROM parquet_kv_metadata({listed}) WHERE key = '{METADATA_KEY}'::BLOB"
    try:
        with duckdb.connect() as database, query_deadline(database):
            found = {Path(name): value for name, value in database.execute(query).fetchall()}
    except duckdb.Error as error:
        raise RunError(
            f"not a result's table: {one_line(str(error))}; pftrack-sim check lists damaged files: delete "
            "them, and the same command makes them again"
        ) from None
    for path, asked in files.items():
        try:
            metadata: object = parse_json(found.get(path, b""))
        except ValueError:
            metadata = None
        if not isinstance(metadata, dict):
            raise RunError(f"{path}: not a result's table: it has no metadata of a run")
        known = cast("dict[str, Any]", metadata)
        if known.get("key") != asked.key:
            other = one_line("{scenario} {condition} seed {seed}, {label}".format_map(defaultdict(str, known)))
            raise RunError(
                f"{path}: is of another episode ({other}), not of {asked.episode.name}, {asked.tracker.label}; "
                "remove it and the same command runs the episode again"
            )
        yield asked, known


def column(values: Sequence[Any]) -> Column:
    """Values as a column; text, lists and None stay objects."""
    if any(isinstance(value, list) for value in values):
        return lists(values)
    if any(isinstance(value, str) or value is None for value in values):
        return np.array(values, dtype=object)
    return np.array(values)


def lists(rows: Sequence[Sequence[Any] | None]) -> Column:
    """Lists as a column; None, and a list with NaN, become NULL."""
    # Filled one by one: numpy would make a matrix of rows of equal length.
    made = np.empty(len(rows), dtype=object)
    for index, row in enumerate(rows):
        made[index] = None if row is None or any(number != number for number in row) else list(row)
    return made
