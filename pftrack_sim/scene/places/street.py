"""A street with shops and parked cars: at night with pools of lamplight and a few lit windows, or by day in the sun."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pftrack_sim.core.random_streams import pick
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scene.layout import WalkableArea
from pftrack_sim.scene.places.builder import LooseProp, PlaceBuilder, bounding_box
from pftrack_sim.scene.places.buildings import house
from pftrack_sim.scene.places.catalogue import load_prop
from pftrack_sim.scene.places.fixed import FixedProp
from pftrack_sim.scene.places.materials import add_skybox, texture, tiling
from pftrack_sim.scene.places.meshes import quad
from pftrack_sim.scene.places.props import advertising_column, bicycle_stand, lamp_post, signboard, tree

_WEST, _EAST, _KERB, _FRONT = -10.0, 44.0, 3.0, 7.8
BOUNDS = (-8.0, -7.2, 42.0, 7.2)
GOALS = ((-6.5, 5.6), (-6.5, -5.6), (-6.5, 0.5), (7.5, 6.3), (16.5, 6.3), (12.0, -5.6), (26.0, 5.2), (22.0, -5.6),
         (33.0, -5.6), (40.5, 5.6), (40.5, -5.6), (40.5, 0.5))  # fmt: skip

# x, and the side of the street: +1 is north.
_LAMPS = ((0.5, 1.0), (10.5, 1.0), (20.5, 1.0), (30.5, 1.0), (5.5, -1.0), (25.5, -1.0))
_UNLIT_LAMPS = ((-7.0, 1.0), (40.5, 1.0), (15.5, -1.0), (36.0, -1.0), (-4.5, -1.0))
"""Lamp posts without a light source, far from where people walk: OpenGL has eight lights."""


_CAR_PAINTS = ("paint-silver", "paint-blue", "paint-red", "paint-green", "paint-maroon", "paint-black", "paint-cream",
               "white")  # fmt: skip

# Kind, shop front, awning.
_NORTH = (("brick", 0, "awning-red"), ("cream", 1, None), ("rose", 2, "awning-green"), ("office", 3, None),
          ("brick", 1, "awning-sand"))  # fmt: skip
_SOUTH = (("office", 2, None), ("rose", 3, "awning-blue"), ("brick", 0, None), ("cream", 1, "awning-red"),
          ("rose", 0, None))  # fmt: skip


def build_street(builder: PlaceBuilder) -> WalkableArea:
    """Build the street; the sun has set."""
    add_skybox(builder.spec, "sky-night")
    _add_street(builder, night=True)
    patches = builder.lights.patches
    lamps = [(x, side * (_KERB + 1.45), 4.4) for x, side in _LAMPS]
    colours = _lamp_colours(patches, builder.patch_rng)
    builder.add_lamps(lamps, colours, 56.0, (1.0, 0.08, 0.04), exponent=4.0 + 8.0 * patches, shadow_of=1)
    sky = 1.0 - 0.4 * patches
    builder.add_fill_light("moon", (0.35, 0.5, -0.7), sky * np.array([0.12, 0.13, 0.165]))
    builder.set_ambient_light(sky * np.array([0.19, 0.19, 0.22]))
    return builder.finish(BOUNDS, GOALS)


def build_street_by_day(builder: PlaceBuilder) -> WalkableArea:
    """Build the same street by day."""
    add_skybox(builder.spec, "sky-day")
    _add_street(builder, night=False)
    builder.add_daylight(BOUNDS, (0.60, 0.57, 0.50), (15.0, 0.0, 26.0), (0.10, 0.11, 0.13), (0.37, 0.39, 0.43))
    return builder.finish(BOUNDS, GOALS)


def _add_street(builder: PlaceBuilder, night: bool) -> None:
    """Add all but the lights."""
    builder.add_fixed(_ground)
    builder.add_fixed(_houses, night)
    builder.add_fixed(_lamp_posts)
    _add_parked_cars(builder)
    builder.add_loose(_loose_props(builder.rng), (0.3, 0.08))


def _lamp_colours(patches: float, rng: np.random.Generator) -> FloatArray:
    """`(lamps, 3)` light of each lamp: sodium; with patches they differ in brightness, and every other one is white."""
    sodium, white = np.array([1.75, 1.32, 0.78]), np.array([1.30, 1.42, 1.50])
    brightness = 1.0 + patches * rng.uniform(-0.4, 1.4, (len(_LAMPS), 1))
    whiteness = patches * ((np.arange(len(_LAMPS)) + rng.integers(2)) % 2)
    return brightness * (sodium + whiteness[:, None] * (white - sodium))


def _ground() -> Iterator[FixedProp]:
    """The road with its markings, and the pavements."""
    asphalt, pavement, white = tiling("asphalt"), tiling("pavement"), texture("white")
    length, width, ends = _EAST - _WEST, _FRONT - _KERB, (_WEST - 14.0, _EAST)
    road = [
        quad(asphalt, (_WEST, -_KERB, 0), (length, 0, 0), (0, 2 * _KERB, 0), (54, 6)),
        *(quad(asphalt, (x, -_KERB, 0), (14, 0, 0), (0, 2 * _KERB, 0)) for x in ends),
        *(quad(white, (x, -0.07, 0.003), (2.0, 0, 0), (0, 0.14, 0)) for x in np.arange(-6.0, 42.0, 4.5)),
        *(quad(white, (15.6, y, 0.003), (3.2, 0, 0), (0, 0.5, 0)) for y in np.arange(-2.75, 2.6, 1.0)),
    ]
    yield FixedProp("road", road, casts_shadow=False)
    for name, low, kerb in (("north", _KERB, _KERB), ("south", -_FRONT, -_KERB)):
        meshes = [
            quad(pavement, (_WEST, low, 0.0), (length, 0, 0), (0, width, 0), (66, 6)),
            *(quad(pavement, (x, low, 0.0), (14, 0, 0), (0, width, 0), (4, 2)) for x in ends),
            quad(texture("stone"), (_WEST - 14, kerb - 0.12, 0.003), (length + 28, 0, 0), (0, 0.24, 0), (82, 1)),
        ]
        yield FixedProp(f"pavement-{name}", meshes, casts_shadow=False)


def _houses(night: bool) -> Iterator[FixedProp]:
    """The fronts on both sides and across both ends. At night the same windows are lit for every seed."""
    rng = np.random.default_rng(23) if night else None
    for index, style in enumerate(_NORTH):
        prop = house(*style, balconies=index % 2 == 1, lit_windows=rng, fine=True)
        yield FixedProp(f"house-north-{index + 1}", prop, (-12.0 + 12.0 * index, _FRONT))
    for index, style in enumerate(_SOUTH):
        prop = house(*style, balconies=index % 2 == 0, lit_windows=rng, fine=True)
        yield FixedProp(f"house-south-{index + 1}", prop, (48.0 - 12.0 * index, -_FRONT), np.pi)
    for index, (x, kind) in enumerate(((-24.0, "rose"), (48.0, "cream"))):
        north, south = house(kind, index, lit_windows=rng), house(kind, index + 2, lit_windows=rng)
        yield FixedProp(f"house-north-{index + 6}", north, (x, _FRONT))
        yield FixedProp(f"house-south-{index + 6}", south, (x + 12.0, -_FRONT), np.pi)
    for index, y in enumerate((12.0, 0.0)):
        east = house("cream", 3 - index, balconies=True, lit_windows=rng)
        west = house("office", index, lit_windows=rng)
        yield FixedProp(f"house-east-{index + 1}", east, (58.0, y), -0.5 * np.pi)
        yield FixedProp(f"house-west-{index + 1}", west, (-24.0, -y), 0.5 * np.pi)


def _lamp_posts() -> Iterator[FixedProp]:
    for index, (x, side) in enumerate((*_LAMPS, *_UNLIT_LAMPS)):
        position, yaw, collider = (x, side * (_KERB + 0.4)), 0.0 if side > 0 else np.pi, (0.13, 0.13, 4.6)
        yield FixedProp(f"lamp-post-{index + 1}", lamp_post(1.05), position, yaw, collider, casts_shadow=False)


def _add_parked_cars(builder: PlaceBuilder) -> None:
    """Add cars along the southern kerb, with random paint, and one at each end of the street."""
    for index, x in enumerate((-3.0, 3.2, 9.4, 20.4, 27.0, 33.4, 39.0)):
        prop = load_prop("van") if index == 4 else load_prop("car", paint=pick(builder.rng, _CAR_PAINTS))
        if index == 2:
            prop += load_prop("rear-lights")
        yaw = np.pi if index % 3 == 1 else 0.0
        builder.add(f"car-{index + 1}", prop, (x, -_KERB + 1.1), yaw, bounding_box(prop))
    far_car = load_prop("car", paint="paint-red") + load_prop("rear-lights")
    for index, position in enumerate(((50.0, -1.8), (-18.0, 1.8))):
        builder.add(f"far-car-{index + 1}", far_car, position, casts_shadow=False)


def _loose_props(rng: np.random.Generator) -> list[LooseProp]:
    trunk = (0.68, 0.68, 2.2)
    return [
        LooseProp("tree", (17.2, 3.9, 0.0), tree(rng, 5.2), trunk),
        LooseProp("tree", (27.0, 3.9, 0.0), tree(rng, 5.4, "leaves-light"), trunk),
        LooseProp("tree", (-1.8, 3.9, 0.0), tree(rng, 5.0), trunk),
        LooseProp("tree", (13.0, -4.2, 0.0), tree(rng, 5.6), trunk),
        LooseProp("tree", (31.0, -4.2, 0.0), tree(rng, 5.2), trunk),
        LooseProp("tree", (0.8, -4.2, 0.0), tree(rng, 5.3, "leaves-light"), trunk),
        LooseProp("shelter", (20.0, -6.2, np.pi), load_prop("bus-shelter"), (1.5, 0.65, 2.35)),
        LooseProp("bench", (10.0, 7.1, 0.0), load_prop("bench", wood="wood-dark")),
        LooseProp("bench", (29.5, 7.1, 0.0), load_prop("bench", wood="wood-green")),
        LooseProp("bench", (5.0, -7.0, np.pi), load_prop("bench", wood="wood-dark")),
        LooseProp("bin", (8.5, 7.2, 0.0), load_prop("litter-bin")),
        LooseProp("bin", (24.0, -7.1, 0.0), load_prop("litter-bin")),
        LooseProp("board", (4.2, 7.0, 0.1), signboard(int(rng.integers(16)))),
        LooseProp("board", (19.6, 7.0, -0.1), signboard(int(rng.integers(16)))),
        LooseProp("bicycles", (35.5, 6.5, 0.5 * np.pi), bicycle_stand(rng, 3)),
        LooseProp("column", (37.0, 4.6, 0.0), advertising_column(int(rng.integers(16))), (0.7, 0.7, 3.2)),
    ]
