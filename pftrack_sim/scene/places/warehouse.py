"""A warehouse: racks full of cartons, steel pillars, pallets, a forklift, high-bay lamps."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pftrack_sim.scene.layout import WalkableArea
from pftrack_sim.scene.places.builder import LooseProp, PlaceBuilder
from pftrack_sim.scene.places.catalogue import load_prop
from pftrack_sim.scene.places.fixed import FixedProp
from pftrack_sim.scene.places.materials import AtlasRegion, texture, tiling
from pftrack_sim.scene.places.meshes import ALL_FACES, Prop, TexturedMesh, box, quad
from pftrack_sim.scene.places.props import carton_stack, drums, framed_poster, pallet_pile, rack, trolley

BOUNDS = (-5.0, -12.0, 33.0, 12.0)
GOALS = ((-3.6, 2.2), (-3.6, -2.2), (-3.8, 7.2), (-3.8, -7.2), (5.6, 7.2), (13.6, 7.7), (21.6, -7.2), (13.6, -7.2),
         (31.2, 7.2), (31.2, -7.2), (31.4, 1.6), (15.0, -2.4), (21.6, 2.6))  # fmt: skip
_LEFT, _LOW, _RIGHT, _HIGH = BOUNDS[0] - 0.4, BOUNDS[1] - 0.4, BOUNDS[2] + 0.4, BOUNDS[3] + 0.4
_LENGTH, _WIDTH, _ROOF = _RIGHT - _LEFT, _HIGH - _LOW, 6.4
_PILLARS_X = (-1.0, 5.0, 11.0, 17.0, 23.0, 29.0)
_RACKS_X = (1.6, 9.6, 17.6, 25.6)
_RACK_ROWS = (("A", 4.7, 0.0), ("B", 9.6, 0.0), ("C", -4.7, np.pi), ("D", -9.6, np.pi))
_LAMPS = ((0.5, 0.0), (8.0, 0.0), (15.5, 0.0), (23.0, 0.0), (30.5, 0.0))
_UNLIT_LAMPS = ((12.0, 7.0), (12.0, -7.0), (21.5, 7.0), (21.5, -7.0), (2.0, 7.0), (2.0, -7.0))
"""Lamps without a light source: OpenGL has eight lights."""


def build_warehouse(builder: PlaceBuilder) -> WalkableArea:
    """Build the warehouse; the sun does not reach it."""
    builder.add_fixed(_floor_and_roof)
    for index, (x, y) in enumerate((*_LAMPS, *_UNLIT_LAMPS)):
        builder.add(f"high-bay-{index + 1}", load_prop("high-bay-lamp"), (x, y, _ROOF - 1.3), casts_shadow=False)
    builder.add_fixed(_walls)
    _add_posters(builder)
    for index, x in enumerate(_PILLARS_X):
        builder.add(f"pillar-{index + 1}", load_prop("steel-pillar"), (x, 0.0), collider=(0.23, 0.23, _ROOF))
    _add_racks(builder)
    builder.add_loose(_loose_props(builder.rng), (0.12, 0.18, 0.1))
    area, sun, lamps = (14.0, 0.0, 21.0), (0.68, 0.63, 0.52), (0.27, 0.27, 0.26)
    builder.add_ceiling_light(BOUNDS, _ROOF + 0.1, area, sun, (0.22, 0.42, -1.0), lamps)
    # Light reflected by floor and walls: it shades what faces north.
    builder.add_fill_light("lamp-fill", (-0.5, -0.8, -0.25), (0.14, 0.14, 0.15))
    positions = [(x, y, _ROOF - 1.2) for x, y in _LAMPS]
    builder.add_lamps(positions, (0.70, 0.69, 0.62), 74.0, (1.0, 0.03, 0.025), exponent=1.2)
    builder.set_ambient_light((0.36, 0.36, 0.37))
    return builder.finish(BOUNDS, GOALS)


def _floor_and_roof() -> Iterator[FixedProp]:
    yellow, white, hazard, steel = (texture(name) for name in ("paint-yellow", "white", "hazard", "steel-dark"))
    floor = [
        quad(tiling("concrete"), (_LEFT, _LOW, 0), (_LENGTH, 0, 0), (0, _WIDTH, 0), (44, 28)),
        *(_stripe(yellow, -3.5, y, 35.0, 0.12) for y in (-3.5, 3.5)),
        *(_stripe(white, x + 1.2, 0.0, 0.7, 0.16) for x in _PILLARS_X),
        *(_stripe(hazard, x + 3.1, y, 1.8, 0.3) for x in _RACKS_X[:3] for y in (-5.0, 5.0)),
        *(_stripe(yellow, x, 0.0, 0.12, 13.0) for x in (-3.1, 31.0)),
    ]
    yield FixedProp("floor", floor, casts_shadow=False)
    roof = [
        quad(tiling("roof"), (_LEFT, _HIGH, _ROOF), (_LENGTH, 0, 0), (0, -_WIDTH, 0), (19, 12)),
        *(box(steel, (x, 0, _ROOF - 0.3), (0.16, _WIDTH, 0.4), ALL_FACES) for x in _PILLARS_X),
        *(box(steel, (14.0, 4.5 * k, _ROOF - 0.14), (_LENGTH, 0.1, 0.2), ALL_FACES) for k in range(-2, 3)),
        box(texture("chrome"), (14.0, -2.6, _ROOF - 0.75), (_LENGTH, 0.35, 0.35), ALL_FACES),
    ]
    yield FixedProp("roof", roof, casts_shadow=False)


def _stripe(paint: AtlasRegion, x: float, y: float, length: float, width: float) -> TexturedMesh:
    """A marking on the floor from x to x + length, with its middle at y."""
    return quad(paint, (x, y - 0.5 * width, 0.003), (length, 0, 0), (0, width, 0))


def _walls() -> Iterator[FixedProp]:
    """The walls, and gates, doors and signs at both ends."""
    x, y, east, west = 0.5 * (_LEFT + _RIGHT), 0.5 * (_LOW + _HIGH), -0.5 * np.pi, 0.5 * np.pi
    gate = load_prop("gate")
    for name, prop, position, yaw in (
        ("wall-north", _wall(_LENGTH), (x, _HIGH), 0.0),
        ("wall-south", _wall(_LENGTH), (x, _LOW), np.pi),
        ("wall-east", _wall(_WIDTH), (_RIGHT, y), east),
        ("wall-west", _wall(_WIDTH), (_LEFT, y), west),
        ("gate-1", gate, (_RIGHT, 3.2), east),
        ("gate-2", gate, (_RIGHT, -4.2), east),
        ("gate-3", gate, (_LEFT, 3.0), west),
        ("door-east", load_prop("door", leaf="door-red"), (_RIGHT, -0.4), east),
        ("door-west", load_prop("door", leaf="door-window"), (_LEFT, -1.2), west),
    ):
        yield FixedProp(name, prop, position, yaw, casts_shadow=False)


def _add_posters(builder: PlaceBuilder) -> None:
    """Add random posters and an extinguisher at the eastern end."""
    east = -0.5 * np.pi
    for k, y in enumerate((-1.9, 8.0, -8.6)):
        poster = framed_poster(int(builder.rng.integers(16)), 1.1, 1.4, 1.0)
        builder.add(f"poster-{k + 1}", poster, (_RIGHT, y), east, casts_shadow=False)
    builder.add("extinguisher", load_prop("extinguisher"), (_RIGHT, 0.8), east, casts_shadow=False)


def _wall(length: float) -> Prop:
    """Brick below and sheet metal above 2.6 m, facing -y at y = 0."""
    cells, split = round(length / 1.2), 2.6
    start, along = -0.5 * length, (length, 0, 0)
    return (
        quad(tiling("brick"), (start, 0, 0), along, (0, 0, split), (cells, 3)),
        quad(tiling("cladding"), (start, 0, split), along, (0, 0, _ROOF - split), (cells // 2, 3)),
        box(texture("concrete"), (0, -0.05, split), (length, 0.14, 0.16), ALL_FACES),
    )


def _add_racks(builder: PlaceBuilder) -> None:
    sign = (box(texture("sign-aisle"), (0, 0, 2.4), (0.04, 0.6, 0.6), ("+x", "-x")),)
    for row, y, yaw in _RACK_ROWS:
        for column, x in enumerate(_RACKS_X):
            name = f"rack-{row}{column + 1}"
            # Racks are half of all triangles, and no camera drives where the outer rows cast their shadows.
            inner = abs(y) < 6.0
            builder.add(name, rack(builder.rng), (x, y), yaw, (2.78, 0.55, 4.6), casts_shadow=inner)
            builder.add(f"{name}-sign", sign, (x + 2.85 * (1 if yaw else -1), y), casts_shadow=False)


def _loose_props(rng: np.random.Generator) -> list[LooseProp]:
    return [
        LooseProp("forklift", (13.6, 5.0, 0.5 * np.pi), load_prop("forklift")),
        LooseProp("stack", (5.6, -5.0, 0.5 * np.pi), carton_stack(rng, 3)),
        LooseProp("stack", (29.6, -10.6, 0.0), carton_stack(rng, 4)),
        LooseProp("stack", (29.8, 5.2, 0.5 * np.pi), carton_stack(rng, 3)),
        LooseProp("stack", (29.8, 10.4, 0.2), carton_stack(rng, 4)),
        LooseProp("stack", (-3.9, 10.4, 0.1), carton_stack(rng, 4)),
        LooseProp("stack", (-4.0, -4.6, 0.5 * np.pi), carton_stack(rng, 2)),
        LooseProp("stack", (21.6, -5.2, 0.1), carton_stack(rng, 3)),
        LooseProp("pile", (21.6, 10.0, 0.1), pallet_pile(8)),
        LooseProp("pile", (-3.9, -10.6, 0.2), pallet_pile(6)),
        LooseProp("pile", (5.6, 10.2, 0.5 * np.pi), pallet_pile(10)),
        LooseProp("drums", (13.6, -10.4, 0.0), drums(rng)),
        LooseProp("drums", (31.7, -10.6, 0.2), drums(rng)),
        LooseProp("drums", (-4.0, 4.9, 0.3), drums(rng)),
        LooseProp("trolley", (5.6, 5.4, 1.3), trolley(rng)),
        LooseProp("trolley", (21.6, 5.6, 1.8), trolley(rng)),
        LooseProp("trolley", (13.6, -5.2, 1.5), trolley(rng)),
    ]
