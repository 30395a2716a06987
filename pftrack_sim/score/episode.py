"""Scores of one tracker on one episode or sequence, in one row.

Frames where the target cannot be seen are not scored (Ko et al. 2012, section 4), nor is the first visible frame: its
box was given to the tracker.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.types import BoolArray, FloatArray
from pftrack_sim.score import curves, events
from pftrack_sim.score.frames import FrameScores


@dataclass(frozen=True)
class Summary:
    """Scores of one tracker on one sequence; NaN where no frame is scored.

    Attributes:
        frames: Number of scored frames.
        mean_overlap: Mean overlap (Ko et al. 2012, table 2).
        success: Share of frames with an overlap of at least `SUCCESS_OVERLAP`.
        precision: Share of frames with a centre error of at most `PRECISION_PX`.
        centre_error_median_px: Median centre error; infinite when the tracker missed most frames.
        ms_median: Median time per frame, without the frame of the initialisation.
    """

    frames: int
    mean_overlap: float
    success: float
    precision: float
    centre_error_median_px: float
    ms_median: float

    def as_dict(self) -> dict[str, float]:
        """Fields by name."""
        return asdict(self)


@dataclass(frozen=True)
class Measures(Summary):
    """Scores of one tracker on one simulated episode; NaN where a measure is undefined.

    Attributes:
        auc: Area under the success curve (Wu, Lim & Yang 2013).
        sr_50: Share of frames with an overlap of more than 0.5 (GOT-10k).
        sr_75: Share of frames with an overlap of more than 0.75 (GOT-10k).
        normalised_precision: Mean of the normalised precision curve (Müller et al. 2018).
        failures: Number of times the overlap falls to 0.
        occlusions: Number of occlusions that end within the episode.
        recovered: Share of these after which the target is tracked again before the next one or the end.
        recovery_s: Mean time of these recoveries.
        drift_per_s: Slope of the normalised centre error until the first failure [box sizes/s].
        lost_for_good: Share of the scored frames after the last tracked one.
        ms_p95: 95th percentile of the time per frame.
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


def summarise(overlap: ArrayLike, centre_error: ArrayLike, scored: ArrayLike, ms: ArrayLike) -> Summary:
    """Summary of one sequence.

    Args:
        overlap: `(N,)` overlaps.
        centre_error: `(N,)` centre errors [px].
        scored: `(N,)` true where the target can be seen; the first of these frames is not scored.
        ms: `(N,)` time the tracker took for each frame.

    Raises:
        ParameterError: The lengths differ.
    """
    columns = [np.asarray(column, dtype=np.float64) for column in (overlap, centre_error, ms)]
    counted = np.array(scored, dtype=np.bool_)
    if any(column.shape != counted.shape or column.ndim != 1 for column in columns):
        shapes = ", ".join(str(column.shape) for column in (*columns[:2], counted, columns[2]))
        raise ParameterError(f"overlap, centre_error, scored and ms must have one number per frame, got {shapes}")
    first = _first_visible(counted)
    counted[: first + 1] = False
    scored_overlap, scored_error, took = columns[0][counted], columns[1][counted], columns[2][first + 1 :]
    return Summary(
        frames=int(counted.sum()),
        mean_overlap=curves.average_overlap(scored_overlap),
        success=curves.success_rate(scored_overlap),
        precision=curves.precision(scored_error),
        centre_error_median_px=_median(scored_error),
        ms_median=_median(took),
    )


def measure(
    frames: FrameScores, scored: ArrayLike, visible_fraction: ArrayLike, ms: ArrayLike, time_s: ArrayLike
) -> Measures:
    """All measures of one simulated episode.

    Args:
        frames: From `frame_scores`.
        scored: `(N,)` true where the target can be seen; the first of these frames is not scored.
        visible_fraction: `(N,)` in [0, 1].
        ms: `(N,)` time the tracker took for each frame.
        time_s: `(N,)` rising times of the frames.

    Raises:
        ParameterError: The lengths differ, or the times do not rise.
    """
    times = np.asarray(time_s, dtype=np.float64)
    if times.shape != frames.overlap.shape or (np.diff(times) <= 0.0).any():
        raise ParameterError(f"time_s must be {frames.overlap.size} rising numbers, got shape {times.shape}")
    summary = summarise(frames.overlap, frames.centre_error_px, scored, ms)
    counted = np.array(scored, dtype=np.bool_)
    first = _first_visible(counted)
    counted[: first + 1] = False
    overlap, took = frames.overlap[counted], np.asarray(ms, dtype=np.float64)[first + 1 :]
    # Before the initialisation there is no occlusion to recover from.
    visible = np.asarray(visible_fraction, dtype=np.float64)[first:]
    recoveries = events.recoveries(frames.overlap[first:], visible, times[first:])
    recovered_s = [recovery.after_s for recovery in recoveries if math.isfinite(recovery.after_s)]
    return Measures(
        frames=summary.frames,
        mean_overlap=summary.mean_overlap,
        success=summary.success,
        precision=summary.precision,
        centre_error_median_px=summary.centre_error_median_px,
        ms_median=summary.ms_median,
        auc=curves.area_under_success(overlap),
        sr_50=curves.strict_success_rate(overlap, 0.5),
        sr_75=curves.strict_success_rate(overlap, 0.75),
        normalised_precision=curves.normalised_precision(frames.normalised_error[counted]),
        failures=events.failures(frames.overlap, counted),
        occlusions=len(recoveries),
        recovered=len(recovered_s) / len(recoveries) if recoveries else math.nan,
        recovery_s=float(np.mean(recovered_s)) if recovered_s else math.nan,
        drift_per_s=events.drift_per_second(frames.normalised_error, frames.overlap, counted, times),
        lost_for_good=events.share_permanently_lost(frames.overlap, counted),
        ms_p95=float(np.percentile(took, 95)) if took.size else math.nan,
    )


def _first_visible(scored: BoolArray) -> int:
    visible = np.flatnonzero(scored)
    return int(visible[0]) if visible.size else scored.size


def _median(values: FloatArray) -> float:
    return float(np.median(values)) if values.size else math.nan
