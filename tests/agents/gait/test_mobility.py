"""Riders: hands and feet stay on what they hold and stand on, and wheels turn with the way."""

from __future__ import annotations

import itertools
from typing import get_args

import numpy as np
import pytest

from pftrack_sim.agents.gait.gait import Gait
from pftrack_sim.agents.gait.posture import PLAIN
from pftrack_sim.scenario.mobility import TOP_SPEED_M_S, USUAL_SPEED_M_S, Mobility
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
    for tick in ridden(gait, TOP_SPEED_M_S.get(kind, 1.4), turn_rad_s):
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
        hand = places[fore] - axes[fore] @ (0.0, 0.0, anatomy.grip_m)
        assert np.linalg.norm(hand - [grip.x, grip.y, grip.z]) < 0.015


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "crutches"])
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


GRIPS, TIPS = slice(1, 3), slice(3, 5)  # Of the parts of crutches, the left one first


@pytest.mark.parametrize("height_m", HEIGHTS)
@pytest.mark.parametrize("speed_m_s", [0.3, 0.8, 1.1])
@pytest.mark.parametrize("turn_rad_s", [0.0, -0.35])
def test_tips_of_crutches_stand_still_on_the_ground(height_m: float, speed_m_s: float, turn_rad_s: float):
    tips = np.array([one["places"][TIPS] for one in ridden(riding("crutches", height_m), speed_m_s, turn_rad_s, 14.0)])
    for tip in tips.swapaxes(0, 1):
        loaded = tip[:, 2] < 1e-6
        stances = np.split(tip, np.flatnonzero(np.diff(loaded)) + 1)[1:-1]
        stances = [one for one in stances if one[0, 2] < 1e-6]
        assert len(stances) >= 3
        assert max(np.ptp(one[:, :2], axis=0).max() for one in stances) < 0.01
        assert 0.45 < loaded.mean() < 0.8
        # Between them it goes forward, above the ground.
        assert min(np.linalg.norm(b[0] - a[0]) for a, b in itertools.pairwise(stances)) > 0.2 * height_m
        assert 0.02 < tip[:, 2].max() < 0.1


def test_crutches_go_forward_with_the_right_foot_at_the_stride_that_was_measured():
    gait, speed = riding("crutches", 1.75), 48.48 / 60.0
    tips, foot = [], PARTS.index("right-foot")
    for one in ridden(gait, speed, seconds=9.0):
        tips.append(one["places"][TIPS])
        ahead = tips[-1][:, 0] - one["body"][foot, 0]
        aside = tips[-1][:, 1] - one["body"][0, 1]
        assert np.ptp(ahead) < 1e-9
        assert ahead.min() > -0.1
        assert ahead.max() < 0.3
        assert (np.abs(aside) > 0.22).all()
    x = np.array(tips)[:, 0, 0]
    landed = x[np.flatnonzero((np.diff(x)[1:] == 0.0) & (np.diff(x)[:-1] > 0.0))]
    assert abs(np.diff(landed).mean() - 1.17) < 0.24  # Demir and Yildirim 2019: mean and standard deviation
    assert USUAL_SPEED_M_S["crutches"] == pytest.approx(speed, abs=0.02)


@pytest.mark.parametrize("height_m", HEIGHTS)
def test_forearms_lie_in_the_cuffs_and_a_crutch_is_in_one_piece(height_m: float):
    fore, body_m = PARTS.index("left-forearm"), body(height_m)
    elbows, shafts = [], []
    for one in ridden(riding("crutches", height_m), 0.8, 0.2):
        places, turned = one["places"], one["turned"]
        assert np.abs(turned @ turned.transpose(0, 2, 1) - np.eye(3)).max() < 1e-9
        shafts.append(np.linalg.norm(places[GRIPS] - places[TIPS], axis=1))
        elbows.append([turned[1 + side].T @ (one["body"][fore + side] - places[1 + side]) for side in range(2)])
    assert np.ptp(shafts) < 1e-9
    assert 0.38 * height_m < np.mean(shafts) < 0.5 * height_m
    assert np.ptp(elbows, axis=0).max() < 2e-3
    assert abs(np.linalg.norm(np.mean(elbows, axis=(0, 1))) - body_m.grip_m) < 0.05 * height_m


def test_who_stands_on_crutches_has_both_tips_on_the_ground():
    gait = riding("crutches", 1.75)
    gait.reset(np.zeros((1, 2)), [0.0], [0.0])
    (left, right) = gait.riders[0].places[TIPS]
    assert left[2] == right[2] == 0.0
    assert left[1] > 0.2
    assert right[1] < -0.2
