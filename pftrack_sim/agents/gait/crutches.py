"""People on two forearm crutches, in the three-point gait with partial weight bearing.

Both crutches go forward with the involved foot, the right one, and take weight with it; then the other foot steps past
them. A tip on the ground stays where it is. Forearm and crutch are one link from the elbow to the tip, as the cuff
holds them: shoulder and tip decide where the elbow and the grip are.

Stride and stance are those of a walk: at 0.81 m/s, the speed on forearm crutches of Demir and Yildirim, Neurosciences
24:36 (2019), `walk` has strides of 1.16 m and 65 % stance, where they measured 1.17 m and 63 %.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pftrack_sim.agents.gait.mobility import rotation, smooth_step
from pftrack_sim.core.data_files import asset_table
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scene.people.anatomy import Anatomy
from pftrack_sim.scene.people.mobility import scale

_INVOLVED = 1  # Side of the foot that goes with the crutches
_SWAY = 0.4  # Turns of pelvis and trunk, relative to a walk: both arms go forward together
_TORSO, _UPPER_ARM = 1, 3  # Rows of `person.PARTS`
_LONGEST = 0.999  # Of arm and crutch, relative to the sum of both links


class Crutches:
    """Two crutches and who walks on them.

    Attributes:
        places: `(5, 3)` of their frame, on the ground below the person, both shafts at the grip, and both tips [m].
        turned: `(5, 3, 3)` rotations.
    """

    def __init__(self, body: Anatomy) -> None:
        table, size = asset_table("mobility")["crutches"], scale(body.height_m)
        self._lean_rad = math.radians(table["lean_deg"])
        self._ahead_m, self._aside_m, self._lift_m = size * np.array(table["tips_m"])
        # From the shaft at the height of the grip, x ahead of it and z along it.
        back, bent = math.radians(table["cuff_deg"]), math.radians(table["elbow_deg"] - table["cuff_deg"])
        self._upper_m, self._grip_m = body.upper_arm_m, size * table["grip_m"]
        elbow_x, elbow_z = self._grip_m - body.grip_m * math.sin(back), body.grip_m * math.cos(back)
        shoulder_x, shoulder_z = elbow_x + self._upper_m * math.sin(bent), elbow_z + self._upper_m * math.cos(bent)
        shoulder_m = body.ankle_m + body.shank_m + body.thigh_m + body.pelvis_m + body.torso_m - body.shoulder_drop_m
        away_m = math.hypot(shoulder_m, self._ahead_m, self._aside_m - body.shoulder_half_m)
        self._shaft_m = math.sqrt(away_m**2 - shoulder_x**2) - shoulder_z
        elbow = np.array([elbow_x, self._shaft_m + elbow_z])
        self._lower_m = float(np.hypot(*elbow))
        self._elbow = elbow / self._lower_m
        self.places, self.turned = np.zeros((5, 3)), np.tile(np.eye(3), (5, 1, 1))
        self._tips, self._from, self._stood = np.zeros((2, 3)), np.zeros((2, 3)), False

    def move(self, dt_s: float, person: Any, feet: Any, _grips: Any) -> None:
        """Follow the walk of a person by a tick, or start: set its posture, and the tips."""
        person.lean, person.amplitude = self._lean_rad, _SWAY * person.amplitude
        self.places[0, :2], self.turned[0] = (person.x, person.y), rotation(person.heading, 0.0)
        foot, stands = feet[_INVOLVED], bool(feet[_INVOLVED].in_stance)
        ankle = np.array([foot.ankle_x, foot.ankle_y, 0.0])
        ahead = self._ahead(foot.yaw - foot.toe_out, person.half_m)
        if stands and dt_s == 0.0:
            self._tips = ahead + np.array([foot.foothold_x, foot.foothold_y, 0.0])
        elif stands and not self._stood:
            self._tips = ankle + ahead
        elif not stands:
            if dt_s == 0.0 or self._stood:
                self._from = ahead if dt_s == 0.0 else self._tips - ankle
            phase = (person.phase + 0.5 * _INVOLVED) % 1.0
            share = min(max(phase - foot.toe_off_phase, 0.0) / (1.0 - foot.toe_off_phase), 1.0)
            self._tips = ankle + self._from + smooth_step(share) * (ahead - self._from)
            self._tips[:, 2] += self._lift_m * math.sin(math.pi * share)
        self._stood = stands

    def hold(self, parts: FloatArray, grips: Any) -> None:
        """Set grips and crutches below the shoulders of `(13, 12)` parts: place, then rotation.

        A tip that the arm does not reach is lifted, until it comes down again with the foot.
        """
        trunk = parts[_TORSO, 3:].reshape(3, 3)
        for side in range(2):
            shoulder, pole = parts[_UPPER_ARM + side, :3], trunk @ (-0.5, 0.35 - 0.7 * side, -0.8)
            down = self._tips[side] - shoulder
            reach_m = float(np.linalg.norm(down))
            down /= reach_m
            longest_m = _LONGEST * (self._upper_m + self._lower_m)
            if reach_m > longest_m:
                reach_m, self._tips[side] = longest_m, shoulder + longest_m * down
            back = _unit(pole - (pole @ down) * down)
            cos = (self._upper_m**2 + reach_m**2 - self._lower_m**2) / (2.0 * self._upper_m * reach_m)
            elbow = shoulder + self._upper_m * (cos * down + math.sqrt(max(1.0 - cos * cos, 0.0)) * back)
            tip = shoulder + reach_m * down
            # Of the crutch, which is bent at the grip: x ahead of it and z along it, in the plane of the arm.
            up = _unit(elbow - tip)
            ahead, (x, z) = _unit((back @ up) * up - back), self._elbow
            forward, along = x * up + z * ahead, z * up - x * ahead
            self.places[1 + side], self.places[3 + side] = shaft, tip = tip + self._shaft_m * along, tip
            self.turned[[1 + side, 3 + side]] = np.stack([forward, np.cross(along, forward), along], axis=1)
            grips[side].on = 1.0
            grips[side].x, grips[side].y, grips[side].z = shaft + self._grip_m * forward

    def _ahead(self, yaw: float, half_m: float) -> FloatArray:
        """`(2, 3)` places of both tips as they come down, from the ankle of the involved foot."""
        cos, sin, foot_m = math.cos(yaw), math.sin(yaw), (1.0 - 2.0 * _INVOLVED) * half_m
        left = np.array([self._aside_m - foot_m, -self._aside_m - foot_m])
        return self._ahead_m * np.array([cos, sin, 0.0]) + left[:, None] * np.array([-sin, cos, 0.0])


def _unit(vector: FloatArray) -> FloatArray:
    return vector / np.linalg.norm(vector)
