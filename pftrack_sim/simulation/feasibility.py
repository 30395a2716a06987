"""Whether robot and target can be where a scenario puts them, and whether the camera can see the target at all.

It is checked before anything is drawn. Only whether people pass each other needs the dry run.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pftrack_sim.agents.path import Path
from pftrack_sim.agents.pedestrians.groups import group_places
from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap
from pftrack_sim.agents.pedestrians.outline import Outline
from pftrack_sim.agents.pedestrians.target import SEAT_FACING_RAD, SITTING_FROM_S, mean_speed_m_s, places_alone
from pftrack_sim.agents.robot.script import Script
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scenario import ResolvedScenario
from pftrack_sim.scenario.axes import TargetAxis
from pftrack_sim.scenario.people import Companions, FurtherTarget, Seated, Sit, title
from pftrack_sim.scenario.robot import StillRoute
from pftrack_sim.scene.layout import WalkableArea
from pftrack_sim.scene.places.seats import Seat
from pftrack_sim.scene.robot import REST_YAW_RAD
from pftrack_sim.scene.thing import half_sizes_m
from pftrack_sim.simulation.dry_run import DryRun

_STEP_M = 0.1
_OUTSIDE_M = 1.0 + 1e-6  # Paths may end this far outside the area that other pedestrians stay in; and rounding
_BODY_M = 0.2  # Half the depth of a person
_LEAST_PX = 2.0  # A target that is lower than this in the image cannot be seen
_VIEW_MARGIN_RAD = math.radians(20.0)  # For the width of the target, the operator's swings and the vibration
_LEAST_WAY_SEEN = 0.5  # Share of its way after which a target may leave the view of a camera at rest for good
_SITTER_M = 1.7  # Stature for which the seats of groups are placed
_MISSED_M = 0.08  # Farther beside its seat than this a person would sit on its edge
_ROBOT_M, _TARGET_M = 0.55, 0.45  # Least distances of the members of groups
_HALF_SEAT_M, _HALF_DEPTH_M = 0.65, 0.25


def path_problems(settings: ResolvedScenario, layout: WalkableArea, path: Path) -> list[str]:
    """For each target a line for the first thing that it would walk through, or the point where it leaves the place."""
    # What is pushed has met the walls already.
    ways = {} if settings.target.pushed else {"target.path_m: the target": (path, settings.target.speed_m_s)}
    for where, one in _further(settings):
        ways[f"{where}.path_m: {one.name}"] = Path(one.path_m), one.speed_m_s
    found = [
        _misplaced(_walked(way, speed_m_s * settings.duration_s), layout, 0.0, f"{who} would walk through", "leave")
        for who, (way, speed_m_s) in ways.items()
    ]
    return [line for line in found if line is not None]


def _further(settings: ResolvedScenario) -> list[tuple[str, FurtherTarget]]:
    """Further targets that walk, each after its place in the scenario."""
    return [(f"targets.{index}", one) for index, one in enumerate(settings.targets) if one.path_m]


def placement_problems(settings: ResolvedScenario, layout: WalkableArea, path: Path, script: Script) -> list[str]:
    """One line for each thing that the robot would stand in, and one if the camera soon sees the target no more."""
    target = _walked(path, mean_speed_m_s(path, settings.target) * settings.duration_s)
    start = script.start_pose()
    robot = np.array([[start.x_m], [start.y_m]])
    radius_m, found = settings.robot.half_width_m, list[str | None]()
    if isinstance(settings.robot.route, StillRoute):
        found.append(_misplaced(robot, layout, radius_m, "robot.route: the robot would stand in", "be outside"))
    # A target that is pushed bounces off a robot that stands.
    passes = isinstance(settings.robot.route, StillRoute) and not settings.target.pushed
    gap_m = float(np.hypot(*((target if passes else target[:, :1]) - robot)).min())
    thing = settings.target.thing
    body_m = _BODY_M if thing is None else float(half_sizes_m(thing)[:2].max())
    if gap_m < radius_m + body_m:
        found.append(
            f"robot.route: the robot would stand on the target: their centres come within {gap_m:.2f} m, "
            f"at least {radius_m + body_m:.2f} m are needed"
        )
    found.append(_unseen(settings, target - robot))
    return [line for line in found if line is not None]


def _walked(path: Path, walked_m: float) -> FloatArray:
    """`(2, N)` points of the path as far as a target comes at its nominal speed."""
    walked_m = min(path.length_m, walked_m)
    # Not beyond it: the path goes on straight after its end.
    return np.stack(path.at(np.minimum(np.arange(0.0, walked_m + _STEP_M, _STEP_M), walked_m))[:2])


def _misplaced(points_m: FloatArray, layout: WalkableArea, radius_m: float, into: str, outside: str) -> str | None:
    """The first thing that a disc at one of `(2, N)` points is in, or the point where it leaves the walkable area."""
    distances = ObstacleMap(layout).distances(points_m)
    count = len(layout.footprints)
    hit = np.flatnonzero((distances[:, :count] < radius_m).any(axis=1))
    left = np.flatnonzero((distances[:, count:] < -_OUTSIDE_M).any(axis=1))
    if len(hit):
        x, y = points_m[:, hit[0]]
        return f"{into} {layout.footprints[int(np.argmin(distances[hit[0], :count]))].name!r} at {x:.1f}, {y:.1f}"
    if len(left):
        x, y = points_m[:, left[0]]
        x_min, y_min, x_max, y_max = layout.bounds_m
        area = f"x {x_min:g} to {x_max:g}, y {y_min:g} to {y_max:g}"
        where = into.rpartition(" would ")[0]
        return f"{where} would {outside} the walkable area ({area}) at {x:.1f}, {y:.1f}"
    return None


def _unseen(settings: ResolvedScenario, offset_m: FloatArray) -> str | None:
    """Why a robot at rest does not see the target on the second half of its way; `(2, N)` positions relative to it."""
    robot, camera = settings.robot, settings.camera
    half_v = camera.half_view_rad[1]
    focal_px = 0.5 * camera.height_px / math.tan(half_v)
    nearest_m = float(np.hypot(*offset_m).min())
    if not isinstance(robot.route, StillRoute):
        return None
    thing = settings.target.thing
    if (settings.target.height_m if thing is None else thing.height_m) * focal_px < _LEAST_PX * nearest_m:
        return f"target.path_m: the target is at least {nearest_m:.0f} m away: too small in the image to be seen"
    if robot.gaze == "forward":
        half = math.atan(0.5 * camera.width_px / focal_px) + _VIEW_MARGIN_RAD
        ahead = math.radians(robot.route.heading_deg) + REST_YAW_RAD[camera.mount]
        bearings = np.arctan2(offset_m[1], offset_m[0]) - ahead
        seen = np.flatnonzero(np.abs((bearings + np.pi) % (2.0 * np.pi) - np.pi) <= half)
        if not len(seen):
            return "robot.gaze: the target is never in view: the camera looks another way during the whole episode"
        if seen[-1] < _LEAST_WAY_SEEN * (len(bearings) - 1):
            share = seen[-1] / (len(bearings) - 1)
            return f"robot.gaze: the target leaves the view for good after {share:.0%} of its way"
    return None


def planned_seats(settings: ResolvedScenario, path: Path) -> list[Seat]:
    """Seats of the target's actions, by time, then those of groups."""
    seats: list[Seat] = []
    target = settings.target
    sits = sorted((one for one in target.actions if isinstance(one, Sit)), key=lambda one: one.at_s)
    found = places_alone(path, target, settings.axes.target, [one.at_s + SITTING_FROM_S for one in sits])
    for action, (s_m, (x, y, _)) in zip(sits, found, strict=True):
        heading = path.pose(s_m)[2] + SEAT_FACING_RAD[action.side]
        seats.append(Seat(action.seat, x, y, heading, target.height_m))
    return seats + group_seats(settings)


def group_seats(settings: ResolvedScenario) -> list[Seat]:
    """Seats of groups."""
    return [
        Seat(group.seat, *group.at_m, math.radians(group.heading_deg), _SITTER_M)
        for group in settings.groups
        if isinstance(group, Seated)
    ]


def seat_problems(seats: Sequence[Seat], layout: WalkableArea) -> list[str]:
    """One line for each seat that would stand in something or outside of the place."""
    others = tuple(one for one in layout.footprints if not one.name.startswith("seat-"))
    obstacles, lines = ObstacleMap(replace(layout, footprints=others)), list[str]()
    for seat in seats:
        along = np.linspace(-_HALF_SEAT_M, _HALF_SEAT_M, 9)[:, None] * (
            -math.sin(seat.heading_rad),
            math.cos(seat.heading_rad),
        )
        if obstacles.clearance_m(np.array(seat.centre_m) + along).min() < _HALF_DEPTH_M:
            x, y = seat.centre_m
            lines.append(f"a {seat.kind} to sit on has no room at {x:.1f}, {y:.1f}")
    return lines


def meeting_problems(settings: ResolvedScenario, path: Path, seats: Sequence[Seat], run: DryRun) -> list[str]:
    """One line for each seat that the target does not reach, and for each group or further target in a way.

    So for a robot that drives into the way of a thing that is pushed.
    """
    lines: list[str] = []
    thing = settings.target.thing
    if thing is not None and settings.target.pushed and not isinstance(settings.robot.route, StillRoute):
        least_m = settings.robot.half_width_m + float(half_sizes_m(thing)[:2].max())
        gaps = np.hypot(*(run.robot_m - run.target_m).T)
        if gaps.min() < least_m:
            time_s = run.times_s[int(gaps.argmin())]
            lines.append(f"target.thing.pushes: {thing.name!r} runs into the robot at {time_s:.1f} s")
    sits = [(index, one) for index, one in enumerate(settings.target.actions) if isinstance(one, Sit)]
    for (index, action), seat in zip(sorted(sits, key=lambda item: item[1].at_s), seats, strict=False):
        (x, y) = run.at(action.at_s + SITTING_FROM_S)[1][0].tolist()
        if math.hypot(x - seat.x_m, y - seat.y_m) > _MISSED_M:
            lines.append(f"target.{title(index, action)}: the robot keeps it from its seat")
    met = {
        f"groups.{index}": [
            np.array([place(time_s, 0.0)[:2] for time_s in run.times_s.tolist()])
            for place in group_places([group], path)
        ]
        for index, group in enumerate(settings.groups)
        if not isinstance(group, Companions)
    }
    for where, one in _further(settings):
        places = places_alone(Path(one.path_m), one.person, TargetAxis(), run.times_s.tolist())
        met[where] = [np.array([place[:2] for _, place in places])]
    target_m = _TARGET_M + Outline.of(settings.target).extra_m
    for where, tracks in met.items():
        for who, other, least_m in (("robot", run.robot_m, _ROBOT_M), ("target", run.target_m, target_m)):
            gaps = np.min([np.hypot(*(track - other).T) for track in tracks], axis=0)
            if gaps.min() < least_m:
                time_s = run.times_s[int(gaps.argmin())]
                lines.append(f"{where}: comes within {gaps.min():.2f} m of the {who} at {time_s:.1f} s")
    return lines
