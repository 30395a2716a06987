"""Geoms in view, and those before people, are those whose corners reach to the inner side of every plane."""

from __future__ import annotations

import mujoco
import numpy as np

from pftrack_sim.camera.extents import CORNERS
from pftrack_sim.camera.pinhole import focal_and_centre, intrinsics
from pftrack_sim.render.backend import PixelRect
from pftrack_sim.render.culling import Bounds

SIZE, NEAR = (64, 48), 0.05
K = intrinsics(*SIZE, 0.9)
VIEW = focal_and_centre(K), PixelRect(0, 0, *SIZE), NEAR


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
        expected = in_rectangle(corners(model, data), pose, PixelRect(0, 0, *SIZE)).all(axis=1) | plane
        found = bounds.in_view(data, pose, *VIEW, np.arange(model.ngeom))
        np.testing.assert_array_equal(found, expected)
        assert 3 < found.sum() < 150
        some = np.array([7, 0, 30])
        np.testing.assert_array_equal(bounds.in_view(data, pose, *VIEW, some), expected[some])


def test_geoms_that_may_occlude_people_are_between_them_and_the_camera():
    rng = np.random.default_rng(1)
    model, data = shapes(rng, 2.0)
    bounds, points, rects = Bounds(model), corners(model, data), [PixelRect(5, 4, 30, 40), PixelRect(20, 10, 12, 8)]
    limbs, geoms = [np.array([3, 8, 9]), np.array([5, 12])], np.arange(20, model.ngeom)
    counts = np.zeros(3, dtype=int)
    for _ in range(40):
        pose, farthest, lowest = random_pose(rng), rng.uniform(1.0, 5.0, 2), rng.normal(0.0, 1.0, 2)
        for person, (rect, own) in enumerate(zip(rects, limbs, strict=True)):
            known = own, float(farthest[person]), float(lowest[person])
            found = bounds.may_occlude(data, pose, focal_and_centre(K), rect, NEAR, geoms, *known)
            plane = bounds.may_occlude(data, pose, focal_and_centre(K), rect, NEAR, np.array([0]), *known)
            assert plane.all(), "nothing is ruled out for what has no box"
            depth = (points[geoms] - pose[:3, 3]) @ pose[:3, 2]
            before = in_rectangle(points[geoms], pose, rect).all(axis=1) & (depth.min(axis=1) < farthest[person] + 0.01)
            high = points[geoms, :, 2].max(axis=1) > lowest[person] + 1e-4
            beside = np.array([separated(model, data, geom, pose[:3, 3], points[own]) for geom in geoms])
            np.testing.assert_array_equal(found, before & (high | (pose[2, 3] <= lowest[person])) & ~beside)
            counts += [found.sum(), (before & ~high).sum(), (before & beside).sum()]
    assert (counts > 20).all(), "each rule decides some"


def test_meshes_that_may_occlude_people_have_a_triangle_that_does():
    rng = np.random.default_rng(2)
    spec = mujoco.MjSpec()
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.2, 0.3, 0.9])
    for index in range(30):
        # Tetrahedra far apart: most of the mesh's box is empty.
        points = (rng.normal(0.0, 2.0, (8, 1, 3)) + rng.normal(0.0, 0.2, (8, 4, 3))).reshape(-1, 3)
        faces = 4 * np.arange(8)[:, None, None] + np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
        mesh = spec.add_mesh(name=f"mesh-{index}", uservert=points.ravel(), userface=faces.ravel())
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
        place, turn = rng.normal(0.0, 1.0, 3), rng.normal(size=4)
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=mesh.name, pos=place, quat=turn)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    boxes, triangles = Bounds(model), Bounds(model, triangles=True)
    geoms, limbs, rect = np.arange(31), np.array([0]), PixelRect(20, 10, 24, 30)
    counts = np.zeros(3, dtype=int)
    for _ in range(40):
        pose, farthest, lowest = random_pose(rng), rng.uniform(1.0, 5.0), rng.normal(0.0, 1.0)
        known = data, pose, focal_and_centre(K), rect, NEAR, geoms, limbs, farthest, lowest
        by_boxes, found = boxes.may_occlude(*known), triangles.may_occlude(*known)
        assert found[0] == by_boxes[0], "only meshes have triangles"
        for geom in range(1, 31):
            corners_of = corners_of_triangles(model, data, geom)
            depth, height = (corners_of - pose[:3, 3]) @ pose[:3, 2], corners_of[..., 2].max(axis=1)
            reaching = in_rectangle(corners_of, pose, rect).all(axis=1) & (depth.min(axis=1) < farthest + 0.01)
            high = (height > lowest + 1e-4) | (pose[2, 3] <= lowest)
            expected = by_boxes[geom] & (reaching & high).any()
            assert found[geom] == expected
            counts += [expected, by_boxes[geom] & ~expected, expected & ~(reaching & high).all()]
    assert (counts > 20).all(), "meshes of all kinds"
    triangles.release()
    np.testing.assert_array_equal(triangles.may_occlude(*known), by_boxes)


def corners_of_triangles(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> np.ndarray:
    """`(F, 3, 3)` corners of the triangles of a mesh in the world."""
    mesh = int(model.geom_dataid[geom])
    vertex, vertices = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    face, faces = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
    local = model.mesh_vert[vertex : vertex + vertices][model.mesh_face[face : face + faces]].astype(np.float64)
    return local @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]


def separated(model: mujoco.MjModel, data: mujoco.MjData, geom: int, eye: np.ndarray, limbs: np.ndarray) -> bool:
    """Whether a face of a geom's box has the camera and the corners of all limbs on its outer side."""
    rotation, (middle, half) = data.geom_xmat[geom].reshape(3, 3), model.geom_aabb[geom].reshape(2, 3)
    camera = (eye - data.geom_xpos[geom]) @ rotation - middle
    person = (limbs.reshape(-1, 3) - data.geom_xpos[geom]) @ rotation - middle
    reach = half + 1e-4
    beyond = (camera > reach) & (person > reach).all(axis=0)
    return bool((beyond | ((camera < -reach) & (person < -reach).all(axis=0))).any())
