"""Everything that is measured of one tracker on one simulated episode."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.core.errors import ParameterError
from pftrack_sim.score.course import drift_per_second, failures, recoveries, share_lost_for_good
from pftrack_sim.score.curves import (
    area_under_success,
    normalised_centre_errors,
    normalised_precision,
    strict_success_rate,
)
from pftrack_sim.score.episode import Summary, centre_errors, overlaps, summarise


@dataclass(frozen=True)
class Measures(Summary):
    """Scores of one tracker on one episode; NaN where there is nothing to measure.

    Attributes:
        auc: Area under the success curve (Wu, Lim & Yang 2013).
        sr_50: Share of frames with an overlap of more than 0.5 (GOT-10k).
        sr_75: Share of frames with an overlap of more than 0.75 (GOT-10k).
        normalised_precision: Mean of the normalised precision curve (Müller et al. 2018).
        failures: How often the overlap falls to 0.
        occlusions: How many occlusions end within the episode.
        recovered: Share of these after which the target is tracked again, before the next one and the end.
        recovery_s: Mean time that it took, over those.
        drift_per_s: Slope of the centre error until the first failure, in box sizes per second.
        lost_for_good: Share of the frames after the last one in which the target was tracked.
        ms_p95: 95th percentile of the time for a frame.
    """

    auc: float
    sr_50: float
    sr_75: float
    normalised_precision: float
    failures: int
    occlusions: int
    recovered: float
    recovery_s: float
    drift_per_s: float
    lost_for_good: float
    ms_p95: float


@dataclass(frozen=True, eq=False)
class FrameScores:
    """Scores frame by frame.

    Attributes:
        overlap: `(N,)` 0 for a miss and where there is no truth.
        centre_error_px: `(N,)` infinite for a miss, NaN where there is no truth.
        normalised_error: `(N,)` the same in sizes of the true box.
    """

    overlap: NDArray[np.float64]
    centre_error_px: NDArray[np.float64]
    normalised_error: NDArray[np.float64]


def frame_scores(estimates: ArrayLike, truth: ArrayLike) -> FrameScores:
    """Every frame's scores.

    Args:
        estimates: `(N, 4)` boxes [px]; a row that is not finite is a miss.
        truth: `(N, 4)` boxes [px]; NaN or of no area where there is none.

    Raises:
        ParameterError: The shapes differ or are not `(N, 4)`.
    """
    return FrameScores(
        overlaps(estimates, truth), centre_errors(estimates, truth), normalised_centre_errors(estimates, truth)
    )


def measure(
    frames: FrameScores, scored: ArrayLike, visible_fraction: ArrayLike, ms: ArrayLike, rate_hz: float
) -> Measures:
    """Put an episode into one row.

    Args:
        frames: From `frame_scores`.
        scored: `(N,)` true where the target can be seen. The first of these frames is left out: its box was given.
        visible_fraction: `(N,)` in [0, 1].
        ms: `(N,)` time the tracker took.
        rate_hz: Frames per second.

    Raises:
        ParameterError: The lengths differ, or the rate is not positive.
    """
    if not rate_hz > 0.0:
        raise ParameterError(f"rate_hz must be positive, got {rate_hz!r}")
    summary = summarise(frames.overlap, frames.centre_error_px, scored, ms)
    counted = np.array(scored, dtype=np.bool_)
    seen = np.flatnonzero(counted)
    first = int(seen[0]) if seen.size else counted.size
    counted[: first + 1] = False
    overlap, took = frames.overlap[counted], np.asarray(ms, dtype=np.float64)[first + 1 :]
    # Before the tracker is started nothing can be lost, covered or found again.
    visible = np.asarray(visible_fraction, dtype=np.float64)[first:]
    after = recoveries(frames.overlap[first:], visible, rate_hz)
    found = [one.after_s for one in after if math.isfinite(one.after_s)]
    return Measures(
        **summary.as_dict(),  # pyright: ignore[reportArgumentType] - counts are counts there too
        auc=area_under_success(overlap),
        sr_50=strict_success_rate(overlap, 0.5),
        sr_75=strict_success_rate(overlap, 0.75),
        normalised_precision=normalised_precision(frames.normalised_error[counted]),
        failures=failures(frames.overlap, counted),
        occlusions=len(after),
        recovered=len(found) / len(after) if after else math.nan,
        recovery_s=float(np.mean(found)) if found else math.nan,
        drift_per_s=drift_per_second(frames.normalised_error, frames.overlap, counted, rate_hz),
        lost_for_good=share_lost_for_good(frames.overlap, counted),
        ms_p95=float(np.percentile(took, 95)) if took.size else math.nan,
    )
