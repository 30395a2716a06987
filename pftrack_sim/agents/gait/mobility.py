"""People who ride, push themselves or push a pram: where hips, feet and hands are, and how the parts turn.

Everything follows from the way rolled: wheels, pedals, the foot that kicks a scooter and the hands on the rims of a
wheelchair stay on the ground, the pedal or the rim without sliding. Who rides puts a foot down at rest.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pftrack_sim.core.data_files import asset_table
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scenario.mobility import Mobility
from pftrack_sim.scene.people.anatomy import Anatomy
from pftrack_sim.scene.people.mobility import parts, scale

_AT_REST_M_S = 0.06
_FOOT_DOWN_S = 0.4
_STEEPEST = 0.9  # Largest curvature that is steered [1/m]
_LEAN_PER_SPEED = math.radians(1.8)  # Of the walk, which is taken away here
_BANK, _MOST_BANK = -0.6 / 9.81, 0.2  # As the trunk's
_PUSH = (1.15, -0.45, 0.85)  # Way between two pushes [m], and where hands take and leave the rim, from its top [rad]
_ON_DECK_M, _BESIDE_M = (0.40, 0.015, 0.097), 0.14  # Ankle on a scooter's deck, and of the other foot beside it


class Rider:
    """A person and what it uses.

    Attributes:
        places: `(N, 3)` of its parts [m].
        turned: `(N, 3, 3)` their rotations.
    """

    def __init__(self, kind: Mobility, body: Anatomy) -> None:
        self._table: dict[str, Any] = asset_table("mobility")[kind]
        self._kind, self._body, self._scale = kind, body, scale(body.height_m)
        self._parts = parts(kind, body.height_m)
        self.places, self.turned = np.zeros((len(self._parts), 3)), np.zeros((len(self._parts), 3, 3))

    @property
    def _period_m(self) -> float:
        """Way of a turn of the pedals, or between two kicks or pushes."""
        kick_m, _ = self._table.get("kick_m", (_PUSH[0], 0.0))
        return self._scale * self._table.get("development_m", kick_m)

    def move(self, dt_s: float, person: Any, feet: Any, grips: Any) -> None:
        """Follow the walk of a person by a tick, or start: set its posture, feet and grips."""
        rests = person.speed < _AT_REST_M_S
        if dt_s == 0.0:
            self._rolled_m, self._turned_rad, self._steer_rad = person.start_phase * self._period_m, 0.0, 0.0
            self._down, self._last = float(rests), (person.x, person.y, person.heading)
        x, y, heading = self._last
        turned = math.remainder(person.heading - heading, 2.0 * math.pi)
        middle = heading + 0.5 * turned
        self._rolled_m += (person.x - x) * math.cos(middle) + (person.y - y) * math.sin(middle)
        self._turned_rad += turned
        self._last = person.x, person.y, person.heading
        step = dt_s / _FOOT_DOWN_S
        self._down = min(max(self._down + (step if rests else -step), 0.0), 1.0)
        curvature = person.turn / max(person.speed, 0.3)
        bends = self._scale * self._table.get("wheelbase_m", 0.0) * min(max(curvature, -_STEEPEST), _STEEPEST)
        self._steer_rad = math.atan(bends)
        banks = "steering_m" in self._table
        bank = min(max(_BANK * person.speed * person.turn, -_MOST_BANK), _MOST_BANK) if banks else 0.0
        self._frame = rotation(person.heading, bank)
        self._origin = np.array([person.x, person.y, 0.0])
        if "hips_m" in self._table:
            self._sit(person, feet)
        for side, at_m in enumerate(self._hands()):
            grips[side].on = 1.0
            grips[side].x, grips[side].y, grips[side].z = self._origin + self._frame @ at_m
        for index, part in enumerate(self._parts):
            at_m, turn = self._part(part.at_m, part.turns, part.radius_m)
            self.places[index], self.turned[index] = self._origin + self._frame @ at_m, self._frame @ turn

    def _part(self, at_m: FloatArray, turns: str, radius_m: float) -> tuple[FloatArray, FloatArray]:
        pitch = yaw = 0.0
        if turns.endswith("wheel"):
            pitch = (self._rolled_m - at_m[1] * self._turned_rad) / radius_m
        if turns == "crank":
            pitch = self._cranked_rad
        if turns.startswith("steer"):
            yaw, at_m = self._steer_rad, self._steered(at_m)
        return at_m, rotation(yaw, 0.0, pitch)

    def _steered(self, at_m: FloatArray) -> FloatArray:
        axis = np.array([self._scale * self._table["steering_m"], 0.0, 0.0])
        return axis + rotation(self._steer_rad, 0.0) @ (at_m - axis)

    @property
    def _cranked_rad(self) -> float:
        return 2.0 * math.pi * self._rolled_m / self._period_m

    def _sit(self, person: Any, feet: Any) -> None:
        """Set the hips, and the feet below them."""
        table, down = self._table, smooth_step(self._down)
        riding, standing = np.array(table["hips_m"]), np.array(table.get("standing_m", table["hips_m"]))
        ahead_m, up_m = self._scale * (riding + down * (standing - riding))
        sine = self._frame[2, 1]
        aside_m, height_m = -sine * up_m, math.sqrt(1.0 - sine * sine) * up_m
        person.rides, person.ahead_m, person.aside_m, person.hip_m = 1.0, ahead_m, aside_m, height_m
        person.amplitude = person.sway_m = 0.0
        person.lean = math.radians(table["lean_deg"]) - _LEAN_PER_SPEED * person.speed
        for side in range(2):
            at_m, pitch = self._foot(side, down)
            place = self._origin + self._frame @ at_m
            foot = feet[side]
            foot.ankle_x, foot.ankle_y, foot.ankle_z = place[0], place[1], max(place[2], self._body.ankle_m)
            foot.yaw, foot.pitch = person.heading, pitch

    def _foot(self, side: int, down: float) -> tuple[FloatArray, float]:
        """`(3,)` place of an ankle in the frame, and its pitch."""
        sign, body, k = 1.0 - 2.0 * side, self._body, self._scale
        if self._kind == "wheelchair":
            return np.array([0.55 * k, 0.11 * k * sign, 0.118 * k + body.ankle_m]), 0.12
        if self._kind == "bicycle":
            x, z, arm, aside = k * np.array(self._table["crank_m"])
            angle, pitch = self._cranked_rad + side * math.pi + math.pi, -0.25
            pedal = np.array([x + arm * math.sin(angle), sign * aside, z + arm * math.cos(angle) + 0.014 * k])
            ball_x, ball_z = 0.45 * body.foot_m, -body.ankle_m
            cos, sin = math.cos(pitch), math.sin(pitch)
            at_m = pedal - (ball_x * cos - ball_z * sin, 0.0, ball_x * sin + ball_z * cos)
            ground = np.array([0.42 * k, 0.24 * k, body.ankle_m])
        else:
            deck = k * np.array(_ON_DECK_M) + (0.0, 0.0, body.ankle_m)
            if side == 1:
                return deck * (1.0, -1.0, 1.0), 0.0
            at_m, pitch = self._kicking(k)
            ground = np.array([deck[0], _BESIDE_M * k, body.ankle_m])
        if side == 1 or down == 0.0:
            return at_m, pitch
        lift = np.array([0.0, 0.0, 0.05 * k * math.sin(math.pi * down)])
        return at_m + down * (ground - at_m) + lift, (1.0 - down) * pitch

    def _kicking(self, k: float) -> tuple[FloatArray, float]:
        """Ankle and pitch of the foot that kicks: on the ground it stays where it is, then it swings forward."""
        period_m, ground_m = k * np.array(self._table["kick_m"])
        way_m, first_m = self._rolled_m % period_m, (_ON_DECK_M[0] + 0.22) * k
        aside, ankle_m = _BESIDE_M * k, self._body.ankle_m
        if way_m < ground_m:
            share = way_m / ground_m
            x, up, pitch = first_m - way_m, 0.0, -0.5 * share**3
        else:
            share = (way_m - ground_m) / (period_m - ground_m)
            back = 1.0 - smooth_step(share)
            x, up, pitch = first_m - ground_m * back, 0.16 * k * math.sin(math.pi * share) ** 0.8, -0.5 * back
        rise = self._body.foot_m * 0.5 * math.sin(-pitch)
        return np.array([x, aside, ankle_m + up + rise]), pitch

    def _hands(self) -> tuple[FloatArray, FloatArray]:
        """`(3,)` places of both grips in the frame."""
        k = self._scale
        if self._kind == "wheelchair":
            wheel = next(part for part in self._parts if part.radius_m)
            rim_m, _, outward = k * np.array(wheel.shapes["rim"])
            period_m, first, last = k * _PUSH[0], *_PUSH[1:]
            way_m, on_m = self._rolled_m % period_m, (last - first) * wheel.radius_m
            if way_m < on_m:
                angle, out = first + way_m / wheel.radius_m, 0.0
            else:
                share = (way_m - on_m) / (period_m - on_m)
                angle, out = last - (last - first) * smooth_step(share), 0.05 * k * math.sin(math.pi * share)
            aside, reach = wheel.at_m[1] + outward, rim_m + out
            left = np.array([reach * math.sin(angle), aside + out, wheel.at_m[2] + reach * math.cos(angle)])
        else:
            left = k * np.array(self._table["grips_m"])
        both = left, left * (1.0, -1.0, 1.0)
        if "steering_m" not in self._table:
            return both
        return self._steered(both[0]), self._steered(both[1])


def rotation(yaw: float, roll: float, pitch: float = 0.0) -> FloatArray:
    """`(3, 3)` rotation: pitch about y, then roll about x, then yaw about z."""
    cos_y, sin_y, cos_r, sin_r = math.cos(yaw), math.sin(yaw), math.cos(roll), math.sin(roll)
    cos_p, sin_p = math.cos(pitch), math.sin(pitch)
    return np.array([
        [cos_y * cos_p - sin_y * sin_r * sin_p, -sin_y * cos_r, cos_y * sin_p + sin_y * sin_r * cos_p],
        [sin_y * cos_p + cos_y * sin_r * sin_p, cos_y * cos_r, sin_y * sin_p - cos_y * sin_r * cos_p],
        [-cos_r * sin_p, sin_r, cos_r * cos_p],
    ])  # fmt: skip


def smooth_step(share: float) -> float:
    """From 0 to 1, at rest at both ends."""
    return share * share * (3.0 - 2.0 * share)
