"""The motion of walking people in one kernel: phase, footholds and feet, then the whole body above them.

A foot in stance stays at its foothold and only rolls. A foot in swing moves to its next foothold: the place below the
body in the middle of the next stance, predicted from the present velocity and turn rate. The gait phase advances with
the distance walked; near rest it also advances with time, until both feet stand side by side. Legs follow by inverse,
the rest by forward kinematics.

The sole is flat between two arcs. A pitched foot rolls on the heel's arc (toes up) or the toes' arc (heel up) without
slipping, so the point of contact of a foot in stance never moves over the ground.

Rotations of pelvis and trunk are those of Murray, Drought and Kory, Journal of Bone and Joint Surgery 46-A:335 (1964),
and Saunders, Inman and Eberhart, ibid. 35-A:543 (1953). Axes of parts are x forward, y left, z up.
"""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.compiled import kernel, part_of_kernel, record_type
from pftrack_sim.core.types import FloatArray

_PERSON_FIELDS = (
    # Body [m]: segments as in `Anatomy`, the arcs of the sole, shoulder joints in the torso's frame, hips on a seat.
    "height_m", "pelvis_m", "torso_m", "thigh_m", "shank_m", "upper_arm_m", "hip_half_m", "ankle_m",
    "heel_x", "heel_radius", "toe_x", "toe_radius", "shoulder_x", "shoulder_half_m", "shoulder_z", "seated_m",
    # Habits: roll of the upper arms outward [rad], their swing relative to other people's, forward lean [rad], rates
    # [rad/s] and phases of breathing and glances, ankles beside the line of progress walking and standing [m], and the
    # phase at which a steady walk starts.
    "arm_roll", "arm_swing", "lean", "breath_rate", "breath_phase", "glance_rate", "glance_phase",
    "walk_half_m", "stand_half_m", "start_phase",
    # Numbers of a `Posture`; 1 for running.
    "crouch", "bend", "look", "sit", "runs",
    # Where the body is to be at the end of the tick: x, y [m] and heading [rad].
    "to_x", "to_y", "to_heading",
    # The walk: place and heading, smoothed velocity [m/s] and turn rate [rad/s], fraction of the stride since the left
    # heel strike, stride frequency, share of running, and 1 at rest.
    "x", "y", "heading", "velocity_x", "velocity_y", "speed", "turn", "phase", "rate_hz", "running", "resting",
    # The gait at this speed: stride length (two steps), share of stance, toes-up angle at heel strike and heel-up angle
    # at toe-off [rad], lowest and highest hips, height of the sole in mid-swing, and lateral amplitude of the pelvis
    # [m], amplitude of the rotations of pelvis, trunk and arms (1 at natural speed), phase at which the body is above
    # the ankle of the flat foot, and distance of the ankles from the line of progress [m].
    "stride_m", "stance_fraction", "heel_strike_rad", "toe_off_rad", "hip_low_m", "hip_high_m", "clearance_m",
    "sway_m", "amplitude", "mid_stance", "half_m",
)  # fmt: skip
PERSON = record_type([(name, "f8") for name in _PERSON_FIELDS])
"""One person: body, habits, posture, walk, and the gait at the present speed."""

FOOT = record_type(
    [
        ("toe_out", "f8"),  # yaw of the foot relative to the body [rad]
        ("in_stance", "?"),
        ("toe_off_phase", "f8"),  # at which the foot left the ground
        ("foothold_x", "f8"),  # where the foot stands, or stood before its swing [m]
        ("foothold_y", "f8"),
        ("foothold_yaw", "f8"),
        ("ankle_x", "f8"),
        ("ankle_y", "f8"),
        ("ankle_z", "f8"),
        ("yaw", "f8"),
        ("pitch", "f8"),  # toes up
    ]
)
"""One foot."""

ARM = record_type([(name, "f8") for name in ("share", "shoulder", "elbow", "outward", "forearm")])
"""An `Arm`; the share of an arm that swings is 0."""

_PART_FIELDS = (
    "x", "y", "z", "forward_x", "left_x", "up_x", "forward_y", "left_y", "up_y", "forward_z", "left_z", "up_z",
)  # fmt: skip
PART = record_type([(name, "f8") for name in _PART_FIELDS])
"""A part of the body: its place [m] and the directions of its axes, which are columns of its rotation."""

Records: TypeAlias = NDArray[Any]

# Rows of `person.PARTS`; of arms and legs the left one, the right one follows.
_PELVIS, _TORSO, _HEAD, _UPPER_ARM, _FOREARM, _THIGH, _SHANK, _FOOT, PARTS = 0, 1, 2, 3, 5, 7, 9, 11, 13

# The walk.
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
_MAX_EXTENSION = 0.9982  # longest reach of a leg relative to the sum of its links: knees never lock
# Below a half there are flight phases (Novacheck, "The biomechanics of running", Gait and Posture 7:77, 1998: 39 % at
# 3.2 m/s).
_RUN_STANCE_FRACTION = 0.37

# The body.
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
def move_people(
    dt_s: float,
    time_s: float,
    people: Records,
    feet: Records,
    arms: Records,
    swing: FloatArray,
    parts: Records,
) -> None:
    """Move `P` people by a tick and pose their bodies; a tick of length 0 starts them in a steady walk or at rest.

    Args:
        dt_s: Length of the tick.
        time_s: Of breathing and glances.
        people: `(P,)` records of `PERSON`.
        feet: `(P, 2)` records of `FOOT`, the left one first.
        arms: `(P, 2)` records of `ARM`.
        swing: `(S, 2)` trajectory of a foot in swing, see `curves.SWING`.
        parts: `(P, 13)` records of `PART`, set.
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
        _place_feet(person, feet, index, swing)
        _pose_body(person, feet, arms, parts, index, time_s)


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
    speed, leg_m = min(person.speed, _MAX_SPEED_M_S), person.thigh_m + person.shank_m
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
    reach_m = 0.9995 * _MAX_EXTENSION * leg_m
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
    travel = min(max(0.0111 + 0.0232 * speed, 0.0), 0.075) * moving
    person.sway_m = min(max(0.0471 - 0.0172 * speed, 0.012), 0.035) * moving
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
def _pose_body(person: Any, feet: Records, arms: Records, parts: Records, index: int, time_s: float) -> None:
    """Set the parts of a person above placed feet."""
    pelvis, torso, head = parts[index, _PELVIS], parts[index, _TORSO], parts[index, _HEAD]
    crouch, bend, sit, heading = person.crouch, person.bend, person.sit, person.heading
    # The pelvis turns with the advancing leg and drops on the side of the leg in swing; the torso counter-rotates.
    stride = _TURN * person.phase
    twist = _PELVIS_YAW * person.amplitude * math.cos(stride)
    drop = _PELVIS_ROLL * person.amplitude * math.cos(stride - _TURN * 0.15)
    # At rest, the weight is on one leg, over which the hip is higher.
    leaning = math.sin(person.glance_phase) * max(1.0 - 2.0 * person.amplitude, 0.0) * (1.0 - sit) * (1.0 - crouch)
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
    sway = person.sway_m * math.cos(_TURN * (person.phase - 0.30)) + _RESTING_SHIFT_M * leaning
    cos, sin = math.cos(heading), math.sin(heading)
    pelvis.x, pelvis.y, pelvis.z = person.x - sway * sin - back * cos, person.y + sway * cos - back * sin, 0.0
    for side in range(2):
        _attach(pelvis, parts[index, _THIGH + side], 0.0, (1.0 - 2.0 * side) * person.hip_half_m, 0.0)
    leg_m = person.thigh_m + person.shank_m
    height_m = _upright_height(person) - (_CROUCH_DEPTH * crouch + _BEND_DEPTH * bend) * leg_m
    height_m += sit * (person.seated_m - height_m)
    for side in range(2):
        # Limited by the reach of both legs: a smooth minimum.
        foot, thigh = feet[index, side], parts[index, _THIGH + side]
        x, y, reach_m = foot.ankle_x - thigh.x, foot.ankle_y - thigh.y, _MAX_EXTENSION * leg_m
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
        _bend_leg(thigh, shank, sole, 0.5 * (foot.yaw + heading), person.thigh_m, person.shank_m)

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
def _upright_height(person: Any) -> float:
    """Height of an upright person's pelvis [m] by the published vertical travel."""
    travel = 0.5 - 0.5 * math.cos(2.0 * _TURN * (person.phase - 0.04))
    # Runners are lowest in mid-stance and highest in the middle of the flight phase.
    running_travel = 0.5 - 0.5 * math.cos(2.0 * _TURN * (person.phase - 0.5 * _RUN_STANCE_FRACTION))
    travel += person.running * (running_travel - travel)
    return person.hip_low_m + (person.hip_high_m - person.hip_low_m) * travel


@part_of_kernel
def _bend_leg(thigh: Any, shank: Any, foot: Any, knee_yaw: float, thigh_m: float, shank_m: float) -> None:
    """Set the knee and the rotations of thigh and shank from hip and ankle: z up along the bone, x to the bent knee.

    The knee bends towards `knee_yaw`; a leg that does not reach points at the ankle, extended.
    """
    x, y, z = foot.x - thigh.x, foot.y - thigh.y, foot.z - thigh.z
    distance, length = math.sqrt(x * x + y * y + z * z), thigh_m + shank_m
    reach = min(max(distance, 0.35 * length), _MAX_EXTENSION * length)
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
    shank.x, shank.y, shank.z = thigh.x + thigh_x, thigh.y + thigh_y, thigh.z + thigh_z
    _set_bone(thigh, left_x, left_y, left_z, thigh_x, thigh_y, thigh_z)
    _set_bone(shank, left_x, left_y, left_z, reach * x - thigh_x, reach * y - thigh_y, reach * z - thigh_z)


@part_of_kernel
def _set_bone(part: Any, left_x: float, left_y: float, left_z: float, x: float, y: float, z: float) -> None:
    """Set the rotation of a part whose y axis is to the left and which hangs along a vector."""
    length = -math.sqrt(x * x + y * y + z * z)
    x, y, z = x / length, y / length, z / length
    part.forward_x, part.forward_y = left_y * z - left_z * y, left_z * x - left_x * z
    part.forward_z = left_x * y - left_y * x
    part.left_x, part.left_y, part.left_z = left_x, left_y, left_z
    part.up_x, part.up_y, part.up_z = x, y, z
