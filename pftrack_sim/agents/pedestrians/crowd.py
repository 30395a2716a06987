"""All pedestrians and carts of one episode, advanced tick by tick.

The target follows its path. Crossing and oncoming pedestrians follow their scripts for a part of the episode. All
others are reactive: they walk to goals and avoid obstacles, each other, the target, the robot and carts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.agents.path import Path
from pftrack_sim.agents.pedestrians.carts import Cart
from pftrack_sim.agents.pedestrians.goal_manager import GoalManager
from pftrack_sim.agents.pedestrians.goal_sampler import PREDICTION_TIMES_S, GoalSampler
from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap, Xy
from pftrack_sim.agents.pedestrians.occlusion_trajectory import Crossing, at_different_depths
from pftrack_sim.agents.pedestrians.oncoming import OncomingPass
from pftrack_sim.agents.pedestrians.reactive import SENTINEL_M, ReactivePedestrians, turn
from pftrack_sim.agents.pedestrians.scripted import CrossingPedestrian, OncomingPedestrian, Phase
from pftrack_sim.agents.pedestrians.target import TargetWalk
from pftrack_sim.agents.pedestrians.visibility_graph import VisibilityGraph
from pftrack_sim.core import random_streams
from pftrack_sim.core.types import BoolArray, FloatArray
from pftrack_sim.scenario import model
from pftrack_sim.scenario.axes import TargetAxis
from pftrack_sim.scene.layout import WalkableArea

_CROSSING_WALKING_SPEED_M_S = 1.2
_ROBOT_VELOCITY_TIME_CONSTANT_S = 0.1


class Crowd:
    """The pedestrians of one episode, in the order target, distractor-1.., crosser-1.., passer-1..

    Args:
        layout: Walkable area and obstacles.
        target: Settings of the target.
        target_path: Its path.
        distractors: Number and speed of the distractors.
        crossings: Crossings of pedestrians.
        seed: Root seed of the episode; every pedestrian has a random stream.
        robot_start_m: `(2,)` start of the robot, kept free of pedestrians; None if it does not matter.
        oncoming: Passes of oncoming pedestrians.
        carts: Crossings of carts.
        target_axis: Manoeuvres of the target; None for none.

    Attributes:
        carts: The carts.
        names: `P` names of the pedestrians.
    """

    def __init__(
        self,
        layout: WalkableArea,
        target: model.Target,
        target_path: Path,
        distractors: model.Distractors,
        crossings: Sequence[Crossing],
        seed: int,
        *,
        robot_start_m: ArrayLike | None = None,
        oncoming: Sequence[OncomingPass] = (),
        carts: Sequence[Crossing] = (),
        target_axis: TargetAxis | None = None,
    ) -> None:
        self._obstacles = ObstacleMap(layout)
        self._graph = VisibilityGraph(self._obstacles)
        self._sampler = GoalSampler(layout, self._obstacles, self._graph, target_path)
        self._seed = seed
        self._robot_start_m = robot_start_m
        self._target = TargetWalk(target_path, target.speed_m_s, target_axis or TargetAxis())
        self._distractors = distractors
        self._crossing = [CrossingPedestrian(one, self._obstacles) for one in at_different_depths(crossings)]
        self._oncoming = [OncomingPedestrian(one, target_path, self._obstacles) for one in oncoming]
        self.carts = tuple(Cart(one, self._obstacles) for one in carts)
        self._first_crossing = 1 + distractors.count
        self._first_oncoming = self._first_crossing + len(self._crossing)
        self._robot_column = self._first_oncoming + len(self._oncoming)
        self.names: tuple[str, ...] = (
            "target",
            *(f"distractor-{i + 1}" for i in range(distractors.count)),
            *(f"crosser-{i + 1}" for i in range(len(self._crossing))),
            *(f"passer-{i + 1}" for i in range(len(self._oncoming))),
        )
        self.reset()

    @property
    def positions_m(self) -> FloatArray:
        """`(P, 2)` positions on the ground [m], world frame."""
        return _read_only(self._state[:2, : self._robot_column].T)

    @property
    def headings_rad(self) -> FloatArray:
        """`(P,)` headings of the bodies; 0 is +x, counter-clockwise, not wrapped."""
        return _read_only(self._headings)

    @property
    def speeds_m_s(self) -> FloatArray:
        """`(P,)` walking speeds."""
        return _read_only(np.hypot(*self._state[2:, : self._robot_column]))

    @property
    def target_s_m(self) -> float:
        """Arc length of the target on its path."""
        return self._target.s_m

    @property
    def crouching(self) -> FloatArray:
        """`(P,)` 0 for upright, 1 for squatting."""
        return np.array([self._target.crouch, *[0.0] * (len(self.names) - 1)])

    @property
    def running(self) -> BoolArray:
        """`(P,)` whether each pedestrian runs."""
        return np.array([self._target.running, *[False] * (len(self.names) - 1)])

    # Reset -------------------------------------------------------------------------------------------------------

    def reset(self) -> None:
        """Return everything to the start of the episode."""
        # Rows x, y, vx, vy; columns pedestrians, robot, carts.
        self._state = np.zeros((4, self._robot_column + 1 + len(self.carts)))
        self._state[:2, self._robot_column] = SENTINEL_M
        self._headings = np.zeros(len(self.names))
        self._robot_seen = False
        counts = {
            "distractors": self._distractors.count,
            "crossers": len(self._crossing),
            "passers": len(self._oncoming),
        }
        rngs = [random_streams.stream(self._seed, kind, i) for kind, count in counts.items() for i in range(count)]
        near_target = [0 < person < self._first_crossing for person in range(len(self.names))]
        self._goals = GoalManager(self._obstacles, self._graph, self._sampler, rngs, near_target)
        self._target.reset()
        self._store_target()
        occupied = [self._state[:2, 0].copy()]
        if self._robot_start_m is not None:
            occupied.append(np.asarray(self._robot_start_m, dtype=np.float64))
        self._reset_distractors(rngs, occupied)
        self._reset_crossing(rngs[self._distractors.count :], occupied)
        self._reset_oncoming()
        for cart in self.carts:
            cart.reset()
        self._store_carts()
        self._group()

    def _reset_distractors(self, rngs: Sequence[np.random.Generator], occupied: list[FloatArray]) -> None:
        for person in range(1, self._first_crossing):
            rng = rngs[person - 1]
            speed = self._distractors.speed_m_s * float(np.clip(rng.normal(1.0, 0.12), 0.75, 1.25))
            self._goals.walking_speed_m_s[person] = speed
            position = self._sampler.start_position(rng, occupied)
            occupied.append(position)
            self._goals.walk_to_sampled_goal(person, 0.0, position, self.target_s_m)
            offset = self._goals.waypoint_m[:, person] - position
            heading = math.atan2(offset[1], offset[0]) if offset.any() else rng.uniform(-math.pi, math.pi)
            # Distractors are already walking when the episode begins.
            speed = self._goals.desired_speed_m_s[person]
            self._state[:, person] = (*position, speed * math.cos(heading), speed * math.sin(heading))
            self._headings[person] = heading

    def _reset_crossing(self, rngs: Sequence[np.random.Generator], occupied: list[FloatArray]) -> None:
        for index, pedestrian in enumerate(self._crossing):
            person = self._first_crossing + index
            pedestrian.reset()
            rngs[index].random()  # Unused: keeps the later draws of this stream as they were.
            self._goals.walking_speed_m_s[person] = _CROSSING_WALKING_SPEED_M_S
            waiting = self._sampler.waiting_position(np.array(pedestrian.crossing.waiting_m), occupied)
            occupied.append(waiting)
            self._state[:2, person] = waiting
            self._goals.wait_at(person, waiting)
            x, y = self._target.predicted(pedestrian.crossing.at_s)
            self._headings[person] = math.atan2(y - waiting[1], x - waiting[0])

    def _reset_oncoming(self) -> None:
        for person, pedestrian in enumerate(self._oncoming, start=self._first_oncoming):
            self._state[:, person], self._headings[person] = pedestrian.reset()
            self._goals.walking_speed_m_s[person] = pedestrian.speed_m_s
            if pedestrian.phase is Phase.WAITING:
                self._goals.wait_at(person, self._state[:2, person].copy())

    # Tick --------------------------------------------------------------------------------------------------------

    def tick(self, dt_s: float, time_s: float, robot_xy: ArrayLike | None, camera_xy: ArrayLike | None) -> None:
        """Advance everything by one tick.

        Args:
            dt_s: Length of the tick.
            time_s: Time at its end.
            robot_xy: `(2,)` position of the robot at its end; None for no robot.
            camera_xy: `(2,)` position of the camera at its end, without vibration; None for no camera: then nothing
                crosses the line of sight.
        """
        robot = self._update_robot(dt_s, robot_xy)
        self._target.update(dt_s, robot)
        self._store_target()
        if camera_xy is not None:
            camera_m = _xy(camera_xy)
            self._update_crossing(dt_s, time_s, camera_m)
            self._update_carts(dt_s, time_s, camera_m)
        self._update_oncoming(dt_s, time_s)
        self._update_reactive(dt_s, time_s)
        turn(dt_s, self._state[2:, 1 : self._robot_column], self._headings[1:])

    def _update_robot(self, dt_s: float, robot_xy: ArrayLike | None) -> FloatArray | None:
        """Store the robot's position and its velocity (differences, low-pass filtered)."""
        robot = self._state[:, self._robot_column]
        if robot_xy is None:
            robot[:] = (SENTINEL_M, SENTINEL_M, 0.0, 0.0)
            self._robot_seen = False
            return None
        position = np.asarray(robot_xy, dtype=np.float64)
        if self._robot_seen and dt_s > 0.0:
            share = min(dt_s / _ROBOT_VELOCITY_TIME_CONSTANT_S, 1.0)
            robot[2:] += share * ((position - robot[:2]) / dt_s - robot[2:])
        robot[:2] = position
        self._robot_seen = True
        return robot

    def _update_crossing(self, dt_s: float, time_s: float, camera_m: Xy) -> None:
        target_m, robot_m = self._position(0), self._position(self._robot_column)
        for person, pedestrian in enumerate(self._crossing, start=self._first_crossing):
            phase, state = pedestrian.phase, self._state[:, person]
            pedestrian.update(dt_s, time_s, state, camera_m, target_m, robot_m)
            if pedestrian.phase is not phase and pedestrian.phase is Phase.RELEASED:
                predicted = self._predicted_camera_and_target(camera_m)
                route = self._sampler.route_off_line_of_sight(state[:2], state[2:], *predicted)
                self._goals.walk_and_stop(person, time_s, state[:2], route)
            self._groups_changed |= pedestrian.phase is not phase

    def _update_carts(self, dt_s: float, time_s: float, camera_m: Xy) -> None:
        for cart in self.carts:
            cart.update(dt_s, time_s, camera_m, self._position(0), self._position(self._robot_column))
        self._store_carts()

    def _update_oncoming(self, dt_s: float, time_s: float) -> None:
        target_m, robot_m = self._position(0), self._position(self._robot_column)
        for person, pedestrian in enumerate(self._oncoming, start=self._first_oncoming):
            phase, state = pedestrian.phase, self._state[:, person]
            pedestrian.update(dt_s, time_s, state, target_m, robot_m)
            if pedestrian.phase is phase:
                continue
            self._groups_changed = True
            if pedestrian.phase is Phase.APPROACHING:
                route = self._graph.shortest_route(state[:2], pedestrian.joining_m)
                self._goals.walk_and_stop(person, time_s, state[:2], route)
            elif pedestrian.phase is Phase.RELEASED:
                # Off the target's path, so that a target that comes back does not meet it again.
                others = np.delete(self._state[:2, : self._robot_column], person, axis=1).T
                heading = float(self._headings[person])
                route = self._sampler.route_aside(state[:2], heading, others)
                if route is None:
                    self._goals.walk_to_sampled_goal(person, time_s, state[:2], self.target_s_m, heading)
                else:
                    self._goals.walk_and_stop(person, time_s, state[:2], route)

    def _update_reactive(self, dt_s: float, time_s: float) -> None:
        if self._groups_changed:
            self._group()
        columns = self._reactive.columns
        if len(columns):
            self._goals.update(dt_s, time_s, columns, self._state, self._headings, self.target_s_m)
            self._reactive.update(dt_s, self._state, self._headings, self._goals)

    def _group(self) -> None:
        """Divide the pedestrians into reactive and scripted ones, after a phase has changed."""
        phases = {
            1 + self._distractors.count + i: one.phase for i, one in enumerate([*self._crossing, *self._oncoming])
        }
        scripted = [person for person, phase in phases.items() if phase is Phase.SCRIPTED]
        reactive = [person for person in range(1, self._robot_column) if person not in scripted]
        waiting = [phases.get(person) is Phase.WAITING for person in reactive]
        vehicles = range(self._robot_column, self._state.shape[1])
        self._reactive = ReactivePedestrians(self._obstacles, reactive, waiting, [0, *scripted], vehicles)
        self._groups_changed = False

    def _predicted_camera_and_target(self, camera_m: Xy) -> tuple[FloatArray, FloatArray]:
        """`(K, 2)` camera and `(K, 2)` target positions at `PREDICTION_TIMES_S`.

        The camera is assumed to move with the target, by the ratio of the robot's speed to the target's.
        """
        target = np.array([self._target.predicted(ahead_s) for ahead_s in PREDICTION_TIMES_S.tolist()])
        target_speed = max(float(np.hypot(*self._state[2:, 0])), 0.3)
        ratio = (
            min(float(np.hypot(*self._state[2:, self._robot_column])) / target_speed, 1.0) if self._robot_seen else 0.0
        )
        return np.asarray(camera_m) + ratio * (target - self._state[:2, 0]), target

    def _position(self, column: int) -> Xy:
        return _xy(self._state[:2, column])

    def _store_target(self) -> None:
        self._state[:, 0], self._headings[0] = self._target.state, self._target.heading_rad

    def _store_carts(self) -> None:
        for column, cart in enumerate(self.carts, start=self._robot_column + 1):
            self._state[:, column] = (*cart.position_m, *cart.velocity_m_s)


def _xy(point: ArrayLike) -> Xy:
    x, y = np.asarray(point, dtype=np.float64).tolist()
    return x, y


def _read_only(array: FloatArray) -> FloatArray:
    copy = array.copy()
    copy.setflags(write=False)
    return copy
