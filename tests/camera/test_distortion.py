"""Lens distortion against OpenCV, and lenses that are not invertible."""

import cv2
import numpy as np
import pytest

from pftrack_sim.camera.distortion import Lens
from pftrack_sim.camera.pinhole import intrinsics
from pftrack_sim.camera.remap import RayGrid
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.scenario.axes import DistortionAxis

SIZE = (640, 480)
K = intrinsics(*SIZE, np.deg2rad(50.0))
LENSES = {
    "typical": DistortionAxis(severity=1.0).coefficients,
    "twice": DistortionAxis(severity=2.0).coefficients,
    "cushion": (0.15, 0.02, 0.0, 0.0, 0.0),
    "tilted": (-0.2, 0.05, 0.01, -0.008, 0.01),
}


@pytest.mark.parametrize("name", LENSES)
def test_projection_agrees_with_opencv(name: str):
    lens = Lens(K, LENSES[name], SIZE)
    rays = lens.to_normalized(np.stack(np.meshgrid(np.arange(0.0, 641.0, 40.0), np.arange(0.0, 481.0, 40.0)), axis=-1))
    points = np.concatenate([rays, np.ones((*rays.shape[:2], 1))], axis=-1).reshape(-1, 3)
    expected = cv2.projectPoints(points, np.zeros(3), np.zeros(3), K, np.array(LENSES[name]))[0].reshape(*rays.shape)
    assert np.abs(lens.to_pixels(rays) - expected).max() < 1e-6


@pytest.mark.parametrize("name", LENSES)
def test_the_pixel_map_follows_the_ray_of_each_pixel(name: str):
    lens = Lens(K, LENSES[name], SIZE)
    grid = RayGrid(lens)
    wide = np.array([[500.0, 0.0, 700.0], [0.0, 500.0, 600.0], [0.0, 0.0, 1.0]])
    normalized = grid.reproject(0, grid.bands, np.eye(4), np.eye(4))
    places = grid.pixel_map(0, grid.bands, normalized, wide) + 0.5
    seen = np.concatenate([(places - wide[:2, 2]) / 500.0, np.ones((480, 640, 1))], axis=-1).reshape(-1, 3)
    landed = cv2.projectPoints(seen, np.zeros(3), np.zeros(3), K, np.array(LENSES[name]))[0].reshape(480, 640, 2)
    wanted = np.stack(np.meshgrid(np.arange(640) + 0.5, np.arange(480) + 0.5), axis=-1)
    assert np.abs(landed - wanted).max() < 0.05


def test_points_far_beside_the_view_are_projected_outside_the_image():
    lens = Lens(K, (-0.12, 0.0, 0.0, 0.0, 0.0), SIZE)
    outwards = np.linspace(0.0, 30.0, 2000)
    for angle in np.linspace(0.0, 2.0 * np.pi, 12):
        seen = lens.to_pixels(outwards[:, None] * (np.cos(angle), np.sin(angle))) - K[:2, 2]
        assert (np.diff(np.linalg.norm(seen, axis=1)) > 0.0).all()


def test_a_lens_without_coefficients_is_a_pinhole_to_the_bit():
    points = np.random.default_rng(0).normal(size=(50, 2))
    assert (Lens(K, (0, 0, 0, 0, 0), SIZE).to_pixels(points) == points * K[(0, 1), (0, 1)] + K[:2, 2]).all()


@pytest.mark.parametrize("coefficients", [(-0.9, 0, 0, 0, 0), (0.0, -3.0, 0, 0, 0), (0, 0, 0.6, 0, 0)])
def test_a_lens_that_is_not_invertible_raises(coefficients):
    with pytest.raises(ParameterError, match="not invertible over the 640 x 480 image"):
        Lens(K, coefficients, SIZE)
