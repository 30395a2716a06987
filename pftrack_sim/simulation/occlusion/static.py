"""Placement of a pillar, a wall or a stack of boxes that covers the target at a requested time.

There are two lines of sight, at the begin and at the end of the occlusion: the occluder is the upright box that touches
both from inside. In between, the line of sight sweeps over the box. All in plan view: the target's centre line is
vertical, and an upright thing covers it where the straight line from the camera to it crosses the thing's footprint.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.types import BoolArray, FloatArray
from pftrack_sim.scenario import model
from pftrack_sim.scene.layout import WalkableArea
from pftrack_sim.scene.occluders import Placement
from pftrack_sim.simulation.dry_run import DryRun

TARGET_GAP_M = 0.45  # Least distance from the box to the path of the target
ROBOT_GAP_M = 0.5  # and to that of the robot
OBSTACLE_GAP_M = 0.05
PILLAR_HEIGHT_M = 2.6
DEPTHS: FloatArray = np.round(np.arange(0.2, 0.9001, 0.02), 3)

_HALF_THICKNESS_M = {"pillar": 0.22, "wall": 0.1, "boxes": 0.28}
_ARTICLE = {"pillar": "a pillar", "wall": "a wall", "boxes": "boxes"}
_MIN_HALF_WIDTH_M = 0.06
_MIN_HEIGHT_M = 0.1
_TURNS_RAD = (0.0, 0.3, -0.3, 0.6, -0.6)  # Rotations of the box away from facing the camera, tried in this order
_SHIFTS_S = (0.5, -0.5, 1.0, -1.0, 1.5, -1.5, 2.0, -2.0, 3.0, -3.0, 4.0, -4.0, 6.0, -6.0)
_NOT_MONOTONIC = "the line of sight turns back in between"


def plan_static(occluder: model.Occluder, run: DryRun, layout: WalkableArea, name: str = "occluder") -> Placement:
    """Place one pillar, wall or stack of boxes, as near to the requested depth as possible, then facing the camera.

    Raises:
        ParameterError: It cannot be placed; the message has the reasons and what would work.
    """
    check_times(occluder, run, name)
    obstacles = ObstacleMap(layout)
    placement = _search(occluder, run, obstacles)
    if isinstance(placement, Placement):
        return placement
    raise ParameterError(
        f"{name}: no place for {_ARTICLE[occluder.kind]} that covers the target from {occluder.at_s:g} s to "
        f"{occluder.at_s + occluder.duration_s:g} s at any depth from 0.2 to 0.9: {placement}; "
        f"use {_alternative(occluder, run, obstacles)}"
    )


def check_times(occluder: model.Occluder, run: DryRun, name: str) -> None:
    """Raise a `ParameterError` unless an occlusion begins and ends within the dry run."""
    until_s = occluder.at_s + occluder.duration_s
    if occluder.at_s < 0.0 or until_s > run.end_s:
        raise ParameterError(
            f"{name}: at_s = {occluder.at_s:g} and duration_s = {occluder.duration_s:g} end at {until_s:g} s, "
            f"but the episode lasts from 0 s to {run.end_s:g} s"
        )


def _search(occluder: model.Occluder, run: DryRun, obstacles: ObstacleMap) -> Placement | str:
    """The best placement, or the most frequent reasons why there is none."""
    rays = _Rays(occluder, run)
    sweep = max(rays.sweep_m(float(depth)) for depth in (occluder.depth, *DEPTHS))
    if sweep < 2.0 * _MIN_HALF_WIDTH_M:
        return (
            f"the line of sight sweeps over no more than {sweep:.2f} m in that time, and a static occluder "
            f"needs at least {2.0 * _MIN_HALF_WIDTH_M:.2f} m (does the robot trail straight behind the target?)"
        )
    reasons: dict[str, int] = {}
    fallback: Placement | None = None
    for depth in sorted({occluder.depth, *DEPTHS.tolist()}, key=lambda d: (abs(d - occluder.depth), d)):
        for turn in _TURNS_RAD:
            placement = _fit(occluder, run, rays, depth, turn)
            reason = placement if isinstance(placement, str) else _objection(placement, occluder, run, obstacles)
            if reason is not None:
                reasons[reason] = reasons.get(reason, 0) + 1
            elif isinstance(placement, Placement):
                if len(placement.spans_s) == 1:
                    return placement
                # It covers the target again at another time: used only if nothing better is found.
                fallback = fallback or placement
    return fallback or "; ".join(sorted(reasons, key=lambda r: -reasons[r])[:3])


def _alternative(occluder: model.Occluder, run: DryRun, obstacles: ObstacleMap) -> str:
    """What would work instead: the nearest possible time, or a walker."""
    for shift in _SHIFTS_S:
        at_s = round(occluder.at_s + shift, 2)
        if 0.0 <= at_s <= run.end_s - occluder.duration_s:
            other = occluder.model_copy(update={"at_s": at_s})
            if isinstance(_search(other, run, obstacles), Placement):
                return f'at_s = {at_s:g}, or kind = "walker"'
    return 'kind = "walker", or a route on which the target is seen more from the side'


class _Rays:
    """Lines of sight on the ground at begin, middle and end of an occlusion.

    Attributes:
        camera_m: `(3, 2)` cameras.
        target_m: `(3, 2)` targets.
        left: `(3, 2)` unit vectors square to the lines.
        camera_z_m: Height of the camera in the middle.
    """

    def __init__(self, occluder: model.Occluder, run: DryRun) -> None:
        camera, self.target_m = run.at(occluder.at_s + occluder.duration_s * np.array([0.0, 0.5, 1.0]))
        self.camera_m, self.camera_z_m = camera[:, :2], float(camera[1, 2])
        way = self.target_m - self.camera_m
        self.shortest_m = float(np.hypot(*way.T).min())
        way = way / np.maximum(np.hypot(*way.T), 1e-9)[:, None]
        self.left = np.stack([-way[:, 1], way[:, 0]], axis=1)

    def point(self, depth: float) -> FloatArray:
        """Point of the middle line at a depth."""
        return self.camera_m[1] + depth * (self.target_m[1] - self.camera_m[1])

    def sides_m(self, depth: float) -> FloatArray:
        """`(3,)` distances of that point to the left of the lines; of one sign where the first and last miss it."""
        sides: FloatArray = ((self.point(depth) - self.camera_m) * self.left).sum(axis=1)
        return sides

    def sweep_m(self, depth: float) -> float:
        """Distance between the first and the last line at a depth; 0 where they do not enclose its point."""
        sides = self.sides_m(depth)
        return abs(float(sides[2] - sides[0])) if sides[0] * sides[2] < 0.0 else 0.0


def _fit(occluder: model.Occluder, run: DryRun, rays: _Rays, depth: float, turn_rad: float) -> Placement | str:
    """The box at a depth that touches the first and the last line from inside, or why there is none."""
    assert occluder.kind != "walker"
    if rays.shortest_m < 1e-6:
        return "the camera stands on the target"
    point, left, sides = rays.point(depth), rays.left, rays.sides_m(depth)
    if sides[0] * sides[2] >= 0.0:
        return _NOT_MONOTONIC
    yaw = float(np.arctan2(left[1, 1], left[1, 0]) + turn_rad)
    along, thick = np.array([np.cos(yaw), np.sin(yaw)]), np.array([-np.sin(yaw), np.cos(yaw)])
    # Normals of both lines, pointing inwards; a box of half width a and half thickness b, shifted by s along its
    # width, touches a line when (distance of its centre) = |n.along| a + |n.thick| b. Two lines, two unknowns.
    inward = np.array([np.sign(sides[0]) * left[0], np.sign(sides[2]) * left[2]])
    gap: FloatArray = np.abs(sides[[0, 2]])
    slope: FloatArray = inward @ along
    skew: FloatArray = np.abs(inward @ thick)
    if slope[0] * slope[1] >= 0.0:
        return _NOT_MONOTONIC
    half_thickness = min(_HALF_THICKNESS_M[occluder.kind], max(0.5 * float(gap.sum()), 0.03))
    matrix = np.stack([-slope, np.abs(slope)], axis=1)
    shift, half_width = (float(v) for v in np.linalg.solve(matrix, gap - skew * half_thickness))
    if half_width < _MIN_HALF_WIDTH_M:
        return "the line of sight sweeps too little"
    centre, half = point + shift * along, (half_width, half_thickness)
    covered = covered_by_box(run.camera_m[:, :2], run.target_m, centre, half, yaw)
    height = PILLAR_HEIGHT_M if occluder.kind == "pillar" else _height_m(occluder, run, rays, centre, half, yaw)
    if height < _MIN_HEIGHT_M:
        return f"for this share it would be lower than {_MIN_HEIGHT_M:g} m"
    at = (float(centre[0]), float(centre[1]))
    return Placement(occluder.kind, at, half, yaw, height, depth, tuple(spans(covered, run.times_s)))


def _height_m(
    occluder: model.Occluder, run: DryRun, rays: _Rays, centre: FloatArray, half: tuple[float, float], yaw: float
) -> float:
    """Height that hides `share` of the target's body, from the feet up, at the middle of the occlusion."""
    enter, leave = line_in_box(rays.camera_m[1:2], rays.target_m[1:2], centre, half, yaw)
    top = occluder.share * run.target_height_m
    # The line of sight to the top of the hidden part passes the box at its near and far face: the lower one decides.
    return min(rays.camera_z_m + (top - rays.camera_z_m) * float(share[0]) for share in (enter, leave))


def _objection(placement: Placement, occluder: model.Occluder, run: DryRun, obstacles: ObstacleMap) -> str | None:
    """Why the box cannot stand there; None when it can."""
    until_s = occluder.at_s + occluder.duration_s
    step = float(np.diff(run.times_s).max()) + 1e-9
    near = [span for span in placement.spans_s if span[0] <= until_s + 1.0 and span[1] >= occluder.at_s - 1.0]
    if len(near) != 1 or abs(near[0][0] - occluder.at_s) > step or abs(near[0][1] - until_s) > step:
        return _NOT_MONOTONIC
    box = ObstacleMap(WalkableArea((-1e4, -1e4, 1e4, 1e4), (placement.footprint("occluder"),), ()))
    if box.clearance_m(run.target_m).min() < TARGET_GAP_M:
        return f"it would stand within {TARGET_GAP_M:g} m of the target's path"
    if box.clearance_m(run.robot_m).min() < ROBOT_GAP_M:
        return f"it would stand within {ROBOT_GAP_M:g} m of the robot's path"
    # Its outline and centre line, sampled every 5 cm.
    along = np.linspace(-1.0, 1.0, max(3, int(placement.half_m[0] / 0.025)))
    u, v = np.meshgrid(along * placement.half_m[0], np.array([-1.0, 0.0, 1.0]) * placement.half_m[1])
    cos, sin = np.cos(placement.yaw_rad), np.sin(placement.yaw_rad)
    samples = np.stack([cos * u - sin * v, sin * u + cos * v], axis=-1).reshape(-1, 2) + placement.centre_m
    if obstacles.clearance_m(samples).min() < OBSTACLE_GAP_M:
        return "something already stands there"
    return None


def line_in_box(
    start: FloatArray, end: FloatArray, centre_m: Sequence[float] | FloatArray, half_m: Sequence[float], yaw_rad: float
) -> tuple[FloatArray, FloatArray]:
    """Shares of the ways from start to end `(T, 2)` at which the infinite lines enter and leave a box, `(T,)` each.

    A line misses the box where it leaves before it enters.
    """
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    axes = np.array([(cos, -sin), (sin, cos)])
    local = (start - np.asarray(centre_m)) @ axes
    step = (end - start) @ axes
    step = np.where(np.abs(step) < 1e-12, 1e-12, step)
    middle, reach = -local / step, np.abs(np.asarray(half_m) / step)
    return (middle - reach).max(axis=1), (middle + reach).min(axis=1)


def covered_by_box(
    camera_m: FloatArray,
    target_m: FloatArray,
    centre_m: Sequence[float] | FloatArray,
    half_m: Sequence[float],
    yaw_rad: float,
) -> BoolArray:
    """`(T,)` whether a static box is between camera and target, both at `(T, 2)` points on the ground.

    The box has its centre at `(2,)` and half sizes `(2,)` along its axes, the first of which is at an angle to the
    world's x.
    """
    enter, leave = line_in_box(camera_m, target_m, centre_m, half_m, yaw_rad)
    return np.maximum(enter, 0.0) <= np.minimum(leave, 1.0)


def spans(covered: BoolArray, times_s: FloatArray) -> list[tuple[float, float]]:
    """First and last covered time of each uninterrupted occlusion."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], covered, [False]]).astype(np.int8)))
    return [(float(times_s[a]), float(times_s[b - 1])) for a, b in zip(edges[::2], edges[1::2], strict=True)]
