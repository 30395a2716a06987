import math

import numpy as np
import pytest
from playground import Playground, started

from pftrack_sim.controllers.moving_obstacles import MovingObstacles
from pftrack_sim.controllers.obstacle_avoidance import BRAKE_M_S2, HULL_M
from pftrack_sim.controllers.passing import KEEP_M, pass_movers
from pftrack_sim.core.proprioception import RANGE_ANGLES_RAD

POSTS = {
    "one in the way": [(3.0, 0.05, 0.2)],
    "a door": [(3.0, 0.75, 0.2), (3.0, 1.1, 0.2), (3.0, 1.5, 0.2), (3.0, -0.75, 0.2), (3.0, -1.1, 0.2)],
    "a table": [(3.0, 0.4, 0.3), (3.0, -0.1, 0.3), (3.0, -0.6, 0.3)],
}


@pytest.mark.parametrize("name", list(POSTS))
def test_the_target_is_reached_past_obstacles_without_contact(name: str):
    world = Playground((9.0, 0.0), posts=POSTS[name])
    world.play(started("servo-avoid"), 25.0)
    assert world.nearest_m > HULL_M + 0.03
    assert abs(world.distance_m - 3.0) < 0.3


def test_servo_without_avoidance_hits_the_obstacle():
    world = Playground((9.0, 0.0), posts=POSTS["one in the way"])
    world.play(started("servo"), 10.0)
    assert world.nearest_m < HULL_M


def test_without_obstacles_it_equals_servo():
    rooms = [Playground((6.0, 2.0)), Playground((6.0, 2.0))]
    for world, name in zip(rooms, ("servo", "servo-avoid"), strict=True):
        world.play(started(name), 6.0, (0.8, 0.3))
    np.testing.assert_allclose(rooms[0].commands, rooms[1].commands, atol=1e-12)


def test_it_stops_before_a_wall_at_full_speed():
    wall = [(6.0, y, 0.3) for y in np.arange(-12.0, 12.01, 0.4)]
    world = Playground((9.0, 0.0), posts=wall)
    world.play(started("servo-avoid"), 20.0)
    assert world.nearest_m > HULL_M
    assert 0.5 * 1.6**2 / BRAKE_M_S2 < 5.0  # it can see as far as it needs to stop


def test_pan_and_tilt_equal_those_of_servo():
    clear, blocked = Playground((6.0, 1.0)), Playground((6.0, 1.0), posts=[(1.2, 0.2, 0.3)])
    for world in (clear, blocked):
        world.play(started("servo-avoid"), 1.0 / 30.0)
    np.testing.assert_array_equal(clear.commands[0][2:], blocked.commands[0][2:])
    assert not math.isclose(clear.commands[0][1], blocked.commands[0][1], abs_tol=1e-3)


@pytest.mark.parametrize("stop_s", [0.0, 40.0])
def test_it_does_not_reverse_into_a_passed_obstacle_nor_one_seen_before_a_long_stop(stop_s: float):
    world = Playground((5.5, 0.0), posts=[(1.2, 0.62, 0.3)])
    controller = started("servo-avoid")
    world.play(controller, 5.0)
    assert world.x > 2.0
    if stop_s:
        world.target = np.array([world.x + 3.0, world.y])
        world.play(controller, stop_s)
        assert abs(world.distance_m - 3.0) < 0.3
    # The person comes back at the robot, pushing it towards the post.
    world.target = np.array([world.x + 1.5, world.y - 0.9])
    for _ in range(60):
        world.play(controller, 0.1, (-0.3, -0.1) if world.x > 0.5 else (0.0, 0.0))
    assert world.nearest_m > HULL_M


def test_round_the_end_of_a_wall_it_drives_along_the_trail_of_the_target():
    wall = [(x, 1.6, 0.1) for x in np.arange(-8.0, 5.6, 0.15)]
    world = Playground((3.0, 0.0), posts=wall)
    controller = started("servo-avoid")
    for seconds, velocity in ((3.5, (1.2, 0.0)), (2.7, (0.0, 1.2)), (7.0, (-1.2, 0.0)), (10.0, (0.0, 0.0))):
        world.play(controller, seconds, velocity)
    assert world.nearest_m > HULL_M
    assert world.y > 2.0
    assert abs(world.distance_m - 3.0) < 0.4


@pytest.mark.parametrize("aside", [0.0, 0.3, -0.3])
def test_it_keeps_off_a_person_who_turns_round_and_comes_while_lost(aside: float):
    world, controller = Playground((3.0, aside), legs=True), started("servo-avoid")
    world.play(controller, 3.0, (1.0, 0.0))
    for _ in range(60):
        world.play(controller, 0.1, (-0.8, 0.0) if world.distance_m > 0.8 else (0.0, 0.0), sure=False)
    assert world.nearest_to_person_m > 0.55


def test_it_passes_who_walks_more_slowly_than_the_target():
    world = Playground((3.0, 0.0), legs=True, walkers=[(1.6, 0.2, 0.6, 0.0)])
    world.play(started("servo-avoid"), 12.0, (1.1, 0.0))
    assert world.distance_m < 3.6
    assert world.x > world.walkers[0, 0]
    assert world.nearest_walker_m > KEEP_M


@pytest.mark.parametrize("seconds", [0.6, 1.2, 1.8, 2.4])
def test_it_keeps_off_who_crosses_its_way(seconds: float):
    # They would meet: the robot drives 1.1 m/s along the x axis.
    world = Playground((3.0, 0.0), legs=True, walkers=[(1.1 * seconds + 1.0, 1.2 * seconds + 0.4, 0.0, -1.2)])
    world.play(started("servo-avoid"), 8.0, (1.1, 0.0))
    assert world.nearest_walker_m > KEEP_M - 0.05
    assert abs(world.distance_m - 3.0) < 0.5


def test_somebody_who_has_just_stopped_beside_it_does_not_hold_it():
    world, controller = Playground((3.0, 0.0), legs=True, walkers=[(1.3, -2.2, 0.0, 1.0)]), started("servo-avoid")
    world.play(controller, 1.5, (0.4, 0.0))
    world.walkers[0, 2:] = 0.0
    world.play(controller, 2.0, (1.1, 0.0))
    assert world.distance_m < 4.0


@pytest.mark.parametrize("heading", [0.0, 0.6])
def test_the_velocity_of_what_moves_is_estimated_on_a_robot_that_drives_and_turns(heading: float):
    world = Playground((30.0, 0.0), walkers=[(2.0, -1.0, 0.3, 0.9)])
    moving = MovingObstacles()
    world.heading = heading
    for _ in range(60):
        moving.see(world.proprio(), RANGE_ANGLES_RAD, 1.0 / 30.0)
        world.x, world.heading = world.x + 0.01, world.heading + 0.004
        world.walkers[:, :2] += world.walkers[:, 2:] / 30.0
    places, velocities = moving.relative(world.proprio())
    turn = np.array(
        [[math.cos(world.heading), -math.sin(world.heading)], [math.sin(world.heading), math.cos(world.heading)]]
    )
    np.testing.assert_allclose(places, (world.walkers[:, :2] - (world.x, world.y)) @ turn, atol=0.25)
    np.testing.assert_allclose(velocities, world.walkers[:, 2:] @ turn, atol=0.25)


def test_only_what_has_moved_counts_as_moving():
    room = [(x, side * 1.2, 0.15) for x in np.arange(-2.0, 9.0, 0.25) for side in (-1.0, 1.0)]
    world = Playground((4.0, 0.0), posts=room, legs=True)
    moving, seen = MovingObstacles(), []
    for frame in range(120):
        world.x, world.heading = 0.03 * frame, 0.3 * math.sin(0.1 * frame)
        world.target = np.array([world.x + 1.5, 1.0 - 0.02 * frame])
        hits = moving.see(world.proprio(), RANGE_ANGLES_RAD, 1.0 / 30.0)
        ends = np.array([world.x, 0.0]) + world.ranges()[:, None] * np.stack(
            [np.cos(world.heading + RANGE_ANGLES_RAD), np.sin(world.heading + RANGE_ANGLES_RAD)], axis=1
        )
        assert (np.hypot(*(ends[hits] - world.target).T) < 0.2).all()
        seen.append(hits.any())
    assert np.mean(seen[30:90]) > 0.9


def test_a_way_past_what_moves_is_chosen_by_where_it_will_be():
    directions = np.deg2rad(np.linspace(-90.0, 90.0, 37))
    ahead = np.array([[1.5, 0.0]])
    direction, speed = pass_movers(0.0, 1.2, directions, ahead, np.array([[1.2, 0.0]]))
    assert (direction, speed) == (0.0, 1.2)  # As fast as the robot: nothing to pass
    direction, _ = pass_movers(0.0, 1.2, directions, ahead, np.array([[0.0, 0.6]]))
    assert direction <= 0.0  # It walks to the left: it is passed behind
    # Who walks straight at the robot from all around leaves no way: it stops.
    around = 0.8 * np.stack([np.cos(np.linspace(-3.0, 3.0, 40)), np.sin(np.linspace(-3.0, 3.0, 40))], axis=1)
    assert pass_movers(0.0, 1.2, directions, around, -0.5 * around) == (0.0, 0.0)
