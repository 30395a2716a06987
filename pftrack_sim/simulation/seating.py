"""Seats where the target and groups sit down, and whether people get there and past each other."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pftrack_sim.agents.path import Path
from pftrack_sim.agents.pedestrians.groups import group_members
from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap
from pftrack_sim.agents.pedestrians.target import places_alone
from pftrack_sim.agents.pedestrians.target_actions import SEAT_FACING_RAD, SITTING_FROM_S
from pftrack_sim.scenario import ResolvedScenario
from pftrack_sim.scenario.actions import Sit, title
from pftrack_sim.scenario.groups import Companions, Seated
from pftrack_sim.scene.layout import WalkableArea
from pftrack_sim.scene.places.seats import Seat
from pftrack_sim.simulation.dry_run import DryRun

_SITTER_M = 1.7  # Stature for which the seats of groups are placed
_MISSED_M = 0.08  # Farther beside its seat than this a person would sit on its edge
_ROBOT_M, _TARGET_M = 0.55, 0.45  # Least distances of the members of groups
_HALF_SEAT_M, _HALF_DEPTH_M = 0.65, 0.25


def planned_seats(settings: ResolvedScenario, path: Path) -> list[Seat]:
    """Seats of the target's actions, by time, then those of groups."""
    seats: list[Seat] = []
    target = settings.target
    sits = sorted((one for one in target.actions if isinstance(one, Sit)), key=lambda one: one.at_s)
    found = places_alone(path, target, settings.axes.target, [one.at_s + SITTING_FROM_S for one in sits])
    for action, (s_m, (x, y, _)) in zip(sits, found, strict=True):
        heading = path.pose(s_m)[2] + SEAT_FACING_RAD[action.side]
        seats.append(Seat(action.seat, x, y, heading, target.height_m))
    for group in settings.groups:
        if isinstance(group, Seated):
            seats.append(Seat(group.seat, *group.at_m, math.radians(group.heading_deg), _SITTER_M))
    return seats


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
    """One line for each seat that the target does not reach, and for each group that is in a way."""
    lines: list[str] = []
    sits = [(index, one) for index, one in enumerate(settings.target.actions) if isinstance(one, Sit)]
    for (index, action), seat in zip(sorted(sits, key=lambda item: item[1].at_s), seats, strict=False):
        (x, y) = run.at(action.at_s + SITTING_FROM_S)[1][0].tolist()
        if math.hypot(x - seat.x_m, y - seat.y_m) > _MISSED_M:
            lines.append(f"target.{title(index, action)}: the robot keeps it from its seat")
    for index, group in enumerate(settings.groups):
        if isinstance(group, Companions):
            continue
        tracks = [member.track(run.times_s) for member in group_members([group], path)]
        for who, other, least_m in (("robot", run.robot_m, _ROBOT_M), ("target", run.target_m, _TARGET_M)):
            gaps = np.min([np.hypot(*(track - other).T) for track in tracks], axis=0)
            if gaps.min() < least_m:
                time_s = run.times_s[int(gaps.argmin())]
                lines.append(f"groups.{index}: comes within {gaps.min():.2f} m of the {who} at {time_s:.1f} s")
    return lines
