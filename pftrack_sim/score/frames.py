"""Scores of single frames: overlap and centre errors of estimated boxes against true boxes.

What a mean overlap is compared with follows from the true boxes alone: a box that stays, and a box that keeps its
shape, as that of many trackers does. The true box of a walking person does not keep its shape: seen from the side its
width follows the stride (Milan et al. 2016, "MOT16", annotation rules).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.core import boxes
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.types import BoolArray, FloatArray, IntArray
from pftrack_sim.score.curves import SUCCESS_OVERLAP

_SAME_S = 1e-6  # Times that differ by less are the same


@dataclass(frozen=True, eq=False)
class FrameScores:
    """Scores of one tracker, one number per frame.

    Attributes:
        overlap: `(N,)` intersection over union (Ko et al. 2012, eq. 14); 0 for a miss and where there is no truth.
        centre_error_px: `(N,)` distance between the centres; infinite for a miss, NaN where there is no truth.
        normalised_error: `(N,)` the same in units of the true width across and the true height down (Müller et al.
            2018, eq. 2); NaN also where the true box has no area.
        centre_inside: `(N,)` whether the centre of the estimate lies inside the true box.
        truth: `(N, 4)` the true boxes [px].
    """

    overlap: FloatArray
    centre_error_px: FloatArray
    normalised_error: FloatArray
    centre_inside: BoolArray
    truth: FloatArray


def frame_scores(estimates: ArrayLike, truth: ArrayLike) -> FrameScores:
    """Scores of `(N, 4)` estimated boxes [px], where a row that is not finite is a miss.

    True boxes are `(N, 4)`, NaN or of zero area where the target is out of view.

    Raises:
        ParameterError: The shapes differ or are not `(N, 4)`.
    """
    estimated, true = np.asarray(estimates, dtype=np.float64), np.asarray(truth, dtype=np.float64)
    if estimated.shape != true.shape or estimated.ndim != 2 or estimated.shape[1] != 4:
        raise ParameterError(f"estimates and truth must both have shape (N, 4), got {estimated.shape} and {true.shape}")
    shift = boxes.centre(estimated) - boxes.centre(true)
    size, hit = true[:, 2:], np.isfinite(estimated).all(axis=1)
    known = np.asarray(np.isfinite(true).all(axis=1))
    has_area = np.asarray(known & (size > 0.0).all(axis=1))

    def distances(unit: FloatArray, counted: BoolArray) -> FloatArray:
        errors = np.where(counted, math.inf, math.nan)
        both = counted & hit
        errors[both] = np.hypot(*(shift[both] / unit[both]).T)
        return errors

    # NaN compares as false: a miss is not inside, nor is anything inside an unknown box.
    inside = np.asarray((np.abs(shift) <= 0.5 * size).all(axis=1) & has_area)
    overlap = boxes.pairwise_iou(estimated, true)
    return FrameScores(overlap, distances(np.ones_like(size), known), distances(size, has_area), inside, true)


def first_scored(scored: ArrayLike) -> int:
    """Index of the first frame in which the target can be seen: its box is given; the number of frames if none is."""
    visible = np.flatnonzero(np.asarray(scored, dtype=np.bool_))
    return int(visible[0]) if visible.size else np.size(scored)


def counted_frames(scored: ArrayLike) -> BoolArray:
    """`(N,)` the scored frames except the first one, whose box was given."""
    counted = np.array(scored, dtype=np.bool_)
    counted[: first_scored(counted) + 1] = False
    return counted


def stay_overlaps(truth: ArrayLike, scored: ArrayLike) -> FloatArray:
    """`(N,)` overlap of the first scored box with the truth of every frame.

    Args:
        truth: `(N, 4)` boxes on which overlap is scored [px]; NaN or of zero area where the target is out of view.
        scored: `(N,)` true where the target can be seen.

    Raises:
        ParameterError: The shapes do not fit.
    """
    true, first = _truth_and_first(truth, scored)
    return boxes.pairwise_iou(first, true)


def fixed_size_overlaps(truth: ArrayLike, scored: ArrayLike) -> FloatArray:
    """`(N,)` overlap of a box about the true centre, with the width and height of the first scored one, in every frame.

    No tracker with a box of this size reaches more: of all boxes of one size, the one about the true centre has the
    largest intersection with the true box. Arguments and errors are those of `stay_overlaps`.

    >>> fixed_size_overlaps([[0, 0, 10, 20], [5, 0, 10, 20], [8, 0, 40, 20]], [True, True, True]).tolist()
    [1.0, 1.0, 0.25]
    """
    true, first = _truth_and_first(truth, scored)
    corners = true[:, :2] + 0.5 * (true[:, 2:] - first[2:])
    return boxes.pairwise_iou(np.concatenate([corners, np.broadcast_to(first[2:], corners.shape)], axis=1), true)


FIRST_FRAMES = 10
"""Frames by which it is judged how boxes are meant."""

_READINGS: Mapping[str, Callable[[FloatArray, FloatArray], FloatArray]] = MappingProxyType(
    {
        "corners x1, y1, x2, y2": lambda box, _: np.hstack([box[:, :2], box[:, 2:] - box[:, :2]]),
        "centre x, centre y, w, h": lambda box, _: np.hstack([box[:, :2] - 0.5 * box[:, 2:], box[:, 2:]]),
        "y, x, h, w": lambda box, _: box[:, [1, 0, 3, 2]],
        "shares of the image's sides": lambda box, size: box * np.tile(size, 2),
    }
)


def misread_boxes(estimates: ArrayLike, truth: ArrayLike, size: tuple[float, float]) -> str | None:
    """A sentence if the first estimates fit the truth far better when they are not read as x, y, w, h.

    Args:
        estimates: `(N, 4)` what a tracker answered [px], NaN where it did not.
        truth: `(N, 4)` true boxes [px], NaN where they are unknown.
        size: Width and height of the images [px].
    """
    said, true = np.asarray(estimates, dtype=np.float64), np.asarray(truth, dtype=np.float64)
    first = np.flatnonzero(np.isfinite(said).all(axis=1) & np.isfinite(true).all(axis=1))[:FIRST_FRAMES]
    if not first.size:
        return None
    own = float(boxes.pairwise_iou(said[first], true[first]).mean())
    with np.errstate(over="ignore", invalid="ignore"):  # 1e308 is finite and a difference of two such is not
        others = {
            name: float(boxes.pairwise_iou(read(said[first], np.array(size)), true[first]).mean())
            for name, read in _READINGS.items()
        }
    best = max(others, key=others.__getitem__)
    if others[best] < SUCCESS_OVERLAP or others[best] < 2.0 * own:
        return None
    return (
        f"its first boxes overlap the truth by {others[best]:.2f} if they are {best}, and by {own:.2f} as x, y, w, h, "
        "which update must return: convert them"
    )


def _truth_and_first(truth: ArrayLike, scored: ArrayLike) -> tuple[FloatArray, FloatArray]:
    true = np.asarray(truth, dtype=np.float64)
    if true.ndim != 2 or true.shape[1] != 4 or np.shape(scored) != true.shape[:1]:
        raise ParameterError(f"truth must be (N, 4) and scored (N,), got {true.shape} and {np.shape(scored)}")
    first = first_scored(scored)
    return true, true[first] if first < len(true) else boxes.NO_BOX


@dataclass(frozen=True, eq=False)
class Arm:
    """One tracker's episode at one severity, `(N,)` each.

    Attributes:
        time_s: Rising times of the frames that the tracker received.
        overlap: Its overlap in each.
        counted: Whether the frame is scored.
    """

    time_s: FloatArray
    overlap: FloatArray
    counted: BoolArray


def overlaps_on_common_frames(arms: Sequence[Arm], from_s: float = 0.0) -> FloatArray:
    """`(A,)` mean overlap of every arm over the times at which the target is scored in all of them; NaN where none is.

    A harder condition cannot gain by showing fewer frames. The arms are episodes of one scenario and seed; times before
    `from_s` are left out. The times are those of the arm with the most frames. Between two frames an arm keeps the
    frame before: where frames are lost, the overlap of a delivered frame counts for as long as it is the last one.
    """
    times = max((arm.time_s for arm in arms), key=len)
    times = times[times >= from_s - _SAME_S]
    rows: list[IntArray] = [np.searchsorted(arm.time_s, times + _SAME_S) - 1 for arm in arms]
    common = np.ones(len(times), dtype=np.bool_)
    for arm, row in zip(arms, rows, strict=True):
        # After the end of an episode nothing is held; frames lost at its end are like those lost before.
        gap_s = float(np.max(np.diff(arm.time_s))) if len(arm.time_s) > 1 else 0.0
        common &= (row >= 0) & arm.counted[row] & (times <= arm.time_s[-1] + gap_s)
    if not common.any():
        return np.full(len(arms), np.nan)
    return np.array([float(arm.overlap[row[common]].mean()) for arm, row in zip(arms, rows, strict=True)])
