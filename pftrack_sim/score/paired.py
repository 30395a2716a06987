"""Mean overlaps of several episodes on the same frames, so that a harder one cannot gain by showing fewer of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pftrack_sim.core.types import BoolArray, FloatArray, IntArray

_SAME_S = 1e-6


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

    The arms are episodes of one scenario and seed; times before `from_s` are left out. The times are those of the arm
    with the most frames. Between two frames an arm keeps the frame before: where frames are lost, the overlap of a
    delivered frame counts for as long as it is the last one.
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
