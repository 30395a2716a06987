"""Where the target walked, as a way for the robot."""

import math

import numpy as np
import pytest

from pftrack_sim.controllers.trail import LONGEST_M, STEP_M, Trail


def walked(*points: tuple[float, float]) -> Trail:
    trail = Trail()
    for point in points:
        trail.add(np.array(point))
    return trail


def test_the_newest_point_that_can_be_reached_is_next():
    trail = walked((1.0, 0.0), (2.0, 0.0), (2.0, 1.0), (2.0, 2.0))
    found = trail.next(np.zeros(2), 0.0, lambda bearing, distance: abs(bearing) < math.radians(30.0))
    assert found is not None
    bearing, length = found
    assert bearing == pytest.approx(math.atan2(1.0, 2.0))
    assert length == pytest.approx(math.hypot(2.0, 1.0) + 1.0)


def test_bearings_are_off_the_heading():
    found = walked((0.0, 3.0)).next(np.array([0.0, 1.0]), math.pi, lambda bearing, distance: True)
    assert found is not None
    assert found == pytest.approx((-0.5 * math.pi, 2.0))


def test_where_nothing_can_be_reached_there_is_no_way():
    assert walked((1.0, 0.0), (2.0, 0.0)).next(np.zeros(2), 0.0, lambda bearing, distance: False) is None
    assert Trail().next(np.zeros(2), 0.0, lambda bearing, distance: True) is None


def test_it_never_leads_back_behind_where_the_robot_is():
    trail = walked((0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (3.0, 0.0))
    assert trail.next(np.array([2.0, 0.1]), 0.0, lambda bearing, distance: abs(bearing) > 2.0) is None


def test_it_is_kept_in_steps_and_not_for_ever():
    trail = walked(*[(0.01 * number, 0.0) for number in range(5000)])
    found = trail.next(np.array([49.0 - LONGEST_M - 5.0, 0.0]), 0.0, lambda bearing, distance: distance < 8.0)
    assert found is not None
    assert found[1] > 8.0
    points: list[float] = []
    trail.next(np.array([-99.0, 0.0]), 0.0, lambda bearing, distance: bool(points.append(distance)))
    assert len(points) <= round(LONGEST_M / STEP_M)
    trail.shorten()
    points.clear()
    trail.next(np.array([-99.0, 0.0]), 0.0, lambda bearing, distance: bool(points.append(distance)))
    assert len(points) == 1
