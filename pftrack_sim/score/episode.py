"""Scores of one tracker on one episode or sequence, in one row.

Frames where the target cannot be seen are not scored (Ko et al. 2012, section 4), nor is the first visible frame: its
box was given to the tracker.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, fields, replace

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.types import FloatArray
from pftrack_sim.score import curves, events
from pftrack_sim.score.frames import (
    FrameScores,
    counted_frames,
    first_scored,
    fixed_size_overlaps,
    stay_overlaps,
)

RECOVERY_S = 2.0  # Time within which a tracker is to have recovered


@dataclass(frozen=True)
class Summary:
    """Scores of one tracker on one sequence; NaN where no frame is scored.

    Attributes:
        frames: Number of scored frames.
        mean_overlap: Mean overlap (Ko et al. 2012, table 2).
        stay: Mean overlap of the first box in every frame, on the same frames.
        success: Share of frames with an overlap of at least `SUCCESS_OVERLAP`.
        success_30: The same with `LOOSE_OVERLAP`.
        centre_inside: Share of frames in which the centre of the estimate lies inside the true box.
        fixed_size: Highest `success` of a box with the size of the first one, see `frames.fixed_size_overlaps`.
        precision: Share of frames with a centre error of at most `PRECISION_PX`.
        centre_error_median_px: Median centre error; infinite when the tracker missed most frames.
        ms_median: Median time of the frames in which the tracker answered, without that of the initialisation.
        ms_max: Longest of these times.
        ms_max_frame: Index of the frame that took it; NaN where there is none.
        ms_reported: `ms_median` as a tracker in a process of its own says; NaN for others.
    """

    frames: int
    mean_overlap: float
    stay: float
    success: float
    success_30: float
    centre_inside: float
    fixed_size: float
    precision: float
    centre_error_median_px: float
    ms_median: float
    ms_max: float
    ms_max_frame: float
    ms_reported: float = field(default=math.nan, kw_only=True)

    @property
    def skill(self) -> float:
        """`mean_overlap` relative to `stay`: 0 for equal, 1 for perfect; NaN where `stay` is 1."""
        return (self.mean_overlap - self.stay) / (1.0 - self.stay) if self.stay < 1.0 else math.nan


@dataclass(frozen=True)
class Measures(Summary):
    """Scores of one tracker on one simulated episode; NaN where a measure is undefined.

    Attributes:
        auc: Area under the success curve (Wu, Lim & Yang 2013).
        sr_50: Share of frames with an overlap of more than 0.5 (GOT-10k).
        sr_75: Share of frames with an overlap of more than 0.75 (GOT-10k).
        normalised_precision: Mean of the normalised precision curve (Müller et al. 2018).
        occlusions: Number of occlusions that end within the episode.
        recovered: Share of these after which the target is tracked again before the next one or the end.
        recovered_2s: Share of the occlusions after which it is tracked again within 2 s; those followed by another one
            or the end before that are left out, unless it is tracked by then.
        recovery_s: Mean time of all recoveries.
        drift_per_s: Slope of the normalised centre error until the first failure [box sizes/s].
        lost_for_good: Share of the scored frames after the last tracked one.
        ms_p95: 95th percentile of the time per frame.
    """

    auc: float
    sr_50: float
    sr_75: float
    normalised_precision: float
    occlusions: int
    recovered: float
    recovered_2s: float
    recovery_s: float
    drift_per_s: float
    lost_for_good: float
    ms_p95: float


def summarise(frames: FrameScores, scored: ArrayLike, ms: ArrayLike) -> Summary:
    """Summary of one sequence.

    Args:
        frames: From `frame_scores`.
        scored: `(N,)` true where the target can be seen; the first of these frames is not scored.
        ms: `(N,)` time the tracker took for each frame; NaN where it did not answer.

    Raises:
        ParameterError: The lengths differ.
    """
    took = np.asarray(ms, dtype=np.float64)
    if took.shape != frames.overlap.shape or np.shape(scored) != took.shape:
        raise ParameterError(
            f"scored and ms must have one number for each of {frames.overlap.size} frames, got {np.shape(scored)} "
            f"and {took.shape}"
        )
    counted = counted_frames(scored)
    overlap, error = frames.overlap[counted], frames.centre_error_px[counted]
    answered = first_scored(scored) + 1 + np.flatnonzero(~np.isnan(took[first_scored(scored) + 1 :]))
    slowest = float(answered[np.argmax(took[answered])]) if answered.size else math.nan
    return Summary(
        frames=int(counted.sum()),
        mean_overlap=curves.average_overlap(overlap),
        stay=curves.average_overlap(stay_overlaps(frames.truth, scored)[counted]),
        success=curves.success_rate(overlap),
        success_30=curves.success_rate(overlap, curves.LOOSE_OVERLAP),
        centre_inside=curves.average_overlap(frames.centre_inside[counted]),
        fixed_size=curves.success_rate(fixed_size_overlaps(frames.truth, scored)[counted]),
        precision=curves.precision(error),
        centre_error_median_px=_median(error),
        ms_median=_median(took[answered]),
        ms_max=float(took[int(slowest)]) if answered.size else math.nan,
        ms_max_frame=slowest,
    )


def mean_summary(summaries: Sequence[Summary]) -> Summary:
    """Means over at least one episode, without NaN; the sum of the frames, the longest time, and no frame that took it.

    `skill` is that of the means.
    """
    names = [one.name for one in fields(Summary) if one.name != "frames"]
    means = {name: _mean([float(getattr(summary, name)) for summary in summaries]) for name in names}
    longest = max((one.ms_max for one in summaries if not math.isnan(one.ms_max)), default=math.nan)
    frames = sum(one.frames for one in summaries)
    return replace(Summary(frames=frames, **means), ms_max=longest, ms_max_frame=math.nan)


def measure(
    frames: FrameScores, scored: ArrayLike, visible_fraction: ArrayLike, ms: ArrayLike, time_s: ArrayLike
) -> Measures:
    """All measures of one simulated episode, with `frames`, `scored` and `ms` as for `summarise`.

    Args:
        frames: Scores of its N frames.
        scored: `(N,)` frames in which the target can be seen.
        visible_fraction: `(N,)` in [0, 1].
        ms: `(N,)` time the tracker took for each frame; NaN where it did not answer.
        time_s: `(N,)` rising times of the frames.

    Raises:
        ParameterError: The lengths differ, or the times do not rise.
    """
    times = np.asarray(time_s, dtype=np.float64)
    if times.shape != frames.overlap.shape or (np.diff(times) <= 0.0).any():
        raise ParameterError(f"time_s must be {frames.overlap.size} rising numbers, got shape {times.shape}")
    summary = summarise(frames, scored, ms)
    first, counted = first_scored(scored), counted_frames(scored)
    overlap, took = frames.overlap[counted], _known(np.asarray(ms, dtype=np.float64)[first + 1 :])
    # Before the initialisation there is no occlusion to recover from.
    visible = np.asarray(visible_fraction, dtype=np.float64)[first:]
    recoveries = events.recoveries(frames.overlap[first:], visible, times[first:])
    sr_50, sr_75 = curves.success_curve(overlap, curves.STRICT_OVERLAPS).tolist()
    recovered_s = [recovery.after_s for recovery in recoveries if math.isfinite(recovery.after_s)]
    return Measures(
        **asdict(summary),
        auc=curves.area_under_success(overlap),
        sr_50=sr_50,
        sr_75=sr_75,
        normalised_precision=curves.normalised_precision(frames.normalised_error[counted]),
        occlusions=len(recoveries),
        recovered=len(recovered_s) / len(recoveries) if recoveries else math.nan,
        recovered_2s=events.recovered_within(recoveries, RECOVERY_S),
        recovery_s=float(np.mean(recovered_s)) if recovered_s else math.nan,
        drift_per_s=events.drift_per_second(frames.normalised_error, frames.overlap, counted, times),
        lost_for_good=events.share_permanently_lost(frames.overlap, counted),
        ms_p95=float(np.percentile(took, 95)) if took.size else math.nan,
    )


def _mean(values: Sequence[float]) -> float:
    known = [value for value in values if not math.isnan(value)]
    return sum(known) / len(known) if known else math.nan


def _known(values: FloatArray) -> FloatArray:
    return values[~np.isnan(values)]


def _median(values: FloatArray) -> float:
    return float(np.median(values)) if values.size else math.nan
