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

_MESH = int(mujoco.mjtGeom.mjGEOM_MESH)
_COARSE_PX = 6.0  # Radius in the image below which the coarse mesh of a geom is drawn
_UNBOUNDED_M = 1e3  # Half size of a plane without limits
_BOX_FACES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4],
     [1, 5, 7], [1, 7, 3]]
)  # fmt: skip
"""Corners of each triangle of a box with the corners `CORNERS`, counter-clockwise from outside."""

_QUAD = np.array([[0, 1, 2], [0, 2, 3]])
_NOTHING = np.empty((0, 3)), np.empty((0, 3), dtype=np.intp)


class Detail:
    """Which geoms of a model are so small in a view that a coarse mesh is drawn in place of theirs.

    Attributes:
        meshes: `(ngeom,)` mesh of each geom; -1 for none.
        coarse: `(ngeom,)` mesh of each for the distance; the same where there is no other.
    """

    def __init__(self, model: Any) -> None:
        self.meshes = np.array(model.geom_dataid)
        # A coarse mesh comes directly before the one whose points it shares.
        shared = np.diff(model.mesh_vertadr, prepend=-1) == 0
        self._has_coarse: BoolArray = np.append(shared, False)[self.meshes]
        self.coarse = self.meshes - self._has_coarse
        self._radii_m = np.array(model.geom_rbound)

    def far(self, view: View, geoms: IntArray) -> BoolArray:
        """`(N,)` of which geoms the coarse mesh is drawn: its outline differs by some tenths of a pixel."""
        depths_m = (view.geom_xpos[geoms] - view.T_world_camera[:3, 3]) @ view.T_world_camera[:3, 2]
        return self._has_coarse[geoms] & (self._radii_m[geoms] * view.intrinsics[1] < _COARSE_PX * depths_m)


def model_triangles(model: Any, drawn: BoolArray, geom_meshes: IntArray | None = None) -> Triangles:
    """Triangles of the `(ngeom,)` drawn geoms of a model, of other meshes than theirs if given; others have none."""
    angles = np.linspace(-0.5 * np.pi, 0.5 * np.pi, int(model.vis.quality.numstacks) + 1)
    arc = angles, np.cos(angles), np.sin(angles)
    slices, sizes = int(model.vis.quality.numslices), np.asarray(model.geom_size, dtype=np.float64)
    kinds, meshes, shown = model.geom_type.tolist(), _meshes(model), np.asarray(drawn).tolist()
    data: list[int] = (model.geom_dataid if geom_meshes is None else geom_meshes).tolist()
    shapes = [
        _NOTHING
        if not shown[geom]
        else meshes[data[geom]]
        if kind == _MESH
        else _shape(mujoco.mjtGeom(kind), sizes[geom], slices, *arc)
        for geom, kind in enumerate(kinds)
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
