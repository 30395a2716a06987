"""Sizes, masses and springs of the robot.

The base has about the size and mass of a Pioneer 3-DX (Omron Adept: 455 x 381 x 237 mm, 195 mm wheels, 9 kg, up to
23 kg with batteries and payload), made round so that it turns on the spot without sweeping anything aside.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

GRAVITY_M_S2 = 9.81

WHEEL_RADIUS_M = 0.0975
WHEEL_HALF_WIDTH_M = 0.022
TRACK_M = 0.38
"""Distance between the tyres' contact points."""

CASTER_RADIUS_M = 0.035
CASTER_ARM_M = 0.185
"""Distance of the casters, front and rear, from the wheels' axle."""

BASE_RADIUS_M = 0.245
BASE_BOTTOM_M = 0.055
DECK_M = 0.235
"""Height of the top of the base."""

CHASSIS_KG = 9.0
BATTERY_KG = 8.0
WHEEL_KG = 0.9
CASTER_KG = 0.35
FOOT_KG = 0.1
MAST_KG_M = 0.55
PAN_KG = 0.45
HEAD_KG = 0.40

NECK_M = 0.055
"""From the top of the mast to the tilt axis."""
LENS_M = 0.06
"""From the tilt axis forward to the optical centre."""

CASTER_SHARE = 0.2
"""Share of the sprung weight on each caster; the rest is on the wheels, for traction."""

WHEEL_SPRING_N_M = 11000.0
WHEEL_DAMPING_NS_M = 160.0
CASTER_SPRING_N_M = 9000.0
CASTER_DAMPING_NS_M = 280.0
TRAVEL_M = 0.02
"""Suspension travel up and down from rest."""

MAST_HZ_M = 4.5
"""Frequency of the mast's swing on a base that stands still, times its length: longer masts swing slower."""
MAST_HZ_RANGE = (3.0, 15.0)
MAST_DAMPING_RATIO = 0.06

WHEEL_TORQUE_NM = 7.0
WHEEL_SERVO_NMS = 3.0
WHEEL_ARMATURE_KG_M2 = 0.01
"""Inertia of the motor's rotor behind its gear."""

HEAD_TORQUE_NM = 4.0
HEAD_ARMATURE_KG_M2 = 0.01
PAN_INERTIA_KG_M2 = 0.012
TILT_INERTIA_KG_M2 = 0.011
"""What the servos turn, rotors included: their gains follow from it."""

HEAD_SERVO_RAD_S = 60.0
"""Bandwidth of the head's position servos, critically damped."""

PAN_RANGE_RAD = math.radians(200.0)
TILT_RANGE_RAD = math.radians(75.0)


@dataclass(frozen=True)
class Mast:
    """What follows from the height and rest tilt of the camera.

    Attributes:
        length_m: From the deck to the pan unit.
        stiffness_nm_rad: Of its foot, in pitch and in roll.
        damping_nms_rad: Of its foot, in pitch and in roll.
    """

    length_m: float
    stiffness_nm_rad: float
    damping_nms_rad: float

    @classmethod
    def for_camera(cls, height_m: float, rest_tilt_rad: float) -> Mast:
        """A mast that brings the optical centre to `height_m` above the ground when the robot is at rest."""
        length = height_m - LENS_M * math.sin(rest_tilt_rad) - NECK_M - DECK_M
        # A camera lower than that has its neck sunk into the deck, and no mast to speak of.
        pole, top = max(length, 0.0), max(length, 0.0) + NECK_M
        inertia = MAST_KG_M * pole**3 / 3.0 + (PAN_KG + HEAD_KG) * top**2
        topple = GRAVITY_M_S2 * (0.5 * MAST_KG_M * pole**2 + (PAN_KG + HEAD_KG) * top)
        omega = 2.0 * math.pi * min(max(MAST_HZ_M / top, MAST_HZ_RANGE[0]), MAST_HZ_RANGE[1])
        return cls(length, inertia * omega**2 + topple, 2.0 * MAST_DAMPING_RATIO * omega * inertia)
