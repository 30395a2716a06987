"""Meshes of head, neck, hair and cap, in statures of a person whose head and neck are 0.160 statures high."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np

from pftrack_sim.core.data_files import asset_table
from pftrack_sim.core.types import FloatArray, read_only
from pftrack_sim.scenario.clothes import HairStyle
from pftrack_sim.scene.people.anatomy import Anatomy
from pftrack_sim.scene.people.head_texture import HEAD_SIZE, hairline, texture_row
from pftrack_sim.scene.people.mesh import (
    TriangleMesh,
    load_profile,
    lofted_mesh,
    merged,
    profile,
    ring_angles,
    superellipse,
    superellipse_rings,
)
from pftrack_sim.scene.people.texture_atlas import CAP, HAIR, HEAD, SKIN, region_mesh

_CROWN_Z = 0.160
_RING_POINTS = 16
_SKULL, _SKULL_POWER = load_profile("skull"), 2.15
_NOSE = {5: 0.0135, 6: 0.0085}  # offset of the front vertex, by ring
_EYE_RING = 7
_UNEVEN = 0.22  # Standard deviation of the thickness of hair, as a share of it


def head_mesh(anatomy: Anatomy) -> TriangleMesh:
    """The head above the base of the neck (the origin), facing along x."""
    scale = anatomy.head_m / _CROWN_Z
    mesh = _unscaled(anatomy.hair_style)
    return replace(mesh, vertices=mesh.vertices * scale)


@cache
def _unscaled(style: HairStyle) -> TriangleMesh:
    """A head with this hair; read-only."""
    mesh = merged([_skull(), _ear(-1.0), _ear(1.0), *_hair(style)])
    for array in (mesh.vertices, mesh.normals, mesh.pixels, mesh.faces, *mesh.coarse):
        read_only(array)
    return mesh


def _skull() -> TriangleMesh:
    rings = superellipse_rings(_SKULL, _RING_POINTS, power=_SKULL_POWER)
    front = _RING_POINTS // 2
    for ring, length in _NOSE.items():
        rings[ring, front, 0] += length
    rings[_EYE_RING, [front - 1, front + 1], 0] -= 0.0030
    columns = np.arange(_RING_POINTS + 1) / _RING_POINTS * (HEAD_SIZE[1] - 1)
    rows = np.clip(texture_row(_SKULL[:, 0]), 1, HEAD_SIZE[0] - 1.0)
    pixels = np.broadcast_arrays(HEAD.column + 0.5 + columns[None], HEAD.row + rows[:, None])
    return lofted_mesh(rings, np.stack(pixels, axis=-1))


def _ear(side: float) -> TriangleMesh:
    rings = superellipse_rings(load_profile("ear"), 5)
    rings[..., 1] += side * 0.0465
    return region_mesh(rings, SKIN)


def _hair(style: HairStyle) -> list[TriangleMesh]:
    """Hair, or a hat."""
    if style == "bald":
        return []
    shape = asset_table("people")["hair"][style]
    parts = [_scalp_cover(style, shape)]
    if "hangs_to" in shape:
        parts.append(_back_hair(shape["hangs_to"]))
    if style == "bun":
        parts.append(region_mesh(superellipse_rings(load_profile("bun"), 8), HAIR))
    if style == "cap":
        parts.append(_brim())
    return parts


def _scalp_cover(style: HairStyle, shape: Mapping[str, float]) -> TriangleMesh:
    """Hair or a hat offset from the skull, thickest at the crown."""
    region = CAP if "hat" in shape else HAIR
    angle = ring_angles(_RING_POINTS)
    edge = np.full(_RING_POINTS, 0.108) if region is CAP else hairline(style, angle)
    share = np.array([0.0, 0.12, 0.30, 0.54, 0.79, 1.0, 1.02])
    # Rings are denser towards the crown, where the curvature of the skull is highest.
    z = _CROWN_Z - (_CROWN_Z - edge[None]) * share[:, None] ** 1.35
    points = _skull_points(np.broadcast_to(angle, z.shape), z)
    outward = points - np.array([-0.002, 0.0, 0.098])
    outward /= np.sqrt((outward**2).sum(axis=2, keepdims=True))
    crown, rim = shape.get("crown", 1.15), shape.get("rim", 0.25)
    falloff = np.interp(share, (0.0, 0.3, 0.79, 1.0, 1.02), (crown, crown, 0.5 * (crown + rim), rim, -0.5))
    flared = shape.get("flare", 0.0) * np.clip(np.abs(angle) / np.pi, 0.3, 1.0)[None] * np.clip(share, 0, 0.8)[:, None]
    offset = (shape["thickness"] * falloff)[:, None] + flared
    if region is HAIR:
        # Strands lie over each other.
        offset *= 1.0 + _UNEVEN * np.random.default_rng(len(style)).standard_normal(offset.shape)
    offset[-1] = -0.003
    points = points + outward * offset[..., None]
    points[0] = points[0].mean(axis=0)
    return region_mesh(points, region)


def _skull_points(angle: FloatArray, z: FloatArray) -> FloatArray:
    """`(..., 3)` points of the skull without the nose, by direction [rad] and height [statures]."""
    centre, front, back, side = (np.interp(z, _SKULL[:, 0], _SKULL[:, column]) for column in (1, 3, 4, 5))
    x, y = superellipse(angle, _SKULL_POWER)
    return np.stack([centre + np.where(x > 0, front, back) * x, side * y, z], axis=-1)


def _back_hair(low: float) -> TriangleMesh:
    """Hair hanging behind the ears and down the back to a height [statures]."""
    z = np.array([0.126, 0.113, 0.092, 0.070, *np.linspace(0.046, low, 3), low - 0.006])
    hang = np.linspace(0.0, 1.0, 4) * (0.046 - low)
    # It lies on the scalp, falls behind the ears and becomes thinner towards its end.
    behind = np.array([0.0, 0.072, 0.080, 0.080, *(0.077 - 0.05 * hang[1:]), 0.060])
    table = profile(
        z=z,
        x=-0.030,
        front=np.array([0.0, 0.030, 0.036, 0.038, *(0.038 - 0.12 * hang[1:]), 0.0]),
        back=np.maximum(behind - 0.030, 0.0) * (z > low - 0.003),
        side=np.array([0.0, 0.044, 0.0545, 0.0565, *(0.056 - 0.13 * hang[1:]), 0.0]),
    )
    rings = superellipse_rings(table, 12, power=2.3)
    rings[..., 1] *= 1.0 + 0.04 * np.sin(110.0 * rings[..., 2] + 2.0 * np.sign(rings[..., 1]))
    return region_mesh(rings, HAIR)


def _brim() -> TriangleMesh:
    rings = superellipse_rings(load_profile("brim"), 12)
    rings[..., 2] -= 0.10 * np.clip(rings[..., 0] - 0.05, 0.0, None) + 2.0 * rings[..., 1] ** 2
    return region_mesh(rings, CAP)
