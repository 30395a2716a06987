"""What a report needs of a run folder."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import duckdb
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.benchmark.plan import Plan
from pftrack_sim.benchmark.reading import Run as RunFolder
from pftrack_sim.core.errors import RunError


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
    """A run.

    Attributes:
        path: The folder.
        record: What `run.json` says.
        plan: What was asked for.
        rows: One for each tracker and finished episode, in the plan's order.
    """

    path: Path
    record: Mapping[str, Any]
    plan: Plan
    rows: tuple[Row, ...]

    @property
    def trackers(self) -> list[str]:
        """Every tracker, once, in order."""
        return list(dict.fromkeys(row.tracker for row in self.rows))

    @property
    def episodes(self) -> list[EpisodeKey]:
        """Every episode, once, in order."""
        return list(dict.fromkeys(row.key for row in self.rows))

    def by_episode(self) -> dict[EpisodeKey, list[Row]]:
        """The rows of each episode."""
        found: dict[EpisodeKey, list[Row]] = {}
        for row in self.rows:
            found.setdefault(row.key, []).append(row)
        return found

    def frames(self, rows: Iterable[Row]) -> dict[str, Frames]:
        """The frames of one episode, for each of its trackers.

        Args:
            rows: The episode's rows.

        Raises:
            RunError: Its file is missing, broken, or outside the run folder.
        """
        found: dict[str, Frames] = {}
        for name in dict.fromkeys(str(row.values["file"]) for row in rows):
            found |= self._frames(name)
        return found

    def _frames(self, name: str) -> dict[str, Frames]:
        table = self.columns(name, ("tracker", "overlap", "centre_error_px", "visible_fraction", "scored"))
        numbers = {
            name: np.asarray(np.ma.filled(table[name], np.nan), dtype=np.float64)
            for name in ("overlap", "centre_error_px", "visible_fraction")
        }
        scored = np.asarray(table["scored"], dtype=np.bool_)
        found: dict[str, Frames] = {}
        for tracker in dict.fromkeys(table["tracker"]):
            own = table["tracker"] == tracker
            found[str(tracker)] = Frames(**{name: values[own] for name, values in numbers.items()}, scored=scored[own])
        return found

    def columns(self, name: str, wanted: Sequence[str]) -> dict[str, Any]:
        """Columns of an episode's file, frame by frame.

        Args:
            name: The file, as the summary names it.
            wanted: Names of the columns.

        Raises:
            RunError: It is missing, broken, or outside the run folder.
        """
        file = (self.path / name).resolve()
        if not file.is_relative_to(self.path.resolve()):
            raise RunError(f"{self.path}: the summary names a file outside the run folder: {name!r}")
        quoted = "'" + str(file).replace("'", "''") + "'"
        try:
            with duckdb.connect() as database:
                query = f"SELECT {', '.join(wanted)} FROM read_parquet({quoted}) ORDER BY frame"
                return database.execute(query).fetchnumpy()
        except duckdb.Error as error:
            raise RunError(f"{file} cannot be read: {str(error).splitlines()[0]}") from None

    def video(self, row: Row) -> Path | None:
        """The video of the row's episode, if one was made."""
        below = Path(str(row.values["file"])).relative_to("episodes").with_suffix(".mp4")
        path = self.path / "videos" / below
        return path if ".." not in below.parts and path.is_file() else None


def read_run(path: Path) -> Run:
    """Read a run folder; an unfinished one as far as it goes.

    Raises:
        RunError: It is no run folder, or holds no finished episode.
    """
    folder = RunFolder(path)
    with folder.open() as database:
        table = database.execute("SELECT * EXCLUDE levels FROM summary ORDER BY number, place")
        names = [one[0] for one in table.description or ()]
        values = [dict(zip(names, one, strict=True)) for one in table.fetchall()]
    rows = tuple(
        Row(EpisodeKey(str(one["scenario"]), str(one["condition"]), int(one["seed"])), str(one["tracker"]), one)
        for one in values
    )
    return Run(path, folder.record, folder.plan, rows)
