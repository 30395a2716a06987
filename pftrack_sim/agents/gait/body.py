"""Postures and poses of body parts: the pelvis above the feet, legs by inverse, the rest by forward kinematics.

Rotations of pelvis and trunk are those of Murray, Drought and Kory, Journal of Bone and Joint Surgery 46-A:335 (1964),
and Saunders, Inman and Eberhart, ibid. 35-A:543 (1953). Axes of parts are x forward, y left, z up.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.agents.gait.trajectories import MAX_EXTENSION, RUN_STANCE_FRACTION
from pftrack_sim.core.compiled import kernel, part_of_kernel, record_type
from pftrack_sim.core.types import FloatArray


class Arm(NamedTuple):
    """Pose of an arm [rad], blended with its swing by `share` from 0 to 1.

    Attributes:
        shoulder: Flexion: 0 hangs along the trunk, positive forward.
        elbow: Flexion.
        outward: Abduction of the upper arm.
        forearm: Roll of the forearm outward.
    """

    share: float
    shoulder: float
    elbow: float
    outward: float = 0.0
    forearm: float = 0.0


@dataclass(frozen=True)
class Posture:
    """Posture of one person.

    Attributes:
        crouch: 0 upright, 1 a full squat.
        bend: 0 upright, 1 bent forward at the hips, hands towards the ground.
        sit: 0 upright, 1 seated on a bench.
        running: Whether the person runs instead of walking.
        look_rad: Turn of the head to the left; the trunk follows by a part of it.
        arms: Left and right arm; None swings.
    """

    crouch: float = 0.0
    bend: float = 0.0
    sit: float = 0.0
    running: bool = False
    look_rad: float = 0.0
    arms: tuple[Arm | None, Arm | None] = (None, None)


PLAIN = Posture()

BODY = record_type(
    [
        ("pelvis_m", "f8"),
        ("torso_m", "f8"),
        ("thigh_m", "f8"),
        ("shank_m", "f8"),
        ("upper_arm_m", "f8"),
        ("hip_half_m", "f8"),
        ("shoulder_x", "f8"),  # of the shoulder joints in the torso's frame [m]; y is +- `shoulder_half_m`
        ("shoulder_half_m", "f8"),
        ("shoulder_z", "f8"),
        ("seated_m", "f8"),  # height of the hip joints on a seat
        ("arm_roll", "f8"),  # of the upper arms outward [rad]
        ("arm_swing", "f8"),  # amplitude relative to other people's
        ("lean", "f8"),  # forward [rad]
        ("breath_rate", "f8"),  # [rad/s]
        ("breath_phase", "f8"),
        ("glance_rate", "f8"),
        ("glance_phase", "f8"),
    ]
)
"""One person's body and habits."""

POSTURE = record_type([("crouch", "f8"), ("bend", "f8"), ("look", "f8"), ("sit", "f8")])
"""Numbers of a `Posture`."""

ARM = record_type([("share", "f8"), ("shoulder", "f8"), ("elbow", "f8"), ("outward", "f8"), ("forearm", "f8")])
"""An `Arm`; the share of an arm that swings is 0."""

_GRAVITY = 9.81
_TURN = 2.0 * math.pi
_HEIGHT_SOFTNESS_M = 0.003  # scale of the smooth minimum that limits the pelvis to the reach of the legs
_PELVIS_YAW, _PELVIS_ROLL = math.radians(4.5), math.radians(3.5)  # amplitudes at natural speed
_LEAN_PER_SPEED = math.radians(1.8)
_HEAD_PITCH = math.radians(2.0)
_BREATH, _GLANCE = math.radians(0.6), math.radians(4.0)  # idle chest pitch (breathing) and head yaw (looking around)
_CROUCH_DEPTH = 0.46  # lowering of the pelvis in a full crouch, in leg lengths
_CROUCH_BACK = 0.38  # backward shift of the pelvis in a full crouch, in thigh lengths
_CROUCH_LEAN, _CROUCH_SHOULDER, _CROUCH_ELBOW = 0.55, 0.7, 0.35
_BEND_BACK, _BEND_DEPTH = 0.40, 0.06  # the same of a full bend
_BEND_PELVIS, _BEND_TRUNK, _BEND_HEAD = math.radians(48.0), math.radians(82.0), math.radians(62.0)
_BEND_ARMS = math.radians(88.0)  # forward
_BEND_ELBOW = 0.7  # share by which a full bend extends the elbow of an arm that holds something
_SIT_BACK = 0.95  # backward shift of the pelvis on a seat, in thigh lengths
_SIT_PELVIS, _SIT_TRUNK = math.radians(-12.0), math.radians(3.0)  # on a seat
_SIT_LEAN = math.radians(38.0)  # forward lean half way down or up, which keeps the weight above the feet
_LOOK_TRUNK = 0.35  # share of the head's turn by which the trunk follows
_SHOULDER_BACK, _SHOULDER_SWING = math.radians(-6.0), math.radians(16.0)
_ELBOW, _ELBOW_SWING, _RUNNING_ELBOW = math.radians(13.0), math.radians(11.0), math.radians(62.0)

# Rows of `person.PARTS`; of arms and legs the left one, the right one follows.
_PELVIS, _TORSO, _HEAD, _UPPER_ARM, _FOREARM, _THIGH, _SHANK, _FOOT, PARTS = 0, 1, 2, 3, 5, 7, 9, 11, 13


@kernel
def pose_bodies(
    time_s: float,
    bodies: NDArray[Any],
    postures: NDArray[Any],
    arms: NDArray[Any],
    walks: NDArray[Any],
    parameters: NDArray[Any],
    feet: NDArray[Any],
    positions: FloatArray,
    rotations: FloatArray,
) -> None:
    """Set positions `(13 P, 3)` [m] and rotations `(13 P, 3, 3)` of the parts of `P` people, one after the other.

    Args:
        time_s: Of breathing and glances.
        bodies: `(P,)` records of `BODY`.
        postures: `(P,)` records of `POSTURE`.
        arms: `(P, 2)` records of `ARM`.
        walks: `(P,)` records of `WALK`.
        parameters: `(P,)` records of `PARAMETERS`.
        feet: `(P, 2)` records of `FOOT`.
        positions: Set.
        rotations: Set.
    """
    bent = np.empty((1, 3, 3))
    for person in range(len(bodies)):
        body, posture, walk, gait, row = (
            bodies[person],
            postures[person],
            walks[person],
            parameters[person],
            13 * person,
        )
        crouch, bend, sit, heading = posture.crouch, posture.bend, posture.sit, walk.heading
        # The pelvis turns with the advancing leg and drops on the side of the leg in swing; the torso counter-rotates.
        stride = _TURN * walk.phase
        twist = _PELVIS_YAW * gait.amplitude * math.cos(stride)
        drop = _PELVIS_ROLL * gait.amplitude * math.cos(stride - _TURN * 0.15)
        bank = min(max(-0.6 / _GRAVITY * walk.speed * walk.turn, -0.2), 0.2)
        gaze = min(max(0.35 * walk.turn, -0.5), 0.5)
        breath = _BREATH * math.sin(body.breath_phase + body.breath_rate * time_s)
        glance = _GLANCE * math.sin(body.glance_phase + body.glance_rate * time_s)
        lean = body.lean + _LEAN_PER_SPEED * walk.speed + _CROUCH_LEAN * crouch
        sit_lean = _SIT_LEAN * 4.0 * sit * (1.0 - sit)
        pitch = 0.4 * lean + _BEND_PELVIS * bend + _SIT_PELVIS * sit + sit_lean
        _set_rotation(rotations, row + _PELVIS, heading - twist, drop + bank, pitch)
        yaw = heading + 0.8 * twist + 0.3 * gaze + _LOOK_TRUNK * posture.look
        pitch = lean + breath + _BEND_TRUNK * bend + _SIT_TRUNK * sit + sit_lean
        _set_rotation(rotations, row + _TORSO, yaw, bank - 0.35 * drop, pitch)
        pitch = 0.3 * lean + _HEAD_PITCH + _BEND_HEAD * bend
        _set_rotation(rotations, row + _HEAD, heading + gaze + glance + posture.look, 0.5 * bank, pitch)

        # A crouching person's pelvis moves back as the chest leans forward: the weight stays above the feet.
        back = body.thigh_m * (_CROUCH_BACK * crouch + _BEND_BACK * bend + _SIT_BACK * sit)
        sway = gait.sway_m * math.cos(_TURN * (walk.phase - 0.30))
        cos, sin = math.cos(heading), math.sin(heading)
        positions[row, 0] = walk.x - sway * sin - back * cos
        positions[row, 1] = walk.y + sway * cos - back * sin
        positions[row, 2] = 0.0
        for side in range(2):
            _attach(positions, rotations, row, row + _THIGH + side, 0.0, (1.0 - 2.0 * side) * body.hip_half_m, 0.0)
        leg_m = body.thigh_m + body.shank_m
        height_m = _upright_height(gait, walk) - (_CROUCH_DEPTH * crouch + _BEND_DEPTH * bend) * leg_m
        height_m += sit * (body.seated_m - height_m)
        for side in range(2):
            # Limited by the reach of both legs.
            foot, hip = feet[person, side], positions[row + _THIGH + side]
            x, y, reach_m = foot.ankle_x - hip[0], foot.ankle_y - hip[1], MAX_EXTENSION * leg_m
            above = math.sqrt(max(reach_m * reach_m - x * x - y * y, 0.04))
            height_m = _softer_minimum(height_m, foot.ankle_z + above - hip[2])
        positions[row, 2] = height_m
        _attach(positions, rotations, row, row + _TORSO, 0.0, 0.0, body.pelvis_m)
        _attach(positions, rotations, row + _TORSO, row + _HEAD, 0.0, 0.0, body.torso_m)

        for side in range(2):
            foot, sign = feet[person, side], 1.0 - 2.0 * side
            positions[row + _THIGH + side, 2] += height_m
            place = positions[row + _FOOT + side]
            place[0], place[1], place[2] = foot.ankle_x, foot.ankle_y, foot.ankle_z
            _set_rotation(rotations, row + _FOOT + side, foot.yaw, 0.0, -foot.pitch)
            _bend_leg(positions, rotations, row + side, 0.5 * (foot.yaw + heading), body.thigh_m, body.shank_m)

            # Shoulder: 24 deg back near the same side's heel strike, 8 deg forward near the other's; elbow: largest
            # flexion as the arm swings forward (Murray, American Journal of Physical Medicine 46:290, 1967, at natural
            # speed).
            phase, swing, arm = walk.phase + 0.5 * side, body.arm_swing * gait.amplitude, arms[person, side]
            shoulder = _SHOULDER_BACK * min(swing, 1.0) - _SHOULDER_SWING * swing * math.cos(_TURN * (phase - 0.03))
            shoulder += _CROUCH_SHOULDER * crouch + _BEND_ARMS * bend
            elbow = _ELBOW + _ELBOW_SWING * swing * (1.0 - 0.85 * math.cos(_TURN * (phase - 0.06)))
            elbow += _CROUCH_ELBOW * crouch + _RUNNING_ELBOW * walk.running
            # What is held before the chest hangs below it in a bend, and is held above the knees in a crouch.
            held = arm.shoulder + _CROUCH_SHOULDER * crouch + _BEND_ARMS * bend
            shoulder += arm.share * (held - shoulder)
            elbow += arm.share * (arm.elbow * (1.0 - _BEND_ELBOW * bend) - elbow)
            upper, fore = row + _UPPER_ARM + side, row + _FOREARM + side
            _attach(
                positions, rotations, row + _TORSO, upper, body.shoulder_x, sign * body.shoulder_half_m, body.shoulder_z
            )
            _set_rotation(bent, 0, 0.0, sign * (body.arm_roll + arm.share * arm.outward), -shoulder)
            _multiply(rotations, row + _TORSO, bent, upper)
            _attach(positions, rotations, upper, fore, 0.0, 0.0, -body.upper_arm_m)
            _set_rotation(bent, 0, -0.25 * sign, sign * (arm.share * arm.forearm - 0.5 * body.arm_roll), -elbow)
            _multiply(rotations, upper, bent, fore)


@part_of_kernel
def _set_rotation(rotations: FloatArray, row: int, yaw: float, roll: float, pitch: float) -> None:
    """Set a rotation: pitch about y, then roll about x, then yaw about z [rad].

    A positive pitch leans an upright body forward and swings a hanging limb back; a positive roll lifts the left side.
    """
    cos_y, sin_y, cos_r, sin_r = math.cos(yaw), math.sin(yaw), math.cos(roll), math.sin(roll)
    cos_p, sin_p = math.cos(pitch), math.sin(pitch)
    out = rotations[row]
    out[0, 0] = cos_y * cos_p - sin_y * sin_r * sin_p
    out[0, 1] = -sin_y * cos_r
    out[0, 2] = cos_y * sin_p + sin_y * sin_r * cos_p
    out[1, 0] = sin_y * cos_p + cos_y * sin_r * sin_p
    out[1, 1] = cos_y * cos_r
    out[1, 2] = sin_y * sin_p - cos_y * sin_r * cos_p
    out[2, 0] = -cos_r * sin_p
    out[2, 1] = sin_r
    out[2, 2] = cos_r * cos_p


@part_of_kernel
def _multiply(rotations: FloatArray, parent: int, bent: FloatArray, child: int) -> None:
    """Set the rotation of a child that is `bent[0]` in the frame of its parent."""
    for row in range(3):
        for column in range(3):
            total = 0.0
            for k in range(3):
                total += rotations[parent, row, k] * bent[0, k, column]
            rotations[child, row, column] = total


@part_of_kernel
def _attach(
    positions: FloatArray, rotations: FloatArray, parent: int, child: int, x: float, y: float, z: float
) -> None:
    """Set the position of a child from its place in the frame of its parent."""
    axes = rotations[parent]
    for row in range(3):
        positions[child, row] = positions[parent, row] + axes[row, 0] * x + axes[row, 1] * y + axes[row, 2] * z


@part_of_kernel
def _upright_height(gait: Any, walk: Any) -> float:
    """Height of an upright person's pelvis [m] by the published vertical travel."""
    travel = 0.5 - 0.5 * math.cos(2.0 * _TURN * (walk.phase - 0.04))
    # Runners are lowest in mid-stance and highest in the middle of the flight phase.
    running_travel = 0.5 - 0.5 * math.cos(2.0 * _TURN * (walk.phase - 0.5 * RUN_STANCE_FRACTION))
    travel += walk.running * (running_travel - travel)
    return gait.hip_low_m + (gait.hip_high_m - gait.hip_low_m) * travel


@part_of_kernel
def _softer_minimum(a: float, b: float) -> float:
    """Smooth minimum of two heights [m]."""
    low, apart = min(a, b), abs(a - b)
    return low - _HEIGHT_SOFTNESS_M * math.log1p(math.exp(-apart / _HEIGHT_SOFTNESS_M))


@part_of_kernel
def _bend_leg(
    positions: FloatArray, rotations: FloatArray, row: int, knee_yaw: float, thigh_m: float, shank_m: float
) -> None:
    """Set the knee and the rotations of thigh and shank from hip and ankle: z up along the bone, x to the bent knee.

    The knee bends towards `knee_yaw`; a leg that does not reach points at the ankle, extended. `row` is that of the
    pelvis, plus 1 for the right leg.
    """
    hip, knee, ankle = positions[row + _THIGH], positions[row + _SHANK], positions[row + _FOOT]
    x, y, z = ankle[0] - hip[0], ankle[1] - hip[1], ankle[2] - hip[2]
    distance, length = math.sqrt(x * x + y * y + z * z), thigh_m + shank_m
    reach = min(max(distance, 0.35 * length), MAX_EXTENSION * length)
    x, y, z = x / max(distance, 1e-9), y / max(distance, 1e-9), z / max(distance, 1e-9)
    # Ahead of the line from hip to ankle, and to its left.
    along = math.cos(knee_yaw) * x + math.sin(knee_yaw) * y
    ahead_x, ahead_y, ahead_z = math.cos(knee_yaw) - along * x, math.sin(knee_yaw) - along * y, -along * z
    norm = math.sqrt(ahead_x * ahead_x + ahead_y * ahead_y + ahead_z * ahead_z)
    ahead_x, ahead_y, ahead_z = ahead_x / norm, ahead_y / norm, ahead_z / norm
    left_x, left_y, left_z = ahead_y * z - ahead_z * y, ahead_z * x - ahead_x * z, ahead_x * y - ahead_y * x
    # Law of cosines: angle at the hip between the thigh and the line to the ankle.
    cos = (thigh_m * thigh_m + reach * reach - shank_m * shank_m) / (2.0 * thigh_m * reach)
    along, across = thigh_m * cos, thigh_m * math.sqrt(max(1.0 - cos * cos, 0.0))
    thigh_x, thigh_y, thigh_z = along * x + across * ahead_x, along * y + across * ahead_y, along * z + across * ahead_z
    knee[0], knee[1], knee[2] = hip[0] + thigh_x, hip[1] + thigh_y, hip[2] + thigh_z
    _set_bone(rotations, row + _THIGH, left_x, left_y, left_z, thigh_x, thigh_y, thigh_z)
    _set_bone(
        rotations, row + _SHANK, left_x, left_y, left_z, reach * x - thigh_x, reach * y - thigh_y, reach * z - thigh_z
    )


@part_of_kernel
def _set_bone(
    rotations: FloatArray, row: int, left_x: float, left_y: float, left_z: float, x: float, y: float, z: float
) -> None:
    """Set the rotation of a part whose y axis is to the left and which hangs along a vector."""
    axes, length = rotations[row], -math.sqrt(x * x + y * y + z * z)
    x, y, z = x / length, y / length, z / length
    axes[0, 0], axes[1, 0], axes[2, 0] = left_y * z - left_z * y, left_z * x - left_x * z, left_x * y - left_y * x
    axes[0, 1], axes[1, 1], axes[2, 1] = left_x, left_y, left_z
    axes[0, 2], axes[1, 2], axes[2, 2] = x, y, z


def quaternions(rotations: FloatArray) -> FloatArray:
    """`(N, 4)` unit quaternions w, x, y, z of `(N, 3, 3)` rotation matrices.

    Of the four candidates, one per component as divisor, the one with the largest divisor is taken (Shepperd 1978).
    """
    r = rotations.reshape(-1, 9).T
    candidates = np.empty((4, 4, len(rotations)))
    candidates[0, 0], candidates[1, 1] = 1.0 + r[0] + r[4] + r[8], 1.0 + r[0] - r[4] - r[8]
    candidates[2, 2], candidates[3, 3] = 1.0 - r[0] + r[4] - r[8], 1.0 - r[0] - r[4] + r[8]
    candidates[0, 1] = candidates[1, 0] = r[7] - r[5]
    candidates[0, 2] = candidates[2, 0] = r[2] - r[6]
    candidates[0, 3] = candidates[3, 0] = r[3] - r[1]
    candidates[1, 2] = candidates[2, 1] = r[1] + r[3]
    candidates[1, 3] = candidates[3, 1] = r[2] + r[6]
    candidates[2, 3] = candidates[3, 2] = r[5] + r[7]
    best = np.diagonal(candidates).argmax(axis=1)
    chosen = candidates[best, :, np.arange(len(best))]
    return chosen / np.sqrt(np.einsum("ij,ij->i", chosen, chosen))[:, None]
