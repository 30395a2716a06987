"""Carts that drive themselves between camera and target: a cabinet as tall as people, and a low one.

A thing that stands cannot cover someone whom the robot follows straight behind; one that rolls along with the line of
sight covers anyone, anywhere, for as long as asked.
"""

from __future__ import annotations

import math

import mujoco
import numpy as np

from pftrack_sim.scenario.axes import OcclusionAxis
from pftrack_sim.scenario.model import Occluder
from pftrack_sim.world.crowd import Crossing
from pftrack_sim.world.layout import SCENERY_GROUP, Layout
from pftrack_sim.world.occlusion.rehearsal import Rehearsal
from pftrack_sim.world.occlusion.walker import Mover, plan_walker

EDGE_M_S = 1.3
"""Speed of an edge across the line of sight: the target is covered and uncovered in about a quarter of a second."""

PERSON_EDGE_M_S = 1.1

HALF_WIDTH_M = (0.27, 0.36)
"""Narrowest and widest cart: at half way from camera to target, each covers a walking person's stride."""

HALF_THICKNESS_M = 0.24
TALL_M = 2.1
_LEAST_TALL_M = 0.4
_CHASSIS_M = 0.20

_HEIGHTS = np.linspace(0.0, 1.0, 11)
_AREA_BELOW_SIDE = np.array([0.0, 0.118, 0.217, 0.324, 0.439, 0.568, 0.670, 0.768, 0.851, 0.940, 1.0])
_AREA_BELOW_BACK = np.array([0.0, 0.063, 0.131, 0.211, 0.305, 0.439, 0.592, 0.748, 0.898, 0.952, 1.0])
"""Share of a walking person's silhouette below a share of their stature, seen from the side and from behind: means
over several people and a stride, rendered. Striding legs show more of themselves from the side."""

_HIDDEN_Z_M = -6.0


def half_width_m(duration_s: float) -> float:
    """Half width of a cart that covers the line of sight for so long: the shorter, the narrower."""
    return float(np.clip(0.5 * EDGE_M_S * duration_s, *HALF_WIDTH_M))


def cart_names(axis: OcclusionAxis) -> tuple[str, ...]:
    """The bodies of the carts of an axis, "cabinet-1" or "cart-1" for the first; none when people cross."""
    if axis.kind not in ("pillar", "wall"):
        return ()
    word = "cabinet" if axis.kind == "pillar" else "cart"
    return tuple(f"{word}-{number + 1}" for number in range(len(axis.spans_s)))


def asked_of(axis: OcclusionAxis) -> tuple[Occluder, ...]:
    """Each cover of an axis, as if a walker were asked for."""
    return tuple(
        Occluder(kind="walker", at_s=at_s, duration_s=length_s, depth=axis.depth, similarity=axis.likeness)
        for at_s, length_s in axis.spans_s
    )


def plan_mover(
    axis: OcclusionAxis, asked: Occluder, rehearsal: Rehearsal, layout: Layout, name: str, depths: tuple[float, ...]
) -> Crossing:
    """How a cart or a person crosses for an axis.

    Args:
        axis: What is asked of all.
        asked: What is asked of this one.
        rehearsal: Where camera and target will be.
        layout: What stands there.
        name: What to call it in an error.
        depths: Depths to try, relative to what is asked.

    Raises:
        ParameterError: It cannot be done.
    """
    person = Mover("person", PERSON_EDGE_M_S, 0.22, 0.42, 0.2, depths)
    cart = Mover(
        "cart",
        EDGE_M_S,
        half_width_m(asked.duration_s),
        0.42,
        HALF_THICKNESS_M + 0.02,
        depths,
        (1.3, 0.9, 1.9, 0.65, 2.6),
    )
    return plan_walker(asked, rehearsal, layout, name, cart if cart_names(axis) else person)


def height_m(axis: OcclusionAxis, crossing: Crossing, rehearsal: Rehearsal) -> float:
    """How tall a cart must be to cover the share asked for, half way through its time."""
    if axis.kind == "pillar":
        return TALL_M
    camera, target = rehearsal.at(crossing.at_s + 0.5 * crossing.duration_s)
    distance = float(np.hypot(*(target[0] - camera[0, :2])))
    _, ends = rehearsal.at([crossing.at_s, crossing.at_s + crossing.duration_s])
    walked, sight = ends[1] - ends[0], target[0] - camera[0, :2]
    lengths = float(np.hypot(*walked) * np.hypot(*sight))
    along = float((walked @ sight) ** 2 / lengths**2) if lengths > 1e-6 else 0.5
    below = along * _AREA_BELOW_BACK + (1.0 - along) * _AREA_BELOW_SIDE
    top = float(np.interp(axis.share, below, _HEIGHTS)) * rehearsal.target_height_m
    middle = min(max(crossing.depth * distance, 0.75), distance - 0.65)
    # The sight of that point passes over the cart at its front or at its back: the lower of the two decides.
    faces = (middle - HALF_THICKNESS_M, middle + HALF_THICKNESS_M)
    camera_z = float(camera[0, 2])
    return max(min(camera_z + (top - camera_z) * face / distance for face in faces), _LEAST_TALL_M)


def add_carts(spec: mujoco.MjSpec, axis: OcclusionAxis) -> None:
    """Add a mocap body for every cart of an axis, out of sight until it is placed."""
    for name in cart_names(axis):
        body = spec.worldbody.add_body(name=name, mocap=True, pos=[0.0, 0.0, _HIDDEN_Z_M])
        for part, rgba in _PARTS.items():
            solid = part == "body"
            body.add_geom(
                name=f"{name}/{part}",
                type=mujoco.mjtGeom.mjGEOM_BOX,
                size=[0.01] * 3,
                rgba=list(rgba),
                group=SCENERY_GROUP,
                density=0.0,
                contype=int(solid),
                conaffinity=2 * int(solid),
            )


_STEEL, _DARK, _DOOR = (0.55, 0.60, 0.63, 1.0), (0.13, 0.14, 0.16, 1.0), (0.36, 0.50, 0.58, 1.0)
_PLATE = (0.86, 0.86, 0.80, 1.0)
_YELLOW, _BLACK = (0.85, 0.68, 0.12, 1.0), (0.05, 0.05, 0.05, 1.0)
_PARTS = {
    "body": _STEEL,
    "chassis": _DARK,
    "bumper": _YELLOW,
    "rim": _DARK,
    **{f"door-{side}-{face}": _DOOR for side in ("left", "right") for face in ("front", "back")},
    **{f"handle-{side}-{face}": _BLACK for side in ("left", "right") for face in ("front", "back")},
    **{f"slot-{number}-{face}": _BLACK for number in range(3) for face in ("front", "back")},
    **{f"plate-{face}": _PLATE for face in ("front", "back")},
    **{f"wheel-{number}": _BLACK for number in range(4)},
}


def size_cart(model: mujoco.MjModel, name: str, half_width: float, height: float) -> None:
    """Give a cart its size; its own x points away from the camera.

    Args:
        model: Compiled with `add_carts`.
        name: Which one.
        half_width: Half of its broad side [m].
        height: Of its top [m].
    """
    thick, wide, base = HALF_THICKNESS_M, half_width, _CHASSIS_M
    parts = {
        "body": ((-thick + 0.004, -wide, base), (thick - 0.004, wide, height - 0.03)),
        "rim": ((-thick, -wide, height - 0.03), (thick, wide, height)),
        "chassis": ((-thick, -wide, 0.07), (thick, wide, base)),
        "bumper": ((-thick - 0.01, -wide, 0.11), (thick + 0.01, wide, 0.14)),
    }
    for sign, face in ((-1.0, "front"), (1.0, "back")):
        for left, side in ((1.0, "left"), (-1.0, "right")):
            inner, outer = sorted((0.012 * left, (wide - 0.02) * left))
            skin = sorted((sign * (thick - 0.006), sign * thick))
            parts[f"door-{side}-{face}"] = ((skin[0], inner, base + 0.03), (skin[1], outer, height - 0.06))
            grip = sorted((0.04 * left, 0.052 * left))
            proud = sorted((sign * thick, sign * (thick + 0.015)))
            low = base + 0.5 * (height - base)
            parts[f"handle-{side}-{face}"] = ((proud[0], grip[0], low), (proud[1], grip[1], low + 0.10))
        paint = sorted((sign * thick, sign * (thick + 0.008)))
        for number in range(3):
            z = base + 0.82 * (height - base) - 0.035 * number
            parts[f"slot-{number}-{face}"] = ((paint[0], -0.8 * wide, z), (paint[1], -0.2 * wide, z + 0.012))
        z = base + 0.72 * (height - base)
        parts[f"plate-{face}"] = ((paint[0], 0.25 * wide, z), (paint[1], 0.75 * wide, z + 0.07))
    for number, (sx, sy) in enumerate(((1, 1), (1, -1), (-1, 1), (-1, -1))):
        x, y = sx * (thick - 0.08), sy * (wide - 0.06)
        parts[f"wheel-{number}"] = ((x - 0.05, y - 0.02, 0.0), (x + 0.05, y + 0.02, 0.10))
    for part, (low, high) in parts.items():
        geom = model.geom(f"{name}/{part}").id
        half = 0.5 * (np.array(high) - np.array(low))
        model.geom_pos[geom] = 0.5 * (np.array(high) + np.array(low))
        model.geom_size[geom] = half
        model.geom_rbound[geom] = np.linalg.norm(half)
        model.geom_aabb[geom] = (0.0, 0.0, 0.0, *half)
        model.geom_sameframe[geom] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
    body = model.body(name).id
    first, count = model.body_bvhadr[body], model.body_bvhnum[body]
    model.bvh_aabb[first : first + count] = (0.0, 0.0, 0.5 * height, thick + 0.03, wide, 0.5 * height)


def move_cart(
    model: mujoco.MjModel, data: mujoco.MjData, name: str, position_m: tuple[float, float], yaw_rad: float
) -> None:
    """Put a cart where it is now; its mocap pose in `data` is written."""
    mocap = model.body_mocapid[model.body(name).id]
    data.mocap_pos[mocap] = (*position_m, 0.0)
    data.mocap_quat[mocap] = (math.cos(0.5 * yaw_rad), 0.0, 0.0, math.sin(0.5 * yaw_rad))
