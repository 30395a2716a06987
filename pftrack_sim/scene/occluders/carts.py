"""Bodies of the carts: a cabinet as tall as people, and a low one."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from pftrack_sim.scenario.axes import OcclusionAxis
from pftrack_sim.scenario.model import Occluder
from pftrack_sim.scene.layout import SCENERY_GROUP

HALF_THICKNESS_M = 0.24
_CHASSIS_M = 0.20
_HIDDEN_Z_M = -6.0


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
