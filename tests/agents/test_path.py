import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pftrack_sim.agents.path import Path
from pftrack_sim.core.errors import ParameterError

points = st.lists(st.tuples(st.floats(-20, 20), st.floats(-20, 20)), min_size=2, max_size=6).filter(
    lambda corners: all(math.dist(a, b) > 0.3 for a, b in itertools.pairwise(corners))
)


def test_straight_line_and_its_extensions():
    path = Path([(1.0, 2.0), (1.0, 6.0)])
    x, y, heading = path.at(np.array([-3.0, 0.0, 4.0, 9.0]))
    assert path.length_m == 4.0
    assert np.abs(x - 1.0).max() < 1e-12
    assert np.abs(y - [-1.0, 2.0, 6.0, 11.0]).max() < 1e-12
    assert np.abs(heading - math.pi / 2).max() < 1e-12


def test_right_angle_is_a_quarter_circle():
    path = Path([(0, 0), (5, 0), (5, 5)], corner_m=2.0)
    assert abs(path.length_m - (3.0 + math.pi + 3.0)) < 1e-12
    x, y, heading = path.at(3.0 + math.pi / 2)
    assert abs(math.hypot(x - 3.0, y - 2.0) - 2.0) < 1e-12
    assert abs(heading - math.pi / 4) < 1e-12
    assert path.curvature(4.0) == 0.5
    assert path.curvature(1.0) == 0.0


@settings(max_examples=150)
@given(points, st.floats(0.0, 3.0))
def test_parameter_is_arc_length_and_ends_are_the_given_points(corners, corner_m):
    path = Path(corners, corner_m)
    x, y, _ = path.at([0.0, path.length_m])
    assert abs(np.stack([x, y], axis=1) - np.array([corners[0], corners[-1]])).max() < 1e-5
    s = np.linspace(-1.0, path.length_m + 1.0, 4001)
    x, y, heading = path.at(s)
    step = s[1] - s[0]
    moved = np.hypot(np.diff(x), np.diff(y))
    assert moved.max() <= step + 1e-5  # continuous, and never faster than its own length
    unit = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    shares = (np.stack([np.diff(x), np.diff(y)], axis=1) * 0.5 * (unit[1:] + unit[:-1])).sum(axis=1) / step
    # Tangent to its own heading, except at the few steps across a corner left sharp.
    assert np.mean(shares > 0.99) > 0.95 or corner_m < 0.2


@settings(max_examples=100)
@given(points, st.floats(-1.0, 30.0), st.floats(-0.05, 0.05))
def test_projection_inverts_the_path(corners, s, aside):
    path = Path(corners, 1.0)
    s = min(s, path.length_m + 1.0)
    x, y, heading = path.at(s)
    point = (float(x - aside * np.sin(heading)), float(y + aside * np.cos(heading)))
    found = path.project(point, near_s_m=s, within_m=0.5)
    fx, fy, _ = path.at(found)
    assert math.hypot(fx - point[0], fy - point[1]) <= abs(aside) + 1e-9
    assert abs(found - s) <= 0.5 + 1e-9


def test_projection_stays_on_its_own_lap():
    path = Path([(0, 0), (10, 0), (10, 4), (5, 4), (5, -4)])
    crossing = path.project((5.0, 0.3), near_s_m=5.0)
    assert abs(crossing - 5.0) < 1e-9
    later = path.project((5.0, 0.3), near_s_m=path.length_m - 4.0)
    assert later > 15.0


@settings(max_examples=50)
@given(points, st.floats(-1.0, 30.0), st.floats(-4.0, 4.0))
def test_projection_is_the_nearest_of_many_points(corners, s, aside):
    path = Path(corners, 1.0)
    x, y, _ = path.at(s)
    point = (float(x) + aside, float(y) - 0.5 * aside)
    found = path.project(point, near_s_m=s, within_m=2.0)
    assert abs(found - s) <= 2.0 + 1e-9
    x, y, _ = path.at(np.linspace(s - 2.0, s + 2.0, 4001))
    fx, fy, _ = path.at(found)
    assert math.dist((fx, fy), point) <= np.hypot(x - point[0], y - point[1]).min() + 1e-9


@pytest.mark.parametrize("left", [0.7, -0.7, 2.0])
def test_offset_keeps_its_distance_on_straights(left: float):
    path = Path([(0, 0), (12, 0), (12, 12)], corner_m=1.5)
    beside = path.offset(left)
    x, y, heading = beside.at([1.0, beside.length_m - 1.0])
    assert abs(y[0] - left) < 1e-12
    assert abs(x[1] - (12.0 - left)) < 1e-12
    assert abs(heading - [0.0, math.pi / 2]).max() < 1e-12


def test_repeated_points_change_nothing():
    once, twice = Path([(0, 0), (3, 0), (3, 3)]), Path([(0, 0), (0, 0), (3, 0), (3, 0), (3, 3)])
    assert once.length_m == twice.length_m


def test_a_reversal_stays_sharp():
    path = Path([(0, 0), (4, 0), (1, 0)])
    x, _, heading = path.at([3.9, 4.1])
    assert path.length_m == 7.0
    assert abs(x - 3.9).max() < 1e-12
    assert abs(abs(heading[1] - heading[0]) - math.pi) < 1e-12


@pytest.mark.parametrize("bad", [[(0, 0)], [(0, 0), (0, 0)], [(0, 0, 0), (1, 1, 1)], [(0, 0), (math.nan, 1)]])
def test_invalid_points_raise(bad):
    with pytest.raises(ParameterError):
        Path(bad)


def test_paths_are_equal_by_their_points_and_corners():
    points = [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0]]
    assert Path(points) == Path(np.array(points))
    assert hash(Path(points)) == hash(Path(np.array(points)))
    assert Path(points) != Path(points, corner_m=0.5)
    assert Path(points) != Path([*points[:2], [4.0, 3.5]])
    assert Path(points) != points
