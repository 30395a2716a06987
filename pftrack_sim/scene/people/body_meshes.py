"""Meshes of trunk, arms, legs and feet.

Profiles (in `assets/people.toml`) are drawn by eye from anatomical charts; a person's segment lengths and girth scale
them.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from pftrack_sim.core.types import FloatArray
from pftrack_sim.scene.people.anatomy import Anatomy
from pftrack_sim.scene.people.mesh import (
    TriangleMesh,
    load_profile,
    lofted_mesh,
    merged,
    ring_angles,
    superellipse_rings,
)
from pftrack_sim.scene.people.outfit import Outfit
from pftrack_sim.scene.people.texture_atlas import BOTTOM, SHOES, TOP, cloth_mesh, skin_mesh

_FRONT_COLUMN = 256.0
_BELT, _LEG_SHARE = 0.10, 0.37  # Height of the belt above the hips, and the length of the cloth below it, in statures
_SLEEVE_COLUMN = 406.0  # Sleeves show cloth from beside the chest, outside the print

_PALM_RINGS = 4
# Of index, middle, ring and little finger: place ahead of the wrist and beside it, length and bend.
_FINGERS = np.transpose([
    (0.0185, 0.0075, -0.003, -0.0125), (-0.002, -0.001, -0.001, -0.003), (1.0, 1.1, 1.02, 0.8), (0.8, 1.0, 1.2, 1.4)
])  # fmt: skip


def torso_mesh(anatomy: Anatomy, outfit: Outfit) -> TriangleMesh:
    """Waist (the origin) to the base of the neck, in a top that hangs over the hips; jackets and loose tops lower."""
    h, g, f, ease = anatomy.height_m, anatomy.girth, anatomy.figure, 0.0015 + 0.007 * outfit.looseness
    table = load_profile("torso")
    # The hem hangs straight down from the hips, before and behind which it stands off.
    table[1:3, 3], table[1, 5] = table[1:3, 3] + 0.008, table[1, 5] + 0.006
    lower = 0.05 if outfit.cut == "jacket" else 0.045 * max(outfit.looseness - 0.2, 0.0)
    table[:2, 0] -= lower
    table[1:4, 3:] += 20.0 * lower * np.array([(0.020, 0.016, 0.012), (0.018, 0.014, 0.008), (0.008, 0.007, 0.004)])
    table[1:7, 3:5] += ease
    table[7, 3:5] += (0.5 * ease, ease)
    table[1:5, 3] += np.array([0.04, 0.09, 0.11, 0.06]) * max(g - 1.0, 0.0)  # belly
    table[5:7, 3] += (0.013 * f, 0.7 * (0.013 * f))  # bust
    waist, hips = 1.0 - 0.13 * f, 1.0 + 0.05 * f
    table[1:5, 5] = (table[1:5, 5] + ease) * (hips, hips, waist, waist)
    table[5:7, 5] += (0.6 * ease, 0.4 * ease)
    table[7:11, 5] += anatomy.shoulder_half_m / h
    table[:, 3:] *= (1.0 + 0.85 * (g - 1.0)) * h
    table[:, 0] *= anatomy.torso_m / 0.230
    table[:, 1] *= h
    # The skeleton sets the width of the shoulders; only the sections below them grow with girth.
    table[7:, 5] /= 1.0 + 0.85 * (g - 1.0)
    rings, top_m = superellipse_rings(table, 14, power=2.35), 0.245 * anatomy.torso_m / 0.230
    torso = cloth_mesh(rings, TOP, _FRONT_COLUMN, top_m, length_m=top_m - float(table[1, 0]))
    if outfit.cut != "hood":
        return torso
    hood = load_profile("hood") * h
    hood[:, 0] *= anatomy.torso_m / (0.230 * h)
    return merged([torso, cloth_mesh(superellipse_rings(hood, 10), TOP, _FRONT_COLUMN, top_m)])


def pelvis_mesh(anatomy: Anatomy, outfit: Outfit) -> TriangleMesh:
    """Hips in trousers or a skirt; the origin is midway between the hip joints."""
    h, g, hips = anatomy.height_m, anatomy.girth, 1.0 + 0.08 * anatomy.figure
    skirt = in_skirt(anatomy, outfit)
    table = load_profile("skirt" if skirt else "pelvis")
    table[2:6, 5] *= hips
    table[:, 3:] *= 1.0 + 0.9 * ((max(g, 1.0) if skirt else g) - 1.0)  # a slim person's stride is not shorter
    rings = superellipse_rings(table * h, 12, power=2.25)
    return cloth_mesh(rings, BOTTOM, _FRONT_COLUMN, _BELT * h, length_m=_LEG_SHARE * h)


def in_skirt(anatomy: Anatomy, outfit: Outfit) -> bool:
    """Whether a person wears a skirt where the outfit has one."""
    return outfit.skirt and anatomy.figure > 0.5


def thigh_mesh(anatomy: Anatomy, outfit: Outfit) -> TriangleMesh:
    """The left thigh below its hip joint (the origin)."""
    h, ease = anatomy.height_m, 0.001 + 0.005 * outfit.looseness
    skin = _scaled("thigh", anatomy, anatomy.thigh_m / 0.245)
    garment = skin.copy()
    garment[2:, 3:] += ease * h
    if in_skirt(anatomy, outfit):
        # Thin enough not to leave the skirt in a stride.
        skin[:7, 3:] *= np.array([0.6, 0.6, 0.6, 0.6, 0.6, 0.68, 0.9])[:, None]
        return skin_mesh(superellipse_rings(skin, 10))
    if outfit.long_legs:
        return cloth_mesh(superellipse_rings(garment, 10), BOTTOM, _FRONT_COLUMN, _BELT * h, length_m=_LEG_SHARE * h)
    garment = garment[:7]
    garment[5:, 3:] += 0.004 * h
    shorts = superellipse_rings(np.concatenate([garment, garment[-1:] * (1, 1, 1, 0.5, 0.5, 0.5)]), 10)
    leg = skin_mesh(superellipse_rings(skin[5:], 10))
    return merged([cloth_mesh(shorts, BOTTOM, _FRONT_COLUMN, _BELT * h, length_m=_LEG_SHARE * h), leg])


def shank_mesh(anatomy: Anatomy, outfit: Outfit) -> TriangleMesh:
    """A lower leg below its knee joint (the origin)."""
    h, stretch = anatomy.height_m, anatomy.shank_m / 0.245
    skin = _scaled("shank", anatomy, stretch)
    if in_skirt(anatomy, outfit) or not outfit.long_legs:
        return skin_mesh(superellipse_rings(skin, 10))
    garment = skin.copy()
    garment[2:, 3:] += (0.001 + 0.005 * outfit.looseness) * h
    # Trouser legs hang from the calf: below it they hardly taper, and they end over the shoe.
    hang = np.array([0.0, 0.0, 0.0, 0.0, 0.2, 0.45, 0.75, 0.9, 1.0, 1.0])[:, None] * (0.35 + 0.65 * outfit.looseness)
    hanging = np.maximum(garment[:, 3:], np.array([0.030, 0.038, 0.031]) * h)
    garment[:, 3:] = (1.0 - hang) * garment[:, 3:] + hang * hanging
    garment[9] = garment[8]
    garment[9, 0] = -0.236 * stretch
    garment[9, 1] -= 0.001 * h
    hem = garment[-1:] * (0.985, 1, 1, 0.4, 0.4, 0.4)
    rings = superellipse_rings(np.concatenate([garment, hem]), 10)
    # From the knee, the cloth runs back up to the belt, whose edge becomes the hem.
    knee_row = (_BELT + anatomy.thigh_m / h) / _LEG_SHARE * BOTTOM.height
    return cloth_mesh(rings, BOTTOM, _FRONT_COLUMN, 0.0, length_m=-_LEG_SHARE * h, first_row=knee_row)


def upper_arm_mesh(anatomy: Anatomy, outfit: Outfit) -> TriangleMesh:
    """An upper arm below its shoulder joint (the origin)."""
    h = anatomy.height_m
    ease = (0.001 + 0.005 * outfit.looseness) * h
    skin = _scaled("upper-arm", anatomy, anatomy.upper_arm_m / 0.170)
    garment = skin.copy()
    garment[2:-1, 3:] += ease * np.array([0.3, 0.6, 1.0, 1.0, 1.0, 1.0, 1.0])[:, None]
    if outfit.long_sleeves:
        return cloth_mesh(superellipse_rings(garment, 8), TOP, _SLEEVE_COLUMN, 0.03 * h)
    garment = garment[:6]
    garment[4:, 3:] += 0.0035 * h
    garment[5, 0] = -0.092 * h
    sleeve = superellipse_rings(np.concatenate([garment, garment[-1:] * (0.97, 1, 1, 0.5, 0.5, 0.5)]), 8)
    arm = skin_mesh(superellipse_rings(skin[4:], 8))
    return merged([cloth_mesh(sleeve, TOP, _SLEEVE_COLUMN, 0.03 * h), arm])


def forearm_mesh(anatomy: Anatomy, outfit: Outfit) -> TriangleMesh:
    """The left forearm with its hand below the elbow joint (the origin), thumb to the front."""
    skin = _scaled("forearm", anatomy, anatomy.forearm_m / 0.146)
    h, hand = anatomy.height_m, anatomy.hand_m / 0.105
    palm, digits = load_profile("palm"), _digits()
    palm[:, 0] *= -hand / h
    palm[:, 0] -= anatomy.forearm_m / h
    digits = replace(digits, vertices=digits.vertices * hand - (0.0, 0.0, anatomy.forearm_m))
    if not outfit.long_sleeves:
        arm = superellipse_rings(np.concatenate([skin, palm * h]), 8, power=2.2)
        return merged([_to_knuckles(skin_mesh(arm), len(skin)), digits])
    garment = skin.copy()
    garment[2:, 3:] += (0.0022 + 0.004 * outfit.looseness) * h
    sleeve = superellipse_rings(np.concatenate([garment, garment[-1:] * (0.985, 1, 1, 0.5, 0.5, 0.5)]), 8)
    sleeve_mesh = cloth_mesh(sleeve, TOP, _SLEEVE_COLUMN, 0.0, first_row=112.0)
    skin[-1, 0] += 0.012 * h
    hand_rings = superellipse_rings(np.concatenate([skin[-1:], palm * h]), 8, power=2.2)
    return merged([sleeve_mesh, _to_knuckles(skin_mesh(hand_rings), 1), digits])


def _to_knuckles(mesh: TriangleMesh, rings: int) -> TriangleMesh:
    """A hand whose palm follows so many rings of 8 points, without fingers; in the distance it stays a mitten."""
    return replace(mesh, faces=mesh.faces[(mesh.faces < 9 * (rings + _PALM_RINGS)).all(axis=1)])


@cache
def _digits() -> TriangleMesh:
    """Thumb and fingers of a left hand below its wrist (the origin), in statures; in the distance the thumb alone."""
    thumb, finger = load_profile("thumb"), load_profile("finger")
    meshes = [skin_mesh(superellipse_rings(thumb * (-1, 1, 1, 1, 1, 1), 5))]
    for x, y, length, curl in _FINGERS:
        table = finger * (-length, 1, 1, 1, 1, 1)
        table[:, 0] -= 0.046
        table[:, 1] += x
        table[:, 2] = y + curl * table[:, 2]
        one = skin_mesh(superellipse_rings(table, 4))
        meshes.append(replace(one, coarse=(one.coarse[0][:0],) * len(one.coarse)))
    return merged(meshes)


def foot_mesh(anatomy: Anatomy, outfit: Outfit) -> TriangleMesh:
    """The left shoe about its ankle joint (the origin); its sole has the arcs on which the gait rolls."""
    length = anatomy.foot_m
    heel_x, heel_r, toe_x, toe_r = anatomy.sole_m
    # In lengths of the shoe; the bottom follows from the arcs of the sole.
    share = np.array([-0.262, -0.250, -0.200, -0.060, 0.050, 0.150, 0.260, 0.400, 0.520, 0.620, 0.690, 0.730, 0.745])
    half = np.array([0.050, 0.085, 0.118, 0.130, 0.129, 0.134, 0.150, 0.170, 0.176, 0.166, 0.140, 0.105, 0.060])
    top = np.array([-0.02, 0.04, 0.085, 0.098, 0.075, 0.015, -0.05, -0.11, -0.14, -0.157, -0.176, -0.196, -0.215])
    x, half, top = share * length, half * length, top * length
    behind, ahead = np.maximum(heel_x - x, 0.0), np.maximum(x - toe_x, 0.0)
    bottom = -anatomy.ankle_m + heel_r - np.sqrt(np.maximum(heel_r**2 - behind**2, 0.0))
    bottom = bottom + toe_r - np.sqrt(np.maximum(toe_r**2 - ahead**2, 0.0))
    top = np.maximum(top, bottom + 0.05 * length)
    # Rings start at the bottom: a flat bottom and steep walls, a vault above.
    angle = ring_angles(8)
    up, side = np.cos(angle), np.sin(angle)
    upward = np.where(up > 0.0, np.abs(up) ** 0.85, -(np.abs(up) ** 0.30))
    sideward = np.sign(side) * np.abs(side) ** np.where(up > 0.0, 0.85, 0.42)
    low = bottom + 0.32 * (top - bottom)
    outward = 0.020 * length * np.clip(share / 0.5, 0.0, 1.0) * np.sin(np.clip(share / 0.745, 0.0, 1.0) * np.pi)
    rings = np.empty((len(share), 8, 3))
    rings[..., 0] = x[:, None]
    rings[..., 1] = half[:, None] * sideward + outward[:, None]
    rings[..., 2] = low[:, None] + np.where(upward > 0.0, (top - low)[:, None], (low - bottom)[:, None]) * upward
    ends = rings[[0, -1]].mean(axis=1, keepdims=True).repeat(8, axis=1)
    rings = np.concatenate([ends[:1], rings, ends[1:]])
    # The bottom fifth of the shoe's texture shows the sole.
    lift = (rings[..., 2] + anatomy.ankle_m) / (0.30 * length)
    lift = np.concatenate([lift, lift[:, :1]], axis=1)
    rows = SHOES.row + 2.0 + (SHOES.height - 4.0) * (1.0 - np.clip(lift, 0.0, 1.0))
    columns = SHOES.column + SHOES.width * np.broadcast_to(np.linspace(0.02, 0.98, 9), rows.shape)
    return lofted_mesh(rings, np.stack([columns, rows], axis=-1))


def _scaled(name: str, anatomy: Anatomy, stretch: float) -> FloatArray:
    """A profile in metres: lengths scaled by the person's segment, thickness by half of the person's girth."""
    scaled = load_profile(name) * anatomy.height_m
    scaled[:, 0] *= stretch / anatomy.height_m
    scaled[:, 2:] *= 1.0 + 0.55 * (anatomy.girth - 1.0)
    return scaled
