"""Times of the rows of a rolling shutter, and of points that move through them."""

import math

import numpy as np
import pytest

from pftrack_sim.camera.projection import Readout, place_vertices
from pftrack_sim.camera.shutter import Shutter

SHUTTER = Shutter(exposure_s=0.01, readout_s=0.03, rows=120)
TIMES_S = np.array([-0.04, -0.031, -0.017, -0.004, 0.0])
NO_LENS = (1.0, 1.0, 0.0, 0.0, *[0.0] * 8, math.inf, 0.0)


def met(heights_px: np.ndarray, speed_px_s: float) -> np.ndarray:
    """`(N, 4)` places, depths and instants of points that are at some heights at the time stamp; each is a geom."""
    poses = np.zeros((len(TIMES_S), 3, len(heights_px), 4))
    poses[..., :3] = np.eye(3)[:, None]
    poses[:, 1, :, 3] = heights_px + speed_px_s * TIMES_S[:, None]
    poses[:, 2, :, 3] = 1.0
    readout = Readout(TIMES_S, poses, SHUTTER.exposure_s, SHUTTER.readout_s, (160, SHUTTER.rows), NO_LENS, 0.1)
    places = np.empty((len(heights_px), 4))
    geoms = np.arange(len(heights_px))
    place_vertices(geoms, np.zeros((len(geoms), 3)), np.arange(len(geoms) + 1), readout, places)
    return places


@pytest.mark.parametrize("speed_px_s", [-500.0, 0.0, 700.0])
def test_a_point_in_uniform_motion_is_met_at_the_mid_exposure_of_its_row(speed_px_s: float):
    starts = np.array([40.0, 60.0, 95.0])
    places = met(starts, speed_px_s)
    share = SHUTTER.readout_s / SHUTTER.rows
    met_s = (SHUTTER.row_s(0.0) + share * starts) / (1.0 - share * speed_px_s)
    np.testing.assert_allclose(places[:, 3], met_s, atol=1e-6)
    np.testing.assert_allclose(SHUTTER.row_s(places[:, 1]), places[:, 3], atol=1e-6)


def test_points_beside_the_image_belong_to_the_nearest_row():
    solved = met(np.array([-50.0, 500.0]), 0.0)[:, 3]
    np.testing.assert_allclose(solved, [SHUTTER.row_s(0.0), SHUTTER.row_s(120.0)], atol=1e-9)
