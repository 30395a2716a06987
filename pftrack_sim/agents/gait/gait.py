"""Gait of people who move over the ground: phase, footholds and foot poses, and with `body` the whole body.

A foot in stance stays at its foothold and only rolls. A foot in swing moves to its next foothold: the place below the
body in the middle of the next stance, predicted from the present velocity and turn rate. The gait phase advances with
the distance walked; near rest it also advances with time, until both feet stand side by side.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.agents.gait.body import ARM, BODY, PARTS, PLAIN, POSTURE, Posture, pose_bodies, quaternions
from pftrack_sim.agents.gait.trajectories import (
    DOWN_POWER,
    FOOT_FLAT,
    HEEL_RISE,
    SWING,
    UP_POWER,
    parameter_table,
    parameters_at,
)
from pftrack_sim.core.compiled import kernel, part_of_kernel, record_type
from pftrack_sim.core.types import BoolArray, FloatArray
from pftrack_sim.scene.people.anatomy import Anatomy
from pftrack_sim.scene.places.seats import SEAT_M

WALK = record_type(
    [
        ("x", "f8"),  # place of the body on the ground [m]
        ("y", "f8"),
        ("heading", "f8"),  # [rad]
        ("velocity_x", "f8"),  # smoothed [m/s]
        ("velocity_y", "f8"),
        ("speed", "f8"),
        ("turn", "f8"),  # smoothed turn rate [rad/s]
        ("phase", "f8"),  # fraction of the stride since the left heel strike
        ("rate_hz", "f8"),  # stride frequency
        ("running", "f8"),  # from 0, walking, to 1
        ("resting", "?"),
        ("half_m", "f8"),  # distance of the ankles from the line of progress, at the present speed
        ("stand_half_m", "f8"),  # at rest
        ("ankle_m", "f8"),  # height of the ankle above the sole
        ("heel_x", "f8"),  # the sole's arcs, see `Anatomy.sole_m` [m]
        ("heel_radius", "f8"),
        ("toe_x", "f8"),
        ("toe_radius", "f8"),
    ]
)
"""How one person walks."""

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

_AT_REST_M_S = 0.06
_VELOCITY_TIME_CONSTANT_S = 0.07
_TURN_TIME_CONSTANT_S = 0.12
_MAX_ACCELERATION_M_S2 = 3.5  # of the smoothed velocity: feet do not jump when the body stops at once
_CATCH_UP_GAIN = 2.5  # relative increase of the stride frequency per phase by which a foot lags, as at a start
_TOLERATED_LAG = 0.06
_SETTLING_HZ = 0.85  # stride frequency at which feet are brought together near rest
_SETTLING_BELOW_M_S = 0.28
_ROLLING_STANCE = 0.56  # stance fraction for which a runner's foot roll is computed; it is played back faster
_LIFT_POWER = 1.2  # of a sine over the swing
# Limits of a foot's distance [m] and angle [rad] from its place at rest: to come to rest, and to remain at rest.
_SETTLED_M, _SETTLED_RAD = 0.035, 0.30
_UNSETTLED_M, _UNSETTLED_RAD = 0.085, 0.50
_SIT_HIP = 0.071  # hip joints above a seat, in statures: thighs and buttocks press 5 mm into it
_SHOULDERS_BACK = 0.008  # shoulder joints behind the base of the neck, in statures
_RUN_TRANSITION_S = 0.5  # about two steps
_SIDES = np.array([1.0, -1.0])  # sign of y of the left and the right side


class Gait:
    """Walking, running, turning, crouching, bending, sitting and standing of `P` people.

    Args:
        anatomies: Their bodies.
        rngs: One generator per person, for individual step width, arm swing, posture and start phase.
        copies: How many times each person is there, with equal draws.

    Attributes:
        start_phase: `(P,)` gait phase with which a steady walk starts; may be set before `reset`.
    """

    def __init__(self, anatomies: Sequence[Anatomy], rngs: Sequence[np.random.Generator], copies: int = 1) -> None:
        normal = np.array([rng.normal(size=6) for rng in rngs]).reshape(-1, 6).clip(-2.0, 2.0).repeat(copies, axis=0).T
        uniform = np.array([rng.random(4) for rng in rngs]).reshape(-1, 4).repeat(copies, axis=0).T
        self._anatomies = tuple(one for one in anatomies for _ in range(copies))
        count = len(self._anatomies)
        self._tables = np.stack([parameter_table(one) for one in self._anatomies])
        self._bodies, self._arms = np.zeros(count, BODY), np.zeros((count, 2), ARM)
        self._walk, self._feet = np.zeros(count, WALK), np.zeros((count, 2), FOOT)
        body, walk = self._bodies, self._walk
        for person, one in enumerate(self._anatomies):
            for name in ("pelvis_m", "torso_m", "thigh_m", "shank_m", "upper_arm_m", "hip_half_m", "shoulder_half_m"):
                body[name][person] = getattr(one, name)
            walk["ankle_m"][person] = one.ankle_m
            for name, value in zip(("heel_x", "heel_radius", "toe_x", "toe_radius"), one.sole_m, strict=True):
                walk[name][person] = value
        height, girth, drop = np.array([(one.height_m, one.girth, one.shoulder_drop_m) for one in self._anatomies]).T
        body["shoulder_x"], body["shoulder_z"] = -_SHOULDERS_BACK * height, body["torso_m"] - drop
        body["seated_m"] = SEAT_M + _SIT_HIP * height
        # Arms hang wider with larger girth.
        body["arm_roll"] = np.radians(6.5 + 1.2 * normal[5]) + 0.3 * np.maximum(girth - 1.0, 0.0)
        body["arm_swing"], body["lean"] = 1.0 + 0.18 * normal[3], np.radians(1.5 + 1.2 * normal[4])
        body["breath_rate"] = 2.0 * np.pi * (0.24 + 0.08 * uniform[1])
        body["glance_rate"] = 2.0 * np.pi * (0.10 + 0.06 * uniform[2])
        body["breath_phase"], body["glance_phase"] = 2.0 * np.pi * uniform[2:4]
        self._feet["toe_out"] = np.radians(7.0 + 2.5 * normal[0])[:, None] * _SIDES
        self._walk_half_m = body["hip_half_m"] * (0.56 + 0.08 * normal[1])
        walk["stand_half_m"] = body["hip_half_m"] * (1.02 + 0.08 * normal[2])
        self.start_phase = uniform[0]
        self.reset(np.zeros((count, 2)), np.zeros(count), np.zeros(count))

    @property
    def phase(self) -> FloatArray:
        """`(P,)` fraction of the stride since the left heel strike."""
        return self._walk["phase"].copy()

    @property
    def in_stance(self) -> BoolArray:
        """`(P, 2)` whether the left and the right foot are on the ground."""
        return self._feet["in_stance"].copy()

    def reset(
        self,
        positions_m: ArrayLike,
        headings_rad: ArrayLike,
        speeds_m_s: ArrayLike,
        postures: Sequence[Posture] | None = None,
    ) -> None:
        """Start in a steady walk, or at rest, at `(P, 2)` positions, `(P,)` headings and forward speeds."""
        self._time_s = 0.0
        places, headings = np.asarray(positions_m, dtype=float), np.asarray(headings_rad, dtype=float)
        speeds = np.asarray(speeds_m_s, dtype=float)
        self._set_postures(postures or (PLAIN,) * len(headings))
        walk, feet = self._walk, self._feet
        walk["x"], walk["y"], walk["heading"], walk["speed"] = places[:, 0], places[:, 1], headings, np.abs(speeds)
        forward_x, forward_y = np.cos(headings), np.sin(headings)
        walk["velocity_x"], walk["velocity_y"] = forward_x * speeds, forward_y * speeds
        walk["turn"] = walk["running"] = 0.0
        self._set_speed()
        resting = walk["speed"] < _AT_REST_M_S
        walk["resting"], walk["rate_hz"] = resting, np.maximum(walk["speed"] / self._parameters["stride_m"], 0.2)
        # At rest both feet are in stance: the right one has just landed.
        walk["phase"] = np.where(resting, 0.55, self.start_phase)
        phases = (walk["phase"][:, None] + (0.0, 0.5)) % 1.0
        stance_fraction = self._parameters["stance_fraction"][:, None]
        feet["in_stance"] = (phases < stance_fraction) | resting[:, None]
        feet["toe_off_phase"] = stance_fraction
        # Footholds of a steady walk up to now.
        along = (self._parameters["mid_stance"][:, None] - phases) * self._parameters["stride_m"][:, None]
        along[resting] = 0.0
        aside = _SIDES * walk["half_m"][:, None]
        feet["foothold_x"] = (walk["x"] + along.T * forward_x - aside.T * forward_y).T
        feet["foothold_y"] = (walk["y"] + along.T * forward_y + aside.T * forward_x).T
        feet["foothold_yaw"] = headings[:, None] + feet["toe_out"]
        self._pose()

    def advance(
        self, dt_s: float, positions_m: ArrayLike, headings_rad: ArrayLike, postures: Sequence[Posture]
    ) -> None:
        """Follow the people to `(P, 2)` positions on the ground and `(P,)` headings, which need not be wrapped."""
        self._time_s += dt_s
        if postures != self._postures:
            self._set_postures(postures)
        step = np.where(self._running, dt_s, -dt_s) / _RUN_TRANSITION_S
        self._walk["running"] = np.clip(self._walk["running"] + step, 0.0, 1.0)
        _follow_bodies(self._walk, dt_s, np.asarray(positions_m, dtype=float), np.asarray(headings_rad, dtype=float))
        self._set_speed()
        _advance_feet(dt_s, self._walk, self._parameters, self._feet)
        self._pose()

    def part_poses(self) -> tuple[FloatArray, FloatArray]:
        """`(P, 13, 3)` positions [m] and `(P, 13, 3, 3)` rotations, in the order of `person.PARTS`."""
        return self._positions.reshape(-1, PARTS, 3), self._rotations.reshape(-1, PARTS, 3, 3)

    def poses(self) -> tuple[FloatArray, FloatArray]:
        """`(P, 13, 3)` positions [m] and `(P, 13, 4)` quaternions w, x, y, z."""
        return self._positions.reshape(-1, PARTS, 3), quaternions(self._rotations).reshape(-1, PARTS, 4)

    def root_poses(self) -> FloatArray:
        """`(P, 4, 4)` poses of the people: origin on the ground below the pelvis, x forward, z up."""
        heading = self._walk["heading"]
        poses = np.zeros((len(heading), 4, 4))
        poses[:, 0, 0] = poses[:, 1, 1] = np.cos(heading)
        poses[:, 1, 0] = np.sin(heading)
        poses[:, 0, 1] = -poses[:, 1, 0]
        poses[:, 2, 2] = poses[:, 3, 3] = 1.0
        poses[:, :2, 3] = self._positions[::PARTS, :2]
        return poses

    def _set_postures(self, postures: Sequence[Posture]) -> None:
        self._postures = postures
        self._running = np.array([one.running for one in postures], dtype=bool)
        self._posture = np.array([(one.crouch, one.bend, one.look_rad, one.sit) for one in postures], POSTURE)
        self._arms = np.array([[arm or (0.0,) * 5 for arm in one.arms] for one in postures], ARM)

    def _set_speed(self) -> None:
        """Set what depends on the speed."""
        walk = self._walk
        self._parameters = parameters_at(self._tables, self._anatomies, walk["speed"], walk["running"])
        standing = np.exp(-((walk["speed"] / 0.45) ** 2))
        walk["half_m"] = self._walk_half_m + (walk["stand_half_m"] - self._walk_half_m) * standing

    def _pose(self) -> None:
        _place_feet(self._walk, self._parameters, self._feet, SWING)
        rows = PARTS * len(self._walk)
        self._positions, self._rotations = np.empty((rows, 3)), np.empty((rows, 3, 3))
        pose_bodies(
            self._time_s, self._bodies, self._posture, self._arms, self._walk, self._parameters, self._feet,
            self._positions, self._rotations,
        )  # fmt: skip


def _follow_bodies(walk: NDArray[Any], dt_s: float, places: FloatArray, headings: FloatArray) -> None:
    """Move `(P,)` records of `WALK` to `(P, 2)` places and `(P,)` headings; smooths velocity and turn rate."""
    share = -math.expm1(-dt_s / _VELOCITY_TIME_CONSTANT_S)
    x = share * ((places[:, 0] - walk["x"]) / dt_s - walk["velocity_x"])
    y = share * ((places[:, 1] - walk["y"]) / dt_s - walk["velocity_y"])
    limit = np.minimum(_MAX_ACCELERATION_M_S2 * dt_s / np.maximum(np.hypot(x, y), 1e-9), 1.0)
    walk["velocity_x"] += limit * x
    walk["velocity_y"] += limit * y
    walk["speed"] = np.hypot(walk["velocity_x"], walk["velocity_y"])
    rate = ((headings - walk["heading"] + math.pi) % (2.0 * math.pi) - math.pi) / dt_s
    walk["turn"] -= math.expm1(-dt_s / _TURN_TIME_CONSTANT_S) * (rate - walk["turn"])
    walk["x"], walk["y"], walk["heading"] = places[:, 0], places[:, 1], headings


@kernel
def _advance_feet(dt_s: float, walks: NDArray[Any], parameters: NDArray[Any], feet: NDArray[Any]) -> None:
    """Advance the gait phase of `(P,)` people, let their `(P, 2)` feet strike and leave the ground, and place them.

    The stride frequency is speed over stride length, higher for a foot that lags or is out of place.
    """
    for person in range(len(walks)):
        walk, gait = walks[person], parameters[person]
        settled, lag, farthest, turned = True, -1.0, 0.0, 0.0
        for side in range(2):
            foot, sign = feet[person, side], 1.0 - 2.0 * side
            x, y = foot.foothold_x - walk.x, foot.foothold_y - walk.y
            ahead = (x * walk.velocity_x + y * walk.velocity_y) / max(walk.speed, 1e-6)
            behind = gait.mid_stance - (walk.phase + 0.5 * side) % 1.0 - ahead / gait.stride_m
            lag = max(lag, behind if foot.in_stance else 0.0)
            x += sign * walk.stand_half_m * math.sin(walk.heading)
            y -= sign * walk.stand_half_m * math.cos(walk.heading)
            farthest = max(farthest, math.sqrt(x * x + y * y))
            turned = max(turned, abs(_wrapped(foot.foothold_yaw - walk.heading - foot.toe_out)))
            settled = settled and foot.in_stance
        if walk.resting:
            settled = settled and farthest < _UNSETTLED_M and turned < _UNSETTLED_RAD
        else:
            settled = settled and farthest < _SETTLED_M and turned < _SETTLED_RAD
        walk.resting = walk.speed < _AT_REST_M_S and settled
        slow = walk.speed / _SETTLING_BELOW_M_S
        catch_up = 1.0 + _CATCH_UP_GAIN * min(max(lag - _TOLERATED_LAG, 0.0), 0.5)
        rate_hz = max(walk.speed / gait.stride_m * catch_up, _SETTLING_HZ * max(1.0 - slow * slow, 0.0))
        walk.rate_hz = 0.0 if walk.resting else rate_hz
        before = walk.phase
        walk.phase = (before + walk.rate_hz * dt_s) % 1.0
        for side in range(2):
            foot = feet[person, side]
            phase = (walk.phase + 0.5 * side) % 1.0
            if foot.in_stance:
                if phase >= gait.stance_fraction and not walk.resting:
                    foot.in_stance, foot.toe_off_phase = False, min(phase, 0.9)
            elif phase < (before + 0.5 * side) % 1.0:
                foot.in_stance = True
                foot.foothold_x, foot.foothold_y, foot.foothold_yaw = _next_foothold(walk, gait, foot, side)


@kernel
def _place_feet(walks: NDArray[Any], parameters: NDArray[Any], feet: NDArray[Any], swing: FloatArray) -> None:
    """Set the poses of `(P, 2)` feet: on their footholds, or on the way from there to the next, by `SWING`."""
    for person in range(len(walks)):
        walk, gait = walks[person], parameters[person]
        # A runner's stance is short: its foot rolls faster.
        faster = 1.0 + walk.running * (_ROLLING_STANCE / gait.stance_fraction - 1.0)
        for side in range(2):
            foot = feet[person, side]
            phase = (walk.phase + 0.5 * side) % 1.0
            x, y, yaw, lift_m = foot.foothold_x, foot.foothold_y, foot.foothold_yaw, 0.0
            if foot.in_stance:
                # As in `trajectories.stance_pitch`.
                down = max(1.0 - phase * faster / FOOT_FLAT, 0.0)
                up = (phase * faster - HEEL_RISE) / (gait.stance_fraction * faster - HEEL_RISE)
                up = min(max(up, 0.0), 1.0)
                pitch = gait.heel_strike_rad * down**DOWN_POWER - gait.toe_off_rad * up**UP_POWER
            else:
                progress = max(phase - foot.toe_off_phase, 0.0) / (1.0 - foot.toe_off_phase)
                row = progress * (len(swing) - 1)
                below = min(int(row), len(swing) - 2)
                travel = swing[below, 0] + (row - below) * (swing[below + 1, 0] - swing[below, 0])
                pitch = swing[below, 1] + (row - below) * (swing[below + 1, 1] - swing[below, 1])
                pitch *= gait.toe_off_rad if pitch < 0.0 else gait.heel_strike_rad
                lift_m = gait.clearance_m * math.sin(math.pi * progress) ** _LIFT_POWER
                next_x, next_y, next_yaw = _next_foothold(walk, gait, foot, side)
                x, y, yaw = x + travel * (next_x - x), y + travel * (next_y - y), yaw + travel * (next_yaw - yaw)
            # A foot that rolls on the ground, as in `trajectories.rolled_ankle`.
            centre = walk.heel_x if pitch > 0.0 else walk.toe_x
            radius = walk.heel_radius if pitch > 0.0 else walk.toe_radius
            above, cos, sin = walk.ankle_m - radius, math.cos(pitch), math.sin(pitch)
            ahead = centre - radius * pitch - centre * cos - above * sin
            foot.ankle_x, foot.ankle_y = x + ahead * math.cos(yaw), y + ahead * math.sin(yaw)
            foot.ankle_z = radius - centre * sin + above * cos + lift_m
            foot.yaw, foot.pitch = yaw, pitch


@part_of_kernel
def _next_foothold(walk: Any, gait: Any, foot: Any, side: int) -> tuple[float, float, float]:
    """x, y [m] and yaw [rad] of the foothold in the middle of the stance that follows or has just begun."""
    phase = (walk.phase + 0.5 * side) % 1.0
    # A runner's foot is in the air before half the stride is over.
    landed = phase < (0.3 if walk.running > 0.0 else 0.5)
    until_mid_stance = gait.mid_stance + (0.0 if landed else 1.0) - phase
    time_s = min(until_mid_stance / max(walk.rate_hz, 0.2), 1.5)
    # Along the chord of the arc that the body will walk.
    half_turn = 0.5 * min(max(walk.turn * time_s, -0.9), 0.9)
    along_x, along_y = walk.velocity_x * time_s, walk.velocity_y * time_s
    cos, sin = math.cos(half_turn), math.sin(half_turn)
    heading, aside = walk.heading + 2.0 * half_turn, (1.0 - 2.0 * side) * walk.half_m
    x = walk.x + along_x * cos - along_y * sin - aside * math.sin(heading)
    y = walk.y + along_x * sin + along_y * cos + aside * math.cos(heading)
    return x, y, foot.foothold_yaw + _wrapped(heading + foot.toe_out - foot.foothold_yaw)


@part_of_kernel
def _wrapped(angle: float) -> float:
    """The angle in [-pi, pi) [rad]."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi
