"""Whole-body gait of people who move over the ground: feet, legs, trunk, head and arms."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.agents.gait.body import ARM, BODY, PARTS, POSTURE, pose_bodies, quaternions
from pftrack_sim.agents.gait.feet import AT_REST_M_S, FOOT, WALK, advance_feet, follow_bodies, place_feet
from pftrack_sim.agents.gait.posture import PLAIN, Posture
from pftrack_sim.agents.gait.trajectories import SWING, parameter_table, parameters_at
from pftrack_sim.core.types import BoolArray, FloatArray
from pftrack_sim.scene.people.anatomy import Anatomy
from pftrack_sim.scene.places.seats import SEAT_M

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
        resting = walk["speed"] < AT_REST_M_S
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
        follow_bodies(self._walk, dt_s, np.asarray(positions_m, dtype=float), np.asarray(headings_rad, dtype=float))
        self._set_speed()
        advance_feet(dt_s, self._walk, self._parameters, self._feet)
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
        place_feet(self._walk, self._parameters, self._feet, SWING)
        rows = PARTS * len(self._walk)
        self._positions, self._rotations = np.empty((rows, 3)), np.empty((rows, 3, 3))
        pose_bodies(
            self._time_s, self._bodies, self._posture, self._arms, self._walk, self._parameters, self._feet,
            self._positions, self._rotations,
        )  # fmt: skip
