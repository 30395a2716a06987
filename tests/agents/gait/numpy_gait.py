"""Gait on arrays of all people: the plain NumPy twin of the kernels of `pftrack_sim.agents.gait`."""

from __future__ import annotations

import numpy as np

from pftrack_sim.agents.gait.foot_placement import (
    _RUN_TRANSITION_S,
    _TURN_TIME_CONSTANT_S,
    _VELOCITY_TIME_CONSTANT_S,
    SIDES,
    FootPlacement,
)
from pftrack_sim.agents.gait.gait import Gait
from pftrack_sim.agents.gait.gait_parameters import MAX_EXTENSION, RUN_STANCE_FRACTION
from pftrack_sim.agents.gait.joint_trajectories import (
    LIFT_POWER,
    SWING,
    rolled_ankle,
    stance_pitch,
)
from pftrack_sim.core.types import BoolArray, FloatArray
from pftrack_sim.scene.people.person import PARTS

# Indices into `PARTS`.
_PELVIS, _TORSO, _HEAD = 0, 1, 2
_UPPER_ARMS, _FOREARMS, _THIGHS, _SHANKS, _FEET = (slice(start, start + 2) for start in range(3, 13, 2))

_GRAVITY = 9.81
_HEIGHT_SOFTNESS_M = 0.003  # scale of the smooth minimum that limits the pelvis to the reach of the legs
_PELVIS_YAW, _PELVIS_ROLL = np.radians(4.5), np.radians(3.5)  # amplitudes at natural speed
_LEAN_PER_SPEED = np.radians(1.8)
_HEAD_PITCH = np.radians(2.0)
_IDLE_AMPLITUDES = np.radians([[0.6], [4.0]])  # of the chest's pitch (breathing) and the head's yaw (looking around)
_CROUCH_DEPTH = 0.46  # lowering of the pelvis in a full crouch, in leg lengths
_CROUCH_BACK = 0.38  # backward shift of the pelvis in a full crouch, in thigh lengths
_CROUCH_LEAN, _CROUCH_SHOULDER, _CROUCH_ELBOW = 0.55, 0.7, 0.35
_BEND_BACK, _BEND_DEPTH = 0.40, 0.06  # the same of a full bend
_BEND_PITCHES = np.radians([48.0, 82.0, 62.0, 88.0])  # of pelvis, trunk and head, and forward of the arms
_BEND_ELBOW = 0.7  # share by which a full bend extends the elbow of an arm that holds something
_LOOK_TRUNK = 0.35  # share of the head's turn by which the trunk follows
_RUNNING_ELBOW = np.radians(62.0)
_ROLLING_STANCE = 0.56  # stance fraction for which a runner's foot roll is computed; it is played back faster
_SHOULDERS_BACK = 0.008  # shoulder joints behind the base of the neck, in statures

_MAX_ACCELERATION_M_S2 = 3.5  # of the smoothed velocity: feet do not jump when the body stops at once
_CATCH_UP_GAIN = 2.5  # relative increase of the stride frequency per phase by which a foot lags, as at a start
_TOLERATED_LAG = 0.06
_SETTLING_HZ = 0.85  # stride frequency at which feet are brought together near rest
_SETTLING_BELOW_M_S = 0.28
_AT_REST_M_S = 0.06
# Limits of a foot's distance [m] and angle [rad] from its place at rest: to come to rest, and to remain at rest.
_SETTLED = np.array([[0.035], [0.30]])
_UNSETTLED = np.array([[0.085], [0.50]])


def shoulder_angles(phase: FloatArray, amplitude: FloatArray) -> FloatArray:
    swing = np.radians(16.0) * amplitude * np.cos(2.0 * np.pi * (phase - 0.03))
    return np.radians(-6.0) * np.minimum(amplitude, 1.0) - swing


def elbow_angles(phase: FloatArray, amplitude: FloatArray) -> FloatArray:
    return np.radians(13.0) + np.radians(11.0) * amplitude * (1.0 - 0.85 * np.cos(2.0 * np.pi * (phase - 0.06)))


def swing_motion(
    progress: FloatArray, heel_strike_rad: FloatArray, toe_off_rad: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Fraction of the way to the next foothold, pitch [rad], and relative height of the sole's lowest point."""
    times, travel, relative_pitch = SWING
    relative = np.interp(progress, times, relative_pitch)
    pitch = np.where(relative < 0.0, toe_off_rad, heel_strike_rad) * relative
    return np.interp(progress, times, travel), pitch, np.sin(np.pi * progress) ** LIFT_POWER


class NumpyFeet(FootPlacement):
    def advance(self, dt_s, positions, headings, running):
        if running.any() or self.running.any():
            step = dt_s / _RUN_TRANSITION_S
            self.running = np.clip(self.running + np.where(running, step, -step), 0.0, 1.0)
        velocity = (positions - self._positions) / dt_s
        turn = wrapped(headings - self._headings) / dt_s
        change = (1.0 - np.exp(-dt_s / _VELOCITY_TIME_CONSTANT_S)) * (velocity - self._velocity)
        change *= np.minimum(_MAX_ACCELERATION_M_S2 * dt_s / np.maximum(_norm(change), 1e-9), 1.0)[:, None]
        self._velocity = self._velocity + change
        self.turn = self.turn + (1.0 - np.exp(-dt_s / _TURN_TIME_CONSTANT_S)) * (turn - self.turn)
        self._positions, self._headings = positions.copy(), headings.copy()
        self._set_speed(_norm(self._velocity))

        before = self.foot_phases
        self._rate_hz = self._stride_frequency(before)
        self.phase = (self.phase + self._rate_hz * dt_s) % 1.0
        phases = self.foot_phases
        toe_off = self.in_stance & (phases >= self.parameters.stance_fraction[:, None]) & ~self._resting[:, None]
        heel_strike = ~self.in_stance & (phases < before)
        self._toe_off_phase = np.where(toe_off, np.minimum(phases, 0.9), self._toe_off_phase)
        self.in_stance = (self.in_stance & ~toe_off) | heel_strike
        self._place(phases, heel_strike)

    def _stride_frequency(self, phases: FloatArray) -> FloatArray:
        """Stride frequency `(P,)` [Hz]: speed over stride length, higher for a foot that lags or is out of place.

        Also updates which people are at rest.
        """
        speed, stride = self.speed, self.parameters.stride_m
        offset = self._foothold - self._positions[:, None]
        ahead = (offset * self._velocity[:, None]).sum(axis=-1) / np.maximum(speed, 1e-6)[:, None]
        lag = ((self.parameters.mid_stance[:, None] - phases) - ahead / stride[:, None]) * self.in_stance
        catch_up = 1.0 + _CATCH_UP_GAIN * np.minimum(np.maximum(lag.max(axis=1) - _TOLERATED_LAG, 0.0), 0.5)

        side = (SIDES * self._stand_half[:, None])[..., None]
        distance = _norm(offset - side * _left(self._headings)[:, None]).max(axis=1)
        angle = np.abs(wrapped(self._foothold_yaw - self._headings[:, None] - self._toe_out)).max(axis=1)
        max_distance, max_angle = np.where(self._resting, _UNSETTLED, _SETTLED)
        in_place = (distance < max_distance) & (angle < max_angle) & self.in_stance.all(axis=1)
        self._resting = (speed < _AT_REST_M_S) & in_place
        least = _SETTLING_HZ * np.maximum(1.0 - (speed / _SETTLING_BELOW_M_S) ** 2, 0.0)
        return np.where(self._resting, 0.0, np.maximum(speed / stride * catch_up, least))

    def _next_foothold(self, phases: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Foothold `(P, 2, 2)` [m] and heading of the body `(P, 2)` [rad] of feet in swing or just landed."""
        # A runner's foot is in the air before half the stride is over.
        landed = phases < np.where(self.running > 0.0, 0.3, 0.5)[:, None]
        until_mid_stance = self.parameters.mid_stance[:, None] + np.where(landed, 0.0, 1.0) - phases
        time_s = np.minimum(until_mid_stance / np.maximum(self._rate_hz, 0.2)[:, None], 1.5)
        # Along the chord of the arc that the body will walk.
        half_turn = 0.5 * np.minimum(np.maximum(self.turn[:, None] * time_s, -0.9), 0.9)
        x, y = (self._velocity[:, None, axis, None] * time_s[..., None] for axis in (0, 1))
        heading = self._headings[:, None] + 2.0 * half_turn
        side = (SIDES * self._half[:, None])[..., None]
        body = self._positions[:, None] + x * _forward(half_turn) + y * _left(half_turn)
        return body + side * _left(heading), heading

    def _place(self, phases: FloatArray, heel_strike: BoolArray) -> None:
        """Set the poses of the feet at these phases."""
        target, heading = self._next_foothold(phases)
        target_yaw = self._foothold_yaw + wrapped(heading + self._toe_out - self._foothold_yaw)
        self._foothold = np.where(heel_strike[..., None], target, self._foothold)
        self._foothold_yaw = np.where(heel_strike, target_yaw, self._foothold_yaw)

        parameters, in_stance = self.parameters, self.in_stance
        heel_strike_rad, toe_off_rad = parameters.heel_strike_rad[:, None], parameters.toe_off_rad[:, None]
        progress = np.maximum(phases - self._toe_off_phase, 0.0) / (1.0 - self._toe_off_phase)
        travel, swing_pitch, lift = swing_motion(progress, heel_strike_rad, toe_off_rad)
        travel = np.where(in_stance, 0.0, travel)
        stance_fraction, rolling = parameters.stance_fraction[:, None], phases
        if self.running.any():
            faster = 1.0 + self.running * (_ROLLING_STANCE / parameters.stance_fraction - 1.0)
            faster = np.where(self.running > 0.0, faster, 1.0)[:, None]
            stance_fraction, rolling = stance_fraction * faster, phases * faster
        rolling_pitch = stance_pitch(rolling, stance_fraction, heel_strike_rad, toe_off_rad)
        self.pitch = np.where(in_stance, rolling_pitch, swing_pitch)
        self.yaw = self._foothold_yaw + travel * (target_yaw - self._foothold_yaw)
        ahead, height = rolled_ankle(self.pitch, self._ankle[:, None], tuple(self._soles.T[..., None]))
        flat = self._foothold + travel[..., None] * (target - self._foothold)
        self.ankles = np.empty((*phases.shape, 3))
        self.ankles[..., :2] = flat + ahead[..., None] * _forward(self.yaw)
        self.ankles[..., 2] = height + np.where(in_stance, 0.0, lift * parameters.clearance_m[:, None])


class NumpyGait(Gait):
    """A gait whose poses are computed on arrays."""

    def __init__(self, anatomies, rngs):
        super().__init__(anatomies, rngs)
        self.feet.__class__ = NumpyFeet
        self._thigh, self._shank = self._legs[:, :, None]
        self._waist, self._neck = (np.stack([0 * z, 0 * z, z], axis=1) for z in self._spine)
        self._hips, self._shoulders, self._elbows = self._offsets
        self._angles = np.zeros((3, len(anatomies), 9))
        self._angles[0, :, 7:9] = -0.25 * SIDES

    def _computed(self):
        if self._pose is None:
            positions, rotations = self._compute_pose()
            self._pose = positions, rotations, quaternions(rotations), self._root_poses(positions)
        return self._pose

    def _root_poses(self, positions: FloatArray) -> FloatArray:
        roots, (cos, sin) = np.tile(np.eye(4), (len(positions), 1, 1)), (np.cos(self._headings), np.sin(self._headings))
        roots[:, 0, 0], roots[:, 0, 1], roots[:, 1, 0], roots[:, 1, 1] = cos, -sin, sin, cos
        roots[:, :2, 3] = positions[:, _PELVIS, :2]
        return roots

    def _compute_pose(self) -> tuple[FloatArray, FloatArray]:
        """Positions `(P, 13, 3)` [m] and rotations `(P, 13, 3, 3)` of all parts."""
        feet, headings = self.feet, self._headings
        positions = np.empty((len(headings), len(PARTS), 3))
        rotations = np.empty((len(headings), len(PARTS), 3, 3))

        part_rotations = self._rotations()
        rotations[:, : _HEAD + 1] = part_rotations[:, :3]
        rotations[:, _FEET] = part_rotations[:, 3:5]
        rotations[:, _UPPER_ARMS] = rotations[:, _TORSO, None] @ part_rotations[:, 5:7]
        rotations[:, _FOREARMS] = rotations[:, _UPPER_ARMS] @ part_rotations[:, 7:9]

        hips = rotated(rotations[:, _PELVIS, None], self._hips)
        sway = feet.parameters.sway_m * np.cos(2.0 * np.pi * (feet.phase - 0.30))
        # A crouching person's pelvis moves back as the chest leans forward: the weight stays above the feet.
        back = _CROUCH_BACK * self._thigh[:, 0] * self._posture[0] + _BEND_BACK * self._thigh[:, 0] * self._posture[1]
        pelvis = positions[:, _PELVIS]
        pelvis[:, 0] = self._positions[:, 0] - sway * np.sin(headings) - back * np.cos(headings)
        pelvis[:, 1] = self._positions[:, 1] + sway * np.cos(headings) - back * np.sin(headings)
        pelvis[:, 2] = self._pelvis_height(pelvis, hips)
        positions[:, _TORSO] = pelvis + rotated(rotations[:, _PELVIS], self._waist)
        positions[:, _HEAD] = positions[:, _TORSO] + rotated(rotations[:, _TORSO], self._neck)

        positions[:, _THIGHS] = pelvis[:, None] + hips
        positions[:, _FEET] = feet.ankles
        knee_yaw = 0.5 * (feet.yaw + headings[:, None])
        knee_directions = np.stack([np.cos(knee_yaw), np.sin(knee_yaw), np.zeros_like(knee_yaw)], axis=-1)
        positions[:, _SHANKS], rotations[:, _THIGHS], rotations[:, _SHANKS] = leg_inverse_kinematics(
            positions[:, _THIGHS], feet.ankles, knee_directions, self._thigh, self._shank
        )
        shoulders = rotated(rotations[:, _TORSO, None], self._shoulders)
        positions[:, _UPPER_ARMS] = positions[:, _TORSO, None] + shoulders
        positions[:, _FOREARMS] = positions[:, _UPPER_ARMS] + rotated(rotations[:, _UPPER_ARMS], self._elbows)
        positions.setflags(write=False)
        return positions, rotations

    def _rotations(self) -> FloatArray:
        """`(P, 9, 3, 3)` of pelvis, torso, head and feet in the world, of upper arms and forearms in their parents."""
        feet, headings, crouch = self.feet, self._headings, self._posture[0][:, None]
        amplitude = feet.parameters.amplitude
        phases, arm_amplitude = feet.foot_phases, (self._arm_swing * amplitude)[:, None]
        shoulders = shoulder_angles(phases, arm_amplitude) + _CROUCH_SHOULDER * crouch
        elbows = elbow_angles(phases, arm_amplitude) + _CROUCH_ELBOW * crouch + _RUNNING_ELBOW * feet.running[:, None]
        # The pelvis turns with the advancing leg and drops on the side of the leg in swing; the torso counter-rotates.
        stride = 2.0 * np.pi * feet.phase
        twist = _PELVIS_YAW * amplitude * np.cos(stride)
        drop = _PELVIS_ROLL * amplitude * np.cos(stride - 2.0 * np.pi * 0.15)
        bank = np.minimum(np.maximum(-0.6 / _GRAVITY * feet.speed * feet.turn, -0.2), 0.2)
        gaze = np.minimum(np.maximum(0.35 * feet.turn, -0.5), 0.5)
        breath, glance = _IDLE_AMPLITUDES * np.sin(self._idle_phase + self._idle_rate * self._time_s)
        lean = self._lean + _LEAN_PER_SPEED * feet.speed + _CROUCH_LEAN * self._posture[0]
        bend, look = self._posture[1], self._posture[2]
        yaw, roll, pitch = self._angles
        yaw[:, 0] = headings - twist
        yaw[:, 1] = headings + 0.8 * twist + 0.3 * gaze + _LOOK_TRUNK * look
        yaw[:, 2] = headings + gaze + glance + look
        yaw[:, 3:5] = feet.yaw
        roll[:, 0] = drop + bank
        roll[:, 1] = bank - 0.35 * drop
        roll[:, 2] = 0.5 * bank
        bend_pelvis, bend_trunk, bend_head, bend_arms = _BEND_PITCHES[:, None] * bend
        pitch[:, 0] = 0.4 * lean + bend_pelvis
        pitch[:, 1] = lean + breath + bend_trunk
        pitch[:, 2] = 0.3 * lean + _HEAD_PITCH + bend_head
        pitch[:, 3:5] = -feet.pitch
        pitch[:, 5:7] = -shoulders - bend_arms[:, None]
        pitch[:, 7:9] = -elbows
        roll[:, 5:9] = self._arm_rolls
        held = [(i, j, arm) for i, one in enumerate(self._postures) for j, arm in enumerate(one.arms) if arm]
        for person, side, arm in held:
            upper, fore, outward = 5 + side, 7 + side, SIDES[side]
            # What is held before the chest hangs below it in a bend, and is held above the knees in a crouch.
            shoulder = arm.shoulder + _CROUCH_SHOULDER * self._posture[0][person] + bend_arms[person]
            elbow = arm.elbow * (1.0 - _BEND_ELBOW * bend[person])
            pitch[person, upper] += arm.share * (-shoulder - pitch[person, upper])
            pitch[person, fore] += arm.share * (-elbow - pitch[person, fore])
            roll[person, upper] += arm.share * outward * arm.outward
            roll[person, fore] += arm.share * outward * arm.forearm
        return rotation_matrices(yaw, roll, pitch)

    def _pelvis_height(self, pelvis: FloatArray, hips: FloatArray) -> FloatArray:
        """Height of the pelvis `(P,)` [m]: the published vertical travel, limited by the reach of both legs.

        Of `pelvis` `(P, 3)` only x and y are used; `hips` `(P, 2, 3)` are relative to it.
        """
        feet, low, high = self.feet, self.feet.parameters.hip_low_m, self.feet.parameters.hip_high_m
        travel = 0.5 - 0.5 * np.cos(4.0 * np.pi * (feet.phase - 0.04))
        # Runners are lowest in mid-stance and highest in the middle of the flight phase.
        running_travel = 0.5 - 0.5 * np.cos(4.0 * np.pi * (feet.phase - 0.5 * RUN_STANCE_FRACTION))
        travel = travel + feet.running * (running_travel - travel)
        wanted = low + (high - low) * travel
        leg = self._thigh[:, 0] + self._shank[:, 0]
        wanted = wanted - _CROUCH_DEPTH * leg * self._posture[0] - _BEND_DEPTH * leg * self._posture[1]
        horizontal = feet.ankles[..., :2] - hips[..., :2] - pelvis[:, None, :2]
        reach_squared = (MAX_EXTENSION * (self._thigh + self._shank)) ** 2
        above = np.sqrt(np.maximum(reach_squared - horizontal[..., 0] ** 2 - horizontal[..., 1] ** 2, 0.04))
        limits = feet.ankles[..., 2] + above - hips[..., 2]
        softened = np.logaddexp(-limits[:, 0] / _HEIGHT_SOFTNESS_M, -limits[:, 1] / _HEIGHT_SOFTNESS_M)
        return -_HEIGHT_SOFTNESS_M * np.logaddexp(softened, -wanted / _HEIGHT_SOFTNESS_M)


def rotation_matrices(yaw: FloatArray, roll: FloatArray, pitch: FloatArray) -> FloatArray:
    """`(..., 3, 3)` rotations: pitch about y, then roll about x, then yaw about z [rad].

    A positive pitch leans an upright body forward and swings a hanging limb back; a positive roll lifts the left side.
    """
    cos_y, sin_y, cos_r, sin_r, cos_p, sin_p = (f(angle) for angle in (yaw, roll, pitch) for f in (np.cos, np.sin))
    sin_r_sin_p, sin_r_cos_p = sin_r * sin_p, sin_r * cos_p
    out = np.empty((*yaw.shape, 3, 3))
    out[..., 0, 0] = cos_y * cos_p - sin_y * sin_r_sin_p
    out[..., 0, 1] = -sin_y * cos_r
    out[..., 0, 2] = cos_y * sin_p + sin_y * sin_r_cos_p
    out[..., 1, 0] = sin_y * cos_p + cos_y * sin_r_sin_p
    out[..., 1, 1] = cos_y * cos_r
    out[..., 1, 2] = sin_y * sin_p - cos_y * sin_r_cos_p
    out[..., 2, 0] = -cos_r * sin_p
    out[..., 2, 1] = sin_r
    out[..., 2, 2] = cos_r * cos_p
    return out


def quaternions(rotations: FloatArray) -> FloatArray:
    """`(..., 4)` unit quaternions w, x, y, z of `(..., 3, 3)` rotation matrices.

    Of the four candidates, one per component as divisor, the one with the largest divisor is taken (Shepperd 1978).
    """
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = np.moveaxis(rotations, (-2, -1), (0, 1))
    wx, wy, wz = zy - yz, xz - zx, yx - xy
    x_y, x_z, y_z = xy + yx, xz + zx, yz + zy
    candidates = (
        *(1.0 + xx + yy + zz, wx, wy, wz),
        *(wx, 1.0 + xx - yy - zz, x_y, x_z),
        *(wy, x_y, 1.0 - xx + yy - zz, y_z),
        *(wz, x_z, y_z, 1.0 - xx - yy + zz),
    )
    flat = np.empty((*xx.shape, 16))
    for index, component in enumerate(candidates):
        flat[..., index] = component
    flat = flat.reshape(-1, 4, 4)
    largest = flat.reshape(-1, 16)[:, ::5].argmax(axis=1)
    chosen = flat[np.arange(len(flat)), largest]
    chosen = chosen / np.sqrt((chosen * chosen).sum(axis=1))[:, None]
    return chosen.reshape(*xx.shape, 4)


def rotated(rotations: FloatArray, vectors: FloatArray) -> FloatArray:
    """`(..., 3)` vectors turned by `(..., 3, 3)` rotation matrices."""
    x, y, z = vectors[..., 0, None], vectors[..., 1, None], vectors[..., 2, None]
    return rotations[..., 0] * x + rotations[..., 1] * y + rotations[..., 2] * z


def wrapped(angle: FloatArray) -> FloatArray:
    """Angles wrapped to [-pi, pi) [rad]."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


def leg_inverse_kinematics(
    hips: FloatArray, ankles: FloatArray, knee_directions: FloatArray, thighs_m: FloatArray, shanks_m: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Knees `(..., 3)` [m], and rotations `(..., 3, 3)` of thighs and shanks: z up along the bone, x to the bent knee.

    Args:
        hips: `(..., 3)` hip joints [m].
        ankles: `(..., 3)` ankle joints [m]; a leg that does not reach points at the ankle, extended.
        knee_directions: `(..., 3)` unit vectors towards which knees bend.
        thighs_m: `(...)` lengths.
        shanks_m: `(...)` lengths.
    """
    way = ankles - hips
    distance = np.sqrt((way * way).sum(axis=-1))
    length = thighs_m + shanks_m
    down = way / np.maximum(distance, 1e-9)[..., None]
    reach = np.minimum(np.maximum(distance, 0.35 * length), MAX_EXTENSION * length)
    ahead = knee_directions - (knee_directions * down).sum(axis=-1)[..., None] * down
    ahead /= np.sqrt((ahead * ahead).sum(axis=-1))[..., None]
    left = _cross(ahead, down)
    # Law of cosines: angle at the hip between the thigh and the line to the ankle.
    cos = (thighs_m**2 + reach**2 - shanks_m**2) / (2.0 * thighs_m * reach)
    along = (thighs_m * cos)[..., None]
    across = (thighs_m * np.sqrt(np.maximum(1.0 - cos * cos, 0.0)))[..., None]
    thigh = along * down + across * ahead
    shank = reach[..., None] * down - thigh
    rotations = np.empty((2, *hips.shape, 3))
    for rotation, bone, bone_m in zip(rotations, (thigh, shank), (thighs_m, shanks_m), strict=True):
        up = -bone / bone_m[..., None]
        rotation[..., 0], rotation[..., 1], rotation[..., 2] = _cross(left, up), left, up
    return hips + thigh, rotations[0], rotations[1]


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """`(..., 3)` cross products, in half the time of `np.cross`."""
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    out = np.empty(a.shape)
    out[..., 0], out[..., 1], out[..., 2] = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    return out


def _forward(angle: FloatArray) -> FloatArray:
    """`(..., 2)` unit vectors in directions `(...)` [rad]."""
    out = np.empty((*angle.shape, 2))
    out[..., 0], out[..., 1] = np.cos(angle), np.sin(angle)
    return out


def _left(angle: FloatArray) -> FloatArray:
    """`(..., 2)` unit vectors to the left of directions `(...)` [rad]."""
    out = np.empty((*angle.shape, 2))
    out[..., 0], out[..., 1] = -np.sin(angle), np.cos(angle)
    return out


def _norm(vectors: FloatArray) -> FloatArray:
    return np.sqrt((vectors * vectors).sum(axis=-1))
