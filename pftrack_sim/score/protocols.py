"""What the scorers of public benchmarks compute of boxes of one target: OTB, GOT-10k, VOT.

They differ from each other, and from `summarise`, in the frames they count, in how they clip boxes, and in means over
frames or over sequences. `docs/formats.md` has their numbers beside these.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from pftrack_sim.core.boxes import pairwise_iou
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.types import BoolArray, FloatArray
from pftrack_sim.score import curves
from pftrack_sim.score.frames import frame_scores

_FAILED, _GRACE = 0.1, 10
"""VOT's failure: so low an overlap in so many frames in a row."""


@dataclass(frozen=True, eq=False)
class TrackedSequence:
    """Boxes of one tracker on all images of one sequence.

    Attributes:
        estimates: `(N, 4)` boxes [px]; NaN rows are misses.
        truth: `(N, 4)` boxes [px]; NaN rows where the target is absent. The tracker was given the first finite one.
        image_size_px: Width and height of the images.
    """

    estimates: FloatArray
    truth: FloatArray
    image_size_px: tuple[int, int]

    def __post_init__(self) -> None:
        if self.estimates.shape != self.truth.shape or self.truth.ndim != 2 or self.truth.shape[1:] != (4,):
            raise ParameterError(
                f"estimates and truth must both be (N, 4), got {self.estimates.shape} and {self.truth.shape}"
            )
        if not self.present.any():
            raise ParameterError("no frame has a true box")

    @property
    def present(self) -> BoolArray:
        """`(N,)` whether the target has a box."""
        return np.asarray(np.isfinite(self.truth).all(axis=1))

    @property
    def first(self) -> int:
        """Frame in which the tracker was given the box."""
        return int(np.argmax(self.present))


def otb(sequences: Sequence[TrackedSequence]) -> dict[str, float]:
    """Success and precision (Wu, Lim & Yang 2013): each the mean of the sequences, all of whose frames count.

    The box that the tracker was given counts as an estimate; frames without a true box count as missed.

    Returns:
        `success`: area under the success curve of 21 thresholds; `precision`: share of frames with a centre error of
        at most 20 px; `success_50`: share of frames with an overlap of more than 0.5.
    """
    rows: list[tuple[float, float, float]] = []
    for one in sequences:
        estimates = np.array(one.estimates)
        estimates[one.first] = one.truth[one.first]
        frames = frame_scores(estimates, one.truth)
        area, precise = curves.area_under_success(frames.overlap), curves.precision(frames.centre_error_px)
        rows.append((area, precise, float(curves.success_curve(frames.overlap, [curves.SUCCESS_OVERLAP])[0])))
    return _named(("success", "precision", "success_50"), np.mean(rows, axis=0))


def got10k(sequences: Sequence[TrackedSequence]) -> dict[str, float]:
    """Average overlap and success rates (Huang, Zhao & Huang 2019) over the frames of all sequences together.

    Both boxes are clipped to the image; the first image and frames without a true box are left out.

    Returns:
        `ao`: mean overlap; `sr_50`, `sr_75`: share of frames with an overlap of more than 0.5 and 0.75.
    """
    parts: list[FloatArray] = []
    for one in sequences:
        counted = one.present
        counted[0] = False
        truth = _clipped(one.truth[counted], one.image_size_px)
        parts.append(pairwise_iou(_clipped(one.estimates[counted], one.image_size_px), truth))
    overlap = np.concatenate(parts)
    rates = curves.success_curve(overlap, curves.STRICT_OVERLAPS)
    return _named(("ao", "sr_50", "sr_75"), [curves.average_overlap(overlap), *rates])


def vot(sequences: Sequence[TrackedSequence]) -> dict[str, float]:
    """Accuracy and robustness without resets, as the VOT toolkit computes them (Kristan et al. 2022, 2023).

    Returns:
        `accuracy`: mean overlap from the frame after the initialisation on, weighted by the sequences' lengths; a miss
        of an absent target has overlap 1 (analysis `average_accuracy` with burn-in 1).
        `tracked_accuracy`: mean overlap of the frames with an overlap of more than 0, and of the first one, which has
        overlap 0 there; `robustness`: share of the frames with a true box in which the overlap is more than 0, the
        first one never being one (analysis `longterm.AccuracyRobustness`). Each is the mean of the sequences.
    """
    accuracy: list[float] = []
    tracked: list[float] = []
    robust: list[float] = []
    for one in sequences:
        overlap = raster_overlaps(one.estimates, one.truth, one.image_size_px)
        after = overlap[one.first + 1 :]
        accuracy.append(float(after.mean()) if after.size else 0.0)
        overlap[one.first] = 0.0
        hit = one.present & (overlap > 0.0)
        robust.append(float(hit.sum() / one.present.sum()))
        hit[one.first] = True
        tracked.append(float(overlap[hit].mean()))
    weights = [len(one.truth) for one in sequences]
    values = [float(np.average(accuracy, weights=weights)), float(np.mean(tracked)), float(np.mean(robust))]
    return _named(("accuracy", "tracked_accuracy", "robustness"), values)


def from_anchors(sequences: Sequence[Sequence[FloatArray]], lengths: tuple[int, int]) -> dict[str, float]:
    """Accuracy, robustness and expected average overlap of runs from anchors (VOT 2020), as the VOT toolkit has them.

    A run fails where the overlap is 0.1 or less in ten frames in a row. The expected average overlap at a length is the
    mean over the runs that are longer or have failed, whose further overlaps are 0.

    Args:
        sequences: For each sequence the `(N,)` overlaps of each run; the first one, of the box given, counts as 0.
        lengths: Least length [frames] over which expected average overlaps are averaged, and the first one beyond.

    Returns:
        `accuracy`: mean overlap until the failures; `robustness`: share of the frames until them; `eao`.
    """
    accuracy: list[tuple[float, int]] = []
    robustness: list[tuple[float, int]] = []
    curves: list[FloatArray] = []
    for runs in sequences:
        frames = [_until_failure(overlap) for overlap in runs]
        hits = [np.where(np.arange(one.size) < end, one, 0.0)[1:] for one, end in zip(runs, frames, strict=True)]
        tracked, shown = sum(frames), sum(one.size for one in runs)
        accuracy.append((sum(float(one.sum()) for one in hits) / max(tracked, 1), tracked))
        robustness.append((tracked / shown, max(one.size for one in runs)))
        for one, end in zip(hits, frames, strict=True):
            curve = np.full(max(lengths[1], one.size + 1), np.nan)
            curve[1 : one.size + 1] = one.cumsum() / np.arange(1, one.size + 1)
            if end <= one.size:  # the toolkit counts one frame less in the length of what it adds to failed runs
                curve[one.size + 1 :] = one.sum() / np.arange(one.size, curve.size - 1)
            curves.append(curve[slice(*lengths)])
    known = np.isfinite(curves)
    expected = np.where(known, curves, 0.0).sum(axis=0) / known.sum(axis=0).clip(min=1)
    return _named(("accuracy", "robustness", "eao"), [_weighted(accuracy), _weighted(robustness), expected.mean()])


def _weighted(pairs: Sequence[tuple[float, int]]) -> float:
    """Mean of values by their weights; 0 where all weights are."""
    return sum(value * weight for value, weight in pairs) / max(sum(weight for _, weight in pairs), 1)


def _until_failure(overlap: FloatArray) -> int:
    """Number of frames before the first ten in a row with an overlap of 0.1 or less, or of all."""
    low = np.concatenate([[True], overlap[1:] <= _FAILED])
    if low.size < _GRACE:
        return low.size
    failed = sliding_window_view(low, _GRACE).all(axis=1)
    return int(np.argmax(failed)) if failed.any() else low.size


def raster_overlaps(first: FloatArray, second: FloatArray, image_size_px: tuple[int, int]) -> FloatArray:
    """Overlaps of the pixels of boxes, as the VOT toolkit counts them.

    Every number of a box is rounded to a whole one in single precision, halves to even; a box covers the pixels
    x to x + w - 1 that lie in the image. Where the pixels of both boxes span less than two columns or rows, the
    overlap is 1, or 0 if they do so only inside the image.

    Args:
        first: `(N, 4)` boxes [px]; NaN rows are boxes without pixels.
        second: `(N, 4)` boxes [px], in the same way.
        image_size_px: Width and height.

    Returns:
        `(N,)` in [0, 1].
    """
    ends = [_pixel_ends(one) for one in (first, second)]
    low = np.minimum(ends[0][0], ends[1][0])
    high = np.maximum(ends[0][1], ends[1][1])
    last = np.array(image_size_px) - 1.0
    seen_low, seen_high = np.maximum(low, 0.0), np.minimum(high, last)
    inside = [(np.maximum(start, 0.0), np.minimum(end, last)) for start, end in ends]
    areas = [_pixels(*one) for one in inside]
    inner = _pixels(np.maximum(inside[0][0], inside[1][0]), np.minimum(inside[0][1], inside[1][1]))
    # A box without pixels shares none, wherever it is.
    inner[(areas[0] == 0.0) | (areas[1] == 0.0)] = 0.0
    union = areas[0] + areas[1] - inner
    overlap = np.divide(inner, union, out=np.zeros_like(inner), where=union > 0.0)
    overlap[(seen_low >= seen_high).any(axis=1)] = 0.0
    overlap[(low >= high).any(axis=1)] = 1.0
    return overlap


def _pixel_ends(boxes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """`(N, 2)` first and last pixel across and down."""
    whole = np.round(np.nan_to_num(boxes, nan=0.0).astype(np.float32)).astype(np.float64)
    return whole[:, :2], whole[:, :2] + whole[:, 2:] - 1.0


def _pixels(start: FloatArray, end: FloatArray) -> FloatArray:
    return np.clip(end - start + 1.0, 0.0, None).prod(axis=1)


def _clipped(boxes: FloatArray, image_size_px: tuple[int, int]) -> FloatArray:
    """Boxes of which corner and size are clipped apart, as GOT-10k's scorer does: a corner outside moves the box."""
    size = np.array(image_size_px, dtype=np.float64)
    corner = np.clip(boxes[:, :2], 0.0, size)
    return np.concatenate([corner, np.clip(boxes[:, 2:], 0.0, size - corner)], axis=1)


def _named(names: Sequence[str], values: Sequence[float] | FloatArray) -> dict[str, float]:
    return dict(zip(names, map(float, values), strict=True))


PROTOCOLS = {"otb": otb, "lasot": otb, "got10k": got10k, "vot": vot}
"""Scorers by layout."""
