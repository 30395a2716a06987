"""Motion of the reactive pedestrians: towards their next waypoints, with collision avoidance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pftrack_sim.agents.pedestrians.goal_manager import GoalManager
from pftrack_sim.agents.pedestrians.kernels import move, sense
from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap
from pftrack_sim.core.types import FloatArray


class ReactivePedestrians:
    """The pedestrians that react to others, as columns of a common state.

    Args:
        reactive: Columns of the reactive pedestrians, rising.
        waiting: Whether each of these stays at its waiting position.
        scripted: Columns of the pedestrians that do not react.
        vehicles: Columns of the robot and the carts, after all pedestrians.
    """

    def __init__(
        self,
        obstacles: ObstacleMap,
        reactive: Sequence[int],
        waiting: Sequence[bool],
        scripted: Sequence[int],
        vehicles: Sequence[int],
    ) -> None:
        self._rectangles = obstacles.rectangles
        self.columns = np.array(reactive, dtype=np.intp)
        self._order = np.array([*reactive, *scripted, *vehicles], dtype=np.intp)
        self._vehicle, self._waiting = vehicles[0], np.array(waiting, dtype=bool)

    def update(self, dt_s: float, state: FloatArray, heading_rad: FloatArray, goals: GoalManager) -> None:
        """Move the reactive pedestrians by one tick.

        `state` `(4, C)` holds x, y [m], vx, vy [m/s] of everything that moves; the reactive columns are overwritten.
        `heading_rad` `(P,)` are the headings of the pedestrians.
        """
        order, vehicle, rectangles = self._order, self._vehicle, self._rectangles
        near, offset, logarithm, *repulsions = sense(
            state, order, len(self.columns), vehicle, heading_rad, goals.waypoint_m, rectangles
        )
        bearings, strength = np.arctan2(offset[1], offset[0]), np.exp(logarithm)
        move(
            dt_s, state, order, vehicle, heading_rad, goals.desired_speed_m_s, goals.pace, self._waiting, rectangles,
            near, offset, bearings, strength, *repulsions,
        )  # fmt: skip
