"""Head, neck, hair and hat."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.scene.people.anatomy import Anatomy
from pftrack_sim.scene.people.atlas import CAP, HAIR, HEAD, SKIN
from pftrack_sim.scene.people.face import HEAD_SIZE, hairline, row_of
from pftrack_sim.scene.people.mesh import TriangleMesh, angles, joined, ovals, tube

Array = NDArray[np.float64]

_REFERENCE = 0.160
"""Base of the neck to the crown in the profile below [statures]."""
_COUNT = 16

# z, x of the centre, reach to the front, to the back, to the sides; statures above the base of the neck.
_PROFILE = np.array(
    [
        (-0.025, -0.006, 0.030, 0.032, 0.034),
        (0.012, -0.002, 0.029, 0.032, 0.030),
        (0.027, 0.003, 0.037, 0.038, 0.033),
        (0.033, 0.006, 0.047, 0.041, 0.036),
        (0.042, 0.007, 0.0505, 0.045, 0.0390),
        (0.0625, 0.005, 0.0515, 0.054, 0.0440),
        (0.073, 0.004, 0.0515, 0.057, 0.0450),
        (0.092, 0.003, 0.0505, 0.060, 0.0465),
        (0.106, 0.002, 0.0535, 0.062, 0.0470),
        (0.122, 0.001, 0.0515, 0.061, 0.0460),
        (0.138, -0.001, 0.0450, 0.053, 0.0410),
        (0.150, -0.003, 0.0330, 0.039, 0.0290),
        (0.157, -0.004, 0.0180, 0.022, 0.0160),
        (0.160, -0.005, 0.0000, 0.000, 0.0000),
    ]
)
_NOSE = {0.0625: 0.0135, 0.073: 0.0085}
"""How far the front vertex stands out, by height."""


def head_shell(anatomy: Anatomy) -> TriangleMesh:
    """The head above the base of the neck, which is the origin; it looks along x."""
    unit = anatomy.head_m / _REFERENCE
    parts = [_skull(), *_ears(), *_hair(anatomy.hair_style)]
    whole = joined(parts)
    return TriangleMesh(whole.vertices * unit, whole.normals, whole.pixels, whole.faces)


def _rows(profile: Array) -> Array:
    return np.insert(profile, 2, 0.0, axis=1)


def _skull() -> TriangleMesh:
    rings = ovals(_rows(_PROFILE), _COUNT, power=2.15)
    front = _COUNT // 2
    for z, length in _NOSE.items():
        rings[int(np.abs(_PROFILE[:, 0] - z).argmin()), front, 0] += length
    eyes = int(np.abs(_PROFILE[:, 0] - 0.092).argmin())
    for side in (-1, 1):
        rings[eyes, front + side, 0] -= 0.0030
    columns = np.broadcast_to(np.arange(_COUNT + 1) / _COUNT * (HEAD_SIZE[1] - 1), (len(rings), _COUNT + 1))
    rows = np.broadcast_to(row_of(_PROFILE[:, 0])[:, None], columns.shape)
    return tube(rings, np.stack([HEAD[0] + 0.5 + columns, HEAD[1] + np.clip(rows, 1, HEAD_SIZE[0] - 1.0)], axis=-1))


def _ears() -> list[TriangleMesh]:
    rows = [
        (0.062, 0.000, 0.0, 0.003, 0.003, 0.0015),
        (0.068, -0.001, 0.0, 0.006, 0.005, 0.004),
        (0.083, -0.003, 0.0, 0.008, 0.009, 0.005),
        (0.094, -0.004, 0.0, 0.005, 0.008, 0.004),
        (0.096, -0.004, 0.0, 0.0, 0.0, 0.0),
    ]
    ears = []
    for side in (-1.0, 1.0):
        rings = ovals(rows, 5)
        rings[..., 1] += side * 0.0465
        ears.append(tube(rings, _flat(rings, SKIN)))
    return ears


def _surface(turn: Array, z: Array) -> Array:
    """Points of the skull `(..., 3)` by direction and height, without the nose."""
    centre, ahead, behind, side = (np.interp(z, _PROFILE[:, 0], _PROFILE[:, k]) for k in (1, 2, 3, 4))
    cos, sin = np.cos(turn), np.sin(turn)
    x = np.sign(cos) * np.abs(cos) ** (2 / 2.15)
    y = np.sign(sin) * np.abs(sin) ** (2 / 2.15)
    return np.stack([centre + np.where(x > 0, ahead, behind) * x, side * y, z + 0.0 * turn], axis=-1)


def _hair(style: str) -> list[TriangleMesh]:
    if style == "bald":
        return []
    if style == "cap":
        return [_mantle("cap", 0.006, 0.0, CAP), _brim()]
    thickness = {"short": 0.0065, "medium": 0.0125, "long": 0.0095, "bun": 0.006}[style]
    parts = [_mantle(style, thickness, {"medium": 0.004, "long": 0.003}.get(style, 0.0), HAIR)]
    if style == "long":
        parts.append(_curtain(-0.055, 0.076))
    if style == "medium":
        parts.append(_curtain(0.020, 0.076))
    if style == "bun":
        rows = [(0.098, -0.072, 0, 0, 0, 0), (0.104, -0.072, 0, 0.014, 0.014, 0.015)]
        rows += [(0.116, -0.074, 0, 0.019, 0.019, 0.020), (0.128, -0.073, 0, 0.014, 0.014, 0.015)]
        rows += [(0.134, -0.072, 0, 0, 0, 0)]
        rings = ovals(rows, 8)
        parts.append(tube(rings, _flat(rings, HAIR)))
    return parts


def _mantle(style: str, thickness: float, flare: float, region: tuple[int, int, int, int]) -> TriangleMesh:
    """Hair (or a hat) as a second skin over the skull, thick at the crown and thin where it ends."""
    turn = angles(_COUNT)
    end = np.full(_COUNT, 0.108) if style == "cap" else hairline(style, turn)
    shares = np.array([0.0, 0.12, 0.30, 0.54, 0.79, 1.0, 1.02])
    # Denser towards the crown, where the skull curves most.
    z = 0.160 - (0.160 - end[None]) * shares[:, None] ** 1.35
    points = _surface(np.broadcast_to(turn, z.shape), z)
    middle = np.array([-0.002, 0.0, 0.098])
    outward = points - middle
    outward /= np.sqrt((outward**2).sum(axis=2, keepdims=True))
    depth = thickness * np.array([1.15, 1.15, 1.1, 1.0, 0.8, 0.25, -0.5])
    if style == "cap":
        depth = thickness * np.array([1.3, 1.3, 1.3, 1.2, 1.05, 0.9, -0.5])
    depth = depth[:, None] + flare * np.clip(np.abs(turn) / np.pi, 0.3, 1.0)[None] * np.clip(shares, 0, 0.8)[:, None]
    depth[-1] = -0.003
    points = points + outward * depth[..., None]
    points[0] = points[0].mean(axis=0)
    return tube(points, _flat(points, region))


def _curtain(low: float, high: float) -> TriangleMesh:
    """Hair that hangs behind the ears and down the back."""
    z = np.linspace(high, low, 6)
    share = np.linspace(0.0, 1.0, 6)
    rows = np.stack(
        [
            z,
            -0.022 - 0.016 * share,
            np.zeros(6),
            np.full(6, 0.031),
            0.043 - 0.010 * share,
            0.0530 + 0.003 * np.sin(np.pi * share) - 0.012 * share**2,
        ],
        axis=1,
    )
    rows = np.vstack([(high + 0.012, -0.025, 0, 0, 0, 0), rows, (low - 0.006, -0.038, 0, 0, 0, 0)])
    rings = ovals(rows, 12, power=2.4)
    return tube(rings, _flat(rings, HAIR))


def _brim() -> TriangleMesh:
    rows = [
        (0.112, 0.066, 0, 0.0, 0.0, 0.0),
        (0.1115, 0.050, 0, 0.046, 0.02, 0.036),
        (0.1085, 0.050, 0, 0.047, 0.02, 0.037),
        (0.108, 0.066, 0, 0.0, 0.0, 0.0),
    ]
    rings = ovals(rows, 12)
    rings[..., 2] -= 0.10 * np.clip(rings[..., 0] - 0.05, 0.0, None) + 2.0 * rings[..., 1] ** 2
    return tube(rings, _flat(rings, CAP))


def _flat(rings: Array, region: tuple[int, int, int, int]) -> Array:
    """Texture pixels that spread one region over the whole shell."""
    column, row, width, height = region
    across = np.linspace(column + 3.0, column + width - 3.0, rings.shape[1] + 1)
    down = np.linspace(row + 3.0, row + height - 3.0, len(rings))
    return np.stack(np.broadcast_arrays(across[None], down[:, None]), axis=-1)
