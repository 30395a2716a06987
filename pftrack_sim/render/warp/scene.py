"""The geoms, meshes, materials, textures and lights of a model, as arrays on the device."""

# Warp is only partly typed.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false

from __future__ import annotations

from itertools import accumulate
from typing import Any

import cv2
import mujoco
import numpy as np
import warp as wp
from numpy.typing import NDArray

from pftrack_sim.core.errors import RenderError
from pftrack_sim.core.types import BoolArray, FloatArray
from pftrack_sim.render.renderer import sky_material
from pftrack_sim.render.warp import rays

_INFINITE_PLANE_M = 1e4
_BOX_MARGIN_M = 1e-4  # Rays are cast in single precision: slightly larger bounding boxes miss no hit

_FIELDS = {
    "repeat": ("mat_texrepeat", wp.vec2),
    "uniform": ("mat_texuniform", int),
    "specular": ("mat_specular", float),
    "shininess": ("mat_shininess", float),
    "face_start": ("mesh_faceadr", int),
    "face_texcoord": ("mesh_facetexcoord", wp.vec3i),
    "texcoord": ("mesh_texcoord", wp.vec2),
    "texcoord_start": ("mesh_texcoordadr", int),
    "face_normal": ("mesh_facenormal", wp.vec3i),
    "normal_start": ("mesh_normaladr", int),
    "normal": ("mesh_normal", wp.vec3),
    "light_type": ("light_type", int),
    "light_shadow": ("light_castshadow", int),
    "light_attenuation": ("light_attenuation", wp.vec3),
    "light_exponent": ("light_exponent", float),
}
"""Arrays of `rays.Appearance` that are fields of the model, and their types."""


class SceneArrays:
    """A model on the device; `visible` are the `(ngeom,)` geoms that are drawn at all.

    Raises:
        RenderError: A visible geom of a type that the ray caster cannot draw.
    """

    def __init__(self, model: mujoco.MjModel, visible: BoolArray) -> None:
        self._model, self.visible = model, visible
        undrawable = np.flatnonzero(visible & ~np.isin(model.geom_type, rays.GEOM_TYPES))
        if undrawable.size:
            name = mujoco.mjtGeom(int(model.geom_type[undrawable[0]])).name
            raise RenderError(f"the renderer warp cannot draw geoms of type {name}; use an OpenGL one")
        self.shadow_casters: BoolArray = visible & model.geom_castshadow.astype(bool)
        boxes = model.geom_aabb.astype(np.float64).reshape(-1, 2, 3)
        self._middle, self._half = boxes[:, 0], boxes[:, 1].copy()
        planes = model.geom_type == int(mujoco.mjtGeom.mjGEOM_PLANE)
        sizes = model.geom_size[planes]
        self._half[planes] = np.where(sizes > 0.0, sizes, _INFINITE_PLANE_M) * (1.0, 1.0, 0.0)
        self._middle[planes] = 0.0
        self._meshes = [mesh_on_device(model, mesh) for mesh in range(model.nmesh)]
        self._levels = [texture_on_device(model, index) for index in range(model.ntex)]
        self.textures = wp.array([level for own in self._levels for level in own], dtype=wp.Texture2D)
        self.geoms = self._make_geoms()
        self.appearance = self._make_appearance([len(own) for own in self._levels])
        self.update_lights()

    def update_poses(self, data: mujoco.MjData) -> None:
        """Copy the poses of geoms and lights."""
        rotations = data.geom_xmat.reshape(-1, 3, 3)
        self.geoms.position = _row(data.geom_xpos, wp.vec3)
        self.geoms.rotation = _row(rotations, wp.mat33)
        centres = data.geom_xpos + np.einsum("nij,nj->ni", rotations, self._middle)
        reach = np.einsum("nij,nj->ni", np.abs(rotations), self._half) + _BOX_MARGIN_M
        self._lower = (centres - reach).astype(np.float32)
        self._upper = (centres + reach).astype(np.float32)
        self.appearance.light_position = _array(data.light_xpos, wp.vec3)
        self.appearance.light_direction = _array(data.light_xdir, wp.vec3)

    def update_lights(self) -> None:
        """Copy what a schedule of lights may have changed: lights, emission, ambient light."""
        model, appearance = self._model, self.appearance
        active = model.light_active.astype(np.float32)[:, None]
        appearance.light_diffuse = _array(model.light_diffuse * active, wp.vec3)
        appearance.light_specular = _array(model.light_specular * active, wp.vec3)
        appearance.emission = _array(model.mat_emission, float)
        sky = sky_material(model)
        appearance.sky_brightness = float(model.mat_emission[sky]) if sky >= 0 else 1.0
        headlight = model.vis.headlight
        ambient = np.array(headlight.ambient) * bool(headlight.active) + (model.light_ambient * active).sum(axis=0)
        appearance.ambient = wp.vec3(*ambient.tolist())

    def bvh(self, geoms: BoolArray) -> tuple[Any, Any]:
        """Build a bounding volume hierarchy of some geoms, a `(ngeom,)` mask, at their current poses.

        Returns:
            The argument of kernels, and its owner, which must be kept until they have run.
        """
        bvh = rays.GeomBvh()
        chosen = np.flatnonzero(geoms)
        bvh.count = int(chosen.size)
        bvh.geoms = wp.array(chosen.astype(np.int32), dtype=int)
        if not chosen.size:
            return bvh, None
        lower, upper = (wp.array(ends[chosen], dtype=wp.vec3) for ends in (self._lower, self._upper))
        owner = wp.Bvh(lower, upper)
        bvh.id = owner.id
        return bvh, owner

    def _make_geoms(self) -> Any:
        model, geoms = self._model, rays.Geoms()
        geoms.geom_type = _array(model.geom_type, int)
        geoms.data, geoms.material = _row(model.geom_dataid, int), _row(model.geom_matid, int)
        geoms.size, geoms.rgba = _row(model.geom_size, wp.vec3), _row(model.geom_rgba, wp.vec4)
        geoms.mesh = wp.array(np.array([mesh.id for mesh in self._meshes], dtype=np.uint64), dtype=wp.uint64)
        for name, dtype in (("int", int), ("float", float), ("edge", wp.vec2i), ("ids", wp.uint64), ("rgba", wp.vec4)):
            setattr(geoms, f"none_{name}", wp.zeros(1, dtype=dtype))
        geoms.none_points = wp.zeros((1, 1), dtype=wp.vec3)
        geoms.none_roots = wp.zeros((1, 1), dtype=int)
        return geoms

    def _make_appearance(self, levels: list[int]) -> Any:
        """What is drawn of materials, meshes and lights; `levels` are the numbers of mip levels of the textures."""
        model, arrays = self._model, rays.Appearance()
        for name, (field, dtype) in _FIELDS.items():
            setattr(arrays, name, _array(getattr(model, field), dtype))
        arrays.rgba = _row(model.mat_rgba, wp.vec4)
        arrays.light_cutoff, arrays.lights = _array(np.deg2rad(model.light_cutoff), float), int(model.nlight)
        gradients = texture_gradients(model)
        arrays.face_along_u, arrays.face_along_v = (_array(gradients[:, axis], wp.vec3) for axis in (0, 1))
        # The last entries stand for materials without a texture, whose index is -1.
        counts, first = np.array([*levels, 1]), np.array([*accumulate(levels, initial=0)])
        first[-1] = -1
        texture = model.mat_texid[:, int(mujoco.mjtTextureRole.mjTEXROLE_RGB)]
        arrays.texture, arrays.texture_levels = _array(first[texture], int), _array(counts[texture], int)
        sizes = np.column_stack([model.tex_width, model.tex_height])
        arrays.texture_size = _array(np.append(sizes, [[1, 1]], axis=0)[texture], wp.vec2)
        skies = np.flatnonzero(model.tex_type == mujoco.mjtTexture.mjTEXTURE_SKYBOX)
        arrays.sky = int(first[skies[0]]) if skies.size else -1
        arrays.sky_width = int(model.tex_width[skies[0]]) if skies.size else 1
        return arrays


def _array(values: NDArray[Any], dtype: Any) -> Any:
    """`(n,)` array on the device, with one zero if it would be empty."""
    return wp.array(_nonempty(values, dtype), dtype=dtype)


def _row(values: NDArray[Any], dtype: Any) -> Any:
    """The same with shape `(1, n)`."""
    return wp.array(_nonempty(values, dtype)[None], dtype=dtype, ndim=2)


def _nonempty(values: NDArray[Any], dtype: Any) -> NDArray[Any]:
    values = np.asarray(values, dtype=np.int32 if dtype in (int, wp.vec3i) else np.float32)
    return values if len(values) else np.zeros((1, *values.shape[1:]), dtype=values.dtype)


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
