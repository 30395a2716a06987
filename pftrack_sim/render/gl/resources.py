"""Textures, meshes and framebuffers in OpenGL's memory, of which the next model takes over what is equal to its own."""

from __future__ import annotations

import ctypes
from typing import Any, TypeAlias

import mujoco
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.render.gl.context import gl_function

_GL_RGBA = 0x1908
_GL_TEXTURE_2D = 0x0DE1
_SOFT_SHADOWS = {
    0x2800: 0x2601,  # GL_TEXTURE_MAG_FILTER: GL_LINEAR
    0x2801: 0x2601,  # GL_TEXTURE_MIN_FILTER: GL_LINEAR
    0x884B: 0x1909,  # GL_DEPTH_TEXTURE_MODE: GL_LUMINANCE, where MuJoCo has GL_INTENSITY, which is opacity, too
}
"""Blends the four nearest pixels of the shadow map, and lets a share of shadow take that share of the light.

MuJoCo takes the nearest pixel, and draws nothing of the light where the shadow is more than 1 %.
"""
_NEAREST_LEVEL = {0x2801: 0x2701}
"""GL_TEXTURE_MIN_FILTER: GL_LINEAR_MIPMAP_NEAREST. MuJoCo blends two levels: a quarter of the time of each pixel."""
_PLANE, _SKYBOX = int(mujoco.mjtGeom.mjGEOM_PLANE), int(mujoco.mjtTexture.mjTEXTURE_SKYBOX)
_IMAGE = int(mujoco.mjtTexture.mjTEXTURE_2D)
_GRAPHICS = ("global_", "quality", "map", "rgba")
"""The parts of MuJoCo's `mjVisual` that resources are made by: all but the headlight and the sizes of decoration."""

Settings: TypeAlias = tuple[object, ...]


class Resources:
    """The resources of one model after the other; the OpenGL context must be current in all methods.

    `size` is the width and height of the framebuffer [px], `context` holds MuJoCo's handles of all.
    """

    def __init__(self, model: mujoco.MjModel, size: tuple[int, int]) -> None:
        self.context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_50)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self.context)
        # It remains the current buffer: drawing, reading and resizing restore it.
        if (self.context.offWidth, self.context.offHeight) != size:
            mujoco.mjr_resizeOffscreen(*size, self.context)
        self.context.readDepthMap = mujoco.mjtDepthMap.mjDEPTH_ZEROFAR  # the buffer's own values, not converted
        self.context.readPixelFormat = _GL_RGBA  # the buffer's own format: ten times quicker to read than RGB
        if self.context.shadowTex:
            _set_texture(int(self.context.shadowTex), _SOFT_SHADOWS)
        for texture in np.flatnonzero(model.tex_type == _IMAGE).tolist():
            _set_texture(int(self.context.texture[texture]), _NEAREST_LEVEL)
        self._settings = _settings(model)
        self._textures: list[object] = _texture_digests(model)
        self._meshes = _mesh_digests(model)

    def replace(self, model: mujoco.MjModel) -> bool:
        """Upload what differs in another model; False if it needs resources of its own, and nothing is done."""
        context = self.context
        kinds = np.asarray(context.textureType)[: context.ntexture]
        if (
            _settings(model) != self._settings
            or 2 * model.nmesh > context.rangeMesh
            or model.ntex > context.ntexture
            or (kinds[: model.ntex] != model.tex_type).any()
            # MuJoCo draws the first skybox that there is.
            or (kinds[model.ntex :] == _SKYBOX).any()
        ):
            return False
        for texture, digest in enumerate(_texture_digests(model)):
            if digest != self._textures[texture]:
                mujoco.mjr_uploadTexture(model, context, texture)
                if model.tex_type[texture] == _IMAGE:
                    _set_texture(int(context.texture[texture]), _NEAREST_LEVEL)
                self._textures[texture] = digest
        meshes = _mesh_digests(model)
        for mesh, digest in enumerate(meshes):
            if mesh >= len(self._meshes) or digest != self._meshes[mesh]:
                mujoco.mjr_uploadMesh(model, context, mesh)
        self._meshes = meshes
        for ours, theirs in (
            (context.mat_texid, model.mat_texid),
            (context.mat_texuniform, model.mat_texuniform),
            (context.mat_texrepeat, model.mat_texrepeat),
        ):
            ours.reshape(-1)[: theirs.size] = theirs.reshape(-1)
        return True

    def upload_texture(self, model: mujoco.MjModel, texture: int) -> None:
        """Upload a texture as the model has it now, for a while: the next model does not take it over."""
        mujoco.mjr_uploadTexture(model, self.context, texture)
        self._textures[texture] = object()

    def free(self) -> None:
        """Free OpenGL's memory."""
        self.context.free()


def _set_texture(texture: int, parameters: dict[int, int]) -> None:
    """Set parameters of a two-dimensional texture in OpenGL."""
    bind = gl_function("glBindTexture", None, ctypes.c_uint, ctypes.c_uint)
    set_parameter = gl_function("glTexParameteri", None, ctypes.c_uint, ctypes.c_uint, ctypes.c_int)
    bind(_GL_TEXTURE_2D, texture)
    for name, value in parameters.items():
        set_parameter(_GL_TEXTURE_2D, name, value)
    bind(_GL_TEXTURE_2D, 0)


def _settings(model: mujoco.MjModel) -> Settings:
    """What resources are made by, besides textures, meshes and materials."""
    planes = model.geom_type == _PLANE
    groups = [getattr(model.vis, name) for name in _GRAPHICS]
    return (
        *(_plain(getattr(group, name)) for group in groups for name in dir(group) if not name.startswith("_")),
        float(model.stat.extent),
        model.geom_size[planes].tobytes(),
        model.geom_matid[planes].tobytes(),
        # Height fields and skins are not compared.
        *([object()] if model.nhfield or model.nskin else []),
    )


def _plain(value: Any) -> object:
    return value.tobytes() if isinstance(value, np.ndarray) else value


def _texture_digests(model: mujoco.MjModel) -> list[object]:
    digests: list[object] = []
    for texture in range(model.ntex):
        form = [int(getattr(model, f"tex_{name}")[texture]) for name in ("type", "width", "height", "nchannel")]
        texels = _digest(model.tex_data, int(model.tex_adr[texture]), form[1] * form[2] * form[3])
        digests.append((*form, int(model.tex_colorspace[texture]), texels))
    return digests


def _mesh_digests(model: mujoco.MjModel) -> list[object]:
    vertices, normals = (model.mesh_vertadr, model.mesh_vertnum), (model.mesh_normaladr, model.mesh_normalnum)
    coordinates, faces = (model.mesh_texcoordadr, model.mesh_texcoordnum), (model.mesh_faceadr, model.mesh_facenum)
    arrays = [
        (model.mesh_vert, *vertices),
        (model.mesh_normal, *normals),
        (model.mesh_texcoord, *coordinates),
        (model.mesh_face, *faces),
        (model.mesh_facenormal, *faces),
        (model.mesh_facetexcoord, *faces),
    ]
    return [
        # The convex hull that belongs to a mesh with a graph is drawn too; it is not compared.
        object()
        if graph >= 0
        else [_digest(array, int(starts[mesh]), int(counts[mesh])) for array, starts, counts in arrays]
        for mesh, graph in enumerate(model.mesh_graphadr)
    ]


def _digest(array: NDArray[Any], start: int, count: int) -> tuple[int, int]:
    """Number and hash of some rows; a negative start stands for none. Half as long as SHA-256 takes."""
    return count, hash(array[start : start + count].tobytes()) if start >= 0 else 0
