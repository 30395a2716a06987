"""Colours, meshes and textures of a compiled model, as another spec takes them."""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.types import FloatArray, IntArray, read_only

_UNSET_RGBA = np.array([0.5, 0.5, 0.5, 1.0], dtype=np.float32)


def colours(model: Any) -> FloatArray:
    """`(ngeom, 4)` colours: the material's where the geom's own was left as it is."""
    rgba = np.array(model.geom_rgba, dtype=np.float64)
    by_material = (model.geom_matid >= 0) & (model.geom_rgba == _UNSET_RGBA).all(axis=1)
    rgba[by_material] = model.mat_rgba[model.geom_matid[by_material]]
    return rgba


def quaternion(rotation: FloatArray) -> FloatArray:
    """`(4,)` quaternion of a rotation matrix `(3, 3)`."""
    found = np.empty(4)
    mujoco.mju_mat2Quat(found, np.ascontiguousarray(rotation).ravel())
    return found


def mesh_corners(model: Any, mesh: int) -> tuple[FloatArray, FloatArray, FloatArray, IntArray]:
    """A mesh with one vertex for each different place, normal and texture coordinate.

    `(V, 3)` places [m] and normals, `(V, 2)` texture coordinates, or `(0, 2)` without any, and `(F, 3)` triangles.
    """
    faces = slice(model.mesh_faceadr[mesh], model.mesh_faceadr[mesh] + model.mesh_facenum[mesh])
    textured = model.mesh_texcoordadr[mesh] >= 0
    corners = [model.mesh_face[faces], model.mesh_facenormal[faces]]
    corners += [model.mesh_facetexcoord[faces]] if textured else []
    rows, index = np.unique(np.stack(corners, axis=-1).reshape(-1, len(corners)), axis=0, return_inverse=True)
    places = model.mesh_vert[model.mesh_vertadr[mesh] + rows[:, 0]].astype(np.float64)
    normals = model.mesh_normal[model.mesh_normaladr[mesh] + rows[:, 1]].astype(np.float64)
    uv = model.mesh_texcoord[model.mesh_texcoordadr[mesh] + rows[:, 2]].astype(np.float64) if textured else None
    return places, normals, np.zeros((0, 2)) if uv is None else uv, index.reshape(-1, 3)


def texture_image(model: Any, texture: int) -> NDArray[np.uint8]:
    """`(H, W, 3)` image of a texture; the six faces of cubes lie below each other."""
    shape = [int(one[texture]) for one in (model.tex_height, model.tex_width, model.tex_nchannel)]
    start = int(model.tex_adr[texture])
    return texels(model.tex_data[start : start + math.prod(shape)].reshape(shape))


def texels(image: NDArray[Any]) -> NDArray[np.uint8]:
    """`(H, W, 3)` of an image with any number of channels, no wider than 2048 pixels."""
    pixels = np.asarray(image, dtype=np.uint8)
    pixels = pixels[..., :3] if pixels.shape[-1] >= 3 else np.repeat(pixels[..., :1], 3, axis=-1)
    step = -(-pixels.shape[1] // 2048)
    return read_only(np.ascontiguousarray(pixels[::step, ::step]))
