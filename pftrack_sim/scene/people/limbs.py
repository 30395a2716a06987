"""Arms, legs and feet as lofts; profiles as in `trunk`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.scene.people.anatomy import Anatomy
from pftrack_sim.scene.people.atlas import BOTTOM, SHOES, TOP
from pftrack_sim.scene.people.clothes import Outfit
from pftrack_sim.scene.people.materials import bare, cloth
from pftrack_sim.scene.people.mesh import TriangleMesh, joined, ovals, tube

Array = NDArray[np.float64]

_SLEEVE_COLUMN = 96.0
"""Sleeves are cut from beside the chest, where no print is."""


def thigh(anatomy: Anatomy, outfit: Outfit) -> TriangleMesh:
    """The left thigh below its hip joint (the origin); the right one is its mirror image."""
    ease = 0.001 + 0.005 * outfit.looseness
    skin = _scaled(
        [
            (0.042, 0.000, 0.004, 0.020, 0.024, 0.022),
            (0.022, -0.002, 0.003, 0.046, 0.056, 0.042),
            (-0.010, -0.003, 0.001, 0.053, 0.062, 0.0475),
            (-0.045, -0.002, 0.000, 0.0535, 0.060, 0.0475),
            (-0.095, 0.000, -0.001, 0.051, 0.050, 0.0450),
            (-0.145, 0.002, -0.002, 0.046, 0.043, 0.0410),
            (-0.195, 0.002, -0.003, 0.040, 0.037, 0.0370),
            (-0.228, 0.002, -0.003, 0.036, 0.034, 0.0345),
            (-0.252, 0.001, -0.003, 0.029, 0.029, 0.0300),
            (-0.266, 0.000, -0.003, 0.015, 0.015, 0.0160),
            (-0.269, 0.000, -0.003, 0.0, 0.0, 0.0),
        ],
        anatomy,
        anatomy.thigh_m / 0.245,
    )
    cut = skin.copy()
    cut[2:, 3:] += ease * anatomy.height_m
    if outfit.long_legs:
        return cloth(ovals(cut, 10), BOTTOM, 256.0, 0.02, reach_m=0.32 * anatomy.height_m)
    garment = cut[:7].copy()
    garment[5:, 3:] += 0.004 * anatomy.height_m
    garment = np.concatenate([garment, garment[-1:] * (1, 1, 1, 0.5, 0.5, 0.5)])
    leg = skin[5:]
    return joined(
        [
            cloth(ovals(garment, 10), BOTTOM, 256.0, 0.02, reach_m=0.28 * anatomy.height_m),
            bare(ovals(leg, 10)),
        ]
    )


def shank(anatomy: Anatomy, outfit: Outfit) -> TriangleMesh:
    """A lower leg below its knee joint (the origin)."""
    stretch = anatomy.shank_m / 0.245
    skin = _scaled(
        [
            (0.031, 0.000, 0.0, 0.0, 0.0, 0.0),
            (0.027, 0.000, 0.0, 0.017, 0.016, 0.016),
            (0.014, 0.001, 0.0, 0.031, 0.029, 0.029),
            (-0.012, 0.002, 0.0, 0.034, 0.034, 0.033),
            (-0.050, 0.000, 0.0, 0.030, 0.039, 0.033),
            (-0.085, -0.001, 0.0, 0.027, 0.040, 0.032),
            (-0.130, -0.002, 0.0, 0.023, 0.031, 0.026),
            (-0.180, -0.003, 0.0, 0.019, 0.022, 0.020),
            (-0.225, -0.003, 0.0, 0.018, 0.020, 0.018),
            (-0.250, -0.002, 0.0, 0.012, 0.012, 0.012),
        ],
        anatomy,
        stretch,
    )
    if not outfit.long_legs:
        return bare(ovals(skin, 10))
    loose = 0.35 + 0.65 * outfit.looseness
    garment = skin.copy()
    garment[2:, 3:] += 0.0035 * anatomy.height_m
    # Trouser legs hang from the calf: below it they hardly taper, and break over the shoe.
    hang = np.array([0.0, 0.0, 0.0, 0.0, 0.2, 0.45, 0.75, 0.9, 1.0, 1.0])[:, None] * loose
    garment[:, 3:] = (1.0 - hang) * garment[:, 3:] + hang * np.maximum(
        garment[:, 3:], np.array([0.030, 0.038, 0.031]) * anatomy.height_m
    )
    garment[9] = garment[8]
    garment[9, 0] = -0.236 * stretch
    garment[9, 1] -= 0.001 * anatomy.height_m
    fold = garment[9] * (0.985, 1, 1, 0.4, 0.4, 0.4)
    return cloth(ovals(np.concatenate([garment, fold[None]]), 10), BOTTOM, 256.0, 0.04, reach_m=0.30 * anatomy.height_m)


def upper_arm(anatomy: Anatomy, outfit: Outfit) -> TriangleMesh:
    """An upper arm below its shoulder joint (the origin)."""
    ease = (0.001 + 0.005 * outfit.looseness) * anatomy.height_m
    skin = _scaled(
        [
            (0.015, 0.000, -0.002, 0.0, 0.0, 0.0),
            (0.0125, 0.000, -0.002, 0.014, 0.015, 0.013),
            (0.005, -0.001, -0.001, 0.0240, 0.0250, 0.0215),
            (-0.012, -0.001, 0.0, 0.0290, 0.0295, 0.0255),
            (-0.040, 0.000, 0.0, 0.029, 0.029, 0.0265),
            (-0.085, 0.001, 0.0, 0.027, 0.026, 0.0245),
            (-0.130, 0.001, 0.0, 0.0245, 0.0235, 0.0225),
            (-0.164, 0.000, 0.0, 0.0225, 0.0225, 0.0215),
            (-0.182, 0.000, 0.0, 0.017, 0.017, 0.0170),
            (-0.190, 0.000, 0.0, 0.0, 0.0, 0.0),
        ],
        anatomy,
        anatomy.upper_arm_m / 0.170,
    )
    garment = skin.copy()
    garment[2:-1, 3:] += ease * np.array([0.3, 0.6, 1.0, 1.0, 1.0, 1.0, 1.0])[:, None]
    if outfit.long_sleeves:
        return cloth(ovals(garment, 8), TOP, _SLEEVE_COLUMN, 0.03 * anatomy.height_m)
    sleeve = garment[:6].copy()
    sleeve[4:, 3:] += 0.0035 * anatomy.height_m
    sleeve[5, 0] = -0.092 * anatomy.height_m
    hem = sleeve[-1:] * (0.97, 1, 1, 0.5, 0.5, 0.5)
    return joined(
        [
            cloth(ovals(np.concatenate([sleeve, hem]), 8), TOP, _SLEEVE_COLUMN, 0.03 * anatomy.height_m),
            bare(ovals(skin[4:], 8)),
        ]
    )


def forearm(anatomy: Anatomy, outfit: Outfit) -> TriangleMesh:
    """The left forearm with its hand below the elbow joint (the origin), thumb to the front."""
    skin = _scaled(
        [
            (0.022, 0.000, 0.0, 0.0, 0.0, 0.0),
            (0.016, 0.000, 0.0, 0.0145, 0.0145, 0.0145),
            (0.000, 0.000, 0.0, 0.0225, 0.0225, 0.0215),
            (-0.030, 0.001, 0.0, 0.0245, 0.0240, 0.0215),
            (-0.070, 0.001, 0.0, 0.0215, 0.0210, 0.0185),
            (-0.110, 0.001, 0.0, 0.0175, 0.0170, 0.0145),
            (-0.140, 0.001, 0.0, 0.0155, 0.0155, 0.0115),
        ],
        anatomy,
        anatomy.forearm_m / 0.146,
    )
    h, hand = anatomy.height_m, anatomy.hand_m / anatomy.height_m / 0.105
    wrist = -anatomy.forearm_m / h
    palm = np.array(
        [
            (wrist - 0.010 * hand, 0.002, 0.000, 0.0175, 0.0165, 0.0120),
            (wrist - 0.028 * hand, 0.004, -0.001, 0.0215, 0.0200, 0.0135),
            (wrist - 0.048 * hand, 0.005, -0.002, 0.0220, 0.0210, 0.0130),
            (wrist - 0.068 * hand, 0.006, -0.005, 0.0200, 0.0200, 0.0115),
            (wrist - 0.086 * hand, 0.008, -0.010, 0.0165, 0.0165, 0.0100),
            (wrist - 0.096 * hand, 0.009, -0.014, 0.0100, 0.0100, 0.0070),
            (wrist - 0.099 * hand, 0.009, -0.015, 0.0, 0.0, 0.0),
        ]
    )
    thumb = np.array(
        [
            (wrist - 0.014 * hand, 0.012, -0.002, 0.006, 0.006, 0.006),
            (wrist - 0.032 * hand, 0.025, -0.006, 0.0075, 0.0075, 0.007),
            (wrist - 0.050 * hand, 0.030, -0.009, 0.0065, 0.0065, 0.006),
            (wrist - 0.060 * hand, 0.031, -0.011, 0.0, 0.0, 0.0),
        ]
    )
    parts = [bare(ovals(thumb * h, 5))]
    if not outfit.long_sleeves:
        return joined([bare(ovals(np.concatenate([skin, palm * h]), 8, power=2.2)), *parts])
    garment = skin.copy()
    garment[2:, 3:] += (0.0022 + 0.004 * outfit.looseness) * h
    cuff = garment[-1:] * (0.985, 1, 1, 0.5, 0.5, 0.5)
    sleeve = cloth(ovals(np.concatenate([garment, cuff]), 8), TOP, _SLEEVE_COLUMN, 0.0, first_row=112.0)
    start = skin[-1:].copy()
    start[0, 0] += 0.012 * h
    return joined([sleeve, bare(ovals(np.concatenate([start, palm * h]), 8, power=2.2)), *parts])


def foot(anatomy: Anatomy, outfit: Outfit) -> TriangleMesh:
    """The left shoe about its ankle joint (the origin); its sole is the one the gait rolls on."""
    length = anatomy.foot_m
    heel_x, heel_r, toe_x, toe_r = anatomy.sole_m
    # x and half width and top in shares of the shoe's length; the bottom follows from the sole's arcs.
    rows = np.array(
        [
            (-0.262, 0.050, -0.020),
            (-0.250, 0.085, 0.040),
            (-0.200, 0.118, 0.085),
            (-0.060, 0.130, 0.098),
            (0.050, 0.129, 0.075),
            (0.150, 0.134, 0.015),
            (0.260, 0.150, -0.050),
            (0.400, 0.170, -0.110),
            (0.520, 0.176, -0.140),
            (0.620, 0.166, -0.157),
            (0.690, 0.140, -0.176),
            (0.730, 0.105, -0.196),
            (0.745, 0.060, -0.215),
        ]
    )
    x, half, top = rows[:, 0] * length, rows[:, 1] * length, rows[:, 2] * length
    beyond = np.maximum(heel_x - x, 0.0), np.maximum(x - toe_x, 0.0)
    bottom = (
        -anatomy.ankle_m
        + heel_r
        - np.sqrt(np.maximum(heel_r**2 - beyond[0] ** 2, 0.0))
        + toe_r
        - np.sqrt(np.maximum(toe_r**2 - beyond[1] ** 2, 0.0))
    )
    top = np.maximum(top, bottom + 0.05 * length)
    turn = -np.pi + 2.0 * np.pi * np.arange(8) / 8.0
    up, side = np.cos(turn), np.sin(turn)
    # Rings start at the bottom. A flat bottom and steep walls below, a vault above.
    upward = np.where(up > 0.0, np.abs(up) ** 0.85, -(np.abs(up) ** 0.30))
    sideward = np.sign(side) * np.abs(side) ** np.where(up > 0.0, 0.85, 0.42)
    low = bottom + 0.32 * (top - bottom)
    rings = np.empty((len(rows), 8, 3))
    rings[..., 0] = x[:, None]
    outward = (
        0.020 * length * np.clip(rows[:, 0] / 0.5, 0.0, 1.0) * np.sin(np.clip(rows[:, 0] / 0.745, 0.0, 1.0) * np.pi)
    )
    rings[..., 1] = half[:, None] * sideward + outward[:, None]
    rings[..., 2] = low[:, None] + np.where(upward > 0.0, (top - low)[:, None], (low - bottom)[:, None]) * upward
    ends = rings[[0, -1]].mean(axis=1, keepdims=True).repeat(8, axis=1)
    rings = np.concatenate([ends[:1], rings, ends[1:]])
    lift = (rings[..., 2] + anatomy.ankle_m) / (0.30 * length)
    lift = np.concatenate([lift, lift[:, :1]], axis=1)
    column, row, width, height = SHOES
    # The sole's colour is the bottom fifth of the picture; toes show no laces.
    across = np.linspace(0.02, 0.98, 9)[None].repeat(len(rings), axis=0)
    rows_px = row + 2.0 + (height - 4.0) * (1.0 - np.clip(lift, 0.0, 1.0))
    return tube(rings, np.stack([column + width * across, rows_px], axis=-1))


def _scaled(rows: Sequence[tuple[float, ...]], anatomy: Anatomy, stretch: float) -> Array:
    """Rows in metres: lengths by the person's segment, thickness by half of the person's girth."""
    table = np.asarray(rows, dtype=float) * anatomy.height_m
    table[:, 0] *= stretch / anatomy.height_m
    table[:, 2:] *= 1.0 + 0.55 * (anatomy.girth - 1.0)
    return table
