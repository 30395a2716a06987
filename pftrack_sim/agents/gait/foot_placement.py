"""Gait phase, footholds and foot poses.

A foot in stance stays at its foothold and only rolls. A foot in swing moves to its next foothold: the place below the
body in the middle of the next stance, predicted from the present velocity and turn rate. The gait phase advances with
the distance walked; near rest it also advances with time, until both feet stand side by side.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pftrack_sim.agents.gait.gait_parameters import blended, running_parameters, walking_parameters, walking_table
from pftrack_sim.agents.gait.joint_trajectories import rolled_ankle, stance_pitch, swing_motion
from pftrack_sim.agents.gait.kinematics import wrapped
from pftrack_sim.core.types import BoolArray, FloatArray
from pftrack_sim.scene.people.anatomy import Anatomy

SIDES = np.array([1.0, -1.0])  # sign of y of the left and the right side

_PHASE_OFFSETS = np.array([0.0, 0.5])
_VELOCITY_TIME_CONSTANT_S = 0.07
_TURN_TIME_CONSTANT_S = 0.12
_MAX_ACCELERATION_M_S2 = 3.5  # of the smoothed velocity: feet do not jump when the body stops at once
_CATCH_UP_GAIN = 2.5  # relative increase of the stride frequency per phase by which a foot lags, as at a start
_TOLERATED_LAG = 0.06
_RUN_TRANSITION_S = 0.5
_ROLLING_STANCE = 0.56  # stance fraction for which a runner's foot roll is computed; it is played back faster
_SETTLING_HZ = 0.85  # stride frequency at which feet are brought together near rest
_SETTLING_BELOW_M_S = 0.28
_AT_REST_M_S = 0.06
# Limits of a foot's distance [m] and angle [rad] from its place at rest: to come to rest, and to remain at rest.
_SETTLED = np.array([[0.035], [0.30]])
_UNSETTLED = np.array([[0.085], [0.50]])


class FootPlacement:
    """Feet of `P` people. Arrays are `(P,)`, or `(P, 2)` for left and right, unless stated otherwise.

    `walk_half_m` is the distance of the ankles from the line of progress, `stand_half_m` that from the mid-plane.

    Attributes:
        start_phase: Gait phase with which a steady walk starts.
        phase: Gait phase: fraction of the stride since the left heel strike.
        speed: Of the smoothed velocity of the body [m/s].
        turn: Smoothed turn rate [rad/s].
        ankles: `(P, 2, 3)` [m].
        pitch: Toes-up angle of the feet [rad].
        in_stance: Whether a foot is on the ground.
    """

    def __init__(
        self,
        anatomies: Sequence[Anatomy],
        toe_out_rad: FloatArray,
        walk_half_m: FloatArray,
        stand_half_m: FloatArray,
        start_phase: FloatArray,
    ) -> None:
        self._anatomies = tuple(anatomies)
        heel_x, heel_radius, toe_x, toe_radius = np.array([one.sole_m for one in anatomies]).T[..., None]
        self._sole = (heel_x, heel_radius, toe_x, toe_radius)
        self._ankle = np.array([one.ankle_m for one in anatomies])[:, None]
        self._toe_out = toe_out_rad[:, None] * SIDES
        self._walk_half, self._stand_half, self.start_phase = walk_half_m, stand_half_m, start_phase
        self._tables = np.stack([walking_table(one) for one in anatomies])

    def reset(self, positions: FloatArray, headings: FloatArray, speeds: FloatArray) -> None:
        """Start in a steady walk at forward speeds [m/s], or at rest, at `(P, 2)` positions [m] and headings [rad]."""
        self.running = np.zeros(len(positions))
        self._positions, self._headings = positions.copy(), headings.copy()
        self._velocity = _forward(headings) * speeds[:, None]
        self.turn = np.zeros(len(positions))
        self._set_speed(np.abs(speeds))
        self._resting = self.speed < _AT_REST_M_S
        self._rate_hz = np.maximum(self.speed / self.parameters.stride_m, 0.2)
        # At rest both feet are in stance: the right one has just landed.
        self.phase = np.where(self._resting, 0.55, self.start_phase)
        phases = self.foot_phases
        stance_fraction = np.broadcast_to(self.parameters.stance_fraction[:, None], phases.shape)
        self.in_stance = (phases < stance_fraction) | self._resting[:, None]
        self._toe_off_phase = stance_fraction.copy()
        # Footholds of a steady walk up to now.
        behind = (self.parameters.mid_stance[:, None] - phases) * self.parameters.stride_m[:, None]
        along = np.where(self._resting[:, None], 0.0, behind)[..., None]
        side = (SIDES * self._half[:, None])[..., None]
        self._foothold = positions[:, None] + along * _forward(headings)[:, None] + side * _left(headings)[:, None]
        self._foothold_yaw = headings[:, None] + self._toe_out
        self._place(phases, np.zeros_like(self.in_stance))

    @property
    def foot_phases(self) -> FloatArray:
        """`(P, 2)` fraction of the stride since each foot's heel strike."""
        return (self.phase[:, None] + _PHASE_OFFSETS) % 1.0

    def advance(self, dt_s: float, positions: FloatArray, headings: FloatArray, running: BoolArray) -> None:
        """Follow the bodies to `(P, 2)` positions [m] and headings [rad]; changing to a run takes about two steps."""
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

    def _set_speed(self, speed: FloatArray) -> None:
        self.speed = speed
        self.parameters = walking_parameters(self._tables, speed)
        if self.running.any():
            self.parameters = blended(self.parameters, running_parameters(self._anatomies, speed), self.running)
        self._half = self._walk_half + (self._stand_half - self._walk_half) * np.exp(-((speed / 0.45) ** 2))

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
        ahead, height = rolled_ankle(self.pitch, self._ankle, self._sole)
        flat = self._foothold + travel[..., None] * (target - self._foothold)
        self.ankles = np.empty((*phases.shape, 3))
        self.ankles[..., :2] = flat + ahead[..., None] * _forward(self.yaw)
        self.ankles[..., 2] = height + np.where(in_stance, 0.0, lift * parameters.clearance_m[:, None])


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
