"""Bodies that occlude, made of boxes in their planned size: pillars, walls, stacks of crates, and carts that move.

A cart is a cabinet as tall as people, or a low cart.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import mujoco
import numpy as np

from pftrack_sim.core.types import FloatArray
from pftrack_sim.scenario.axes import DistractorsAxis, OcclusionAxis
from pftrack_sim.scenario.model import Occluder
from pftrack_sim.scene.layout import Footprint
from pftrack_sim.scene.places.materials import image_file, read_image
from pftrack_sim.scene.scene_spec import SceneSpec, add_box

MAX_CRATES = 16  # Largest number of crates in one stack
CART_HALF_THICKNESS_M = 0.24
_CRATE_M = 0.62
_SKIN_M = 0.002
_QUARTER = float(np.sqrt(0.5))
_ABOUT_X = ((_QUARTER, -_QUARTER, 0.0, 0.0), [0, 2, 1])
_TURNED = {"shaft": _ABOUT_X, "slab": _ABOUT_X, "shaft-sides": ((0.5, 0.5, 0.5, 0.5), [1, 2, 0])}
"""Quaternion, and order of the sizes, of boxes that are turned so that their local z is the body's y or x: MuJoCo maps
flat textures onto the faces of local z."""

_MATERIAL = {"shaft": "concrete", "shaft-sides": "concrete", "slab": "brick"} | dict.fromkeys(
    ("plinth", "capital", "coping"), "stone"
)


_CHASSIS_M = 0.20
_HIDDEN_Z_M = -6.0
_STEEL, _DARK, _DOOR = (0.55, 0.60, 0.63, 1.0), (0.13, 0.14, 0.16, 1.0), (0.36, 0.50, 0.58, 1.0)
_PLATE = (0.86, 0.86, 0.80, 1.0)
_YELLOW, _BLACK = (0.85, 0.68, 0.12, 1.0), (0.05, 0.05, 0.05, 1.0)

Boxes: TypeAlias = dict[str, tuple[FloatArray, FloatArray]]
"""Centre `(3,)` and half sizes `(3,)` [m] of each named box, along the axes of its body."""

Colour: TypeAlias = tuple[float, float, float, float]
Corner: TypeAlias = tuple[float, float, float]


@dataclass(frozen=True)
class Placement:
    """Pose and size of a static occluder.

    Attributes:
        half_m: Half its width and half its thickness.
        yaw_rad: Angle of its width to the world's x.
        depth: Its place on the line from the camera (0) to the target (1).
        spans_s: Begin and end of each time at which it covers the target's centre line in the dry run.
    """

    kind: Literal["pillar", "wall", "boxes"]
    centre_m: tuple[float, float]
    half_m: tuple[float, float]
    yaw_rad: float
    height_m: float
    depth: float
    spans_s: tuple[tuple[float, float], ...]

    def footprint(self, name: str) -> Footprint:
        """Its rectangle on the ground."""
        return Footprint(name, self.centre_m, self.half_m, self.yaw_rad, self.height_m)


@dataclass(frozen=True)
class CartSize:
    """Half of the broad side of a cart, and the height of its top."""

    half_width_m: float
    height_m: float


def occluder_names(occluders: Sequence[Occluder]) -> tuple[str | None, ...]:
    """Body name of each occluder, such as "occluder-pillar-1"; None for walkers, which are pedestrians."""
    return tuple(
        None if occluder.kind == "walker" else f"occluder-{occluder.kind}-{index + 1}"
        for index, occluder in enumerate(occluders)
    )


def cart_names(axis: OcclusionAxis) -> tuple[str, ...]:
    """Body names of the carts of an axis, such as "cabinet-1" or "cart-1"; empty where pedestrians cross instead."""
    if axis.kind not in ("pillar", "wall"):
        return ()
    word = "cabinet" if axis.kind == "pillar" else "cart"
    return tuple(f"{word}-{number + 1}" for number in range(len(axis.spans_s)))


def axis_occluders(axis: OcclusionAxis) -> tuple[Occluder, ...]:
    """Each occlusion of an axis as a request for a walker."""
    return tuple(
        Occluder(
            kind="walker", at_s=at_s, duration_s=length_s, depth=axis.depth, similarity=float(axis.kind == "lookalike")
        )
        for at_s, length_s in axis.spans_s
    )


def distractor_crossings(axis: DistractorsAxis) -> tuple[Occluder, ...]:
    """Each look-alike that crosses, as a request for a walker."""
    return tuple(
        Occluder(kind="walker", at_s=at_s, duration_s=length_s, similarity=axis.similarity)
        for at_s, length_s in axis.crossings_s
    )


def add_static_occluders(spec: SceneSpec, placements: Mapping[str, Placement]) -> None:
    """Add a body for every static occluder."""
    _add_materials(spec, {placement.kind for placement in placements.values()})
    for name, placement in placements.items():
        yaw = placement.yaw_rad
        body = spec.worldbody.add_body(
            name=name,
            mocap=True,
            pos=[*placement.centre_m, 0.0],
            quat=[np.cos(0.5 * yaw), 0.0, 0.0, np.sin(0.5 * yaw)],
        )
        for order, (part, (centre, half)) in enumerate(_boxes(placement).items()):
            turned, size = _TURNED.get(part, ((1.0, 0.0, 0.0, 0.0), [0, 1, 2]))
            solid = part == "solid"
            geom = add_box(body, f"{name}/{part}", half[size], centre, solid=solid, quat=turned, density=0.0)
            if part in _MATERIAL:
                geom.material = f"occluder/{_MATERIAL[part]}"
            elif part.startswith("crate"):
                geom.material = "occluder/crate"
                shade = 0.82 + 0.18 * ((order * 7) % 5) / 4.0
                geom.rgba = [shade, shade, shade * 0.97, 1.0]


def _boxes(placement: Placement) -> Boxes:
    """The boxes of an occluder; the first one, `solid`, collides, the others are drawn."""
    (width, thickness), height = placement.half_m, placement.height_m
    whole = (np.array([0.0, 0.0, 0.5 * height]), np.array([width, thickness, 0.5 * height]))
    if placement.kind == "pillar":
        brim = np.array([width + 0.02, thickness + 0.02])
        return {
            "solid": whole,
            "shaft": whole,
            # Each face is drawn by the one of two boxes whose texture lies flat on it.
            "shaft-sides": (whole[0], whole[1] + np.array([_SKIN_M, -_SKIN_M, 0.0])),
            "plinth": (np.array([0.0, 0.0, 0.07]), np.array([*brim, 0.07])),
            "capital": (np.array([0.0, 0.0, height - 0.06]), np.array([*brim, 0.06])),
        }
    if placement.kind == "wall":
        # The coping lies within the wall's height and width: the silhouette is the planned one.
        cap = min(0.05, 0.25 * height)
        half_z = (height - cap) / 2
        return {
            "solid": whole,
            "slab": (np.array([0.0, 0.0, 0.5 * (height - cap)]), np.array([width, thickness, half_z])),
            "coping": (np.array([0.0, 0.0, height - 0.5 * cap]), np.array([width, thickness + 0.03, 0.5 * cap])),
        }
    return {"solid": whole, **_crates(width, thickness, height)}


def _crates(width: float, thickness: float, height: float) -> Boxes:
    """Crates that fill a box from edge to edge, in whole columns and rows."""
    columns = int(np.clip(round(2.0 * width / _CRATE_M), 1, 8))
    rows = int(np.clip(round(height / _CRATE_M), 1, MAX_CRATES // columns))
    half_x, half_z = width / columns, 0.5 * height / rows
    crates: Boxes = {}
    for number in range(rows * columns):
        row, column = divmod(number, columns)
        # Neighbouring crates differ a little in depth, so that the edge between them is visible.
        half_y = thickness * (1.0 - 0.06 * ((row * 5 + column * 3) % 4) / 3.0)
        centre = np.array([(2 * column + 1) * half_x - width, 0.0, (2 * row + 1) * half_z])
        crates[f"crate-{number + 1}"] = (centre, np.array([half_x, half_y, half_z]))
    return crates


def _add_materials(spec: SceneSpec, kinds: set[str]) -> None:
    for kind, material, repeat in (("pillar", "concrete", 2.0), ("wall", "brick", 2.0), ("boxes", "crate", 1.0)):
        if kind not in kinds:
            continue
        name, image = f"occluder/{material}", f"occluder-{material}"
        if kind == "boxes":
            faces, linear = np.tile(read_image(image), (6, 1, 1)), mujoco.mjtColorSpace.mjCOLORSPACE_LINEAR
            spec.add_image(name, faces, mujoco.mjtTexture.mjTEXTURE_CUBE, colorspace=linear)
        else:
            spec.add_image_file(name, image_file(image))
        roles = [""] * int(mujoco.mjtTextureRole.mjNTEXROLE)
        roles[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name
        properties = {"texuniform": True, "texrepeat": [repeat] * 2, "specular": 0.1, "shininess": 0.1}
        spec.add_material(name=name, textures=roles, **properties)
    if kinds & {"pillar", "wall"}:
        spec.add_material(name="occluder/stone", rgba=[0.62, 0.61, 0.58, 1.0], specular=0.1, shininess=0.1)


def add_carts(spec: mujoco.MjSpec, sizes: Mapping[str, CartSize]) -> None:
    """Add a mocap body for every cart, by name; its x axis points away from the camera."""
    for name, size in sizes.items():
        body = spec.worldbody.add_body(name=name, mocap=True, pos=[0.0, 0.0, _HIDDEN_Z_M])
        for part, (rgba, low, high) in _cart_boxes(size).items():
            half, centre = 0.5 * np.subtract(high, low), 0.5 * np.add(high, low)
            add_box(body, f"{name}/{part}", half, centre, solid=part == "solid", rgba=list(rgba), density=0.0)


def _cart_boxes(size: CartSize) -> dict[str, tuple[Colour, Corner, Corner]]:
    """Colour, lowest and highest corner of each part; `solid` collides, the others are drawn."""
    thick, wide, base, height = CART_HALF_THICKNESS_M, size.half_width_m, _CHASSIS_M, size.height_m
    boxes: dict[str, tuple[Colour, Corner, Corner]] = {
        "solid": (_STEEL, (-thick, -wide, 0.07), (thick, wide, height)),
        "body": (_STEEL, (-thick + 0.004, -wide, base), (thick - 0.004, wide, height - 0.03)),
        "chassis": (_DARK, (-thick, -wide, 0.07), (thick, wide, base)),
        "bumper": (_YELLOW, (-thick - 0.01, -wide, 0.11), (thick + 0.01, wide, 0.14)),
        "rim": (_DARK, (-thick, -wide, height - 0.03), (thick, wide, height)),
    }
    skin, proud, paint = (thick - 0.006, thick), (thick, thick + 0.015), (thick, thick + 0.008)
    door, grip = (base + 0.03, height - 0.06), base + 0.5 * (height - base)
    slot, plate = base + 0.82 * (height - base), base + 0.72 * (height - base)
    # What both faces have: name, colour, and its extent outwards, across and upwards.
    for name, colour, (inner, outer), (right, left), (low, high) in (
        ("door-left", _DOOR, skin, (0.012, wide - 0.02), door),
        ("door-right", _DOOR, skin, (0.02 - wide, -0.012), door),
        ("handle-left", _BLACK, proud, (0.04, 0.052), (grip, grip + 0.10)),
        ("handle-right", _BLACK, proud, (-0.052, -0.04), (grip, grip + 0.10)),
        *(
            (f"slot-{n}", _BLACK, paint, (-0.8 * wide, -0.2 * wide), (slot - 0.035 * n, slot - 0.035 * n + 0.012))
            for n in range(3)
        ),
        ("plate", _PLATE, paint, (0.25 * wide, 0.75 * wide), (plate, plate + 0.07)),
    ):
        boxes[f"{name}-front"] = (colour, (-outer, right, low), (-inner, left, high))
        boxes[f"{name}-back"] = (colour, (inner, right, low), (outer, left, high))
    for number, (sx, sy) in enumerate(((1, 1), (1, -1), (-1, 1), (-1, -1))):
        x, y = sx * (thick - 0.08), sy * (wide - 0.06)
        boxes[f"wheel-{number}"] = (_BLACK, (x - 0.05, y - 0.02, 0.0), (x + 0.05, y + 0.02, 0.10))
    return boxes
