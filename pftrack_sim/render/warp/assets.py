"""Meshes and textures of a model on the device."""

# Warp is only partly typed.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false

from __future__ import annotations

from typing import Any

import cv2
import mujoco
import numpy as np
import warp as wp
from numpy.typing import NDArray

from pftrack_sim.core.types import FloatArray


def mesh_on_device(model: mujoco.MjModel, mesh: int) -> Any:
    """A mesh, for rays."""
    faces = slice(model.mesh_faceadr[mesh], model.mesh_faceadr[mesh] + model.mesh_facenum[mesh])
    vertices = slice(model.mesh_vertadr[mesh], model.mesh_vertadr[mesh] + model.mesh_vertnum[mesh])
    corners = wp.array(model.mesh_vert[vertices], dtype=wp.vec3)
    return wp.Mesh(corners, wp.array(model.mesh_face[faces].reshape(-1), dtype=int))


def texture_on_device(model: mujoco.MjModel, index: int) -> list[Any]:
    """Mip levels of a texture, the largest first; only that one for the sky, which is always magnified."""
    start, width, height = model.tex_adr[index], model.tex_width[index], model.tex_height[index]
    channels = model.tex_nchannel[index]
    texels = model.tex_data[start : start + width * height * channels].reshape(height, width, channels)
    rgba = np.full((height, width, 4), 255, dtype=np.uint8)
    rgba[..., : min(channels, 4)] = texels[..., :4]
    linear = wp.TextureFilterMode.LINEAR
    if model.tex_type[index] != mujoco.mjtTexture.mjTEXTURE_2D:
        return [wp.Texture2D(rgba, filter_mode=linear)]
    # The largest level keeps its bytes, which Warp reads as shares of 255; means of texels are no bytes.
    _, *smaller = mip_levels(np.divide(rgba, np.float32(255.0), dtype=np.float32))
    levels = [rgba, *(np.ascontiguousarray(level) for level in smaller)]
    return [wp.Texture2D(level, filter_mode=linear, address_mode=wp.TextureAddressMode.WRAP) for level in levels]


def mip_levels(texels: NDArray[np.float32]) -> list[NDArray[np.float32]]:
    """`(H, W, C)` levels of a texture, each half the size of the one before, down to one texel; texels are averaged."""
    levels = [texels]
    while max(levels[-1].shape[:2]) > 1:
        height, width = levels[-1].shape[:2]
        half = max(width // 2, 1), max(height // 2, 1)
        levels.append(np.asarray(cv2.resize(levels[-1], half, interpolation=cv2.INTER_AREA), dtype=np.float32))
    return levels


def texture_gradients(model: mujoco.MjModel) -> FloatArray:
    """`(nmeshface, 2, 3)` gradients of u and v on each mesh face [1/m]; zeros on meshes without coordinates."""
    gradients = np.zeros((model.nmeshface, 2, 3))
    for mesh in np.flatnonzero(model.mesh_texcoordadr >= 0):
        faces = slice(model.mesh_faceadr[mesh], model.mesh_faceadr[mesh] + model.mesh_facenum[mesh])
        corners = model.mesh_vert[model.mesh_vertadr[mesh] + model.mesh_face[faces]].astype(np.float64)
        uv = model.mesh_texcoord[model.mesh_texcoordadr[mesh] + model.mesh_facetexcoord[faces]].astype(np.float64)
        edge_1, edge_2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        normal = np.cross(edge_1, edge_2)
        square = np.maximum((normal**2).sum(axis=1, keepdims=True), 1e-24)
        # Vectors in the face whose product with one edge is 1 and with the other 0.
        dual = np.stack([np.cross(edge_2, normal), np.cross(normal, edge_1)], axis=1) / square[:, None]
        gradients[faces] = np.einsum("feu,fex->fux", uv[:, 1:] - uv[:, :1], dual)
    return gradients
