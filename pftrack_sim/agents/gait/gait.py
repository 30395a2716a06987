"""Whole-body gait: the pelvis above the feet, legs by inverse kinematics, trunk, head and arms by forward kinematics.

Rotations of pelvis and trunk are those of Murray, Drought and Kory, Journal of Bone and Joint Surgery 46-A:335 (1964),
and Saunders, Inman and Eberhart, ibid. 35-A:543 (1953).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.agents.gait.foot_placement import SIDES, FootPlacement
from pftrack_sim.agents.gait.joint_trajectories import elbow_angles, shoulder_angles
from pftrack_sim.agents.gait.kernels import BEND_ARMS, CROUCH_SHOULDER, assemble, body_angles
from pftrack_sim.agents.gait.kinematics import quaternions, rotation_matrices
from pftrack_sim.agents.gait.posture import PLAIN, Posture
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scene.people.anatomy import Anatomy
from pftrack_sim.scene.places.seats import SEAT_M

_BEND_ELBOW = 0.7  # share by which a full bend extends the elbow of an arm that holds something
_SIT_HIP = 0.071  # hip joints above a seat, in statures: thighs and buttocks press 5 mm into it
_SHOULDERS_BACK = 0.008  # shoulder joints behind the base of the neck, in statures


class Gait:
    """Walking, running, turning, crouching, bending, sitting and standing of `P` people.

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
        self._seated_m = SEAT_M + _SIT_HIP * height
        self._arm_swing = 1.0 + 0.18 * normal[3]
        self._lean = np.radians(1.5 + 1.2 * normal[4])
        self._idle_rate = 2.0 * np.pi * np.stack([0.24 + 0.08 * uniform[1], 0.10 + 0.06 * uniform[2]])
        self._idle_phase = 2.0 * np.pi * uniform[2:4]

        # Offsets of joints in the frames of their parents.
        self._spine = np.array([(b.pelvis_m, b.torso_m) for b in anatomies]).T.copy()
        self._legs = np.array([(b.thigh_m, b.shank_m) for b in anatomies]).T.copy()
        self._offsets = np.zeros((3, people, 2, 3))
        hips, shoulders, elbows = self._offsets
        hips[..., 1] = SIDES * hip_half[:, None]
        shoulders[..., 0] = -_SHOULDERS_BACK * height[:, None]
        shoulders[..., 1] = SIDES * shoulder_half[:, None]
        shoulders[..., 2] = np.array([[b.torso_m - b.shoulder_drop_m] for b in anatomies])
        elbows[..., 2] = -upper_arm[:, None]

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
        # Rows crouch, bend, look and sit.
        rows = [(one.crouch, one.bend, one.look_rad, one.sit) for one in postures]
        self._posture = np.array(rows).reshape(-1, 4).T.copy()
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
        poses[:, :2, 3] = self.part_poses()[0][:, 0, :2]  # of the pelvis
        return poses

    def part_poses(self) -> tuple[FloatArray, FloatArray]:
        """`(P, 13, 3)` positions [m] and `(P, 13, 3, 3)` rotations, computed once after `reset` or `advance`."""
        if self._pose is None:
            self._pose = self._compute_pose()
        return self._pose

    def _compute_pose(self) -> tuple[FloatArray, FloatArray]:
        """Positions `(P, 13, 3)` [m] and rotations `(P, 13, 3, 3)` of all parts."""
        feet, part_rotations = self.feet, self._rotations()
        upper_arms = part_rotations[:, 1, None] @ part_rotations[:, 5:7]
        positions, rotations = assemble(
            part_rotations, upper_arms, upper_arms @ part_rotations[:, 7:9], self._offsets, self._spine, self._legs,
            self._positions, self._headings, self._posture, self._seated_m, feet.parameters, feet.phase, feet.running,
            feet.ankles, feet.yaw,
        )  # fmt: skip
        positions.setflags(write=False)
        return positions, rotations

    def _rotations(self) -> FloatArray:
        """`(P, 9, 3, 3)` of pelvis, torso, head and feet in the world, of upper arms and forearms in their parents."""
        feet, phases = self.feet, self.feet.foot_phases
        arm_amplitude = (self._arm_swing * feet.parameters.amplitude)[:, None]
        body_angles(
            self._angles, self._arm_rolls, shoulder_angles(phases, arm_amplitude), elbow_angles(phases, arm_amplitude),
            self._idle_phase, self._idle_rate, self._time_s, self._lean, self._headings, self._posture,
            feet.parameters, feet.phase, feet.running, feet.speed, feet.turn, feet.yaw, feet.pitch,
        )  # fmt: skip
        yaw, roll, pitch = self._angles
        crouch, bend, _, _ = self._posture
        for person, side, arm in self._arms:
            upper, fore, outward = 5 + side, 7 + side, SIDES[side]
            # What is held before the chest hangs below it in a bend, and is held above the knees in a crouch.
            shoulder = arm.shoulder + CROUCH_SHOULDER * crouch[person] + BEND_ARMS * bend[person]
            elbow = arm.elbow * (1.0 - _BEND_ELBOW * bend[person])
            pitch[person, upper] += arm.share * (-shoulder - pitch[person, upper])
            pitch[person, fore] += arm.share * (-elbow - pitch[person, fore])
            roll[person, upper] += arm.share * outward * arm.outward
            roll[person, fore] += arm.share * outward * arm.forearm
        return rotation_matrices(yaw, roll, pitch)
