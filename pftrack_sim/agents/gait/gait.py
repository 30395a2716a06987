"""Gait of people who move over the ground: walking, running, turning, crouching, bending, sitting and standing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.agents.gait.body import pose_bodies
from pftrack_sim.agents.gait.crutches import Crutches
from pftrack_sim.agents.gait.curves import SWING
from pftrack_sim.agents.gait.mobility import Rider
from pftrack_sim.agents.gait.posture import PLAIN, Posture
from pftrack_sim.agents.gait.records import ARM, FOOT, GRIP, PART, PARTS, PERSON
from pftrack_sim.agents.gait.walk import walk
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scenario.mobility import Mobility
from pftrack_sim.scene.people.anatomy import Anatomy
from pftrack_sim.scene.places.seats import SEAT_M

_SIT_HIP = 0.071  # hip joints above a seat, in statures: thighs and buttocks press 5 mm into it
_LEG_REACH = 0.9982  # longest reach of a leg relative to the sum of its links: knees never lock
_SHOULDERS_BACK = 0.008  # shoulder joints behind the base of the neck, in statures
_SEGMENTS = (
    "height_m", "pelvis_m", "torso_m", "thigh_m", "shank_m", "upper_arm_m", "hip_half_m", "ankle_m", "shoulder_half_m",
)  # fmt: skip


class Gait:
    """The bodies of `P` people who move over the ground.

    Args:
        anatomies: Their bodies.
        rngs: One generator per person, for individual step width, arm swing, posture and start phase.
        uses: What some of them move with, by index.

    Attributes:
        start_phase: `(P,)` gait phase with which a steady walk starts; may be set before `reset`.
        positions: `(P, 13, 3)` of their parts [m], in the order of `person.PARTS`.
        rotations: `(P, 13, 3, 3)`.
        riders: Those who move with something, by index.
    """

    def __init__(
        self,
        anatomies: Sequence[Anatomy],
        rngs: Sequence[np.random.Generator],
        uses: Mapping[int, Mobility] = MappingProxyType({}),
    ) -> None:
        self.riders = {
            index: Crutches(anatomies[index]) if kind == "crutches" else Rider(kind, anatomies[index])
            for index, kind in uses.items()
        }
        self._crutches = {index: one for index, one in self.riders.items() if isinstance(one, Crutches)}
        normal = np.array([rng.normal(size=6) for rng in rngs]).reshape(-1, 6).clip(-2.0, 2.0).T
        uniform = np.array([rng.random(4) for rng in rngs]).reshape(-1, 4).T
        count = len(anatomies)
        self._people = people = np.zeros(count, PERSON)
        self._feet, self._arms = np.zeros((count, 2), FOOT), np.zeros((count, 2), ARM)
        self._grips = np.zeros((count, 2), GRIP)
        for name in _SEGMENTS:
            people[name] = [getattr(one, name) for one in anatomies]
        soles = np.array([one.sole_m for one in anatomies]).T
        people["heel_x"], people["heel_radius"], people["toe_x"], people["toe_radius"] = soles
        height, girth, drop = np.array([(one.height_m, one.girth, one.shoulder_drop_m) for one in anatomies]).T
        people["shoulder_x"], people["shoulder_z"] = -_SHOULDERS_BACK * height, people["torso_m"] - drop
        people["seated_m"] = SEAT_M + _SIT_HIP * height
        people["reach"] = _LEG_REACH
        people["grip_m"] = [one.grip_m for one in anatomies]
        # Arms hang wider with larger girth.
        people["arm_roll"] = np.radians(9.5 + 1.5 * normal[5]) + 0.45 * np.maximum(girth - 1.0, 0.0)
        people["arm_swing"], people["lean"] = 1.0 + 0.18 * normal[3], np.radians(1.5 + 1.2 * normal[4])
        people["breath_rate"] = 2.0 * np.pi * (0.24 + 0.08 * uniform[1])
        people["glance_rate"] = 2.0 * np.pi * (0.10 + 0.06 * uniform[2])
        people["breath_phase"], people["glance_phase"] = 2.0 * np.pi * uniform[2:4]
        people["walk_half_m"] = people["hip_half_m"] * (0.56 + 0.08 * normal[1])
        people["stand_half_m"] = people["hip_half_m"] * (1.02 + 0.08 * normal[2])
        self._feet["toe_out"] = np.radians(7.0 + 2.5 * normal[0])[:, None] * (1.0, -1.0)
        self.start_phase = people["start_phase"]
        self.start_phase[:] = uniform[0]
        self.reset(np.zeros((count, 2)), np.zeros(count), np.zeros(count))

    @property
    def root_poses(self) -> FloatArray:
        """`(P, 4, 4)` poses of the people: origin on the ground below the pelvis, x forward, z up."""
        heading = self._people["heading"]
        poses = np.zeros((len(heading), 4, 4))
        poses[:, 0, 0] = poses[:, 1, 1] = np.cos(heading)
        poses[:, 1, 0] = np.sin(heading)
        poses[:, 0, 1] = -poses[:, 1, 0]
        poses[:, 2, 2] = poses[:, 3, 3] = 1.0
        poses[:, :2, 3] = self.positions[:, 0, :2]
        return poses

    def reset(
        self,
        positions_m: ArrayLike,
        headings_rad: ArrayLike,
        speeds_m_s: ArrayLike,
        postures: Sequence[Posture] | None = None,
    ) -> None:
        """Start in a steady walk, or at rest, at `(P, 2)` positions, `(P,)` headings and forward speeds."""
        self._time_s, people = 0.0, self._people
        self._set_postures(postures or (PLAIN,) * len(people))
        headings, speeds = np.asarray(headings_rad, dtype=float), np.asarray(speeds_m_s, dtype=float)
        people["x"], people["y"] = np.asarray(positions_m, dtype=float).T
        people["heading"], people["speed"] = headings, np.abs(speeds)
        people["velocity_x"], people["velocity_y"] = np.cos(headings) * speeds, np.sin(headings) * speeds
        people["turn"] = people["running"] = 0.0
        self._move(0.0)

    def advance(
        self, dt_s: float, positions_m: FloatArray, headings_rad: FloatArray, postures: Sequence[Posture]
    ) -> None:
        """Follow the people to `(P, 2)` positions on the ground and `(P,)` headings, which need not be wrapped."""
        self._time_s += dt_s
        if postures != self._postures:
            self._set_postures(postures)
        people = self._people
        (people["to_x"], people["to_y"]), people["to_heading"] = positions_m.T, headings_rad
        self._move(dt_s)

    def _set_postures(self, postures: Sequence[Posture]) -> None:
        self._postures = postures
        rows = [(one.crouch, one.bend, one.look_rad, one.sit, one.running) for one in postures]
        for name, column in zip(("crouch", "bend", "look", "sit", "runs"), zip(*rows, strict=True), strict=True):
            self._people[name] = column
        self._arms = np.array([[arm or (0.0,) * 5 for arm in one.arms] for one in postures], ARM)

    def _move(self, dt_s: float) -> None:
        """Move by a tick, or start; with new arrays, so that those of the last tick stay as they are."""
        parts = np.empty((len(self._people), PARTS), PART)
        walk(dt_s, self._people, self._feet, SWING)
        for index, rider in self.riders.items():
            rider.move(dt_s, self._people[index], self._feet[index], self._grips[index])
        bodies = self._time_s, self._people, self._feet, self._arms, self._grips, parts
        pose_bodies(*bodies)
        numbers = parts.view(np.float64).reshape(*parts.shape, -1)
        for index, crutches in self._crutches.items():
            crutches.hold(numbers[index], self._grips[index])
        if self._crutches:
            pose_bodies(*bodies)  # Shoulders are where they were; arms now reach the grips
        self.positions, self.rotations = numbers[..., :3], numbers[..., 3:].reshape(*parts.shape, 3, 3)


def quaternions(rotations: FloatArray) -> FloatArray:
    """`(..., 4)` unit quaternions w, x, y, z of `(..., 3, 3)` rotation matrices.

    Of the four candidates, one per component as divisor, the one with the largest divisor is taken (Shepperd 1978).
    """
    r = rotations.reshape(-1, 9).T
    candidates = np.empty((4, 4, r.shape[1]))
    candidates[0, 0], candidates[1, 1] = 1.0 + r[0] + r[4] + r[8], 1.0 + r[0] - r[4] - r[8]
    candidates[2, 2], candidates[3, 3] = 1.0 - r[0] + r[4] - r[8], 1.0 - r[0] - r[4] + r[8]
    candidates[0, 1] = candidates[1, 0] = r[7] - r[5]
    candidates[0, 2] = candidates[2, 0] = r[2] - r[6]
    candidates[0, 3] = candidates[3, 0] = r[3] - r[1]
    candidates[1, 2] = candidates[2, 1] = r[1] + r[3]
    candidates[1, 3] = candidates[3, 1] = r[2] + r[6]
    candidates[2, 3] = candidates[3, 2] = r[5] + r[7]
    best = np.diagonal(candidates).argmax(axis=1)
    chosen = candidates[best, :, np.arange(len(best))]
    return (chosen / np.sqrt(np.einsum("ij,ij->i", chosen, chosen))[:, None]).reshape(*rotations.shape[:-2], 4)
