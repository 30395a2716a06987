"""Geoms in view, and those before people, are those whose corners reach to the inner side of every plane."""

from __future__ import annotations

import mujoco
import numpy as np

from pftrack_sim.camera.extents import CORNERS
from pftrack_sim.camera.pinhole import intrinsics
from pftrack_sim.render.culling import Bounds, PixelRect, View

SIZE, NEAR = (64, 48), 0.05
K = intrinsics(*SIZE, 0.9)
IMAGE = PixelRect(0, 0, *SIZE)


def view_of(data: mujoco.MjData, pose: np.ndarray) -> View:
    return View(data.geom_xpos, data.geom_xmat, pose, K, NEAR)


def shapes(rng: np.random.Generator, spread_m: float) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """A plane, and shapes at random."""
    spec = mujoco.MjSpec()
    spec.worldbody.add_light()
    spec.add_material(name="matt")
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[5, 5, 0.1])
    for kind in (mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_CAPSULE, mujoco.mjtGeom.mjGEOM_SPHERE) * 60:
        place, turn, size = rng.normal(0.0, spread_m, 3), rng.normal(size=4), rng.uniform(0.02, 1.0, 3)
        spec.worldbody.add_geom(type=kind, pos=place, quat=turn / np.linalg.norm(turn), size=size)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return model, data


def random_pose(rng: np.random.Generator) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, :3] = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    pose[:3, 3] = rng.normal(0.0, 2.0, 3)
    return pose


def corners(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """`(ngeom, 8, 3)` corners of the geoms' boxes in the world."""
    local = model.geom_aabb[:, None, :3] + CORNERS * model.geom_aabb[:, None, 3:]
    return local @ data.geom_xmat.reshape(-1, 3, 3).transpose(0, 2, 1) + data.geom_xpos[:, None]


def in_rectangle(points: np.ndarray, pose: np.ndarray, rect: PixelRect) -> np.ndarray:
    """`(N, 5)` whether a corner of each box is beyond the near plane and each side of a view, a pixel wider."""
    fx, fy, cx, cy = K[0, 0], K[1, 1], K[0, 2], K[1, 2]
    left, top, right, bottom = rect.left - 1, rect.top - 1, rect.left + rect.width + 1, rect.top + rect.height + 1
    sides = np.array([(fx, 0, cx - left), (-fx, 0, right - cx), (0, fy, cy - top), (0, -fy, bottom - cy)])
    sides /= np.linalg.norm(sides, axis=1)[:, None]
    local = (points - pose[:3, 3]) @ pose[:3, :3]
    near = (local[..., 2] > NEAR - 0.01).any(axis=1)
    return np.column_stack([near, (local @ sides.T > -0.01).any(axis=1)])


def test_geoms_in_view_have_corners_inside_every_plane():
    rng = np.random.default_rng(0)
    model, data = shapes(rng, 4.0)
    bounds, plane = Bounds(model), model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE
    for _ in range(20):
        pose = random_pose(rng)
        expected = in_rectangle(corners(model, data), pose, IMAGE).all(axis=1) | plane
        found = bounds.in_view(view_of(data, pose), IMAGE, np.arange(model.ngeom))
        np.testing.assert_array_equal(found, expected)
        assert 3 < found.sum() < 150
        some = np.array([7, 0, 30])
        np.testing.assert_array_equal(bounds.in_view(view_of(data, pose), IMAGE, some), expected[some])


def test_geoms_that_may_occlude_people_are_between_them_and_the_camera():
    rng = np.random.default_rng(1)
    model, data = shapes(rng, 2.0)
    bounds, points, rects = Bounds(model), corners(model, data), [PixelRect(5, 4, 30, 40), PixelRect(20, 10, 12, 8)]
    geoms, counts = np.arange(20, model.ngeom), np.zeros(2, dtype=int)
    for _ in range(40):
        pose, farthest, lowest = random_pose(rng), rng.uniform(1.0, 5.0, 2), rng.normal(0.0, 1.0, 2)
        for person, rect in enumerate(rects):
            known = float(farthest[person]), float(lowest[person])
            found = bounds.may_occlude(view_of(data, pose), rect, geoms, *known)
            plane = bounds.may_occlude(view_of(data, pose), rect, np.array([0]), *known)
            assert plane.all(), "nothing is ruled out for what has no box"
            depth = (points[geoms] - pose[:3, 3]) @ pose[:3, 2]
            before = in_rectangle(points[geoms], pose, rect).all(axis=1) & (depth.min(axis=1) < farthest[person] + 0.01)
            high = points[geoms, :, 2].max(axis=1) > lowest[person] + 1e-4
            np.testing.assert_array_equal(found, before & (high | (pose[2, 3] <= lowest[person])))
            counts += [found.sum(), (before & ~high).sum()]
    assert (counts > 20).all(), "each rule decides some"
