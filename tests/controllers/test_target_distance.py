"""The fused distance: each cue alone, cues that contradict each other, and following without contact."""

from __future__ import annotations

import math

import numpy as np
import pytest
from playground import SIZE, Playground

from pftrack_sim import controllers
from pftrack_sim.controllers import RobotParameters
from pftrack_sim.controllers.target_distance import RECOVERY_S, TargetDistance, View


def estimator(**robot: float) -> TargetDistance:
    distance = TargetDistance(1.72)
    distance.reset(RobotParameters(SIZE, **robot))
    return distance


def watch(distance: TargetDistance, world: Playground, seconds: float, box: np.ndarray | None = None) -> float:
    """Show the standing robot the person for a while; returns the estimate."""
    for _ in range(round(30.0 * seconds)):
        x, y, width, height = (world.box() if box is None else box).tolist()
        distance.predict(0.0)
        distance.update(View((x, y, width, height), world.pan, world.tilt, world.ranges()))
    assert distance.distance_m is not None
    return distance.distance_m


@pytest.mark.parametrize("tilt_deg", [-12.0, 0.0, 3.0])
@pytest.mark.parametrize("true_m", [3.2, 5.0, 8.0])
def test_height_and_feet_agree_with_the_geometry(true_m: float, tilt_deg: float):
    world = Playground((true_m, 0.0))
    world.tilt = math.radians(tilt_deg)
    assert abs(watch(estimator(), world, 1.0) / true_m - 1.0) < 0.02


@pytest.mark.parametrize("height_m", [1.5, 1.95])
def test_the_ground_corrects_an_unknown_body_height(height_m: float):
    world = Playground((4.0, 0.0), height_m)
    by_height_alone = 4.0 * 1.72 / height_m
    assert abs(watch(estimator(), world, 4.0) - 4.0) < 0.35 * abs(by_height_alone - 4.0)


def test_off_the_middle_the_foot_point_is_on_the_ground_too():
    world = Playground((4.0, 1.8))
    assert abs(watch(estimator(), world, 1.0) - world.distance_m) < 0.25


def test_where_the_image_cuts_the_box_the_scan_gives_the_distance():
    world = Playground((1.2, 0.0), legs=True)
    assert world.box()[1] + world.box()[3] == SIZE[1]
    assert abs(watch(estimator(), world, 2.0) - 1.2) < 0.15


def test_what_a_box_says_beyond_the_image_does_not_count():
    world = Playground((0.9, 0.0), legs=True)
    seen, guessed = world.box(), world.box() + np.array([0.0, -900.0, 0.0, 5000.0])
    assert watch(estimator(), world, 2.0, guessed) == watch(estimator(), world, 2.0, seen)


def test_a_target_that_fills_the_image_is_never_nearer_than_the_estimate_for_long():
    world, distance = Playground((1.5, 0.0), legs=True), estimator()
    watch(distance, world, 1.0)
    world.target = np.array([0.7, 0.0])
    box = np.array([200.0, 0.0, 240.0, SIZE[1]])
    assert abs(watch(distance, world, 0.1, box) - 0.7) < 0.25
    assert abs(watch(distance, world, 1.0, box) - 0.7) < 0.1
    assert abs(distance.speed_m_s) < 0.2


def test_a_box_that_keeps_its_size_does_not_fool_it_where_the_scan_sees_the_legs():
    world = Playground((2.9, 0.0), legs=True)
    distance, box = estimator(), world.box()
    for true_m in np.arange(2.9, 4.7, 0.5 / 30.0):
        world.target = np.array([true_m, 0.0])
        watch(distance, world, 1.0 / 30.0, box)
    assert abs(watch(distance, world, 1.0, box) - world.distance_m) < 0.4
    for _ in range(600):
        distance.predict(0.0)
    forgotten = watch(distance, Playground((4.7, 0.0)), 1.0 / 30.0)
    assert abs(forgotten - 4.7) < 0.5, "of a box too high nothing is left after 20 s in which nothing was seen"


def test_someone_who_steps_between_does_not_change_it():
    world, distance = Playground((4.0, 0.0), legs=True), estimator()
    before = watch(distance, world, 1.0)
    world.posts = np.array([(1.8, 0.0, 0.15)])
    assert abs(watch(distance, world, 2.0) - before) < 0.1


def test_it_starts_anew_when_it_has_contradicted_the_box_for_long():
    world, distance = Playground((3.5, 0.0)), estimator()
    watch(distance, world, 2.0)
    world.target = np.array([9.0, 0.0])
    assert watch(distance, world, 0.5 * RECOVERY_S) < 5.0
    assert abs(watch(distance, world, 2.0) - 9.0) < 0.5


def test_the_speed_of_a_walker_is_estimated():
    world, distance = Playground((3.0, 0.0)), estimator()
    for _ in range(90):
        world.target = world.target + np.array([1.2 / 30.0, 0.0])
        watch(distance, world, 1.0 / 30.0)
    assert abs(distance.speed_m_s - 1.2) < 0.25


@pytest.mark.parametrize("wanted_m", [1.5, 2.0, 3.0, 4.0])
@pytest.mark.parametrize("name", ["servo", "servo-avoid"])
def test_a_walker_who_stops_at_once_is_not_touched(name: str, wanted_m: float):
    world = Playground((wanted_m + 1.0, 0.0), legs=True)
    controller = controllers.make(name)
    controller.reset(RobotParameters(SIZE, distance_m=wanted_m))
    world.play(controller, 6.0, (1.3, 0.0))
    assert abs(world.distance_m - wanted_m) < 0.6
    world.play(controller, 8.0)
    assert world.nearest_to_person_m > 0.6
    assert abs(world.distance_m - wanted_m) < 0.3
