"""Planning of pedestrians and carts that cross the line of sight: side, depth and waiting place.

A static occluder cannot cover a target whom the robot follows straight behind; a cart that moves with the line of sight
covers any target, anywhere, for any time.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from pftrack_sim.agents.pedestrians.crossing import (
    WALKER_HALF_WIDTH_M,
    Crossing,
    covered_by_person,
    crossing_track,
)
from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scenario import model
from pftrack_sim.scenario.axes import OcclusionAxis
from pftrack_sim.scene.layout import WalkableArea
from pftrack_sim.scene.occluders import CART_HALF_THICKNESS_M, cart_names
from pftrack_sim.simulation.dry_run import DryRun
from pftrack_sim.simulation.occlusion.static import check_times

STEP_S = 1.0 / 20.0
MAX_SPEED_M_S = 2.2
WALL_GAP_M = 0.42  # Preferred distance of the mover's centre to walls and obstacles
_PREFERRED_SPEED_M_S = 1.2
_MOST_CLEAR_S, _ALL_CLEAR_S = 1.5, 3.2  # Times after a cover at which movers are clear of the line of sight
_NO_FAULT_COST = 0.35  # A crossing with a lower cost is good enough: other depths are not tried

# Half widths of a walking person with swinging arms, seen from behind and from the side.
_SHOULDERS_M, _CHEST_M = 0.22, 0.14
_ARMS_M = 0.03  # Part of the half width that is swinging arms, which cover little

EDGE_M_S = 1.3  # Speed of a cart's edge across the line of sight: the target is covered and uncovered in about 0.25 s
PERSON_EDGE_M_S = 1.1
CART_HALF_WIDTH_M = (0.27, 0.36)
"""Narrowest and widest cart: half way between camera and target, each covers a walking person's stride."""
TALL_CART_M = 2.1
_MIN_CART_HEIGHT_M = 0.4

_HEIGHTS = np.linspace(0.0, 1.0, 11)
_AREA_BELOW_SIDE = np.array([0.0, 0.118, 0.217, 0.324, 0.439, 0.568, 0.670, 0.768, 0.851, 0.940, 1.0])
_AREA_BELOW_BACK = np.array([0.0, 0.063, 0.131, 0.211, 0.305, 0.439, 0.592, 0.748, 0.898, 0.952, 1.0])
"""Share of a walking person's silhouette below a share of their stature, seen from the side and from behind: rendered,
mean over several people and a stride."""


@dataclass(frozen=True)
class Mover:
    """What crosses.

    Attributes:
        edge_m_s: Speed across the line of sight as it covers and uncovers the target; None for one constant speed.
        half_width_m: Half of the width that covers the line of sight.
        min_gap_m: Least distance of its centre to obstacles while it covers the target.
        depth_shifts: Depths to try, relative to the requested one.
        asides_m: Distances of waiting places from the line of sight.
    """

    name: str = "walker"
    edge_m_s: float | None = None
    half_width_m: float = WALKER_HALF_WIDTH_M
    min_gap_m: float = 0.2
    depth_shifts: tuple[float, ...] = (0.0, -0.1, 0.1, -0.2, 0.2, -0.3, 0.3)
    asides_m: tuple[float, ...] = (2.6, 1.9, 3.4, 1.3)


WALKER = Mover()


def plan_crossing(
    occluder: model.Occluder, run: DryRun, layout: WalkableArea, name: str = "occluder", mover: Mover = WALKER
) -> Crossing:
    """Choose side, depth and waiting place so that the mover has an easy course through free space.

    Every candidate is evaluated on the positions of camera and target in the dry run.

    Raises:
        ParameterError: Every course leads through obstacles while it covers the target, or the times do not fit.
    """
    check_times(occluder, run, name)
    best = _best_candidate(occluder, run, ObstacleMap(layout), mover)
    if best.hits_obstacle:
        raise ParameterError(
            f"{name}: a {mover.name} that covers the target from {occluder.at_s:g} s to "
            f"{occluder.at_s + occluder.duration_s:g} s would have to pass through an obstacle "
            "at any depth from 0.2 to 0.9; use another at_s or a shorter duration_s"
        )
    if mover.half_width_m != WALKER_HALF_WIDTH_M:
        return best.crossing
    arms_m = 0.0 if mover.edge_m_s is None else _ARMS_M
    return replace(best.crossing, half_width_m=_apparent_half_width(best.crossing, run) - arms_m)


def plan_axis_crossing(
    axis: OcclusionAxis,
    occluder: model.Occluder,
    run: DryRun,
    layout: WalkableArea,
    name: str,
    depth_shifts: tuple[float, ...],
) -> Crossing:
    """Plan one occlusion of the stress axis, by a cart or by a pedestrian.

    Raises:
        ParameterError: It is impossible.
    """
    mover = Mover("person", PERSON_EDGE_M_S, depth_shifts=depth_shifts)
    if cart_names(axis):
        half_width = float(np.clip(0.5 * EDGE_M_S * occluder.duration_s, *CART_HALF_WIDTH_M))
        asides = (1.3, 0.9, 1.9, 0.65, 2.6)
        mover = Mover("cart", EDGE_M_S, half_width, CART_HALF_THICKNESS_M + 0.02, depth_shifts, asides)
    return plan_crossing(occluder, run, layout, name, mover)


def cart_height_m(axis: OcclusionAxis, crossing: Crossing, run: DryRun) -> float:
    """Height of a cart that covers the requested share of the silhouette at the middle of the occlusion."""
    if axis.kind == "pillar":
        return TALL_CART_M
    camera, target = run.at(crossing.at_s + 0.5 * crossing.duration_s)
    distance = float(np.hypot(*(target[0] - camera[0, :2])))
    _, ends = run.at([crossing.at_s, crossing.at_s + crossing.duration_s])
    walked, sight = ends[1] - ends[0], target[0] - camera[0, :2]
    lengths = float(np.hypot(*walked) * np.hypot(*sight))
    cos2 = float((walked @ sight) ** 2 / lengths**2) if lengths > 1e-6 else 0.5
    area_below = cos2 * _AREA_BELOW_BACK + (1.0 - cos2) * _AREA_BELOW_SIDE
    top = float(np.interp(axis.share, area_below, _HEIGHTS)) * run.target_height_m
    middle = min(max(crossing.depth * distance, 0.75), distance - 0.65)
    # The line of sight to the top of the hidden part passes the cart at its front and back: the lower one decides.
    faces = (middle - CART_HALF_THICKNESS_M, middle + CART_HALF_THICKNESS_M)
    camera_z = float(camera[0, 2])
    return max(min(camera_z + (top - camera_z) * face / distance for face in faces), _MIN_CART_HEIGHT_M)


@dataclass(frozen=True)
class _Candidate:
    crossing: Crossing
    cost: float
    hits_obstacle: bool


def _best_candidate(occluder: model.Occluder, run: DryRun, obstacles: ObstacleMap, mover: Mover) -> _Candidate:
    """The first depth with a faultless candidate, or the candidate of lowest cost over all depths."""
    best: _Candidate | None = None
    for shift in mover.depth_shifts:
        depth = min(max(occluder.depth + shift, 0.2), 0.9)
        for candidate in _candidates(occluder, run, obstacles, depth, mover):
            if best is None or candidate.cost < best.cost:
                best = candidate
        if best is not None and best.cost < _NO_FAULT_COST:
            break
    assert best is not None
    return best


def _candidates(
    occluder: model.Occluder, run: DryRun, obstacles: ObstacleMap, depth: float, mover: Mover
) -> Iterator[_Candidate]:
    """Crossings from both sides and from several waiting places, with their costs."""
    sides: tuple[Literal[-1, 1], ...] = (1, -1)
    until_s = occluder.at_s + occluder.duration_s
    for side in sides:
        for aside in mover.asides_m:
            lead = min(aside / 0.9 + 0.6, occluder.at_s)
            waiting = _waiting_place(occluder, run, depth, side, lead, aside, mover.half_width_m)
            crossing = Crossing(
                occluder.at_s, occluder.duration_s, depth, side, waiting, lead, mover.half_width_m, mover.edge_m_s
            )
            start_s = max(occluder.at_s - lead - 5.0 * STEP_S, 0.0)
            times, target, track = _course(crossing, run, start_s)
            clearance = obstacles.clearance_m(track)
            cost = _course_cost(track, target, clearance[times <= until_s])
            cost += 1.0 * abs(depth - occluder.depth)
            # After the occlusion the mover may leave its course: obstacles on it cost less.
            cost += 2.0 * max(0.0, WALL_GAP_M - float(clearance.min()))
            cost += _side_effect_cost(crossing, run, start_s, times, track)
            covering = (times <= until_s) & (times >= occluder.at_s)
            # A cover that is shorter than a step has no sample of its own.
            narrow = bool((clearance[covering] < mover.min_gap_m).any())
            yield _Candidate(crossing, cost, narrow)


def _course(
    crossing: Crossing, run: DryRun, start_s: float, after_s: float = _MOST_CLEAR_S
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """`(T,)` times, and `(T, 2)` places of target and mover from a time until the crossing is over."""
    times = np.arange(start_s, min(crossing.until_s + after_s, run.end_s), STEP_S)
    camera, target = run.at(times)
    track = crossing_track(crossing, start_s, STEP_S, camera[:, :2], target)
    known = ~np.isnan(track[:, 0])
    if known.all() and after_s < _ALL_CLEAR_S:
        return _course(crossing, run, start_s, _ALL_CLEAR_S)
    return times[known], target[known], track[known]


def _course_cost(track: FloatArray, target: FloatArray, clearance: FloatArray) -> float:
    """Cost of obstacles on the course, of high or unusual speed, and of passing the target closely."""
    speed = np.hypot(*np.diff(track, axis=0).T) / STEP_S
    blocked = max(0.0, WALL_GAP_M - float(clearance.min()))
    fast = max(0.0, float(speed.max()) - 0.95 * MAX_SPEED_M_S)
    unusual = abs(float(np.median(speed)) - _PREFERRED_SPEED_M_S)
    near = max(0.0, 0.8 - float(np.hypot(*(track - target).T).min()))
    return 20.0 * blocked + 4.0 * fast + 0.3 * unusual + near


def _side_effect_cost(crossing: Crossing, run: DryRun, start_s: float, times: FloatArray, track: FloatArray) -> float:
    """Cost of covering the target at other times, and of waiting in the way of robot or target."""
    before = run.until(start_s)
    waiting = before.times_s < start_s
    moving = (times < crossing.at_s - 0.1) | (times > crossing.until_s + 0.1)
    cameras, targets = run.at(times[moving])
    camera = np.vstack([before.camera_m[waiting, :2], cameras[:, :2]])
    target = np.vstack([before.target_m[waiting], targets])
    robot = np.vstack([before.robot_m[waiting], run.robot_at(times[moving])])
    mover = np.vstack([np.tile(crossing.waiting_m, (int(waiting.sum()), 1)), track[moving]])
    covered = covered_by_person(camera, target, mover, crossing.half_width_m)
    gap = min(float(np.hypot(*(mover - robot).T).min()), float(np.hypot(*(mover - target).T).min()))
    return 2.0 * bool(covered.any()) + 5.0 * max(0.0, 0.9 - gap)


def _waiting_place(
    occluder: model.Occluder, run: DryRun, depth: float, side: int, lead: float, aside: float, half_m: float
) -> tuple[float, float]:
    """x, y [m] of the waiting place with an easy course to the crossing."""
    camera, target = run.at([occluder.at_s - 0.1, occluder.at_s, occluder.at_s + 0.1])
    points = camera[:, :2] + depth * (target - camera[:, :2])
    if lead < 1.5:
        # Too little time to start from rest: the mover is already moving when the episode begins.
        camera, target = run.at(occluder.at_s - lead)
        sight = target[0] - camera[0, :2]
        rate = 2.0 * half_m / occluder.duration_s
        x, y = camera[0, :2] + depth * sight + side * (half_m + rate * lead) * _left_of(sight)
    else:
        # From rest it covers half of the distance that the line of sight covers at the end.
        velocity = (points[2] - points[0]) / 0.2
        reach = min(aside, 0.9 * lead)
        sight = target[1] - camera[1, :2]
        x, y = points[1] - 0.5 * lead * velocity + side * (half_m + reach) * _left_of(sight)
    return float(x), float(y)


def _left_of(sight: FloatArray) -> FloatArray:
    return np.array([-sight[1], sight[0]]) / max(float(np.hypot(*sight)), 1e-9)


def _apparent_half_width(crossing: Crossing, run: DryRun) -> float:
    """Half of the width of a walker seen by the camera while covering: shoulders from behind, a chest from the side."""
    start_s = max(crossing.at_s - crossing.lead_s - 2.0 * STEP_S, 0.0)
    times = np.arange(start_s, crossing.until_s + STEP_S, STEP_S)
    camera, target = run.at(times)
    track = crossing_track(crossing, start_s, STEP_S, camera[:, :2], target)
    covering = (times >= crossing.at_s) & ~np.isnan(track[:, 0])
    steps: FloatArray = np.gradient(track, axis=0)
    walked = steps[covering]
    sight = (target - camera[:, :2])[covering]
    lengths = np.hypot(*walked.T) * np.hypot(*sight.T)
    products: FloatArray = (walked * sight).sum(axis=1)
    cosines: FloatArray = np.abs(products) / np.maximum(lengths, 1e-9)
    cos = min(float(cosines.mean()), 1.0)
    return float(np.hypot(_SHOULDERS_M * cos, _CHEST_M * np.sqrt(1.0 - cos * cos)))
