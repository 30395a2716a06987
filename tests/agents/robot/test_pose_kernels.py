"""Poses by kernels are those by products of matrices, but for the rounding of the machine's BLAS."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pftrack_sim.agents.robot.control_laws import bearing
from pftrack_sim.agents.robot.pose_kernels import camera_pose, rays, readings
from pftrack_sim.core.types import FloatArray

COUNT = 60


@pytest.fixture
def poses() -> tuple[FloatArray, FloatArray]:
    rng = np.random.default_rng(0)
    rotations = [np.linalg.qr(rng.normal(size=(3, 3)))[0].ravel() for _ in range(COUNT)]
    return rng.normal(0.0, 5.0, (COUNT, 3)), np.array(rotations)


def test_the_camera_pose_turns_mujocos_axes(poses: tuple[FloatArray, FloatArray]):
    positions, rotations = poses
    for camera in range(COUNT):
        expected = np.eye(4)
        expected[:3, :3] = rotations[camera].reshape(3, 3) @ np.diag([1.0, -1.0, -1.0])
        expected[:3, 3] = positions[camera]
        np.testing.assert_array_equal(camera_pose(positions, rotations, camera), expected)


def test_beams_are_turned_with_the_body(poses: tuple[FloatArray, FloatArray]):
    positions, rotations = poses
    angles = np.linspace(-1.5, 1.5, 37)
    beams = np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=1)
    for body in range(COUNT):
        rotation = rotations[body].reshape(3, 3)
        origin, directions = rays(positions, rotations, body, beams, 0.23)
        np.testing.assert_array_equal(origin, positions[body] + 0.23 * rotation[:, 2])
        np.testing.assert_allclose(directions, (beams @ rotation.T).ravel(), rtol=0.0, atol=1e-15)


def test_the_bearing_is_that_of_the_point_in_camera_axes(poses: tuple[FloatArray, FloatArray]):
    positions, rotations = poses
    for camera in range(COUNT):
        pose = camera_pose(positions, rotations, camera)
        x, y, z = pose[:3, :3].T @ (np.array([1.5, -0.5, 1.1]) - pose[:3, 3])
        expected = math.atan2(-x, z), math.atan2(-y, max(math.hypot(x, z), 0.3))
        assert bearing(pose, (1.5, -0.5)) == pytest.approx(expected, rel=0.0, abs=1e-13)


def test_readings_are_scaled_and_limited():
    rng = np.random.default_rng(1)
    sensed, places, scale = rng.normal(size=20), np.array([4, 0, 11, 19], dtype=np.intp), rng.normal(size=4)
    ranges_m = np.array([-1.0, 0.0, 4.999, 5.0, 5.001])
    expected = np.concatenate([[0.1, 0.2, 0.3], sensed[places] * scale, [5.0, 0.0, 4.999, 5.0, 5.0]])
    found = readings((0.1, 0.2, 0.3), sensed, places, scale, ranges_m, 5.0)
    np.testing.assert_array_equal(found, expected.astype(np.float32))
    assert found.dtype == np.float32
