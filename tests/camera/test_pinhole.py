"""Laws of the pinhole camera."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest

from pftrack_sim.camera.pinhole import focal_and_centre, intrinsics
from pftrack_sim.core.errors import ParameterError


@pytest.mark.parametrize(("width", "height", "fovy"), [(640, 480, 0.9), (161, 97, 0.3), (1, 1, 2.0)])
def test_the_edges_of_the_field_of_view_are_the_edges_of_the_image(width: int, height: int, fovy: float):
    half = math.tan(fovy / 2)
    points = np.array([[0, 0, 1], [0, half, 1], [0, -half, 1], [half * width / height, 0, 1]]) * 3.0
    expected = [[width / 2, height / 2], [width / 2, height], [width / 2, 0], [width, height / 2]]
    pixels = cv2.projectPoints(points, np.zeros(3), np.zeros(3), intrinsics(width, height, fovy), None)[0][:, 0]
    assert np.allclose(pixels, expected, atol=1e-9)


@pytest.mark.parametrize(
    "call",
    [
        lambda: intrinsics(0, 10, 1.0),
        lambda: intrinsics(10, 10, 0.0),
        lambda: intrinsics(10, 10, math.pi),
        lambda: intrinsics(10, 10, math.nan),
        lambda: focal_and_centre(np.eye(4)),
        lambda: focal_and_centre(np.diag([1.0, -1.0, 1.0])),
        lambda: focal_and_centre([[1, 0.1, 0], [0, 1, 0], [0, 0, 1]]),
    ],
)
def test_invalid_cameras_raise(call):
    with pytest.raises(ParameterError):
        call()
