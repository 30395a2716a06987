import math
from collections.abc import Callable

import numpy as np

from pftrack_sim.agents.robot.sensors import Odometry, OdometryCalibration
from pftrack_sim.core.proprioception import PROPRIO_INDEX
from pftrack_sim.core.random_streams import stream
from pftrack_sim.scenario.model import Robot, StillRoute
from pftrack_sim.scene.robot import TRACK_M, WHEEL_RADIUS_M


def test_no_error_is_the_truth():
    assert OdometryCalibration.sampled(0.0, stream(3, "odometry")) == OdometryCalibration()


def test_errors_have_the_spread_asked_for_and_their_own_draw():
    drawn = [OdometryCalibration.sampled(0.5, stream(seed, "odometry")) for seed in range(300)]
    numbers = np.array([(one.left_radius_m, one.right_radius_m, one.track_m) for one in drawn])
    relative = numbers / (WHEEL_RADIUS_M, WHEEL_RADIUS_M, TRACK_M) - 1.0
    assert (np.abs(relative.std(axis=0) - 0.005) < 0.001).all()
    assert (np.abs(np.corrcoef(relative.T) - np.eye(3)) < 0.2).all()


def test_unequal_wheels_bend_a_straight_way_by_what_the_kinematics_say():
    wrong = OdometryCalibration(right_radius_m=1.01 * WHEEL_RADIUS_M)
    odometry = Odometry()
    for angle in np.linspace(0.0, 60.0, 200):
        odometry = odometry.updated(angle, angle, wrong)
    assert math.isclose(odometry.heading_rad, 0.01 * 60.0 * WHEEL_RADIUS_M / TRACK_M, rel_tol=1e-9)
    assert odometry.y_m > 0.0


def test_ice_makes_the_wheels_spin_and_the_odometry_dream(lab: Callable):
    dry = Robot(route=StillRoute(kind="still"))
    worlds = [lab(robot=dry.model_copy(update={"floor_friction": grip})) for grip in (1.0, 0.03)]
    for world in worlds:
        world.run(1.0, forward=1.2)
    went = [world.drive.pose(world.data)[0] for world in worlds]
    dreamt = [float(world.drive.proprio(world.data)[PROPRIO_INDEX["odometry_x_m"]]) for world in worlds]
    assert abs(dreamt[0] - went[0]) < 0.02
    assert went[1] < 0.6 * went[0]
    assert dreamt[1] > 1.5 * went[1]
