"""Build the spec of a resolved scenario: first the stage (place and robot), then people, occluders and carts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache

import mujoco
import numpy as np

from pftrack_sim.core import random_streams
from pftrack_sim.core.errors import ScenarioError
from pftrack_sim.scenario import ResolvedScenario
from pftrack_sim.scenario.model import Occluder
from pftrack_sim.scenario.people import FurtherTarget, Target
from pftrack_sim.scene.layout import CONTACT, WalkableArea, owner_name
from pftrack_sim.scene.occluders import (
    CartSize,
    Placement,
    add_carts,
    add_static_occluders,
    axis_occluders,
    cart_names,
    distractor_crossings,
)
from pftrack_sim.scene.people.person import Person, add_person, sample_others, sample_target
from pftrack_sim.scene.people.props import add_props
from pftrack_sim.scene.places.builder import add_ground_plane
from pftrack_sim.scene.places.place import add_place
from pftrack_sim.scene.places.seats import Seat
from pftrack_sim.scene.robot import RobotForm, add_robot
from pftrack_sim.scene.scene_spec import BLANK, SceneSpec, mesh_file
from pftrack_sim.scene.thing import BEARER, WALKER, add_thing

NEAR_M, FAR_M = 0.05, 120.0  # Clipping planes of the camera: nothing nearer or farther is drawn
_MAX_SHADE = 0.9
_TROUSERS = {"skirt": False}  # Of who sits or stoops: a skirt would hang through the seat, or stand off
_CONTACT_PX, _CONTACT_HALF_M = 64, (0.30, 0.19)


def build_stage(
    settings: ResolvedScenario, seed: int, step_s: float, seats: Sequence[Seat] = (), *, draws: bool = True
) -> tuple[SceneSpec, WalkableArea]:
    """Build the place with the robot in it, and the seats that people sit on.

    Args:
        settings: The scenario.
        seed: That of the episode.
        step_s: Length of a physics step.
        seats: Where people sit.
        draws: Whether the scene is drawn in colour.

    Returns:
        The spec, which `add_agents` completes, and the walkable area.
    """
    spec = _empty(step_s, draws=draws)
    _add_contact(spec)
    layout = _add_place(spec, settings, seed, seats)
    _set_graphics(spec, settings)
    add_robot(spec, RobotForm.of(settings.robot, settings.camera))
    return spec, layout


def walkable_area(settings: ResolvedScenario, seed: int, seats: Sequence[Seat] = ()) -> WalkableArea:
    """The walkable area of the place of an episode, with these seats in it."""
    return _add_place(SceneSpec(draws=False), settings, seed, seats)


def _add_place(spec: SceneSpec, settings: ResolvedScenario, seed: int, seats: Sequence[Seat] = ()) -> WalkableArea:
    rng, patch_rng = random_streams.stream(seed, "place"), random_streams.stream(seed, "lights", "patches")
    patches = min(_MAX_SHADE, settings.lights.patches + settings.axes.light.shade)
    lights = settings.lights.model_copy(update={"patches": patches})
    return add_place(spec, settings.place, lights, rng, patch_rng, seats)


@lru_cache(maxsize=8)
def compile_robot_alone(form: RobotForm, step_s: float) -> mujoco.MjModel:
    """The robot on the ground without anything else.

    As long as it touches nothing but the ground it moves as in any place, to the bit, in less than half the time. The
    model is kept for those who ask again, perhaps in other threads: it must not be changed.
    """
    spec = _empty(step_s)
    add_ground_plane(spec)
    add_robot(spec, form)
    for geom in spec.geoms:
        if not (geom.contype or geom.conaffinity or geom.mass):
            spec.delete(geom)
    model = spec.compile()
    # The robot is one island: it is found anew in every step for nothing.
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ISLAND)
    return model


def _empty(step_s: float, *, draws: bool = False) -> SceneSpec:
    spec = SceneSpec(draws=draws)
    spec.option.timestep = step_s
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    return spec


def add_agents(
    spec: SceneSpec,
    settings: ResolvedScenario,
    seed: int,
    static_occluders: Mapping[str, Placement],
    carts: Mapping[str, CartSize],
) -> tuple[Person, ...]:
    """Complete a stage with its people, and with occluders and carts by body name.

    Returns:
        The people, the target first; where that is a thing, who carries it, or a walker who is not there.
    """
    wardrobe = settings.target.wardrobe or settings.place.kind
    wardrobe_seed = int(random_streams.stream(seed, "wardrobe", wardrobe).integers(2**32))
    target, axis = _sample_target(wardrobe_seed, "target", settings.target), settings.axes.distractors
    similarities = {
        "distractor": [settings.distractors.similarity] * settings.distractors.count,
        "crosser": [walker.similarity for walker in _walkers(settings)],
        "passer": [axis.similarity] * len(axis.passings_s),
        "member": [group.similarity for group in settings.groups for _ in range(group.count)],
    }
    people = target, *sample_others(wardrobe_seed, target, similarities)
    seats = [group.kind == "sit" for group in settings.groups for _ in range(group.count)]
    seated = {f"member-{number}" for number, sits in enumerate(seats, start=1) if sits}
    people = tuple(
        replace(one, outfit=replace(one.outfit, **_TROUSERS)) if one.name in seated else one for one in people
    )
    taken = {owner_name(body.name) for body in spec.bodies}
    for one in settings.walking_targets:
        if one.name in taken:
            raise ScenarioError(f"{settings.title!r} at seed {seed}", [f"targets: {one.name!r} names a thing there"])
        people = (*people, _sample_target(wardrobe_seed, one.name, one))
    thing = settings.target.thing
    if thing is not None:
        add_thing(spec, people[0].name, thing)
        people = (replace(people[0], name=BEARER if thing.moves == "carried" else WALKER), *people[1:])
    for person in people:
        if person.name != WALKER:
            add_person(spec, person)
    add_props(spec, settings.target.carries)
    add_static_occluders(spec, static_occluders)
    add_carts(spec, carts)
    return people


def _sample_target(seed: int, name: str, target: Target | FurtherTarget) -> Person:
    lowers = any(action.kind in ("sit", "crouch", "bend") for action in target.actions)
    lowers = lowers or target.uses in ("wheelchair", "bicycle")
    clothes = target.clothes.model_copy(update=_TROUSERS) if lowers else target.clothes
    return sample_target(seed, name, target.height_m, clothes, target.uses)


def _walkers(settings: ResolvedScenario) -> tuple[Occluder, ...]:
    """The walkers that cross: those of the scenario, then those of the axes `occlusion` and `distractors`."""
    axis = settings.axes.occlusion
    listed = tuple(occluder for occluder in settings.occluders if occluder.kind == "walker")
    strangers = () if cart_names(axis) else axis_occluders(axis)
    return (*listed, *strangers, *distractor_crossings(settings.axes.distractors))


def _set_graphics(spec: mujoco.MjSpec, settings: ResolvedScenario) -> None:
    """Set how a place that stands is drawn."""
    # Distances of the clipping planes are in units of the extent.
    spec.stat.extent = 1.0
    spec.visual.map.znear = NEAR_M
    spec.visual.map.zfar = FAR_M
    quality = spec.visual.quality
    quality.offsamples = settings.sensor.multisamples
    casts = any(light.castshadow for light in spec.lights)
    quality.shadowsize = (settings.lights.shadow_pixels or settings.camera.width_px) if casts else 0
    # MuJoCo multiplies it by the extent.
    spec.visual.map.shadowclip = settings.lights.shadow_reach_m
    # Software rasterisers pay for every vertex.
    quality.numslices, quality.numstacks = 12, 8
    spec.visual.global_.offwidth = settings.camera.width_px
    spec.visual.global_.offheight = settings.camera.height_px


def _add_contact(spec: SceneSpec) -> None:
    """Add material and mesh of the darkness under feet: opaque in its middle, and clear at its edge."""
    across = np.linspace(-1.0, 1.0, _CONTACT_PX)
    depth = np.clip(1.0 - np.hypot(across[:, None], across), 0.0, 1.0)
    image = np.full((_CONTACT_PX, _CONTACT_PX, 4), 255, dtype=np.uint8)
    image[..., 3] = np.round(255.0 * depth**2 * (3.0 - 2.0 * depth))
    if spec.draws:
        size = {"width": _CONTACT_PX, "height": _CONTACT_PX, "nchannel": 4}
        texture = spec.add_texture(name=CONTACT, type=mujoco.mjtTexture.mjTEXTURE_2D, **size)
        texture.data = image.tobytes()
    else:
        spec.add_image(CONTACT, BLANK)
    corners, up = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]), [[0.0, 0.0, 1.0]] * 4
    vertices = np.column_stack([corners * _CONTACT_HALF_M, np.zeros(4)])
    spec.add_mesh_file(CONTACT, mesh_file(vertices, up, 0.5 + 0.5 * corners, [[0, 1, 2], [0, 2, 3]]))
    material = spec.add_material(name=CONTACT, specular=0.0)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = CONTACT
