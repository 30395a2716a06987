"""Kernels of foot placement: the body's smoothed motion, the gait phase, footholds, and the poses of the feet.

As in `kernels`, the steps and their order are those of the formulas on arrays.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from pftrack_sim.core.types import BoolArray, FloatArray

_MAX_ACCELERATION_M_S2 = 3.5  # of the smoothed velocity: feet do not jump when the body stops at once
_CATCH_UP_GAIN = 2.5  # relative increase of the stride frequency per phase by which a foot lags, as at a start
_TOLERATED_LAG = 0.06
_SETTLING_HZ = 0.85  # stride frequency at which feet are brought together near rest
_SETTLING_BELOW_M_S = 0.28
AT_REST_M_S = 0.06
_ROLLING_STANCE = 0.56  # stance fraction for which a runner's foot roll is computed; it is played back faster
FOOT_FLAT = 0.13  # phase at which the foot is flat after heel strike
HEEL_RISE = 0.30  # phase at which the heel starts to leave the ground
# Limits of a foot's distance [m] and angle [rad] from its place at rest: to come to rest, and to remain at rest.
_SETTLED = 0.035, 0.30
_UNSETTLED = 0.085, 0.50


@njit(cache=True, nogil=True)
def follow(
    dt_s: float,
    velocity_share: float,
    turn_share: float,
    positions: FloatArray,
    headings: FloatArray,
    last_positions: FloatArray,
    last_headings: FloatArray,
    velocity: FloatArray,
    turn: FloatArray,
) -> FloatArray:
    """Smooth `(P, 2)` velocities and `(P,)` turn rates in place, by shares of their changes; `(P,)` speeds [m/s]."""
    speed = np.empty(len(turn))
    for person in range(len(turn)):
        x = velocity_share * ((positions[person, 0] - last_positions[person, 0]) / dt_s - velocity[person, 0])
        y = velocity_share * ((positions[person, 1] - last_positions[person, 1]) / dt_s - velocity[person, 1])
        share = min(_MAX_ACCELERATION_M_S2 * dt_s / max(math.sqrt(x * x + y * y), 1e-9), 1.0)
        velocity[person, 0] += x * share
        velocity[person, 1] += y * share
        rate = _wrapped(headings[person] - last_headings[person]) / dt_s
        turn[person] += turn_share * (rate - turn[person])
        x, y = velocity[person]
        speed[person] = math.sqrt(x * x + y * y)
    return speed


@njit(cache=True, nogil=True)
def advance_phase(
    dt_s: float,
    positions: FloatArray,
    headings: FloatArray,
    velocity: FloatArray,
    speed: FloatArray,
    stride_m: FloatArray,
    stance_fraction: FloatArray,
    mid_stance: FloatArray,
    toe_out: FloatArray,
    stand_half_m: FloatArray,
    foothold: FloatArray,
    foothold_yaw: FloatArray,
    phase: FloatArray,
    rate_hz: FloatArray,
    resting: BoolArray,
    in_stance: BoolArray,
    toe_off_phase: FloatArray,
) -> tuple[FloatArray, BoolArray]:
    """Advance phase, stride frequency, who is at rest, and which feet are in stance, all in place.

    The stride frequency is speed over stride length, higher for a foot that lags or is out of place.

    Returns:
        `(P, 2)` phases of the feet, and whether they have just landed.
    """
    phases, heel_strike = np.empty((len(phase), 2)), np.zeros((len(phase), 2), dtype=np.bool_)
    for person in range(len(phase)):
        stride, heading, settled = stride_m[person], headings[person], True
        lag, farthest, turned = -np.inf, 0.0, 0.0
        for side in range(2):
            sign, foot_phase = 1.0 - 2.0 * side, (phase[person] + 0.5 * side) % 1.0
            x, y = foothold[person, side, 0] - positions[person, 0], foothold[person, side, 1] - positions[person, 1]
            ahead = (x * velocity[person, 0] + y * velocity[person, 1]) / max(speed[person], 1e-6)
            behind = (mid_stance[person] - foot_phase) - ahead / stride
            lag = max(lag, behind * in_stance[person, side])
            aside = sign * stand_half_m[person]
            x, y = x - aside * -math.sin(heading), y - aside * math.cos(heading)
            farthest = max(farthest, math.sqrt(x * x + y * y))
            turned = max(turned, abs(_wrapped(foothold_yaw[person, side] - heading - toe_out[person, side])))
            settled = settled and in_stance[person, side]
        catch_up = 1.0 + _CATCH_UP_GAIN * min(max(lag - _TOLERATED_LAG, 0.0), 0.5)
        max_distance, max_angle = _UNSETTLED if resting[person] else _SETTLED
        settled = settled and farthest < max_distance and turned < max_angle
        resting[person] = speed[person] < AT_REST_M_S and settled
        slow = speed[person] / _SETTLING_BELOW_M_S
        least = _SETTLING_HZ * max(1.0 - slow * slow, 0.0)
        rate_hz[person] = 0.0 if resting[person] else max(speed[person] / stride * catch_up, least)
        before, phase[person] = phase[person], (phase[person] + rate_hz[person] * dt_s) % 1.0
        for side in range(2):
            foot_phase = phases[person, side] = (phase[person] + 0.5 * side) % 1.0
            stance = in_stance[person, side]
            toe_off = stance and foot_phase >= stance_fraction[person] and not resting[person]
            heel_strike[person, side] = not stance and foot_phase < (before + 0.5 * side) % 1.0
            if toe_off:
                toe_off_phase[person, side] = min(foot_phase, 0.9)
            in_stance[person, side] = (stance and not toe_off) or heel_strike[person, side]
    return phases, heel_strike


@njit(cache=True, nogil=True)
def next_footholds(
    phases: FloatArray,
    heel_strike: BoolArray,
    positions: FloatArray,
    headings: FloatArray,
    velocity: FloatArray,
    turn: FloatArray,
    rate_hz: FloatArray,
    running: FloatArray,
    half_m: FloatArray,
    toe_out: FloatArray,
    mid_stance: FloatArray,
    stance_fraction: FloatArray,
    toe_off_phase: FloatArray,
    foothold: FloatArray,
    foothold_yaw: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Footholds of feet in swing or just landed, and how far along their motion the feet are.

    The footholds of feet that have just landed are stored in `foothold` and `foothold_yaw`.

    Returns:
        `(P, 2, 2)` footholds [m] and their yaw `(P, 2)` [rad]; `(P, 2)` progress of a swing, from 0 at toe-off to 1 at
        heel strike; `(3, P, 2)` bases of `joint_trajectories.stance_pitch`'s powers, and of that of the lift in swing.
    """
    targets, yaws = np.empty_like(foothold), np.empty_like(foothold_yaw)
    progress, bases = np.empty_like(foothold_yaw), np.empty((3, *foothold_yaw.shape))
    for person in range(len(headings)):
        # A runner's stance is short: its foot rolls faster.
        faster = 1.0 + running[person] * (_ROLLING_STANCE / stance_fraction[person] - 1.0)
        for side in range(2):
            phase, sign = phases[person, side], 1.0 - 2.0 * side
            # A runner's foot is in the air before half the stride is over.
            landed = phase < (0.3 if running[person] > 0.0 else 0.5)
            until_mid_stance = mid_stance[person] + (0.0 if landed else 1.0) - phase
            time_s = min(until_mid_stance / max(rate_hz[person], 0.2), 1.5)
            # Along the chord of the arc that the body will walk.
            half_turn = 0.5 * min(max(turn[person] * time_s, -0.9), 0.9)
            x, y = velocity[person, 0] * time_s, velocity[person, 1] * time_s
            cos, sin = math.cos(half_turn), math.sin(half_turn)
            heading, aside = headings[person] + 2.0 * half_turn, sign * half_m[person]
            targets[person, side, 0] = positions[person, 0] + x * cos + y * -sin + aside * -math.sin(heading)
            targets[person, side, 1] = positions[person, 1] + x * sin + y * cos + aside * math.cos(heading)
            before = foothold_yaw[person, side]
            yaws[person, side] = before + _wrapped(heading + toe_out[person, side] - before)
            if heel_strike[person, side]:
                foothold[person, side], foothold_yaw[person, side] = targets[person, side], yaws[person, side]
            toe_off = toe_off_phase[person, side]
            progress[person, side] = max(phase - toe_off, 0.0) / (1.0 - toe_off)
            bases[0, person, side] = max(1.0 - phase * faster / FOOT_FLAT, 0.0)
            rising = (phase * faster - HEEL_RISE) / (stance_fraction[person] * faster - HEEL_RISE)
            bases[1, person, side] = min(max(rising, 0.0), 1.0)
            bases[2, person, side] = math.sin(math.pi * progress[person, side])
    return targets, yaws, progress, bases


@njit(cache=True, nogil=True)
def place_feet(
    in_stance: BoolArray,
    foothold: FloatArray,
    foothold_yaw: FloatArray,
    targets: FloatArray,
    target_yaws: FloatArray,
    progress: FloatArray,
    down: FloatArray,
    up: FloatArray,
    lift: FloatArray,
    swing: tuple[FloatArray, FloatArray, FloatArray],
    heel_strike_rad: FloatArray,
    toe_off_rad: FloatArray,
    clearance_m: FloatArray,
    ankle_m: FloatArray,
    soles_m: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Poses of the feet: on their footholds, or on the way from there to the targets.

    Args:
        in_stance: `(P, 2)`.
        foothold: `(P, 2, 2)` [m].
        foothold_yaw: `(P, 2)` [rad].
        targets: See `next_footholds`.
        target_yaws: See `next_footholds`.
        progress: See `next_footholds`.
        down: `(P, 2)` share of the pitch at heel strike that a foot in stance still has.
        up: `(P, 2)` share of the pitch at toe-off.
        lift: `(P, 2)` height of a foot in swing relative to its maximum.
        swing: Progress, travel and relative pitch of a swing, see `joint_trajectories`.
        heel_strike_rad: `(P,)` see `GaitParameters`.
        toe_off_rad: `(P,)`.
        clearance_m: `(P,)`.
        ankle_m: `(P,)` height above the sole.
        soles_m: `(P, 4)` see `Anatomy.sole_m`.

    Returns:
        Ankles `(P, 2, 3)` [m], yaw and pitch `(P, 2)` [rad].
    """
    ankles, yaw, pitch = np.empty((len(down), 2, 3)), np.empty(down.shape), np.empty(down.shape)
    times, travels, pitches = swing
    for person in range(len(down)):
        heel, toe = heel_strike_rad[person], toe_off_rad[person]
        for side in range(2):
            stands, share, raised = in_stance[person, side], 0.0, 0.0
            if stands:
                angle = heel * down[person, side] - toe * up[person, side]
            else:
                share = _interpolated(progress[person, side], times, travels)
                raised = lift[person, side] * clearance_m[person]
                angle = _interpolated(progress[person, side], times, pitches)
                angle *= toe if angle < 0.0 else heel
            pitch[person, side] = angle
            # A foot that rolls on the ground, as in `joint_trajectories.rolled_ankle`.
            centre, radius = soles_m[person, 0 if angle > 0.0 else 2], soles_m[person, 1 if angle > 0.0 else 3]
            above, cos, sin = ankle_m[person] - radius, math.cos(angle), math.sin(angle)
            ahead_m = centre - radius * angle - centre * cos - above * sin
            ankles[person, side, 2] = radius - centre * sin + above * cos + raised
            start = foothold_yaw[person, side]
            yaw[person, side] = start + share * (target_yaws[person, side] - start)
            x, y = foothold[person, side]
            x = x + share * (targets[person, side, 0] - x)
            y = y + share * (targets[person, side, 1] - y)
            ankles[person, side, 0] = x + ahead_m * math.cos(yaw[person, side])
            ankles[person, side, 1] = y + ahead_m * math.sin(yaw[person, side])
    return ankles, yaw, pitch


@njit(cache=True, nogil=True)
def _interpolated(x: float, xs: FloatArray, ys: FloatArray) -> float:
    """Value at x between tabulated points, as by `np.interp`."""
    low = np.searchsorted(xs, x, side="right") - 1
    if low < 0 or low >= len(xs) - 1 or x == xs[low]:
        return ys[min(max(low, 0), len(xs) - 1)]
    return (ys[low + 1] - ys[low]) / (xs[low + 1] - xs[low]) * (x - xs[low]) + ys[low]


@njit(cache=True, nogil=True)
def _wrapped(angle: float) -> float:
    """The angle in [-pi, pi) [rad]."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi
