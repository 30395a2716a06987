"""Events of an episode over time: recovery after occlusions, drift, permanent loss.

A tracker is not reinitialised after a failure. Times are the frames' own: under frame loss they are irregular.
Arguments are `(N,)`, one number per frame; functions raise `ParameterError` where the lengths differ. `scored` is true
where the target can be seen.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.types import BoolArray, FloatArray, IntArray
from pftrack_sim.score.curves import SUCCESS_OVERLAP

COVERED_BELOW = 0.5  # Visible fraction below which the target counts as occluded


@dataclass(frozen=True)
class Recovery:
    """Recovery of a tracker after one occlusion.

    Attributes:
        first: First occluded frame.
        last: Last occluded frame.
        after_s: Time from the first frame after it until the target is tracked again; infinite when it is not tracked
            before the next occlusion or the end.
        observed_s: Time until the next occlusion or the end: an infinite `after_s` is censored at this value.
    """

    first: int
    last: int
    after_s: float
    observed_s: float


def occlusions(visible_fraction: ArrayLike) -> list[tuple[int, int]]:
    """First and last frame of each span in which the target is occluded; a visible fraction of NaN counts as 0.

    >>> occlusions([1.0, 0.4, 0.0, 0.9, 0.2])
    [(1, 2), (4, 4)]
    """
    visible = np.nan_to_num(np.asarray(visible_fraction, dtype=np.float64), nan=0.0)
    return list(_spans(visible < COVERED_BELOW))


def recoveries(overlap: ArrayLike, visible_fraction: ArrayLike, time_s: ArrayLike) -> list[Recovery]:
    """Time after each occlusion until the overlap reaches `SUCCESS_OVERLAP` again.

    An occlusion that lasts to the end of the episode is left out.
    """
    values, visible = _pair("visible_fraction", overlap, visible_fraction)
    _, times = _pair("time_s", overlap, time_s)
    # The last frame lasts as long as a frame usually does.
    ends = np.append(times, times[-1] + np.median(np.diff(times))) if times.size > 1 else times
    spans = occlusions(visible)
    starts = [first for first, _ in spans] + [values.size]
    found: list[Recovery] = []
    for (first, last), end in zip(spans, starts[1:], strict=True):
        uncovered = last + 1
        if uncovered >= end:
            continue
        tracked = np.flatnonzero(values[uncovered:end] >= SUCCESS_OVERLAP)
        after = float(times[uncovered + tracked[0]] - times[uncovered]) if tracked.size else math.inf
        found.append(Recovery(first, last, after, float(ends[end] - times[uncovered])))
    return found


def recovered_within(found: Sequence[Recovery], limit_s: float) -> float:
    """Share of recoveries within a time; those censored before it are left out, NaN where none remains.

    >>> recovered_within([Recovery(0, 1, 0.5, 9.0), Recovery(5, 6, math.inf, 9.0), Recovery(8, 9, math.inf, 0.2)], 2.0)
    0.5
    """
    known = [one.after_s <= limit_s for one in found if one.after_s <= limit_s or one.observed_s >= limit_s]
    return sum(known) / len(known) if known else math.nan


def drift_per_second(normalised_error: ArrayLike, overlap: ArrayLike, scored: ArrayLike, time_s: ArrayLike) -> float:
    """Slope of the normalised centre error while the target is tracked [box sizes/s]; NaN for fewer than 3 frames.

    Ordinary least squares over the frames before the overlap first is 0, where the target can be seen.

    >>> round(drift_per_second([0.0, 0.1, 0.2, 9.0], [1.0, 0.9, 0.8, 0.0], [True] * 4, [0.0, 0.1, 0.2, 0.3]), 6)
    1.0
    """
    values, _ = _pair("normalised_error", overlap, normalised_error)
    _, times = _pair("time_s", overlap, time_s)
    seen, frames = _scored(values, scored)
    lost = np.flatnonzero(seen == 0.0)
    held = frames[: lost[0]] if lost.size else frames
    if held.size < 3:
        return math.nan
    slope, _ = np.polyfit(times[held], np.asarray(normalised_error, dtype=np.float64)[held], 1)
    return float(slope)


def share_permanently_lost(overlap: ArrayLike, scored: ArrayLike) -> float:
    """Share of the scored frames after the last one with an overlap of at least `SUCCESS_OVERLAP`; NaN for no frames.

    >>> share_permanently_lost([0.9, 0.6, 0.1, 0.0], [True] * 4)
    0.5
    """
    seen, _ = _scored(overlap, scored)
    if not seen.size:
        return math.nan
    tracked = np.flatnonzero(seen >= SUCCESS_OVERLAP)
    return 1.0 - (float(tracked[-1]) + 1.0) / seen.size if tracked.size else 1.0


def _scored(overlap: ArrayLike, scored: ArrayLike) -> tuple[FloatArray, IntArray]:
    """Overlaps of the scored frames, and which these are."""
    values, counted = _pair("scored", overlap, scored)
    frames = np.flatnonzero(counted)
    return values[frames], frames


def _pair(name: str, overlap: ArrayLike, other: ArrayLike) -> tuple[FloatArray, FloatArray]:
    values, others = np.asarray(overlap, dtype=np.float64), np.asarray(other, dtype=np.float64)
    if values.ndim != 1 or values.shape != others.shape:
        raise ParameterError(f"overlap and {name} must have one number per frame, got {values.shape}, {others.shape}")
    return values, others


def _spans(flags: BoolArray) -> Iterator[tuple[int, int]]:
    """First and last index of every run of true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    for first, end in edges.reshape(-1, 2):
        yield int(first), int(end) - 1
