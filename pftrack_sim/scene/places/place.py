"""The places: each is a file in `assets/places` that says what stands where.

    sky                     image of the skybox, for places in the open
    bounds, goals           walkable area x_min, y_min, x_max, y_max [m]; goals of pedestrians x, y [m]
    fixed, drawn, loose     lists of groups of things: the same for every seed; with values drawn for every seed; and
                            with values drawn, displaced by at most `displacement` x, y [m] and yaw [deg], or left out
    light                   arguments of `add_daylight`, `add_ceiling`, `add_fill`, `add_lamps`, `add_ambient` of
                            `PlaceBuilder`
    props                   props of this place, in the language of `assets/props.toml`
    like, without           another place that this one is but for what it says itself, and keys that its groups lack

Keys of a group:

    prop                    name of a prop: of this place, of the catalogue, or of the module `props`
    name                    by default that of the prop; things of a place that share a name are numbered
    at, z                   rows x, y [m] and, if not 0, yaw [deg]; height of all of them [m]
    collider                half sizes x, y and height [m], without the height that of the prop, or "box" (default for
                            loose things): its bounding box; by default there is none, for what hangs or lies flat
    shadow                  whether it casts one, or "front": if the sun is behind it
    seed                    of the random shapes from this group on, in `fixed`
    any, between            arguments of the prop: one of a list, or a whole number below the one given; drawn uniformly
                            between two numbers
    others                  arguments of the prop; values in lists alternate from one thing to the next
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from functools import cache, lru_cache
from typing import Any, cast

import numpy as np

from pftrack_sim.core.data_files import asset_table
from pftrack_sim.core.errors import ParameterError, ScenarioError
from pftrack_sim.core.random_streams import pick
from pftrack_sim.scenario.model import AnyPlace, Lights, Place
from pftrack_sim.scene.layout import WalkableArea
from pftrack_sim.scene.places.builder import Collider, Item, PlaceBuilder, add_ground_plane, bounding_box
from pftrack_sim.scene.places.catalogue import described_meshes, load_prop
from pftrack_sim.scene.places.materials import add_skybox
from pftrack_sim.scene.places.meshes import Prop, merged_by_material
from pftrack_sim.scene.places.props import BUILT, RANDOM
from pftrack_sim.scene.places.room import Room, add_room
from pftrack_sim.scene.places.room_map import read_map
from pftrack_sim.scene.places.room_mesh import read_mesh
from pftrack_sim.scene.places.room_mjcf import read_mjcf
from pftrack_sim.scene.places.seats import Seat, add_seats
from pftrack_sim.scene.scene_spec import SceneSpec

_READERS: dict[str, Callable[[Any], Room]] = {"map": read_map, "mjcf": read_mjcf, "mesh": read_mesh}
_SECTIONS = ("fixed", "drawn", "loose")
_PLACING = ("name", "names", "at", "z", "collider", "shadow", "seed", "any", "between")  # Not arguments of the prop


def add_place(
    spec: SceneSpec,
    place: AnyPlace,
    lights: Lights,
    rng: np.random.Generator,
    patch_rng: np.random.Generator | None = None,
    seats: Sequence[Seat] = (),
) -> WalkableArea:
    """Add a place to a spec: ground, walls, furniture and lights. Returns its walkable area.

    Walls, pillars and everything else that is fixed has the same pose for every seed; loose furniture, posters and the
    goods on shelves are drawn from `rng`, the patches of light from `patch_rng` (by default the same for every seed).
    `seats` are those that people of the scenario sit on. A place from a file is the same for every seed.

    Raises:
        ScenarioError: The file cannot be read, or is no room for people and robot.
    """
    patch_rng = patch_rng or np.random.default_rng(0)
    add_ground_plane(spec)
    if not isinstance(place, Place):
        room = load_room(cast(Any, place))
        builder = PlaceBuilder(spec, rng, room.area.bounds_m, lights, patch_rng)
        add_seats(builder, seats)
        return add_room(builder, room)
    description = _description(place.kind)
    left, low, right, high = description["bounds"]
    builder = PlaceBuilder(spec, rng, (left, low, right, high), lights, patch_rng)
    add_seats(builder, seats)
    if "sky" in description:
        add_skybox(spec, description["sky"])
    for item in (*_fixed_items(place.kind), *_items(description, "drawn", rng)):
        builder.add(item)
    builder.add_loose(list(_items(description, "loose", rng)), place.clutter, description["displacement"])
    for kind, values in description["light"].items():
        getattr(builder, f"add_{kind}")(**values)
    return builder.finish([(x, y) for x, y in description["goals"]])


@lru_cache(maxsize=4)
def load_room(place: Any) -> Room:
    """The room of a place from a file, read once as long as its digest stays the same.

    Raises:
        ScenarioError: The file cannot be read, or is no room for people and robot.
    """
    try:
        return _READERS[place.kind](place)
    except ParameterError as error:
        raise ScenarioError(place.model, [f"place.model: {error}"]) from None


@cache
def _description(kind: str) -> dict[str, Any]:
    """The description of a place, with `names` of the things of each group: numbered where they share one."""
    table = asset_table(f"places/{kind}")
    if "like" in table:
        table = asset_table(f"places/{table['like']}") | table
    without = table.get("without", ())
    sections = {
        section: [{key: group[key] for key in group if key not in without} for group in table.get(section, ())]
        for section in _SECTIONS
    }
    groups = [group for section in _SECTIONS for group in sections[section]]
    totals, numbers = Counter[str](), Counter[str]()
    for group in groups:
        group.setdefault("at", [[0.0, 0.0]])
        totals[group.setdefault("name", group["prop"])] += len(group["at"])
    for group in groups:
        name, first = group["name"], numbers[group["name"]] + 1
        numbers[name] += len(group["at"])
        group["names"] = [f"{name}-{n}" for n in range(first, numbers[name] + 1)] if totals[name] > 1 else [name]
    return {**table, **sections}


@cache
def _fixed_items(kind: str) -> tuple[Item, ...]:
    """What is the same for every seed: built once, with one mesh per material; read-only."""
    items = _items(_description(kind), "fixed", np.random.default_rng(0))
    return tuple(item._replace(prop=merged_by_material(item.prop, frozen=True)) for item in items)


def _items(description: dict[str, Any], section: str, rng: np.random.Generator) -> Iterator[Item]:
    """What stands in one section of a place; `rng` draws, unless a group has a seed of its own."""
    groups: list[dict[str, Any]] = description[section]
    for group in groups:
        if "seed" in group:
            rng = np.random.default_rng(group["seed"])
        names: list[str] = group["names"]
        rows: list[list[float]] = group["at"]
        for index, (name, (x, y, *turn)) in enumerate(zip(names, rows, strict=True)):
            arguments = {key: _alternating(group[key], index) for key in group if key not in _PLACING}
            for key, options in group.get("any", {}).items():
                choices: Sequence[Any] = range(options) if isinstance(options, int) else options
                arguments[key] = pick(rng, choices)
            for key, limits in group.get("between", {}).items():
                arguments[key] = rng.uniform(*limits)
            prop = _prop(description, rng, **arguments)
            collider = _collider(group.get("collider", "box" if section == "loose" else None), index, prop)
            position, yaw_rad = (x, y, group.get("z", 0.0)), math.radians(turn[0] if turn else 0.0)
            yield Item(name, prop, position, yaw_rad, collider, group.get("shadow", True))


def _alternating(value: Any, index: int) -> Any:
    if not isinstance(value, list):
        return value
    values = cast(list[Any], value)
    return values[index % len(values)]


def _prop(description: dict[str, Any], rng: np.random.Generator, prop: str, **arguments: Any) -> Prop:
    if prop in RANDOM:
        return RANDOM[prop](rng, **arguments)
    if prop in BUILT:
        return BUILT[prop](**arguments)
    if prop in description["props"]:
        return tuple(described_meshes(description["props"][prop], arguments))
    return load_prop(prop, **arguments)


def _collider(given: Any, index: int, prop: Prop) -> Collider | None:
    """Half sizes and height [m] from a description: these, without the height, `"box"` around the prop, or none."""
    if given is None:
        return None
    if given == "box":
        return bounding_box(prop)
    numbers = given[index] if isinstance(given[0], list) else given
    half_x, half_y, height = (*numbers, bounding_box(prop)[2])[:3]
    return half_x, half_y, height
