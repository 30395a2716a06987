"""khan2011, and the mean shift of divided, rotated boxes."""

import math

import numpy as np
import pytest

from pftrack_sim.trackers.features.mean_shift import Partition, area_histograms, mean_shift
from pftrack_sim.trackers.relatives.khan2011 import upright

PARTITION = Partition(2, 2)
TRUE = np.array([100.0, 80.0, 40.0, 70.0, 0.0])


def codes_of(state: np.ndarray) -> np.ndarray:
    """`(160, 200, 1)` codes: four colours in the quarters of a rotated box on a background of a fifth."""
    y, x = np.mgrid[:160, :200] + 0.5
    cosine, sine = math.cos(state[4]), math.sin(state[4])
    u = ((x - state[0]) * cosine + (y - state[1]) * sine) / state[2]
    v = ((y - state[1]) * cosine - (x - state[0]) * sine) / state[3]
    colours = 1 + (u > 0) + 2 * (v > 0)
    return np.where((np.abs(u) < 0.5) & (np.abs(v) < 0.5), colours, 0).astype(np.uint8)[..., None]


def climb(codes: np.ndarray, start: np.ndarray, gain: float) -> np.ndarray:
    model = area_histograms(codes_of(TRUE), TRUE[None], PARTITION, 5)[0]
    return mean_shift(codes, start[None], PARTITION, model, 20, gain)[0]


def test_histograms_sum_to_one_inside_and_rotate_with_the_box():
    found = area_histograms(codes_of(TRUE), TRUE[None], PARTITION, 5)
    assert found.shape == (1, 5, 5)
    assert np.allclose(found.sum(axis=2), 1.0, rtol=0, atol=1e-9)
    assert np.allclose(found[0, 1:, 1:], np.eye(4), rtol=0, atol=0.02)
    turned = TRUE + np.array([0, 0, 0, 0, 0.6])
    assert np.allclose(area_histograms(codes_of(turned), turned[None], PARTITION, 5), found, rtol=0, atol=0.02)
    assert not area_histograms(codes_of(TRUE), TRUE[None] + 1e4, PARTITION, 5).any()


@pytest.mark.slow
@pytest.mark.parametrize("shift", [(8.0, 0.0), (0.0, -15.0), (-7.0, 12.0)])
@pytest.mark.parametrize("angle", [0.0, 0.5])
def test_it_climbs_back_from_beside_the_target(shift: tuple[float, float], angle: float):
    target = TRUE + np.array([0, 0, 0, 0, angle])
    start = target + np.array([*shift, 0, 0, 0])
    assert np.abs(climb(codes_of(target), start, 0.0)[:2] - target[:2]).max() < 1.5


@pytest.mark.parametrize("change", [0.1, -0.1])
def test_the_angle_turns_towards_the_target(change: float):
    start = TRUE + np.array([0, 0, 0, 0, change])
    found = climb(codes_of(TRUE), start, 1.0)
    assert abs(found[4]) < 0.9 * abs(change)


def test_the_size_shrinks_towards_a_smaller_target_and_stays_on_an_equal_one():
    smaller = TRUE * np.array([1, 1, 0.8, 0.8, 1])
    found = climb(codes_of(smaller), TRUE, 1.0)
    assert (found[2:4] < 0.97 * TRUE[2:4]).all()
    assert np.allclose(climb(codes_of(TRUE), TRUE, 1.0), TRUE, rtol=0, atol=0.5)


def test_upright_boxes_hold_the_ellipse():
    assert np.allclose(upright(TRUE[None]), [[80, 45, 40, 70]], rtol=0, atol=1e-9)
    quarter = TRUE + np.array([0, 0, 0, 0, math.pi / 2])
    assert np.allclose(upright(quarter[None]), [[65, 60, 70, 40]], rtol=0, atol=1e-9)
