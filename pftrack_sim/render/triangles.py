"""Triangles of a model's geoms, in the frame of each geom."""

from __future__ import annotations

from functools import cache
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.camera.extents import CORNERS
from pftrack_sim.camera.projection import Triangles
from pftrack_sim.core.types import BoolArray, FloatArray, IntArray
from pftrack_sim.render.culling import View
from pftrack_sim.scene.scene_spec import geom_meshes

_MESH = int(mujoco.mjtGeom.mjGEOM_MESH)
_COARSE_PX, _COARSEST_PX = 6.0, 2.0  # Radii in the image below which the coarser meshes of a geom are drawn
_UNBOUNDED_M = 1e3  # Half size of a plane without limits
_BOX_FACES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4],
     [1, 5, 7], [1, 7, 3]]
)  # fmt: skip
"""Corners of each triangle of a box with the corners `CORNERS`, counter-clockwise from outside."""

_QUAD = np.array([[0, 1, 2], [0, 2, 3]])
_NOTHING = np.empty((0, 3)), np.empty((0, 3), dtype=np.intp)


class Detail:
    """Which geoms of a model are so small in a view that a coarser mesh is drawn in place of theirs.

    A geom at a level of detail is a *shape*: its number is level times ngeom plus geom.

    Attributes:
        meshes: `(L, ngeom)` mesh of each geom by level, the finest first; -1 for none.
    """

    def __init__(self, model: Any) -> None:
        self.meshes = geom_meshes(model)
        detailed = (self.meshes[1:] != self.meshes[0]).any(axis=0)
        self._radii_m = np.where(detailed, model.geom_rbound, np.inf)

    def shapes(self, view: View, geoms: IntArray) -> IntArray:
        """`(N,)` shapes of geoms in a view: their outlines differ from the finest by some tenths of a pixel."""
        depths_m = (view.geom_xpos[geoms] - view.T_world_camera[:3, 3]) @ view.T_world_camera[:3, 2]
        across = self._radii_m[geoms] * view.K[1, 1]
        levels = (across < _COARSE_PX * depths_m).astype(np.intp) + (across < _COARSEST_PX * depths_m)
        return levels * len(self._radii_m) + geoms


def model_triangles(model: Any, drawn: BoolArray, levels: IntArray) -> Triangles:
    """Triangles of all shapes of the `(ngeom,)` drawn geoms of a model; other shapes have none.

    `(L, ngeom)` levels are the meshes of the geoms. Coarser shapes of those that have one mesh have no triangles.
    """
    angles = np.linspace(-0.5 * np.pi, 0.5 * np.pi, int(model.vis.quality.numstacks) + 1)
    arc = angles, np.cos(angles), np.sin(angles)
    slices, sizes = int(model.vis.quality.numslices), np.asarray(model.geom_size, dtype=np.float64)
    kinds: list[int] = model.geom_type.tolist()
    meshes, shown = _meshes(model), np.asarray(drawn).tolist()
    finest: list[int] = levels[0].tolist()
    shapes = [
        _NOTHING
        if not shown[geom]
        else meshes[mesh]
        if kinds[geom] == _MESH
        else _shape(mujoco.mjtGeom(kinds[geom]), sizes[geom], slices, *arc)
        for geom, mesh in enumerate(finest)
    ]
    for coarser in levels[1:].tolist():
        shapes += [
            meshes[mesh] if shown[geom] and mesh != finest[geom] else _NOTHING for geom, mesh in enumerate(coarser)
        ]
    vertices = np.concatenate([vertices for vertices, _ in shapes]).astype(np.float64, copy=False)
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in shapes)]).astype(np.intp)
    faces = np.concatenate([faces for _, faces in shapes]).astype(np.int32)
    return Triangles(vertices, faces, starts, np.cumsum([0, *(len(faces) for _, faces in shapes)]).astype(np.intp))


def _meshes(model: Any) -> list[tuple[NDArray[Any], NDArray[Any]]]:
    """`(V, 3)` vertices and `(F, 3)` triangles of every mesh."""
    vertices, faces = model.mesh_vert, model.mesh_face
    rows = zip(
        *(array.tolist() for array in (model.mesh_vertadr, model.mesh_vertnum, model.mesh_faceadr, model.mesh_facenum)),
        strict=True,
    )
    return [
        (vertices[first : first + count], faces[start : start + faces_count])
        for first, count, start, faces_count in rows
    ]


def _shape(
    kind: mujoco.mjtGeom, size: FloatArray, slices: int, angles: FloatArray, cos: FloatArray, sin: FloatArray
) -> tuple[FloatArray, IntArray]:
    """`(V, 3)` vertices and `(F, 3)` triangles of a geom that is no mesh, as finely divided as OpenGL draws it.

    `(S + 1,)` angles, from the bottom of a sphere to its top, and their cosines and sines divide round geoms.
    """
    match kind:
        case mujoco.mjtGeom.mjGEOM_BOX:
            return CORNERS * size, _BOX_FACES
        case mujoco.mjtGeom.mjGEOM_PLANE:
            half = np.where(size[:2] > 0.0, size[:2], _UNBOUNDED_M)
            return np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * (half[0], half[1], 1.0), _QUAD
        case mujoco.mjtGeom.mjGEOM_CYLINDER:
            return _revolved(size[0] * np.array([0.0, 1, 1, 0]), size[1] * np.array([-1.0, -1, 1, 1]), slices)
        case mujoco.mjtGeom.mjGEOM_CAPSULE:
            return _revolved(size[0] * cos, size[0] * sin + size[1] * np.where(angles < 0.0, -1.0, 1.0), slices)
        case mujoco.mjtGeom.mjGEOM_SPHERE:
            return _revolved(size[0] * cos, size[0] * sin, slices)
        case mujoco.mjtGeom.mjGEOM_ELLIPSOID:
            vertices, faces = _revolved(cos, sin, slices)
            return vertices * size, faces
        case _:
            return _NOTHING


def _revolved(radii: FloatArray, heights: FloatArray, slices: int) -> tuple[FloatArray, IntArray]:
    """Surface of revolution around z of a profile, from bottom to top, that begins and ends on the axis."""
    circle, faces = _revolution(len(radii), slices)
    return (circle * np.stack([radii, radii, heights], axis=1)[:, None]).reshape(-1, 3), faces


@cache
def _revolution(rings: int, slices: int) -> tuple[FloatArray, IntArray]:
    """`(slices, 3)` points of a circle with radius and height 1, and the triangles between such rings; read-only."""
    angles = 2.0 * np.pi * np.arange(slices) / slices
    circle = np.stack([np.cos(angles), np.sin(angles), np.ones(slices)], axis=1)
    ring, slice_ = np.meshgrid(np.arange(rings - 1), np.arange(slices), indexing="ij")
    here, after = ring * slices + slice_, ring * slices + (slice_ + 1) % slices
    quads = np.stack([here, after, after + slices, here + slices], axis=-1).reshape(-1, 4)
    faces = quads[:, _QUAD].reshape(-1, 3)
    for array in (circle, faces):
        array.setflags(write=False)
    return circle, faces
