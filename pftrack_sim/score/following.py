"""Measures of person following: those of EVT-Bench, and errors in metres, degrees and seconds.

Success, tracking and collision are those of EVT-Bench, the benchmark of TrackVLA (Wang et al. 2025, "TrackVLA: embodied
visual tracking in the wild", arXiv:2505.23189), as its published evaluation code counts them (wsakobe/TrackVLA,
`evt_bench/additional_metric.py`, `baseline_agent.py`, `analyze_results.py`), with "facing" taken as: part of the target
can be seen. Two things differ: a collision is a contact in the physics or, as there, a distance below 0.5 m; and the
scenario's own limits end the episode, while there 20 steps beyond 4 m do.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy  # it imports its packages at first use
from numpy.typing import ArrayLike

from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.types import BoolArray, FloatArray
from pftrack_sim.scenario.model import Follow

FOLLOWED_MARGIN_M = 1.0
"""EVT-Bench: a step is followed when the target is faced and no farther than 3 m. Its robots keep 1 to 3 m: this margin
beyond the middle."""

COLLISION_M = 0.5  # EVT-Bench: nearer than this is a collision
FOUND_S = 0.5  # A lost target that is visible this long without a break is found again


@dataclass(frozen=True)
class DrivenPath:
    """A driven episode, one row per frame.

    Attributes:
        time_s: `(N,)` simulated time.
        distance_m: `(N,)` on the ground, camera to target.
        bearing_rad: `(N,)` of the target off the optical axis.
        seen: `(N,)` whether part of the target can be seen.
        robot_xy_m: `(N, 2)` where the robot was.
        bystander_m: `(N,)` from the robot to the nearest person but the target, on the ground; inf where there is none.
        outcome: `"finished"`, `"collision"` or `"lost"`.

    Raises:
        ParameterError: The lengths differ, or there are no frames.
    """

    time_s: FloatArray
    distance_m: FloatArray
    bearing_rad: FloatArray
    seen: BoolArray
    robot_xy_m: FloatArray
    bystander_m: FloatArray
    outcome: str

    def __post_init__(self) -> None:
        frames = len(self.time_s)
        columns = (self.time_s, self.distance_m, self.bearing_rad, self.seen, self.bystander_m)
        shapes = [np.shape(one) for one in columns]
        if frames == 0 or any(one != (frames,) for one in shapes) or np.shape(self.robot_xy_m) != (frames, 2):
            raise ParameterError(f"need one number per frame, got {[*shapes, np.shape(self.robot_xy_m)]}")


@dataclass(frozen=True)
class Following:
    """Scores of one episode; NaN where there is nothing to measure.

    Attributes:
        success: 1 if the episode ended well, else 0. To the end of the task: the target followed in its last frame
            (faced, no farther than the wanted distance and `FOLLOWED_MARGIN_M`).
        tracking_rate: Share of the full episode's frames in which the target was followed.
        collision: 1 if the robot touched something or came within `COLLISION_M` of the target.
        length: Frames driven.
        within: Share of the frames driven with both errors within the task's limits and the target seen.
        distance_rms_m: Error of distance.
        bearing_rms_deg: Error of bearing.
        time_to_loss_s: Until the target was first out of sight for longer than `FOUND_S`; NaN when never.
        time_to_find_s: Mean time from a loss until it was seen again for `FOUND_S`; NaN when never lost or never found.
        losses: Number of such losses.
        jerk_rms_m_s3: Jerk of the robot's path, over half a second.
        bystander_m: Least distance to a person but the target, on the ground; NaN where there is none.
    """

    success: float
    tracking_rate: float
    collision: float
    length: int
    within: float
    distance_rms_m: float
    bearing_rms_deg: float
    time_to_loss_s: float
    time_to_find_s: float
    losses: int
    jerk_rms_m_s3: float
    bystander_m: float


def summarise(path: DrivenPath, task: Follow, frames: int) -> Following:
    """Measures of one driven episode; a full one of the task has so many `frames`.

    Where the task wants another distance than 2 m, the limit of EVT-Bench moves along: see `FOLLOWED_MARGIN_M`.
    """
    distance, bearing, seen = path.distance_m, path.bearing_rad, np.asarray(path.seen, dtype=np.bool_)
    followed = seen & (distance <= task.distance_m + FOLLOWED_MARGIN_M)
    collided = path.outcome == "collision" or bool((distance < COLLISION_M).any())
    finished = path.outcome == "finished" and not collided
    lost_spans = losses(path.time_s, seen)
    good = (
        seen
        & (np.abs(distance - task.distance_m) <= task.distance_limit_m)
        & (np.abs(bearing) <= np.deg2rad(task.bearing_limit_deg))
    )
    found = [until - since for since, until in lost_spans if not math.isnan(until)]
    return Following(
        success=float(finished and bool(followed[-1])),
        tracking_rate=float(followed.sum()) / max(frames, len(distance)),
        collision=float(collided),
        length=len(distance),
        within=float(good.mean()),
        distance_rms_m=_rms(distance - task.distance_m),
        bearing_rms_deg=math.degrees(_rms(bearing)),
        time_to_loss_s=float(lost_spans[0][0] - path.time_s[0]) if lost_spans else math.nan,
        time_to_find_s=sum(found) / len(found) if found else math.nan,
        losses=len(lost_spans),
        jerk_rms_m_s3=jerk_rms(path.robot_xy_m, path.time_s),
        bystander_m=nearest_m if math.isfinite(nearest_m := float(path.bystander_m.min())) else math.nan,
    )


def losses(time_s: ArrayLike, seen: ArrayLike) -> list[tuple[float, float]]:
    """Times at which the target was lost and found again, from `(N,)` times and whether it was seen.

    Lost: out of sight for longer than `FOUND_S`. Found: in sight for at least that long without a break.

    Returns:
        For each loss the time of the first frame without it and of the first frame of the sight that ended the loss
        (NaN when none did).
    """
    times, sight = np.asarray(time_s, dtype=np.float64), np.asarray(seen, dtype=np.bool_)
    last_s = float(np.median(np.diff(times))) if len(times) > 1 else 0.0  # The last frame lasts as long as the others
    ended = np.append(times, times[-1:] + last_s)
    edges = np.flatnonzero(np.diff(sight.astype(np.int8))) + 1
    starts = np.concatenate([[0], edges]).astype(np.intp)
    ends = np.concatenate([edges, [len(sight)]]).astype(np.intp)
    found: list[tuple[float, float]] = []
    since = math.nan
    for start, end in zip(starts.tolist(), ends.tolist(), strict=True):
        lasted = float(ended[end]) - float(times[start])
        if not sight[start]:
            if math.isnan(since) and lasted > FOUND_S:
                since = float(times[start])
        elif not math.isnan(since) and lasted >= FOUND_S:
            found.append((since, float(times[start])))
            since = math.nan
    if not math.isnan(since):
        found.append((since, math.nan))
    return found


def jerk_rms(xy_m: ArrayLike, time_s: ArrayLike) -> float:
    """RMS of the third derivative of a path [m/s^3], from a cubic fitted over half a second (Savitzky and Golay 1964).

    `(N, 2)` positions at irregular `(N,)` times are interpolated to their median interval. NaN for a shorter path.
    """
    path, times = np.asarray(xy_m, dtype=np.float64), np.asarray(time_s, dtype=np.float64)
    if len(times) < 2:
        return math.nan
    interval_s = float(np.median(np.diff(times)))
    if np.ptp(np.diff(times)) > 1e-6:
        even = np.arange(times[0], times[-1] + 0.5 * interval_s, interval_s)
        path = np.column_stack([np.interp(even, times, path[:, 0]), np.interp(even, times, path[:, 1])])
    half = max(2, round(0.25 / interval_s))
    if len(path) < 2 * half + 1:
        return math.nan
    jerk: FloatArray = scipy.signal.savgol_filter(path, 2 * half + 1, 3, deriv=3, delta=interval_s, axis=0)
    jerk = jerk[half : len(path) - half]
    return _rms(np.hypot(*jerk.T))


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if values.size else math.nan
