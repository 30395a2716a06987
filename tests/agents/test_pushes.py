"""Laws that a thing obeys when it is pushed about among boxes."""

import itertools
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap
from pftrack_sim.agents.pushed_thing import PushedWay
from pftrack_sim.agents.pushes import pushed_way
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.scenario.thing import Push, Thing
from pftrack_sim.scene.layout import Footprint, WalkableArea
from pftrack_sim.scene.thing import half_sizes_m

PILLAR, BENCH = Footprint("pillar", (5.0, 4.0), (0.3, 0.3), 0.4), Footprint("bench", (2.0, 6.0), (1.5, 0.2), 0.0, 0.5)
ROOM = WalkableArea((0.0, 0.0, 10.0, 8.0), (PILLAR, BENCH), ())
OPEN = WalkableArea((-50.0, -50.0, 50.0, 50.0), (), ())
BALL_M, G, STEP_S = 0.11, 9.81, 0.004


def thing(prop: str = "football", *pushes: tuple[float, float, float], **more: float) -> Thing:
    height_m = {"football": 2.0 * BALL_M, "juice": 0.28}.get(prop, 0.3)
    kicks = [Push(at_s=at_s, speed_m_s=speed, direction_deg=way) for at_s, speed, way in pushes]
    return Thing(prop=prop, moves="pushed", height_m=height_m, pushes=tuple(kicks), **more)


def pushed(one: Thing, area: WalkableArea = ROOM, duration_s: float = 12.0, seed: int = 0) -> PushedWay:
    start = (3.0, 3.0) if area is ROOM else (0.0, 0.0)
    return pushed_way(one, start, area, duration_s, np.random.default_rng(seed))


def poses(way: PushedWay, duration_s: float = 12.0) -> tuple[np.ndarray, np.ndarray]:
    """`(T, 3)` positions and `(T, 4)` quaternions at all samples."""
    found = [way.at_time(index * STEP_S) for index in range(round(duration_s / STEP_S) + 1)]
    return np.array([place for place, _ in found]), np.array([turned for _, turned in found])


def spins(quaternions: np.ndarray) -> np.ndarray:
    """`(T - 1, 3)` angular velocities in the world [rad/s]."""
    turned = Rotation.from_quat(quaternions, scalar_first=True)
    return (turned[1:] * turned[:-1].inv()).as_rotvec() / STEP_S


def test_the_same_seed_gives_the_same_bits_and_another_one_another_way():
    ways = [pushed(thing(), seed=seed) for seed in (3, 3, 4)]
    first, again, other = (np.concatenate(poses(way), axis=1) for way in ways)
    assert first.tobytes() == again.tobytes()
    assert ways[0].pushed_s == ways[1].pushed_s != ways[2].pushed_s
    assert np.abs(first - other).max() > 0.5


@pytest.mark.parametrize("seed", range(4))
def test_energy_is_lost_from_one_push_to_the_next(seed: int):
    way = pushed(thing(restitution=0.9, rolling_resistance=0.1), seed=seed)
    places, turned = poses(way)
    speed, spin = np.diff(places, axis=0) / STEP_S, spins(turned)
    energy = 0.5 * (speed**2).sum(axis=1) + BALL_M**2 / 3.0 * (spin**2).sum(axis=1) + G * places[1:, 2]
    assert len(way.pushed_s) >= 2
    edges = [round(at_s / STEP_S) for at_s in way.pushed_s] + [len(energy)]
    for begin, end in itertools.pairwise(edges):
        # While it touches a wall a part is in the spring between them, for two samples.
        held = np.lib.stride_tricks.sliding_window_view(energy[begin:end], 4).max(axis=1)
        assert np.diff(held).max() < 2e-3


@pytest.mark.parametrize("prop", ["football", "juice", "cube", "car", "litter-bin"])
def test_it_enters_no_wall_and_not_the_floor(prop: str):
    pushes = [(0.1, 5.0, 20.0), (3.0, 5.0, 130.0), (6.0, 5.0, -60.0), (9.0, 5.0, 170.0)]
    places, turned = poses(pushed(thing(prop, *pushes)))
    obstacles, half = ObstacleMap(ROOM), half_sizes_m(thing(prop))
    if prop == "football":
        assert obstacles.clearance_m(places[:, :2]).min() > BALL_M - 0.01
        assert np.abs(places[:, 2] - BALL_M).max() < 0.02
        return
    signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    if prop == "litter-bin":
        around = np.linspace(0.0, 2.0 * math.pi, 24)
        rim = np.column_stack([np.cos(around), np.sin(around)])
        signs = np.concatenate([np.column_stack([rim, np.full(24, z)]) for z in (-1.0, 1.0)])
    rotations = Rotation.from_quat(turned[::5], scalar_first=True).as_matrix()
    for place, rotation in zip(places[::5], rotations, strict=True):
        corners = place + (signs * half) @ rotation.T
        assert corners[:, 2].min() > -0.02
        low = corners[corners[:, 2] < BENCH.height_m - 0.02]
        assert obstacles.clearance_m(low[:, :2]).min(initial=1.0) > -0.02


def test_a_ball_rolls_without_slipping_once_a_kick_is_over():
    places, turned = poses(pushed(thing("football", (0.2, 3.0, 30.0)), OPEN, 6.0), 6.0)
    rolling = slice(round(0.8 / STEP_S), round(5.0 / STEP_S))
    speed, spin = (np.diff(places, axis=0) / STEP_S)[rolling], spins(turned)[rolling]
    assert np.hypot(*speed[:, :2].T).min() > 0.5
    # Its top moves forward: the axis is to the left of the way.
    wanted = np.column_stack([-speed[:, 1], speed[:, 0], np.zeros(len(speed))]) / BALL_M
    assert np.linalg.norm(spin - wanted, axis=1).max() < 0.02 * np.linalg.norm(wanted, axis=1).min()
    # Of a hollow ball that slides first, three fifths of the speed are left when it rolls.
    assert np.linalg.norm(speed[0]) == pytest.approx(0.6 * 3.0, rel=0.06)


@pytest.mark.parametrize("resistance", [0.03, 0.08])
def test_a_ball_slows_down_by_its_rolling_resistance(resistance: float):
    way = pushed(thing("football", (0.2, 2.0, 0.0), rolling_resistance=resistance), OPEN)
    early, late = (math.hypot(*way.velocity_m_s(time_s)) for time_s in (0.8, 1.8))
    assert early - late == pytest.approx(0.6 * resistance * G, rel=0.03)


@pytest.mark.parametrize("friction", [0.2, 0.5])
def test_a_box_slides_as_far_as_friction_lets_it_and_lies_still(friction: float):
    way = pushed(thing("car", (0.2, 2.0, 30.0), friction=friction), OPEN)
    assert way.length_m == pytest.approx(2.0**2 / (2.0 * friction * G), rel=0.05)
    end, later = way.at_time(0.2 + 2.0 / (friction * G) + 0.5), way.at_time(11.0)
    assert np.array_equal(end[0], later[0])
    assert np.array_equal(end[1], later[1])
    assert way.velocity_m_s(11.0) == (0.0, 0.0)


@pytest.mark.parametrize("restitution", [0.2, 0.5, 0.9])
def test_it_bounces_off_a_wall_with_its_restitution(restitution: float):
    # A box without friction keeps its speed up to the wall.
    way = pushed(thing("cube", (0.0, 2.0, 0.0), friction=0.0, restitution=restitution))
    speeds = [way.velocity_m_s(index * STEP_S)[0] for index in range(round(6.0 / STEP_S))]
    before, after = max(speeds), min(speeds)
    assert before == pytest.approx(2.0, rel=0.01)
    assert -after == pytest.approx(restitution * 2.0, abs=0.08)


def test_drawn_pushes_wait_until_it_lies_still_and_keep_to_free_ways_near_the_start():
    way = pushed(thing(rolling_resistance=0.3), duration_s=60.0)
    assert len(way.pushed_s) > 5
    for at_s in way.pushed_s:
        assert way.velocity_m_s(at_s - 0.3) == (0.0, 0.0)
        assert math.hypot(*way.velocity_m_s(at_s + 0.02)) > 1.0
    away = np.hypot(*(poses(way, 60.0)[0][:, :2] - (3.0, 3.0)).T)
    assert away.max() < 7.0


def test_its_path_is_where_it_is():
    way = pushed(thing())
    for time_s in np.arange(0.0, 12.0, 0.1).tolist():
        assert np.abs(np.subtract(way.pose(way.s_at(time_s))[:2], way.at_time(time_s)[0][:2])).max() < 0.01
    assert np.array_equal(way.at_time(99.0)[0], way.at_time(12.0)[0])


@pytest.mark.parametrize(
    ("start", "words"),
    [
        ((5.0, 3.65), "'football' would lie in 'pillar' at 5.00, 3.65"),
        ((0.05, 4.0), "would lie in the edge of the walkable area"),
    ],
)
def test_what_lies_in_something_is_an_error(start: tuple[float, float], words: str):
    with pytest.raises(ParameterError, match=words):
        pushed_way(thing(), start, ROOM, 12.0, np.random.default_rng(0))


def test_what_is_never_pushed_stays_and_faces_its_push():
    way = pushed(thing("car", (2.0, 1.0, 90.0)), duration_s=1.0)
    assert way.pushed_s == ()
    assert way.s_at(1.0) == 0.0
    assert way.pose(0.0) == pytest.approx((3.0, 3.0, 0.5 * math.pi))
    assert np.array_equal(way.at_time(0.0)[0], way.at_time(1.0)[0])
    assert way.at_time(0.0)[1] == pytest.approx([math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)])
