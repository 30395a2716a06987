"""Extents of convex hulls against dense samples, near and far, whole and cut by the near plane."""

from __future__ import annotations

import numpy as np
import pytest

from pftrack_sim.camera.extents import CORNERS, Bodies
from pftrack_sim.camera.pinhole import intrinsics

NEAR = 0.05
K = intrinsics(640, 480, 0.9)
EYE = np.eye(4)


def rotation(rng: np.random.Generator) -> np.ndarray:
    matrix = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return matrix * np.sign(np.linalg.det(matrix))


def random_parts(rng: np.random.Generator) -> list[np.ndarray]:
    """A box, a small and a large hull, and a rod."""
    return [
        CORNERS * rng.uniform(0.05, 0.5, 3),
        rng.normal(size=(30, 3)) * 0.2,
        rng.normal(size=(150, 3)) * 0.2,
        CORNERS * (0.02, 0.02, 0.8),
    ]


def extents_of(body: Bodies, position, turn) -> tuple[np.ndarray, np.ndarray]:
    """`(1, 4)` smallest and largest normalized coordinates, and `(1, 2)` depths, of one part."""
    boxes, depths, _ = body.boxes([position], [turn], EYE, np.eye(3), NEAR)
    return np.column_stack([boxes[:, :2], boxes[:, :2] + boxes[:, 2:]]), depths


def beyond(points: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Points of a hull beyond the near plane, with points of the section."""
    ahead, behind = points[points[:, 2] >= NEAR], points[points[:, 2] < NEAR]
    if not len(ahead) or not len(behind):
        return ahead
    first = ahead[rng.integers(len(ahead), size=8_000)]
    second = behind[rng.integers(len(behind), size=8_000)]
    share = (first[:, 2:] - NEAR) / (first[:, 2:] - second[:, 2:])
    return np.concatenate([ahead, first + share * (second - first)])


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("near_the_camera", [False, True])
def test_extents_contain_the_part_and_touch_it(seed: int, near_the_camera: bool):
    rng = np.random.default_rng(seed)
    for vertices in random_parts(rng):
        turn = rotation(rng)
        centre = rng.normal(size=3) * 0.4 + ((0, 0, 0.1) if near_the_camera else (0, 0, 3))
        extents, depths = extents_of(Bodies([[vertices]]), centre, turn)
        points = vertices @ turn.T + centre
        assert np.allclose(depths[0], [points[:, 2].min(), points[:, 2].max()], atol=1e-12)
        visible = beyond(points, rng)
        if not len(visible):
            assert np.isnan(extents[0]).all()
            continue
        coordinates = visible[:, :2] / visible[:, 2:]
        expected = np.concatenate([coordinates.min(axis=0), coordinates.max(axis=0)])
        size = 1.0 + np.abs(expected).max()
        assert (extents[0, :2] <= expected[:2] + 1e-9 * size).all()
        assert (extents[0, 2:] >= expected[2:] - 1e-9 * size).all()
        assert np.abs(extents[0] - expected).max() < (0.05 if near_the_camera else 1e-9) * size


@pytest.mark.parametrize("index", range(4))
def test_extents_are_continuous_at_the_near_plane(index: int):
    rng = np.random.default_rng(4)
    body, turn = Bodies([[random_parts(rng)[index]]]), rotation(rng)
    _, depths = extents_of(body, (0.1, 0.0, 5.0), turn)
    touching = 5.0 - depths[0, 0] + NEAR
    before, _ = extents_of(body, (0.1, 0.0, touching + 1e-9), turn)
    after, _ = extents_of(body, (0.1, 0.0, touching - 1e-9), turn)
    assert np.allclose(before, after, rtol=1e-4)


def test_a_body_behind_the_near_plane_has_no_box():
    parts = random_parts(np.random.default_rng(5))
    boxes, depths, _ = Bodies([[part] for part in parts]).boxes([(0, 0, -3)] * 4, [np.eye(3)] * 4, EYE, K, NEAR)
    assert np.isnan(boxes).all()
    assert (depths < 0).all()


def test_a_camera_inside_a_body_sees_a_finite_box_larger_than_the_image():
    turn = rotation(np.random.default_rng(6))
    boxes, *_ = Bodies([[CORNERS * 0.5]]).boxes([(0, 0, 0)], [turn], EYE, K, NEAR)
    assert np.isfinite(boxes).all()
    assert (boxes[0, :2] < 0).all()
    assert (boxes[0, :2] + boxes[0, 2:] > (640, 480)).all()


def test_the_box_of_a_body_is_the_union_of_its_parts_in_front_of_the_camera():
    rng = np.random.default_rng(7)
    bodies = [random_parts(rng) for _ in range(4)]
    parts = [part for body in bodies for part in body]
    positions = rng.normal(size=(len(parts), 3)) * 1.5 + (0, 0, 1.0)
    turns = np.stack([rotation(rng) for _ in parts])
    boxes, depths, _ = Bodies(bodies).boxes(positions, turns, EYE, K, NEAR)
    alone, alone_depths, _ = Bodies([[part] for part in parts]).boxes(positions, turns, EYE, K, NEAR)
    for index in range(4):
        own = slice(4 * index, 4 * index + 4)
        assert np.allclose(boxes[index, :2], np.nanmin(alone[own, :2], axis=0), atol=1e-9)
        assert np.allclose((boxes[index, :2] + boxes[index, 2:]), np.nanmax(alone[own, :2] + alone[own, 2:], axis=0))
        assert np.allclose(depths[index], [alone_depths[own, 0].min(), alone_depths[own, 1].max()])


def test_moving_the_camera_and_the_world_together_changes_nothing():
    rng = np.random.default_rng(8)
    parts = random_parts(rng)
    positions, turns = rng.normal(size=(4, 3)) * 0.5 + (0, 0, 3.0), np.stack([rotation(rng) for _ in parts])
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation(rng), rng.normal(size=3) * 10
    body = Bodies([parts])
    still, *_ = body.boxes(positions, turns, EYE, K, NEAR)
    moved, *_ = body.boxes(positions @ pose[:3, :3].T + pose[:3, 3], pose[:3, :3] @ turns, pose, K, NEAR)
    assert np.allclose(still, moved, atol=1e-6)


def test_arguments_are_not_changed():
    positions, turns, pose = np.full((1, 3), 2.0), np.eye(3)[None].copy(), np.eye(4)
    kept = [array.copy() for array in (positions, turns, pose)]
    Bodies([[CORNERS]]).boxes(positions, turns, pose, K, NEAR)
    assert all(np.array_equal(a, b) for a, b in zip(kept, (positions, turns, pose), strict=True))


def test_the_lowest_point_is_that_of_all_vertices():
    rng = np.random.default_rng(9)
    bodies = [random_parts(rng) for _ in range(3)]
    parts = [part for body in bodies for part in body]
    positions, turns = rng.normal(size=(len(parts), 3)), np.stack([rotation(rng) for _ in parts])
    heights = [(part @ turn.T + at)[:, 2].min() for part, turn, at in zip(parts, turns, positions, strict=True)]
    expected = np.array(heights).reshape(3, 4).min(axis=1)
    assert np.allclose(Bodies(bodies).boxes(positions, turns, EYE, K, NEAR)[2], expected, atol=1e-12)
