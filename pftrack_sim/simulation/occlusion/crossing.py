"""How a walker should cross: from which side, where, and from where it comes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap
from pftrack_sim.agents.pedestrians.occlusion_trajectory import WALKER_HALF_WIDTH_M, Crossing, crossing_track
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.scenario import model
from pftrack_sim.scene.layout import WalkableArea
from pftrack_sim.simulation.dry_run import DryRun
from pftrack_sim.simulation.occlusion.line_of_sight import covered_by_person
from pftrack_sim.simulation.occlusion.static import check_times

Array = NDArray[np.float64]

STEP_S = 1.0 / 30.0
FASTEST_M_S = 2.2
_PLEASANT_M_S = 1.2
_ASIDE_M = (2.6, 1.9, 3.4, 1.3)
_SHOULDERS_M = 0.22
_CHEST_M = 0.14
"""Half widths of a walking person with swinging arms, seen from behind and from the side."""

_ARMS_M = 0.03
"""So much of the half width is swinging arms, which cover little."""

_DEPTHS = (0.0, -0.1, 0.1, -0.2, 0.2, -0.3, 0.3)


@dataclass(frozen=True)
class Mover:
    """What crosses.

    Attributes:
        what: What to call it.
        edge_m_s: Speed across the line of sight as it covers and frees the target; None for one even speed.
        half_width_m: Half of the width that covers the line of sight.
        wall_gap_m: Room that its centre likes to have to walls and things.
        least_gap_m: Room that it needs while it covers the target.
        depths: Where else it may cross, relative to what is asked.
        asides_m: How far from the line of sight it may wait.
    """

    what: str
    edge_m_s: float | None
    half_width_m: float
    wall_gap_m: float
    least_gap_m: float
    depths: tuple[float, ...] = _DEPTHS
    asides_m: tuple[float, ...] = _ASIDE_M


PASSER_BY = Mover("walker", None, WALKER_HALF_WIDTH_M, 0.42, 0.2)


@dataclass(frozen=True)
class _Try:
    crossing: Crossing
    cost: float
    hits_now: bool


def plan_walker(
    occluder: model.Occluder,
    rehearsal: DryRun,
    layout: WalkableArea,
    name: str = "occluder",
    mover: Mover = PASSER_BY,
) -> Crossing:
    """Choose side, depth and waiting place so that the walk is an easy one through free space.

    The walk itself is evaluated as it happens, from the camera and the target as they then are.

    Args:
        occluder: What is asked; its kind is "walker".
        rehearsal: Where camera and target will be, more or less.
        layout: What stands there, other occluders included.
        name: What to call it in an error.
        mover: Who or what crosses.

    Raises:
        ParameterError: It would have to walk through something while covering the target, or the times do not fit.
    """
    check_times(occluder, rehearsal, name)
    ground = ObstacleMap(layout)
    best: _Try | None = None
    for shift in mover.depths:
        depth = min(max(occluder.depth + shift, 0.2), 0.9)
        for side in (1, -1):
            for aside in mover.asides_m:
                found = _attempt(occluder, rehearsal, ground, depth, side, aside, mover)
                if best is None or found.cost < best.cost:
                    best = found
        if best is not None and best.cost < 0.35:
            break
    if best is None or best.hits_now:
        raise ParameterError(
            f"{name}: a {mover.what} that covers the target from {occluder.at_s:g} s to "
            f"{occluder.at_s + occluder.duration_s:g} s would have to walk through something that stands there, "
            "at any depth from 0.2 to 0.9; use another at_s or a shorter duration_s"
        )
    if mover.half_width_m != WALKER_HALF_WIDTH_M:
        return best.crossing
    slimmer_m = 0.0 if mover.edge_m_s is None else _ARMS_M
    return replace(best.crossing, half_width_m=_seen_half_width(best.crossing, rehearsal) - slimmer_m)


def _seen_half_width(crossing: Crossing, rehearsal: DryRun) -> float:
    """Half of the width the walker shows to the camera while covering: shoulders from behind, a chest from the side."""
    start_s = max(crossing.at_s - crossing.lead_s - 2.0 * STEP_S, float(rehearsal.times_s[0]))
    grid = np.arange(start_s, crossing.until_s + STEP_S, STEP_S)
    camera, target = rehearsal.at(grid)
    track = crossing_track(crossing, start_s, STEP_S, camera[:, :2], target)
    covering = (grid >= crossing.at_s) & ~np.isnan(track[:, 0])
    walked = np.gradient(track, axis=0)[covering]
    sight = (target - camera[:, :2])[covering]
    lengths = np.hypot(*walked.T) * np.hypot(*sight.T)
    facing = np.abs((walked * sight).sum(axis=1)) / np.maximum(lengths, 1e-9)
    cos = float(np.clip(np.mean(facing), 0.0, 1.0))
    return float(np.hypot(_SHOULDERS_M * cos, _CHEST_M * np.sqrt(1.0 - cos * cos)))


def _attempt(
    occluder: model.Occluder,
    rehearsal: DryRun,
    ground: ObstacleMap,
    depth: float,
    side: Literal[-1, 1],
    aside: float,
    mover: Mover,
) -> _Try:
    """One way to do it, and how bad it is: below 0.35 is a walk without fault."""
    begin_s = float(rehearsal.times_s[0])
    until_s = occluder.at_s + occluder.duration_s
    lead = min(aside / 0.9 + 0.6, occluder.at_s - begin_s)
    stage = _stage(occluder, rehearsal, depth, side, lead, aside, mover.half_width_m)
    crossing = Crossing(
        occluder.at_s, occluder.duration_s, depth, side, stage, lead, mover.half_width_m, mover.edge_m_s
    )
    start_s = max(occluder.at_s - lead - 5.0 * STEP_S, begin_s)
    grid = np.arange(start_s, min(until_s + 3.2, float(rehearsal.times_s[-1])), STEP_S)
    camera, target = rehearsal.at(grid)
    track = crossing_track(crossing, start_s, STEP_S, camera[:, :2], target)
    known = ~np.isnan(track[:, 0])
    track, target, grid = track[known], target[known], grid[known]
    speed = np.hypot(*np.diff(track, axis=0).T) / STEP_S
    clearance = ground.clearance_m(track)
    # After the crossing it may leave its course: what stands there is a nuisance, no more.
    before = grid <= until_s
    forced = before & (grid >= occluder.at_s)
    hits = max(0.0, mover.wall_gap_m - float(clearance[before].min()))
    fast = max(0.0, float(speed.max()) - 0.95 * FASTEST_M_S)
    pleasant = abs(float(np.median(speed)) - _PLEASANT_M_S)
    near = max(0.0, 0.8 - float(np.hypot(*(track - target).T).min()))
    cost = 20.0 * hits + 4.0 * fast + 0.3 * pleasant + near + 1.0 * abs(depth - occluder.depth)
    cost += 2.0 * max(0.0, mover.wall_gap_m - float(clearance.min()))
    cost += _spoils(crossing, rehearsal, start_s, grid, track)
    return _Try(crossing, cost, bool(clearance[forced].min() < mover.least_gap_m))


def _spoils(crossing: Crossing, rehearsal: DryRun, start_s: float, grid: Array, track: Array) -> float:
    """What else the walk would do: cover the target at other times, or stand in the way while waiting."""
    waiting = rehearsal.times_s < start_s
    stage = np.broadcast_to(np.asarray(crossing.waiting_m), (int(waiting.sum()), 2))
    walked = (grid < crossing.at_s - 0.1) | (grid > crossing.until_s + 0.1)
    cameras, targets = rehearsal.at(grid[walked])
    camera = np.vstack([rehearsal.camera_m[waiting, :2], cameras[:, :2]])
    target = np.vstack([rehearsal.target_m[waiting], targets])
    person = np.vstack([stage, track[walked]])
    covered = covered_by_person(camera, target, person, crossing.half_width_m)
    robot = np.vstack(
        [
            rehearsal.robot_m[waiting],
            np.stack([np.interp(grid[walked], rehearsal.times_s, c) for c in rehearsal.robot_m.T], axis=1),
        ]
    )
    apart = min(float(np.hypot(*(person - robot).T).min()), float(np.hypot(*(person - target).T).min()))
    return 2.0 * bool(covered.any()) + 5.0 * max(0.0, 0.9 - apart)


def _stage(
    occluder: model.Occluder, rehearsal: DryRun, depth: float, side: int, lead: float, aside: float, half_m: float
) -> tuple[float, float]:
    """Where to wait so that the walk to the crossing is a natural one."""
    camera, target = rehearsal.at([occluder.at_s - 0.1, occluder.at_s, occluder.at_s + 0.1])
    ground_camera = camera[:, :2]
    points = ground_camera + depth * (target - ground_camera)
    along = (points[2] - points[0]) / 0.2
    way = target[1] - ground_camera[1]
    left = np.array([-way[1], way[0]]) / max(float(np.hypot(*way)), 1e-9)
    if lead < 1.5:
        # No time to set off: already on the way when the episode begins.
        camera, target = rehearsal.at(occluder.at_s - lead)
        way = target[0] - camera[0, :2]
        left = np.array([-way[1], way[0]]) / max(float(np.hypot(*way)), 1e-9)
        rate = 2.0 * half_m / occluder.duration_s
        stage = camera[0, :2] + depth * way + side * (half_m + rate * lead) * left
    else:
        # From rest it covers half the way that the line of sight covers at the end.
        reach = min(aside, 0.9 * lead)
        stage = points[1] - 0.5 * lead * along + side * (half_m + reach) * left
    return float(stage[0]), float(stage[1])
