"""What the robot looks like: geoms that neither collide nor weigh."""

from __future__ import annotations

from typing import TypeAlias

import mujoco

from pftrack_sim.scene.layout import ROBOT_GROUP
from pftrack_sim.scene.robot import dimensions as d

Rgba: TypeAlias = tuple[float, float, float, float]
Triple: TypeAlias = tuple[float, float, float]

BODY: Rgba = (0.88, 0.89, 0.90, 1.0)
TRIM: Rgba = (0.95, 0.45, 0.10, 1.0)
DARK: Rgba = (0.13, 0.14, 0.16, 1.0)
RUBBER: Rgba = (0.07, 0.07, 0.08, 1.0)
METAL: Rgba = (0.62, 0.64, 0.67, 1.0)
GLASS: Rgba = (0.10, 0.12, 0.22, 1.0)
GREEN: Rgba = (0.25, 0.85, 0.40, 1.0)

MAST_RADIUS_M = 0.018

_BOX, _CYLINDER, _SPHERE = mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_SPHERE
_ALONG_X = (0.70710678, 0.0, 0.70710678, 0.0)
_ALONG_Y = (0.70710678, 0.70710678, 0.0, 0.0)
_UPRIGHT = (1.0, 0.0, 0.0, 0.0)


def dress_base(base: mujoco.MjsBody) -> None:
    """Hull, skirt, bumper, deck with a lid, status lights, a laser scanner in front."""
    r = d.BASE_RADIUS_M
    _disc(base, r, 0.100, d.DECK_M - 0.012, BODY)
    _disc(base, r - 0.015, d.BASE_BOTTOM_M, 0.100, DARK)
    _disc(base, r + 0.004, 0.088, 0.112, TRIM)
    _disc(base, r - 0.012, d.DECK_M - 0.012, d.DECK_M - 0.002, DARK)
    _part(base, _BOX, (0.06, 0.09, 0.004), (-0.11, 0, d.DECK_M), METAL)
    _part(base, _CYLINDER, (0.035, 0.024, 0), (0.15, 0, d.DECK_M + 0.018), DARK)
    _part(base, _CYLINDER, (0.036, 0.005, 0), (0.15, 0, d.DECK_M + 0.022), GLASS)
    _part(base, _BOX, (0.004, 0.05, 0.012), (r - 0.005, 0, 0.165), GREEN)
    _part(base, _BOX, (0.012, 0.03, 0.012), (-r + 0.006, 0, 0.165), TRIM)


def dress_wheel(wheel: mujoco.MjsBody, outward: float) -> None:
    """Tyre, rim and three spokes; `outward` is the sign of y away from the base."""
    half = d.WHEEL_HALF_WIDTH_M
    _part(wheel, _CYLINDER, (d.WHEEL_RADIUS_M, half, 0), (0, 0, 0), RUBBER, _ALONG_Y)
    _part(wheel, _CYLINDER, (0.06, half + 0.002, 0), (0, 0, 0), METAL, _ALONG_Y)
    _part(wheel, _BOX, (0.052, 0.002, 0.008), (0, outward * (half + 0.003), 0), TRIM)


def dress_caster(caster: mujoco.MjsBody) -> None:
    """Ball and stem."""
    _part(caster, _SPHERE, (d.CASTER_RADIUS_M, 0, 0), (0, 0, 0), RUBBER)
    _part(caster, _CYLINDER, (0.015, 0.02, 0), (0, 0, 0.045), METAL)


def dress_mast(mast: mujoco.MjsBody, length_m: float) -> None:
    """A foot on the deck, and a clamp half way up when there is room."""
    _part(mast, _CYLINDER, (0.045, 0.012, 0), (0, 0, 0.01), DARK)
    if length_m > 0.5:
        _part(mast, _BOX, (0.028, 0.028, 0.02), (0, 0, 0.5 * length_m), DARK)
        _part(mast, _BOX, (0.006, 0.045, 0.06), (-0.03, 0, 0.5 * length_m), BODY)


def dress_pan(pan: mujoco.MjsBody) -> None:
    """Motor housing and the two arms of the yoke."""
    _part(pan, _CYLINDER, (0.036, 0.014, 0), (0, 0, 0.006), DARK)
    for sign in (1.0, -1.0):
        _part(pan, _BOX, (0.016, 0.004, 0.026), (0, sign * 0.048, d.NECK_M - 0.012), METAL)
    _part(pan, _BOX, (0.016, 0.052, 0.004), (0, 0, 0.022), METAL)


def dress_head(head: mujoco.MjsBody) -> None:
    """Camera housing and lens, all of it behind the optical centre."""
    _part(head, _BOX, (0.036, 0.042, 0.027), (-0.006, 0, 0), BODY)
    _part(head, _BOX, (0.003, 0.036, 0.022), (0.031, 0, 0), DARK)
    _part(head, _CYLINDER, (0.018, 0.012, 0), (0.044, 0, 0), DARK, _ALONG_X)
    _part(head, _CYLINDER, (0.014, 0.0005, 0), (0.0562, 0, 0), GLASS, _ALONG_X)
    _part(head, _SPHERE, (0.004, 0, 0), (-0.04, 0.025, 0.01), GREEN)


def _disc(body: mujoco.MjsBody, radius_m: float, bottom_m: float, top_m: float, rgba: Rgba) -> None:
    _part(body, _CYLINDER, (radius_m, 0.5 * (top_m - bottom_m), 0), (0, 0, 0.5 * (top_m + bottom_m)), rgba)


def _part(
    body: mujoco.MjsBody,
    kind: mujoco.mjtGeom,
    size: Triple,
    pos: Triple,
    rgba: Rgba,
    quat: tuple[float, float, float, float] = _UPRIGHT,
) -> None:
    body.add_geom(
        type=kind,
        size=list(size),
        pos=list(pos),
        quat=list(quat),
        rgba=list(rgba),
        mass=0.0,
        contype=0,
        conaffinity=0,
        group=ROBOT_GROUP,
    )
