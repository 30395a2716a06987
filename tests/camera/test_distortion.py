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
    "rational": (0.7, 0.1, 0.001, -0.002, 0.01, 1.1, 0.3, 0.02),
}
FISHEYES = {"plain": (0.0, 0.0, 0.0, 0.0), "bent": (0.03, -0.01, 0.004, -0.0008), "pressed": (-0.015, 0.003, 0.0, 0.0)}
WIDE = np.array([[306.0, 0.0, 330.0], [0.0, 310.0, 232.0], [0.0, 0.0, 1.0]])  # 120 degrees across


EVERY_LENS = [(K, coefficients) for coefficients in LENSES.values()] + [(WIDE, one) for one in FISHEYES.values()]


def projected(rays: np.ndarray, K: np.ndarray, coefficients: tuple[float, ...]) -> np.ndarray:
    """`(..., 2)` pixels of `(..., 2)` normalized image coordinates, by OpenCV."""
    project = cv2.fisheye.projectPoints if len(coefficients) == 4 else cv2.projectPoints
    points = np.concatenate([rays, np.ones((*rays.shape[:-1], 1))], axis=-1).reshape(-1, 1, 3)
    return project(points, np.zeros(3), np.zeros(3), K, np.array(coefficients))[0].reshape(rays.shape)


@pytest.mark.parametrize(("K", "coefficients"), EVERY_LENS)
def test_projection_agrees_with_opencv_over_the_image(K: np.ndarray, coefficients: tuple[float, ...]):
    lens = Lens(K, coefficients, SIZE)
    rays = lens.to_normalized(np.stack(np.meshgrid(np.arange(0.0, 641.0, 20.0), np.arange(0.0, 481.0, 20.0)), axis=-1))
    assert np.abs(lens.to_pixels(rays) - projected(rays, K, coefficients)).max() < 1e-6


@pytest.mark.parametrize("coefficients", FISHEYES.values())
def test_an_equidistant_lens_agrees_with_opencv_beside_the_image_too(coefficients: tuple[float, ...]):
    lens = Lens(WIDE, coefficients, SIZE)
    rays = 1.2 * lens.to_normalized(np.array([[x, y] for x in (0.0, 320.0, 640.0) for y in (0.0, 240.0, 480.0)]))
    assert np.rad2deg(np.arctan(np.linalg.norm(rays / 1.2, axis=-1))).max() > 70.0
    assert np.abs(lens.to_pixels(rays) - projected(rays, WIDE, coefficients)).max() < 1e-6


@pytest.mark.parametrize(("K", "coefficients"), EVERY_LENS)
def test_the_pixel_map_follows_the_ray_of_each_pixel(K: np.ndarray, coefficients: tuple[float, ...]):
    lens = Lens(K, coefficients, SIZE)
    grid = RayGrid(lens)
    drawn = np.array([[500.0, 0.0, 700.0], [0.0, 500.0, 600.0], [0.0, 0.0, 1.0]])
    places = grid.pixel_map(0, grid.bands, grid.normalized, drawn) + 0.5
    landed = projected((places.astype(np.float64) - drawn[:2, 2]) / 500.0, K, coefficients)
    wanted = np.stack(np.meshgrid(np.arange(640) + 0.5, np.arange(480) + 0.5), axis=-1)
    assert np.abs(landed - wanted).max() < 0.05


@pytest.mark.parametrize("coefficients", [(0.0, 0.0, 0.0, 0.0), (0.01, -0.004, 0.001, 0.0)])
def test_a_wide_lens_is_that_of_opencv_up_to_a_right_angle_and_of_its_polynomial_beyond(coefficients):
    K = np.array([[198.0, 0.0, 325.0], [0.0, 199.0, 236.0], [0.0, 0.0, 1.0]])
    lens = Lens(K, coefficients, SIZE)
    pixels = np.stack(np.meshgrid(np.arange(640) + 0.5, np.arange(480) + 0.5), axis=-1)
    rays = lens.rays(pixels)
    angles = np.arccos(rays[..., 2])
    assert lens.wide
    assert np.rad2deg(angles.max()) > 105.0
    assert np.abs(np.linalg.norm(rays, axis=-1) - 1.0).max() < 1e-9
    ahead = angles < np.deg2rad(89.9)
    seen = cv2.fisheye.projectPoints(
        rays[ahead][:, None], np.zeros(3), np.zeros(3), K, np.array(coefficients, dtype=float)
    )[0]
    assert np.abs(seen[:, 0] - pixels[ahead]).max() < 1e-6
    height = angles * np.polynomial.polynomial.polyval(angles**2, [1.0, *coefficients])
    around = np.arctan2(rays[..., 1], rays[..., 0])[..., None]
    wanted = height[..., None] * np.concatenate([np.cos(around), np.sin(around)], axis=-1) * (198.0, 199.0) + K[:2, 2]
    assert np.abs(wanted - pixels).max() < 1e-6
    grid = RayGrid(lens)
    drawn = grid.interpolated(0, grid.bands, grid.directions(0, grid.bands, np.eye(4), np.eye(4)))
    off = np.linalg.norm(drawn / np.linalg.norm(drawn, axis=-1, keepdims=True) - rays, axis=-1)
    assert (off * 199.0 * 1.1).max() < 0.05  # [px]


@pytest.mark.parametrize(
    ("focal", "coefficients", "said"),
    [
        (140.0, (0, 0, 0, 0), "sees up to 150 degrees off its axis, and a corner .* is farther out: crop"),
        (300.0, (-0.3, 0, 0, 0), "k1, k2, k3, k4 = .* not invertible over the 640 x 480 image"),
        (300.0, (0, 0, 0), "distortion needs five .* or the four of an equidistant lens"),
    ],
)
def test_an_equidistant_lens_that_is_too_wide_or_folds_raises(focal: float, coefficients, said: str):
    wide = np.array([[focal, 0.0, 320.0], [0.0, focal, 240.0], [0.0, 0.0, 1.0]])
    with pytest.raises(ParameterError, match=said):
        Lens(wide, coefficients, SIZE)


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
