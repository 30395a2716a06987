import math
from collections.abc import Callable

import mujoco
import numpy as np
import pytest

from pftrack_sim import controllers, policies
from pftrack_sim.agents.robot.drive import Odometry, OdometryCalibration
from pftrack_sim.core.proprioception import PROPRIO_INDEX, PROPRIO_NAMES, RANGE_ANGLES_RAD, RANGE_M, RANGES
from pftrack_sim.core.random_streams import stream
from pftrack_sim.core.records import Estimate
from pftrack_sim.env.tasks import FollowEnv
from pftrack_sim.scenario.robot import Robot, StillRoute
from pftrack_sim.scene.layout import HIDDEN_GROUP, SCENERY_GROUP
from pftrack_sim.scene.occluders import CartSize, Placement, add_carts, add_static_occluders

WHEEL_RADIUS_M, TRACK_M = 0.0975, 0.38  # Of assets/robot.xml
WHEELS = OdometryCalibration(WHEEL_RADIUS_M, WHEEL_RADIUS_M, TRACK_M)


def test_zero_error_is_the_true_calibration():
    assert WHEELS.sampled(0.0, stream(3, "odometry")) == WHEELS


def test_calibration_errors_have_the_requested_deviation_and_are_independent():
    sampled = [WHEELS.sampled(0.5, stream(seed, "odometry")) for seed in range(300)]
    numbers = np.array([(each.left_radius_m, each.right_radius_m, each.track_m) for each in sampled])
    relative = numbers / (WHEEL_RADIUS_M, WHEEL_RADIUS_M, TRACK_M) - 1.0
    assert (np.abs(relative.std(axis=0) - 0.005) < 0.001).all()
    assert (np.abs(np.corrcoef(relative.T) - np.eye(3)) < 0.2).all()


def test_unequal_wheels_turn_a_straight_drive_as_the_kinematics_predict():
    wrong = OdometryCalibration(WHEEL_RADIUS_M, 1.01 * WHEEL_RADIUS_M, TRACK_M)
    odometry = Odometry()
    for angle in np.linspace(0.0, 60.0, 200):
        odometry = odometry.updated(angle, angle, wrong)
    assert math.isclose(odometry.heading_rad, 0.01 * 60.0 * WHEEL_RADIUS_M / TRACK_M, rel_tol=1e-9)
    assert odometry.y_m > 0.0


def test_on_low_friction_the_wheels_slip_and_the_odometry_overestimates(lab: Callable):
    robot = Robot(route=StillRoute(kind="still"))
    worlds = [lab(robot=robot.model_copy(update={"floor_friction": friction})) for friction in (1.0, 0.03)]
    for world in worlds:
        world.run(1.0, forward=1.2)
    driven_m = [world.drive.pose(world.data)[0] for world in worlds]
    odometry_m = [float(world.drive.proprio(world.data)[PROPRIO_INDEX["odometry_x_m"]]) for world in worlds]
    assert abs(odometry_m[0] - driven_m[0]) < 0.02
    assert driven_m[1] < 0.6 * driven_m[0]
    assert odometry_m[1] > 1.5 * driven_m[1]


def box(x: float, y: float, half: tuple[float, float], group: int = HIDDEN_GROUP) -> Callable[[mujoco.MjSpec], None]:
    def furnish(spec: mujoco.MjSpec) -> None:
        body = spec.worldbody.add_body(name="crate", pos=[x, y, 0.5])
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[*half, 0.5], group=group, contype=1, conaffinity=2)

    return furnish


def ranges(world) -> np.ndarray:
    return world.drive.proprio(world.data)[RANGES]


def test_names_are_in_the_order_of_the_beams():
    assert PROPRIO_NAMES[RANGES][0] == "range_00_m"
    assert len(PROPRIO_NAMES[RANGES]) == len(RANGE_ANGLES_RAD)
    assert RANGE_ANGLES_RAD[0] == -math.pi / 2
    assert RANGE_ANGLES_RAD[-1] == math.pi / 2


@pytest.mark.parametrize("height_m", [0.3, 1.25, 2.5])
def test_in_the_open_nothing_is_measured_not_even_the_robot(lab: Callable, height_m: float):
    world = lab(height_m=height_m)
    for command in ({}, {"forward": 1.6}, {"forward": -1.0, "turn": 1.5}, {"pan": 2.0}):
        world.run(0.4, **command)
        assert (ranges(world) > 4.0).all()


def test_ranges_to_a_wall_satisfy_the_equation_of_its_plane(lab: Callable):
    measured = ranges(lab(furnish=box(2.5, 0.0, (0.5, 4.0))))
    seen = np.abs(RANGE_ANGLES_RAD) < math.radians(60.0)
    np.testing.assert_allclose(measured[seen], 2.0 / np.cos(RANGE_ANGLES_RAD[seen]), atol=0.01)


def test_beams_are_ordered_from_right_to_left_and_limited_in_range(lab: Callable):
    left_box = ranges(lab(furnish=box(0.0, 2.0, (0.3, 0.3))))
    assert abs(left_box[-1] - 1.7) < 0.01
    assert left_box[0] == RANGE_M
    assert (ranges(lab(furnish=box(RANGE_M + 1.0, 0.0, (0.5, 0.5)))) == RANGE_M).all()


def test_beams_pass_through_visual_geoms(lab: Callable):
    assert (ranges(lab(furnish=box(2.0, 0.0, (0.3, 0.3), SCENERY_GROUP))) == RANGE_M).all()


@pytest.mark.parametrize("kind", ["pillar", "wall", "boxes"])
def test_static_occluders_are_measured(lab: Callable, kind):
    placement = Placement(kind, (2.5, 0.0), (0.6, 0.2), math.pi / 2, 0.9, 0.5, ())
    measured = ranges(lab(furnish=lambda spec: add_static_occluders(spec, {"occluder-1": placement})))
    assert abs(measured[18] - 2.3) < 0.01
    assert measured[18 - 4] == RANGE_M


@pytest.mark.parametrize("height_m", [0.5, 1.9])
def test_carts_are_measured(lab: Callable, height_m: float):
    world = lab(furnish=lambda spec: add_carts(spec, {"cart-1": CartSize(0.5, height_m)}))
    world.data.mocap_pos[world.model.body("cart-1").mocapid[0]] = (2.5, 0.0, 0.0)
    mujoco.mj_kinematics(world.model, world.data)
    assert abs(ranges(world)[18] - 2.26) < 0.01


def test_beams_field_and_range_are_those_of_the_scenario():
    """A wider, finer scan sees what the default one sees, between its beams and beside them, and farther."""
    keys = {"beams": 145, "field_deg": 270.0, "range_m": 12.0}
    overrides = {"duration_s": 5, "occluders": [], "lights.shadows": False}
    own = {**overrides, **{f"robot.range_finder.{key}": value for key, value in keys.items()}}
    plain, wide = (FollowEnv("corridor", one, image=False) for one in (overrides, own))
    for env, beams, range_m in ((plain, 37, 5.0), (wide, 145, 12.0)):
        observation, _ = env.reset(seed=1)
        high = env.observation_space["proprio"].high[RANGES]
        assert high.shape == observation["proprio"][RANGES].shape == (beams,)
        assert (high == range_m).all()
    few, many = (env.simulation.world.proprio()[RANGES] for env in (plain, wide))
    angles = np.linspace(-135.0, 135.0, 145)
    same = np.arange(24, 121, 8)
    # Every third beam of 5 degrees lies on every eighth of 1.875 degrees.
    np.testing.assert_allclose(angles[same], np.degrees(RANGE_ANGLES_RAD)[::3], atol=1e-9)
    np.testing.assert_allclose(np.minimum(many[same], RANGE_M), few[::3], atol=1e-5)
    assert (many > RANGE_M).any()
    controller = controllers.make("servo-avoid")
    controller.reset(policies.robot_parameters(wide.simulation.settings))
    truth = wide.simulation.frame.truth
    command = controller.act(Estimate(truth.box), wide.simulation.world.proprio())
    assert np.isfinite(command).all()
