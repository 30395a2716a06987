"""What is arranged before an episode begins: who comes between camera and target, who passes by, and when."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pftrack_sim.agents.path import Path
from pftrack_sim.agents.pedestrians.crossing import Crossing
from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap
from pftrack_sim.agents.pedestrians.oncoming import OncomingPass, plan_oncoming_pass, positions_away_from
from pftrack_sim.core import random_streams
from pftrack_sim.core.errors import ParameterError, ScenarioError
from pftrack_sim.scenario import ResolvedScenario
from pftrack_sim.scene.layout import WalkableArea
from pftrack_sim.scene.occluders.bodies import occluder_names
from pftrack_sim.scene.occluders.carts import asked_of, cart_names
from pftrack_sim.scene.occluders.placement import Placement
from pftrack_sim.simulation.dry_run import DryRun
from pftrack_sim.simulation.occlusion.carts import height_m, plan_mover
from pftrack_sim.simulation.occlusion.crossing import plan_walker
from pftrack_sim.simulation.occlusion.static import plan_static

AFTER_S = 3.0
"""The rehearsal goes on so long after the last thing that is arranged."""

_APART = 0.25
_APART_S = 2.5
"""Two that are between camera and target within this time are so far apart in depth."""


@dataclass(frozen=True)
class Plans:
    """Everything arranged for one episode.

    Attributes:
        layout: The place with the standing occluders in it.
        placements: Where those stand, by their index in the scenario.
        crossings: How people cross.
        carts: How carts cross.
        cart_heights_m: How tall each cart is.
        passings: How people pass by the target.
    """

    layout: WalkableArea
    placements: dict[int, Placement]
    crossings: tuple[Crossing, ...] = ()
    carts: tuple[Crossing, ...] = ()
    cart_heights_m: tuple[float, ...] = ()
    passings: tuple[OncomingPass, ...] = ()


def plan(
    settings: ResolvedScenario, seed: int, layout: WalkableArea, path: Path, rehearse: Callable[[float], DryRun]
) -> Plans:
    """Arrange an episode.

    The target and the robot follow their scripts whoever else is about, so the rehearsal needs no strangers. What the
    scenario itself asks for is planned first and from its own part of the rehearsal: the stress axes do not change it.

    Args:
        settings: The scenario, every range drawn.
        seed: Root seed of the episode.
        layout: The place.
        path: The target's.
        rehearse: Runs the episode without pictures up to a time.

    Raises:
        ScenarioError: Something that was asked for cannot happen.
    """
    occluders, axes = settings.occluders, settings.axes
    own_s = max((one.at_s + one.duration_s for one in occluders), default=0.0) + AFTER_S
    covers_s = [at_s + length_s for at_s, length_s in axes.occlusion.spans_s]
    last_s = max([own_s, *(time_s + AFTER_S for time_s in (*covers_s, *axes.distractors.passings_s))])
    if last_s == AFTER_S:
        return Plans(layout, {})
    whole = rehearse(last_s)
    problems: list[str] = []
    plans = _own(settings, layout, whole.until(own_s), problems) if occluders else Plans(layout, {})
    plans = _covers(settings, plans, whole, problems)
    plans = replace(plans, passings=_passings(settings, seed, plans.layout, path, whole, problems))
    if problems:
        raise ScenarioError(f"{settings.title!r} at seed {seed}", problems)
    return plans


def _own(settings: ResolvedScenario, layout: WalkableArea, rehearsal: DryRun, problems: list[str]) -> Plans:
    """The scenario's own occluders; standing things first: walkers must know what they walk around."""
    occluders = settings.occluders
    placements: dict[int, Placement] = {}
    crossings: list[Crossing] = []
    names = occluder_names(occluders)
    for index in sorted(range(len(occluders)), key=lambda index: names[index] is None):
        occluder, name = occluders[index], names[index]
        try:
            if name is None:
                crossings.append(plan_walker(occluder, rehearsal, layout, f"occluders.{index}"))
            else:
                found = plan_static(occluder, rehearsal, layout, f"occluders.{index}")
                placements[index] = found
                layout = replace(layout, footprints=(*layout.footprints, found.footprint(name)))
        except ParameterError as error:
            problems.append(str(error))
    return Plans(layout, placements, tuple(crossings))


def _covers(settings: ResolvedScenario, plans: Plans, rehearsal: DryRun, problems: list[str]) -> Plans:
    """The covers of the stress axis."""
    axis = settings.axes.occlusion
    found: list[Crossing] = []
    for number, asked in enumerate(asked_of(axis)):
        near = [
            one.depth
            for one in plans.crossings
            if one.at_s - _APART_S < asked.at_s + asked.duration_s and asked.at_s - _APART_S < one.until_s
        ]
        if not cart_names(axis):
            # People who follow each other closely cross one behind the other.
            last = found[-1:] if found and found[-1].until_s + _APART_S > asked.at_s else []
            near += [one.depth for one in last]
        shifts = sorted(np.round(np.arange(0.3, 0.7001, 0.05) - axis.depth, 3).tolist(), key=abs)
        free = [one for one in shifts if all(abs(axis.depth + one - depth) >= _APART for depth in near)]
        try:
            depths = tuple(free or shifts)
            found.append(
                plan_mover(axis, asked, rehearsal, plans.layout, f"axes.occlusion, cover {number + 1}", depths)
            )
        except ParameterError as error:
            problems.append(str(error))
    if not cart_names(axis):
        return replace(plans, crossings=(*plans.crossings, *found))
    heights = tuple(height_m(axis, one, rehearsal) for one in found)
    return replace(plans, carts=tuple(found), cart_heights_m=heights)


def _passings(
    settings: ResolvedScenario, seed: int, layout: WalkableArea, path: Path, rehearsal: DryRun, problems: list[str]
) -> tuple[OncomingPass, ...]:
    """The people of the stress axis who pass by."""
    axis = settings.axes.distractors
    ground = ObstacleMap(layout)
    found: list[OncomingPass] = []
    # Step by step: a path may come back to where it has been.
    times = np.arange(0.0, max(axis.passings_s, default=0.0) + 1.0, 0.5)
    walked = [0.0]
    for point in rehearsal.at(times)[1]:
        walked.append(path.project(point, walked[-1]))
    free = positions_away_from(path, ground, layout.bounds_m)

    def target_s_at(time_s: float) -> float:
        near_m = float(np.interp(time_s, times, walked[1:]))
        return path.project(rehearsal.at(time_s)[1][0], near_m)

    for number, at_s in enumerate(axis.passings_s):
        rng = random_streams.stream(seed, "axes", "distractors", number)
        side, pace = (1 if rng.random() < 0.5 else -1), float(rng.uniform(1.05, 1.35))
        camera, target = rehearsal.at(at_s)
        _, _, heading = path.at(target_s_at(at_s))
        aside = np.cos(heading) * (camera[0, 1] - target[0, 1]) - np.sin(heading) * (camera[0, 0] - target[0, 0])
        if abs(aside) > 1.0:
            # Seen from the side, one who passes on the far side is in view and does not cover the target.
            side = -1 if aside > 0.0 else 1
        try:
            name = f"axes.distractors, passing {number + 1}"
            found.append(plan_oncoming_pass(at_s, axis.distance_m, pace, path, ground, target_s_at, side, name, free))
            if found[-1].waiting_m is not None:
                free = free[(free != found[-1].waiting_m).any(axis=1)]
        except ParameterError as error:
            problems.append(str(error))
    return tuple(found)
