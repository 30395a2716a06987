"""The bodies of walking people in one kernel: all parts above their feet.

Legs follow by inverse, the rest by forward kinematics. Rotations of pelvis and trunk are those of Murray, Drought and
Kory, Journal of Bone and Joint Surgery 46-A:335 (1964), and Saunders, Inman and Eberhart, ibid. 35-A:543 (1953). Axes
of parts are x forward, y left, z up.
"""

from __future__ import annotations

import math
from typing import Any

from pftrack_sim.agents.gait.records import Records
from pftrack_sim.core.compiled import kernel, part_of_kernel

# Rows of `person.PARTS`; of arms and legs the left one, the right one follows.
_PELVIS, _TORSO, _HEAD, _UPPER_ARM, _FOREARM, _THIGH, _SHANK, _FOOT = 0, 1, 2, 3, 5, 7, 9, 11

_GRAVITY = 9.81
_TURN = 2.0 * math.pi
_HEIGHT_SOFTNESS_M = 0.003  # scale of the smooth minimum that limits the pelvis to the reach of the legs
_PELVIS_YAW, _PELVIS_ROLL = math.radians(4.5), math.radians(3.5)  # amplitudes at natural speed
_RESTING_ROLL, _RESTING_SHIFT_M = math.radians(3.0), 0.025  # at rest, towards the leg that carries the weight
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
_ELBOW, _ELBOW_SWING, _RUNNING_ELBOW = math.radians(18.0), math.radians(11.0), math.radians(62.0)


@kernel
def pose_bodies(time_s: float, people: Records, feet: Records, arms: Records, grips: Records, parts: Records) -> None:
    """Pose the bodies of `P` people above their feet.

    Args:
        time_s: Of breathing and glances.
        people: `(P,)` records of `PERSON`.
        feet: `(P, 2)` records of `FOOT`, the left one first.
        arms: `(P, 2)` records of `ARM`.
        grips: `(P, 2)` records of `GRIP`.
        parts: `(P, 13)` records of `PART`, set.
    """
    for index in range(len(people)):
        _pose_body(people[index], feet, arms, grips, parts, index, time_s)


@part_of_kernel
def _pose_body(
    person: Any, feet: Records, arms: Records, grips: Records, parts: Records, index: int, time_s: float
) -> None:
    """Set the parts of a person above placed feet."""
    pelvis, torso, head = parts[index, _PELVIS], parts[index, _TORSO], parts[index, _HEAD]
    crouch, bend, sit, heading = person.crouch, person.bend, person.sit, person.heading
    # The pelvis turns with the advancing leg and drops on the side of the leg in swing; the torso counter-rotates.
    stride = _TURN * person.phase
    twist = _PELVIS_YAW * person.amplitude * math.cos(stride)
    drop = _PELVIS_ROLL * person.amplitude * math.cos(stride - _TURN * 0.15)
    # At rest, the weight is on one leg, over which the hip is higher.
    leaning = math.sin(person.glance_phase) * max(1.0 - 2.0 * person.amplitude, 0.0) * (1.0 - sit) * (1.0 - crouch)
    leaning *= 1.0 - person.rides
    drop += _RESTING_ROLL * leaning
    bank = min(max(-0.6 / _GRAVITY * person.speed * person.turn, -0.2), 0.2)
    gaze = min(max(0.35 * person.turn, -0.5), 0.5)
    breath = _BREATH * math.sin(person.breath_phase + person.breath_rate * time_s)
    glance = _GLANCE * math.sin(person.glance_phase + person.glance_rate * time_s)
    lean = person.lean + _LEAN_PER_SPEED * person.speed + _CROUCH_LEAN * crouch
    sit_lean = _SIT_LEAN * 4.0 * sit * (1.0 - sit)
    pitch = 0.4 * lean + _BEND_PELVIS * bend + _SIT_PELVIS * sit + sit_lean
    _set_rotation(pelvis, heading - twist, drop + bank, pitch)
    yaw = heading + 0.8 * twist + 0.3 * gaze + _LOOK_TRUNK * person.look
    pitch = lean + breath + _BEND_TRUNK * bend + _SIT_TRUNK * sit + sit_lean
    _set_rotation(torso, yaw, bank - 0.35 * drop, pitch)
    pitch = 0.3 * lean + _HEAD_PITCH + _BEND_HEAD * bend
    _set_rotation(head, heading + gaze + glance + person.look, 0.5 * bank, pitch)

    # A crouching person's pelvis moves back as the chest leans forward: the weight stays above the feet.
    back = person.thigh_m * (_CROUCH_BACK * crouch + _BEND_BACK * bend + _SIT_BACK * sit)
    back -= person.ahead_m
    sway = person.sway_m * math.cos(_TURN * (person.phase - 0.30)) + _RESTING_SHIFT_M * leaning + person.aside_m
    cos, sin = math.cos(heading), math.sin(heading)
    pelvis.x, pelvis.y, pelvis.z = person.x - sway * sin - back * cos, person.y + sway * cos - back * sin, 0.0
    for side in range(2):
        _attach(pelvis, parts[index, _THIGH + side], 0.0, (1.0 - 2.0 * side) * person.hip_half_m, 0.0)
    leg_m = person.thigh_m + person.shank_m
    height_m = person.hip_m - (_CROUCH_DEPTH * crouch + _BEND_DEPTH * bend) * leg_m
    height_m += sit * (person.seated_m - height_m)
    for side in range(2):
        # Limited by the reach of both legs: a smooth minimum.
        foot, thigh = feet[index, side], parts[index, _THIGH + side]
        x, y, reach_m = foot.ankle_x - thigh.x, foot.ankle_y - thigh.y, person.reach * leg_m
        most_m = foot.ankle_z + math.sqrt(max(reach_m * reach_m - x * x - y * y, 0.04)) - thigh.z
        soft = math.log1p(math.exp(-abs(height_m - most_m) / _HEIGHT_SOFTNESS_M))
        height_m = min(height_m, most_m) - _HEIGHT_SOFTNESS_M * soft
    pelvis.z = height_m
    _attach(pelvis, torso, 0.0, 0.0, person.pelvis_m)
    _attach(torso, head, 0.0, 0.0, person.torso_m)

    for side in range(2):
        foot, sign = feet[index, side], 1.0 - 2.0 * side
        thigh, shank, sole = parts[index, _THIGH + side], parts[index, _SHANK + side], parts[index, _FOOT + side]
        thigh.z += height_m
        sole.x, sole.y, sole.z = foot.ankle_x, foot.ankle_y, foot.ankle_z
        _set_rotation(sole, foot.yaw, 0.0, -foot.pitch)
        yaw, legs = 0.5 * (foot.yaw + heading), (person.thigh_m, person.shank_m, person.reach)
        _bend_limb(thigh, shank, (sole.x, sole.y, sole.z), (math.cos(yaw), math.sin(yaw), 0.0), 1.0, legs)

        # Shoulder: 24 deg back near the same side's heel strike, 8 deg forward near the other's; elbow: largest
        # flexion as the arm swings forward (Murray, American Journal of Physical Medicine 46:290, 1967, at natural
        # speed).
        phase, swing, arm = person.phase + 0.5 * side, person.arm_swing * person.amplitude, arms[index, side]
        shoulder = _SHOULDER_BACK * min(swing, 1.0) - _SHOULDER_SWING * swing * math.cos(_TURN * (phase - 0.03))
        shoulder += _CROUCH_SHOULDER * crouch + _BEND_ARMS * bend
        elbow = _ELBOW + _ELBOW_SWING * swing * (1.0 - 0.85 * math.cos(_TURN * (phase - 0.06)))
        elbow += _CROUCH_ELBOW * crouch + _RUNNING_ELBOW * person.running
        # What is held before the chest hangs below it in a bend, and is held above the knees in a crouch.
        held = arm.shoulder + _CROUCH_SHOULDER * crouch + _BEND_ARMS * bend
        shoulder += arm.share * (held - shoulder)
        elbow += arm.share * (arm.elbow * (1.0 - _BEND_ELBOW * bend) - elbow)
        upper, fore = parts[index, _UPPER_ARM + side], parts[index, _FOREARM + side]
        _attach(torso, upper, person.shoulder_x, sign * person.shoulder_half_m, person.shoulder_z)
        _set_rotation(upper, 0.0, sign * (person.arm_roll + arm.share * arm.outward), -shoulder)
        _turn_along(torso, upper)
        _attach(upper, fore, 0.0, 0.0, -person.upper_arm_m)
        _set_rotation(fore, -0.25 * sign, sign * (arm.share * arm.forearm - 0.9 * person.arm_roll), -elbow)
        _turn_along(upper, fore)
        grip = grips[index, side]
        if grip.on > 0.0:
            # The elbow points down, back and outward.
            pole = _in_world(torso, -0.5, 0.35 * sign, -0.8)
            links = (person.upper_arm_m, person.grip_m, person.reach)
            _bend_limb(upper, fore, (grip.x, grip.y, grip.z), pole, -1.0, links)


@part_of_kernel
def _set_rotation(part: Any, yaw: float, roll: float, pitch: float) -> None:
    """Set a rotation: pitch about y, then roll about x, then yaw about z [rad].

    A positive pitch leans an upright body forward and swings a hanging limb back; a positive roll lifts the left side.
    """
    cos_y, sin_y, cos_r, sin_r = math.cos(yaw), math.sin(yaw), math.cos(roll), math.sin(roll)
    cos_p, sin_p = math.cos(pitch), math.sin(pitch)
    part.forward_x = cos_y * cos_p - sin_y * sin_r * sin_p
    part.forward_y = sin_y * cos_p + cos_y * sin_r * sin_p
    part.forward_z = -cos_r * sin_p
    part.left_x, part.left_y, part.left_z = -sin_y * cos_r, cos_y * cos_r, sin_r
    part.up_x = cos_y * sin_p + sin_y * sin_r * cos_p
    part.up_y = sin_y * sin_p - cos_y * sin_r * cos_p
    part.up_z = cos_r * cos_p


@part_of_kernel
def _turn_along(parent: Any, child: Any) -> None:
    """Turn a child, set in the frame of its parent, with the parent."""
    x, y, z = child.forward_x, child.forward_y, child.forward_z
    child.forward_x, child.forward_y, child.forward_z = _in_world(parent, x, y, z)
    x, y, z = child.left_x, child.left_y, child.left_z
    child.left_x, child.left_y, child.left_z = _in_world(parent, x, y, z)
    x, y, z = child.up_x, child.up_y, child.up_z
    child.up_x, child.up_y, child.up_z = _in_world(parent, x, y, z)


@part_of_kernel
def _attach(parent: Any, child: Any, x: float, y: float, z: float) -> None:
    """Set the position of a child from its place in the frame of its parent."""
    x, y, z = _in_world(parent, x, y, z)
    child.x, child.y, child.z = parent.x + x, parent.y + y, parent.z + z


@part_of_kernel
def _in_world(part: Any, x: float, y: float, z: float) -> tuple[float, float, float]:
    """A vector in the frame of a part, turned to the world's."""
    return (
        part.forward_x * x + part.left_x * y + part.up_x * z,
        part.forward_y * x + part.left_y * y + part.up_y * z,
        part.forward_z * x + part.left_z * y + part.up_z * z,
    )


@part_of_kernel
def _bend_limb(
    upper: Any,
    lower: Any,
    end: tuple[float, float, float],
    pole: tuple[float, float, float],
    sign: float,
    links: tuple[float, float, float],
) -> None:
    """Set the middle joint and the rotations of both links of a limb from its ends: z up along the bone.

    The joint bends towards the pole, as knees do, to which x points; with a sign of -1 x points away from it, as from
    an elbow. `links` are both lengths and the longest reach relative to their sum: a limb that does not reach points at
    the end, extended.
    """
    upper_m, lower_m, longest = links
    x, y, z = end[0] - upper.x, end[1] - upper.y, end[2] - upper.z
    distance, length = math.sqrt(x * x + y * y + z * z), upper_m + lower_m
    reach = min(max(distance, 0.35 * length), longest * length)
    x, y, z = x / max(distance, 1e-9), y / max(distance, 1e-9), z / max(distance, 1e-9)
    # Towards the pole, square to the line between the ends, and to the left of both.
    along = pole[0] * x + pole[1] * y + pole[2] * z
    ahead_x, ahead_y, ahead_z = pole[0] - along * x, pole[1] - along * y, pole[2] - along * z
    norm = math.sqrt(ahead_x * ahead_x + ahead_y * ahead_y + ahead_z * ahead_z)
    ahead_x, ahead_y, ahead_z = ahead_x / norm, ahead_y / norm, ahead_z / norm
    left_x, left_y, left_z = ahead_y * z - ahead_z * y, ahead_z * x - ahead_x * z, ahead_x * y - ahead_y * x
    left_x, left_y, left_z = sign * left_x, sign * left_y, sign * left_z
    # Law of cosines: angle between the upper link and the line to the end.
    cos = (upper_m * upper_m + reach * reach - lower_m * lower_m) / (2.0 * upper_m * reach)
    along, across = upper_m * cos, upper_m * math.sqrt(max(1.0 - cos * cos, 0.0))
    bone_x, bone_y, bone_z = along * x + across * ahead_x, along * y + across * ahead_y, along * z + across * ahead_z
    lower.x, lower.y, lower.z = upper.x + bone_x, upper.y + bone_y, upper.z + bone_z
    _set_bone(upper, left_x, left_y, left_z, bone_x, bone_y, bone_z)
    _set_bone(lower, left_x, left_y, left_z, reach * x - bone_x, reach * y - bone_y, reach * z - bone_z)


@part_of_kernel
def _set_bone(part: Any, left_x: float, left_y: float, left_z: float, x: float, y: float, z: float) -> None:
    """Set the rotation of a part whose y axis is to the left and which hangs along a vector."""
    length = -math.sqrt(x * x + y * y + z * z)
    x, y, z = x / length, y / length, z / length
    part.forward_x, part.forward_y = left_y * z - left_z * y, left_z * x - left_x * z
    part.forward_z = left_x * y - left_y * x
    part.left_x, part.left_y, part.left_z = left_x, left_y, left_z
    part.up_x, part.up_y, part.up_z = x, y, z
