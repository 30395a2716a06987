"""Beams of the range finder that end on something that moves: on the legs of people, and on carts."""

from __future__ import annotations

import math
from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.proprioception import RANGES
from pftrack_sim.core.types import BoolArray, FloatArray, IntArray

NEAR_M, GAP_M = 2.5, 0.25  # Farther off, or where the beams lie farther apart, legs fit between two beams
BEYOND_M = 0.4  # A place was free if the beams on both its sides went on for so far behind it
SCAN_S, KEPT_S = 0.25, 3.0
"""Time from one kept scan to the next, and how long they are kept: who stands for longer is an obstacle like others."""


class MovingObstacles:
    """Compares each scan with those of the last `KEPT_S`: what stands where one of them saw free space has moved.

    Scans are compared in the odometry frame. A thing that is thinner than the gap between two beams is missed by some
    scans and may count as moving.
    """

    def __init__(self) -> None:
        self._scans: deque[tuple[float, FloatArray, FloatArray]] = deque()
        self._time_s = 0.0

    def see(self, proprio: NDArray[Any], beams_rad: FloatArray, frame_s: float) -> BoolArray:
        """Which of `(B,)` beams, in rising order [rad], end on something near that moves; called in every frame."""
        pose, ranges = np.asarray(proprio[:3], dtype=np.float64), np.asarray(proprio[RANGES], dtype=np.float64)
        self._time_s += frame_s
        while self._scans and self._scans[0][0] < self._time_s - KEPT_S:
            self._scans.popleft()
        hits = np.zeros(len(ranges), dtype=np.bool_)
        near_m = min(NEAR_M, GAP_M / float(np.diff(beams_rad).max(initial=1e-3)))
        if self._scans and (ranges < near_m).any():
            poses = np.stack([where for _, where, _ in self._scans])
            before = np.stack([scan for _, _, scan in self._scans])
            angles = pose[2] + beams_rad
            dx = pose[0] + ranges * np.cos(angles) - poses[:, :1]
            dy = pose[1] + ranges * np.sin(angles) - poses[:, 1:2]
            away = np.hypot(dx, dy)
            bearing: FloatArray = np.remainder(np.arctan2(dy, dx) - poses[:, 2:] + math.pi, 2.0 * math.pi) - math.pi
            beam: IntArray = np.asarray(np.searchsorted(beams_rad, bearing, side="right"), dtype=np.intp) - 1
            inside = (beam >= 0) & (beam < len(ranges) - 1) & (away < near_m)
            beam = np.clip(beam, 0, len(ranges) - 2)
            right_m, left_m = (np.take_along_axis(before, beam + side, axis=1) for side in (0, 1))
            free_m = np.minimum(right_m, left_m)
            hits = (inside & (free_m > away + BEYOND_M)).any(axis=0) & (ranges < near_m)
        if not self._scans or self._time_s - self._scans[-1][0] > SCAN_S:
            self._scans.append((self._time_s, pose, ranges))
        return hits
