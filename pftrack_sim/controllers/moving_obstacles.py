"""Beams of the range finder that end on something that moves: on the legs of people, and on carts."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.proprioception import RANGES
from pftrack_sim.core.types import BoolArray, FloatArray, IntArray

NEAR_M, GAP_M = 2.5, 0.25  # Farther off, or where the beams lie farther apart, legs fit between two beams
BEYOND_M = 0.4  # A place was free if the beams on both its sides went on for so far behind it
SCAN_S, KEPT_S = 0.25, 3.0
"""Time from one kept scan to the next, and how long they are kept: who stands for longer is an obstacle like others."""

APART_M = 0.5  # Neighbouring beams that end farther apart than this end on two people
JUMP_M = 0.6  # A track is assigned what is nearer than this to its prediction
PLACE_S = 0.2  # Time constant of a track's place; that of its velocity follows from it
COAST_S = 0.5  # A track to which nothing was assigned for so long ends


class MovingObstacles:
    """Compares each scan with those of the last `KEPT_S`: what stands where one of them saw free space has moved.

    What moves is tracked: an alpha-beta filter at constant velocity, beta = alpha^2 / (2 - alpha), over the middle of
    neighbouring beams' ends (Benedict and Bordner 1962, "Synthesis of an optimal set of radar track-while-scan
    smoothing equations", IRE Transactions on Automatic Control).

    Scans are compared in the odometry frame. A thing that is thinner than the gap between two beams is missed by some
    scans and may count as moving.
    """

    def __init__(self) -> None:
        self._scans: deque[tuple[float, FloatArray, FloatArray]] = deque()
        self._tracks: list[_Track] = []
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
        angles = pose[2] + beams_rad[hits]
        ends = pose[:2] + ranges[hits, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        self._update_tracks(ends, frame_s)
        return hits

    def relative(self, proprio: NDArray[Any]) -> tuple[FloatArray, FloatArray]:
        """`(K, 2)` places [m] and `(K, 2)` velocities over the ground [m/s] of what moves, in the chassis' frame."""
        x, y, heading = (float(value) for value in proprio[:3])
        turn = np.array([[math.cos(heading), -math.sin(heading)], [math.sin(heading), math.cos(heading)]])
        places = np.array([track.place_m for track in self._tracks]).reshape(-1, 2)
        velocities = np.array([track.velocity_m_s for track in self._tracks]).reshape(-1, 2)
        return (places - (x, y)) @ turn, velocities @ turn

    def _update_tracks(self, ends_m: FloatArray, frame_s: float) -> None:
        """Predict the tracks by a frame and correct them by `(N, 2)` ends of beams, in the beams' order."""
        steps = np.hypot(*np.diff(ends_m, axis=0).T)
        places = [ends.mean(axis=0) for ends in np.split(ends_m, np.flatnonzero(steps > APART_M) + 1) if len(ends)]
        gain = 1.0 - math.exp(-frame_s / PLACE_S)
        for track in sorted(self._tracks, key=lambda track: -track.seen_s):
            track.place_m = track.place_m + frame_s * track.velocity_m_s
            away = [math.dist(place, track.place_m) for place in places]
            if min(away, default=math.inf) < JUMP_M:
                innovation = places.pop(int(np.argmin(away))) - track.place_m
                track.place_m = track.place_m + gain * innovation
                track.velocity_m_s = track.velocity_m_s + gain * gain / (2.0 - gain) / frame_s * innovation
                track.seen_s = self._time_s
        self._tracks = [track for track in self._tracks if self._time_s - track.seen_s < COAST_S]
        self._tracks += [_Track(place, np.zeros(2), self._time_s) for place in places]


@dataclass
class _Track:
    place_m: FloatArray  # (2,) in the odometry frame
    velocity_m_s: FloatArray
    seen_s: float
