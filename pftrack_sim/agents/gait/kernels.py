"""Kernels of the gait: angles of the body's parts, and their positions and rotations in the world.

They take the same steps in the same order as the formulas would on arrays of all people, so their results do not depend
on how they are computed. Exponentials and powers are left to NumPy, whose last bits are its own.
Kernels that call each other are in this module (but `fused_dot`): a cache does not see changes in another module.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from pftrack_sim.agents.gait.gait_parameters import MAX_EXTENSION, RUN_STANCE_FRACTION
from pftrack_sim.core.fused import fused_dot
from pftrack_sim.core.types import FloatArray

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

# Indices into `person.PARTS`: pelvis, torso, head, then left and right of upper arms, forearms, thighs, shanks, feet.
_UPPER_ARMS, _FOREARMS, _THIGHS, _SHANKS, _FEET, _PARTS = 3, 5, 7, 9, 11, 13


@njit(cache=True, nogil=True)
def pose_bodies(
    arm_rolls: FloatArray,
    arm_swing: FloatArray,
    held: FloatArray,
    idle_phase: FloatArray,
    idle_rate: FloatArray,
    time_s: float,
    lean_rad: FloatArray,
    headings: FloatArray,
    posture: FloatArray,
    amplitudes: FloatArray,
    phase: FloatArray,
    running: FloatArray,
    speed: FloatArray,
    turn: FloatArray,
    feet_yaw: FloatArray,
    feet_pitch: FloatArray,
    offsets: FloatArray,
    spine_m: FloatArray,
    legs_m: FloatArray,
    places: FloatArray,
    seated_m: FloatArray,
    hip_low_m: FloatArray,
    hip_high_m: FloatArray,
    sway_m: FloatArray,
    ankles: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """All parts: `assemble` of `body_rotations`, whose arguments these are; and `root_poses`."""
    parts = body_rotations(
        arm_rolls, arm_swing, held, idle_phase, idle_rate, time_s, lean_rad, headings, posture, amplitudes, phase,
        running, speed, turn, feet_yaw, feet_pitch,
    )  # fmt: skip
    arms = np.empty((2, len(headings), 2, 3, 3))
    for person, side in np.ndindex(len(headings), 2):
        _multiply(parts[person, 1], parts[person, 5 + side], arms[0, person, side])
        _multiply(arms[0, person, side], parts[person, 7 + side], arms[1, person, side])
    positions, rotations, quaternions = assemble(
        parts, arms[0], arms[1], offsets, spine_m, legs_m, places, headings, posture, seated_m, hip_low_m, hip_high_m,
        sway_m, phase, running, ankles, feet_yaw,
    )  # fmt: skip
    return positions, rotations, quaternions, root_poses(headings, positions)


@njit(cache=True, nogil=True)
def _multiply(left: FloatArray, right: FloatArray, out: FloatArray) -> None:
    """Product of two rotations, with the bits of a product of matrices."""
    for row in range(3):
        for column in range(3):
            out[row, column] = fused_dot(left[row], right[0, column], right[1, column], right[2, column])


@njit(cache=True, nogil=True)
def body_rotations(
    arm_rolls: FloatArray,
    arm_swing: FloatArray,
    held: FloatArray,
    idle_phase: FloatArray,
    idle_rate: FloatArray,
    time_s: float,
    lean_rad: FloatArray,
    headings: FloatArray,
    posture: FloatArray,
    amplitudes: FloatArray,
    phase: FloatArray,
    running: FloatArray,
    speed: FloatArray,
    turn: FloatArray,
    feet_yaw: FloatArray,
    feet_pitch: FloatArray,
) -> FloatArray:
    """`(P, 9, 3, 3)` rotations: pelvis, torso, head and feet in the world, upper arms and forearms in their parents.

    `posture` `(4, P)` holds crouch, bend, look and sit; `arm_swing` `(P,)` the amplitude relative to other people's;
    `held` `(A, 7)` person, side, and the five numbers of an `Arm`.
    """
    angles = np.zeros((3, len(headings), 9))
    yaw, roll, pitch = angles
    for person in range(len(headings)):
        heading, amplitude = headings[person], amplitudes[person]
        # Shoulder: 24 deg back near the same side's heel strike, 8 deg forward near the other's; elbow: largest flexion
        # as the arm swings forward (Murray, American Journal of Physical Medicine 46:290, 1967, at natural speed).
        swing = arm_swing[person] * amplitude
        crouch, bend, look, sit = posture[:, person]
        sit_lean = _SIT_LEAN * 4.0 * sit * (1.0 - sit)
        # The pelvis turns with the advancing leg and drops on the side of the leg in swing; the torso counter-rotates.
        stride = _TURN * phase[person]
        twist = _PELVIS_YAW * amplitude * math.cos(stride)
        drop = _PELVIS_ROLL * amplitude * math.cos(stride - _TURN * 0.15)
        bank = min(max(-0.6 / _GRAVITY * speed[person] * turn[person], -0.2), 0.2)
        gaze = min(max(0.35 * turn[person], -0.5), 0.5)
        breath = _BREATH * math.sin(idle_phase[0, person] + idle_rate[0, person] * time_s)
        glance = _GLANCE * math.sin(idle_phase[1, person] + idle_rate[1, person] * time_s)
        lean = lean_rad[person] + _LEAN_PER_SPEED * speed[person] + _CROUCH_LEAN * crouch
        yaw[person, 0] = heading - twist
        yaw[person, 1] = heading + 0.8 * twist + 0.3 * gaze + _LOOK_TRUNK * look
        yaw[person, 2] = heading + gaze + glance + look
        roll[person, 0] = drop + bank
        roll[person, 1] = bank - 0.35 * drop
        roll[person, 2] = 0.5 * bank
        pitch[person, 0] = 0.4 * lean + _BEND_PELVIS * bend + (_SIT_PELVIS * sit + sit_lean)
        pitch[person, 1] = lean + breath + _BEND_TRUNK * bend + (_SIT_TRUNK * sit + sit_lean)
        pitch[person, 2] = 0.3 * lean + _HEAD_PITCH + _BEND_HEAD * bend
        for side in range(2):
            foot_phase = (phase[person] + 0.5 * side) % 1.0
            shoulder = _SHOULDER_BACK * min(swing, 1.0) - _SHOULDER_SWING * swing * math.cos(
                _TURN * (foot_phase - 0.03)
            )
            elbow = _ELBOW + _ELBOW_SWING * swing * (1.0 - 0.85 * math.cos(_TURN * (foot_phase - 0.06)))
            yaw[person, 3 + side] = feet_yaw[person, side]
            yaw[person, 7 + side] = -0.25 * (1.0 - 2.0 * side)
            pitch[person, 3 + side] = -feet_pitch[person, side]
            pitch[person, 5 + side] = -(shoulder + _CROUCH_SHOULDER * crouch) - _BEND_ARMS * bend
            pitch[person, 7 + side] = -(elbow + _CROUCH_ELBOW * crouch + _RUNNING_ELBOW * running[person])
        roll[person, 5:9] = arm_rolls[person]
    for index in range(len(held)):
        person, side = int(held[index, 0]), int(held[index, 1])
        share, shoulder, elbow, outward, forearm = held[index, 2:]
        crouch, bend, upper, fore = posture[0, person], posture[1, person], 5 + side, 7 + side
        # What is held before the chest hangs below it in a bend, and is held above the knees in a crouch.
        shoulder = shoulder + _CROUCH_SHOULDER * crouch + _BEND_ARMS * bend
        elbow = elbow * (1.0 - _BEND_ELBOW * bend)
        pitch[person, upper] += share * (-shoulder - pitch[person, upper])
        pitch[person, fore] += share * (-elbow - pitch[person, fore])
        roll[person, upper] += share * (1.0 - 2.0 * side) * outward
        roll[person, fore] += share * (1.0 - 2.0 * side) * forearm
    rotations = np.empty((len(headings), 9, 3, 3))
    set_rotations(yaw.ravel(), roll.ravel(), pitch.ravel(), rotations.reshape(-1, 3, 3))
    return rotations


@njit(cache=True, nogil=True)
def set_rotations(yaw: FloatArray, roll: FloatArray, pitch: FloatArray, out: FloatArray) -> None:
    """Set `(N, 3, 3)` rotations from `(N,)` angles, see `kinematics.rotation_matrices`."""
    for index in range(len(yaw)):
        cos_y, sin_y = math.cos(yaw[index]), math.sin(yaw[index])
        cos_r, sin_r = math.cos(roll[index]), math.sin(roll[index])
        cos_p, sin_p = math.cos(pitch[index]), math.sin(pitch[index])
        sin_r_sin_p, sin_r_cos_p = sin_r * sin_p, sin_r * cos_p
        matrix = out[index]
        matrix[0, 0] = cos_y * cos_p - sin_y * sin_r_sin_p
        matrix[0, 1] = -sin_y * cos_r
        matrix[0, 2] = cos_y * sin_p + sin_y * sin_r_cos_p
        matrix[1, 0] = sin_y * cos_p + cos_y * sin_r_sin_p
        matrix[1, 1] = cos_y * cos_r
        matrix[1, 2] = sin_y * sin_p - cos_y * sin_r_cos_p
        matrix[2, 0] = -cos_r * sin_p
        matrix[2, 1] = sin_r
        matrix[2, 2] = cos_r * cos_p


@njit(cache=True, nogil=True)
def set_quaternions(rotations: FloatArray, out: FloatArray) -> None:
    """Set `(N, 4)` quaternions of `(N, 3, 3)` rotations, see `kinematics.quaternions`."""
    for index in range(len(rotations)):
        r, q = rotations[index], out[index]
        xx, yy, zz = r[0, 0], r[1, 1], r[2, 2]
        wx, wy, wz = r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]
        x_y, x_z, y_z = r[0, 1] + r[1, 0], r[0, 2] + r[2, 0], r[1, 2] + r[2, 1]
        w, x, y, z = 1.0 + xx + yy + zz, 1.0 + xx - yy - zz, 1.0 - xx + yy - zz, 1.0 - xx - yy + zz
        if w >= x and w >= y and w >= z:
            q[0], q[1], q[2], q[3] = w, wx, wy, wz
        elif x >= y and x >= z:
            q[0], q[1], q[2], q[3] = wx, x, x_y, x_z
        elif y >= z:
            q[0], q[1], q[2], q[3] = wy, x_y, y, y_z
        else:
            q[0], q[1], q[2], q[3] = wz, x_z, y_z, z
        length = math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
        for component in range(4):
            q[component] /= length


@njit(cache=True, nogil=True)
def assemble(
    part_rotations: FloatArray,
    upper_arms: FloatArray,
    forearms: FloatArray,
    offsets: FloatArray,
    spine_m: FloatArray,
    legs_m: FloatArray,
    places: FloatArray,
    headings: FloatArray,
    posture: FloatArray,
    seated_m: FloatArray,
    hip_low_m: FloatArray,
    hip_high_m: FloatArray,
    sway_m: FloatArray,
    phase: FloatArray,
    running: FloatArray,
    ankles: FloatArray,
    feet_yaw: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """All parts: positions `(P, 13, 3)` [m], rotations `(P, 13, 3, 3)`, quaternions `(P, 13, 4)` w, x, y, z.

    Args:
        part_rotations: `(P, 9, 3, 3)` in the world of pelvis, torso, head and feet; the others are not used.
        upper_arms: `(P, 2, 3, 3)` in the world.
        forearms: `(P, 2, 3, 3)` in the world.
        offsets: `(3, P, 2, 3)` of hips, shoulders and elbows in the frames of their parents [m].
        spine_m: `(2, P)` lengths of pelvis and torso.
        legs_m: `(2, P)` lengths of thighs and shanks.
        places: `(P, 2)` of the people on the ground [m].
        headings: `(P,)`.
        posture: `(4, P)` crouch, bend, look and sit.
        seated_m: `(P,)` height of the hip joints on a seat.
        hip_low_m: `(P,)` least height of the pelvis.
        hip_high_m: `(P,)` greatest height.
        sway_m: `(P,)` of the pelvis.
        phase: `(P,)`.
        running: `(P,)` share.
        ankles: `(P, 2, 3)` [m].
        feet_yaw: `(P, 2)`.
    """
    positions = np.empty((len(headings), _PARTS, 3))
    rotations = np.empty((len(headings), _PARTS, 3, 3))
    turned, knee_direction = np.empty((2, 3)), np.zeros(3)
    for person in range(len(headings)):
        here, axes = positions[person], rotations[person]
        axes[:3], axes[_FEET:] = part_rotations[person, :3], part_rotations[person, 3:5]
        axes[_UPPER_ARMS:_FOREARMS], axes[_FOREARMS:_THIGHS] = upper_arms[person], forearms[person]
        thigh_m, shank_m, heading = legs_m[0, person], legs_m[1, person], headings[person]
        crouch, bend, sit = posture[0, person], posture[1, person], posture[3, person]
        for side in range(2):
            _rotate(axes[0], offsets[0, person, side], turned[side])
        sway = sway_m[person] * math.cos(_TURN * (phase[person] - 0.30))
        # A crouching person's pelvis moves back as the chest leans forward: the weight stays above the feet.
        back = _CROUCH_BACK * thigh_m * crouch + _BEND_BACK * thigh_m * bend + _SIT_BACK * thigh_m * sit
        cos, sin = math.cos(heading), math.sin(heading)
        here[0, 0] = places[person, 0] - sway * sin - back * cos
        here[0, 1] = places[person, 1] + sway * cos - back * sin
        wanted = _wanted_height(hip_low_m[person], hip_high_m[person], phase[person], running[person])
        leg_m = thigh_m + shank_m
        wanted = wanted - _CROUCH_DEPTH * leg_m * crouch - _BEND_DEPTH * leg_m * bend
        wanted = wanted + sit * (seated_m[person] - wanted)
        here[0, 2] = _pelvis_height(wanted, MAX_EXTENSION * leg_m, here[0], turned, ankles[person])
        for part in range(2):
            axis = axes[part]
            for row in range(3):
                # The offset is along z alone; the products with 0 keep the sign of a zero.
                lift = axis[row, 0] * 0.0 + axis[row, 1] * 0.0 + axis[row, 2] * spine_m[part, person]
                here[part + 1, row] = here[part, row] + lift
        for side in range(2):
            thigh, shank, foot = here[_THIGHS + side], here[_SHANKS + side], here[_FEET + side]
            for row in range(3):
                thigh[row], foot[row] = here[0, row] + turned[side, row], ankles[person, side, row]
            knee_yaw = 0.5 * (feet_yaw[person, side] + heading)
            knee_direction[0], knee_direction[1] = math.cos(knee_yaw), math.sin(knee_yaw)
            _bend_leg(thigh, foot, knee_direction, thigh_m, shank_m, shank, axes[_THIGHS + side], axes[_SHANKS + side])
            upper, fore = here[_UPPER_ARMS + side], here[_FOREARMS + side]
            _rotate(axes[1], offsets[1, person, side], upper)
            for row in range(3):
                upper[row] = here[1, row] + upper[row]
            _rotate(axes[_UPPER_ARMS + side], offsets[2, person, side], fore)
            for row in range(3):
                fore[row] = upper[row] + fore[row]
    quaternions = np.empty((len(headings), _PARTS, 4))
    set_quaternions(rotations.reshape(-1, 3, 3), quaternions.reshape(-1, 4))
    return positions, rotations, quaternions


@njit(cache=True, nogil=True)
def root_poses(headings: FloatArray, positions: FloatArray) -> FloatArray:
    """`(P, 4, 4)` poses on the ground below the first of `(P, 13, 3)` positions: x forward, z up."""
    poses = np.zeros((len(headings), 4, 4))
    for person in range(len(headings)):
        pose, cos, sin = poses[person], math.cos(headings[person]), math.sin(headings[person])
        pose[0, 0] = pose[1, 1] = cos
        pose[0, 1], pose[1, 0] = -sin, sin
        pose[2, 2] = pose[3, 3] = 1.0
        pose[:2, 3] = positions[person, 0, :2]
    return poses


@njit(cache=True, nogil=True)
def _rotate(rotation: FloatArray, vector: FloatArray, out: FloatArray) -> None:
    for row in range(3):
        out[row] = rotation[row, 0] * vector[0] + rotation[row, 1] * vector[1] + rotation[row, 2] * vector[2]


@njit(cache=True, nogil=True)
def _wanted_height(low: float, high: float, phase: float, running: float) -> float:
    """Height of an upright person's pelvis [m] by the published vertical travel."""
    travel = 0.5 - 0.5 * math.cos(2.0 * _TURN * (phase - 0.04))
    # Runners are lowest in mid-stance and highest in the middle of the flight phase.
    running_travel = 0.5 - 0.5 * math.cos(2.0 * _TURN * (phase - 0.5 * RUN_STANCE_FRACTION))
    travel = travel + running * (running_travel - travel)
    return low + (high - low) * travel


@njit(cache=True, nogil=True)
def _pelvis_height(wanted: float, reach_m: float, pelvis: FloatArray, hips: FloatArray, ankles: FloatArray) -> float:
    """Height of a pelvis [m]: the wanted one, limited by the reach of both legs.

    Of `pelvis` `(3,)` only x and y are used; `hips` `(2, 3)` are relative to it, `ankles` `(2, 3)` in the world.
    """
    softened = 0.0
    for side in range(2):
        x, y = ankles[side, 0] - hips[side, 0] - pelvis[0], ankles[side, 1] - hips[side, 1] - pelvis[1]
        above = math.sqrt(max(reach_m * reach_m - x * x - y * y, 0.04))
        limit = -(ankles[side, 2] + above - hips[side, 2]) / _HEIGHT_SOFTNESS_M
        softened = np.logaddexp(softened, limit) if side else limit
    return -_HEIGHT_SOFTNESS_M * np.logaddexp(softened, -wanted / _HEIGHT_SOFTNESS_M)


@njit(cache=True, nogil=True)
def _bend_leg(
    hip: FloatArray,
    ankle: FloatArray,
    knee_direction: FloatArray,
    thigh_m: float,
    shank_m: float,
    knee: FloatArray,
    thigh_rotation: FloatArray,
    shank_rotation: FloatArray,
) -> None:
    """Set the knee `(3,)` [m] and the rotations of thigh and shank: z up along the bone, x to the bent knee.

    The knee bends towards the unit vector `knee_direction`; a leg that does not reach points at the ankle, extended.
    """
    down, ahead, left, thigh, shank = np.empty((5, 3))
    squared = 0.0
    for row in range(3):
        down[row] = ankle[row] - hip[row]
        squared += down[row] * down[row]
    distance = math.sqrt(squared)
    length = thigh_m + shank_m
    reach = min(max(distance, 0.35 * length), MAX_EXTENSION * length)
    along = 0.0
    for row in range(3):
        down[row] /= max(distance, 1e-9)
        along += knee_direction[row] * down[row]
    squared = 0.0
    for row in range(3):
        ahead[row] = knee_direction[row] - along * down[row]
        squared += ahead[row] * ahead[row]
    norm = math.sqrt(squared)
    for row in range(3):
        ahead[row] /= norm
    _cross(ahead, down, left)
    # Law of cosines: angle at the hip between the thigh and the line to the ankle.
    cos = (thigh_m * thigh_m + reach * reach - shank_m * shank_m) / (2.0 * thigh_m * reach)
    along, across = thigh_m * cos, thigh_m * math.sqrt(max(1.0 - cos * cos, 0.0))
    for row in range(3):
        thigh[row] = along * down[row] + across * ahead[row]
        shank[row] = reach * down[row] - thigh[row]
        knee[row] = hip[row] + thigh[row]
    for bone, bone_m, rotation in ((thigh, thigh_m, thigh_rotation), (shank, shank_m, shank_rotation)):
        for row in range(3):
            rotation[row, 1] = left[row]
            rotation[row, 2] = bone[row] = -bone[row] / bone_m
        _cross(left, bone, rotation[:, 0])


@njit(cache=True, nogil=True)
def _cross(a: FloatArray, b: FloatArray, out: FloatArray) -> None:
    out[0], out[1], out[2] = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
