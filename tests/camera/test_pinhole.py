"""Laws of the pinhole camera, and agreement of the frustum that draws with the matrix that projects."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pftrack_sim.camera.pinhole import (
    OPENGL_AXES,
    camera_matrix,
    cropped,
    frustum,
    in_camera,
    intrinsics,
    project,
)
from pftrack_sim.core.errors import ParameterError

RNG = np.random.default_rng(20)


def random_pose(rng: np.random.Generator) -> np.ndarray:
    rotation = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    pose = np.eye(4)
    pose[:3, :3] = rotation * np.sign(np.linalg.det(rotation))
    pose[:3, 3] = rng.normal(size=3)
    return pose


@pytest.mark.parametrize(("width", "height", "fovy"), [(640, 480, 0.9), (161, 97, 0.3), (1, 1, 2.0)])
def test_the_edges_of_the_field_of_view_are_the_edges_of_the_image(width: int, height: int, fovy: float):
    K = intrinsics(width, height, fovy)
    half = math.tan(fovy / 2)
    points = np.array([[0, 0, 1], [0, half, 1], [0, -half, 1], [half * width / height, 0, 1]]) * 3.0
    pixels, depth = project(points, np.eye(4), K)
    expected = [[width / 2, height / 2], [width / 2, height], [width / 2, 0], [width, height / 2]]
    assert np.allclose(pixels, expected, atol=1e-9)
    assert np.allclose(depth, 3.0)


def test_a_point_moved_with_the_camera_stays_where_it_is_in_the_image():
    K = intrinsics(320, 240, 0.8)
    local = RNG.uniform([-1, -1, 1], [1, 1, 9], size=(50, 3))
    still, depth = project(local, np.eye(4), K)
    for _ in range(20):
        pose = random_pose(RNG)
        world = local @ pose[:3, :3].T + pose[:3, 3]
        assert np.allclose(in_camera(world, pose), local, atol=1e-12)
        moved, moved_depth = project(world, pose, K)
        assert np.allclose(moved, still, atol=1e-8)
        assert np.allclose(moved_depth, depth, atol=1e-12)


def test_what_is_not_in_front_has_no_pixel_but_a_depth():
    pixels, depth = project([[0, 0, -2], [1, 1, 0], [0, 0, 2]], np.eye(4), intrinsics(10, 10, 1.0))
    assert np.isnan(pixels[:2]).all()
    assert np.isfinite(pixels[2]).all()
    assert depth.tolist() == [-2, 0, 2]


def test_a_rectangle_keeps_the_pixel_grid():
    K = intrinsics(640, 480, 0.7)
    points = RNG.uniform([-1, -1, 1], [1, 1, 9], size=(30, 3))
    whole, _ = project(points, np.eye(4), K)
    part, _ = project(points, np.eye(4), cropped(K, 100, 37))
    assert np.allclose(part, whole - [100, 37], atol=1e-9)
    assert K[0, 2] == 320  # the matrix given is left alone


@pytest.mark.parametrize("rect", [(0, 0, 640, 480), (100, 37, 64, 200), (639, 479, 1, 1)])
def test_the_frustum_bounds_exactly_the_rectangle(rect: tuple[int, int, int, int]):
    left, top, width, height = rect
    K = intrinsics(640, 480, 0.7)
    K[0, 0] *= 1.3
    K[0, 2] += 11.5
    view = frustum(cropped(K, left, top), width, height, 0.1, 50.0)
    # OpenGL's y points up.
    corners = np.array([[view.left, -view.top, view.near], [view.right, -view.bottom, view.near]])
    pixels, _ = project(corners, np.eye(4), K)
    assert np.allclose(pixels, [[left, top], [left + width, top + height]], atol=1e-9)


def test_opengl_axes_turn_there_and_back():
    assert np.array_equal(OPENGL_AXES @ OPENGL_AXES, np.eye(3))
    assert np.linalg.det(OPENGL_AXES) == 1.0


def test_a_matrix_or_a_field_of_view_names_the_same_camera():
    K = intrinsics(64, 48, 0.7)
    assert np.array_equal(camera_matrix(0.7, 64, 48), K)
    copied = camera_matrix(K, 64, 48)
    assert np.array_equal(copied, K)
    assert copied is not K


@pytest.mark.parametrize(
    "call",
    [
        lambda: intrinsics(0, 10, 1.0),
        lambda: intrinsics(10, 10, 0.0),
        lambda: intrinsics(10, 10, math.pi),
        lambda: intrinsics(10, 10, math.nan),
        lambda: frustum(np.eye(3), 10, 10, 1.0, 1.0),
        lambda: frustum(np.eye(3), 10, 10, 0.0, 1.0),
        lambda: project(np.zeros((1, 3)), np.eye(4), np.eye(4)),
        lambda: project(np.zeros((1, 3)), np.eye(4), np.diag([1.0, -1.0, 1.0])),
        lambda: camera_matrix([[1, 0.1, 0], [0, 1, 0], [0, 0, 1]], 4, 4),
    ],
)
def test_impossible_cameras_are_refused(call):
    with pytest.raises(ParameterError):
        call()
