"""A person's whole body in motion: pelvis over the feet, legs in between, trunk, head and arms above.

The crowd decides where people are; the gait decides how they get there. Rotations of pelvis and trunk are those of
Murray, Drought and Kory, Journal of Bone and Joint Surgery 46-A:335 (1964), and Saunders, Inman and Eberhart, ibid.
35-A:543 (1953); the arms' are in `curves`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.agents.gait.foot_placement import SIDES, FootPlacement, Habits
from pftrack_sim.agents.gait.gait_parameters import RUN_STANCE
from pftrack_sim.agents.gait.joint_trajectories import elbow_angles, shoulder_angles
from pftrack_sim.agents.gait.leg_kinematics import STRAIGHT, bent_legs
from pftrack_sim.agents.gait.limb_rotations import moved, quaternions, turned
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.scene.people.anatomy import Anatomy
from pftrack_sim.scene.people.person import PARTS

Array = NDArray[np.float64]

_PELVIS, _TORSO, _HEAD = 0, 1, 2
_UPPER_ARMS, _FOREARMS, _THIGHS, _SHANKS, _FEET = (slice(start, start + 2) for start in range(3, 13, 2))
_GRAVITY = 9.81
_SOFT_M = 0.003
"""How softly the reach of the legs limits the height of the pelvis."""
_PELVIS_TWIST, _PELVIS_DROP = np.radians(4.5), np.radians(3.5)
"""Amplitudes at natural speed."""
_LEAN_PER_SPEED = np.radians(1.8)
_HEAD_DOWN = np.radians(2.0)
_IDLE_ANGLES = np.radians([[0.6], [4.0]])
"""How far breathing moves the chest, and how far the eyes wander."""
_SQUAT = 0.46
"""How far the seat sinks when squatting [legs]."""
_SEAT_BACK = 0.38
"""How far it goes back [thighs]."""
_SQUAT_LEAN, _REACH_OUT = 0.55, 0.7
_RUNNING_ELBOW = np.radians(62.0)
_SHOULDERS_BACK = 0.008
"""Shoulder joints behind the base of the neck [statures]."""


class Gait:
    """Walking, turning, standing people.

    Args:
        anatomies: Bodies of the `P` people.
        rngs: One generator each, for habits: step width, arm swing, posture, which foot comes first.

    Raises:
        ParameterError: The two differ in number.
    """

    def __init__(self, anatomies: Sequence[Anatomy], rngs: Sequence[np.random.Generator]) -> None:
        if len(anatomies) != len(rngs):
            raise ParameterError(f"one generator per person: got {len(anatomies)} bodies and {len(rngs)} generators")
        draws = np.array([rng.normal(size=6) for rng in rngs]).reshape(-1, 6).clip(-2.0, 2.0)
        shares = np.array([rng.random(4) for rng in rngs]).reshape(-1, 4)
        self._feet = FootPlacement(
            anatomies,
            [
                Habits(
                    toe_out_rad=np.radians(7.0 + 2.5 * drawn[0]),
                    walk_half_m=body.hip_half_m * (0.56 + 0.08 * drawn[1]),
                    stand_half_m=body.hip_half_m * (1.02 + 0.08 * drawn[2]),
                    start_phase=float(share[0]),
                )
                for body, drawn, share in zip(anatomies, draws, shares, strict=True)
            ],
        )
        self._arm_swing = 1.0 + 0.18 * draws[:, 3]
        self._lean = np.radians(1.5 + 1.2 * draws[:, 4])
        self._idle_rate = 2.0 * np.pi * np.stack([0.24 + 0.08 * shares[:, 1], 0.10 + 0.06 * shares[:, 2]], axis=1)
        self._idle_start = 2.0 * np.pi * shares[:, 2:4]

        self._thigh = np.array([[b.thigh_m] for b in anatomies])
        self._shank = np.array([[b.shank_m] for b in anatomies])
        self._reach_squared = (STRAIGHT * (self._thigh + self._shank)) ** 2
        self._waist = np.array([[0.0, 0.0, b.pelvis_m] for b in anatomies])
        self._neck = np.array([[0.0, 0.0, b.torso_m] for b in anatomies])
        self._hips = np.array([[[0.0, side * b.hip_half_m, 0.0] for side in SIDES] for b in anatomies])
        self._shoulders = np.array(
            [
                [
                    [-_SHOULDERS_BACK * b.height_m, side * b.shoulder_half_m, b.torso_m - b.shoulder_drop_m]
                    for side in SIDES
                ]
                for b in anatomies
            ]
        )
        self._upper_arm = np.array([[0.0, 0.0, -b.upper_arm_m] for b in anatomies])[:, None]
        people = len(anatomies)
        # Yaw, roll and pitch of what `_turns` lists; what never changes is written once. Stout people's arms hang
        # wider.
        hang = np.radians(6.5 + 1.2 * draws[:, 5]) + 0.3 * np.array([max(b.girth - 1.0, 0.0) for b in anatomies])
        self._angles = np.zeros((3, people, 9))
        self._angles[1, :, 5:7] = SIDES * hang[:, None]
        self._angles[1, :, 7:9] = -0.5 * SIDES * hang[:, None]
        self._angles[0, :, 7:9] = -0.25 * SIDES
        self._clock = 0.0
        self.reset(np.zeros((people, 2)), np.zeros(people), np.zeros(people))

    def reset(self, positions_m: ArrayLike, headings_rad: ArrayLike, speeds_m_s: ArrayLike) -> None:
        """Put everyone in the middle of a steady walk, or at rest.

        Args:
            positions_m: `(P, 2)` on the ground.
            headings_rad: `(P,)`.
            speeds_m_s: `(P,)` forward speeds.
        """
        self._clock = 0.0
        self._crouch = np.zeros(len(self._waist))
        headings = np.asarray(headings_rad, dtype=float)
        positions = np.asarray(positions_m, dtype=float)
        self._feet.reset(positions, headings, np.asarray(speeds_m_s, dtype=float))
        self._stand(positions, headings)

    def advance(
        self,
        dt_s: float,
        positions_m: ArrayLike,
        headings_rad: ArrayLike,
        crouching: ArrayLike | None = None,
        running: ArrayLike | None = None,
    ) -> None:
        """Follow the people to where they are now.

        Args:
            dt_s: Time since the last call.
            positions_m: `(P, 2)` on the ground.
            headings_rad: `(P,)` where they face; need not be wrapped.
            crouching: `(P,)` 0 for upright, 1 for squatting; None for nobody.
            running: `(P,)` who runs instead of walking; None for nobody.
        """
        if crouching is not None:
            self._crouch = np.array(crouching, dtype=float)
        if running is not None:
            self._feet.run(dt_s, np.asarray(running, dtype=bool))
        self._clock += dt_s
        headings = np.asarray(headings_rad, dtype=float)
        positions = np.asarray(positions_m, dtype=float)
        self._feet.advance(dt_s, positions, headings)
        self._stand(positions, headings)

    def poses(self) -> tuple[Array, Array]:
        """Where every part is, in the order of `body.PARTS`.

        Returns:
            `(P, 13, 3)` positions [m] and `(P, 13, 4)` unit quaternions w, x, y, z.
        """
        places, rotations = self._parts()
        return places, quaternions(rotations)

    def root_poses(self) -> Array:
        """`(P, 4, 4)` poses of the people: on the ground below the pelvis, x where the person faces, z up."""
        out = np.zeros((len(self._headings), 4, 4))
        cos, sin = np.cos(self._headings), np.sin(self._headings)
        out[:, 0, 0] = out[:, 1, 1] = cos
        out[:, 0, 1], out[:, 1, 0] = -sin, sin
        out[:, 2, 2] = out[:, 3, 3] = 1.0
        out[:, :2, 3] = self._parts()[0][:, _PELVIS, :2]
        return out

    @property
    def standing(self) -> NDArray[np.bool_]:
        """`(P, 2)` whether the left and the right foot are on the ground."""
        return self._feet.standing

    @property
    def phases(self) -> Array:
        """`(P,)` share of the stride since the left heel's contact, in [0, 1)."""
        return self._feet.phase

    def _stand(self, positions: Array, headings: Array) -> None:
        self._positions, self._headings = positions.copy(), headings.copy()
        self._posed: tuple[Array, Array] | None = None

    def _parts(self) -> tuple[Array, Array]:
        """Places and rotations of all parts; worked out when asked for, as only the feet remember anything."""
        if self._posed is None:
            self._posed = self._pose(self._positions, self._headings)
        return self._posed

    def _pose(self, positions: Array, headings: Array) -> tuple[Array, Array]:
        feet, gauge = self._feet, self._feet.gauge
        places = np.empty((len(headings), len(PARTS), 3))
        rotations = np.empty((len(headings), len(PARTS), 3, 3))

        swing = (self._arm_swing * gauge.vigour)[:, None]
        cycle = feet.cycle
        shoulders, elbows = shoulder_angles(cycle, swing), elbow_angles(cycle, swing)
        if self._crouch.any():
            shoulders = shoulders + _REACH_OUT * self._crouch[:, None]
            elbows = elbows + 0.5 * _REACH_OUT * self._crouch[:, None]
        if feet.running.any():
            elbows = elbows + _RUNNING_ELBOW * feet.running[:, None]
        turns = self._turns(headings, shoulders, elbows)
        rotations[:, : _HEAD + 1] = turns[:, :3]
        rotations[:, _FEET] = turns[:, 3:5]
        rotations[:, _UPPER_ARMS] = rotations[:, _TORSO, None] @ turns[:, 5:7]
        rotations[:, _FOREARMS] = rotations[:, _UPPER_ARMS] @ turns[:, 7:9]

        hips = moved(rotations[:, _PELVIS, None], self._hips)
        sway = gauge.sway_m * np.cos(2.0 * np.pi * (feet.phase - 0.30))
        pelvis = places[:, _PELVIS]
        pelvis[:, 0] = positions[:, 0] - sway * np.sin(headings)
        pelvis[:, 1] = positions[:, 1] + sway * np.cos(headings)
        if self._crouch.any():
            # The seat goes back as the chest leans forward: the weight stays above the feet.
            back = _SEAT_BACK * self._thigh[:, 0] * self._crouch
            pelvis[:, 0] -= back * np.cos(headings)
            pelvis[:, 1] -= back * np.sin(headings)
        pelvis[:, 2] = self._pelvis_height(pelvis, hips)
        places[:, _TORSO] = pelvis + moved(rotations[:, _PELVIS], self._waist)
        places[:, _HEAD] = places[:, _TORSO] + moved(rotations[:, _TORSO], self._neck)

        places[:, _THIGHS] = pelvis[:, None] + hips
        places[:, _FEET] = feet.ankles
        yaw = 0.5 * (feet.yaw + headings[:, None])
        forward = np.stack([np.cos(yaw), np.sin(yaw), np.zeros_like(yaw)], axis=-1)
        knees, rotations[:, _THIGHS], rotations[:, _SHANKS] = bent_legs(
            places[:, _THIGHS], feet.ankles, forward, self._thigh, self._shank
        )
        places[:, _SHANKS] = knees

        places[:, _UPPER_ARMS] = places[:, _TORSO, None] + moved(rotations[:, _TORSO, None], self._shoulders)
        places[:, _FOREARMS] = places[:, _UPPER_ARMS] + moved(rotations[:, _UPPER_ARMS], self._upper_arm)
        places.setflags(write=False)
        return places, rotations

    def _turns(self, headings: Array, shoulders: Array, elbows: Array) -> Array:
        """Rotations of pelvis, torso, head and feet in the world, of upper arms and forearms in their parents.

        Args:
            headings: `(P,)` [rad].
            shoulders: `(P, 2)` flexion [rad].
            elbows: `(P, 2)` flexion [rad].

        Returns:
            `(P, 9, 3, 3)`.
        """
        feet, vigour = self._feet, self._feet.gauge.vigour
        angles = self._angles
        stride = 2.0 * np.pi * feet.phase
        # The pelvis turns with the leg that comes forward and drops on the side that is in the air; the chest counters.
        twist = _PELVIS_TWIST * vigour * np.cos(stride)
        drop = _PELVIS_DROP * vigour * np.cos(stride - 2.0 * np.pi * 0.15)
        bank = np.minimum(np.maximum(-0.6 / _GRAVITY * feet.speed * feet.turn, -0.2), 0.2)
        gaze = np.minimum(np.maximum(0.35 * feet.turn, -0.5), 0.5)
        breath, glance = _IDLE_ANGLES * np.sin(self._idle_start + self._idle_rate * self._clock).T
        lean = self._lean + _LEAN_PER_SPEED * feet.speed + _SQUAT_LEAN * self._crouch
        yaw, roll, pitch = angles
        yaw[:, 0] = headings - twist
        yaw[:, 1] = headings + 0.8 * twist + 0.3 * gaze
        yaw[:, 2] = headings + gaze + glance
        yaw[:, 3:5] = feet.yaw
        roll[:, 0] = drop + bank
        roll[:, 1] = bank - 0.35 * drop
        roll[:, 2] = 0.5 * bank
        pitch[:, 0] = 0.4 * lean
        pitch[:, 1] = lean + breath
        pitch[:, 2] = 0.3 * lean + _HEAD_DOWN
        pitch[:, 3:5] = -feet.pitch
        pitch[:, 5:7] = -shoulders
        pitch[:, 7:9] = -elbows
        return turned(yaw, roll, pitch)

    def _pelvis_height(self, pelvis: Array, hips: Array) -> Array:
        """Height of the pelvis `(P,)` [m]: the published bob, never more than both legs can reach."""
        feet, gauge = self._feet, self._feet.gauge
        bob = 0.5 - 0.5 * np.cos(4.0 * np.pi * (feet.phase - 0.04))
        if feet.running.any():
            # Runners are lowest in the middle of a stance and highest in the middle of a flight.
            fall = 0.5 - 0.5 * np.cos(4.0 * np.pi * (feet.phase - 0.5 * RUN_STANCE))
            bob = bob + feet.running * (fall - bob)
        wanted = gauge.low_m + (gauge.high_m - gauge.low_m) * bob
        if self._crouch.any():
            wanted = wanted - _SQUAT * (self._thigh[:, 0] + self._shank[:, 0]) * self._crouch
        away = feet.ankles[..., :2] - hips[..., :2] - pelvis[:, None, :2]
        above = np.sqrt(np.maximum(self._reach_squared - away[..., 0] ** 2 - away[..., 1] ** 2, 0.04))
        limit = feet.ankles[..., 2] + above - hips[..., 2]
        soft = np.logaddexp(-limit[:, 0] / _SOFT_M, -limit[:, 1] / _SOFT_M)
        return -_SOFT_M * np.logaddexp(soft, -wanted / _SOFT_M)
