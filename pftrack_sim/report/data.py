"""A run folder, read back."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import duckdb
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.errors import RunError


@dataclass(frozen=True)
class EpisodeKey:
    """What is shown to every tracker alike."""

    scenario: str
    condition: str
    seed: int


@dataclass(frozen=True, eq=False)
class Row:
    """One tracker's episode.

    Attributes:
        key: The episode.
        tracker: Name, as a stranger may have chosen it.
        values: Every column of the summary.
    """

    key: EpisodeKey
    tracker: str
    values: Mapping[str, Any]

    def number(self, name: str) -> float:
        """A column as a number; NaN where the summary has none."""
        value = self.values.get(name)
        return float(value) if value is not None else float("nan")


@dataclass(frozen=True, eq=False)
class Frames:
    """One tracker's episode, frame by frame: `(N,)` each.

    Attributes:
        overlap: With the truth's box.
        centre_error_px: Infinite for a miss, NaN where there is no truth.
        visible_fraction: Of the target.
        scored: Whether the frame counts in a mean.
    """

    overlap: NDArray[np.float64]
    centre_error_px: NDArray[np.float64]
    visible_fraction: NDArray[np.float64]
    scored: NDArray[np.bool_]

    @property
    def counted(self) -> NDArray[np.bool_]:
        """Scored frames but the first of them, whose box was given."""
        counted = self.scored.copy()
        first = np.flatnonzero(counted)[:1]
        counted[first] = False
        return counted


@dataclass(frozen=True, eq=False)
class Run:
    """A finished run.

    Attributes:
        path: The folder.
        record: What `run.json` says.
        rows: One for each tracker and episode, in the run's order.
    """

    path: Path
    record: Mapping[str, Any]
    rows: tuple[Row, ...]

    @property
    def trackers(self) -> list[str]:
        """Every tracker, once, in order."""
        return list(dict.fromkeys(row.tracker for row in self.rows))

    @property
    def episodes(self) -> list[EpisodeKey]:
        """Every episode, once, in order."""
        return list(dict.fromkeys(row.key for row in self.rows))

    def frames(self, row: Row) -> Frames:
        """The frames of one row.

        Raises:
            RunError: Its file is missing, broken, or outside the run folder.
        """
        file = (self.path / str(row.values["file"])).resolve()
        if not file.is_relative_to(self.path.resolve()):
            raise RunError(f"{self.path}: the summary names a file outside the run folder: {row.values['file']!r}")
        columns = _query(
            self.path, f"SELECT overlap, centre_error_px, visible_fraction, scored FROM {_quoted(file)} ORDER BY frame"
        )
        return Frames(
            np.asarray(columns["overlap"], dtype=np.float64),
            np.asarray(columns["centre_error_px"], dtype=np.float64),
            np.asarray(columns["visible_fraction"], dtype=np.float64),
            np.asarray(columns["scored"], dtype=np.bool_),
        )

    def video(self, row: Row) -> Path | None:
        """The video of the row's episode, if one was made."""
        name = Path(str(row.values["file"])).name.rpartition("__")[0]
        path = self.path / "videos" / f"{name}.mp4"
        return path if path.is_file() else None


def read_run(path: Path) -> Run:
    """Read a run folder.

    Raises:
        RunError: It is no run folder, or not complete.
    """
    if not path.is_dir():
        raise RunError(f"{path} is not a folder: give the run folder that `pftrack-sim bench` wrote")
    for name in ("run.json", "summary.parquet"):
        if not (path / name).is_file():
            raise RunError(f"{path} has no {name}: it is not a complete run folder")
    try:
        record = json.loads((path / "run.json").read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise RunError(f"{path / 'run.json'} cannot be read: {error}") from None
    columns = _query(path, f"SELECT * FROM {_quoted(path / 'summary.parquet')}")
    rows = []
    for values in (dict(zip(columns, one, strict=True)) for one in zip(*columns.values(), strict=True)):
        plain = {key: _plain(value) for key, value in values.items()}
        key = EpisodeKey(str(plain["scenario"]), str(plain["condition"]), int(plain["seed"]))
        rows.append(Row(key, str(plain["tracker"]), plain))
    if not rows:
        raise RunError(f"{path} holds no episodes")
    return Run(path, record, tuple(rows))


def _query(path: Path, sql: str) -> dict[str, Any]:
    try:
        with duckdb.connect() as database:
            return database.execute(sql).fetchnumpy()
    except duckdb.Error as error:
        raise RunError(f"{path} cannot be read: {str(error).splitlines()[0]}") from None


def _quoted(path: Path) -> str:
    escaped = str(path).replace("'", "''")
    return f"'{escaped}'"


def _plain(value: Any) -> Any:
    if value is np.ma.masked:
        return None
    return value.item() if isinstance(value, np.generic) else value
