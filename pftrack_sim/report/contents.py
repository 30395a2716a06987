"""The data of the page as plain values for JSON."""

from __future__ import annotations

import base64
import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from pftrack_sim import score
from pftrack_sim.benchmark import Result, RunStore
from pftrack_sim.benchmark.datasets.results import Scored, ScoredResult
from pftrack_sim.benchmark.reading.losses import EVER_TRACKED, LOSS, TAGS, tag_title
from pftrack_sim.benchmark.reading.summary import by_seed, paired_by_seed
from pftrack_sim.benchmark.said.degradation import degradation, levels_of
from pftrack_sim.core.palette import GREY, STAY, Style, styles_of
from pftrack_sim.core.types import BoolArray, FloatArray, IntArray
from pftrack_sim.report.following import following_episodes, video_link
from pftrack_sim.report.tables import grouped
from pftrack_sim.score.events import occlusions
from pftrack_sim.score.statistics import Comparison

GROUPS: Mapping[str, Mapping[str, str]] = MappingProxyType(
    {
        "overview": {
            "mean_overlap": "mean overlap",
            "stay": "stay",
            "success": "tracked at 0.5",
            "success_30": "at 0.3",
            "centre_inside": "centre inside",
            "fixed_size": "fixed size",
            "ms_median": "ms per frame",
        },
        "following": {
            "follow_success": "success (following)",
            "follow_collision": "collided",
            "follow_tracking_rate": "tracked (following)",
            "follow_within": "within",
            "follow_distance_rms_m": "RMS distance [m]",
            "follow_bearing_rms_deg": "RMS bearing [°]",
            "follow_losses": "times out of sight",
            "follow_time_to_loss_s": "time to loss [s]",
            "follow_time_to_find_s": "time to find [s]",
            "follow_jerk_rms_m_s3": "jerk [m/s\u00b3]",
            "follow_bystander_m": "nearest bystander [m]",
        },
        "success and precision": {
            "mean_overlap": "mean overlap",
            "auc": "AUC",
            "precision": "precision at 20 px",
            "normalised_precision": "normalised precision",
            "sr_75": "SR 0.75",
        },
        "losses and recovery": {
            "mean_overlap": "mean overlap",
            "lost_for_good": "lost for good",
            "occlusions": "occlusions",
            "recovered_2s": "recovered within 2 s",
            "recovered": "recovered",
            "recovery_s": "recovery [s]",
            "drift_per_s": "drift [sizes/s]",
        },
        "speed": {
            "ms_median": "ms per frame",
            "ms_p95": "ms, 95th percentile",
            "ms_max": "ms, slowest frame",
            "ms_reported": "ms, as it says",
        },
    }
)
"""Columns of the leader board, in the groups that are shown together: names in the summary, and heads."""

PEOPLE: Mapping[str, str] = MappingProxyType({head.lower(): head for head in score.PEOPLE_DEFINITIONS})
"""Columns of the table of everybody in view, of which the first orders the trackers."""

MEASURES: Mapping[str, str] = MappingProxyType(
    {name: head for group in (*GROUPS.values(), PEOPLE) for name, head in group.items()}
)

_EPISODE = "scenario, condition, seed, label"
_FRAME_COLUMNS = ("time_s", "overlap", "centre_error_px", "visible_fraction", "scored")


@dataclass(frozen=True, eq=False)
class TrackerFrames:
    """One tracker's frames of an episode, `(N,)` each."""

    time_s: FloatArray
    overlap: FloatArray
    centre_error_px: FloatArray
    visible_fraction: FloatArray
    scored: BoolArray

    @property
    def counted(self) -> BoolArray:
        """Scored frames except the first one, in which the box was given."""
        return score.counted_frames(self.scored)


def read_frames(store: RunStore, results: Iterable[Result]) -> dict[str, TrackerFrames]:
    """The frames of the trackers in an episode, by label, from the episode's results.

    Raises:
        RunError: A file is missing, broken, or outside the run folder.
    """
    frames: dict[str, TrackerFrames] = {}
    for result in results:
        table = store.frame_columns(result, _FRAME_COLUMNS)
        numbers = [np.asarray(table[name], dtype=np.float64) for name in _FRAME_COLUMNS[:-1]]
        frames[result.label] = TrackerFrames(*numbers, scored=table["scored"])
    return frames


def by_episode(results: Iterable[Result]) -> dict[tuple[str, str, int], list[Result]]:
    """Results by scenario, condition and seed."""
    return grouped(results, cell_of)


def cell_of(one: Result) -> tuple[str, str, int]:
    """Scenario, condition and seed of a result."""
    return one.scenario, one.condition.name, one.seed


@dataclass(frozen=True, eq=False)
class _Shown:
    """One tracker in an episode of the page: its measures by name, NaN or None where there is none, and its frames."""

    label: str
    values: Mapping[str, Any]
    error: str | None
    frames: TrackerFrames


def contents(store: RunStore, on_episode: Callable[[], None] = lambda: None) -> dict[str, Any]:
    """The page's data of a run; `on_episode` is called after every episode that was read."""
    results = store.results
    trackers = list(dict.fromkeys(result.label for result in results))
    scenarios = list(dict.fromkeys(result.scenario for result in results))
    conditions = list(dict.fromkeys(result.condition for result in results))
    by_key = by_episode(results)

    def episodes() -> Iterator[tuple[dict[str, Any], list[_Shown]]]:
        for its_results in by_key.values():
            frames = read_frames(store, its_results)
            first = its_results[0]
            episode = _episode(store, first, frames[first.label])
            episode |= {"scenario": scenarios.index(first.scenario), "condition": conditions.index(first.condition)}
            yield episode, [_Shown(one.label, one.values, one.error, frames[one.label]) for one in its_results]
            on_episode()

    numbers = {key: number for number, key in enumerate(by_key)}
    swept = degradation(store)
    return {
        **_board(trackers, store.plan.labels, episodes()),
        "unit": "seed",
        "scenarios": scenarios,
        "conditions": [condition.name for condition in conditions],
        "levels": [{at.label: at.x for at in levels_of(condition)} for condition in conditions],
        "axes": [
            [one.at.label, one.at.x, one.tracker, scenarios.index(one.scenario), one.seed, _json(one.overlap)]
            for one in swept.curves
        ],
        "maps": [
            [
                *(value for at in (one.first, one.second) for value in (at.label, at.x)),
                one.tracker,
                scenarios.index(one.scenario),
                one.seed,
                _json(one.overlap),
            ]
            for one in swept.maps
        ],
        "drives": following_episodes(store, numbers),
        "matrix": _matrix(results, trackers),
        **_losses(store, trackers, numbers),
    }


def _losses(store: RunStore, trackers: Sequence[str], numbers: Mapping[tuple[str, str, int], int]) -> dict[str, Any]:
    """Data of the losses, of trackers in the order of the page.

    Returns:
        `loss`: the definition; `tags`: names and meanings; `losses`: rows of tracker, episode, times [s] when it was
        tracked last, lost, and found again or null, and a bit for each tag; `moments`: rows of tracker, episode, number
        of frames in which the target can be seen, whether it is ever tracked, and number of those with each tag.
    """
    bits = " + ".join(f"{name}::INTEGER * {1 << place}" for place, name in enumerate(TAGS))
    counts = ", ".join(f"sum({name}::INTEGER)::INTEGER" for name in TAGS)
    times = ", ".join(f"round({name}, 3)" for name in ("time_s", "lost_s", "found_s"))
    lost = store.query(f"SELECT {_EPISODE}, {times}, {bits} FROM losses")
    seen = store.query(
        f"SELECT {_EPISODE}, count(*), {EVER_TRACKED}, {counts} FROM moments WHERE scored GROUP BY ALL ORDER BY ALL"
    )

    def rows(found: Sequence[tuple[Any, ...]]) -> list[list[Any]]:
        return [
            [trackers.index(label), numbers[scenario, condition, seed], *values]
            for scenario, condition, seed, label, *values in found
        ]

    meanings = [[tag_title(name), words] for name, (words, _) in TAGS.items()]
    return {"loss": LOSS, "tags": meanings, "losses": rows(lost.rows), "moments": rows(seen.rows)}


def _board(
    trackers: Sequence[str], labels: Sequence[str], episodes: Iterable[tuple[dict[str, Any], Sequence[_Shown]]]
) -> dict[str, Any]:
    """What the leader board, the curves and the episodes frame by frame show.

    All `labels` of the run give each tracker its style; of each episode there is what the page tells of it.
    """
    rows: list[tuple[int, int, Mapping[str, Any], str | None]] = []
    slowest: dict[int, tuple[float, int, int, float]] = {}
    curves: dict[tuple[int, int, int], IntArray] = {}
    told: list[dict[str, Any]] = []
    for number, (episode, its_trackers) in enumerate(episodes):
        for one in its_trackers:
            tracker = trackers.index(one.label)
            rows.append((tracker, number, one.values, one.error))
            ms, frame = (one.values.get(name) for name in ("ms_max", "ms_max_frame"))
            if ms is not None and frame is not None and ms > slowest.get(tracker, (0.0,))[0]:
                slowest[tracker] = ms, number, int(frame), round(float(one.frames.time_s[int(frame)]), 3)
            at = (tracker, episode["scenario"], episode["condition"])
            curves[at] = curves.get(at, 0) + _counts(one.frames)  # Whole episodes of a long run are not kept
            episode["overlap"][tracker] = _packed(one.frames.overlap)
        told.append(episode)
    most = max(len({one[key] for one in told}) for key in ("seed", "scenario"))
    measures = [name for name in MEASURES if any(values.get(name) is not None for _, _, values, _ in rows)]
    styles = styles_of(labels)
    return {
        "trackers": list(trackers),
        # Colour, dash and marker, as plotly reads them; the last are those of the first box in every frame.
        "styles": [[one.hexadecimal, one.dash, one.marker] for one in (*(styles[label] for label in trackers), STAY)],
        "neutral": Style(GREY).hexadecimal,
        "measures": [[name, MEASURES[name], score.MEASURE_DEFINITIONS.get(name, "")] for name in measures],
        "groups": [
            [title, known] for title, group in GROUPS.items() if (known := [one for one in group if one in measures])
        ],
        "people": [name for name in PEOPLE if name in measures],
        "rows": [
            [tracker, number, *(_json(values.get(name)) for name in measures), error]
            for tracker, number, values, error in rows
        ],
        "curves": [
            [*at, int(counts[0]), *(one.tolist() for one in np.split(counts[1:], [score.SUCCESS_THRESHOLDS.size]))]
            for at, counts in curves.items()
        ],
        "least_seeds": score.LEAST_FOR_INTERVAL,
        # Of Student's t for so many values, seeds or sequences.
        "quantiles": [0, 0, *(_json(score.student_quantile(count)) for count in range(2, most + 1))],
        # Of each tracker its slowest frame: tracker, time [ms], episode, frame and its time in the episode [s].
        "slowest": [[tracker, *found] for tracker, found in slowest.items()],
        "success_thresholds": score.SUCCESS_THRESHOLDS.tolist(),
        "precision_thresholds": score.PRECISION_THRESHOLDS_PX.tolist(),
        "episodes": told,
    }


def _counts(frames: TrackerFrames) -> IntArray:
    """`(1 + S + P,)` frames that count, and those of them beyond each threshold of success and of precision."""
    counted = frames.counted
    curves = score.success_curve(frames.overlap[counted]), score.precision_curve(frames.centre_error_px[counted])
    return np.rint(np.nan_to_num(counted.sum() * np.concatenate([[1.0], *curves]))).astype(np.intp)


def _episode(store: RunStore, result: Result, frames: TrackerFrames) -> dict[str, Any]:
    rate_hz = result.number("rate_hz")
    time_s: FloatArray = frames.time_s - frames.time_s[0]
    regular = np.allclose(time_s, np.arange(len(time_s)) / rate_hz, rtol=0.0, atol=1e-3)
    return _entry(result.seed, rate_hz, frames) | {
        "time": None if regular else [round(float(time), 3) for time in time_s],
        "video": video_link(store, result) if store.plan.kind == "open" else None,
    }


def _entry(seed: int, rate_hz: float, frames: TrackerFrames) -> dict[str, Any]:
    """What the page tells of an episode without a video, whose frames come at a fixed rate."""
    return {
        "seed": seed,
        "rate_hz": _json(rate_hz),
        "time": None,
        "overlap": {},
        "occluded": [[first, last + 1] for first, last in occlusions(frames.visible_fraction)],
        "video": None,
    }


def _matrix(results: Sequence[Result], trackers: Sequence[str]) -> list[dict[str, Any]]:
    """Differences in mean overlap of each pair of trackers over the episodes of both, paired by seed."""
    found = {name: {cell_of(one): one for one in results if one.label == name} for name in trackers}

    def scores(name: str, other: str) -> dict[int, float]:
        common = found[name].keys() & found[other].keys()
        return by_seed((found[name][cell].seed, found[name][cell].number("mean_overlap")) for cell in sorted(common))

    pairs = list(itertools.combinations(trackers, 2))
    differences = score.corrected([paired_by_seed(scores(*pair), scores(*pair[::-1])) for pair in pairs])
    return _pairs([Comparison(*pair, one) for pair, one in zip(pairs, differences, strict=True)], trackers)


def _pairs(compared: Sequence[Comparison], trackers: Sequence[str]) -> list[dict[str, Any]]:
    """Differences of pairs of trackers, and whether they are shown."""
    return [
        {
            "one": trackers.index(one.first),
            "other": trackers.index(one.second),
            "difference": _json(one.difference.mean),
            "p": _json(one.difference.p),
            "shown": one.difference.verdict in ("above", "below"),
            "seeds": one.difference.seeds,
        }
        for one in compared
    ]


def scored_contents(found: Scored) -> dict[str, Any]:
    """The page's data of scored result files."""
    trackers = list(dict.fromkeys(one.tracker.label for one in found.results))
    sequences = list(dict.fromkeys(one.sequence for one in found.results))
    return {
        **_board(trackers, trackers, _scored_episodes(found.results, sequences)),
        "unit": "sequence",
        "scenarios": sequences,
        "conditions": ["base"],
        "levels": [{}],
        "axes": [],
        "maps": [],
        "drives": [],
        "matrix": _pairs(found.comparisons, trackers),
        "loss": LOSS,
        "tags": [],
        "losses": [],
        "moments": [],
    }


def _scored_episodes(
    results: Sequence[ScoredResult], sequences: Sequence[str]
) -> Iterator[tuple[dict[str, Any], list[_Shown]]]:
    """Trackers by sequence and repetition."""
    for name in sequences:
        for repetition in sorted({one.seed for one in results if one.sequence == name}):
            its = [one for one in results if (one.sequence, one.seed) == (name, repetition)]
            shown = [_shown(one) for one in its]
            entry = _entry(repetition, its[0].rate_hz, shown[0].frames)
            yield entry | {"scenario": sequences.index(name), "condition": 0}, shown


def _shown(one: ScoredResult) -> _Shown:
    seen = np.isfinite(one.frames.truth[:, 0])
    time_s = np.arange(len(seen)) / one.rate_hz
    frames = TrackerFrames(time_s, one.frames.overlap, one.frames.centre_error_px, seen.astype(np.float64), seen)
    values = {name: None if np.isnan(value) else value for name, value in asdict(one.summary).items()}
    return _Shown(one.tracker.label, values, one.error, frames)


def _packed(overlap: FloatArray) -> str:
    """Overlaps in steps of 1/250, one byte each, so that a page with a thousand episodes still opens at once."""
    return base64.b64encode(np.rint(250.0 * np.nan_to_num(overlap)).astype(np.uint8).tobytes()).decode()


def _json(value: float | None) -> float | None:
    return round(float(value), 6) if value is not None and math.isfinite(value) else None
