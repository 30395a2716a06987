"""Targets that physics moves: where they are, what does not change that, and what is refused."""

import math
from typing import Any

import mujoco
import numpy as np
import pytest

from pftrack_sim import scenario
from pftrack_sim.agents.pushed_thing import PushedWay
from pftrack_sim.core.errors import ScenarioError
from pftrack_sim.scene.build import walkable_area
from pftrack_sim.simulation.dry_run import dry_run
from pftrack_sim.simulation.overview import overview
from pftrack_sim.simulation.planning import make_script
from pftrack_sim.simulation.target_path import target_path
from pftrack_sim.simulation.world import World

SHORT: dict[str, Any] = {"duration_s": 6, "lights.shadows": False, "occluders": []}
DRAWN: dict[str, Any] = {**SHORT, "target.thing.pushes": []}
EAST = {"at_s": 0.4, "speed_m_s": 2.5, "direction_deg": 0.0}
BACK = {"at_s": 3.0, "speed_m_s": 3.0, "direction_deg": 180.0}
AHEAD: dict[str, Any] = {**SHORT, "target.path_m": [[4.0, -0.4]], "distractors.count": 0}
TRAIL: dict[str, Any] = {"robot.route": {"kind": "trail", "distance_m": 2.0}}


def resolved(overrides: dict[str, Any], seed: int = 2) -> scenario.ResolvedScenario:
    return scenario.load("objects/kicked-ball", overrides).resolve(seed)


def world(overrides: dict[str, Any], seed: int = 2) -> World:
    return World(resolved(overrides, seed), seed, draws=False)


def ball(simulated: World) -> tuple[np.ndarray, np.ndarray]:
    body = simulated.model.body("target/body").id
    return simulated.data.xpos[body].copy(), simulated.data.xquat[body].copy()


def test_truth_walkers_and_picture_are_told_of_where_physics_has_it():
    simulated = world(SHORT)
    assert isinstance(simulated.path, PushedWay)
    assert simulated.people == ("target", "distractor-1", "distractor-2", "distractor-3")
    moved = 0
    for _ in range(120):
        simulated.advance()
        place, turned = simulated.path.at_time(simulated.time_s)
        there, orientation = ball(simulated)
        assert np.abs(there - place).max() < 1e-9
        assert abs(orientation @ turned) == pytest.approx(1.0, abs=1e-9)
        assert np.abs(simulated.root_poses()[0, :2, 3] - place[:2]).max() < 1e-9
        assert np.abs(np.subtract(simulated.traffic.crowd.tracked_m, place[:2])).max() < 1e-9
        speed = float(simulated.traffic.crowd.speeds_m_s[0])
        if speed > 0.5:
            moved += 1
            heading = simulated.root_poses()[0, :2, 0]
            assert heading @ simulated.path.velocity_m_s(simulated.time_s) > 0.9 * speed
    assert moved > 20


def test_neither_the_robot_nor_other_people_nor_other_axes_change_its_way():
    ways = [
        world(SHORT | more).path
        for more in ({}, {"distractors.count": 0}, {"axes.jitter.severity": 2.0, "axes.distractors.severity": 1.0})
    ]
    assert ways[0] == ways[1] == ways[2] != world(SHORT, seed=3).path
    driven, left = world(SHORT), world(SHORT)
    for _ in range(60):
        driven.advance(np.array([0.5, 0.3, 0.0, 0.0]))
        left.advance()
        assert np.array_equal(ball(driven)[0], ball(left)[0])


def test_it_bounces_off_a_robot_that_stands_and_does_not_touch_it():
    simulated = world(AHEAD | {"target.thing.pushes": [EAST | {"direction_deg": 180.0, "speed_m_s": 4.0}]})
    robot, nearest, places = np.array(simulated.robot_pose()[:2]), math.inf, []
    for _ in range(100):
        simulated.advance()
        assert simulated.collision() is None
        nearest = min(nearest, float(np.hypot(*(ball(simulated)[0][:2] - robot))))
        places.append(simulated.traffic.crowd.positions_m[0, 0])
    assert nearest < 0.6
    assert max(np.diff(places)) > 0.005


def test_what_is_planned_is_what_happens():
    overrides = AHEAD | TRAIL | {"target.thing.pushes": [EAST], "occluders": []}
    settings, simulated = resolved(overrides), world(overrides)
    path = target_path(settings, 2)
    run = dry_run(settings, path, make_script(settings, 2, walkable_area(settings, 2), path), 5.0)
    for _ in range(100):
        simulated.advance()
        camera, target = run.at(simulated.time_s)
        assert np.abs(target[0] - ball(simulated)[0][:2]).max() < 0.02
        assert np.hypot(*(camera[0, :2] - simulated.camera_pose()[:2, 3])) < 0.15


def test_a_ball_touches_the_robot_as_a_ball_and_a_carton_as_a_box():
    kinds = [
        int(world(SHORT | {"target.thing.prop": prop}).model.geom("target/body/bumper").type[0])
        for prop in ("football", "juice", "litter-bin")
    ]
    assert kinds == [mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_CYLINDER]


@pytest.mark.parametrize("place", ["plaza", "corridor", "warehouse"])
def test_without_pushes_or_a_place_they_are_drawn_by_seed(place: str):
    overrides = DRAWN | {"target.path": "auto", "place.kind": place, "duration_s": 12}
    ways = [target_path(resolved(overrides, seed), seed) for seed in (4, 4, 5)]
    assert ways[0] == ways[1] != ways[2]
    for way in ways:
        assert isinstance(way, PushedWay)
        assert len(way.pushed_s) >= 1
        assert way.length_m > 1.0


def test_pushes_are_on_the_map_and_late_ones_and_a_long_rest_are_suspicious():
    found = overview(resolved(AHEAD | {"duration_s": 14, "target.thing.pushes": [EAST, BACK | {"at_s": 20.0}]}), 2)
    assert [event.title for event in found.events] == ["push, 0.4 s"]
    assert found.events[0].target_m == (4.0, -0.4)
    late, rests = found.suspicious
    assert late == "target.thing.pushes.1 at 20 s: after the end of the episode"
    assert rests.startswith("target.thing.pushes: the target is at the end of its")


WRONG: list[tuple[dict[str, Any], str]] = [
    ({"target.path_m": [[3.0, 0.0], [5.0, 0.0]]}, "path_m of a thing that is pushed must be the one point"),
    ({"target.path_m": []}, "where it lies at first, got 0; or set path = 'auto'"),
    ({"target.path_m": [[4.0, 1.74]]}, "target.thing: 'football' would lie in 'wall-north-west' at 4.00, 1.74"),
    ({"target.path_m": [[1.2, -0.4]]}, "'football' would lie in 'robot'"),
    ({"target.actions": [{"kind": "stop", "at_s": 1}]}, "'football' is pushed: give it target.thing.pushes"),
    (
        {"target.thing.moves": "rolling", "target.path_m": [[3, 0], [5, 0]]},
        "pushes need moves = 'pushed', got 'rolling'",
    ),
    ({"target.thing.restitution": 1.2}, "target.thing.restitution"),
    ({"target.thing.pushes": [EAST | {"speed_m_s": 40.0}]}, "target.thing.pushes.0.speed_m_s"),
    ({"target.thing.pushes": [EAST | {"direction": 40.0}]}, "did you mean 'direction_deg'"),
    (AHEAD | TRAIL | {"target.thing.pushes": [EAST, BACK]}, "'football' runs into the robot at "),
]


@pytest.mark.parametrize(("overrides", "message"), WRONG)
def test_what_is_impossible_is_refused(overrides: dict[str, Any], message: str):
    with pytest.raises(ScenarioError) as caught:
        world(SHORT | overrides)
    assert message in str(caught.value)
