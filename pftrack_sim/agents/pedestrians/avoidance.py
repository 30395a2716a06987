"""How people keep out of each other's way.

Two layers. The first makes people move as people do: a social force with explicit collision prediction (Zanlungo,
Ikeda and Kanda, "Social force model with explicit collision prediction", EPL 93, 2011), which is the exponential
repulsion of Helbing and Molnar (1995) acting between the places where two people will be nearest to each other.
The second makes sure: a barrier on the velocity that lets a distance shrink only as fast as there is room left, so
that it never falls below its minimum.

Everything is vectorised over `M` people who can yield and `N` who are there: the same `M` and those who walk on
regardless (the target, a walker while crossing, the robot).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

PERSON_DISTANCE_M = 0.52
"""Distance between two people's centres that the barrier keeps; 0.45 is never passed."""

WALL_DISTANCE_M = 0.30
"""Distance of a person's centre from walls and things that the barrier keeps."""

ROBOT_EXTRA_M = 0.28
"""How much farther people stay from the robot's centre than from a person's."""

FORCE_M_S2 = 2.6
FORCE_RADIUS_M = 0.62
FORCE_RANGE_M = 0.24
FORESIGHT_S = 1.3
"""Strength, contact distance, range and fading with the time ahead of the repulsion between people."""

LOOKAHEAD_S = 4.0
PASS_RIGHT_M = 0.18
"""Two people head on both step to their right, as if already this much off each other's line."""

BEHIND = 0.25
"""Weight of those behind one's back (Helbing and Molnar's anisotropy)."""

YIELD = 1.7
"""Weight of those who do not yield: all the avoiding is left to the others."""

WALL_FORCE_M_S2 = 1.4
WALL_RANGE_M = 0.14

BARRIER_RATE_S = 2.6
"""A distance may shrink by at most this share of the room left per second."""


class Others(NamedTuple):
    """Those around, seen by each person who can yield.

    Attributes:
        state: `(4, N)` x, y [m], vx, vy [m/s], world frame. The first `M` are the people who can yield themselves.
        extra_m: `(N,)` how much farther to stay away than from a person.
        weight: `(N,)` `YIELD` for those who do not yield, 1 for the others.
        share: `(N,)` share of the avoiding that is left to the person who can yield: 1 or 0.5.
        self_m: `(M, N)` a large number where a person meets itself, else 0.
    """

    state: Array
    extra_m: Array
    weight: Array
    share: Array
    self_m: Array


def social_force(others: Others, facing_x: Array, facing_y: Array) -> tuple[Array, Array]:
    """Acceleration by which people avoid each other.

    Args:
        others: Everyone.
        facing_x: `(M,)` unit vectors where people look.
        facing_y: `(M,)`.

    Returns:
        `(M,)` x and `(M,)` y [m/s^2].
    """
    count = len(facing_x)
    x, y, all_vx, all_vy = others.state
    dx, dy = x[:count, None] - x + others.self_m, y[:count, None] - y
    vx, vy = all_vx[:count, None] - all_vx, all_vy[:count, None] - all_vy
    speed2 = vx * vx + vy * vy + 1e-4
    ahead_s = np.minimum(np.maximum(-(dx * vx + dy * vy) / speed2, 0.0), LOOKAHEAD_S)
    # Each is pushed to the right of its motion relative to the other: the same rule for both sends them apart.
    bias = np.where(ahead_s > 0.0, PASS_RIGHT_M, 0.0) / np.sqrt(speed2)
    near_x = dx + vx * ahead_s + vy * bias
    near_y = dy + vy * ahead_s - vx * bias
    miss = np.sqrt(near_x * near_x + near_y * near_y) + 1e-6
    strength = FORCE_M_S2 * np.exp(
        np.minimum((FORCE_RADIUS_M + others.extra_m - miss) / FORCE_RANGE_M, 1.5) - ahead_s / FORESIGHT_S
    )
    distance = np.sqrt(dx * dx + dy * dy)
    in_front = -(dx * facing_x[:, None] + dy * facing_y[:, None]) / distance
    seen = BEHIND + (1.0 - BEHIND) * 0.5 * (1.0 + in_front)
    strength *= np.maximum(seen, others.weight - 1.0) * others.weight / miss
    return (strength * near_x).sum(axis=1), (strength * near_y).sum(axis=1)


def wall_force(distance: Array, away_x: Array, away_y: Array) -> tuple[Array, Array]:
    """Acceleration away from walls, from their `(M, F)` distances and directions: `(M,)` x and y [m/s^2]."""
    strength = WALL_FORCE_M_S2 * np.exp(np.minimum((WALL_DISTANCE_M - distance) / WALL_RANGE_M, 0.5))
    return (strength * away_x).sum(axis=1), (strength * away_y).sum(axis=1)


def barrier_people(others: Others, vx: Array, vy: Array) -> tuple[Array, Array]:
    """The velocities nearest to those wanted that keep people apart.

    Args:
        others: Everyone, with the velocities of those who do not yield.
        vx: `(M,)` wanted velocity [m/s].
        vy: `(M,)`.

    Returns:
        `(M,)` x and `(M,)` y of the velocity [m/s].
    """
    count = len(vx)
    x, y = others.state[:2]
    dx, dy = x[:count, None] - x + others.self_m, y[:count, None] - y
    distance = np.sqrt(dx * dx + dy * dy)
    room = distance - (PERSON_DISTANCE_M + others.extra_m)
    if room.min() > 1.2:
        return vx, vy
    nx, ny = dx / distance, dy / distance
    floor = -BARRIER_RATE_S * room
    all_vx, all_vy = others.state[2:].copy()
    for _ in range(3):
        all_vx[:count], all_vy[:count] = vx, vy
        opening = nx * (vx[:, None] - all_vx) + ny * (vy[:, None] - all_vy)
        lack = floor - opening
        if lack.max() <= 1e-9:
            break
        push = np.maximum(lack, 0.0) * others.share
        vx, vy = vx + (push * nx).sum(axis=1), vy + (push * ny).sum(axis=1)
    return vx, vy


def barrier_walls(distance: Array, away_x: Array, away_y: Array, vx: Array, vy: Array) -> tuple[Array, Array]:
    """The velocities nearest to those wanted `(M,)` that keep people off walls at `(M, F)` distances."""
    room = distance - WALL_DISTANCE_M
    if room.min() > 0.8:
        return vx, vy
    floor = -BARRIER_RATE_S * room
    rows = np.arange(len(vx))
    for _ in range(3):
        lack = floor - (away_x * vx[:, None] + away_y * vy[:, None])
        worst = lack.argmax(axis=1)
        push = np.maximum(lack[rows, worst], 0.0)
        if not push.any():
            break
        vx, vy = vx + push * away_x[rows, worst], vy + push * away_y[rows, worst]
    return vx, vy


def must_brake(distance: Array, away_x: Array, away_y: Array, vx: float, vy: float) -> bool:
    """Whether the walls' barrier would slow down someone at `(1, F)` distances who walks at this velocity."""
    return bool((away_x * vx + away_y * vy < -BARRIER_RATE_S * (distance - WALL_DISTANCE_M)).any())
