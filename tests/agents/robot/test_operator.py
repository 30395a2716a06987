"""The operator's laws, on a robot that does at once what it is told."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from render_stage import facing

from pftrack_sim.agents.path import Path
from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap
from pftrack_sim.agents.robot.drive import ACCELERATION, camera_pose
from pftrack_sim.agents.robot.head import Events, Head, Wander, bearing, gaze_rate
from pftrack_sim.agents.robot.lane import CLEARANCE_M, Lane, Nearness
from pftrack_sim.agents.robot.script import Script, Stops
from pftrack_sim.core.errors import ParameterError, ScenarioError
from pftrack_sim.scenario.load import load
from pftrack_sim.scenario.robot import (
    CHARACTERS,
    OWN_RADIUS_M,
    BesideRoute,
    Operator,
    Robot,
    Route,
    StillRoute,
    TrailRoute,
)
from pftrack_sim.scene.layout import Footprint, WalkableArea

STRAIGHT = Path([(0, 0), (60, 0)])
TRAIL = TrailRoute(kind="trail", distance_m=3.5)
HALF_VIEW_RAD = math.atan(math.tan(math.radians(25.0)) * 4.0 / 3.0)
WALK_M_S = 1.2


def camera(x: float, y: float, yaw: float, pitch: float = 0.0) -> np.ndarray:
    """T_world_camera 1.1 m above the ground."""
    return facing(yaw, (x, y, 1.1), pitch)


def drive(
    route: Route, seconds: float, seed: int = 0, tick_s: float = 1 / 60, **operator: Any
) -> dict[str, np.ndarray]:
    """The script of a robot without inertia, behind or beside a target that walks straight on."""
    script = Script(
        Robot(route=route, operator=Operator(**operator)), STRAIGHT, WALK_M_S, layout=open_place(), seed=seed
    )
    x, y, heading, pan = script.start_pose()
    pan, tilt = pan or 0.0, 0.0
    rows: dict[str, list[float]] = {"x": [], "y": [], "heading": [], "yaw": [], "bearing": [], "gap": [], "speed": []}
    for tick in range(round(seconds / tick_s)):
        time_s = tick * tick_s
        target = (WALK_M_S * time_s, 0.0)
        T = camera(x, y, heading + pan, tilt)
        forward, turn = script.drive(time_s, (x, y, heading), target[0])
        pan_rate, tilt_rate = script.gaze(T, target, tick_s, time_s)
        gap = math.dist((x, y), target)
        for key, value in zip(rows, (x, y, heading, heading + pan, bearing(T, target)[0], gap, forward), strict=True):
            rows[key].append(value)
        x, y = x + forward * math.cos(heading) * tick_s, y + forward * math.sin(heading) * tick_s
        heading, pan, tilt = heading + turn * tick_s, pan + pan_rate * tick_s, tilt + tilt_rate * tick_s
    return {key: np.array(values) for key, values in rows.items()}


def lane_of(**operator: Any) -> Lane:
    lane = Lane.of(Robot(route=TRAIL, operator=Operator(**operator)), STRAIGHT)
    assert lane is not None
    return lane


def open_place(*footprints: Footprint) -> WalkableArea:
    return WalkableArea((-30.0, -30.0, 90.0, 30.0), footprints, ())


def test_an_operator_of_zeros_is_the_steady_one():
    head = Head(Operator(), (1.0, 1.0), (2.0, 1.0), seed=3)
    for target in ((4.0, 0.0), (4.0, 0.9), (2.0, -0.8)):
        T = camera(0.0, 0.0, 0.05, 0.02)
        head.reset()
        assert head.rates(T, target, 0.02, 5.0) == tuple(gaze_rate(error, 0.02) for error in bearing(T, target))
    lane = lane_of()
    assert lane.swung(WALK_M_S, ObstacleMap(open_place()), 3) is lane
    assert Nearness(Operator(), 3).at(7.0) == (1.0, 0.0)
    assert Stops(Operator(), 3).turn_rad_s(7.0) is None


def test_the_bearing_is_to_the_left_and_up_of_the_optical_axis():
    T = camera(1.0, 2.0, math.radians(90.0))
    left, up = bearing(T, (0.0, 3.0))
    assert left == pytest.approx(math.radians(45.0))
    assert up == pytest.approx(math.atan2(1.1 - T[2, 3], math.sqrt(2.0)))


@pytest.mark.parametrize("character", CHARACTERS)
def test_a_character_gives_the_keys_left_out(character: str):
    given = Operator.model_validate({"character": character, "wander_s": 9.0})
    assert given.wander_s == 9.0
    wanted = {**CHARACTERS[character], "wander_s": 9.0}
    assert {key: getattr(given, key) for key in wanted} == wanted


def test_an_unknown_character_is_an_error_with_the_nearest_name():
    with pytest.raises(ScenarioError, match=r"robot\.operator\.character.*'averag'.*average"):
        load("plaza-walk", {"robot.operator.character": "averag"})


def test_equal_seeds_move_equally_and_others_do_not():
    runs = [drive(TRAIL, 6.0, seed, character="hasty") for seed in (4, 4, 5)]
    for key, values in runs[0].items():
        assert (values == runs[1][key]).all()
    assert abs(runs[0]["yaw"] - runs[2]["yaw"]).max() > math.radians(5.0)


def test_the_motion_does_not_depend_on_the_rate_of_the_camera():
    fast, slow = (drive(TRAIL, 8.0, 2, 1 / rate, character="average") for rate in (100, 50))
    assert abs(fast["yaw"][::2] - slow["yaw"]).max() < math.radians(2.0)
    assert np.hypot(fast["x"][::2] - slow["x"], fast["y"][::2] - slow["y"]).max() < 0.08


@pytest.mark.slow
def test_the_aim_wanders_by_its_rms_at_its_period():
    times = np.arange(0.0, 4000.0, 0.25)
    value = np.array([Wander(0.2, 4.0, np.random.default_rng(0)).at(t) for t in times.tolist()])
    assert abs(value.std() / 0.2 - 1.0) < 0.03
    # A process of mean frequency f crosses zero 2 f times a second.
    crossings = np.count_nonzero(np.diff(np.sign(value))) / times[-1]
    assert abs(crossings / (2.0 / 4.0) - 1.0) < 0.15


def test_glances_leave_the_wandering_as_it_is():
    rare, often = (
        Head(Operator(wander_deg=8.0, glances_per_minute=rate), (0.5, 0.4), (2.0, 1.0), 1) for rate in (0.0, 20.0)
    )
    aims = np.array([(rare.aim(t), often.aim(t)) for t in np.arange(0.0, 60.0, 0.1).tolist()])
    same = (aims[:, 0] == aims[:, 1]).all(axis=1)
    assert 0.4 < same.mean() < 0.9


def test_the_drive_stays_within_its_limits(lab: Callable[..., Any]):
    robot = Robot(route=TRAIL, operator=Operator(character="hasty", stops_per_minute=12.0))
    world = lab(robot=robot)
    script = Script(robot, STRAIGHT, WALK_M_S, seed=1)
    world.drive.reset(world.data, *script.start_pose())
    poses = []
    for tick in range(8 * 60):
        time_s, pose = tick / 60, world.drive.pose(world.data)
        T, target = camera_pose(world.model, world.data), (WALK_M_S * time_s, 0.0)
        poses.append((*pose, math.atan2(T[1, 2], T[0, 2])))
        world.tick(*script.drive(time_s, pose, target[0]), *script.gaze(T, target, 1 / 60, time_s))
    x, y, heading, yaw = np.unwrap(np.array(poses), axis=0).T
    speed = 60.0 * np.hypot(np.diff(x), np.diff(y))
    assert 1.2 < speed.max() < 1.05 * robot.max_speed_m_s
    # Over a quarter of a second, in which suspension and tyres have settled.
    assert np.abs(speed[15:] - speed[:-15]).max() < 0.25 * 1.1 * ACCELERATION[0]
    assert 60.0 * np.abs(np.diff(heading)).max() < 1.1 * math.radians(robot.max_turn_deg_s)
    head_rad_s = 60.0 * np.abs(np.diff(yaw - heading))
    assert math.radians(30.0) < head_rad_s.max() < 1.1 * math.radians(robot.max_pan_deg_s)


def test_events_come_as_often_and_last_as_long_as_asked():
    events = Events(6.0, 2.0, np.random.default_rng(0))
    times = np.arange(0.0, 3000.0, 0.05)
    on = np.array([events.at(t) is not None for t in times.tolist()])
    begins = np.count_nonzero(np.diff(on.astype(int)) == 1)
    assert abs(begins / (times[-1] / 60.0) / 6.0 - 1.0) < 0.1
    assert abs(on.mean() * times[-1] / begins / 2.0 - 1.0) < 0.1
    assert not on[times < 2.0].any()


@pytest.mark.parametrize("damping", [0.3, 0.5])
def test_the_head_overshoots_as_its_damping_says(damping: float):
    head = Head(Operator(dead_zone_deg=0.0, head_hz=0.8, head_damping=damping), (0.5, 0.4), (9.0, 9.0), 0)
    target = (4.0 * math.cos(0.2), 4.0 * math.sin(0.2))
    yaw, yaws = 0.0, []
    for tick in range(1000):
        yaws.append(yaw)
        yaw += 0.002 * head.rates(camera(0.0, 0.0, yaw), target, 0.002, tick * 0.002)[0]
    overshoot = math.exp(-math.pi * damping / math.sqrt(1.0 - damping**2))
    assert abs(max(yaws) / 0.2 - 1.0 - overshoot) < 0.02


def test_the_head_answers_after_the_reaction_time():
    head = Head(Operator(reaction_s=0.3, dead_zone_deg=0.0, keep_in_view=False), (0.5, 0.4), (9.0, 9.0), 0)
    first = next(
        time_s
        for time_s in np.arange(0.0, 3.0, 0.02).tolist()
        if head.rates(camera(0.0, 0.0, 0.0), (4.0, 0.5 if time_s >= 1.0 else 0.0), 0.02, time_s)[0] != 0.0
    )
    assert abs(first - 1.3) < 0.021


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("route", [TRAIL, BesideRoute(kind="beside", distance_m=3.0)])
def test_a_target_that_is_kept_stays_in_view_at_its_edge(route: Route, seed: int):
    wild = {"character": "hasty", "wander_deg": 25.0, "glances_per_minute": 12.0, "glance_deg": 80.0}
    kept, free = (
        np.abs(drive(route, 15.0, seed, keep_in_view=keep, **wild)["bearing"]).max() for keep in (True, False)
    )
    assert 0.6 * HALF_VIEW_RAD < kept < HALF_VIEW_RAD < free


def test_the_base_stands_for_as_long_as_asked_turns_and_goes_on():
    operator = {"stops_per_minute": 6.0, "stop_s": 1.0, "stop_turn_deg": 30.0}
    run = drive(TRAIL, 40.0, **operator)
    standing = run["speed"] == 0.0
    assert 0.05 < standing.mean() < 0.5
    assert math.radians(15.0) < np.ptp(run["heading"]) < math.radians(78.0)
    assert run["gap"].max() < 3.5 + 2.0 + 0.7
    still = drive(StillRoute(kind="still", start_m=(5.0, -5.0)), 40.0, **operator)
    assert np.ptp(still["x"]) == 0.0
    assert math.radians(15.0) < np.ptp(still["heading"]) < math.radians(78.0)
    assert abs(still["heading"][-1]) < math.radians(40.0)


@pytest.mark.parametrize("route", [TRAIL, BesideRoute(kind="beside", distance_m=3.0)])
def test_the_distance_varies_by_its_ratio(route: Route):
    gaps = [drive(route, 36.0, seed, distance_ratio=1.6, distance_period_s=30.0)["gap"] for seed in (0, 1)]
    for gap in gaps:
        assert abs(np.ptp(np.log(gap)) / math.log(1.6) - 1.0) < 0.2


@pytest.mark.parametrize("seed", range(2))
def test_swings_are_as_wide_as_asked_and_begin_on_the_route(seed: int):
    run = drive(TRAIL, 30.0, seed, swing_m=0.8, swing_every_m=9.0)
    steady = drive(TRAIL, 0.1, seed)
    assert [run[key][0] for key in ("x", "y", "heading")] == [steady[key][0] for key in ("x", "y", "heading")]
    assert 0.5 * 0.8 < np.abs(run["y"]).max() < 0.9
    assert run["y"].max() > 0.3 > -0.3 > run["y"].min()


@pytest.mark.parametrize("seed", range(4))
def test_swings_keep_clear_of_walls_and_furniture(seed: int):
    wall = Footprint("wall", (30.0, 1.2), (40.0, 0.1))
    box = Footprint("box", (8.0, -1.0), (0.3, 0.3), 0.4)
    obstacles = ObstacleMap(open_place(wall, box))
    swung = lane_of(swing_m=1.5, swing_every_m=8.0).swung(WALK_M_S, obstacles, seed)
    points = np.stack(swung.path.at(np.arange(0.0, swung.path.length_m, 0.05))[:2], axis=1)
    assert obstacles.clearance_m(points).min() > OWN_RADIUS_M + CLEARANCE_M - 0.05
    assert np.ptp(points[:, 1]) > 0.6


def test_swings_without_room_are_an_error():
    walls = [Footprint(side, (30.0, y), (50.0, 0.1)) for side, y in (("left", 0.65), ("right", -0.65))]
    with pytest.raises(ParameterError, match=r"swing_m.*walls and furniture leave"):
        lane_of(swing_m=1.0).swung(WALK_M_S, ObstacleMap(open_place(*walls)), 0)


def test_a_route_through_an_obstacle_is_found_if_the_episode_gets_there():
    place = open_place(Footprint("kiosk", (12.0, 0.3), (0.5, 0.5)), Footprint("bench", (5.0, 1.5), (0.5, 0.5)))
    script = Script(Robot(route=TRAIL), STRAIGHT, WALK_M_S, layout=place)
    hit = script.obstacle(place, 20.0)
    assert hit is not None
    name, x, y = hit
    assert (name, y) == ("kiosk", 0.0)
    assert 11.2 < x < 11.5
    assert script.obstacle(place, 10.0) is None
