"""Collision avoidance of the reactive pedestrians: a social force, and barriers on the distances.

The social force (Zanlungo, Ikeda and Kanda, "Social force model with explicit collision prediction", EPL 93, 2011) is
the repulsion of Helbing and Molnar (1995) between the predicted positions of closest approach. The barriers let a
distance shrink only at a rate proportional to the room left, so that it never falls below its minimum.
"""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.compiled import kernel, part_of_kernel, record_type

FAR_M = 1e6
"""Position of an absent robot: too far to matter to the avoidance."""

_MOVER_FIELDS = (
    "x", "y", "vx", "vy",  # Position [m] and velocity [m/s]
    "heading",  # Of the body [rad]
    "waypoint_x", "waypoint_y",  # Where it walks to [m]
    "speed", "pace",  # Desired speed [m/s], and a factor on it
    "reaction",  # Share of the forces that it reacts to; 0 for what is moved by other laws
    "turns",  # 1 where the heading follows the velocity, at a limited rate
    "extra_m",  # Distance to keep from it, in addition to that from a person
    "rear_m", "front_m",  # Ends of the line along its heading from which that is kept, see `Outline`; 0 of a point
    "ax", "ay",  # Acceleration [m/s^2]
)  # fmt: skip
MOVER = record_type([(name, "f8") for name in _MOVER_FIELDS])
"""A pedestrian, the robot or a cart; all fields are float64, so that an array of them can be viewed as a table."""

_RECTANGLE_FIELDS = ("x", "y", "half_u", "half_v", "cos", "sin", "reach_m")
RECTANGLE = record_type([(name, "f8") for name in _RECTANGLE_FIELDS])
"""An obstacle on the ground: centre, half sizes along its axes [m], yaw, and half its diagonal [m]."""

Movers: TypeAlias = NDArray[Any]  # of MOVER
Rectangles: TypeAlias = NDArray[Any]  # of RECTANGLE

WAITING_REACTION = 0.2
"""Waiting positions are out of the way: pedestrians who wait give way only at close range."""

# Distances that the barriers keep between the centres of two people, from walls, and more from the robot and carts.
PERSON_DISTANCE_M = 0.52
WALL_DISTANCE_M = 0.30
VEHICLE_EXTRA_M = 0.28
BARRIER_RATE_S = 2.6  # Share of the room left by which a distance may shrink per second [1/s].
_BARRIER_SWEEPS = 3

# Repulsion between people.
_FORCE_M_S2 = 2.6
_FORCE_RADIUS_M = 0.62
_FORCE_RANGE_M = 0.24
_FORCE_DECAY_S = 1.3
_LOOKAHEAD_S = 4.0
_PASS_RIGHT_M = 0.18  # Lateral offset assumed between two people on a collision course: both step to their right.
_WEIGHT_BEHIND = 0.25  # Weight of neighbours directly behind (anisotropy of Helbing and Molnar).
_NON_REACTIVE_WEIGHT = 1.7  # Weight of neighbours that do not react: the reactive pedestrian does all the avoiding.
_WALL_FORCE_M_S2 = 1.4
_WALL_FORCE_RANGE_M = 0.14
_NEAR_M = 2.0  # Walls farther away have no influence

_RELAXATION_S = 0.5  # Time constant of taking up the desired velocity (Helbing and Molnar 1995).
_MAX_ACCELERATION_M_S2 = 2.6
_MAX_SPEED_M_S = 2.0
_MAX_BACKWARD_M_S = 0.15
_MAX_HEADING_OFFSET_RAD = 1.1  # Largest angle from the heading to the desired velocity; the rest is turned on the way.
_MAX_TURN_RATE_RAD_S = math.radians(120.0)
_TURN_TIME_CONSTANT_S = 0.2

# Distances restored by shifting positions where the barriers could not keep them.
LEAST_PERSON_M = 0.47
_LEAST_WALL_M = 0.27
_SHIFT_SWEEPS = 6


@kernel
def avoid(movers: Movers, rectangles: Rectangles, tick_s: float) -> None:
    """Move those that react by a tick: to their waypoints, away from others and from walls, with all distances kept.

    Args:
        movers: `(C,)` everything that moves; what does not react has moved already.
        rectangles: `(F,)` obstacles.
        tick_s: Length of the tick.
    """
    _accelerate(movers, rectangles)
    _move(movers, rectangles, tick_s)


@part_of_kernel
def _accelerate(movers: Movers, rectangles: Rectangles) -> None:
    """Write the accelerations of the movers that react: to their waypoints, away from others and from walls."""
    for index in range(len(movers)):
        person = movers[index]
        if person.reaction == 0.0:
            continue
        x, y, vx, vy = person.x, person.y, person.vx, person.vy
        # Towards the next waypoint, along an arc that a walking body can turn.
        to_x, to_y = person.waypoint_x - x, person.waypoint_y - y
        error = (math.atan2(to_y, to_x) - person.heading + math.pi) % (2.0 * math.pi) - math.pi
        speed = person.speed * person.pace * max(math.cos(error), 0.4)
        if person.reaction < 1.0:
            # It comes to rest at its waiting position, and returns to it after stepping aside.
            speed *= min(max((math.sqrt(to_x * to_x + to_y * to_y) - 0.15) / 0.8, 0.0), 1.0)
        direction = person.heading + min(max(error, -_MAX_HEADING_OFFSET_RAD), _MAX_HEADING_OFFSET_RAD)
        facing_x, facing_y = math.cos(person.heading), math.sin(person.heading)
        force_x = force_y = 0.0
        for other_index in range(len(movers)):
            if other_index == index:
                continue
            other = movers[other_index]
            other_x, other_y = _nearest(other, x, y)
            from_x, from_y, rate_x, rate_y = x - other_x, y - other_y, vx - other.vx, vy - other.vy
            # The place of closest approach, with both a little to their right.
            speed2 = rate_x * rate_x + rate_y * rate_y + 1e-4
            ahead_s = min(max(-(from_x * rate_x + from_y * rate_y) / speed2, 0.0), _LOOKAHEAD_S)
            bias = (_PASS_RIGHT_M if ahead_s > 0.0 else 0.0) / math.sqrt(speed2)
            near_x, near_y = from_x + rate_x * ahead_s + rate_y * bias, from_y + rate_y * ahead_s - rate_x * bias
            miss_m = math.sqrt(near_x * near_x + near_y * near_y) + 1e-6
            close = min((_FORCE_RADIUS_M + other.extra_m - miss_m) / _FORCE_RANGE_M, 1.5)
            in_front = -(from_x * facing_x + from_y * facing_y) / math.sqrt(from_x * from_x + from_y * from_y + 1e-12)
            weight = 1.0 if other.reaction > 0.0 else _NON_REACTIVE_WEIGHT
            seen = max(_WEIGHT_BEHIND + (1.0 - _WEIGHT_BEHIND) * 0.5 * (1.0 + in_front), weight - 1.0)
            force = _FORCE_M_S2 * math.exp(close - ahead_s / _FORCE_DECAY_S) * seen * weight / miss_m
            force_x += force * near_x
            force_y += force * near_y
        for wall in range(len(rectangles)):
            distance, away_x, away_y = _from_rectangle(rectangles[wall], x, y)
            if distance < _NEAR_M:
                close = min((WALL_DISTANCE_M - distance) / _WALL_FORCE_RANGE_M, 0.5)
                force = _WALL_FORCE_M_S2 * math.exp(close)
                force_x += force * away_x
                force_y += force * away_y
        ax = (speed * math.cos(direction) - vx) / _RELAXATION_S + force_x * person.reaction
        ay = (speed * math.sin(direction) - vy) / _RELAXATION_S + force_y * person.reaction
        share = min(1.0, _MAX_ACCELERATION_M_S2 / math.sqrt(ax * ax + ay * ay + 1e-9))
        person.ax, person.ay = share * ax, share * ay


@part_of_kernel
def _move(movers: Movers, rectangles: Rectangles, tick_s: float) -> None:
    """Move those that react by a tick of their accelerations, as far as all distances are kept; and turn people.

    Velocities are changed pair by pair, as little as the barriers ask. Where that could not keep the least distances,
    positions are shifted apart, and the velocities with them.
    """
    for index in range(len(movers)):
        person = movers[index]
        if person.reaction > 0.0:
            vx, vy = person.vx + person.ax * tick_s, person.vy + person.ay * tick_s
            facing_x, facing_y = math.cos(person.heading), math.sin(person.heading)
            backward = max(-_MAX_BACKWARD_M_S - (vx * facing_x + vy * facing_y), 0.0)
            share = min(1.0, _MAX_SPEED_M_S / math.sqrt(vx * vx + vy * vy + 1e-9))
            person.vx, person.vy = share * vx + backward * facing_x, share * vy + backward * facing_y
    for _ in range(_BARRIER_SWEEPS):
        for index in range(len(movers)):
            person = movers[index]
            if person.reaction == 0.0:
                continue
            for other_index in range(len(movers)):
                other = movers[other_index]
                if other_index > index or other.reaction == 0.0:
                    distance, away_x, away_y = _from_mover(other, person.x, person.y)
                    room_m = distance - PERSON_DISTANCE_M - other.extra_m
                    opening = away_x * (person.vx - other.vx) + away_y * (person.vy - other.vy)
                    lack = max(-BARRIER_RATE_S * room_m - opening, 0.0)
                    share = 0.5 if other.reaction > 0.0 else 1.0
                    person.vx, person.vy = person.vx + share * lack * away_x, person.vy + share * lack * away_y
                    share = 1.0 - share
                    other.vx, other.vy = other.vx - share * lack * away_x, other.vy - share * lack * away_y
            for wall in range(len(rectangles)):
                distance, away_x, away_y = _from_rectangle(rectangles[wall], person.x, person.y)
                opening = away_x * person.vx + away_y * person.vy
                lack = max(-BARRIER_RATE_S * (distance - WALL_DISTANCE_M) - opening, 0.0)
                person.vx, person.vy = person.vx + lack * away_x, person.vy + lack * away_y
    for index in range(len(movers)):
        person = movers[index]
        if person.reaction > 0.0:
            person.x, person.y = person.x + person.vx * tick_s, person.y + person.vy * tick_s
    for _ in range(_SHIFT_SWEEPS):
        shifted = False
        for index in range(len(movers)):
            person = movers[index]
            if person.reaction == 0.0:
                continue
            for other_index in range(len(movers)):
                other = movers[other_index]
                if other_index > index or other.reaction == 0.0:
                    distance, away_x, away_y = _from_mover(other, person.x, person.y)
                    lack = LEAST_PERSON_M + other.extra_m - distance
                    if lack > 1e-6:
                        shifted, share = True, 0.5 if other.reaction > 0.0 else 1.0
                        _shift(person, share * lack * away_x, share * lack * away_y, tick_s)
                        _shift(other, (share - 1.0) * lack * away_x, (share - 1.0) * lack * away_y, tick_s)
            for wall in range(len(rectangles)):
                distance, away_x, away_y = _from_rectangle(rectangles[wall], person.x, person.y)
                lack = _LEAST_WALL_M - distance
                if lack > 1e-6:
                    shifted = True
                    _shift(person, lack * away_x, lack * away_y, tick_s)
        if not shifted:
            break
    for index in range(len(movers)):
        person = movers[index]
        if person.turns > 0.0:
            vx, vy = person.vx, person.vy
            error = (math.atan2(vy, vx) - person.heading + math.pi) % (2.0 * math.pi) - math.pi
            rate = min(math.sqrt(vx * vx + vy * vy) / 0.4, 1.0) * error / _TURN_TIME_CONSTANT_S
            person.heading += min(max(rate, -_MAX_TURN_RATE_RAD_S), _MAX_TURN_RATE_RAD_S) * tick_s


@part_of_kernel
def _shift(mover: Any, x: float, y: float, tick_s: float) -> None:
    """Displace a mover by a vector [m]; its velocity is that of the whole way."""
    mover.x, mover.y = mover.x + x, mover.y + y
    mover.vx, mover.vy = mover.vx + x / tick_s, mover.vy + y / tick_s


@part_of_kernel
def _nearest(mover: Any, x: float, y: float) -> tuple[float, float]:
    """The point of a mover's line that is nearest to a point."""
    if mover.rear_m == mover.front_m:
        return mover.x, mover.y
    cos, sin = math.cos(mover.heading), math.sin(mover.heading)
    along = min(max((x - mover.x) * cos + (y - mover.y) * sin, mover.rear_m), mover.front_m)
    return mover.x + along * cos, mover.y + along * sin


@part_of_kernel
def _from_mover(mover: Any, x: float, y: float) -> tuple[float, float, float]:
    """Distance of a point from a mover [m], and the direction x, y away from it."""
    near_x, near_y = _nearest(mover, x, y)
    x, y = x - near_x, y - near_y
    distance = max(math.sqrt(x * x + y * y), 1e-6)
    return distance, x / distance, y / distance


@part_of_kernel
def _from_rectangle(rectangle: Any, x: float, y: float) -> tuple[float, float, float]:
    """Signed distance of a point from a rectangle [m], negative inside, and the direction x, y away from it.

    Infinite where it is certainly farther than `_NEAR_M`.
    """
    x, y, near_m = x - rectangle.x, y - rectangle.y, rectangle.reach_m + _NEAR_M
    if x * x + y * y > near_m * near_m:
        return np.inf, 0.0, 0.0
    u, v = rectangle.cos * x + rectangle.sin * y, rectangle.cos * y - rectangle.sin * x
    over_u, over_v = abs(u) - rectangle.half_u, abs(v) - rectangle.half_v
    if over_u <= 0.0 and over_v <= 0.0:
        distance = max(over_u, over_v)
        over_u, over_v = (1.0, 0.0) if over_u > over_v else (0.0, 1.0)
    else:
        over_u, over_v = max(over_u, 0.0), max(over_v, 0.0)
        distance = math.sqrt(over_u * over_u + over_v * over_v)
        over_u, over_v = over_u / distance, over_v / distance
    u, v = math.copysign(over_u, u), math.copysign(over_v, v)
    return distance, rectangle.cos * u - rectangle.sin * v, rectangle.sin * u + rectangle.cos * v
