import math

import numpy as np
import pytest
from playground import SIZE, Playground

from pftrack_sim import controllers
from pftrack_sim.controllers import Controller, RobotParameters
from pftrack_sim.controllers.target_search import LOOK_S, OVERSHOOT_RAD, PATIENCE_S, TargetSearch


def servo() -> Controller:
    controller = controllers.make("servo")
    controller.reset(RobotParameters(SIZE))
    return controller


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_it_looks_first_to_the_side_where_the_target_left(side: float):
    world, controller = Playground((3.0, 0.0)), servo()
    world.play(controller, 2.0, (0.0, 0.5 * side))
    before = world.heading + world.pan
    world.play(controller, PATIENCE_S + LOOK_S, sure=False)
    turned = world.heading + world.pan - before
    assert 0.6 * OVERSHOOT_RAD < side * turned < 1.8 * OVERSHOOT_RAD
    # The base has come after the head.
    assert side * world.heading > math.radians(10.0)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_person_behind_the_robot_is_found_again(side: float):
    world, controller = Playground((3.0, 0.0)), servo()
    world.play(controller, 2.0, (0.0, 0.4 * side))
    # The person moves to the other side of the robot while out of view.
    world.target = np.array([world.x - 2.5, world.y - 1.0 * side])
    world.play(controller, 25.0)
    assert world.in_view
    assert abs(world.distance_m - 3.0) < 0.4


def test_the_sweep_covers_all_directions_at_a_bounded_rate():
    times = np.arange(0.0, 40.0, 1.0 / 30.0)
    swing = np.array([TargetSearch.sweep_rad(float(one)) for one in times])
    assert swing.max() > math.radians(170.0)
    assert swing.min() < -math.radians(170.0)
    early = times < LOOK_S + 9.0
    rate = np.abs(np.diff(swing[early & (times > LOOK_S)])) * 30.0
    assert rate.max() < math.radians(120.0)
    # It begins where it looked: no jump.
    assert abs(TargetSearch.sweep_rad(LOOK_S) - OVERSHOOT_RAD) < 1e-9


def test_it_never_drives_without_a_target():
    world, controller = Playground((3.0, 0.0)), servo()
    world.play(controller, 3.0, (1.0, 0.0))
    world.play(controller, PATIENCE_S + 0.1, sure=False)
    world.commands.clear()
    world.play(controller, 10.0, sure=False)
    assert max(abs(command[0]) for command in world.commands) == 0.0
