"""Times at which the rows of a rolling shutter meet moving points."""

import numpy as np
import pytest

from pftrack_sim.camera.shutter import Shutter, interpolate_pixels, solve_row_times

SHUTTER = Shutter(exposure_s=0.01, readout_s=0.03, rows=120)
TIMES_S = np.array([-0.04, -0.031, -0.017, -0.004, 0.0])


@pytest.mark.parametrize("speed_px_s", [-500.0, 0.0, 700.0])
def test_a_point_in_uniform_motion_is_met_at_the_mid_exposure_of_its_row(speed_px_s: float):
    starts = np.array([40.0, 60.0, 95.0])  # Heights at the time stamp
    pixels = np.stack([np.column_stack([[5.0, 5.0, 5.0], starts + speed_px_s * when]) for when in TIMES_S])
    solved = solve_row_times(SHUTTER, TIMES_S, pixels)
    share = SHUTTER.readout_s / SHUTTER.rows
    met_s = (SHUTTER.row_s(0.0) + share * starts) / (1.0 - share * speed_px_s)
    np.testing.assert_allclose(solved, met_s, atol=1e-12)
    heights = interpolate_pixels(TIMES_S, pixels, solved)[:, 1]
    np.testing.assert_allclose(SHUTTER.row_s(heights), solved, atol=1e-12)


def test_points_beside_the_image_belong_to_the_nearest_row_and_unknown_ones_to_none():
    heights = np.array([-50.0, 500.0, np.nan])
    pixels = np.stack([np.column_stack([np.zeros(3), heights])] * len(TIMES_S))
    solved = solve_row_times(SHUTTER, TIMES_S, pixels)
    np.testing.assert_allclose(solved, [SHUTTER.row_s(0.0), SHUTTER.row_s(120.0), np.nan], atol=1e-12)
