"""Where feet stand, when they leave, and where they come down next.

A foot that stands is fixed to the ground and only rolls. A foot in the air flies from where it stood to where the body
will need it: the place below the body in the middle of its next stance, predicted from the present velocity and turn.
The phase of the stride advances with the distance walked. Near rest it also advances with time, until both feet stand
side by side.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.agents.gait import foot_roll as soles
from pftrack_sim.agents.gait.gait_parameters import RUN_STANCE, blended, look_up, run_gauge, table
from pftrack_sim.agents.gait.limb_rotations import wrapped
from pftrack_sim.scene.people.anatomy import Anatomy

Array = NDArray[np.float64]

SIDES = np.array([1.0, -1.0])
"""Left is positive y."""

_HALF_A_STRIDE = np.array([0.0, 0.5])
_SPEED_LAG_S = 0.07
_TURN_LAG_S = 0.12
"""Time constants of the smoothing of what the body does."""
_SURPRISE_M_S2 = 3.5
"""Feet follow no harder acceleration: a body that stops dead would tear a foot out of its flight."""
_AT_REST_M_S = 0.06
_HASTE = 2.5
"""How strongly the stride quickens when a foot is left behind, as at a start."""
_TOLERATED_LAG = 0.06
_RUN_LAG_S = 0.5
_ROLLED = 0.56
"""Share of the stride over which a foot is thought to roll."""
_FIDGET_HZ = 0.85
"""Stride frequency at which feet are brought together near rest, and below which speed that begins [m/s]."""
_FIDGET_BELOW_M_S = 0.28
_SETTLED = np.array([[0.035], [0.30]])
_UNSETTLED = np.array([[0.085], [0.50]])
"""How far [m] and how twisted [rad] a foot may be from its place at rest, to come to rest and to stay there."""


@dataclass(frozen=True)
class Habits:
    """How one person steps.

    Attributes:
        toe_out_rad: Angle of the feet to the heading.
        walk_half_m: Ankle to the line of progress when walking.
        stand_half_m: The same when standing.
        start_phase: Where in the stride the person is at a reset.
    """

    toe_out_rad: float
    walk_half_m: float
    stand_half_m: float
    start_phase: float


class FootPlacement:
    """Feet of `P` people. Arrays are `(P,)`, or `(P, 2)` for left and right, unless said otherwise.

    Attributes:
        phase: Share of the stride since the left heel's contact.
        velocity: `(P, 2)` smoothed velocity of the body [m/s].
        speed: Its length.
        turn: Smoothed turn rate [rad/s].
        gauge: What depends on speed alone.
        ankles: `(P, 2, 3)` [m].
        yaw: Where feet point [rad].
        pitch: Toes-up angle of feet [rad].
        standing: Whether a foot is on the ground.
        running: Share of running in the gait.
    """

    def __init__(self, anatomies: Sequence[Anatomy], habits: Sequence[Habits]) -> None:
        people = len(anatomies)
        self._anatomies = tuple(anatomies)
        self.running = np.zeros(people)
        soles_m = np.array([one.sole_m for one in anatomies]).reshape(people, 4)[:, :, None]
        self._heel, self._toe = (soles_m[:, 0], soles_m[:, 1]), (soles_m[:, 2], soles_m[:, 3])
        self._ankle = np.array([one.ankle_m for one in anatomies])[:, None]
        self._toe_out = np.array([one.toe_out_rad for one in habits])[:, None] * SIDES
        self._walk_half = np.array([one.walk_half_m for one in habits])
        self._stand_half = np.array([one.stand_half_m for one in habits])
        self._start_phase = np.array([one.start_phase for one in habits])
        self._tables = np.stack([table(one) for one in anatomies])

    def reset(self, positions: Array, headings: Array, speeds: Array) -> None:
        """Take up the steady gait at these speeds, or stand.

        Args:
            positions: `(P, 2)` [m].
            headings: `(P,)` [rad].
            speeds: `(P,)` forward speeds [m/s].
        """
        self.running = np.zeros(len(positions))
        self._positions, self._headings = positions.copy(), headings.copy()
        cos, sin = np.cos(headings), np.sin(headings)
        self.velocity = np.stack([cos * speeds, sin * speeds], axis=-1)
        self.turn = np.zeros(len(positions))
        self.speed = np.abs(speeds)
        self._adapt(self.speed)
        self._resting = self.speed < _AT_REST_M_S
        self._rate = np.maximum(self.speed / self.gauge.stride_m, 0.2)
        # At rest both feet stand: the right one has just landed.
        self.phase = np.where(self._resting, 0.55, self._start_phase)
        cycle = self.cycle
        stance = np.broadcast_to(self.gauge.stance[:, None], cycle.shape)
        self.standing = (cycle < stance) | self._resting[:, None]
        self._lift_share = stance.copy()
        # Where feet stood down in a steady walk up to now.
        ahead = np.where(self._resting[:, None], 0.0, (soles.UNDERFOOT - cycle) * self.gauge.stride_m[:, None])
        side = SIDES * self._half[:, None]
        self._spot_x = positions[:, 0, None] + ahead * cos[:, None] - side * sin[:, None]
        self._spot_y = positions[:, 1, None] + ahead * sin[:, None] + side * cos[:, None]
        self._spot_yaw = headings[:, None] + self._toe_out
        self._place(cycle, np.zeros_like(self.standing))

    @property
    def cycle(self) -> Array:
        """`(P, 2)` share of the stride since each foot's contact."""
        return (self.phase[:, None] + _HALF_A_STRIDE) % 1.0

    def run(self, dt_s: float, who: NDArray[np.bool_]) -> None:
        """Take up or give up running over about two steps, before `advance`.

        Args:
            dt_s: Time since the last call [s].
            who: Who runs.
        """
        if who.any() or self.running.any():
            step = dt_s / _RUN_LAG_S
            self.running = np.clip(self.running + np.where(who, step, -step), 0.0, 1.0)

    @property
    def _underfoot(self) -> Array:
        """`(P, 1)` share of the stride after contact at which the body is above the foot."""
        if not self.running.any():
            return np.full((len(self.running), 1), soles.UNDERFOOT)
        run = self.running[:, None]
        return np.where(run > 0.0, soles.UNDERFOOT + run * (0.5 * RUN_STANCE - soles.UNDERFOOT), soles.UNDERFOOT)

    def advance(self, dt_s: float, positions: Array, headings: Array) -> None:
        """Go on to where bodies are now, `dt_s` later.

        Args:
            dt_s: Time since the last call [s].
            positions: `(P, 2)` [m].
            headings: `(P,)` [rad].
        """
        moved = (positions - self._positions) / dt_s
        turned = wrapped(headings - self._headings) / dt_s
        change = (1.0 - np.exp(-dt_s / _SPEED_LAG_S)) * (moved - self.velocity)
        size = np.sqrt(change[:, 0] ** 2 + change[:, 1] ** 2)
        change *= np.minimum(_SURPRISE_M_S2 * dt_s / np.maximum(size, 1e-9), 1.0)[:, None]
        self.velocity = self.velocity + change
        self.turn = self.turn + (1.0 - np.exp(-dt_s / _TURN_LAG_S)) * (turned - self.turn)
        self._positions, self._headings = positions.copy(), headings.copy()
        self.speed = speed = np.sqrt(self.velocity[:, 0] ** 2 + self.velocity[:, 1] ** 2)
        self._adapt(speed)

        before = self.cycle
        self._rate = self._stride_rate(speed, before)
        self.phase = (self.phase + self._rate * dt_s) % 1.0
        cycle = self.cycle
        lifting = self.standing & (cycle >= self.gauge.stance[:, None]) & ~self._resting[:, None]
        landing = ~self.standing & (cycle < before)
        self._lift_share = np.where(lifting, np.minimum(cycle, 0.9), self._lift_share)
        self.standing = (self.standing & ~lifting) | landing
        self._place(cycle, landing)

    def _adapt(self, speed: Array) -> None:
        self.gauge = look_up(self._tables, speed)
        if self.running.any():
            self.gauge = blended(self.gauge, run_gauge(self._anatomies, speed), self.running)
        share = np.exp(-((speed / 0.45) ** 2))
        self._half = self._walk_half + (self._stand_half - self._walk_half) * share

    def _stride_rate(self, speed: Array, cycle: Array) -> Array:
        """Strides per second: distance walked over stride length, quicker for a foot left behind or out of place."""
        stride = self.gauge.stride_m
        away_x, away_y = self._spot_x - self._positions[:, 0, None], self._spot_y - self._positions[:, 1, None]
        ahead = (away_x * self.velocity[:, 0, None] + away_y * self.velocity[:, 1, None]) / np.maximum(speed, 1e-6)[
            :, None
        ]
        lag = ((self._underfoot - cycle) - ahead / stride[:, None]) * self.standing
        haste = 1.0 + _HASTE * np.minimum(np.maximum(lag.max(axis=1) - _TOLERATED_LAG, 0.0), 0.5)

        cos, sin = np.cos(self._headings), np.sin(self._headings)
        side = SIDES * self._stand_half[:, None]
        off_x, off_y = away_x + sin[:, None] * side, away_y - cos[:, None] * side
        off = np.sqrt(off_x * off_x + off_y * off_y).max(axis=1)
        twist = np.abs(wrapped(self._spot_yaw - self._headings[:, None] - self._toe_out)).max(axis=1)
        allowed, twisted = np.where(self._resting, _UNSETTLED, _SETTLED)
        self._resting = (speed < _AT_REST_M_S) & (off < allowed) & (twist < twisted) & self.standing.all(axis=1)
        floor = _FIDGET_HZ * np.maximum(1.0 - (speed / _FIDGET_BELOW_M_S) ** 2, 0.0)
        return np.where(self._resting, 0.0, np.maximum(speed / stride * haste, floor))

    def _aim(self, cycle: Array) -> tuple[Array, Array, Array]:
        """Where a foot in the air, or one just landed, will stand flat: x, y [m] and the body's heading [rad]."""
        # A runner's foot is in the air before half the stride is over.
        landed = cycle < np.where(self.running > 0.0, 0.3, 0.5)[:, None]
        share = self._underfoot + np.where(landed, 0.0, 1.0) - cycle
        ahead_s = np.minimum(share / np.maximum(self._rate, 0.2)[:, None], 1.5)
        bend = 0.5 * np.minimum(np.maximum(self.turn[:, None] * ahead_s, -0.9), 0.9)
        # Along the chord of the arc that the body will walk.
        cos, sin = np.cos(bend), np.sin(bend)
        x, y = self.velocity[:, 0, None] * ahead_s, self.velocity[:, 1, None] * ahead_s
        heading = self._headings[:, None] + 2.0 * bend
        side = SIDES * self._half[:, None]
        return (
            self._positions[:, 0, None] + cos * x - sin * y - np.sin(heading) * side,
            self._positions[:, 1, None] + sin * x + cos * y + np.cos(heading) * side,
            heading,
        )

    def _place(self, cycle: Array, landing: NDArray[np.bool_]) -> None:
        """Feet as they are at this share of the stride."""
        x, y, heading = self._aim(cycle)
        yaw = self._spot_yaw + wrapped(heading + self._toe_out - self._spot_yaw)
        self._spot_x = np.where(landing, x, self._spot_x)
        self._spot_y = np.where(landing, y, self._spot_y)
        self._spot_yaw = np.where(landing, yaw, self._spot_yaw)

        gauge, standing = self.gauge, self.standing
        strike, push = gauge.strike_rad[:, None], gauge.push_rad[:, None]
        progress = np.maximum(cycle - self._lift_share, 0.0) / (1.0 - self._lift_share)
        travel, pitch, lift = soles.swing(progress, strike, push)
        travel = np.where(standing, 0.0, travel)
        stance, rolling = gauge.stance[:, None], cycle
        if self.running.any():
            # A short stance is rolled over as a long one is, only faster.
            quicker = np.where(self.running > 0.0, 1.0 + self.running * (_ROLLED / gauge.stance - 1.0), 1.0)[:, None]
            stance, rolling = stance * quicker, cycle * quicker
        self.pitch = np.where(standing, soles.stance_pitch(rolling, stance, strike, push), pitch)
        self.yaw = self._spot_yaw + travel * (yaw - self._spot_yaw)
        roll, high = soles.rolled(self.pitch, self._ankle, self._heel, self._toe)
        self.ankles = np.empty((*cycle.shape, 3))
        self.ankles[..., 0] = self._spot_x + travel * (x - self._spot_x) + roll * np.cos(self.yaw)
        self.ankles[..., 1] = self._spot_y + travel * (y - self._spot_y) + roll * np.sin(self.yaw)
        self.ankles[..., 2] = high + np.where(standing, 0.0, lift * gauge.clearance_m[:, None])
