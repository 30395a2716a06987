"""A tracker's results on a frozen suite as one file that others can check; reference results are a folder of them.

A Parquet file with a row per episode: its scores, the digest of its frames, and strings with a byte per frame:

overlap     overlap times 250; 255 where there is none
moment      bit 0: the frame is scored; the next: what happens around it, in the order of `losses.TAGS`
luminance   the target's luminance times 255; 0 where it has none

The metadata tell suite, tracker, code, versions and machines, and a digest of the rows. The digest detects accidental
changes; rows that were changed together with it are detected by `verification`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import NoneType
from typing import Any, Literal, TypeAlias

import duckdb
import numpy as np
from pydantic import ValidationError

from pftrack_sim.benchmark import keys
from pftrack_sim.benchmark.asked.from_names import plan_all
from pftrack_sim.benchmark.asked.plan import Plan, TrackerSpec, make_checked_plan
from pftrack_sim.benchmark.asked.suite import load_suite, newest
from pftrack_sim.benchmark.kept.files import atomic_write, query_deadline, sql_text
from pftrack_sim.benchmark.kept.record import Session
from pftrack_sim.benchmark.kept.tables import METADATA_KEY, parquet
from pftrack_sim.benchmark.reading.losses import TAGS
from pftrack_sim.benchmark.reading.store import RunStore
from pftrack_sim.core.data_files import envs_dir
from pftrack_sim.core.errors import ParameterError, RunError, UnknownNameError
from pftrack_sim.core.inputs import is_file, parse_json
from pftrack_sim.core.text import one_line
from pftrack_sim.core.types import BoolArray, FloatArray
from pftrack_sim.scenario.section import Section
from pftrack_sim.score import counted_frames

Row: TypeAlias = Mapping[str, Any]
Cell: TypeAlias = tuple[str, str, str, int]

OVERLAP, LUMINANCE, NONE = 250, 255, 255
_STRINGS = ("overlap", "moment", "luminance")
_NUMBER = (int, float, NoneType)
_NEEDED: Mapping[str, type | tuple[type, ...]] = {
    **dict.fromkeys(("kind", "scenario", "condition", "label", "key", "frames_digest"), str),
    **dict.fromkeys(("seed", "frames"), int),
    **dict.fromkeys(("mean_overlap", "stay", "ms_median"), _NUMBER),
    **dict.fromkeys(_STRINGS, bytes),
}
_MAX_BYTES = 64 << 20
_MOST_NAMED = 5
_BITS = " + ".join(f"{2 << place} * {name}::INT" for place, name in enumerate(TAGS))
_FRAME = "scenario, condition, seed, label"
_ROWS = f"""
SELECT summary.* EXCLUDE (number, place, file, printed, levels, frames_key), {", ".join(_STRINGS)} FROM summary JOIN (
    SELECT {_FRAME},
        list(if(overlap >= 0 AND overlap <= 1, round({OVERLAP} * overlap), {NONE})::UTINYINT ORDER BY frame) AS overlap,
        list((scored::INT + {_BITS})::UTINYINT ORDER BY frame) AS moment,
        list(if(luminance <= 1, round({LUMINANCE} * luminance), 0)::UTINYINT ORDER BY frame) AS luminance
    FROM moments JOIN (SELECT {_FRAME}, frame, luminance FROM frames) USING ({_FRAME}, frame) GROUP BY ALL
) USING ({_FRAME}) ORDER BY number, place
"""


class About(Section):
    """What a submission is of, and what made it.

    Attributes:
        trackers: In open loop and with its controller, as far as the suite has both parts.
        opened: Digests of the files that a third party's tracker has loaded, by their names without folders.
        rows: Digest of the rows.
    """

    format: Literal[1] = 1
    suite: str
    trackers: tuple[TrackerSpec, ...]
    environment: dict[str, str]
    sessions: tuple[Session, ...]
    opened: dict[str, str]
    rows: str


@dataclass(frozen=True, eq=False)
class Submission:
    """A tracker's results on a suite; `path` is the file or the run that they are from."""

    path: Path
    about: About
    rows: tuple[Row, ...]

    @property
    def label(self) -> str:
        """The tracker in both loops: without controller and latency."""
        return plain_label(self.about.trackers[0])


def plain_label(spec: TrackerSpec) -> str:
    """A tracker's label without controller and latency."""
    return spec.model_copy(update={"controller": None, "latency_ms": 0.0}).label


def cell_of(row: Row) -> Cell:
    """Kind, scenario, condition and seed of a row."""
    return row["kind"], row["scenario"], row["condition"], row["seed"]


def frames_of(row: Row) -> tuple[FloatArray, BoolArray, dict[str, BoolArray]]:
    """`(N,)` overlaps of a row's frames, NaN where there is none; whether they count; by tag, whether they have it."""
    stored, moments = (np.frombuffer(row[name], np.uint8) for name in ("overlap", "moment"))
    overlaps = np.where(stored == NONE, np.nan, stored / OVERLAP)
    tags = {name: (moments & (2 << place)) > 0 for place, name in enumerate(TAGS)}
    return overlaps, counted_frames(moments & 1), tags


def suite_plan(
    name: str,
    trackers: Sequence[TrackerSpec],
    environment: keys.Environment | None = None,
    seeds: Sequence[int] | None = None,
) -> Plan:
    """What a suite asks of trackers, as they are given; with their controllers its part in closed loop."""
    part = plan_all([name], trackers=["stay"], closed_loop=trackers[0].controller is not None, seeds=seeds)
    return make_checked_plan(part.sweeps, tuple(trackers), part.suites, environment=environment)


def results_on(
    store: RunStore, name: str, trackers: Sequence[TrackerSpec], seeds: Sequence[int] | None = None
) -> tuple[list[Row], list[str]]:
    """Rows of the trackers' results in a run that are exactly those of a suite, and the names of those it lacks."""
    asked = suite_plan(name, trackers, store.plan.environment, seeds).asked
    there = store.present.keys() & asked.keys()
    rows = [row for row in rows_of(store) if keys.short(row["key"]) in there] if there else []
    return rows, [one.episode.name for key, one in asked.items() if key not in there]


def rows_of(store: RunStore) -> list[Row]:
    """A row for each result of a run, in the plan's order; numbers that are not known are None."""
    answer = store.query(_ROWS)
    return [_row(dict(zip(answer.columns, values, strict=True))) for values in answer.rows]


def _row(values: dict[str, Any]) -> Row:
    unknown = {name: None for name, value in values.items() if isinstance(value, float) and math.isnan(value)}
    return {**values, **unknown, **{name: bytes(values[name]) for name in _STRINGS}}


def make_submission(stores: Sequence[RunStore], tracker: str | None = None) -> Submission:
    """A tracker's results on the frozen suite that runs are of, one for each of its parts.

    Args:
        stores: The runs.
        tracker: Name or label; None: the only one.

    Raises:
        ParameterError: The runs are of no one frozen suite, or not one for each part; it is not clear which tracker.
        UnknownNameError: No such tracker.
        RunError: Results are missing, or were made with other settings.
    """
    names = [{suite.name for suite in store.plan.suites if suite.versions} for store in stores]
    common = sorted(set[str].intersection(*names)) if names else []
    if len(common) != 1:
        given = ", ".join(str(store.path) for store in stores)
        raise ParameterError(
            f"a submission is of one frozen suite, such as {newest('standard')}; got {given}, of "
            f"{' and '.join(common) or 'no common one'}"
        )
    (name,) = common
    kinds = sorted(store.plan.kind for store in stores)
    parts = _parts(name)
    if kinds != parts:
        commands = " and ".join("follow" if kind == "follow" else "bench" for kind in parts)
        raise ParameterError(f"{name} needs one run of {commands} each, got {' and '.join(kinds)}")
    environment = stores[0].plan.environment
    for store in stores[1:]:
        if other := list(keys.differences(environment, store.plan.environment)):
            raise RunError(
                "\n  ".join([f"{store.path} was run with other code or versions than the other part:", *other])
            )
    specs: list[TrackerSpec] = []
    rows: list[Row] = []
    for store in sorted(stores, key=lambda one: one.plan.kind, reverse=True):
        spec = _chosen(store, tracker)
        found, missing = results_on(store, name, [spec])
        if missing:
            more = f" and {len(missing) - _MOST_NAMED} more" if len(missing) > _MOST_NAMED else ""
            raise RunError(
                f"{store.path} lacks {len(missing)} results of {spec.label} on {name}, or has them with other "
                f"settings: {', '.join(missing[:_MOST_NAMED])}{more}"
            )
        specs.append(spec)
        rows += found
    opened = {
        Path(file).name: digest for store in stores for _, files in store.opened() for file, digest in files.items()
    }
    # The command lines hold paths of the machine.
    sessions = [one.model_copy(update={"command": ()}) for store in stores for one in store.record.sessions]
    about = About(suite=name, trackers=tuple(specs), environment=environment, sessions=tuple(sessions), opened=opened,
                  rows=_digest(rows))  # fmt: skip
    made = Submission(stores[0].path, about, tuple(rows))
    if found_wrong := problems(made):
        raise RunError("\n  ".join([f"{name} by {made.label} cannot be submitted:", *found_wrong]))
    return made


def _parts(suite: str) -> list[str]:
    return sorted({"follow" if block.loop == "closed" else "open" for block in load_suite(suite).run})


def _chosen(store: RunStore, tracker: str | None) -> TrackerSpec:
    found = [one for one in store.plan.trackers if tracker in (None, one.name, one.base_label, one.label)]
    if not found:
        raise UnknownNameError("tracker of the run", str(tracker), store.plan.labels)
    if len(found) > 1:
        raise ParameterError(
            f"say which tracker with --tracker: {store.path} has {', '.join(one.label for one in found)}"
        )
    return found[0]


def write_submission(path: Path, made: Submission) -> None:
    """Write a submission; raises RunError."""
    names = dict.fromkeys(name for row in made.rows for name, value in row.items() if value is not None)
    columns = {name: np.array([row.get(name) for row in made.rows], dtype=object) for name in names}
    metadata = f"{{{METADATA_KEY}: {sql_text(made.about.model_dump_json())}}}"
    with atomic_write(path) as part, duckdb.connect() as database:
        try:
            database.execute(f"SET pandas_analyze_sample = {len(made.rows)}")  # types are those of all rows
            database.register("rows", columns)
            options = f"FORMAT parquet, COMPRESSION zstd, KV_METADATA {metadata}"
            database.execute(f"COPY rows TO {sql_text(part)} ({options})")
        except duckdb.Error as error:
            raise RunError(f"cannot write {path}: {one_line(str(error))}") from None


def _digest(rows: Sequence[Row]) -> str:
    """Digest of rows; a column without any value is none, as a file has it for all its rows."""
    known = [{name: value for name, value in row.items() if value is not None} for row in rows]
    plain = ({name: one.hex() if isinstance(one, bytes) else one for name, one in row.items()} for row in known)
    return keys.digest(*plain)


def read_submission(path: Path) -> Submission:
    """Read a submission.

    Raises:
        RunError: It is none, or was changed since it was written.
    """
    if not is_file(path) or path.stat().st_size > _MAX_BYTES:
        raise RunError(f"{path} is not a submission: not a regular file of at most {_MAX_BYTES} bytes")
    try:
        with duckdb.connect() as database, query_deadline(database):
            kept = f"SELECT value FROM parquet_kv_metadata({sql_text(path)}) WHERE key = '{METADATA_KEY}'::BLOB"
            metadata = database.execute(kept).fetchall()
            table = database.execute(f"FROM {parquet([path])}")
            names = [one[0] for one in table.description or ()]
            rows = tuple(dict(zip(names, values, strict=True)) for values in table.fetchall())
        about = About.model_validate(parse_json(metadata[0][0]) if metadata else None)
    except (duckdb.Error, ValueError, ValidationError) as error:
        raise RunError(f"{path} is not a submission that this version reads: {one_line(str(error), 200)}") from None
    lacking = [name for name, kind in _NEEDED.items() if not all(isinstance(row.get(name), kind) for row in rows)]
    if not lacking and any(len({len(row[name]) for name in _STRINGS}) > 1 for row in rows):
        lacking = ["bytes of some frames"]
    if lacking or not about.trackers:
        raise RunError(f"{path} is not a submission: it lacks {', '.join(lacking) or 'its trackers'}")
    if _digest(rows) != about.rows:
        raise RunError(f"{path} was changed since it was written: its rows are not those of its digest")
    return Submission(path, about, rows)


def reference_folder(suite: str) -> Path:
    """Folder of a suite's reference results: beside its file, with its name."""
    return Path(suite).with_suffix("") if suite.endswith(".toml") else envs_dir() / "suites" / suite


def references(suite: str) -> list[Submission]:
    """The reference results of a suite; RunError where one is damaged."""
    found = [read_submission(path) for path in sorted(reference_folder(suite).glob("*.parquet"))]
    return [one for one in found if one.about.suite == suite]


def problems(one: Submission) -> list[str]:
    """What is wrong with a submission, seen from its own content: nothing is played again."""
    found: list[str] = []
    asked = {
        (episode.kind, episode.spec.name, episode.condition.name, episode.seed, spec.label)
        for spec in one.about.trackers
        for episode in suite_plan(one.about.suite, [spec]).episodes()
    }
    cells = [(*cell_of(row), row["label"]) for row in one.rows]
    if set(cells) != asked or len(cells) != len(asked):
        found.append(f"{len(asked ^ set(cells))} episodes are missing, or are none of {one.about.suite}")
    kinds = sorted("open" if spec.controller is None else "follow" for spec in one.about.trackers)
    if kinds != (parts := _parts(one.about.suite)):
        found.append(f"{one.about.suite} needs one part each of {' and '.join(parts)}, got {' and '.join(kinds)}")
    first, *others = one.about.trackers
    for spec in others:
        if (plain_label(spec), _code(spec)) != (plain_label(first), _code(first)):
            found.append(f"its parts are of two trackers, or of other code: {first.label} and {spec.label}")
    wrong = [row for row in one.rows if not _follows(row)]
    found += [
        f"the scores of {' '.join(map(str, cell_of(row)))} are not those of its frames" for row in wrong[:_MOST_NAMED]
    ]
    controllers = load_suite(one.about.suite).controllers
    found += [
        f"it is driven by {spec.controller}, not by {', '.join(controllers)}"
        for spec in one.about.trackers
        if spec.controller is not None and spec.controller not in controllers
    ]
    times = [row["ms_median"] for row in one.rows if row["kind"] == "open" and row["ms_median"] is not None]
    takes = float(np.median(times)) if times else 0.0
    found += [
        f"in closed loop it is charged {spec.latency_ms:g} ms per frame, and takes {takes:.1f} ms: follow with "
        "--latency measured"
        for spec in one.about.trackers
        if spec.controller is not None and spec.latency_ms < 0.5 * takes - 1.0
    ]
    return found


def _code(spec: TrackerSpec) -> dict[str, str]:
    """Digests of a tracker's code, without its controller's."""
    return {name: digest for name, digest in spec.code.items() if name != spec.controller}


def _follows(row: Row) -> bool:
    """Whether a row's scores and number of frames are those of its frames, but for rounding."""
    overlaps, counted, _ = frames_of(row)
    if len(overlaps) != len(counted) or not counted.any():
        return row["frames"] == 0 and row["mean_overlap"] is None
    known = np.nan_to_num(overlaps[counted])
    apart = abs(float(known.mean()) - (row["mean_overlap"] or 0.0))
    tracked, half = (row.get("success") or 0.0), 0.5 / OVERLAP  # an overlap of a half may be rounded up or down
    low, high = (float(np.mean(known > 0.5 + sign * half)) for sign in (1.0, -1.0))
    right = apart <= 1.0 / OVERLAP and low - 1e-9 <= tracked <= high + 1e-9
    return bool(right and row["frames"] == counted.sum())
