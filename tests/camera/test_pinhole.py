"""Laws of the pinhole camera, and agreement of the frustum with the camera matrix."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest

from pftrack_sim.camera.pinhole import (
    focal_and_centre,
    frustum,
    intrinsics,
)
from pftrack_sim.core.errors import ParameterError


def project(points: np.ndarray, K: np.ndarray) -> np.ndarray:
    return cv2.projectPoints(points, np.zeros(3), np.zeros(3), K, None)[0].reshape(-1, 2)


@pytest.mark.parametrize(("width", "height", "fovy"), [(640, 480, 0.9), (161, 97, 0.3), (1, 1, 2.0)])
def test_the_edges_of_the_field_of_view_are_the_edges_of_the_image(width: int, height: int, fovy: float):
    half = math.tan(fovy / 2)
    points = np.array([[0, 0, 1], [0, half, 1], [0, -half, 1], [half * width / height, 0, 1]]) * 3.0
    expected = [[width / 2, height / 2], [width / 2, height], [width / 2, 0], [width, height / 2]]
    assert np.allclose(project(points, intrinsics(width, height, fovy)), expected, atol=1e-9)


@pytest.mark.parametrize("rect", [(0, 0, 640, 480), (100, 37, 64, 200), (639, 479, 1, 1)])
def test_the_frustum_bounds_exactly_the_rectangle(rect: tuple[int, int, int, int]):
    left, top, width, height = rect
    K = intrinsics(640, 480, 0.7)
    K[0, 0] *= 1.3
    K[0, 2] += 11.5
    cropped = K - [[0, 0, left], [0, 0, top], [0, 0, 0]]
    view = frustum(focal_and_centre(cropped), width, height, 0.1, 50.0)
    # OpenGL's y points up.
    corners = np.array([[view.left, -view.top, view.near], [view.right, -view.bottom, view.near]])
    assert np.allclose(project(corners, K), [[left, top], [left + width, top + height]], atol=1e-9)


@pytest.mark.parametrize(
    "call",
    [
        lambda: intrinsics(0, 10, 1.0),
        lambda: intrinsics(10, 10, 0.0),
        lambda: intrinsics(10, 10, math.pi),
        lambda: intrinsics(10, 10, math.nan),
        lambda: frustum((1.0, 1.0, 0.0, 0.0), 10, 10, 1.0, 1.0),
        lambda: frustum((1.0, 1.0, 0.0, 0.0), 10, 10, 0.0, 1.0),
        lambda: focal_and_centre(np.eye(4)),
        lambda: focal_and_centre(np.diag([1.0, -1.0, 1.0])),
        lambda: focal_and_centre([[1, 0.1, 0], [0, 1, 0], [0, 0, 1]]),
    ],
)
def test_invalid_cameras_raise(call):
    with pytest.raises(ParameterError):
        call()
