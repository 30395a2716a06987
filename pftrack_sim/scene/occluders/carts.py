"""Bodies of the carts: a cabinet as tall as people, and a low cart."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

import mujoco
import numpy as np

from pftrack_sim.scenario.axes import DistractorsAxis, OcclusionAxis
from pftrack_sim.scenario.model import Occluder
from pftrack_sim.scene.scene_spec import add_box

HALF_THICKNESS_M = 0.24
_CHASSIS_M = 0.20
_HIDDEN_Z_M = -6.0

Colour: TypeAlias = tuple[float, float, float, float]
Corner: TypeAlias = tuple[float, float, float]

_STEEL, _DARK, _DOOR = (0.55, 0.60, 0.63, 1.0), (0.13, 0.14, 0.16, 1.0), (0.36, 0.50, 0.58, 1.0)
_PLATE = (0.86, 0.86, 0.80, 1.0)
_YELLOW, _BLACK = (0.85, 0.68, 0.12, 1.0), (0.05, 0.05, 0.05, 1.0)


@dataclass(frozen=True)
class CartSize:
    """Half of the broad side of a cart, and the height of its top."""

    half_width_m: float
    height_m: float


def cart_names(axis: OcclusionAxis) -> tuple[str, ...]:
    """Body names of the carts of an axis, such as "cabinet-1" or "cart-1"; empty where pedestrians cross instead."""
    if axis.kind not in ("pillar", "wall"):
        return ()
    word = "cabinet" if axis.kind == "pillar" else "cart"
    return tuple(f"{word}-{number + 1}" for number in range(len(axis.spans_s)))


def axis_occluders(axis: OcclusionAxis) -> tuple[Occluder, ...]:
    """Each occlusion of an axis as a request for a walker."""
    return tuple(
        Occluder(kind="walker", at_s=at_s, duration_s=length_s, depth=axis.depth, similarity=axis.likeness)
        for at_s, length_s in axis.spans_s
    )


def distractor_crossings(axis: DistractorsAxis) -> tuple[Occluder, ...]:
    """Each look-alike that crosses, as a request for a walker."""
    return tuple(
        Occluder(kind="walker", at_s=at_s, duration_s=length_s, similarity=axis.similarity)
        for at_s, length_s in axis.crossings_s
    )


def add_carts(spec: mujoco.MjSpec, sizes: Mapping[str, CartSize]) -> None:
    """Add a mocap body for every cart, by name; its x axis points away from the camera."""
    for name, size in sizes.items():
        body = spec.worldbody.add_body(name=name, mocap=True, pos=[0.0, 0.0, _HIDDEN_Z_M])
        for part, (rgba, low, high) in _boxes(size).items():
            half, centre = 0.5 * np.subtract(high, low), 0.5 * np.add(high, low)
            add_box(body, f"{name}/{part}", half, centre, solid=part == "solid", rgba=list(rgba), density=0.0)


def _boxes(size: CartSize) -> dict[str, tuple[Colour, Corner, Corner]]:
    """Colour, lowest and highest corner of each part; `solid` collides, the others are drawn."""
    thick, wide, base, height = HALF_THICKNESS_M, size.half_width_m, _CHASSIS_M, size.height_m
    boxes: dict[str, tuple[Colour, Corner, Corner]] = {
        "solid": (_STEEL, (-thick, -wide, 0.07), (thick, wide, height)),
        "body": (_STEEL, (-thick + 0.004, -wide, base), (thick - 0.004, wide, height - 0.03)),
        "chassis": (_DARK, (-thick, -wide, 0.07), (thick, wide, base)),
        "bumper": (_YELLOW, (-thick - 0.01, -wide, 0.11), (thick + 0.01, wide, 0.14)),
        "rim": (_DARK, (-thick, -wide, height - 0.03), (thick, wide, height)),
    }
    faces = ((-1.0, "front"), (1.0, "back"))
    sides = ((1.0, "left"), (-1.0, "right"))
    for left, side in sides:
        inner, outer = sorted((0.012 * left, (wide - 0.02) * left))
        for sign, face in faces:
            skin = sorted((sign * (thick - 0.006), sign * thick))
            low, high = (skin[0], inner, base + 0.03), (skin[1], outer, height - 0.06)
            boxes[f"door-{side}-{face}"] = (_DOOR, low, high)
    for left, side in sides:
        grip, z = sorted((0.04 * left, 0.052 * left)), base + 0.5 * (height - base)
        for sign, face in faces:
            proud = sorted((sign * thick, sign * (thick + 0.015)))
            boxes[f"handle-{side}-{face}"] = (_BLACK, (proud[0], grip[0], z), (proud[1], grip[1], z + 0.10))
    paint = {face: sorted((sign * thick, sign * (thick + 0.008))) for sign, face in faces}
    for number in range(3):
        z = base + 0.82 * (height - base) - 0.035 * number
        for face, (near, far) in paint.items():
            boxes[f"slot-{number}-{face}"] = (_BLACK, (near, -0.8 * wide, z), (far, -0.2 * wide, z + 0.012))
    z = base + 0.72 * (height - base)
    for face, (near, far) in paint.items():
        boxes[f"plate-{face}"] = (_PLATE, (near, 0.25 * wide, z), (far, 0.75 * wide, z + 0.07))
    for number, (sx, sy) in enumerate(((1, 1), (1, -1), (-1, 1), (-1, -1))):
        x, y = sx * (thick - 0.08), sy * (wide - 0.06)
        boxes[f"wheel-{number}"] = (_BLACK, (x - 0.05, y - 0.02, 0.0), (x + 0.05, y + 0.02, 0.10))
    return boxes
