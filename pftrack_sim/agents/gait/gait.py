"""Whole-body gait: the pelvis above the feet, legs by inverse kinematics, trunk, head and arms by forward kinematics.

Rotations of pelvis and trunk are those of Murray, Drought and Kory, Journal of Bone and Joint Surgery 46-A:335 (1964),
and Saunders, Inman and Eberhart, ibid. 35-A:543 (1953).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.agents.gait.foot_placement import SIDES, FootPlacement
from pftrack_sim.agents.gait.gait_parameters import RUN_STANCE_FRACTION
from pftrack_sim.agents.gait.joint_trajectories import elbow_angles, shoulder_angles
from pftrack_sim.agents.gait.kinematics import (
    MAX_EXTENSION,
    leg_inverse_kinematics,
    quaternions,
    rotated,
    rotation_matrices,
)
from pftrack_sim.agents.gait.posture import PLAIN, Posture
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scene.people.anatomy import Anatomy
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
_SHOULDERS_BACK = 0.008  # shoulder joints behind the base of the neck, in statures


class Gait:
    """Walking, running, turning, crouching, bending and standing of `P` people.

    Args:
        rngs: One generator per person, for individual step width, arm swing, posture and start phase.
    """

    def __init__(self, anatomies: Sequence[Anatomy], rngs: Sequence[np.random.Generator]) -> None:
        people = len(anatomies)
        normal = np.array([rng.normal(size=6) for rng in rngs]).reshape(-1, 6).clip(-2.0, 2.0).T
        uniform = np.array([rng.random(4) for rng in rngs]).reshape(-1, 4).T
        height, girth, hip_half, shoulder_half, upper_arm = np.array(
            [(b.height_m, b.girth, b.hip_half_m, b.shoulder_half_m, b.upper_arm_m) for b in anatomies]
        ).T
        self.feet = FootPlacement(
            anatomies,
            toe_out_rad=np.radians(7.0 + 2.5 * normal[0]),
            walk_half_m=hip_half * (0.56 + 0.08 * normal[1]),
            stand_half_m=hip_half * (1.02 + 0.08 * normal[2]),
            start_phase=uniform[0],
        )
        self._arm_swing = 1.0 + 0.18 * normal[3]
        self._lean = np.radians(1.5 + 1.2 * normal[4])
        self._idle_rate = 2.0 * np.pi * np.stack([0.24 + 0.08 * uniform[1], 0.10 + 0.06 * uniform[2]])
        self._idle_phase = 2.0 * np.pi * uniform[2:4]

        # Offsets of joints in the frames of their parents.
        self._thigh = np.array([[b.thigh_m] for b in anatomies])
        self._shank = np.array([[b.shank_m] for b in anatomies])
        self._waist = np.array([[0.0, 0.0, b.pelvis_m] for b in anatomies])
        self._neck = np.array([[0.0, 0.0, b.torso_m] for b in anatomies])
        self._hips, self._shoulders, self._elbows = np.zeros((3, people, 2, 3))
        self._hips[..., 1] = SIDES * hip_half[:, None]
        self._shoulders[..., 0] = -_SHOULDERS_BACK * height[:, None]
        self._shoulders[..., 1] = SIDES * shoulder_half[:, None]
        self._shoulders[..., 2] = np.array([[b.torso_m - b.shoulder_drop_m] for b in anatomies])
        self._elbows[..., 2] = -upper_arm[:, None]

        # Yaw, roll and pitch of pelvis, torso, head, feet, upper arms and forearms; constant ones are set here. Arms
        # hang wider with larger girth.
        arm_roll = (np.radians(6.5 + 1.2 * normal[5]) + 0.3 * np.maximum(girth - 1.0, 0.0))[:, None]
        self._angles = np.zeros((3, people, 9))
        self._arm_rolls = np.concatenate([SIDES * arm_roll, -0.5 * SIDES * arm_roll], axis=1)
        self._angles[0, :, 7:9] = -0.25 * SIDES
        self.reset(np.zeros((people, 2)), np.zeros(people), np.zeros(people))

    def reset(
        self,
        positions_m: ArrayLike,
        headings_rad: ArrayLike,
        speeds_m_s: ArrayLike,
        postures: Sequence[Posture] | None = None,
    ) -> None:
        """Start in a steady walk, or at rest, at `(P, 2)` positions, `(P,)` headings and forward speeds."""
        self._time_s = 0.0
        self._positions = np.array(positions_m, dtype=float)
        self._headings = np.array(headings_rad, dtype=float)
        self._set_postures(postures or [PLAIN] * len(self._headings))
        self.feet.reset(self._positions, self._headings, np.asarray(speeds_m_s, dtype=float))
        self._pose: tuple[FloatArray, FloatArray] | None = None

    def advance(
        self, dt_s: float, positions_m: ArrayLike, headings_rad: ArrayLike, postures: Sequence[Posture]
    ) -> None:
        """Follow the people to `(P, 2)` positions on the ground and `(P,)` headings, which need not be wrapped."""
        self._time_s += dt_s
        self._positions = np.array(positions_m, dtype=float)
        self._headings = np.array(headings_rad, dtype=float)
        self._set_postures(postures)
        running = np.array([one.running for one in postures], dtype=bool)
        self.feet.advance(dt_s, self._positions, self._headings, running)
        self._pose = None

    def _set_postures(self, postures: Sequence[Posture]) -> None:
        table = np.array([(one.crouch, one.bend, one.look_rad) for one in postures]).reshape(-1, 3)
        self._crouch, self._bend, self._look = table.T
        self._arms = [
            (person, side, arm)
            for person, one in enumerate(postures)
            for side, arm in enumerate(one.arms)
            if arm is not None
        ]

    def poses(self) -> tuple[FloatArray, FloatArray]:
        """`(P, 13, 3)` positions [m] and `(P, 13, 4)` quaternions w, x, y, z, in the order of `person.PARTS`."""
        positions, rotations = self.part_poses()
        return positions, quaternions(rotations)

    def root_poses(self) -> FloatArray:
        """`(P, 4, 4)` poses of the people: origin on the ground below the pelvis, x forward, z up."""
        poses = np.zeros((len(self._headings), 4, 4))
        cos, sin = np.cos(self._headings), np.sin(self._headings)
        poses[:, 0, 0] = poses[:, 1, 1] = cos
        poses[:, 0, 1], poses[:, 1, 0] = -sin, sin
        poses[:, 2, 2] = poses[:, 3, 3] = 1.0
        poses[:, :2, 3] = self.part_poses()[0][:, _PELVIS, :2]
        return poses

    def part_poses(self) -> tuple[FloatArray, FloatArray]:
        """`(P, 13, 3)` positions [m] and `(P, 13, 3, 3)` rotations, computed once after `reset` or `advance`."""
        if self._pose is None:
            self._pose = self._compute_pose()
        return self._pose

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
        back = _CROUCH_BACK * self._thigh[:, 0] * self._crouch + _BEND_BACK * self._thigh[:, 0] * self._bend
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
        feet, headings, crouch = self.feet, self._headings, self._crouch[:, None]
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
        lean = self._lean + _LEAN_PER_SPEED * feet.speed + _CROUCH_LEAN * self._crouch
        bend, look = self._bend, self._look
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
        for person, side, arm in self._arms:
            upper, fore, outward = 5 + side, 7 + side, SIDES[side]
            # What is held before the chest hangs below it in a bend, and is held above the knees in a crouch.
            shoulder = arm.shoulder + _CROUCH_SHOULDER * self._crouch[person] + bend_arms[person]
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
        wanted = wanted - _CROUCH_DEPTH * leg * self._crouch - _BEND_DEPTH * leg * self._bend
        horizontal = feet.ankles[..., :2] - hips[..., :2] - pelvis[:, None, :2]
        reach_squared = (MAX_EXTENSION * (self._thigh + self._shank)) ** 2
        above = np.sqrt(np.maximum(reach_squared - horizontal[..., 0] ** 2 - horizontal[..., 1] ** 2, 0.04))
        limits = feet.ankles[..., 2] + above - hips[..., 2]
        softened = np.logaddexp(-limits[:, 0] / _HEIGHT_SOFTNESS_M, -limits[:, 1] / _HEIGHT_SOFTNESS_M)
        return -_HEIGHT_SOFTNESS_M * np.logaddexp(softened, -wanted / _HEIGHT_SOFTNESS_M)
