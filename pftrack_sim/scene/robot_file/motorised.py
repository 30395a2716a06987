"""A robot of a file that moves by its own motors, wheels, springs and masses: an MJCF as `assets/robot.xml` is.

Its mast is as long as the height of the scenario's camera asks, and its springs are stretched so that it stands level.
"""

from __future__ import annotations

import math
import operator
from dataclasses import dataclass
from functools import lru_cache, reduce
from typing import Any

import mujoco

from pftrack_sim.core.errors import ParameterError
from pftrack_sim.scene.robot_file.reading import compile_spec, read_spec
from pftrack_sim.scene.robot_file.roles import Roles
from pftrack_sim.scene.scene_spec import SceneSpec

SUSPENSIONS = ("left", "right", "front", "rear")  # Of the wheels and of the casters
GRAVITY_M_S2 = 9.81

_SIDES = ("left", "right")
_NAMES = {
    "body": ("base", "mast", "pan", "head"),
    "joint": (*(f"axle-{side}" for side in _SIDES), *(f"suspension-{end}" for end in SUSPENSIONS), "mast-pitch",
              "mast-roll", "pan", "tilt"),
    "geom": (*(f"tyre-{side}" for side in _SIDES), "pole"),
    "camera": ("camera",),
    "actuator": (*(f"drive-{side}" for side in _SIDES), "pan", "tilt"),
    "sensor": (*(f"wheel-speed-{side}" for side in _SIDES), "pan", "tilt", "gyro", "accelerometer"),
}  # fmt: skip
_MAST_HZ_M = 4.5  # Natural frequency of a mast on a fixed base, times its length: longer masts swing slower
_MAST_HZ_RANGE = (3.0, 15.0)
_MAST_DAMPING_RATIO = 0.06
_MIN_POLE_M = 0.02
_MIN_CLAMPED_M = 0.5


@dataclass(frozen=True)
class Mast:
    """What a file's mast carries, and where.

    Attributes:
        deck_m: Height of its foot.
        neck_m: From its top up to the tilt axis.
        lens_m: From the tilt axis forward to the optical centre.
        kg_m: Mass of its pole by length.
        head_kg: Mass of pan unit and head.
        sprung_kg: Masses of all bodies above the suspension but the pole, up to the foot and beyond it.
    """

    deck_m: float
    neck_m: float
    lens_m: float
    kg_m: float
    head_kg: float
    sprung_kg: tuple[tuple[float, ...], tuple[float, ...]]

    def length_m(self, height_m: float, tilt_rad: float) -> float:
        """Length with the optical centre at a height above the ground at rest; negative if sunk into the deck."""
        return height_m - self.lens_m * math.sin(tilt_rad) - self.neck_m - self.deck_m

    def spring(self, length_m: float) -> tuple[float, float]:
        """Stiffness [N m/rad] and damping [N m s/rad] of the joints at its foot, in pitch and in roll."""
        pole, top = max(length_m, 0.0), max(length_m, 0.0) + self.neck_m
        inertia = self.kg_m * pole**3 / 3.0 + self.head_kg * top**2
        gravity_torque = GRAVITY_M_S2 * (0.5 * self.kg_m * pole**2 + self.head_kg * top)
        low_hz, high_hz = _MAST_HZ_RANGE
        omega = 2.0 * math.pi * min(max(_MAST_HZ_M / top, low_hz), high_hz)
        return inertia * omega**2 + gravity_torque, 2.0 * _MAST_DAMPING_RATIO * omega * inertia

    def carried_kg(self, pole_kg: float) -> float:
        """Mass of all that the suspension carries."""
        # One by one: `sum` rounds in another way since Python 3.12.
        return reduce(operator.add, (*self.sprung_kg[0], pole_kg, *self.sprung_kg[1]))


@lru_cache(maxsize=4)
def mast_of(roles: Roles) -> Mast:
    """The mast of a robot's file.

    Raises:
        ParameterError: The file cannot be used, or lacks what a robot with motors needs.
    """
    spec, path = read_spec(roles.model)
    lacks = [
        f"{kind} {name!r}" for kind, names in _NAMES.items() for name in names if getattr(spec, kind)(name) is None
    ]
    if lacks:
        raise ParameterError(
            f"{path}: drive = 'motors' takes the names of our own robot's file; it lacks {', '.join(lacks[:6])}; "
            "copy that (see your-robot.md), or take another drive"
        )
    pole = spec.geom("pole")
    kg_m = float(pole.mass / (2.0 * pole.size[1]))
    spec.delete(pole)
    model: Any = compile_spec(spec, path)
    free = model.jnt_type[model.body("base").jntadr[0]] == mujoco.mjtJoint.mjJNT_FREE
    shares = [float(model.joint(f"suspension-{end}").user.sum()) for end in SUSPENSIONS]
    if not free or not kg_m > 0.0 or abs(sum(shares) - 1.0) > 1e-9 or min(shares) <= 0.0:
        raise ParameterError(
            f"{path}: drive = 'motors' needs a free joint of 'base', a mass of 'pole', and suspensions whose `user` is "
            f"their share of the sprung weight, together 1; got {kg_m:g} kg/m and {shares}"
        )
    bodies = _sprung(model)
    foot = bodies.index(int(model.body("mast").id)) + 1
    sprung = [float(model.body_mass[body]) for body in bodies]
    return Mast(
        float(model.body("mast").pos[2]),
        float(model.body("head").pos[2]),
        float(model.camera("camera").pos[0]),
        kg_m,
        float(model.body("pan").subtreemass[0]),
        (tuple(sprung[:foot]), tuple(sprung[foot:])),
    )


def add_motorised(
    spec: SceneSpec, roles: Roles, height_m: float, tilt_deg: float, fovy_deg: float, friction: float
) -> None:
    """Attach the robot of a file with the optical centre at a height above the ground, on a floor of some friction."""
    mjcf, mast = read_spec(roles.model)[0], mast_of(roles)
    length_m = mast.length_m(height_m, math.radians(tilt_deg))
    mjcf.camera("camera").fovy = fovy_deg
    for side in _SIDES:
        mjcf.geom(f"tyre-{side}").friction[0] = friction
    stiffness, damping = mast.spring(length_m)
    for name in ("mast-pitch", "mast-roll"):
        joint = mjcf.joint(name)
        joint.stiffness[0], joint.damping[0] = stiffness, damping
    mjcf.body("pan").pos[2] = length_m
    pole, clamp, pole_kg = mjcf.geom("pole"), mjcf.frame("clamp"), mast.kg_m * max(length_m, 0.0)
    if length_m > _MIN_POLE_M:
        pole.size[1] = pole.pos[2] = 0.5 * length_m
        pole.mass = pole_kg
    else:
        mjcf.delete(pole)
    if clamp is not None and length_m > _MIN_CLAMPED_M:
        clamp.pos[2] = 0.5 * length_m
    elif clamp is not None:
        mjcf.delete(clamp)
    weight_n = GRAVITY_M_S2 * mast.carried_kg(pole_kg)
    for end in SUSPENSIONS:
        joint = mjcf.joint(f"suspension-{end}")
        # So that it stands level, at zero deflection.
        joint.springref = -float(joint.userdata[0]) * weight_n / joint.stiffness[0]
    spec.attach(mjcf, prefix="robot/", frame=spec.worldbody.add_frame())


def wheel_share(model: Any) -> float:
    """Share of the sprung weight on each wheel of a robot with motors."""
    return float(model.joint("robot/suspension-left").user[0])


def _sprung(model: Any) -> list[int]:
    """Bodies that the suspensions carry."""
    mounts = {int(model.jnt_bodyid[model.joint(f"suspension-{end}").id]) for end in SUSPENSIONS}
    below = set[int]()
    for body in range(1, model.nbody):
        if body in mounts or int(model.body_parentid[body]) in below:
            below.add(body)
    return [body for body in range(1, model.nbody) if body not in below]
