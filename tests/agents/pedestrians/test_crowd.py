"""Pedestrians keep their distances, make progress, walk smoothly, and repeat exactly for a seed."""

import math
from typing import get_args

import numpy as np
import pytest

from pftrack_sim.agents.path import Path
from pftrack_sim.agents.pedestrians.crossing import Crossing
from pftrack_sim.agents.pedestrians.crowd import Crowd
from pftrack_sim.agents.pedestrians.goals import PaceChanges, positions_away_from
from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap
from pftrack_sim.agents.pedestrians.oncoming import plan_oncoming_pass
from pftrack_sim.scenario import people
from pftrack_sim.scenario.mobility import Mobility
from pftrack_sim.scene.layout import Footprint, WalkableArea
from pftrack_sim.scene.people.mobility import footprint_m

TICK_S = 1.0 / 60.0
FAR_M = (1e3, 1e3)
PATH_M = ((0.0, 0.0), (6.0, 0.0), (10.0, 0.6), (18.0, -0.4))
TARGET = people.Target(path_m=PATH_M)

HALL = WalkableArea(
    (-3.0, -7.0, 21.0, 8.0),
    (
        *(Footprint(f"pillar-{x}-{y}", (x, y), (0.3, 0.3)) for x in (4.0, 8.0, 12.0) for y in (2.2, -2.5)),
        Footprint("wall-1", (6.0, 5.0), (3.0, 0.1)),
        Footprint("bench", (14.0, 1.8), (0.8, 0.25), 0.5),
        Footprint("wall-2", (16.0, -4.5), (0.1, 2.0), 0.3),
    ),
    ((-2.0, -6.0), (-2.0, 7.0), (19.0, 7.0), (19.5, -6.0), (10.0, 6.5), (10.0, -6.0), (19.0, 1.0)),
)
CORRIDOR = WalkableArea(
    (-3.0, -1.8, 22.0, 1.8),
    (Footprint("plant", (7.0, 1.5), (0.25, 0.25)), Footprint("bin", (13.0, -1.5), (0.2, 0.2))),
    ((-2.0, 0.7), (-2.0, -0.7), (21.0, 0.7), (21.0, -0.7), (10.0, 0.5)),
)
FIELD = WalkableArea((-6.0, -7.0, 20.0, 7.0), (), ())


def crowd_of(layout: WalkableArea, count: int, seed: int) -> Crowd:
    return Crowd(layout, TARGET, Path(PATH_M), people.Distractors(count=count), (), seed, robot_start_m=(-3.0, 0.0))


def walk(crowd: Crowd, duration_s: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`(T, P, 2)` positions, `(T, P)` headings and `(T, 2)` positions of a robot that follows the target."""
    path = Path(PATH_M)
    positions, headings, robots = [crowd.positions_m], [crowd.headings_rad], []
    for tick in range(round(duration_s / TICK_S)):
        x, y, _ = path.at(crowd.target_s_m - 3.0)
        robots.append((float(x), float(y)))
        crowd.tick(TICK_S, (tick + 1) * TICK_S, robots[-1], robots[-1])
        positions.append(crowd.positions_m)
        headings.append(crowd.headings_rad)
    return np.array(positions), np.array(headings), np.array([robots[0], *robots])


def gaps(positions: np.ndarray) -> np.ndarray:
    """`(T, P, P)` distances between people; infinite on the diagonal."""
    distance = np.linalg.norm(positions[:, :, None] - positions[:, None], axis=-1)
    distance[:, np.arange(positions.shape[1]), np.arange(positions.shape[1])] = np.inf
    return distance


@pytest.mark.parametrize("layout", [HALL, CORRIDOR, FIELD], ids=["hall", "corridor", "field"])
@pytest.mark.parametrize(("count", "seed"), [(1, 0), (3, 1), (6, 2), (9, 4), (12, 5)])
def test_distractors_keep_their_distances_and_make_progress(layout: WalkableArea, count: int, seed: int) -> None:
    crowd = crowd_of(layout, count, seed)
    positions, headings, robots = walk(crowd, 25.0)
    assert gaps(positions).min() >= 0.45
    distractors = positions[:, 1:]
    assert np.linalg.norm(distractors - robots[:, None], axis=-1)[1:].min() >= 0.7
    assert ObstacleMap(layout).clearance_m(distractors.reshape(-1, 2)).min() >= 0.25
    speeds = np.linalg.norm(np.diff(distractors, axis=0), axis=-1) / TICK_S
    assert speeds.max() <= 2.6
    assert np.abs(np.diff(headings[:, 1:], axis=0)).max() <= math.radians(120.0) * TICK_S + 1e-9
    # Within any ten seconds, every distractor moves by more than a step.
    for start in range(0, len(positions) - 600, 60):
        assert np.ptp(distractors[start : start + 600], axis=0).max(axis=-1).min() > 0.6


@pytest.mark.parametrize("seed", range(4))
def test_distractors_walk_smoothly_and_face_their_direction_of_travel(seed: int) -> None:
    positions, headings, _ = walk(crowd_of(HALL, 5, seed), 20.0)
    velocity = np.diff(positions[:, 1:], axis=0) / TICK_S
    acceleration = np.linalg.norm(np.diff(velocity, axis=0), axis=-1) / TICK_S
    assert np.percentile(acceleration, 99) <= 3.0
    speed = np.linalg.norm(velocity, axis=-1)
    slip = np.arctan2(velocity[..., 1], velocity[..., 0]) - headings[1:, 1:]
    slip = np.abs((slip + np.pi) % (2.0 * np.pi) - np.pi)[speed > 0.5]
    assert np.degrees(np.median(slip)) <= 5.0
    assert np.degrees(np.percentile(slip, 99)) <= 45.0


@pytest.mark.parametrize("seed", range(3))
def test_start_positions_are_free_and_repeat(seed: int) -> None:
    crowd = crowd_of(HALL, 12, seed)
    start = crowd.positions_m
    assert gaps(start[None]).min() >= 0.9
    assert ObstacleMap(HALL).clearance_m(start[1:]).min() >= 0.4
    first = walk(crowd, 3.0)
    other = walk(crowd_of(HALL, 12, seed), 3.0)
    for one, two in zip(first, other, strict=True):
        assert np.array_equal(one, two)


def test_seeds_differ_and_more_distractors_do_not_change_the_first_ones() -> None:
    few, many = crowd_of(HALL, 3, 7), crowd_of(HALL, 8, 7)
    assert np.array_equal(few.positions_m, many.positions_m[:4])
    assert np.array_equal(few.speeds_m_s, many.speeds_m_s[:4])
    assert not np.array_equal(few.positions_m[1:], crowd_of(HALL, 3, 8).positions_m[1:])


def test_target_stays_on_its_path_among_distractors_and_stops_gently() -> None:
    path = Path(PATH_M)
    crowd = crowd_of(CORRIDOR, 12, 3)
    assert crowd.speeds_m_s[0] == pytest.approx(TARGET.speed_m_s)
    travelled = []
    for tick in range(1200):
        crowd.tick(TICK_S, (tick + 1) * TICK_S, FAR_M, FAR_M)
        travelled.append(crowd.target_s_m)
        x, y, heading = path.at(crowd.target_s_m)
        assert np.abs(crowd.positions_m[0] - (float(x), float(y))).max() <= 1e-9
        assert abs(crowd.headings_rad[0] - float(heading)) <= 1e-9
    speed = np.diff(travelled) / TICK_S
    assert speed.min() >= 0.0
    assert (-np.diff(speed) / TICK_S).max() < 1.2
    assert speed[-1] < 0.02
    assert abs(travelled[-1] - path.length_m) <= 0.01


def test_target_waits_for_a_robot_in_its_way_and_continues() -> None:
    crowd = crowd_of(FIELD, 0, 0)
    for tick in range(600):
        crowd.tick(TICK_S, tick * TICK_S, (4.0, 0.1), FAR_M)
    assert 0.5 <= np.linalg.norm(crowd.positions_m[0] - (4.0, 0.1)) <= 1.5
    assert crowd.speeds_m_s[0] < 0.02
    for tick in range(300):
        crowd.tick(TICK_S, tick * TICK_S, (4.0, 3.0), FAR_M)
    assert crowd.speeds_m_s[0] == pytest.approx(TARGET.speed_m_s)


def test_arrays_are_read_only_and_names_are_in_order() -> None:
    crowd = crowd_of(HALL, 2, 0)
    assert crowd.names == ("target", "distractor-1", "distractor-2")
    for array in (crowd.positions_m, crowd.headings_rad, crowd.speeds_m_s):
        assert len(array) == 3
        assert not array.flags.writeable
    before = crowd.positions_m
    kept = before.copy()
    crowd.tick(TICK_S, TICK_S, FAR_M, FAR_M)
    assert np.array_equal(before, kept)


def test_on_laps_each_oncoming_pedestrian_passes_the_target_once() -> None:
    lap = [(0.0, 0.0), (14.0, 0.0), (14.0, 1.2), (0.0, 1.2)]
    path, layout = Path(lap * 4), WalkableArea((-5.0, -14.0, 19.0, 14.0), (), ((-2.0, -7.5), (4.0, 9.0)))
    obstacles, speed = ObstacleMap(layout), 1.0
    target = people.Target(path_m=tuple(lap * 4), speed_m_s=speed)
    free, passings = positions_away_from(path, obstacles, layout.bounds_m), []
    for at_s in (7.0, 22.0, 37.0, 52.0):
        passings.append(plan_oncoming_pass(at_s, speed * at_s, 0.8, 1.2, path, obstacles, 1, "test", free))
        if passings[-1].waiting_m is not None:
            free = free[(free != passings[-1].waiting_m).any(axis=1)]
    assert sum(one.waiting_m is not None for one in passings) == 3
    crowd = Crowd(layout, target, path, people.Distractors(count=0), (), 0, oncoming=passings)
    positions = [crowd.positions_m]
    for tick in range(round(60.0 / TICK_S)):
        crowd.tick(TICK_S, (tick + 1) * TICK_S, FAR_M, FAR_M)
        positions.append(crowd.positions_m)
    walked = np.array(positions)
    for person, one in enumerate(passings, start=1):
        gap = np.linalg.norm(walked[:, person] - walked[:, 0], axis=1)
        near = np.flatnonzero(gap < 2.5)
        assert abs(gap.argmin() * TICK_S - one.at_s) < 0.3
        assert gap.min() == pytest.approx(0.8, abs=0.1)
        assert np.ptp(near) * TICK_S < 4.0, "it came close once"
        if one.waiting_m is not None:
            waits = walked[: round((one.at_s - 20.0) / TICK_S), person]
            assert np.linalg.norm(waits - one.waiting_m, axis=1).max(initial=0.0) < 0.3
        speeds = np.linalg.norm(np.diff(walked[:, person], axis=0), axis=1) / TICK_S
        assert speeds.max() < 2.41


def test_distractors_pause_and_change_their_pace_as_often_as_asked():
    rngs = [np.random.default_rng(seed) for seed in range(40)]
    now, times, factors = np.zeros(40), np.arange(0.0, 60.0, 0.04), []
    changes = PaceChanges(rngs, 20.0, now)
    for time_s in times:
        changes.update(time_s)
        factors.append(now.copy())
    course = np.array(factors)
    changed = (np.diff(course, axis=0) != 0.0).sum(axis=0)
    assert changed.mean() == pytest.approx(20.0, rel=0.25)
    assert 0.1 < (course == 0.0).mean() < 0.3
    assert (course[course > 0.0] >= 0.55).all()
    paused = Crowd(FIELD, TARGET, Path(PATH_M), people.Distractors(count=4, changes_per_minute=30.0), (), 1)
    positions, *_ = walk(paused, 12.0)
    speeds = np.linalg.norm(np.diff(positions[:, 1:], axis=0), axis=-1) / TICK_S
    assert (speeds < 0.1).mean() > 0.05
    assert speeds.max() < 2.2
    PaceChanges(rngs, 0.0, now).update(1e6)
    assert (now == 1.0).all()


def test_nobody_starts_between_the_robot_and_the_target():
    for seed in range(60):
        others = crowd_of(FIELD, 12, seed).positions_m[1:]
        between = (others[:, 0] > -3.0) & (others[:, 0] < 0.0)
        assert np.abs(others[between, 1]).min(initial=np.inf) > 0.9


RADIUS_M = 0.235  # Of people, half the least distance between two


def into_m(crowd: Crowd, kind: Mobility, height_m: float) -> float:
    """How far the circle of another person is in the footprint of what the target uses."""
    rear_m, front_m, half_m = footprint_m(kind, height_m)
    offset, heading = crowd.positions_m[1:] - crowd.positions_m[0], crowd.headings_rad[0]
    ahead = offset @ (np.cos(heading), np.sin(heading)) - 0.5 * (front_m + rear_m)
    aside = offset @ (-np.sin(heading), np.cos(heading))
    over = np.maximum(np.abs([ahead, aside]).T - (0.5 * (front_m - rear_m), half_m), 0.0)
    return RADIUS_M - float(np.linalg.norm(over, axis=1).min())


@pytest.mark.parametrize("kind", get_args(Mobility))
@pytest.mark.parametrize("layout", [HALL, CORRIDOR, FIELD], ids=["hall", "corridor", "field"])
def test_nobody_enters_what_the_target_rides_or_pushes(layout: WalkableArea, kind: Mobility) -> None:
    target = TARGET.model_copy(update={"uses": kind, "height_m": 1.85})
    for seed in range(3):
        crowd = Crowd(layout, target, Path(PATH_M), people.Distractors(count=9), (), seed)
        for tick in range(round(20.0 / TICK_S)):
            assert into_m(crowd, kind, 1.85) < 0.01
            crowd.tick(TICK_S, (tick + 1) * TICK_S, FAR_M, FAR_M)


def test_who_crosses_to_cover_the_target_from_a_camera_ahead_passes_before_the_pram() -> None:
    target, camera_m = TARGET.model_copy(update={"uses": "pram"}), (11.0, 0.2)
    crossing = Crossing(at_s=3.0, duration_s=0.6, depth=0.9, side=1, waiting_m=(6.5, -2.5), lead_s=2.5)
    crowd = Crowd(FIELD, target, Path(PATH_M), people.Distractors(count=0), [crossing], 0)
    for tick in range(round(6.0 / TICK_S)):
        crowd.tick(TICK_S, (tick + 1) * TICK_S, FAR_M, camera_m)
        assert into_m(crowd, "pram", target.height_m) < 0.01
        if abs((tick + 1) * TICK_S - 3.3) < 0.5 * TICK_S:
            sight = np.array(camera_m) - crowd.positions_m[0]
            offset = crowd.positions_m[1] - crowd.positions_m[0]
            assert abs(sight[0] * offset[1] - sight[1] * offset[0]) / np.linalg.norm(sight) < 0.03, "it covers"


def test_a_target_with_a_pram_stops_for_a_robot_with_the_pram_clear_of_it() -> None:
    crowd = Crowd(FIELD, TARGET.model_copy(update={"uses": "pram"}), Path(PATH_M), people.Distractors(count=0), (), 0)
    for tick in range(900):
        crowd.tick(TICK_S, tick * TICK_S, (5.0, 0.1), FAR_M)
    gap_m = 5.0 - footprint_m("pram", TARGET.height_m)[1] - crowd.positions_m[0, 0]
    assert 0.4 < gap_m < 1.2
