import math
from collections.abc import Callable

import mujoco
import numpy as np
import pytest

from pftrack_sim.agents.robot.drive import ACCELERATION, camera_pose
from pftrack_sim.agents.robot.steering import Steering
from pftrack_sim.core.proprioception import BEAMS, PROPRIO_INDEX, PROPRIO_NAMES, RANGE_M, proprio_high
from pftrack_sim.scenario.robot import Robot, StillRoute

TICK_S = 1.0 / 60.0
CAR = Robot.model_construct(drive="ackermann", wheelbase_m=0.5, max_steer_deg=30.0, max_steer_deg_s=60.0)


def test_straight_on(lab: Callable):
    world = lab()
    world.run(2.0, forward=1.0)
    rows = world.run(5.0, forward=1.0)
    assert abs((rows[-1, 0] - rows[0, 0]) / (5.0 - 1 / 60) - 1.0) < 0.03
    assert np.abs(rows[:, 1]).max() < 0.02


@pytest.mark.parametrize("turn", [0.8, -1.4])
def test_turn_rate_and_its_sign(lab: Callable, turn: float):
    world = lab()
    world.run(1.5, turn=turn)
    rows = world.run(2.0, turn=turn)
    heading = np.unwrap(rows[:, 2])
    assert abs((heading[-1] - heading[0]) / (2.0 - 1 / 60) / turn - 1.0) < 0.05
    assert np.hypot(rows[:, 0], rows[:, 1]).max() < 0.03


def test_braking_pitches_forward_and_decays(lab: Callable):
    world = lab()
    start = world.run(3.0, forward=1.2)
    assert math.radians(0.2) < start[:60, 6].max() < math.radians(2.0)
    brake = world.run(4.0)
    swing = brake[:, 6]
    assert math.radians(-2.0) < swing.min() < math.radians(-0.2)  # down first
    assert swing[np.argmin(swing) :].max() > math.radians(0.05)  # then back up
    assert np.abs(swing[-30:]).max() < math.radians(0.02)
    assert np.abs(swing[90:120]).max() < math.radians(0.5)


def test_turning_rolls_outwards(lab: Callable):
    world = lab()
    world.run(2.0, forward=1.2)
    rows = world.run(1.0, forward=1.2, turn=1.2)
    assert math.radians(0.1) < rows[:, 7].max() < math.radians(3.0)  # a left turn leans right


def test_acceleration_is_limited(lab: Callable):
    world = lab()
    speeds = []
    for _ in range(30):
        before = world.data.qpos[0]
        world.tick(forward=1.6)
        speeds.append((world.data.qpos[0] - before) * 60.0)
    assert speeds[-1] < ACCELERATION[0] * 0.5 * 1.1
    assert speeds[-1] > ACCELERATION[0] * 0.5 * 0.7


def test_limits_of_the_robot_hold(lab: Callable):
    world = lab(robot=Robot(route=StillRoute(kind="still"), max_speed_m_s=0.5, max_turn_deg_s=30.0))
    world.run(2.0, forward=9.0)
    rows = world.run(1.0, forward=9.0)
    assert abs(rows[-1, 0] - rows[0, 0]) / (1.0 - 1 / 60) < 0.51
    assert world.drive.scaled([2.0, -1.0, 0.5, 0.0]) == pytest.approx((0.5, -math.pi / 6, math.pi / 3, 0.0))


@pytest.mark.parametrize(("joint", "rate"), [("pan", 1.5), ("pan", -0.7), ("tilt", 0.5), ("tilt", -0.9)])
def test_the_head_reaches_its_rate_and_then_stops(lab: Callable, joint: str, rate: float):
    world = lab()
    name = f"robot/{joint}"
    world.run(0.5, **{joint: rate})
    before = world.data.joint(name).qpos[0]
    world.run(0.5, **{joint: rate})
    reached = (world.data.joint(name).qpos[0] - before) / 0.5
    assert abs(reached / rate - 1.0) < 0.02
    world.run(1.0)
    stopped = world.data.joint(name).qpos[0]
    world.run(1.0)
    assert abs(world.data.joint(name).qpos[0] - stopped) < 1e-4


def test_signs_of_pan_and_tilt(lab: Callable):
    world = lab()
    world.run(0.5, pan=1.0, tilt=0.5)
    forward = camera_pose(world.model, world.data)[:3, 2]
    assert forward[1] > 0.1  # to the left
    assert forward[2] > 0.05  # upwards


def test_head_stops_at_its_range(lab: Callable):
    world = lab(mount="left")
    world.run(8.0, pan=2.0, tilt=1.0)
    low, high = world.model.joint("robot/pan").range
    assert low <= world.data.joint("robot/pan").qpos[0] <= high + 1e-3
    start = world.data.joint("robot/pan").qpos[0]
    world.run(0.5, pan=-2.0)  # no wound-up reference to unwind first
    assert world.data.joint("robot/pan").qpos[0] < start - 0.4


@pytest.mark.parametrize("mount", ["front", "left"])
def test_camera_frame_is_opencv(lab: Callable, mount: str):
    world = lab(mount=mount, tilt_deg=-10.0)
    world.drive.reset(world.data, 2.0, -1.0, 0.7)
    T = camera_pose(world.model, world.data)
    assert abs(T[:3, :3] @ T[:3, :3].T - np.eye(3)).max() < 1e-12
    assert np.linalg.det(T[:3, :3]) == pytest.approx(1.0)
    bearing = 0.7 + (math.pi / 2 if mount == "left" else 0.0)
    ahead = T[:3, 3] + 4.0 * np.array([math.cos(bearing), math.sin(bearing), -math.tan(math.radians(10.0))])
    seen = np.linalg.inv(T) @ np.array([*ahead, 1.0])
    assert seen[2] > 3.9
    assert abs(seen[:2] / seen[2]).max() < 2e-3
    assert T[2, 1] < -0.9  # the image's y axis points down
    right = np.linalg.inv(T) @ np.array([ahead[0] + math.sin(bearing), ahead[1] - math.cos(bearing), ahead[2], 1.0])
    assert right[0] > 0.9


def test_reset_sets_the_pose(lab: Callable):
    world = lab()
    world.run(2.0, forward=1.0, turn=0.5)
    world.drive.reset(world.data, 3.0, -2.0, -2.5, pan_rad=0.4)
    assert world.drive.pose(world.data) == pytest.approx((3.0, -2.0, -2.5), abs=1e-3)
    rest = world.run(1.0)
    assert np.ptp(rest[:, :6], axis=0).max() < 1e-4
    forward = camera_pose(world.model, world.data)[:3, 2]
    assert math.atan2(forward[1], forward[0]) == pytest.approx(-2.1, abs=1e-3)


def test_measurements_do_not_change_the_state(lab: Callable):
    observed, reference = lab(), lab()
    for index in range(60):
        for world in (observed, reference):
            world.tick(1.0, 0.5 * math.sin(index))
        for _ in range(3):
            observed.drive.proprio(observed.data)
            camera_pose(observed.model, observed.data)
            observed.drive.collision(observed.data)
            observed.drive.pose(observed.data)
    assert observed.data.qpos.tobytes() == reference.data.qpos.tobytes()
    assert observed.drive.proprio(observed.data).tobytes() == reference.drive.proprio(reference.data).tobytes()


def test_proprioception_agrees_with_the_motion(lab: Callable):
    world = lab(mount="left", tilt_deg=5.0)
    at = PROPRIO_INDEX
    rest = world.drive.proprio(world.data)
    assert rest.shape == proprio_high(BEAMS, RANGE_M).shape == (len(PROPRIO_NAMES),)
    assert rest.dtype == np.float32
    assert rest[at["accelerometer_z_m_s2"]] == pytest.approx(9.81, abs=0.01)
    assert rest[at["pan_rad"]] == pytest.approx(math.pi / 2, abs=1e-3)
    assert rest[at["tilt_rad"]] == pytest.approx(math.radians(5.0), abs=1e-3)
    world.drive.reset(world.data, 4.0, 4.0, 1.0)
    speeding = [world.tick(1.0) or world.drive.proprio(world.data)[at["accelerometer_x_m_s2"]] for _ in range(30)]
    assert np.mean(speeding) == pytest.approx(1.2, abs=0.25)
    world.run(1.5, forward=1.0)
    world.run(1.5, forward=1.0, turn=0.9)
    measured = world.drive.proprio(world.data)
    assert measured[at["gyro_z_rad_s"]] == pytest.approx(0.9, rel=0.05)
    wheels = measured[at["wheel_left_m_s"]], measured[at["wheel_right_m_s"]]
    assert sum(wheels) / 2 == pytest.approx(1.0, rel=0.03)
    assert wheels[1] - wheels[0] == pytest.approx(0.9 * 0.38, rel=0.1)
    x, y, heading = world.drive.pose(world.data)
    start = np.array([[math.cos(1.0), math.sin(1.0)], [-math.sin(1.0), math.cos(1.0)]]) @ np.array([x - 4.0, y - 4.0])
    assert abs(measured[:2] - start).max() < 0.1
    assert abs(math.remainder(float(measured[2]) - (heading - 1.0), 2 * math.pi)) < 0.05
    assert (np.abs(measured) <= proprio_high(BEAMS, RANGE_M)).all()


def test_a_collision_names_what_is_touched(lab: Callable):
    def furnish(spec: mujoco.MjSpec) -> None:
        pillar = spec.worldbody.add_body(name="pillar-3", pos=[1.5, 0, 1])
        geom = pillar.add_geom(type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=[0.2, 1, 0])
        geom.contype, geom.conaffinity = 1, 2
        leg = spec.worldbody.add_body(name="target/left-shank", mocap=True, pos=[-1.5, 0, 0.4])
        limb = leg.add_geom(type=mujoco.mjtGeom.mjGEOM_CAPSULE, size=[0.06, 0.3, 0])
        limb.contype, limb.conaffinity = 4, 2

    world = lab(furnish)
    world.run(0.5)
    assert world.drive.collision(world.data) is None
    world.run(2.5, forward=1.0)
    assert world.drive.collision(world.data) == "pillar-3"
    world.run(4.0, forward=-1.0)
    assert world.drive.collision(world.data) == "target"
    assert world.data.body("robot/base").xmat[8] > 0.99


@pytest.mark.parametrize("speed_m_s", [1.0, -1.0])
def test_a_car_turns_as_commanded_forwards_and_backwards_by_opposite_angles(speed_m_s: float):
    steering = Steering.of(CAR)
    for _ in range(60):
        turn = steering.turn_rad_s(speed_m_s, 0.4, TICK_S)
    assert turn == pytest.approx(0.4)
    assert steering.angle_rad == pytest.approx(math.copysign(math.atan(0.2), speed_m_s))


def test_a_car_turns_no_tighter_than_its_angle_and_steers_no_faster_than_its_rate():
    steering = Steering.of(CAR)
    angles, turns = zip(*((steering.angle_rad, steering.turn_rad_s(0.5, 9.0, TICK_S)) for _ in range(60)), strict=True)
    assert np.diff(angles).max() == pytest.approx(math.radians(60.0) * TICK_S)
    assert turns[-1] == pytest.approx(0.5 * math.tan(math.radians(30.0)) / 0.5)


def test_a_car_that_stands_steers_but_does_not_turn():
    steering = Steering.of(CAR)
    assert [steering.turn_rad_s(0.0, 0.1, 0.1) for _ in range(10)] == [0.0] * 10
    assert steering.angle_rad == pytest.approx(math.radians(30.0))
