"""Events of an episode over time: recovery after occlusions, drift, permanent loss.

A tracker is not reinitialised after a failure. Times are the frames' own: under frame loss they are irregular.
Arguments are `(N,)`, one number per frame; functions raise `ParameterError` where the lengths differ. `scored` is true
where the target can be seen.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.types import FloatArray
from pftrack_sim.score.curves import SUCCESS_OVERLAP

COVERED_BELOW = 0.5  # Visible fraction below which the target counts as occluded


@dataclass(frozen=True)
class Recovery:
    """Recovery of a tracker after one occlusion.

    Attributes:
        after_s: Time from the first frame after it until the target is tracked again; infinite when it is not tracked
            before the next occlusion or the end.
        observed_s: Time until the next occlusion or the end: an infinite `after_s` is censored at this value.
    """

    after_s: float
    observed_s: float


def occlusions(visible_fraction: ArrayLike) -> list[tuple[int, int]]:
    """First and last frame of each span in which the target is occluded; a visible fraction of NaN counts as 0.

    >>> occlusions([1.0, 0.4, 0.0, 0.9, 0.2])
    [(1, 2), (4, 4)]
    """
    occluded = ~(np.asarray(visible_fraction, dtype=np.float64) >= COVERED_BELOW)
    edges = np.flatnonzero(np.diff(occluded.astype(np.int8), prepend=0, append=0))
    return [(first, end - 1) for first, end in edges.reshape(-1, 2).tolist()]


def recoveries(overlap: ArrayLike, visible_fraction: ArrayLike, time_s: ArrayLike) -> list[Recovery]:
    """Time after each occlusion until the overlap reaches `SUCCESS_OVERLAP` again.

    An occlusion that lasts to the end of the episode is left out.
    """
    values, visible, times = _columns(overlap=overlap, visible_fraction=visible_fraction, time_s=time_s)
    # The last frame lasts as long as a frame usually does.
    ends = np.append(times, times[-1] + np.median(np.diff(times))) if times.size > 1 else times
    spans = occlusions(visible)
    starts = [first for first, _ in spans] + [values.size]
    found: list[Recovery] = []
    for (_, last), end in zip(spans, starts[1:], strict=True):
        uncovered = last + 1
        if uncovered >= end:
            continue
        tracked = np.flatnonzero(values[uncovered:end] >= SUCCESS_OVERLAP)
        after = float(times[uncovered + tracked[0]] - times[uncovered]) if tracked.size else math.inf
        found.append(Recovery(after, float(ends[end] - times[uncovered])))
    return found


def recovered_within(found: Sequence[Recovery], limit_s: float) -> float:
    """Share of recoveries within a time; those censored before it are left out, NaN where none remains.

    >>> recovered_within([Recovery(0.5, 9.0), Recovery(math.inf, 9.0), Recovery(math.inf, 0.2)], 2.0)
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
    values, errors, counted, times = _columns(
        overlap=overlap, normalised_error=normalised_error, scored=scored, time_s=time_s
    )
    frames = np.flatnonzero(counted)
    lost = np.flatnonzero(values[frames] == 0.0)
    held = frames[: lost[0]] if lost.size else frames
    if held.size < 3:
        return math.nan
    slope, _ = np.polyfit(times[held], errors[held], 1)
    return float(slope)


def share_permanently_lost(overlap: ArrayLike, scored: ArrayLike) -> float:
    """Share of the scored frames after the last one with an overlap of at least `SUCCESS_OVERLAP`; NaN for no frames.

    >>> share_permanently_lost([0.9, 0.6, 0.1, 0.0], [True] * 4)
    0.5
    """
    values, counted = _columns(overlap=overlap, scored=scored)
    seen = values[np.flatnonzero(counted)]
    if not seen.size:
        return math.nan
    tracked = np.flatnonzero(seen >= SUCCESS_OVERLAP)
    return 1.0 - (float(tracked[-1]) + 1.0) / seen.size if tracked.size else 1.0


def _columns(**columns: ArrayLike) -> list[FloatArray]:
    """The columns as arrays of one number per frame."""
    found = [np.asarray(one, dtype=np.float64) for one in columns.values()]
    shapes = [one.shape for one in found]
    if found[0].ndim != 1 or len({*shapes}) > 1:
        raise ParameterError(f"{', '.join(columns)} must have one number per frame each, got shapes {shapes}")
    return found
