import math

import numpy as np
import pytest
from playground import SIZE, Playground, started

from pftrack_sim import controllers
from pftrack_sim.controllers import Controller, RobotParameters
from pftrack_sim.controllers.visual_servo import ACCELERATION, VisualServo
from pftrack_sim.core.errors import ParameterError, UnknownNameError
from pftrack_sim.core.proprioception import PROPRIO_INDEX, PROPRIO_NAMES
from pftrack_sim.core.records import Estimate


@pytest.mark.parametrize("target", [(6.0, 0.0), (4.0, 2.5), (2.2, -0.8), (5.0, -2.5)])
def test_servo_converges_to_the_desired_distance_and_bearing(target):
    world = Playground(target)
    world.play(started(), 15.0)
    assert abs(world.distance_m - 3.0) < 0.15
    assert abs(world.bearing_rad) < math.radians(1.0)
    assert abs(world.pan) < math.radians(2.0)
    assert abs(world.rates).max() < 0.02


@pytest.mark.parametrize("velocity", [(1.25, 0.0), (0.9, 0.6), (0.0, 0.8)])
def test_servo_keeps_up_with_a_walker(velocity):
    world = Playground((3.5, 0.0))
    controller = started()
    world.play(controller, 10.0, velocity)
    for _ in range(20):
        world.play(controller, 0.5, velocity)
        assert abs(world.distance_m - 3.0) < 0.5
        assert abs(world.bearing_rad) < math.radians(8.0)


def test_signs_of_the_command():
    senses = np.zeros(len(PROPRIO_NAMES))
    far_left_high = started().act(Estimate(np.array([100.0, 50.0, 20.0, 60.0])), senses)
    assert far_left_high[0] > 0.0
    assert far_left_high[2] > 0.0
    assert far_left_high[3] > 0.0
    near_right_low = started().act(Estimate(np.array([500.0, 60.0, 100.0, 410.0])), senses)
    assert near_right_low[0] < 0.0
    assert near_right_low[2] < 0.0
    assert near_right_low[3] < 0.0
    senses[PROPRIO_INDEX["pan_rad"]] = 0.5
    assert started().act(Estimate(np.array([300.0, 100.0, 40.0, 290.0])), senses)[1] > 0.0


def test_commands_are_four_numbers_within_one():
    rng = np.random.default_rng(0)
    controller = started()
    for _ in range(200):
        box = np.concatenate([rng.uniform(-200, 800, 2), rng.uniform(0, 900, 2)])
        estimate = Estimate(box, confidence=rng.random(), occluded=bool(rng.random() < 0.2))
        command = controller.act(estimate, rng.normal(size=len(PROPRIO_NAMES)).astype(np.float32))
        assert command.shape == (4,)
        assert command.dtype == np.float64
        assert np.abs(command).max() <= 1.0


@pytest.mark.parametrize(
    "lost",
    [
        Estimate(np.array([300.0, 100.0, 40.0, 200.0]), confidence=0.05),
        Estimate(np.array([300.0, 100.0, 40.0, 200.0]), occluded=True),
        Estimate(np.zeros(4)),
    ],
)
def test_the_command_decays_while_the_target_is_lost(lost: Estimate):
    controller = VisualServo()
    senses = np.zeros(len(PROPRIO_NAMES))
    before = controller.act(Estimate(np.array([200.0, 100.0, 40.0, 120.0])), senses)
    first = controller.act(lost, senses)
    assert (np.sign(first) == np.sign(before)).all()
    assert (np.abs(first) <= np.abs(before)).all()
    for _ in range(120):
        last = controller.act(lost, senses)
    assert np.abs(last).max() < 0.01


def test_commands_are_rate_limited():
    controller = controllers.make("servo")
    robot = RobotParameters(rate_hz=20.0, max_speed_m_s=2.0)
    controller.reset(robot)
    rng = np.random.default_rng(1)
    last = np.zeros(4)
    for _ in range(100):
        box = np.concatenate([rng.uniform(0, 500, 2), rng.uniform(20, 300, 2)])
        now = controller.act(Estimate(box), np.zeros(len(PROPRIO_NAMES)))
        assert (np.abs(now - last) * robot.limits * robot.rate_hz <= ACCELERATION + 1e-9).all()
        last = now


def test_a_cut_box_does_not_increase_the_distance():
    world = Playground((1.6, 0.0))
    controller = started()
    nearest = world.distance_m
    for _ in range(40):
        world.play(controller, 0.1)
        nearest = min(nearest, world.distance_m)
    assert nearest > 1.3


def test_modifying_the_returned_command_has_no_effect():
    controller = started()
    senses = np.zeros(len(PROPRIO_NAMES))
    command = controller.act(Estimate(np.array([200.0, 100.0, 40.0, 120.0])), senses)
    command[:] = 9.0
    assert np.abs(controller.act(Estimate(np.zeros(4)), senses)).max() <= 1.0


@pytest.mark.parametrize("name", controllers.names())
def test_same_input_same_output_after_reset(name: str):
    controller = controllers.make(name)

    def episode() -> bytes:
        controller.reset(RobotParameters(SIZE, math.radians(60.0)))
        rng = np.random.default_rng(3)
        return b"".join(
            controller.act(Estimate(rng.uniform(50, 200, 4)), rng.normal(size=len(PROPRIO_NAMES))).tobytes()
            for _ in range(30)
        )

    assert episode() == episode()
    assert isinstance(controller, Controller)
    assert len(controllers.describe(name)) > 10


def test_unknown_names_and_parameters_report_the_nearest():
    with pytest.raises(UnknownNameError, match="did you mean 'servo'"):
        controllers.make("sevro")
    with pytest.raises(ParameterError, match="did you mean 'distance_m'"):
        controllers.make("servo", distance=2.0)
    with pytest.raises(ParameterError, match="has no parameter 'gain'"):
        controllers.make("still", gain=1.0)


@pytest.mark.parametrize(
    "params",
    [
        {"distance_m": 0.0},
        {"person_m": math.nan},
        {"person_m": "tall"},
        {"least_confidence": 1.5},
        {"distance_m": True},
    ],
)
def test_invalid_parameters_are_refused(params):
    with pytest.raises(ParameterError, match=next(iter(params))):
        controllers.make("servo", **params)
