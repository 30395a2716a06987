"""Plans of oncoming pedestrians: they walk against the target's direction and pass it at a given time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.agents.path import Path
from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap, Xy
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.types import FloatArray

EXACT_LANE_M = 2.0  # Within this distance along the path from the meeting point, the lane is kept exactly.
WALL_DISTANCE_M = 0.34
JOINING_M = 5.0  # Distance before the meeting point at which a waiting pedestrian joins the path.
_MAX_APPROACH_M = 20.0  # With a longer approach it waits aside first: on laps it would meet the target before.
_ASIDE_M = 8.0  # Least distance of waiting positions from the path.
_GRID_M = 2.5
_MIN_WALL_DISTANCE_M = 0.22


@dataclass(frozen=True)
class OncomingPass:
    """One pass of the target.

    Attributes:
        meeting_s_m: Arc length of the target on its path then.
        left_m: Offset of the pedestrian to the left of the path; negative is right.
        waiting_m: Waiting position away from the path; None for a pedestrian that is on the path from the start.
    """

    at_s: float
    meeting_s_m: float
    left_m: float
    speed_m_s: float
    waiting_m: Xy | None = None


def plan_oncoming_pass(
    at_s: float,
    meeting_s_m: float,
    distance_m: float,
    speed_m_s: float,
    path: Path,
    obstacles: ObstacleMap,
    side: int,
    name: str,
    waiting_positions_m: ArrayLike = (),
) -> OncomingPass:
    """Plan a pass at `distance_m` from the target, on the side with more room.

    At `at_s` the target is at the arc length `meeting_s_m` of its path. `side` is the preferred side: 1 is left of the
    path, -1 right. `waiting_positions_m` are `(N, 2)` free positions away from the path.

    Raises:
        ParameterError: There is no room on either side.
    """
    x, y, heading = path.at(np.linspace(meeting_s_m - EXACT_LANE_M, meeting_s_m + EXACT_LANE_M, 21))
    room: dict[int, float] = {}
    for sign in (side, -side):
        left = sign * distance_m
        lane = np.stack([x - left * np.sin(heading), y + left * np.cos(heading)], axis=1)
        room[sign] = float(obstacles.clearance_m(lane)[5:16].min())
    best = max(room, key=lambda sign: min(room[sign], WALL_DISTANCE_M))
    if room[best] < _MIN_WALL_DISTANCE_M:
        raise ParameterError(
            f"{name}: no pedestrian can pass the target at {distance_m:g} m at {at_s:g} s, because of obstacles on "
            "both sides; use another time or a smaller distance_m"
        )
    left_m, waiting_m = best * distance_m, None
    positions = np.array(waiting_positions_m, dtype=np.float64).reshape(-1, 2)
    if min(path.length_m - meeting_s_m, speed_m_s * at_s) > _MAX_APPROACH_M and len(positions):
        joining = np.array(path.beside(meeting_s_m + JOINING_M, left_m))
        waiting_x, waiting_y = positions[np.argmin(np.hypot(*(positions - joining).T))].tolist()
        waiting_m = (waiting_x, waiting_y)
    return OncomingPass(at_s, meeting_s_m, left_m, speed_m_s, waiting_m)


def positions_away_from(path: Path, obstacles: ObstacleMap, bounds_m: tuple[float, float, float, float]) -> FloatArray:
    """`(N, 2)` free grid positions [m] within bounds x_min, y_min, x_max, y_max that are far from a path."""
    x_min, y_min, x_max, y_max = bounds_m
    grid = np.meshgrid(np.arange(x_min + 1.0, x_max, _GRID_M), np.arange(y_min + 1.0, y_max, _GRID_M))
    positions = np.stack(grid, axis=-1).reshape(-1, 2)
    x, y, _ = path.at(np.arange(0.0, path.length_m, 0.5))
    distance = np.hypot(positions[:, :1] - x, positions[:, 1:] - y).min(axis=1)
    return positions[(distance >= _ASIDE_M) & (obstacles.clearance_m(positions) >= 2.0 * WALL_DISTANCE_M)]
