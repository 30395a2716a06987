"""Where a pillar, a wall or a stack of boxes must stand so that the target goes behind it just when asked.

Two lines of sight, from the camera through the target's centre, at the first and at the last moment: the thing is
the upright box that touches both from inside. The line of sight sweeps from one to the other in between.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.scenario import model
from pftrack_sim.scene.layout import WalkableArea
from pftrack_sim.scene.occluders.static import Placement
from pftrack_sim.simulation.dry_run import DryRun
from pftrack_sim.simulation.occlusion.line_of_sight import covered_by_box, spans

Array = NDArray[np.float64]

TARGET_GAP_M = 0.45
"""The target's centre passes no nearer."""

ROBOT_GAP_M = 0.5
"""The robot's centre passes no nearer."""

THING_GAP_M = 0.05
"""Room left between it and what already stands there."""

PILLAR_HEIGHT_M = 2.6
DEPTHS = np.round(np.arange(0.2, 0.9001, 0.02), 3)

_HALF_THICKNESS_M = {"pillar": 0.22, "wall": 0.1, "boxes": 0.28}
_THINGS = {"pillar": "a pillar", "wall": "a wall", "boxes": "boxes"}
_LEAST_HALF_WIDTH_M = 0.06
_LEAST_HEIGHT_M = 0.1
_TURNS_RAD = (0.0, 0.3, -0.3, 0.6, -0.6)
"""Turns of the box away from facing the camera, tried in this order."""


def plan_static(occluder: model.Occluder, rehearsal: DryRun, layout: WalkableArea, name: str = "occluder") -> Placement:
    """Place one pillar, wall or stack of boxes.

    Args:
        occluder: What is asked.
        rehearsal: Where camera, target and robot will be.
        layout: What already stands there, other occluders included.
        name: What to call it in an error.

    Returns:
        The placement whose depth is nearest to the one asked for; among equals, the one facing the camera.

    Raises:
        ParameterError: It cannot be placed: says why and what would work.
    """
    if occluder.kind == "walker":
        raise ParameterError(f"{name}: a walker is no standing thing; plan it with plan_walker")
    until_s = occluder.at_s + occluder.duration_s
    check_times(occluder, rehearsal, name)
    found = _search(occluder, rehearsal, ObstacleMap(layout))
    if isinstance(found, Placement):
        return found
    thing = _THINGS[occluder.kind]
    raise ParameterError(
        f"{name}: no place for {thing} that covers the target from {occluder.at_s:g} s to {until_s:g} s at any depth "
        f"from 0.2 to 0.9: {found}; use {_remedy(occluder, rehearsal, ObstacleMap(layout))}"
    )


def _search(occluder: model.Occluder, rehearsal: DryRun, ground: ObstacleMap) -> Placement | str:
    """The best placement, or why there is none."""
    rays = _Rays.of(occluder, rehearsal)
    sweep = max(rays.sweep_m(float(depth)) for depth in (occluder.depth, *DEPTHS))
    if sweep < 2.0 * _LEAST_HALF_WIDTH_M:
        return (
            f"the line of sight sweeps over no more than {sweep:.2f} m in that time, and a thing that stands still "
            f"needs at least {2.0 * _LEAST_HALF_WIDTH_M:.2f} m (does the robot trail straight behind the target?)"
        )
    reasons: dict[str, int] = {}
    fallback: Placement | None = None
    for depth in sorted({occluder.depth, *DEPTHS.tolist()}, key=lambda d: (abs(d - occluder.depth), d)):
        for turn in _TURNS_RAD:
            found = _fit(occluder, rehearsal, rays, depth, turn)
            if isinstance(found, Placement):
                reason = _objection(found, occluder, rehearsal, ground)
                if reason is None and len(found.spans_s) == 1:
                    return found
                if reason is None:
                    # It covers the target again at another time: rather another place, but better than none.
                    fallback = fallback or found
                    continue
            else:
                reason = found
            reasons[reason] = reasons.get(reason, 0) + 1
    return fallback or "; ".join(sorted(reasons, key=lambda r: -reasons[r])[:3])


def _remedy(occluder: model.Occluder, rehearsal: DryRun, ground: ObstacleMap) -> str:
    """What would work instead: the nearest time that does, or a walker."""
    last = float(rehearsal.times_s[-1]) - occluder.duration_s
    for shift in (0.5, -0.5, 1.0, -1.0, 1.5, -1.5, 2.0, -2.0, 3.0, -3.0, 4.0, -4.0, 6.0, -6.0):
        at_s = round(occluder.at_s + shift, 2)
        if float(rehearsal.times_s[0]) <= at_s <= last:
            other = occluder.model_copy(update={"at_s": at_s})
            if isinstance(_search(other, rehearsal, ground), Placement):
                return f'at_s = {at_s:g}, or kind = "walker"'
    return 'kind = "walker", or a route on which the target is seen more from the side'


def check_times(occluder: model.Occluder, rehearsal: DryRun, name: str) -> None:
    """Raise a `ParameterError` unless an occlusion begins and ends within the rehearsal."""
    first, last = float(rehearsal.times_s[0]), float(rehearsal.times_s[-1])
    until_s = occluder.at_s + occluder.duration_s
    if occluder.at_s < first or until_s > last:
        raise ParameterError(
            f"{name}: at_s = {occluder.at_s:g} and duration_s = {occluder.duration_s:g} end at {until_s:g} s, "
            f"but the episode lasts from {first:g} s to {last:g} s"
        )


@dataclass(frozen=True)
class _Rays:
    """Lines of sight on the ground at the first, middle and last moment: `(3, 2)` cameras and `(3, 2)` targets."""

    camera_m: Array
    target_m: Array
    camera_z_m: float

    @classmethod
    def of(cls, occluder: model.Occluder, rehearsal: DryRun) -> _Rays:
        times = occluder.at_s + occluder.duration_s * np.array([0.0, 0.5, 1.0])
        camera, target = rehearsal.at(times)
        return cls(camera[:, :2], target, float(camera[1, 2]))

    def point(self, depth: float) -> Array:
        """The point of the middle line at a depth."""
        return self.camera_m[1] + depth * (self.target_m[1] - self.camera_m[1])

    def sweep_m(self, depth: float) -> float:
        """Width between the first and the last line where they pass the depth's point; 0 if they do not enclose it."""
        sides = self._sides(self.point(depth))
        return abs(float(sides[2] - sides[0])) if sides[0] * sides[2] < 0.0 else 0.0

    def _sides(self, point: Array) -> Array:
        """Signed distances of a point to the left of each line."""
        way = self.target_m - self.camera_m
        way = way / np.maximum(np.hypot(*way.T), 1e-9)[:, None]
        offset = point - self.camera_m
        return way[:, 0] * offset[:, 1] - way[:, 1] * offset[:, 0]


def _fit(occluder: model.Occluder, rehearsal: DryRun, rays: _Rays, depth: float, turn_rad: float) -> Placement | str:
    """The box at a depth that touches the first and the last line from inside, or why there is none."""
    point = rays.point(depth)
    way = rays.target_m - rays.camera_m
    length = np.hypot(*way.T)
    if length.min() < 1e-6:
        return "the camera stands on the target"
    way = way / length[:, None]
    left = np.stack([-way[:, 1], way[:, 0]], axis=1)
    sides = ((point - rays.camera_m) * left).sum(axis=1)
    if sides[0] * sides[2] >= 0.0:
        return "the line of sight turns back in between"
    yaw = float(np.arctan2(left[1, 1], left[1, 0]) + turn_rad)
    along, thick = np.array([np.cos(yaw), np.sin(yaw)]), np.array([-np.sin(yaw), np.cos(yaw)])
    # Normals of both lines, pointing inwards; a box of half width a and half thickness b, shifted by s along its
    # width, touches a line when (distance of its centre) = |n.along| a + |n.thick| b. Two lines, two unknowns.
    inward = np.array([np.sign(sides[0]) * left[0], np.sign(sides[2]) * left[2]])
    gap = np.abs(sides[[0, 2]])
    slope, skew = inward @ along, np.abs(inward @ thick)
    if slope[0] * slope[1] >= 0.0:
        return "the line of sight turns back in between"
    half_thickness = min(_HALF_THICKNESS_M[occluder.kind], max(0.5 * float(gap.sum()), 0.03))
    room = gap - skew * half_thickness
    matrix = np.stack([-slope, np.abs(slope)], axis=1)
    shift, half_width = np.linalg.solve(matrix, room)
    if half_width < _LEAST_HALF_WIDTH_M:
        return "the line of sight sweeps too little"
    centre = point + shift * along
    half = (float(half_width), float(half_thickness))
    covered = covered_by_box(rehearsal.camera_m[:, :2], rehearsal.target_m, centre, half, yaw)
    height = PILLAR_HEIGHT_M if occluder.kind == "pillar" else _height_m(occluder, rehearsal, rays, centre, half, yaw)
    if height < _LEAST_HEIGHT_M:
        return f"for this share it would be lower than {_LEAST_HEIGHT_M:g} m"
    return Placement(
        occluder.kind if occluder.kind != "walker" else "pillar",
        (float(centre[0]), float(centre[1])),
        half,
        yaw,
        float(height),
        depth,
        tuple(spans(covered, rehearsal.times_s)),
    )


def _height_m(
    occluder: model.Occluder, rehearsal: DryRun, rays: _Rays, centre: Array, half: tuple[float, float], yaw: float
) -> float:
    """The height that hides `share` of the target's body, from the feet up, at the middle of the occlusion."""
    start, step = rays.camera_m[1], rays.target_m[1] - rays.camera_m[1]
    axes = np.array([(np.cos(yaw), -np.sin(yaw)), (np.sin(yaw), np.cos(yaw))])
    begin, way = (start - centre) @ axes, step @ axes
    way = np.where(np.abs(way) < 1e-12, 1e-12, way)
    middle, reach = -begin / way, np.abs(np.array(half) / way)
    near, far = float((middle - reach).max()), float((middle + reach).min())
    top = occluder.share * rehearsal.target_height_m
    # The sight of that point passes over the thing at either end of its thickness: the lower of the two decides.
    return min(rays.camera_z_m + (top - rays.camera_z_m) * share for share in (near, far))


def _objection(placement: Placement, occluder: model.Occluder, rehearsal: DryRun, ground: ObstacleMap) -> str | None:
    """Why it cannot stand there; None when it can."""
    until_s = occluder.at_s + occluder.duration_s
    step = float(np.diff(rehearsal.times_s).max()) + 1e-9
    asked = [span for span in placement.spans_s if span[0] <= until_s + 1.0 and span[1] >= occluder.at_s - 1.0]
    if len(asked) != 1 or abs(asked[0][0] - occluder.at_s) > step or abs(asked[0][1] - until_s) > step:
        return "the line of sight turns back in between"
    thing = ObstacleMap(WalkableArea((-1e4, -1e4, 1e4, 1e4), (placement.footprint("occluder"),), ()))
    if thing.clearance_m(rehearsal.target_m).min() < TARGET_GAP_M:
        return f"it would stand within {TARGET_GAP_M:g} m of the target's path"
    if thing.clearance_m(rehearsal.robot_m).min() < ROBOT_GAP_M:
        return f"it would stand within {ROBOT_GAP_M:g} m of the robot's path"
    # Its outline and the middle of it, 5 cm apart, against everything that stands.
    along = np.linspace(-1.0, 1.0, max(3, int(placement.half_m[0] / 0.025)))
    u, v = np.meshgrid(along * placement.half_m[0], np.array([-1.0, 0.0, 1.0]) * placement.half_m[1])
    cos, sin = np.cos(placement.yaw_rad), np.sin(placement.yaw_rad)
    outline = np.stack([cos * u - sin * v, sin * u + cos * v], axis=-1).reshape(-1, 2) + placement.centre_m
    if ground.clearance_m(outline).min() < THING_GAP_M:
        return "something already stands there"
    return None
