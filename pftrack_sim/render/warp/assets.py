"""Meshes and textures of one model on the device, shared with other models that have the same ones."""

# Warp is only partly typed.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false

from __future__ import annotations

import hashlib
from collections.abc import Callable
from typing import Any
from weakref import WeakValueDictionary

import cv2
import mujoco
import numpy as np
import warp as wp
from numpy.typing import NDArray

from pftrack_sim.core.types import FloatArray


class MipLevels(list[Any]):
    """Mip levels of one texture, the largest first; a list that can be referenced weakly."""


class SharedAssets:
    """Meshes and textures that are in use, by content: the same one is on the device once."""

    def __init__(self) -> None:
        self._known: WeakValueDictionary[bytes, Any] = WeakValueDictionary()

    def get(self, parts: tuple[NDArray[Any], ...], make: Callable[[], Any]) -> Any:
        """What was made of arrays with this content, while it is in use; otherwise made now."""
        digest = hashlib.blake2b(digest_size=16)
        for part in parts:
            digest.update(repr((part.shape, part.dtype.str)).encode())
            digest.update(np.ascontiguousarray(part).data)
        key = digest.digest()
        found = self._known.get(key)
        if found is None:
            found = self._known[key] = make()
        return found


class Assets:
    """Meshes, textures and gradients of texture coordinates of one model.

    Args:
        model: The model.
        shared: Those of other models, where there are any.
    """

    def __init__(self, model: mujoco.MjModel, shared: SharedAssets | None = None) -> None:
        shared = SharedAssets() if shared is None else shared
        self.meshes: list[Any] = [_mesh(model, mesh, shared) for mesh in range(model.nmesh)]
        self.textures: list[MipLevels] = [_texture(model, index, shared) for index in range(model.ntex)]
        self.gradients = texture_gradients(model)
        """`(nmeshface, 2, 3)`, see `texture_gradients`."""


def _mesh(model: mujoco.MjModel, mesh: int, shared: SharedAssets) -> Any:
    faces = slice(model.mesh_faceadr[mesh], model.mesh_faceadr[mesh] + model.mesh_facenum[mesh])
    vertices = slice(model.mesh_vertadr[mesh], model.mesh_vertadr[mesh] + model.mesh_vertnum[mesh])
    corners, ends = model.mesh_vert[vertices], model.mesh_face[faces].reshape(-1)
    return shared.get((corners, ends), lambda: wp.Mesh(wp.array(corners, dtype=wp.vec3), wp.array(ends, dtype=int)))


def _texture(model: mujoco.MjModel, index: int, shared: SharedAssets) -> MipLevels:
    """Mip levels of a texture; only the largest for the sky, which is always magnified."""
    start, width, height = model.tex_adr[index], model.tex_width[index], model.tex_height[index]
    channels = model.tex_nchannel[index]
    texels = model.tex_data[start : start + width * height * channels].reshape(height, width, channels)
    flat = bool(model.tex_type[index] == mujoco.mjtTexture.mjTEXTURE_2D)
    return shared.get((texels, np.array(flat)), lambda: _levels_on_device(texels, flat))


def _levels_on_device(texels: NDArray[np.uint8], flat: bool) -> MipLevels:
    rgba = np.full((*texels.shape[:2], 4), 255, dtype=np.uint8)
    rgba[..., : min(texels.shape[2], 4)] = texels[..., :4]
    linear = wp.TextureFilterMode.LINEAR
    if not flat:
        return MipLevels([wp.Texture2D(rgba, filter_mode=linear)])
    # The largest level keeps its bytes, which Warp reads as shares of 255; means of texels are no bytes.
    _, *smaller = mip_levels(np.divide(rgba, np.float32(255.0), dtype=np.float32))
    levels = [rgba, *(np.ascontiguousarray(level) for level in smaller)]
    return MipLevels(
        wp.Texture2D(level, filter_mode=linear, address_mode=wp.TextureAddressMode.WRAP) for level in levels
    )


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
