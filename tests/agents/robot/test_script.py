import math
from collections.abc import Callable

import numpy as np
import pytest

from pftrack_sim.agents.path import Path
from pftrack_sim.agents.robot.drive import camera_pose
from pftrack_sim.agents.robot.script import Script
from pftrack_sim.scenario.robot import BesideRoute, Robot, StillRoute, TrailRoute, WaypointRoute

S_CURVE = [(0, 0), (5, 0), (5, 4), (10, 4), (14, 0)]
STRAIGHT = [(0, 0), (20, 0)]
TICK_S = 1.0 / 60.0


def follow(lab: Callable, robot: Robot, points, seconds: float, speed: float = 1.25, **camera) -> dict[str, np.ndarray]:
    """Run the script with a target that walks at constant speed and stops at the end."""
    world = lab(robot=robot, **camera)
    path = Path(points)
    script = Script(robot, path, speed)
    world.drive.reset(world.data, *script.start_pose())
    rows: dict[str, list] = {"pose": [], "bearing": [], "gap": [], "target": []}
    for tick in range(round(seconds / TICK_S)):
        s = min(speed * tick * TICK_S, path.length_m)
        target = np.array(path.at(s)[:2])
        T, pose = camera_pose(world.model, world.data), world.drive.pose(world.data)
        seen = T[:3, :3].T @ (np.array([*target, 1.1]) - T[:3, 3])
        rows["pose"].append(pose)
        rows["bearing"].append(math.atan2(seen[0], seen[2]))
        rows["gap"].append(math.dist(pose[:2], target))
        rows["target"].append(target)
        world.tick(*script.drive(tick * TICK_S, pose, s), *script.gaze(T, target, TICK_S))
    return {key: np.array(values) for key, values in rows.items()}


def max_distance_m(path: Path, xy: np.ndarray) -> float:
    x, y, _ = path.at(np.linspace(-6.0, path.length_m + 1.0, 3000))
    return float(np.max([np.hypot(x - px, y - py).min() for px, py in xy]))


def test_waypoints_are_driven_through_and_the_last_is_a_stop(lab: Callable):
    route = WaypointRoute(kind="waypoints", points_m=tuple(S_CURVE), speed_m_s=1.0)
    run = follow(lab, Robot(route=route, gaze="forward"), [(0, 8), (9, 8)], 26.0)
    assert max_distance_m(Path(S_CURVE), run["pose"][::20, :2]) < 0.1
    assert math.dist(run["pose"][-1, :2], S_CURVE[-1]) < 0.05
    assert np.ptp(run["pose"][-60:, :2], axis=0).max() < 0.01


def test_trail_keeps_its_distance_on_an_s_curve(lab: Callable):
    run = follow(lab, Robot(route=TrailRoute(kind="trail", distance_m=3.0)), S_CURVE, 12.0)
    assert run["pose"][0] == pytest.approx((-3.0, 0.0, 0.0), abs=1e-2)
    assert max_distance_m(Path(S_CURVE), run["pose"][::20, :2]) < 0.25
    assert run["gap"].max() < 4.2
    assert run["gap"].min() > 1.8  # through the bend the way along the path is longer than the line of sight
    assert np.abs(run["bearing"]).max() < math.radians(27.0)


def test_trail_beside_the_path(lab: Callable):
    run = follow(lab, Robot(route=TrailRoute(kind="trail", distance_m=3.0, offset_m=0.8)), STRAIGHT, 8.0)
    assert np.abs(run["pose"][:, 1] - 0.8).max() < 0.05
    assert abs(run["target"][-1, 0] - run["pose"][-1, 0] - 3.0) < 0.15


@pytest.mark.parametrize(("side", "mount"), [("left", "right"), ("right", "left")])
@pytest.mark.parametrize("points", [STRAIGHT, [(0, 0), (8, 0), (12, 5)]])
def test_beside_runs_abreast_with_the_target_in_view(lab: Callable, side, mount, points):
    robot = Robot(route=BesideRoute(kind="beside", distance_m=2.5, side=side))
    run = follow(lab, robot, points, 12.5, mount=mount)
    assert run["pose"][0] == pytest.approx((0.0, 2.5 if side == "left" else -2.5, 0.0), abs=1e-2)
    assert np.abs(run["bearing"]).max() < math.radians(27.0)
    assert run["gap"].min() > 2.3
    assert run["gap"].max() < 4.2
    assert abs(run["gap"][-1] - 2.5) < 0.3


def test_a_front_camera_beside_the_target_looks_sideways_from_the_first_frame(lab: Callable):
    robot = Robot(route=BesideRoute(kind="beside", distance_m=3.0, lead_m=1.0))
    run = follow(lab, robot, STRAIGHT, 4.0)
    assert run["pose"][0, 0] == pytest.approx(1.0, abs=1e-2)
    assert abs(run["bearing"][0]) < math.radians(2.0)
    assert np.abs(run["bearing"]).max() < math.radians(27.0)


def test_a_still_robot_keeps_the_target_in_view_but_not_centred(lab: Callable):
    robot = Robot(route=StillRoute(kind="still", start_m=(6.0, -4.0), heading_deg=90.0))
    run = follow(lab, robot, [(0, 0), (12, 0)], 9.0)
    assert np.ptp(run["pose"], axis=0).max() < 1e-3
    off = np.abs(run["bearing"])
    assert off.max() < math.radians(20.0)
    assert np.mean(off[60:] > math.radians(3.0)) > 0.8  # in view, not centred


def test_forward_gaze_holds_the_mount(lab: Callable):
    robot = Robot(route=WaypointRoute(kind="waypoints", points_m=((0, 0), (4, 0)), speed_m_s=1.0), gaze="forward")
    world = lab(robot=robot, mount="left")
    script = Script(robot, Path(STRAIGHT), 1.2)
    assert script.start_pose().pan_rad is None
    assert script.gaze(camera_pose(world.model, world.data), (9.0, 9.0), TICK_S) == (0.0, 0.0)


def test_in_a_bend_sharper_than_the_offset_the_robot_waits(lab: Callable):
    robot = Robot(route=BesideRoute(kind="beside", distance_m=3.0, side="left"))
    run = follow(lab, robot, [(0, 0), (7, 0), (7, 7)], 11.0, mount="right")
    assert run["gap"].max() < 5.0
    assert abs(run["pose"][-1, 0] - 4.0) < 0.2
    heading = np.unwrap(run["pose"][:, 2])
    assert heading.min() > -0.3
    assert heading.max() < math.pi / 2 + 0.3
