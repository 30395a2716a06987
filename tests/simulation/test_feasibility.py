"""What cannot be is said before anything is drawn."""

from typing import Any

import pytest

from pftrack_sim import scenario
from pftrack_sim.core.errors import ScenarioError
from pftrack_sim.simulation.world import World

EASY: dict[str, Any] = {"distractors.count": 0, "occluders": [], "duration_s": 10.0}


def still(x: float, y: float, heading_deg: float = 0.0) -> dict[str, Any]:
    return {"robot.route": {"kind": "still", "start_m": [x, y], "heading_deg": heading_deg}}


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {"target.path_m": [[2, 0], [2, 12]], **still(0, 0)},
            "target.path_m: the target would walk through 'wall-north-west'",
        ),
        ({"target.path_m": [[-5, 0], [-30, 0]], **still(0, 0)}, "the target would leave the walkable area"),
        (still(0, 30), "robot.route: the robot would be outside the walkable area"),
        (still(4, 0), "robot.route: the robot would stand on the target"),
        ({"robot.route": {"kind": "trail", "distance_m": 0.2}}, "robot.route: the robot would stand on the target"),
        ({**still(-3, 0, 180.0), "robot.gaze": "forward"}, "robot.gaze: the target is never in view"),
        ({**still(-3, 0), "robot.gaze": "forward", "camera.mount": "back"}, "robot.gaze: the target is never in view"),
        (
            {**still(2, 1.2), "robot.gaze": "forward", "camera.mount": "right"},
            "robot.gaze: the target leaves the view for good after [23].% of its way",
        ),
    ],
)
def test_an_impossible_place_is_one_error(changes: dict[str, Any], words: str):
    settings = scenario.load("easy/corridor", {**EASY, **changes}).resolve(0)
    with pytest.raises(ScenarioError, match=words):
        World(settings, 0)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"target.path_m": [[0, 0], [12, 0]]}, "the target would walk through 'pillar-2' at 4."),
        ({"robot.route": still(5, 0)["robot.route"]}, "the robot would stand in 'pillar-2' at 5.0, 0.0"),
    ],
)
def test_the_thing_in_the_way_is_named(changes: dict[str, Any], words: str):
    settings = scenario.load("warehouse", {**EASY, "target.actions": [], **still(-3, 1), **changes}).resolve(0)
    with pytest.raises(ScenarioError, match=words):
        World(settings, 0)


def test_a_path_through_a_wall_is_named_before_the_swing_that_it_leaves_no_room_for():
    settings = scenario.load("corridor", {**EASY, "target.path_m": [[2, 0], [2, 12]]}).resolve(0)
    with pytest.raises(ScenarioError) as caught:
        World(settings, 0)
    assert [problem.partition(": ")[0] for problem in caught.value.problems] == [
        "target.path_m",
        "robot.operator.swing_m",
    ]


def test_a_target_that_comes_into_view_or_is_turned_to_is_possible():
    World(scenario.load("easy/corridor", {**EASY, **still(-3, 0), "camera.mount": "back"}).resolve(0), 0)
    World(scenario.load("easy/corridor", {**EASY, **still(6, 1.2, -90), "robot.gaze": "forward"}).resolve(0), 0)


def test_a_path_may_end_a_metre_outside_the_walkable_area():
    """As that of `ko2012/video-2`, at whose end the target arrives on one seed of twenty."""
    changes = {**EASY, "target.actions": [], "target.path_m": [[24.0, 0.0], [31.0, -0.3]], **still(18, 0)}
    World(scenario.load("easy/plaza-walk", changes).resolve(0), 0)
    changes["target.path_m"] = [[24.0, 0.0], [31.1, -0.3]]
    with pytest.raises(ScenarioError, match=r"the target would leave the walkable area .* at 31\.\d"):
        World(scenario.load("easy/plaza-walk", changes).resolve(0), 0)
