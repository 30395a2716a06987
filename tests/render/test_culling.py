"""Geoms in view by the kernel are those by planes and boxes on arrays."""

import mujoco
import numpy as np

from pftrack_sim.camera.pinhole import intrinsics
from pftrack_sim.render.backend import PixelRect
from pftrack_sim.render.culling import Bounds, _view_planes


def test_geoms_in_view_are_those_of_planes_on_arrays():
    rng = np.random.default_rng(0)
    spec = mujoco.MjSpec()
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[5, 5, 0.1])
    for kind in (mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_CAPSULE, mujoco.mjtGeom.mjGEOM_SPHERE) * 60:
        place, turn, size = rng.normal(0.0, 4.0, 3), rng.normal(size=4), rng.uniform(0.02, 1.0, 3)
        spec.worldbody.add_geom(type=kind, pos=place, quat=turn / np.linalg.norm(turn), size=size)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    bounds, size, K = Bounds(model), (64, 48), intrinsics(64, 48, 0.9)
    for _ in range(20):
        pose = np.eye(4)
        pose[:3, :3] = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        pose[:3, 3] = rng.normal(0.0, 2.0, 3)
        normals, offsets = _view_planes(pose, K, [PixelRect(0, 0, *size)], 0.05)
        expected = bounds._reaches(data, np.arange(model.ngeom), normals, offsets).all(axis=1) | bounds._unbounded
        found = bounds.in_view(data, pose, K, size, 0.05)
        np.testing.assert_array_equal(found, expected)
        assert 3 < found.sum() < 150
        some = np.array([7, 0, 30])
        np.testing.assert_array_equal(bounds.in_view(data, pose, K, size, 0.05, some), expected[some])
