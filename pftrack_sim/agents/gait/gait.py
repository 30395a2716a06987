"""Whole-body gait: the pelvis above the feet, legs by inverse kinematics, trunk, head and arms by forward kinematics.

Rotations of pelvis and trunk are those of Murray, Drought and Kory, Journal of Bone and Joint Surgery 46-A:335 (1964),
and Saunders, Inman and Eberhart, ibid. 35-A:543 (1953).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.agents.gait.foot_placement import SIDES, FootPlacement
from pftrack_sim.agents.gait.kernels import pose_bodies
from pftrack_sim.agents.gait.posture import PLAIN, Posture
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scene.people.anatomy import Anatomy
from pftrack_sim.scene.places.seats import SEAT_M

_SIT_HIP = 0.071  # hip joints above a seat, in statures: thighs and buttocks press 5 mm into it
_SHOULDERS_BACK = 0.008  # shoulder joints behind the base of the neck, in statures


class Gait:
    """Walking, running, turning, crouching, bending, sitting and standing of `P` people.

    Args:
        rngs: One generator per person, for individual step width, arm swing, posture and start phase.
        copies: How many times each person is there, with equal draws.
    """

    def __init__(self, anatomies: Sequence[Anatomy], rngs: Sequence[np.random.Generator], copies: int = 1) -> None:
        normal = np.array([rng.normal(size=6) for rng in rngs]).reshape(-1, 6).clip(-2.0, 2.0).repeat(copies, axis=0).T
        uniform = np.array([rng.random(4) for rng in rngs]).reshape(-1, 4).repeat(copies, axis=0).T
        anatomies = [one for one in anatomies for _ in range(copies)]
        people = len(anatomies)
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

        # Arms hang wider with larger girth.
        arm_roll = (np.radians(6.5 + 1.2 * normal[5]) + 0.3 * np.maximum(girth - 1.0, 0.0))[:, None]
        self._arm_rolls = np.concatenate([SIDES * arm_roll, -0.5 * SIDES * arm_roll], axis=1)
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
        self._set_postures(postures or (PLAIN,) * len(self._headings))
        self.feet.reset(self._positions, self._headings, np.asarray(speeds_m_s, dtype=float))
        self._pose: tuple[FloatArray, FloatArray, FloatArray, FloatArray] | None = None

    def advance(
        self, dt_s: float, positions_m: ArrayLike, headings_rad: ArrayLike, postures: Sequence[Posture]
    ) -> None:
        """Follow the people to `(P, 2)` positions on the ground and `(P,)` headings, which need not be wrapped."""
        self._time_s += dt_s
        self._positions = np.array(positions_m, dtype=float)
        self._headings = np.array(headings_rad, dtype=float)
        if postures != self._postures:
            self._set_postures(postures)
        self.feet.advance(dt_s, self._positions, self._headings, self._running)
        self._pose = None

    def _set_postures(self, postures: Sequence[Posture]) -> None:
        self._postures = postures
        self._running = np.array([one.running for one in postures], dtype=bool)
        # Rows crouch, bend, look and sit.
        rows = [(one.crouch, one.bend, one.look_rad, one.sit) for one in postures]
        self._posture = np.array(rows).reshape(-1, 4).T.copy()
        arms = [(person, side, *arm) for person, one in enumerate(postures) for side, arm in enumerate(one.arms) if arm]
        self._held = np.array(arms, dtype=np.float64).reshape(-1, 7)

    def poses(self) -> tuple[FloatArray, FloatArray]:
        """`(P, 13, 3)` positions [m] and `(P, 13, 4)` quaternions w, x, y, z, in the order of `person.PARTS`."""
        positions, _, quaternions, _ = self._computed()
        return positions, quaternions

    def root_poses(self) -> FloatArray:
        """`(P, 4, 4)` poses of the people: origin on the ground below the pelvis, x forward, z up."""
        return self._computed()[3].copy()

    def part_poses(self) -> tuple[FloatArray, FloatArray]:
        """`(P, 13, 3)` positions [m] and `(P, 13, 3, 3)` rotations."""
        return self._computed()[:2]

    def _computed(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Positions, rotations and quaternions of parts, and root poses; computed once after `reset` or `advance`."""
        if self._pose is None:
            feet, parameters = self.feet, self.feet.parameters
            self._pose = pose_bodies(
                self._arm_rolls, self._arm_swing, self._held, self._idle_phase, self._idle_rate, self._time_s,
                self._lean, self._headings, self._posture, parameters.amplitude, feet.phase, feet.running, feet.speed,
                feet.turn, feet.yaw, feet.pitch, self._offsets, self._spine, self._legs, self._positions,
                self._seated_m, parameters.hip_low_m, parameters.hip_high_m, parameters.sway_m, feet.ankles,
            )  # fmt: skip
            self._pose[0].setflags(write=False)
        return self._pose
