"""Closed-form extents against dense samples of the same shapes, near and far, whole and cut by the near plane."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pftrack_sim.camera import shapes
from pftrack_sim.camera.extents import Bodies
from pftrack_sim.camera.pinhole import intrinsics
from pftrack_sim.camera.shapes import Shape
from pftrack_sim.core.errors import ParameterError

NEAR = 0.05
K = intrinsics(640, 480, 0.9)
EYE = np.eye(4)


def rotation(rng: np.random.Generator) -> np.ndarray:
    matrix = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return matrix * np.sign(np.linalg.det(matrix))


def sampled(shape: Shape, count: int = 90) -> np.ndarray:
    """`(N, 3)` points that lie densely on a shape's surface, in its own frame."""
    if shape.points is not None:
        return shape.points
    polar = np.linspace(0, np.pi, count)[:, None]
    around = np.linspace(0, 2 * np.pi, count)[None]
    unit = np.stack(
        [np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar) + 0 * around], axis=-1
    ).reshape(-1, 3)
    a, b, c = shape.size
    if shape.kind == "ellipsoid":
        return unit * (a, b, c)
    if shape.kind == "capsule":
        return np.concatenate([unit * a + (0, 0, z) for z in np.linspace(-b, b, 5)])
    return np.concatenate([np.column_stack([unit[:, :2] * a, np.full(len(unit), z)]) for z in np.linspace(-b, b, 5)])


def beyond(points: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """What of a convex body's points lies beyond the near plane, with points of the cut itself."""
    ahead, behind = points[points[:, 2] >= NEAR], points[points[:, 2] < NEAR]
    if not len(ahead) or not len(behind):
        return ahead
    first = ahead[rng.integers(len(ahead), size=8_000)]
    second = behind[rng.integers(len(behind), size=8_000)]
    share = (first[:, 2:] - NEAR) / (first[:, 2:] - second[:, 2:])
    return np.concatenate([ahead, first + share * (second - first)])


def random_shapes(rng: np.random.Generator) -> list[Shape]:
    return [
        shapes.sphere(rng.uniform(0.05, 0.4)),
        shapes.ellipsoid(rng.uniform(0.05, 0.5, 3)),
        shapes.capsule(rng.uniform(0.05, 0.3), rng.uniform(0.05, 0.5)),
        shapes.cylinder(rng.uniform(0.05, 0.3), rng.uniform(0.05, 0.5)),
        shapes.cuboid(rng.uniform(0.05, 0.5, 3)),
        shapes.hull(rng.normal(size=(30, 3)) * 0.2),
    ]


@pytest.mark.parametrize("seed", range(24))
@pytest.mark.parametrize("near_the_camera", [False, True])
def test_extents_hold_the_body_and_touch_it(seed: int, near_the_camera: bool):
    rng = np.random.default_rng(seed)
    for shape in random_shapes(rng):
        turn = rotation(rng)
        centre = rng.normal(size=3) * 0.4 + ((0, 0, 0.1) if near_the_camera else (0, 0, 3))
        found, depths = Bodies([[shape]]).extents([centre], [turn], EYE, NEAR)
        points = sampled(shape) @ turn.T + centre
        assert depths[0, 0] <= points[:, 2].min() + 1e-9
        assert depths[0, 1] >= points[:, 2].max() - 1e-9
        assert abs(depths[0] - [points[:, 2].min(), points[:, 2].max()]).max() < 2e-3
        inside = beyond(points, rng)
        if not len(inside):
            assert np.isnan(found[0]).all() or depths[0, 1] - NEAR < 2e-3
            continue
        slopes = inside[:, :2] / inside[:, 2:]
        expected = np.concatenate([slopes.min(axis=0), slopes.max(axis=0)])
        size = 1.0 + np.abs(expected).max()
        # A cut cylinder is a polygon, so it may fall short by a hair.
        slack = 2e-2 * size if shape.kind == "cylinder" and near_the_camera else 1e-9 * size
        assert (found[0, :2] <= expected[:2] + slack).all()
        assert (found[0, 2:] >= expected[2:] - slack).all()
        assert np.abs(found[0] - expected).max() < (0.05 if near_the_camera else 1e-3) * size


def test_a_sphere_subtends_its_angle():
    rng = np.random.default_rng(1)
    for _ in range(200):
        centre = rng.uniform([-2, -2, 1], [2, 2, 60])
        radius = rng.uniform(0.01, 0.9)
        found, _ = Bodies([[shapes.sphere(radius)]]).extents([centre], [np.eye(3)], EYE, NEAR)
        if centre[2] - radius < NEAR:
            continue
        for axis in (0, 1):
            # In the plane of the axis and the depth, the ball's shadow is a disc of the same radius.
            towards = math.atan2(centre[axis], centre[2])
            half = math.asin(radius / math.hypot(centre[axis], centre[2]))
            assert found[0, axis] == pytest.approx(math.tan(towards - half), abs=1e-9)
            assert found[0, axis + 2] == pytest.approx(math.tan(towards + half), abs=1e-9)


def test_shapes_that_are_the_same_have_the_same_extents():
    rng = np.random.default_rng(2)
    for _ in range(50):
        centre, turn = rng.normal(size=3) * 0.5 + (0, 0, 2), rotation(rng)
        radius = rng.uniform(0.05, 0.5)
        pairs = [
            (shapes.sphere(radius), shapes.ellipsoid([radius] * 3)),
            (shapes.sphere(radius), shapes.capsule(radius, 0.0)),
            (shapes.cuboid([0.1, 0.2, 0.3]), shapes.hull(shapes.CORNERS * (0.1, 0.2, 0.3))),
        ]
        for pair in pairs:
            found, _ = Bodies([list(pair)]).extents([centre] * 2, [turn] * 2, EYE, NEAR)
            assert np.allclose(found[0], found[1], atol=1e-9)


def test_a_mirrored_scene_has_mirrored_extents():
    rng = np.random.default_rng(3)
    for near_the_camera in (False, True):
        for shape in random_shapes(rng)[:4]:  # those that are their own mirror image
            centre, turn = rng.normal(size=3) * 0.3 + (0, 0, 0.1 if near_the_camera else 2.0), rotation(rng)
            mirror = np.diag([-1.0, 1.0, 1.0])
            flip = mirror @ turn @ np.diag([-1.0, 1.0, 1.0])
            both, _ = Bodies([[shape, shape]]).extents([centre, mirror @ centre], [turn, flip], EYE, NEAR)
            assert np.allclose(both[1], both[0][[2, 1, 0, 3]] * (-1, 1, -1, 1), atol=1e-6, equal_nan=True)


@pytest.mark.parametrize("index", range(6))
def test_nothing_jumps_when_a_body_reaches_the_near_plane(index: int):
    rng = np.random.default_rng(4)
    shape, turn = random_shapes(rng)[index], rotation(rng)
    body = Bodies([[shape]])
    _, depths = body.extents([(0.1, 0.0, 5.0)], [turn], EYE, NEAR)
    touching = 5.0 - depths[0, 0] + NEAR
    before, _ = body.extents([(0.1, 0.0, touching + 1e-9)], [turn], EYE, NEAR)
    after, _ = body.extents([(0.1, 0.0, touching - 1e-9)], [turn], EYE, NEAR)
    # A cylinder becomes a polygon of 96 sides when cut.
    assert np.allclose(before, after, rtol=2e-3 if shape.kind == "cylinder" else 1e-4)


def test_what_lies_behind_the_near_plane_has_no_box():
    rng = np.random.default_rng(5)
    bodies = Bodies([[shape] for shape in random_shapes(rng)])
    boxes, depths = bodies.boxes([(0, 0, -3)] * 6, [np.eye(3)] * 6, EYE, K, NEAR)
    assert np.isnan(boxes).all()
    assert (depths < 0).all()


def test_a_camera_inside_a_body_sees_a_finite_box_beyond_the_image():
    rng = np.random.default_rng(6)
    for shape in [shapes.sphere(0.5), shapes.capsule(0.4, 0.5), shapes.cuboid([0.5, 0.5, 0.5])]:
        boxes, _ = Bodies([[shape]]).boxes([(0, 0, 0)], [rotation(rng)], EYE, K, NEAR)
        assert np.isfinite(boxes).all()
        assert (boxes[0, :2] < 0).all()
        assert (boxes[0, :2] + boxes[0, 2:] > (640, 480)).all()


def test_a_body_is_the_union_of_its_parts_in_front_of_the_camera():
    rng = np.random.default_rng(7)
    parts = [random_shapes(rng) for _ in range(4)]
    flat = [shape for body in parts for shape in body]
    positions = rng.normal(size=(len(flat), 3)) * 1.5 + (0, 0, 1.0)
    turns = np.stack([rotation(rng) for _ in flat])
    boxes, depths = Bodies(parts).boxes(positions, turns, EYE, K, NEAR)
    alone, alone_depths = Bodies([[shape] for shape in flat]).boxes(positions, turns, EYE, K, NEAR)
    for index in range(4):
        own = slice(6 * index, 6 * index + 6)
        assert np.allclose(boxes[index, :2], np.nanmin(alone[own, :2], axis=0), atol=1e-9)
        assert np.allclose((boxes[index, :2] + boxes[index, 2:]), np.nanmax(alone[own, :2] + alone[own, 2:], axis=0))
        assert np.allclose(depths[index], [alone_depths[own, 0].min(), alone_depths[own, 1].max()])


def test_moving_the_camera_and_the_world_together_changes_nothing():
    rng = np.random.default_rng(8)
    flat = random_shapes(rng)
    positions, turns = rng.normal(size=(6, 3)) * 0.5 + (0, 0, 3.0), np.stack([rotation(rng) for _ in flat])
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation(rng), rng.normal(size=3) * 10
    body = Bodies([flat])
    still, _ = body.boxes(positions, turns, EYE, K, NEAR)
    moved, _ = body.boxes(positions @ pose[:3, :3].T + pose[:3, 3], pose[:3, :3] @ turns, pose, K, NEAR)
    assert np.allclose(still, moved, atol=1e-6)


def test_arguments_stay_as_they_are():
    positions, turns, pose = np.full((1, 3), 2.0), np.eye(3)[None].copy(), np.eye(4)
    kept = [array.copy() for array in (positions, turns, pose)]
    Bodies([[shapes.cylinder(0.1, 3.0)]]).boxes(positions, turns, pose, K, NEAR)
    assert all(np.array_equal(a, b) for a, b in zip(kept, (positions, turns, pose), strict=True))


@pytest.mark.parametrize(
    "call",
    [
        lambda: shapes.hull(np.empty((0, 3))),
        lambda: shapes.hull(np.zeros((3, 2))),
        lambda: Bodies([[shapes.sphere(1.0)], []]),
        lambda: Bodies([[shapes.sphere(1.0)]]).extents(np.zeros((1, 3)), np.eye(3)[None], EYE, 0.0),
    ],
)
def test_impossible_shapes_are_refused(call):
    with pytest.raises(ParameterError):
        call()


def test_the_lowest_point_is_the_lowest_of_all_points():
    rng = np.random.default_rng(9)
    parts = [random_shapes(rng) for _ in range(3)]
    flat = [shape for body in parts for shape in body]
    positions, turns = rng.normal(size=(len(flat), 3)), np.stack([rotation(rng) for _ in flat])
    found = Bodies(parts).lowest(positions, turns)
    for index in range(3):
        heights = [
            (sampled(shape) @ turns[6 * index + i].T + positions[6 * index + i])[:, 2].min()
            for i, shape in enumerate(parts[index])
        ]
        assert found[index] <= min(heights) + 1e-12
        assert found[index] == pytest.approx(min(heights), abs=1e-3)
