"""All pedestrians and carts of one episode, advanced tick by tick.

The target follows its path. Crossing and oncoming pedestrians and carts follow scripts for a part of the episode. All
other pedestrians are reactive: they walk to goals and avoid obstacles and everything that moves.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.agents.gait.posture import PLAIN, Posture
from pftrack_sim.agents.path import Path
from pftrack_sim.agents.pedestrians.avoidance import FAR_M, MOVER, VEHICLE_EXTRA_M, WAITING_REACTION, avoid
from pftrack_sim.agents.pedestrians.crossing import (
    Cart,
    Crossing,
    CrossingPedestrian,
    Phase,
    Surroundings,
    at_different_depths,
)
from pftrack_sim.agents.pedestrians.goals import PREDICTION_TIMES_S, GoalManager, GoalSampler, PaceChanges
from pftrack_sim.agents.pedestrians.groups import GroupMember, group_places
from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap, VisibilityGraph, Xy
from pftrack_sim.agents.pedestrians.oncoming import OncomingPass, OncomingPedestrian
from pftrack_sim.agents.pedestrians.outline import Outline
from pftrack_sim.agents.pedestrians.target import TargetWalk, Walk, walk_of
from pftrack_sim.core.random_streams import stream
from pftrack_sim.core.types import FloatArray, read_only
from pftrack_sim.scenario.axes import TargetAxis
from pftrack_sim.scenario.people import Distractors, FurtherTarget, Group, Target
from pftrack_sim.scene.layout import WalkableArea

_Scripted: TypeAlias = CrossingPedestrian | OncomingPedestrian

_CROSSING_WALKING_SPEED_M_S = 1.2
_SIGHT_POINTS = 16  # On the line of sight at the start, half a metre apart at 8 m
_ROBOT_VELOCITY_TIME_CONSTANT_S = 0.1


class Crowd:
    """The `P` pedestrians of one episode, and the carts.

    Their order is target, distractor-1.., crosser-1.., passer-1.., member-1.. (of groups), further targets.

    Args:
        seed: Root seed of the episode; every pedestrian has a random stream.
        robot_start_m: `(2,)` start of the robot, kept free of pedestrians; None if it does not matter.
    """

    def __init__(
        self,
        layout: WalkableArea,
        target: Target,
        target_path: Path,
        distractors: Distractors,
        crossings: Sequence[Crossing],
        seed: int,
        *,
        robot_start_m: ArrayLike | None = None,
        oncoming: Sequence[OncomingPass] = (),
        carts: Sequence[Crossing] = (),
        target_axis: TargetAxis | None = None,
        groups: Sequence[Group] = (),
        targets: Sequence[FurtherTarget] = (),
    ) -> None:
        self._obstacles = obstacles = ObstacleMap(layout)
        self._graph = VisibilityGraph(obstacles)
        self._sampler = GoalSampler(layout, self._graph, target_path)
        self._distractors = distractors
        self._target = walk_of(target_path, target, target_axis or TargetAxis())
        counts = {"distractor": distractors.count, "crosser": len(crossings), "passer": len(oncoming)}
        self.names = ("target", *(f"{kind}-{i + 1}" for kind, count in counts.items() for i in range(count)))
        self._reactive = slice(1, len(self.names))  # Those who react to others, except while they follow a script
        self._walks: list[Walk] = [self._target]
        self._walks += [TargetWalk(Path(one.path_m), one.person, TargetAxis()) for one in targets]
        self._members = [GroupMember(place, self._target) for place in group_places(groups, target_path)]
        others = dict(enumerate([*self._members, *self._walks[1:]], start=len(self.names)))
        self._independent: dict[int, Walk | GroupMember] = {0: self._target, **others}
        self.names += (*(f"member-{i + 1}" for i in range(len(self._members))), *(one.name for one in targets))
        # Pedestrians, robot, carts; of each x, y, vx, vy as a row of the state.
        self._robot = len(self.names)
        self._movers = np.zeros(self._robot + 1 + len(carts), MOVER)
        self._state = self._movers.view(np.float64).reshape(len(self._movers), -1)[:, :4]
        self._headings = self._movers["heading"][: self._robot]
        self._movers["pace"] = 1.0
        self._movers["turns"][self._reactive] = 1.0
        self._movers["extra_m"][self._robot :] = VEHICLE_EXTRA_M
        self._state[self._robot, :2] = FAR_M
        rngs = [stream(seed, f"{kind}s", i) for kind, count in counts.items() for i in range(count)]
        self._goals = GoalManager(self._movers, self._graph, self._sampler, rngs, distractors.count)
        rngs_of_pace = [stream(seed, "distractors", "pace", i) for i in range(distractors.count)]
        factors = self._movers["pace"][1 : 1 + distractors.count]
        self._pace = PaceChanges(rngs_of_pace, distractors.changes_per_minute, factors)

        self._store_independent()
        occupied = [self._state[person, :2].copy() for person in self._independent]
        for person, one in self._independent.items():
            mover, line = self._movers[person], one.outline
            mover["rear_m"], mover["front_m"], mover["extra_m"] = line
            if line != Outline():
                ahead = np.array([math.cos(one.heading_rad), math.sin(one.heading_rad)])
                occupied += list(self._state[person, :2] + np.linspace(line.rear_m, line.front_m, 3)[:, None] * ahead)
        if robot_start_m is not None:
            # The line of sight at the start is kept free: the first box holds the target, not somebody in front.
            start_m = np.asarray(robot_start_m, dtype=np.float64)
            occupied += list(np.linspace(start_m, self._state[0, :2], _SIGHT_POINTS))
        for person in range(1, 1 + distractors.count):
            self._start_distractor(person, rngs[person - 1], occupied)
        self._scripted: dict[int, _Scripted] = {}
        for person, crossing in enumerate(at_different_depths(crossings), start=1 + distractors.count):
            self._start_crossing(person, crossing, occupied)
        for person, one in enumerate(oncoming, start=1 + distractors.count + len(crossings)):
            self._scripted[person] = passer = OncomingPedestrian(one, target_path, obstacles, self._state[person])
            self._headings[person] = passer.heading_rad
            self._goals.walking_speed_m_s[person] = passer.speed_m_s
        for person, pedestrian in self._scripted.items():
            if pedestrian.phase is Phase.WAITING:
                self._goals.wait_at(person, self._state[person, :2].copy())
        columns = self._state[self._robot + 1 :]
        self.carts = tuple(Cart(one, obstacles, column) for one, column in zip(carts, columns, strict=True))
        self._group()

    @property
    def positions_m(self) -> FloatArray:
        """`(P, 2)` positions on the ground [m], world frame."""
        return read_only(self._state[: self._robot, :2].copy())

    @property
    def headings_rad(self) -> FloatArray:
        """`(P,)` headings of the bodies; 0 is +x, counter-clockwise, not wrapped."""
        return read_only(self._headings.copy())

    @property
    def speeds_m_s(self) -> FloatArray:
        """`(P,)` walking speeds."""
        return read_only(np.hypot(*self._state[: self._robot, 2:].T))

    @property
    def tracked_m(self) -> Xy:
        """x, y of what is tracked [m]: the target, or the thing in its hands."""
        return self._target.tracked_m

    @property
    def target_s_m(self) -> float:
        """Arc length of the target on its path."""
        return self._target.s_m

    @property
    def postures(self) -> tuple[Posture, ...]:
        """Posture of each pedestrian."""
        walks = (self._independent.get(person) for person in range(self._robot))
        return tuple(PLAIN if one is None else one.posture for one in walks)

    def _start_distractor(self, person: int, rng: np.random.Generator, occupied: list[FloatArray]) -> None:
        walking_speed = self._distractors.speed_m_s * float(np.clip(rng.normal(1.0, 0.12), 0.75, 1.25))
        self._goals.walking_speed_m_s[person] = walking_speed
        position = self._sampler.start_position(rng, occupied)
        occupied.append(position)
        self._goals.walk_to_sampled_goal(person, 0.0, position, self.target_s_m)
        mover = self._movers[person]
        x, y = mover["waypoint_x"] - position[0], mover["waypoint_y"] - position[1]
        heading = math.atan2(y, x) if x or y else rng.uniform(-math.pi, math.pi)
        # Distractors are already walking when the episode begins.
        speed = mover["speed"]
        self._state[person] = (*position, speed * math.cos(heading), speed * math.sin(heading))
        self._headings[person] = heading

    def _start_crossing(self, person: int, crossing: Crossing, occupied: list[FloatArray]) -> None:
        state = self._state[person]
        state[:2] = self._sampler.waiting_position(np.array(crossing.waiting_m), occupied)
        occupied.append(state[:2].copy())
        self._scripted[person] = CrossingPedestrian(crossing, self._obstacles, state)
        self._goals.walking_speed_m_s[person] = _CROSSING_WALKING_SPEED_M_S
        x, y = self._target.predicted(crossing.at_s)
        self._headings[person] = math.atan2(y - state[1], x - state[0])

    def tick(self, dt_s: float, time_s: float, robot_m: Xy, camera_m: Xy) -> None:
        """Advance by a tick that ends at `time_s`, with robot and camera (without vibration) at these places."""
        robot = self._moved_robot(dt_s, robot_m)
        for walk in self._walks:
            walk.update(dt_s, robot, camera_m)
        for member in self._members:
            member.update(dt_s, time_s)
        self._store_independent()
        around = Surroundings(camera_m, robot_m, self._target)
        self._update_scripted(dt_s, time_s, around)
        for cart in self.carts:
            cart.update(dt_s, time_s, around)
        if self._reactive.stop > 1:
            self._pace.update(time_s)
            self._goals.update(dt_s, time_s, self.target_s_m)
            avoid(self._movers, self._obstacles.rectangles, dt_s)

    def _moved_robot(self, dt_s: float, robot_m: Xy) -> tuple[float, float, float, float]:
        """Store the robot's position and its velocity (differences, low-pass filtered), and return x, y, vx, vy."""
        (x, y), (last_x, last_y, vx, vy) = robot_m, self._state[self._robot].tolist()
        if last_x != FAR_M:
            share = min(dt_s / _ROBOT_VELOCITY_TIME_CONSTANT_S, 1.0)
            vx += share * ((x - last_x) / dt_s - vx)
            vy += share * ((y - last_y) / dt_s - vy)
        self._state[self._robot] = robot = x, y, vx, vy
        return robot

    def _update_scripted(self, dt_s: float, time_s: float, around: Surroundings) -> None:
        changed = False
        for person, pedestrian in self._scripted.items():
            phase = pedestrian.phase
            pedestrian.update(dt_s, time_s, around)
            if pedestrian.phase is not phase:
                changed = True
                self._assign_route(person, pedestrian, time_s, around)
        if changed:
            self._group()

    def _assign_route(self, person: int, pedestrian: _Scripted, time_s: float, around: Surroundings) -> None:
        """Give a scripted pedestrian a route before or after its script."""
        position, velocity = pedestrian.state[:2], pedestrian.state[2:]
        if pedestrian.phase is Phase.SCRIPTED:
            return
        if isinstance(pedestrian, CrossingPedestrian):
            route = self._sampler.route_off_line_of_sight(position, velocity, *self._predicted(around))
        elif pedestrian.phase is Phase.APPROACHING:
            route = self._graph.shortest_route(position, pedestrian.joining_m)
        else:
            # Off the target's path, so that a target that comes back does not meet it again.
            others = np.delete(self._state[: self._robot, :2], person, axis=0)
            heading = float(self._headings[person])
            route = self._sampler.route_aside(position, heading, others)
            if route is None:
                self._goals.walk_to_sampled_goal(person, time_s, position, self.target_s_m, heading)
                return
        self._goals.walk_and_stop(person, time_s, position, route)

    def _group(self) -> None:
        """Divide the pedestrians into reactive and scripted ones, after a phase has changed."""
        reaction = self._movers["reaction"]
        reaction[self._reactive] = 1.0
        for person, pedestrian in self._scripted.items():
            if pedestrian.phase in (Phase.SCRIPTED, Phase.WAITING):
                reaction[person] = 0.0 if pedestrian.phase is Phase.SCRIPTED else WAITING_REACTION

    def _predicted(self, around: Surroundings) -> tuple[FloatArray, FloatArray]:
        """`(K, 2)` camera and `(K, 2)` target positions at `PREDICTION_TIMES_S`.

        The camera is assumed to move with the target, by the ratio of the robot's speed to the target's.
        """
        target = np.array([self._target.predicted(ahead_s) for ahead_s in PREDICTION_TIMES_S])
        target_speed, robot_speed = np.hypot(*self._state[[0, self._robot], 2:].T).tolist()
        ratio = min(robot_speed / max(target_speed, 0.3), 1.0)
        return np.asarray(around.camera_m) + ratio * (target - around.target_m), target

    def _store_independent(self) -> None:
        """Store where those are whose way does not depend on other people."""
        for person, one in self._independent.items():
            self._state[person], self._headings[person] = one.state, one.heading_rad
