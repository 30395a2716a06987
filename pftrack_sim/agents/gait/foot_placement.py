"""Gait phase, footholds and foot poses.

A foot in stance stays at its foothold and only rolls. A foot in swing moves to its next foothold: the place below the
body in the middle of the next stance, predicted from the present velocity and turn rate. The gait phase advances with
the distance walked; near rest it also advances with time, until both feet stand side by side.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

from pftrack_sim.agents.gait.foot_kernels import AT_REST_M_S, advance_phase, follow, next_footholds, place_feet
from pftrack_sim.agents.gait.gait_parameters import blended, running_parameters, walking_parameters, walking_table
from pftrack_sim.agents.gait.joint_trajectories import DOWN_POWER, LIFT_POWER, SWING, UP_POWER
from pftrack_sim.core.types import BoolArray, FloatArray
from pftrack_sim.scene.people.anatomy import Anatomy

SIDES = np.array([1.0, -1.0])  # sign of y of the left and the right side

_PHASE_OFFSETS = np.array([0.0, 0.5])
_VELOCITY_TIME_CONSTANT_S = 0.07
_TURN_TIME_CONSTANT_S = 0.12
_RUN_TRANSITION_S = 0.5


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
        self._soles, self._ankle = np.array([one.sole_m for one in anatomies]), np.array([b.ankle_m for b in anatomies])
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
        self._resting = self.speed < AT_REST_M_S
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
        """Follow the bodies to `(P, 2)` positions [m] and headings [rad]; changing to a run takes about two steps.

        Keeps both arrays without a copy; the caller must not modify them.
        """
        if running.any() or self.running.any():
            step = dt_s / _RUN_TRANSITION_S
            self.running = np.clip(self.running + np.where(running, step, -step), 0.0, 1.0)
        # The kernels change their arguments; what a caller holds stays as it is.
        self.phase, self.turn, self.in_stance = self.phase.copy(), self.turn.copy(), self.in_stance.copy()
        speed = follow(
            dt_s, *_shares(dt_s), positions, headings, self._positions, self._headings, self._velocity,
            self.turn,
        )  # fmt: skip
        self._positions, self._headings = positions, headings
        self._set_speed(speed)
        parameters = self.parameters
        phases, heel_strike = advance_phase(
            dt_s, positions, headings, self._velocity, speed, parameters.stride_m, parameters.stance_fraction,
            parameters.mid_stance, self._toe_out, self._stand_half, self._foothold, self._foothold_yaw, self.phase,
            self._rate_hz, self._resting, self.in_stance, self._toe_off_phase,
        )  # fmt: skip
        self._place(phases, heel_strike)

    def _set_speed(self, speed: FloatArray) -> None:
        self.speed = speed
        self.parameters = walking_parameters(self._tables, speed)
        if self.running.any():
            self.parameters = blended(self.parameters, running_parameters(self._anatomies, speed), self.running)
        self._half = self._walk_half + (self._stand_half - self._walk_half) * np.exp(-((speed / 0.45) ** 2))

    def _place(self, phases: FloatArray, heel_strike: BoolArray) -> None:
        """Set the poses of the feet at these phases."""
        parameters = self.parameters
        targets, target_yaws, progress, (down, up, rising) = next_footholds(
            phases, heel_strike, self._positions, self._headings, self._velocity, self.turn, self._rate_hz,
            self.running, self._half, self._toe_out, parameters.mid_stance, parameters.stance_fraction,
            self._toe_off_phase, self._foothold, self._foothold_yaw,
        )  # fmt: skip
        self.ankles, self.yaw, self.pitch = place_feet(
            self.in_stance, self._foothold, self._foothold_yaw, targets, target_yaws, progress, down**DOWN_POWER,
            up**UP_POWER, rising**LIFT_POWER, SWING, parameters.heel_strike_rad, parameters.toe_off_rad,
            parameters.clearance_m, self._ankle, self._soles,
        )  # fmt: skip


@cache
def _shares(dt_s: float) -> tuple[float, float]:
    """Shares of their changes by which velocity and turn rate are smoothed in a tick."""
    velocity, turn = 1.0 - np.exp([-dt_s / _VELOCITY_TIME_CONSTANT_S, -dt_s / _TURN_TIME_CONSTANT_S])
    return float(velocity), float(turn)


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
