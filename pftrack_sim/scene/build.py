"""From a resolved scenario to a compiled model: place, robot, people and occluders put into one MjSpec."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco

from pftrack_sim.core import random_streams
from pftrack_sim.scenario import ResolvedScenario
from pftrack_sim.scenario.model import Occluder
from pftrack_sim.scene import places
from pftrack_sim.scene.layout import WalkableArea
from pftrack_sim.scene.occluders.bodies import add_occluders
from pftrack_sim.scene.occluders.carts import add_carts, asked_of, cart_names
from pftrack_sim.scene.people.body import Person, add_person
from pftrack_sim.scene.people.sampling import sample_cast
from pftrack_sim.scene.robot import add_robot

NEAR_M = 0.05
FAR_M = 120.0
"""Clipping planes of the camera: nothing nearer or farther is drawn."""

SHADOW_PIXELS = 2048


@dataclass(frozen=True, eq=False)
class Scene:
    """A compiled scene and what is known about it.

    Attributes:
        model: The compiled model.
        stage: The place and the robot alone, not compiled: all that a rehearsal touches, and less work in every
            physics step.
        layout: Where people can walk.
        cast: Everyone, the target first.
    """

    model: mujoco.MjModel
    stage: mujoco.MjSpec
    layout: WalkableArea
    cast: tuple[Person, ...]


def build(settings: ResolvedScenario, seed: int, step_s: float) -> Scene:
    """Build and compile the scene of one episode.

    Args:
        settings: The scenario, every range drawn.
        seed: Root seed of the episode.
        step_s: Physics step.
    """
    spec = mujoco.MjSpec()
    spec.option.timestep = step_s
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    _set_graphics(spec, settings)
    layout = places.furnish(spec, settings.place, settings.lights, random_streams.stream(seed, "place"))
    add_robot(spec, settings.robot, settings.camera)
    stage = spec.copy()
    cast = sample_cast(
        seed,
        settings.target.height_m,
        settings.distractors.count,
        settings.distractors.similarity,
        [one.similarity for one in walkers(settings)],
        [settings.axes.distractors.similarity] * len(settings.axes.distractors.passings_s),
    )
    for person in cast:
        add_person(spec, person)
    add_occluders(spec, settings.occluders)
    add_carts(spec, settings.axes.occlusion)
    return Scene(spec.compile(), stage, layout, cast)


def walkers(settings: ResolvedScenario) -> tuple[Occluder, ...]:
    """Who crosses: the scenario's own walkers, then the people of the stress axis."""
    axis = settings.axes.occlusion
    own = tuple(one for one in settings.occluders if one.kind == "walker")
    return own if cart_names(axis) else (*own, *asked_of(axis))


def _set_graphics(spec: mujoco.MjSpec, settings: ResolvedScenario) -> None:
    # Distances of the clipping planes are in units of the extent.
    spec.stat.extent = 1.0
    spec.visual.map.znear = NEAR_M
    spec.visual.map.zfar = FAR_M
    quality = spec.visual.quality
    quality.offsamples = settings.sensor.multisamples
    quality.shadowsize = SHADOW_PIXELS
    # Software rasterisers pay for every vertex.
    quality.numslices, quality.numstacks = 12, 8
    spec.visual.global_.offwidth = settings.camera.width_px
    spec.visual.global_.offheight = settings.camera.height_px
