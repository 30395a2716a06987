"""Poses of the things that the target carries, picks up or puts down."""

from __future__ import annotations

import math
from collections.abc import Mapping

import mujoco
import numpy as np

from pftrack_sim.core.types import FloatArray
from pftrack_sim.scenario.people import Carried, Item, Target, held_share
from pftrack_sim.scene.people.anatomy import Anatomy
from pftrack_sim.scene.people.person import PARTS
from pftrack_sim.scene.people.props import RESTING_HEIGHT_M

_TORSO, _LEFT_HAND, _RIGHT_HAND = (PARTS.index(part) for part in ("torso", "left-forearm", "right-forearm"))
_REACH_M: dict[Item, tuple[float, float]] = {"box": (0.45, 0.0), "bag": (0.45, 0.28)}
"""Where a thing lies that the target is going to pick up: ahead of it, and to its left."""

_UMBRELLA_TILT = (-0.25, -0.28)  # Roll and pitch of the shaft [rad]: over the head


class CarriedItems:
    """The target's things.

    Args:
        model: Has a mocap body for each thing.
        places: x, y [m] and heading [rad] of the target when it picks up a thing that it does not carry from the start,
            by item.
    """

    def __init__(
        self, model: mujoco.MjModel, target: Target, anatomy: Anatomy, places: Mapping[Item, tuple[float, float, float]]
    ) -> None:
        self._target = target
        self._mocap_ids = [int(model.body_mocapid[model.body(one.item).id]) for one in target.carries]
        self._anatomy = anatomy
        # Where each thing lies, or would lie if it were let go now.
        self._rests = {
            item: (*(np.array([x, y]) + turned_by(heading)[:2, :2] @ _REACH_M[item]).tolist(), heading)
            for item, (x, y, heading) in places.items()
        }

    def write(self, data: mujoco.MjData, time_s: float, positions: FloatArray, rotations: FloatArray) -> None:
        """Set the mocap poses at a time from the target's `(13, 3)` positions [m] and `(13, 3, 3)` rotations."""
        for one, mocap in zip(self._target.carries, self._mocap_ids, strict=True):
            share = held_share(one, self._target.actions, time_s)
            place, rotation = self._carried(one, positions, rotations)
            height_m = RESTING_HEIGHT_M[one.item]
            place[2] = max(place[2], height_m)
            if share == 1.0:
                self._rests[one.item] = (place[0], place[1], _yaw(rotation))
            else:
                x, y, yaw = self._rests[one.item]
                place = share * place + (1.0 - share) * np.array([x, y, height_m])
                rotation = turned_by(yaw + share * math.remainder(_yaw(rotation) - yaw, 2.0 * math.pi))
            data.mocap_pos[mocap] = place
            mujoco.mju_mat2Quat(data.mocap_quat[mocap], rotation.ravel())

    def _carried(self, one: Carried, positions: FloatArray, rotations: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Position and rotation of a thing that is held."""
        torso, turned = positions[_TORSO], rotations[_TORSO]
        yaw = _yaw(turned)
        upright = turned_by(yaw)
        match one.item:
            case "bag":
                hand = _hand(_LEFT_HAND, self._anatomy, positions, rotations)
                return hand + upright @ (0.0, 0.03, 0.0), upright
            case "box":
                middle, upright = between_hands(self._anatomy, positions, rotations)
                return middle + upright @ (-0.05, 0.0, 0.06), upright
            case "backpack":
                return torso + turned @ (-0.185, 0.0, 0.52 * self._anatomy.torso_m), turned
            case "umbrella":
                return _hand(_RIGHT_HAND, self._anatomy, positions, rotations), turned_by(yaw, *_UMBRELLA_TILT)


def between_hands(anatomy: Anatomy, positions: FloatArray, rotations: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Place midway between the hands, from `(13, 3)` positions and `(13, 3, 3)` rotations, and the upright trunk's."""
    left, right = (_hand(side, anatomy, positions, rotations) for side in (_LEFT_HAND, _RIGHT_HAND))
    return 0.5 * (left + right), turned_by(_yaw(rotations[_TORSO]))


def _hand(side: int, anatomy: Anatomy, positions: FloatArray, rotations: FloatArray) -> FloatArray:
    return positions[side] + rotations[side] @ np.array([0.0, 0.0, -anatomy.forearm_m - 0.55 * anatomy.hand_m])


def _yaw(rotation: FloatArray) -> float:
    return math.atan2(rotation[1, 0], rotation[0, 0])


def turned_by(yaw_rad: float, roll_rad: float = 0.0, pitch_rad: float = 0.0) -> FloatArray:
    """`(3, 3)` rotation by roll about x, pitch about y, then yaw about z."""
    quaternion, matrix = np.empty(4), np.empty(9)
    mujoco.mju_euler2Quat(quaternion, [yaw_rad, roll_rad, pitch_rad], "zxy")
    mujoco.mju_quat2Mat(matrix, quaternion)
    return matrix.reshape(3, 3)
