"""Everything that the page shows, as plain values ready for JSON: what can be worked out once is worked out here."""

from __future__ import annotations

import base64
import math
import os
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pftrack_sim import score
from pftrack_sim.benchmark.plan import LATENCY
from pftrack_sim.core import random_streams
from pftrack_sim.report.data import EpisodeKey, Frames, Row, Run
from pftrack_sim.report.drives import drives
from pftrack_sim.scenario.axes import axes_by_name

MEASURES = {
    "mean_overlap": "mean overlap",
    "follow_success": "followed to the end",
    "follow_collision": "collided",
    "follow_tracking_rate": "tracked (following)",
    "follow_distance_rms_m": "RMS distance [m]",
    "follow_bearing_rms_deg": "RMS bearing [°]",
    "follow_losses": "losses",
    "follow_time_to_loss_s": "time to loss [s]",
    "follow_time_to_find_s": "time to find [s]",
    "follow_jerk_rms_m_s3": "jerk [m/s\u00b3]",
    "success": "success at 0.5",
    "auc": "AUC",
    "precision": "precision at 20 px",
    "normalised_precision": "normalised precision",
    "sr_75": "SR 0.75",
    "failures": "failures",
    "recovered": "recovered",
    "recovery_s": "recovery [s]",
    "drift_per_s": "drift [sizes/s]",
    "lost_for_good": "lost for good",
    "ms_median": "ms per frame",
    "ms_p95": "ms, 95th percentile",
}
"""Columns of the board that a summary may have, and their heads."""

COVERED_BELOW = 0.5


def contents(run: Run, on_episode: Callable[[], None] = lambda: None) -> dict[str, Any]:
    """The page's data.

    Args:
        run: The run folder.
        on_episode: Called after every episode that was read.
    """
    trackers, episodes = run.trackers, run.episodes
    scenarios = list(dict.fromkeys(one.scenario for one in episodes))
    conditions = list(dict.fromkeys(one.condition for one in episodes))
    measures = [name for name in MEASURES if any(name in row.values for row in run.rows)]
    number = {key: index for index, key in enumerate(episodes)}
    rows: list[list[Any]] = []
    curves: dict[tuple[int, int, int], _Counts] = {}
    shown: list[dict[str, Any]] = []
    for key, its_rows in run.by_episode().items():
        by_tracker = run.frames(its_rows)
        episode = _episode(run, key, its_rows[0], scenarios, conditions)
        shown.append(episode)
        for row in its_rows:
            tracker, frames = trackers.index(row.tracker), by_tracker[row.tracker]
            rows.append(
                [tracker, number[key], *(_json(row.number(name)) for name in measures), row.values.get("failure")]
            )
            at = (tracker, episode["scenario"], episode["condition"])
            curves.setdefault(at, _Counts()).add(frames)
            episode["overlap"][tracker] = _packed(frames.overlap)
            episode["occluded"] = _spans(frames.visible_fraction < COVERED_BELOW)
        on_episode()
    return {
        "trackers": trackers,
        "scenarios": scenarios,
        "conditions": conditions,
        "axes": [axis_of(condition) for condition in conditions],
        "measures": [[name, MEASURES[name]] for name in measures],
        "rows": rows,
        "curves": [[*at, *counts.as_lists()] for at, counts in curves.items()],
        "success_thresholds": score.SUCCESS_THRESHOLDS.tolist(),
        "precision_thresholds": score.PRECISION_THRESHOLDS_PX.tolist(),
        "episodes": shown,
        "drives": drives(run),
        "matrix": _matrix(run.rows, trackers),
    }


class _Counts:
    """How many frames lie beyond each threshold, added up over episodes."""

    def __init__(self) -> None:
        self.frames = 0
        self.success = np.zeros(score.SUCCESS_THRESHOLDS.size)
        self.precision = np.zeros(score.PRECISION_THRESHOLDS_PX.size)

    def add(self, frames: Frames) -> None:
        counted = frames.counted
        count = int(counted.sum())
        if not count:
            return
        self.frames += count
        self.success += count * score.success_curve(frames.overlap[counted])
        self.precision += count * score.precision_curve(frames.centre_error_px[counted])

    def as_lists(self) -> list[Any]:
        return [self.frames, np.rint(self.success).astype(int).tolist(), np.rint(self.precision).astype(int).tolist()]


def _episode(
    run: Run, key: EpisodeKey, row: Row, scenarios: Sequence[str], conditions: Sequence[str]
) -> dict[str, Any]:
    video = run.video(row) if run.plan.kind == "open" else None
    return {
        "scenario": scenarios.index(key.scenario),
        "condition": conditions.index(key.condition),
        "seed": key.seed,
        "rate_hz": _json(row.number("rate_hz")),
        "overlap": {},
        "occluded": [],
        "video": os.path.relpath(video, run.path).replace(os.sep, "/") if video is not None else None,
    }


def axis_of(condition: str) -> dict[str, Any] | None:
    """The one axis that a condition moves, and how far in its own unit; None for several or none."""
    if condition == "base" or "," in condition:
        return None
    name, _, level = condition.partition("=")
    word, _, axis = name.rpartition(" ")
    axis, _, parameter = axis.partition(".")
    known = axes_by_name().get(axis)
    try:
        value = float(level)
    except ValueError:
        return None
    if name == LATENCY:
        return {"axis": name, "level": value, "x": value, "label": "latency [ms]"}
    if known is None:
        return None
    if parameter:
        return {"axis": name, "level": value, "x": value, "label": name}
    label = f"{axis} ({word}) [{known.unit}]" if word else f"{axis} [{known.unit}]"
    return {"axis": name, "level": value, "x": known(severity=value).physical, "label": label}


def _matrix(rows: Iterable[Row], trackers: Sequence[str]) -> dict[str, Any]:
    """Who beats whom in mean overlap, paired by episode's seed."""
    by_seed: dict[str, dict[int, list[float]]] = {name: {} for name in trackers}
    for row in rows:
        by_seed[row.tracker].setdefault(row.key.seed, []).append(row.number("mean_overlap"))
    seeds = sorted({seed for found in by_seed.values() for seed in found})
    scores = {
        name: np.array([np.mean(found[seed]) if seed in found else math.nan for seed in seeds])
        for name, found in by_seed.items()
    }
    compared = score.compare(scores, random_streams.stream(0, "bootstrap"))
    return {
        "wins": score.win_matrix(compared, trackers).tolist(),
        "pairs": [
            {
                "one": trackers.index(one.first),
                "other": trackers.index(one.second),
                "difference": _json(one.difference),
                "low": _json(one.low),
                "high": _json(one.high),
                "p": _json(one.p_corrected),
                "seeds": one.seeds,
            }
            for one in compared
        ],
    }


def _packed(overlap: NDArray[np.float64]) -> str:
    """Overlaps in steps of 1/250, a byte each: a thousand episodes stay a page that opens at once."""
    return base64.b64encode(np.rint(250.0 * np.nan_to_num(overlap)).astype(np.uint8).tobytes()).decode()


def _spans(covered: NDArray[np.bool_]) -> list[list[int]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], covered, [False]]).astype(np.int8)))
    return [[int(first), int(end)] for first, end in edges.reshape(-1, 2)]


def _json(value: float) -> float | None:
    return round(value, 6) if math.isfinite(value) else None
