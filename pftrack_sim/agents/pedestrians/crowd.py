"""Everyone who walks, one tick at a time.

The target walks its script. Walkers who cross walk theirs while they do. Everyone else yields: they walk routes to
places of their own and avoid walls, each other, the target and the robot.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.agents.pedestrians import avoidance
from pftrack_sim.agents.pedestrians.carts import Cart
from pftrack_sim.agents.pedestrians.crossing import (
    Crossing,
    OcclusionTrajectory,
    Xy,
    at_different_depths,
    outside,
    within,
)
from pftrack_sim.agents.pedestrians.goal_manager import GoalManager
from pftrack_sim.agents.pedestrians.goal_sampler import WALK_OFF_S, GoalSampler
from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap
from pftrack_sim.agents.pedestrians.oncoming import OncomingPass, OncomingPedestrians
from pftrack_sim.agents.pedestrians.reactive import NOWHERE_M, ReactivePedestrians, turn
from pftrack_sim.agents.pedestrians.routes import Routes
from pftrack_sim.agents.pedestrians.target import TargetWalk
from pftrack_sim.core import random_streams
from pftrack_sim.scenario import model
from pftrack_sim.scenario.axes import TargetAxis
from pftrack_sim.scene.layout import WalkableArea

if TYPE_CHECKING:
    from pftrack_sim.agents.path import Path

Array = NDArray[np.float64]

CROSSING_LIMIT_M_S = 2.8
"""A walker who cannot be in time without running comes late."""

_CLEAR_OF_TARGET_M = 0.55
_CLEAR_OF_ROBOT_M = 0.7
"""On the way to and from its crossing, a walker goes around the target and the robot at this distance."""


class Crowd:
    """The people of one episode, in the order target, distractor-1.., crosser-1.., passer-1...

    Args:
        layout: Where one can walk and what stands there.
        target: The person to track.
        target_path: Where it walks.
        distractors: How many strangers there are and how fast they walk.
        crossings: Walkers who come between the camera and the target, each at its time.
        seed: Root seed of the episode. Every person draws from a stream of its own.
        robot_start_m: `(2,)` where the robot starts, kept free of people; None if it does not matter.
        oncoming: People who pass close by the target.
        carts: Things that drive themselves between the camera and the target.
        target_axis: What the target does besides walking; None for nothing.
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
        self._ground = ObstacleMap(layout)
        self._routes = Routes(self._ground)
        self._places = GoalSampler(self._ground, self._routes, layout.bounds_m, layout.goals_m, target_path)
        self._target = TargetWalk(target_path, target.speed_m_s, target_axis or TargetAxis())
        self._distractors = distractors
        self._crossings = at_different_depths(crossings)
        self._seed = seed
        self._robot_start = None if robot_start_m is None else np.asarray(robot_start_m, dtype=np.float64)
        self._passers = OncomingPedestrians(oncoming, target_path, self._ground)
        self.carts = tuple(Cart(crossing, self._ground) for crossing in carts)
        self._first_passer = 1 + distractors.count + len(self._crossings)
        self._people = self._first_passer + len(oncoming)
        self.names: tuple[str, ...] = (
            "target",
            *(f"distractor-{i + 1}" for i in range(distractors.count)),
            *(f"crosser-{i + 1}" for i in range(len(self._crossings))),
            *(f"passer-{i + 1}" for i in range(len(oncoming))),
        )
        self.reset()

    @property
    def positions_m(self) -> Array:
        """`(P, 2)` places on the ground [m], world frame."""
        return _frozen(self._state[:2, : self._people].T)

    @property
    def velocities_m_s(self) -> Array:
        """`(P, 2)` velocities [m/s], world frame."""
        return _frozen(self._state[2:, : self._people].T)

    @property
    def headings_rad(self) -> Array:
        """`(P,)` where people face; 0 is +x, counter-clockwise, not wrapped."""
        return _frozen(self._heading)

    @property
    def speeds_m_s(self) -> Array:
        """`(P,)` walking speeds."""
        return _frozen(np.hypot(self._state[2, : self._people], self._state[3, : self._people]))

    @property
    def target_s_m(self) -> float:
        """How far the target has walked along its path."""
        return self._target.s_m

    @property
    def crouching(self) -> Array:
        """`(P,)` 0 for upright, 1 for squatting."""
        out = np.zeros(self._people)
        out[0] = self._target.crouch
        return out

    @property
    def running(self) -> NDArray[np.bool_]:
        """`(P,)` who runs."""
        out = np.zeros(self._people, dtype=bool)
        out[0] = self._target.running
        return out

    def reset(self) -> None:
        """Everyone back to the start."""
        count, crossers, people = self._distractors.count, len(self._crossings), self._people
        # Rows x, y, vx, vy; after the people come the robot and the carts.
        for cart in self.carts:
            cart.reset()
        self._passers.reset()
        self._state = np.zeros((4, people + 1 + len(self.carts)))
        self._state[:2, people] = NOWHERE_M
        self._store_carts()
        self._heading = np.zeros(people)
        rngs = [random_streams.stream(self._seed, "distractors", i) for i in range(count)]
        rngs += [random_streams.stream(self._seed, "crossers", i) for i in range(crossers)]
        rngs += [random_streams.stream(self._seed, "passers", i) for i in range(len(self._passers.passings))]
        near_target = [0 < person <= count for person in range(people)]
        self._errands = GoalManager(self._ground, self._routes, self._places, rngs, near_target)
        self._released = [False] * crossers
        self._passed = [False] * len(self._passers.passings)
        self._on_path = [not self._passers.waits(index, 0.0) for index in range(len(self._passed))]
        self._set_off = self._on_path.copy()
        self._robot_seen = False
        self._ticks = 0
        self._target.reset()
        self._state[:, 0], self._heading[0] = self._target.state, self._target.heading_rad
        taken = [self._state[:2, 0].copy()]
        if self._robot_start is not None:
            taken.append(self._robot_start)
        self._place_distractors(rngs[:count], taken)
        self._place_crossers(rngs[count : count + crossers], taken)
        self._place_passers()
        self._regroup()

    def tick(self, dt_s: float, time_s: float, robot_xy: ArrayLike | None, camera_xy: ArrayLike | None) -> None:
        """Move everyone by one tick.

        Args:
            dt_s: Length of the tick.
            time_s: Time at its end.
            robot_xy: `(2,)` where the robot is at its end, to be avoided; None when there is none.
            camera_xy: `(2,)` where the camera is at its end, not counting its shaking; None when there is none: then
                nobody sets off to cross.
        """
        self._ticks += 1
        robot = self._follow_robot(dt_s, robot_xy)
        self._target.advance(dt_s, robot)
        self._state[:, 0], self._heading[0] = self._target.state, self._target.heading_rad
        if self._crossings and camera_xy is not None:
            camera = np.asarray(camera_xy, dtype=np.float64)
            self._cross(dt_s, time_s, (float(camera[0]), float(camera[1])))
        if camera_xy is not None:
            camera = np.asarray(camera_xy, dtype=np.float64)
            robot_m = self._state[:2, self._people].tolist()
            target_m = (float(self._state[0, 0]), float(self._state[1, 0]))
            for cart in self.carts:
                cart.update(dt_s, time_s, (float(camera[0]), float(camera[1])), target_m, robot_m)
            self._store_carts()
        if self._passed:
            self._pass_by(dt_s, time_s)
        who = self._yielders.who
        if len(who):
            self._errands.tend(dt_s, time_s, who, self._state, self._heading, self.target_s_m)
            self._yielders.move(dt_s, self._state, self._heading, self._errands)
        turn(dt_s, self._state[2, 1 : self._people], self._state[3, 1 : self._people], self._heading[1:])

    # Moments of a tick -----------------------------------------------------------------------------------------

    def _store_carts(self) -> None:
        for column, cart in enumerate(self.carts, start=self._people + 1):
            self._state[:, column] = (*cart.position_m, *cart.velocity_m_s)

    def _follow_robot(self, dt_s: float, robot_xy: ArrayLike | None) -> Array | None:
        """Take the robot's place and velocity (by difference, smoothed)."""
        robot = self._state[:, self._people]
        if robot_xy is None:
            robot[:] = (NOWHERE_M, NOWHERE_M, 0.0, 0.0)
            self._robot_seen = False
            return None
        now = np.asarray(robot_xy, dtype=np.float64)
        if self._robot_seen and dt_s > 0.0:
            robot[2:] += min(dt_s / 0.1, 1.0) * ((now - robot[:2]) / dt_s - robot[2:])
        robot[:2] = now
        self._robot_seen = True
        return robot

    def _cross(self, dt_s: float, time_s: float, camera: Xy) -> None:
        """Move those who are crossing; see off those who are done; send those whose time has come."""
        target = (float(self._state[0, 0]), float(self._state[1, 0]))
        changed = False
        for index, walk in enumerate(self._walks):
            person = 1 + self._distractors.count + index
            if self._released[index]:
                continue
            here = (float(self._state[0, person]), float(self._state[1, person]))
            walk.update(dt_s, time_s, camera, target)
            if not walk.begun and time_s >= walk.crossing.at_s - walk.crossing.lead_s:
                suits = None if self._ticks <= 2 else (float(self._state[2, person]), float(self._state[3, person]))
                walk.begin(dt_s, time_s, here, suits)
                changed = True
            if not walk.begun:
                continue
            there, done = self._way_of(walk, dt_s, time_s, here)
            if done:
                self._released[index] = True
                place, velocity = self._state[:2, person], self._state[2:, person]
                off = self._places.walk_off(place, velocity, *self._foresee(camera, WALK_OFF_S))
                self._errands.leave(person, time_s, place, off)
                changed = True
                continue
            if dt_s > 0.0:
                self._state[2:, person] = ((there[0] - here[0]) / dt_s, (there[1] - here[1]) / dt_s)
            self._state[:2, person] = there
        if changed:
            self._regroup()

    def _pass_by(self, dt_s: float, time_s: float) -> None:
        """Move those who pass the target; let go those who have."""
        target, robot = self._state[:2, 0].tolist(), self._state[:2, self._people].tolist()
        for index, passed in enumerate(self._passed):
            person = self._first_passer + index
            if passed:
                continue
            if self._passers.waits(index, time_s):
                goal = None if self._set_off[index] else self._passers.comes_to_m(index, time_s)
                if goal is not None:
                    self._set_off[index] = True
                    place = self._state[:2, person]
                    self._errands.leave(person, time_s, place, self._routes.route(place, goal))
                    self._regroup()
                continue
            if not self._on_path[index]:
                self._on_path[index] = True
                self._regroup()
            here = (float(self._state[0, person]), float(self._state[1, person]))
            there, done = self._passers.advance(index, dt_s, time_s, here, target, robot)
            if done:
                self._passed[index] = True
                # A target that comes back meets nobody twice: who has passed it keeps away from its path.
                place, heading = self._state[:2, person], float(self._heading[person])
                others = np.delete(self._state[:2, : self._people], person, axis=1).T
                aside = self._places.walk_aside(place, heading, others)
                if aside is None:
                    self._errands.set_out(person, time_s, place, self.target_s_m, heading)
                else:
                    self._errands.leave(person, time_s, place, aside)
                self._regroup()
                continue
            self._state[2:, person] = ((there[0] - here[0]) / dt_s, (there[1] - here[1]) / dt_s)
            self._state[:2, person] = there

    def _way_of(self, walk: OcclusionTrajectory, dt_s: float, time_s: float, here: Xy) -> tuple[Xy, bool]:
        """Where a crossing walker goes from here, and whether it is done with crossing."""
        there = walk.position(time_s)
        if walk.crossing.at_s <= time_s <= walk.crossing.until_s:
            return within(here, there, CROSSING_LIMIT_M_S * dt_s), False
        around = outside(there, self._state[:2, 0].tolist(), _CLEAR_OF_TARGET_M)
        around = outside(around, self._state[:2, self._people].tolist(), _CLEAR_OF_ROBOT_M)
        if time_s > walk.crossing.until_s and dt_s > 0.0:
            # Out of the line of sight it no longer goes through things for the sake of its timing: it goes its own way
            # as soon as it would have to slow down before one.
            velocity = ((there[0] - here[0]) / dt_s, (there[1] - here[1]) / dt_s)
            walls = self._ground.distances(*np.array(here)[:, None])
            if around != there or avoidance.must_brake(*walls, *velocity):
                return here, True
        there = self._ground.outside(around, avoidance.WALL_DISTANCE_M)
        return within(here, there, CROSSING_LIMIT_M_S * dt_s), walk.finished(time_s)

    def _foresee(self, camera: Xy, ahead_s: Sequence[float]) -> tuple[Array, Array]:
        """Where camera `(K, 2)` and target `(K, 2)` will be, as far as one can tell.

        The camera is expected to keep its place relative to the target as far as the robot has been moving.
        """
        now, velocity = self._state[:2, 0], self._state[2:, 0]
        target = np.array([self._target.foresee(one)[:2] for one in ahead_s])
        speed = max(float(np.hypot(*velocity)), 0.3)
        share = min(float(np.hypot(*self._state[2:, self._people])) / speed, 1.0) if self._robot_seen else 0.0
        return np.asarray(camera) + share * (target - now), target

    # The start -----------------------------------------------------------------------------------------------------

    def _place_distractors(self, rngs: Sequence[np.random.Generator], taken: list[Array]) -> None:
        for person, rng in enumerate(rngs, start=1):
            speed = self._distractors.speed_m_s * float(np.clip(rng.normal(1.0, 0.12), 0.75, 1.25))
            self._errands.speed_m_s[person] = speed
            point = self._places.start(rng, taken)
            taken.append(point)
            self._state[:2, person] = point
            self._errands.set_out(person, 0.0, point, self.target_s_m)
            way = self._errands.way_m[:, person] - point
            heading = math.atan2(way[1], way[0]) if way.any() else rng.uniform(-math.pi, math.pi)
            # Everyone is already walking when the episode begins.
            pace = self._errands.pace_m_s[person]
            self._heading[person] = heading
            self._state[2:, person] = (pace * math.cos(heading), pace * math.sin(heading))

    def _place_crossers(self, rngs: Sequence[np.random.Generator], taken: list[Array]) -> None:
        self._walks: list[OcclusionTrajectory] = []
        for index, (crossing, rng) in enumerate(zip(self._crossings, rngs, strict=True)):
            person = 1 + self._distractors.count + index
            rng.random()  # Unused; the later draws of this stream must stay what they are.
            self._walks.append(OcclusionTrajectory(crossing))
            self._errands.speed_m_s[person] = 1.2
            stage = self._places.waiting_position(np.array(crossing.waiting_m), taken)
            taken.append(stage)
            self._state[:2, person] = stage
            self._errands.wait_at(person, stage)
            x, y, _ = self._target.foresee(crossing.at_s)
            self._heading[person] = math.atan2(y - stage[1], x - stage[0])

    def _place_passers(self) -> None:
        people = slice(self._first_passer, self._people)
        self._state[:, people] = self._passers.state
        self._heading[people] = self._passers.heading_rad
        self._errands.speed_m_s[people] = [one.speed_m_s for one in self._passers.passings]
        for index, begun in enumerate(self._set_off):
            if not begun:
                person = self._first_passer + index
                self._errands.wait_at(person, self._state[:2, person].copy())

    def _regroup(self) -> None:
        """Who yields and who does not, after that has changed."""
        first = 1 + self._distractors.count
        begun = [walk.begun for walk in self._walks]
        forced = [first + i for i, done in enumerate(self._released) if begun[i] and not done]
        forced += [self._first_passer + i for i, done in enumerate(self._passed) if self._on_path[i] and not done]
        who = [person for person in range(1, self._people) if person not in forced]
        waits = [*([False] * first), *(not one for one in self._released), *(not one for one in self._set_off)]
        waiting = [waits[person] for person in who]
        machines = range(self._people, self._state.shape[1])
        self._yielders = ReactivePedestrians(self._ground, who, waiting, [0, *forced], machines)


def _frozen(array: Array) -> Array:
    copy = array.copy()
    copy.setflags(write=False)
    return copy
