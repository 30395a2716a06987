import math

import numpy as np
import pytest
from playground import Playground, started

from pftrack_sim.controllers.obstacle_avoidance import HULL_M
from pftrack_sim.controllers.target_search import ARRIVED_M, LEAD_S, LOOK_S, OVERSHOOT_RAD, PATIENCE_S, TargetSearch


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_it_looks_first_to_the_side_where_the_target_left(side: float):
    world, controller = Playground((3.0, 0.0)), started()
    world.play(controller, 2.0, (0.0, 0.5 * side))
    before = world.heading + world.pan
    world.play(controller, PATIENCE_S + LOOK_S, sure=False)
    turned = world.heading + world.pan - before
    assert 0.6 * OVERSHOOT_RAD < side * turned < 1.8 * OVERSHOOT_RAD
    # The base has come after the head.
    assert side * world.heading > math.radians(10.0)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_person_behind_the_robot_is_found_again(side: float):
    world, controller = Playground((3.0, 0.0)), started()
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


def test_servo_never_drives_without_a_target():
    world, controller = Playground((3.0, 0.0)), started()
    world.play(controller, 3.0, (1.0, 0.0))
    world.play(controller, PATIENCE_S + 0.1, sure=False)
    world.commands.clear()
    world.play(controller, 10.0, sure=False)
    assert max(abs(command[0]) for command in world.commands) == 0.0


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_it_drives_to_the_last_place_and_on_along_the_last_motion(side: float):
    world, controller = Playground((3.0, 0.0)), started("servo-avoid")
    world.play(controller, 4.0, (0.8, 0.6 * side))
    last, velocity = world.target.copy(), np.array([0.8, 0.6 * side])
    world.play(controller, 8.0, sure=False)
    robot = np.array([world.x, world.y])
    assert np.hypot(*(robot - (last + LEAD_S * velocity))) < ARRIVED_M + 0.4
    assert np.hypot(*(robot - last)) > 0.5  # beyond where it was seen
    world.commands.clear()
    world.play(controller, 4.0, sure=False)
    assert max(abs(command[0]) for command in world.commands) == 0.0  # there it looks around


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_person_who_walks_past_the_robot_is_looked_for_behind_it(side: float):
    world, controller = Playground((4.0, 0.5 * side)), started("servo-avoid")
    world.play(controller, 1.0)
    while world.distance_m > 1.6:
        world.play(controller, 0.1, (-1.3, 0.0))
    seen = []
    for _ in range(40):  # too near to be recognised, then far behind
        world.play(controller, 0.1, (-1.3, 0.0), sure=False)
        seen.append(world.in_view)
    assert world.target[0] < world.x
    assert sum(seen) > 25


def test_a_person_behind_a_corner_is_found_again():
    # A wall beside the way: the person turns round its end, where the line of sight crosses it.
    wall = [(x, 0.6, 0.15) for x in np.arange(-1.0, 4.01, 0.25)]
    found = {}
    for name in ("servo", "servo-avoid"):
        world, controller = Playground((3.0, 0.0), posts=wall), started(name)
        world.play(controller, 2.0, (0.8, 0.0))
        world.play(controller, 2.0, (0.0, 1.0), sure=False)
        for _ in range(200):
            line = np.array([world.target[0] - world.x, world.target[1] - world.y])
            crossing = world.x + line[0] * (0.6 - world.y) / line[1]
            world.play(controller, 0.1, sure=not crossing < 4.15)
        found[name] = not crossing < 4.15
        assert world.nearest_m > HULL_M or name == "servo"
    assert found == {"servo": False, "servo-avoid": True}


def test_it_looks_around_where_the_way_to_the_last_place_is_closed():
    ring = [(2.0 * math.cos(angle), 2.0 * math.sin(angle), 0.3) for angle in np.arange(0.0, 6.3, 0.2)]
    world, controller = Playground((4.0, 0.0), posts=ring), started("servo-avoid")
    world.play(controller, 1.0)
    world.play(controller, 20.0, sure=False)
    assert world.nearest_m > HULL_M
    world.commands.clear()
    world.play(controller, 3.0, sure=False)
    assert max(abs(command[0]) for command in world.commands) == 0.0


def test_it_does_not_drive_up_to_somebody_who_stands_at_the_last_place():
    """The tracker lost a person in full view, who turned, say: too near, the camera sees a part of the body alone."""
    nearest: list[float] = []
    for legs in (True, False):
        world, controller = Playground((3.0, 0.0), legs=legs), started("servo-avoid")
        world.play(controller, 3.0)
        world.target[0] += 1.5  # So that there is a way to drive
        world.play(controller, 0.5)
        world.play(controller, 6.0, sure=False)
        nearest.append(world.nearest_to_person_m)
    assert nearest[0] > 2.0
    assert nearest[1] < nearest[0] - 0.5, "to a place where nobody stands it drives"
