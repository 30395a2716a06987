"""Riders: hands and feet stay on what they hold and stand on, and wheels turn with the way."""

from __future__ import annotations

import itertools
from typing import get_args

import numpy as np
import pytest

from pftrack_sim.agents.gait.gait import Gait
from pftrack_sim.agents.gait.posture import PLAIN
from pftrack_sim.scenario.mobility import Mobility
from pftrack_sim.scene.people.anatomy import Anatomy, sample_anatomy
from pftrack_sim.scene.people.mobility import parts
from pftrack_sim.scene.people.person import PARTS

KINDS: tuple[Mobility, ...] = get_args(Mobility)
HEIGHTS = (1.1, 1.62, 1.9)
DT = 0.02


def body(height_m: float) -> Anatomy:
    return sample_anatomy(np.random.default_rng(4), height_m)


def riding(kind: Mobility, height_m: float) -> Gait:
    return Gait([body(height_m)], [np.random.default_rng(1)], {0: kind})


def ridden(gait: Gait, speed_m_s: float, turn_rad_s: float = 0.0, seconds: float = 4.0) -> list[dict[str, np.ndarray]]:
    """Positions and rotations of body and parts over `T` ticks, from a ride that has begun."""
    place, heading, ticks = np.zeros((1, 2)), np.zeros(1), list[dict[str, np.ndarray]]()
    gait.reset(place, heading, [speed_m_s])
    for _ in range(round(seconds / DT)):
        middle = heading + 0.5 * turn_rad_s * DT
        heading = heading + turn_rad_s * DT
        place = place + speed_m_s * DT * np.stack([np.cos(middle), np.sin(middle)], -1)
        gait.advance(DT, place, heading, [PLAIN])
        rider = gait.riders[0]
        told = {"body": gait.positions[0], "axes": gait.rotations[0], "places": rider.places, "turned": rider.turned}
        ticks.append({name: array.copy() for name, array in told.items()})
    return ticks


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("height_m", HEIGHTS)
@pytest.mark.parametrize("turn_rad_s", [0.0, 0.5])
def test_limbs_reach_what_they_hold_and_stay_in_one_piece(kind: Mobility, height_m: float, turn_rad_s: float):
    anatomy, gait = body(height_m), riding(kind, height_m)
    rows = {name: PARTS.index(name) for name in PARTS}
    before: np.ndarray | None = None
    for tick in ridden(gait, 1.4, turn_rad_s):
        places, axes = tick["body"], tick["axes"]
        assert np.abs(axes @ axes.transpose(0, 2, 1) - np.eye(3)).max() < 1e-9
        grips = gait._grips[0]
        for side, grip in zip(("left", "right"), grips, strict=True):
            thigh, shank, foot = (rows[f"{side}-{part}"] for part in ("thigh", "shank", "foot"))
            assert abs(np.linalg.norm(places[shank] - places[thigh]) - anatomy.thigh_m) < 1e-9
            end = places[shank] - axes[shank] @ (0.0, 0.0, anatomy.shank_m)
            assert np.linalg.norm(end - places[foot]) < 0.012
            assert grip.on == 1.0
        if before is not None:
            assert np.linalg.norm(places - before, axis=1).max() < 6.0 * DT
        before = places
    for side, grip in zip(("left", "right"), gait._grips[0], strict=True):
        fore = rows[f"{side}-forearm"]
        hand = places[fore] - axes[fore] @ (0.0, 0.0, anatomy.forearm_m + 0.72 * anatomy.hand_m)
        assert np.linalg.norm(hand - [grip.x, grip.y, grip.z]) < 0.015


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("turn_rad_s", [0.0, 0.4])
def test_wheels_roll_as_far_as_their_hubs_travel(kind: Mobility, turn_rad_s: float):
    ticks = ridden(riding(kind, 1.75), 1.2, turn_rad_s)
    checked = 0
    for index, part in enumerate(parts(kind, 1.75)):
        if part.turns != "wheel":
            continue
        way_m = angle = 0.0
        for first, second in itertools.pairwise(ticks):
            # Along the frame: what is ahead of the rear axle moves sideways, too, in a turn.
            ahead = first["turned"][0, :, 0] + second["turned"][0, :, 0]
            way_m += ((second["places"] - first["places"])[index] @ ahead) / np.linalg.norm(ahead)
            turned = first["turned"][index].T @ second["turned"][index]
            angle += np.arctan2(turned[0, 2], turned[0, 0])
        assert abs(angle * part.radius_m - way_m) < 0.01 * way_m
        checked += 1
    assert checked


def test_the_foot_that_kicks_a_scooter_does_not_slide():
    foot, still = PARTS.index("left-foot"), 0
    ticks = ridden(riding("scooter", 1.75), 1.5, seconds=6.0)
    lowest = min(tick["body"][foot, 2] for tick in ticks)
    for first, second in itertools.pairwise(ticks):
        if max(first["body"][foot, 2], second["body"][foot, 2]) < lowest + 0.002:
            assert np.linalg.norm((second["body"] - first["body"])[foot, :2]) < 1e-3
            still += 1
    assert still > 20


@pytest.mark.parametrize("kind", ["bicycle", "scooter"])
def test_a_rider_puts_a_foot_down_at_rest(kind: Mobility):
    gait, anatomy = riding(kind, 1.75), body(1.75)
    foot = PARTS.index("left-foot")
    gait.reset(np.zeros((1, 2)), [0.0], [0.0])
    assert abs(gait.positions[0, foot, 2] - anatomy.ankle_m) < 1e-9


@pytest.mark.parametrize("kind", KINDS)
def test_a_reset_clears_the_ride(kind: Mobility):
    gait = riding(kind, 1.7)
    first, second = ridden(gait, 1.3, 0.3, 0.5), ridden(gait, 1.3, 0.3, 0.5)
    for one, other in zip(first, second, strict=True):
        assert all(np.array_equal(one[name], other[name]) for name in one)
