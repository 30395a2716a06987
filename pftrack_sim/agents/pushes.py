"""What becomes of a thing that is pushed: it is simulated alone in its place, before the episode."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace
from functools import partial

import mujoco
import numpy as np

from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap, Xy
from pftrack_sim.agents.pushed_thing import PushedWay
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scenario.thing import Push, Thing
from pftrack_sim.scene.layout import Footprint, WalkableArea, edges
from pftrack_sim.scene.thing import half_sizes_m, solid

_SAMPLE_S, _STEPS = 0.004, 16  # Time between poses, and physics steps in it
_CONTACT_S = 0.005  # How long it touches a wall as it bounces: 20 steps, in which it gives way by some mm
_IMPEDANCE, _IMPEDANCE_M = 0.98, 0.001
_TORSION_M = 0.002
_STILL_M_S, _STILL_S = 0.005, 0.1  # It lies still when nothing of it has been faster for this time

_PAUSE_S, _SPEED_M_S = (0.6, 1.6), (1.5, 3.2)  # Of pushes that are drawn
_HEADINGS, _FREE_M, _HOME_M = 24, 2.0, 4.0  # They go where this is free, and from farther away towards the start


def pushed_way(
    thing: Thing, start_m: Xy, layout: WalkableArea, duration_s: float, rng: np.random.Generator
) -> PushedWay:
    """Let a thing be pushed in a place in which nothing else moves.

    Args:
        thing: With its pushes.
        start_m: Where it lies at first, upright, its front in the direction of the first push.
        layout: Of the place. The thing touches the same boxes as the robot does.
        duration_s: How long.
        rng: Draws the pushes of a thing that has none, one whenever it lies still.

    Raises:
        ParameterError: It would lie in something.
    """
    reach_m = float(half_sizes_m(thing)[:2].max())
    obstacles = ObstacleMap(layout)
    distances = obstacles.distances(np.array(start_m)[:, None])[0]
    if distances.min() < reach_m:
        names = [f"{one.name!r}" for one in layout.footprints] + ["the edge of the walkable area"] * 4
        raise ParameterError(
            f"{thing.name!r} would lie in {names[int(distances.argmin())]} at {start_m[0]:.2f}, {start_m[1]:.2f}"
        )
    half_width_m = 0.9 * min(half_sizes_m(thing)[:2].tolist())
    draw = None if thing.pushes else partial(_drawn, obstacles, start_m, half_width_m, rng)
    pushes = deque(sorted(thing.pushes, key=lambda one: one.at_s))
    if draw is not None:
        pushes.append(draw(0.0, start_m))
    yaw_rad = math.radians(pushes[0].direction_deg)
    model = _compiled(thing, start_m, yaw_rad, layout)
    data = mujoco.MjData(model)
    size_m, moves, quiet_s, pushed_s = float(model.geom_rbound[-1]), False, 0.0, list[float]()
    poses = np.empty((1 + math.ceil(duration_s / _SAMPLE_S), 7))
    poses[0] = data.qpos
    for sample in range(1, len(poses)):
        while pushes and pushes[0].at_s <= (sample - 1) * _SAMPLE_S:
            push, moves, quiet_s = pushes.popleft(), True, 0.0
            way = math.radians(push.direction_deg)
            data.qvel[:2] = push.speed_m_s * math.cos(way), push.speed_m_s * math.sin(way)
            pushed_s.append((sample - 1) * _SAMPLE_S)
        if moves:
            mujoco.mj_step(model, data, _STEPS)
            speed, spin = np.linalg.norm(data.qvel.reshape(2, 3), axis=1).tolist()
            quiet_s = quiet_s + _SAMPLE_S if max(speed, spin * size_m) < _STILL_M_S else 0.0
            if quiet_s >= _STILL_S:
                # From here on it stays, to the bit: a soft contact would let it creep.
                moves, data.qvel[:] = False, 0.0
                if draw is not None:
                    x, y = data.qpos[:2].tolist()
                    pushes.append(draw(sample * _SAMPLE_S, (x, y)))
        poses[sample] = data.qpos
    poses.setflags(write=False)
    return PushedWay(_SAMPLE_S, poses[:, :3], poses[:, 3:], tuple(pushed_s), yaw_rad)


def _drawn(
    obstacles: ObstacleMap, home_m: Xy, half_width_m: float, rng: np.random.Generator, now_s: float, at_m: Xy
) -> Push:
    """The next push of a thing that came to rest."""
    here, at_s = np.array(at_m), now_s + rng.uniform(*_PAUSE_S)
    headings = rng.uniform(-math.pi, math.pi, _HEADINGS)
    ways = np.column_stack([np.cos(headings), np.sin(headings)])
    free = ~obstacles.blocked(here, here + _FREE_M * ways, half_width_m)
    home = np.array(home_m) - here
    if np.hypot(*home) > _HOME_M:
        free &= ways @ home > 0.0
    direction_deg = math.degrees(headings[int(free.argmax())])
    return Push(at_s=at_s, speed_m_s=float(rng.uniform(*_SPEED_M_S)), direction_deg=direction_deg)


def with_robot(layout: WalkableArea, start_m: Xy, half_width_m: float) -> WalkableArea:
    """A place with a robot that stands in it."""
    robot = Footprint("robot", start_m, (half_width_m, half_width_m), 0.0, 1.0)
    return replace(layout, footprints=(*layout.footprints, robot))


def _compiled(thing: Thing, start_m: Xy, yaw_rad: float, layout: WalkableArea) -> mujoco.MjModel:
    """The thing as a free body on the ground, among the boxes that stand there; its geom is the last one."""
    spec = mujoco.MjSpec()
    spec.option.timestep = _SAMPLE_S / _STEPS
    # Coulomb's cone: with a pyramid friction would depend on the direction.
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 1.0])
    for one in (*layout.footprints, *edges(layout.bounds_m)):
        x, y = one.centre_m
        box = spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[*one.half_m, 0.5 * one.height_m])
        box.pos, box.quat = [x, y, 0.5 * one.height_m], _upright(one.yaw_rad)
    half_m = half_sizes_m(thing)
    kind, size = solid(thing)
    body = spec.worldbody.add_body(pos=[*start_m, half_m[2]], quat=_upright(yaw_rad))
    body.add_freejoint()
    geom = body.add_geom(type=kind, size=size, condim=6, priority=1)  # What it touches has no say in these:
    ball = kind == mujoco.mjtGeom.mjGEOM_SPHERE
    geom.typeinertia = mujoco.mjtGeomInertia.mjINERTIA_SHELL if ball else mujoco.mjtGeomInertia.mjINERTIA_VOLUME
    geom.friction = [thing.friction, _TORSION_M, thing.rolling_resistance * size[0]]
    geom.solref, geom.solimp = _spring(thing.restitution), [_IMPEDANCE, _IMPEDANCE, _IMPEDANCE_M, 0.5, 2.0]
    return spec.compile()


def _spring(restitution: float) -> FloatArray:
    """`(2,)` stiffness and damping, as MuJoCo's `solref` has them, of a contact that gives back a share of the speed.

    A damped spring that pushes but does not pull is left with exp(-2 phi / tan(phi)) of the speed, where cos(phi) is
    its damping ratio (after Schwager and Poeschel 2007).
    """
    phi = np.linspace(1e-3, 0.5 * math.pi, 1000)
    ratio = math.cos(float(np.interp(restitution, np.exp(-2.0 * phi / np.tan(phi)), phi)))
    rate = math.pi / _CONTACT_S
    return np.array([-(rate**2), -2.0 * ratio * rate]) / _IMPEDANCE


def _upright(yaw_rad: float) -> list[float]:
    return [math.cos(0.5 * yaw_rad), 0.0, 0.0, math.sin(0.5 * yaw_rad)]
