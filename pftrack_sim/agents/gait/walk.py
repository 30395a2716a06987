"""The walk of people in one kernel: phase of the gait, footholds and feet.

A foot in stance stays at its foothold and only rolls. A foot in swing moves to its next foothold: the place below the
body in the middle of the next stance, predicted from the present velocity and turn rate. The gait phase advances with
the distance walked; near rest it also advances with time, until both feet stand side by side.

The sole is flat between two arcs. A pitched foot rolls on the heel's arc (toes up) or the toes' arc (heel up) without
slipping, so the point of contact of a foot in stance never moves over the ground.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pftrack_sim.agents.gait.records import Records
from pftrack_sim.core.compiled import kernel, part_of_kernel
from pftrack_sim.core.types import FloatArray

_TURN = 2.0 * math.pi
_AT_REST_M_S = 0.06
_VELOCITY_TIME_CONSTANT_S = 0.07
_TURN_TIME_CONSTANT_S = 0.12
_MAX_ACCELERATION_M_S2 = 3.5  # of the smoothed velocity: feet do not jump when the body stops at once
_RUN_TRANSITION_S = 0.5  # about two steps
_CATCH_UP_GAIN = 2.5  # relative increase of the stride frequency per phase by which a foot lags, as at a start
_TOLERATED_LAG = 0.06
_SETTLING_HZ = 0.85  # stride frequency at which feet are brought together near rest
_SETTLING_BELOW_M_S = 0.28
# Limits of a foot's distance [m] and angle [rad] from its place at rest: to come to rest, and to remain at rest.
_SETTLED_M, _SETTLED_RAD = 0.035, 0.30
_UNSETTLED_M, _UNSETTLED_RAD = 0.085, 0.50

# Feet.
_FOOT_FLAT, _HEEL_RISE = 0.13, 0.30  # phases at which the foot is flat, and the heel starts to rise
_DOWN_POWER, _UP_POWER = 1.5, 2.7  # of the phases after heel strike and before toe-off
_ROLLING_STANCE = 0.56  # stance fraction for which a runner's foot roll is computed; it is played back faster
_LIFT_POWER = 1.2  # of a sine over the swing
_MID_STANCE = 0.245
_MAX_SPEED_M_S = 2.6  # of walking
_MAX_STATURES_S = 1.85  # and in statures per second, which limits children: beyond it, they take more steps
_ADULT_M = 1.48  # Children sway and bob less, by their stature
# Below a half there are flight phases (Novacheck, "The biomechanics of running", Gait and Posture 7:77, 1998: 39 % at
# 3.2 m/s).
_RUN_STANCE_FRACTION = 0.37


def stride_length(speed_m_s: float, height_m: float) -> float:
    """Stride length (two steps) [m].

    Stride frequency grows with the 0.57th power of speed in statures per second, 64.8 strides a minute at one (Grieve
    and Gear, Ergonomics 9:379, 1966; Grieve, Physiotherapy 54:283, 1968), so length grows with its 0.43rd power.
    """
    return height_m * (60.0 / 64.8) * max(speed_m_s / height_m, 1e-4) ** 0.43


def rolled_ankle(pitch: Any, ankle_m: Any, centre_x: Any, radius_m: Any) -> tuple[Any, Any]:
    """Ankle of a foot that rolls on an arc of its sole: x ahead of the flat foot's ankle, and height [m].

    `pitch` is positive with toes up [rad]; `ankle_m` is the height of the ankle above the sole, `centre_x` that of the
    arc's centre ahead of the ankle. Numbers, or arrays of one shape.
    """
    cos, sin, above = np.cos(pitch), np.sin(pitch), ankle_m - radius_m
    return centre_x - radius_m * pitch - centre_x * cos - above * sin, radius_m - centre_x * sin + above * cos


_stride_length, _rolled_ankle = part_of_kernel(stride_length), part_of_kernel(rolled_ankle)


@kernel
def walk(dt_s: float, people: Records, feet: Records, swing: FloatArray) -> None:
    """Move `P` people and their feet by a tick; a tick of length 0 starts them in a steady walk or at rest.

    Args:
        dt_s: Length of the tick.
        people: `(P,)` records of `PERSON`.
        feet: `(P, 2)` records of `FOOT`, the left one first.
        swing: `(S, 2)` trajectory of a foot in swing, see `curves.SWING`.
    """
    for index in range(len(people)):
        person = people[index]
        if dt_s > 0.0:
            _follow(person, dt_s)
            _set_gait(person, swing)
            _advance_feet(person, feet, index, dt_s)
        else:
            _set_gait(person, swing)
            _start(person, feet, index)
        _set_hips(person)
        _place_feet(person, feet, index, swing)


@part_of_kernel
def _start(person: Any, feet: Records, index: int) -> None:
    """Footholds of a steady walk up to now; at rest both feet are in stance: the right one has just landed."""
    resting = person.speed < _AT_REST_M_S
    person.resting, person.phase = (1.0, 0.55) if resting else (0.0, person.start_phase)
    person.rate_hz = max(person.speed / person.stride_m, 0.2)
    for side in range(2):
        foot, phase = feet[index, side], (person.phase + 0.5 * side) % 1.0
        foot.in_stance, foot.toe_off_phase = resting or phase < person.stance_fraction, person.stance_fraction
        strides, foot.foothold_yaw = 0.0 if resting else person.mid_stance - phase, person.heading
        foot.foothold_x, foot.foothold_y, foot.foothold_yaw = _foothold(person, foot, side, strides)


@part_of_kernel
def _follow(person: Any, dt_s: float) -> None:
    """Move to the place at the end of the tick; smooths velocity and turn rate."""
    step = dt_s / _RUN_TRANSITION_S
    person.running = min(max(person.running + (step if person.runs > 0.0 else -step), 0.0), 1.0)
    share = -math.expm1(-dt_s / _VELOCITY_TIME_CONSTANT_S)
    x = share * ((person.to_x - person.x) / dt_s - person.velocity_x)
    y = share * ((person.to_y - person.y) / dt_s - person.velocity_y)
    limit = min(_MAX_ACCELERATION_M_S2 * dt_s / max(math.sqrt(x * x + y * y), 1e-9), 1.0)
    velocity_x, velocity_y = person.velocity_x + limit * x, person.velocity_y + limit * y
    person.velocity_x, person.velocity_y = velocity_x, velocity_y
    person.speed = math.sqrt(velocity_x * velocity_x + velocity_y * velocity_y)
    rate = _wrapped(person.to_heading - person.heading) / dt_s
    person.turn -= math.expm1(-dt_s / _TURN_TIME_CONSTANT_S) * (rate - person.turn)
    person.x, person.y, person.heading = person.to_x, person.to_y, person.to_heading


@part_of_kernel
def _set_gait(person: Any, swing: FloatArray) -> None:
    """Set the parameters of the gait at the present speed, between walking and running."""
    speed = min(person.speed, _MAX_SPEED_M_S, _MAX_STATURES_S * person.height_m)
    small, leg_m = min(person.height_m / _ADULT_M, 1.0), person.thigh_m + person.shank_m
    stride_m = _stride_length(speed, person.height_m)
    # Linear fit to Murray et al., American Journal of Physical Medicine 45:8 (1966), and Murray et al., Acta
    # Orthopaedica Scandinavica 55 (1984): 62 % at natural speed.
    stance = min(max(0.70 - 0.06 * speed, 0.55), 0.70)
    moving = min(speed / 0.4, 1.0)
    moving *= moving * (3.0 - 2.0 * moving)
    # The published 18 deg at natural speed, less when slower; and about 57 deg, less than the published 67 deg, because
    # the toes of the shoe do not bend.
    heel_strike = swing[-1, 1] * 1.25 * (1.0 - math.exp(-speed / 0.8))
    toe_off = -swing[0, 1] * 0.97 * (1.0 - math.exp(-speed / 0.6))
    # At heel strike the feet are farthest apart; the hips must be low enough for both legs to reach the ground.
    reach_m = 0.9995 * person.reach * leg_m
    leading_x, leading_z = _rolled_ankle(heel_strike, person.ankle_m, person.heel_x, person.heel_radius)
    leading_x += _MID_STANCE * stride_m
    pitch = _stance_pitch(0.5, stance, heel_strike, toe_off)
    trailing_x, trailing_z = _rolled_ankle(pitch, person.ankle_m, person.toe_x, person.toe_radius)
    trailing_x = (0.5 - _MID_STANCE) * stride_m - trailing_x
    leading_z += math.sqrt(max(reach_m * reach_m - leading_x * leading_x, 0.0))
    trailing_z += math.sqrt(max(reach_m * reach_m - trailing_x * trailing_x, 0.0))
    upright = person.ankle_m + 0.9976 * leg_m
    low = min(leading_z, trailing_z, upright)
    # Orendurff et al., Journal of Rehabilitation Research and Development 41:829 (2004), at 0.7 m/s and 1.6 m/s: 7.0 cm
    # and 3.9 cm of lateral, 2.7 cm and 4.8 cm of vertical travel of the trunk, peak to peak.
    travel = min(max(0.0111 + 0.0232 * speed, 0.0), 0.075) * moving * small
    person.sway_m = min(max(0.0471 - 0.0172 * speed, 0.012), 0.035) * moving * small
    person.hip_low_m, person.hip_high_m = low, min(low + max(travel, 0.80 * (upright - low)), upright)
    person.stride_m, person.stance_fraction, person.mid_stance = stride_m, stance, _MID_STANCE
    person.heel_strike_rad, person.toe_off_rad = heel_strike, toe_off
    # Slow walkers hardly pitch their feet and lift them higher instead.
    person.clearance_m = person.height_m * (0.011 + 0.014 * math.exp(-speed / 0.4))
    person.amplitude = stride_m / _stride_length(1.3, person.height_m) * moving
    slow = person.speed / 0.45
    person.half_m = person.walk_half_m + (person.stand_half_m - person.walk_half_m) * math.exp(-slow * slow)
    if person.running > 0.0:
        _blend_running(person, leg_m)


@part_of_kernel
def _blend_running(person: Any, leg_m: float) -> None:
    """Blend the gait with running: 1.25 to 1.5 strides a second (Novacheck 1998), landing on bent knees."""
    stride_m, share = person.speed / (1.22 + 0.06 * person.speed), person.running
    reach_m = 0.5 * _RUN_STANCE_FRACTION * stride_m
    bent_m, half_m = 0.965 * leg_m, 0.55 * reach_m
    low = person.ankle_m + math.sqrt(max(bent_m * bent_m - half_m * half_m, 0.25 * leg_m * leg_m))
    person.stride_m += share * (stride_m - person.stride_m)
    person.hip_low_m += share * (low - person.hip_low_m)
    person.hip_high_m += share * (low + 0.07 - person.hip_high_m)
    person.stance_fraction += share * (_RUN_STANCE_FRACTION - person.stance_fraction)
    person.mid_stance += share * (0.5 * _RUN_STANCE_FRACTION - person.mid_stance)
    person.heel_strike_rad += share * (0.10 - person.heel_strike_rad)
    person.toe_off_rad += share * (0.85 - person.toe_off_rad)
    person.clearance_m += share * (0.10 * person.height_m - person.clearance_m)
    person.sway_m += share * (0.008 - person.sway_m)
    person.amplitude += share * (1.35 - person.amplitude)


@part_of_kernel
def _stance_pitch(phase: float, stance_fraction: float, heel_strike_rad: float, toe_off_rad: float) -> float:
    """Pitch of a foot in stance, toes up positive [rad]: down from heel strike, flat, heel up to toe-off."""
    down = max(1.0 - phase / _FOOT_FLAT, 0.0)
    up = min(max((phase - _HEEL_RISE) / (stance_fraction - _HEEL_RISE), 0.0), 1.0)
    return heel_strike_rad * down**_DOWN_POWER - toe_off_rad * up**_UP_POWER


@part_of_kernel
def _advance_feet(person: Any, feet: Records, index: int, dt_s: float) -> None:
    """Advance the gait phase, and let feet strike and leave the ground.

    The stride frequency is speed over stride length, higher for a foot that lags or is out of place.
    """
    settled, lag, farthest, turned = True, -1.0, 0.0, 0.0
    for side in range(2):
        foot, sign = feet[index, side], 1.0 - 2.0 * side
        x, y = foot.foothold_x - person.x, foot.foothold_y - person.y
        ahead = (x * person.velocity_x + y * person.velocity_y) / max(person.speed, 1e-6)
        behind = person.mid_stance - (person.phase + 0.5 * side) % 1.0 - ahead / person.stride_m
        lag = max(lag, behind if foot.in_stance else 0.0)
        x += sign * person.stand_half_m * math.sin(person.heading)
        y -= sign * person.stand_half_m * math.cos(person.heading)
        farthest = max(farthest, math.sqrt(x * x + y * y))
        turned = max(turned, abs(_wrapped(foot.foothold_yaw - person.heading - foot.toe_out)))
        settled = settled and foot.in_stance
    if person.resting > 0.0:
        settled = settled and farthest < _UNSETTLED_M and turned < _UNSETTLED_RAD
    else:
        settled = settled and farthest < _SETTLED_M and turned < _SETTLED_RAD
    resting = person.speed < _AT_REST_M_S and settled
    slow = person.speed / _SETTLING_BELOW_M_S
    catch_up = 1.0 + _CATCH_UP_GAIN * min(max(lag - _TOLERATED_LAG, 0.0), 0.5)
    rate_hz = max(person.speed / person.stride_m * catch_up, _SETTLING_HZ * max(1.0 - slow * slow, 0.0))
    person.resting, person.rate_hz = (1.0, 0.0) if resting else (0.0, rate_hz)
    before = person.phase
    person.phase = (before + person.rate_hz * dt_s) % 1.0
    for side in range(2):
        foot, phase = feet[index, side], (person.phase + 0.5 * side) % 1.0
        if foot.in_stance:
            if phase >= person.stance_fraction and not resting:
                foot.in_stance, foot.toe_off_phase = False, min(phase, 0.9)
        elif phase < (before + 0.5 * side) % 1.0:
            foot.in_stance = True
            foot.foothold_x, foot.foothold_y, foot.foothold_yaw = _next_foothold(person, foot, side)


@part_of_kernel
def _place_feet(person: Any, feet: Records, index: int, swing: FloatArray) -> None:
    """Set the poses of the feet: on their footholds, or on the way from there to the next."""
    # A runner's stance is short: its foot rolls faster.
    faster = 1.0 + person.running * (_ROLLING_STANCE / person.stance_fraction - 1.0)
    for side in range(2):
        foot = feet[index, side]
        phase = (person.phase + 0.5 * side) % 1.0
        x, y, yaw, lift_m = foot.foothold_x, foot.foothold_y, foot.foothold_yaw, 0.0
        if foot.in_stance:
            stance = person.stance_fraction * faster
            pitch = _stance_pitch(phase * faster, stance, person.heel_strike_rad, person.toe_off_rad)
        else:
            progress = max(phase - foot.toe_off_phase, 0.0) / (1.0 - foot.toe_off_phase)
            row = progress * (len(swing) - 1)
            below = min(int(row), len(swing) - 2)
            travel = swing[below, 0] + (row - below) * (swing[below + 1, 0] - swing[below, 0])
            pitch = swing[below, 1] + (row - below) * (swing[below + 1, 1] - swing[below, 1])
            pitch *= -person.toe_off_rad / swing[0, 1] if pitch < 0.0 else person.heel_strike_rad / swing[-1, 1]
            lift_m = person.clearance_m * math.sin(math.pi * progress) ** _LIFT_POWER
            next_x, next_y, next_yaw = _next_foothold(person, foot, side)
            x, y, yaw = x + travel * (next_x - x), y + travel * (next_y - y), yaw + travel * (next_yaw - yaw)
        centre_x = person.heel_x if pitch > 0.0 else person.toe_x
        radius_m = person.heel_radius if pitch > 0.0 else person.toe_radius
        ahead, height_m = _rolled_ankle(pitch, person.ankle_m, centre_x, radius_m)
        foot.ankle_x, foot.ankle_y = x + ahead * math.cos(yaw), y + ahead * math.sin(yaw)
        foot.ankle_z, foot.yaw, foot.pitch = height_m + lift_m, yaw, pitch


@part_of_kernel
def _next_foothold(person: Any, foot: Any, side: int) -> tuple[float, float, float]:
    """Foothold of the stance that follows or has just begun."""
    phase = (person.phase + 0.5 * side) % 1.0
    # A runner's foot is in the air before half the stride is over.
    landed = phase < (0.3 if person.running > 0.0 else 0.5)
    return _foothold(person, foot, side, person.mid_stance + (0.0 if landed else 1.0) - phase)


@part_of_kernel
def _foothold(person: Any, foot: Any, side: int, strides: float) -> tuple[float, float, float]:
    """x, y [m] and yaw [rad] of the foothold in the middle of the stance that many strides ahead."""
    time_s = min(strides / max(person.rate_hz, 0.2), 1.5)
    # Along the chord of the arc that the body will walk.
    half_turn = 0.5 * min(max(person.turn * time_s, -0.9), 0.9)
    along_x, along_y = person.velocity_x * time_s, person.velocity_y * time_s
    cos, sin = math.cos(half_turn), math.sin(half_turn)
    heading, aside = person.heading + 2.0 * half_turn, (1.0 - 2.0 * side) * person.half_m
    x = person.x + along_x * cos - along_y * sin - aside * math.sin(heading)
    y = person.y + along_x * sin + along_y * cos + aside * math.cos(heading)
    return x, y, foot.foothold_yaw + _wrapped(heading + foot.toe_out - foot.foothold_yaw)


@part_of_kernel
def _wrapped(angle: float) -> float:
    """The angle in [-pi, pi) [rad]."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


@part_of_kernel
def _set_hips(person: Any) -> None:
    """Set the height of an upright person's hips by the published vertical travel."""
    travel = 0.5 - 0.5 * math.cos(2.0 * _TURN * (person.phase - 0.04))
    # Runners are lowest in mid-stance and highest in the middle of the flight phase.
    running_travel = 0.5 - 0.5 * math.cos(2.0 * _TURN * (person.phase - 0.5 * _RUN_STANCE_FRACTION))
    travel += person.running * (running_travel - travel)
    person.hip_m = person.hip_low_m + (person.hip_high_m - person.hip_low_m) * travel
