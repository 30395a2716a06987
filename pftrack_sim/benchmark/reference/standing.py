"""Where the trackers of a run stand among the reference results of a frozen suite."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from pftrack_sim import score
from pftrack_sim.benchmark.asked.from_names import seeds_text
from pftrack_sim.benchmark.reading.store import RunStore
from pftrack_sim.benchmark.reading.summary import by_seed, paired_by_seed
from pftrack_sim.benchmark.reference.submission import (
    LUMINANCE,
    Cell,
    Row,
    Submission,
    cell_of,
    frames_of,
    plain_label,
    references,
    results_on,
)
from pftrack_sim.score import SeedMean

EXPLAINING: Mapping[str, str] = {
    "occluded": "occluded",
    "fast_motion": "shaken",
    "light_change": "light",
    "look_alike_near": "look-alike",
    "scale_change": "scale",
}
"""Tags of `losses.TAGS` whose frames explain a number, with the heads of their columns."""

_T = TypeVar("_T")
_SAME = 1e-9


@dataclass(frozen=True)
class Place:
    """A tracker's numbers on a suite.

    Attributes:
        here: Whether they are of this run.
        skill: Mean overlap over all scored frames, corrected for chance, over seeds; none in closed loop.
        explained: Mean overlap on the frames with each tag of `EXPLAINING`.
        ms: Median time per frame.
        success: Share of the drives that succeed.
    """

    label: str
    here: bool
    skill: SeedMean
    explained: Mapping[str, float]
    ms: float
    success: SeedMean


@dataclass(frozen=True)
class PairedPlace:
    """A tracker of this run minus one of the references, over the seeds that both have whole.

    Attributes:
        difference: Of mean overlaps, its p-value corrected for all references.
        episodes: Number of pairs.
        other_scenes: Pairs that are left out, as even the truth differs.
        other_frames: Pairs whose images differ.
        luminance: Mean difference of the target's luminance in these, in shares of the brightest; below 1/255 it is
            within rounding.
    """

    label: str
    reference: str
    difference: SeedMean
    episodes: int
    other_scenes: int
    other_frames: int
    luminance: float


@dataclass(frozen=True)
class Standing:
    """A run among the reference results of a suite; `places` are in descending order."""

    suite: str
    places: tuple[Place, ...]
    pairs: tuple[PairedPlace, ...]
    episodes: int
    missing: int
    references: int


def standings(store: RunStore) -> list[Standing]:
    """Where a run's trackers stand on each of its frozen suites; none for results with other settings.

    Raises:
        RunError: A file cannot be read.
    """
    found = [_standing(store, suite.name, suite.controllers) for suite in store.plan.suites if suite.versions]
    return [one for one in found if one is not None]


def board(suite: str) -> Standing | None:
    """The reference results alone; None without any."""
    known = references(suite)
    places = _sorted(place_of(one.label, False, one.rows) for one in known)
    return Standing(suite, places, (), 0, 0, len(known)) if known else None


def _standing(store: RunStore, suite: str, controllers: Sequence[str]) -> Standing | None:
    specs = [one for one in store.plan.trackers if one.controller is None or one.controller in controllers]
    rows, missing = results_on(store, suite, specs) if specs else ([], [])
    known, name = references(suite), suite
    if specs and not rows:  # tuning: the numbers of other seeds stand alone
        seeds = sorted({one.seed for one in store.plan.episodes()})
        rows, missing = results_on(store, suite, specs, seeds)
        known, name = [], f"{suite} on seeds {seeds_text(seeds)}, which are not its own"
    if not rows:
        return None
    own = {one.label: [row for row in rows if row["label"] == one.label] for one in specs}
    here = {plain_label(one): own[one.label] for one in specs if own[one.label]}
    places = [place_of(label, True, mine) for label, mine in here.items()]
    places += [place_of(one.label, False, one.rows) for one in known]
    pairs = [pair for label, mine in here.items() for pair in _paired(label, mine, known)]
    return Standing(name, _sorted(places), tuple(pairs), len(rows), len(missing), len(known))


def _sorted(places: Iterable[Place]) -> tuple[Place, ...]:
    def descending(place: Place) -> tuple[bool, float, float]:
        skill, success = place.skill.mean, place.success.mean
        return math.isnan(skill), -np.nan_to_num(skill), -np.nan_to_num(success)

    return tuple(sorted(places, key=descending))


def place_of(label: str, here: bool, rows: Sequence[Row]) -> Place:
    """The numbers of a tracker's rows; seeds that lack an episode that others have do not count."""
    tracked = _whole_seeds({cell_of(row): row for row in rows if row["kind"] == "open"})
    overlaps, stays = (
        by_seed((row["seed"], _number(row, name)) for row in tracked) for name in ("mean_overlap", "stay")
    )
    values: dict[str, list[tuple[int, float]]] = {name: [] for name in EXPLAINING}
    for row in tracked:
        found, counted, tags = frames_of(row)
        for name, known in values.items():
            if (frames := counted & tags[name]).any():
                known.append((row["seed"], float(np.nan_to_num(found[frames]).mean())))
    explained = {name: _mean(by_seed(known).values()) for name, known in values.items()}
    skill = score.skill_over_seeds([overlaps[seed] for seed in overlaps], [stays[seed] for seed in overlaps])
    driven = [row for row in rows if row["kind"] == "follow"]
    times = [_number(row, "ms_median") for row in tracked or driven]
    # Drives of one seed are in different places; over all of them the interval covers (docs/standard.md).
    success = score.proportion_over_seeds([_number(row, "follow_success") for row in driven])
    ms = float(np.nanmedian(times)) if not np.isnan(times).all() else math.nan
    return Place(label, here, skill, explained, ms, success)


def _paired(label: str, mine: Sequence[Row], known: Sequence[Submission]) -> list[PairedPlace]:
    own = {cell_of(row): row for row in mine if row["kind"] == "open"}
    found: list[PairedPlace] = []
    for one in known if own else ():
        theirs = {cell_of(row): row for row in one.rows if cell_of(row) in own}
        same = {cell: (own[cell], row) for cell, row in theirs.items() if _same_scene(own[cell], row)}
        whole = _whole_seeds(same)
        ours, other = (
            by_seed((pair[place]["seed"], _number(pair[place], "mean_overlap")) for pair in whole) for place in (0, 1)
        )
        redrawn = [pair for pair in same.values() if pair[0]["frames_digest"] != pair[1]["frames_digest"]]
        difference = paired_by_seed(ours, other)
        counts = len(whole), len(theirs) - len(same), len(redrawn)
        found.append(PairedPlace(label, one.label, difference, *counts, _mean(map(_luminance, redrawn))))
    differences = score.corrected([one.difference for one in found])
    return [replace(one, difference=difference) for one, difference in zip(found, differences, strict=True)]


def _same_scene(one: Row, other: Row) -> bool:
    """Whether the truth is the same: the box that stays has the same overlap, on as many frames."""
    close = abs(_number(one, "stay") - _number(other, "stay")) < _SAME
    return one["frames"] == other["frames"] and (close or one["stay"] is other["stay"] is None)


def _luminance(pair: tuple[Row, Row]) -> float:
    one, other = (np.frombuffer(row["luminance"], np.uint8).astype(np.float64) for row in pair)
    return float(np.abs(one - other).mean()) / LUMINANCE if len(one) == len(other) else 1.0


def _whole_seeds(cells: Mapping[Cell, _T]) -> list[_T]:
    """What is known of the seeds that have as many episodes as any seed has."""
    counts = {seed: sum(cell[3] == seed for cell in cells) for seed in {cell[3] for cell in cells}}
    return [one for cell, one in cells.items() if counts[cell[3]] == max(counts.values())]


def _number(row: Row, name: str) -> float:
    value = row.get(name)
    return math.nan if value is None else float(value)


def _mean(values: Iterable[float]) -> float:
    known = list(values)
    return sum(known) / len(known) if known else math.nan
