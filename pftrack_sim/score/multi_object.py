"""Scores of tracks of several persons: HOTA, IDF1 and MOTA.

HOTA: Luiten et al. 2021, "HOTA: A Higher Order Metric for Evaluating Multi-Object Tracking". IDF1: Ristani et al.
2016, "Performance Measures and a Data Set for Multi-Target, Multi-Camera Tracking". MOTA: Bernardin & Stiefelhagen
2008, "Evaluating Multiple Object Tracking Performance: The CLEAR MOT Metrics". Where these leave a choice it is
TrackEval's, so that its numbers result (`docs/formats.md`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy  # it imports its packages at first use
from numpy.typing import NDArray

from pftrack_sim.core.boxes import pairwise_iou
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.types import FloatArray

ALPHAS = np.arange(0.05, 0.99, 0.05)
"""`(19,)` overlaps at which HOTA matches boxes."""
_MATCH = 0.5
"""Overlap from which IDF1 and MOTA match boxes."""
_KEPT = 1000.0
"""Weight of a match of the previous frame over any overlap, in MOTA's assignment."""
_TINY = float(np.finfo(np.float64).eps)

Identities = NDArray[np.intp]
Frames = Sequence[tuple[Identities, Identities, FloatArray]]
"""True identities, estimated ones, and the overlaps of all pairs, frame by frame."""


@dataclass(frozen=True, eq=False)
class Tracks:
    """Boxes with identities in one sequence.

    Attributes:
        frames: `(M,)` index of each box's frame.
        identities: `(M,)` whole numbers; one person has one throughout. At most one box of each in a frame.
        boxes: `(M, 4)` boxes [px].
    """

    frames: NDArray[np.int64]
    identities: NDArray[np.int64]
    boxes: FloatArray

    def __post_init__(self) -> None:
        count = len(self.frames)
        if self.frames.shape != (count,) or self.identities.shape != (count,) or self.boxes.shape != (count, 4):
            raise ParameterError(
                "frames, identities and boxes must be (M,), (M,) and (M, 4), got "
                f"{self.frames.shape}, {self.identities.shape} and {self.boxes.shape}"
            )
        pairs, counts = np.unique(np.stack([self.frames, self.identities], axis=1), axis=0, return_counts=True)
        if (counts > 1).any():
            frame, identity = pairs[int(np.argmax(counts))].tolist()
            raise ParameterError(f"identity {identity} has {int(counts.max())} boxes in frame {frame}")


@dataclass
class _Counts:
    """Sums over all sequences."""

    matches: FloatArray = field(default_factory=lambda: np.zeros(len(ALPHAS)))
    association: FloatArray = field(default_factory=lambda: np.zeros(len(ALPHAS)))
    truths: int = 0
    estimates: int = 0
    clear_matches: int = 0
    switches: int = 0
    same_identity: int = 0


def multi_object(sequences: Sequence[tuple[Tracks, Tracks]]) -> dict[str, float]:
    """HOTA, IDF1 and MOTA of pairs of true and estimated tracks, the counts of all sequences taken together.

    Returns:
        `hota`, `deta`, `assa` (means over `ALPHAS`), `idf1`, `mota`, and the numbers `switches`, `missed` and
        `false_alarms` at an overlap of 0.5.
    """
    counts = _Counts()
    for truth, estimates in sequences:
        counts.truths += len(truth.frames)
        counts.estimates += len(estimates.frames)
        if len(truth.frames) and len(estimates.frames):
            _add(counts, truth, estimates)
    detection = counts.matches / np.maximum(1.0, counts.truths + counts.estimates - counts.matches)
    association = counts.association / np.maximum(1.0, counts.matches)
    lost, false = counts.truths - counts.clear_matches, counts.estimates - counts.clear_matches
    return {
        "hota": float(np.mean(np.sqrt(detection * association))),
        "deta": float(np.mean(detection)),
        "assa": float(np.mean(association)),
        "idf1": 2.0 * counts.same_identity / max(1, counts.truths + counts.estimates),
        "mota": (counts.clear_matches - false - counts.switches) / max(1, counts.truths),
        "switches": float(counts.switches),
        "missed": float(lost),
        "false_alarms": float(false),
    }


def _add(counts: _Counts, truth: Tracks, estimates: Tracks) -> None:
    """Add one sequence with boxes on both sides."""
    true_places, places = (np.unique(one.identities, return_inverse=True)[1] for one in (truth, estimates))
    frames: list[tuple[Identities, Identities, FloatArray]] = []
    for frame in np.unique(np.concatenate([truth.frames, estimates.frames])).tolist():
        here, there = truth.frames == frame, estimates.frames == frame
        overlaps = pairwise_iou(truth.boxes[here][:, None], estimates.boxes[there])
        frames.append((true_places[here], places[there], overlaps))
    of_true, of_estimated = np.bincount(true_places), np.bincount(places)
    _add_hota(counts, frames, of_true, of_estimated)
    _add_identities(counts, frames, (len(of_true), len(of_estimated)))
    _add_clear(counts, frames, len(of_true))


def _add_hota(counts: _Counts, frames: Frames, of_true: Identities, of_estimated: Identities) -> None:
    """HOTA: boxes are matched so that identities agree best over the whole sequence, then by overlap."""
    either = of_true[:, None] + of_estimated[None, :]
    aligned = np.zeros(either.shape)
    for mine, theirs, overlap in frames:
        total = overlap.sum(axis=0, keepdims=True) + overlap.sum(axis=1, keepdims=True) - overlap
        shared = np.divide(overlap, total, out=np.zeros_like(overlap), where=total > _TINY)
        aligned[np.ix_(mine, theirs)] += shared
    alignment = aligned / (either - aligned)
    together = np.zeros((len(ALPHAS), *either.shape))
    for mine, theirs, overlap in frames:
        rows, columns = scipy.optimize.linear_sum_assignment(-alignment[np.ix_(mine, theirs)] * overlap)
        found = overlap[rows, columns]
        matched = found[None, :] >= ALPHAS[:, None] - _TINY
        counts.matches += matched.sum(axis=1)
        together[:, mine[rows], theirs[columns]] += matched
    counts.association += (together * (together / np.maximum(1.0, either - together))).sum(axis=(1, 2))


def _add_identities(counts: _Counts, frames: Frames, shape: tuple[int, int]) -> None:
    """IDF1: each true identity gets at most one estimated one, so that as many boxes as possible agree.

    The fewest boxes left over and the most boxes that agree are the same assignment.
    """
    agree = np.zeros(shape)
    for mine, theirs, overlap in frames:
        agree[np.ix_(mine, theirs)] += overlap >= _MATCH
    rows, columns = scipy.optimize.linear_sum_assignment(-agree)
    counts.same_identity += int(agree[rows, columns].sum())


def _add_clear(counts: _Counts, frames: Frames, true_count: int) -> None:
    """MOTA: matches of the previous frame are kept while they overlap; a person with another identity is a switch."""
    last = np.full(true_count, -1)
    previous = np.full(true_count, -1)
    for mine, theirs, overlap in frames:
        # A frame without boxes on one side keeps what was matched before it, as in TrackEval.
        if not (len(mine) and len(theirs)):
            continue
        value = overlap + _KEPT * (theirs[None, :] == previous[mine][:, None])
        value[overlap < _MATCH - _TINY] = 0.0
        rows, columns = scipy.optimize.linear_sum_assignment(-value)
        kept = value[rows, columns] > _TINY
        people, identities = mine[rows[kept]], theirs[columns[kept]]
        counts.switches += int(((last[people] >= 0) & (last[people] != identities)).sum())
        counts.clear_matches += len(people)
        last[people] = identities
        previous[:] = -1
        previous[people] = identities
