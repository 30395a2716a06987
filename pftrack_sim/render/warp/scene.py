"""The geoms, meshes, materials, textures and lights of n worlds, concatenated into arrays on the device."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cv2
import mujoco
import numpy as np
import warp as wp
from numpy.typing import NDArray

from pftrack_sim.core.errors import RenderError
from pftrack_sim.core.types import BoolArray
from pftrack_sim.render.backend import sky_material
from pftrack_sim.render.warp import kernels, rays

_ROLE_RGB = int(mujoco.mjtTextureRole.mjTEXROLE_RGB)
_PLANE = int(mujoco.mjtGeom.mjGEOM_PLANE)
_INFINITE_PLANE_M = 1e4
_BOX_MARGIN_M = 1e-4
"""Rays are cast in single precision: slightly larger bounding boxes miss no hit."""


class SceneArrays:
    """Models on the device; geom g of world w is entry `geom_start[w] + g`.

    Args:
        models: One model per world.
        visible: Of each model, the `(ngeom,)` geoms that are drawn at all.

    Raises:
        RenderError: A visible geom of a type that the ray caster cannot draw.
    """

    def __init__(self, models: Sequence[mujoco.MjModel], visible: Sequence[BoolArray]) -> None:
        self._models = tuple(models)
        self.geom_start = _starts([model.ngeom for model in models])
        self.world_of_geom = np.repeat(np.arange(len(models)), [model.ngeom for model in models])
        self.visible = np.concatenate(visible)
        types = _concatenated(models, "geom_type")
        undrawable = np.flatnonzero(self.visible & ~np.isin(types, rays.GEOM_TYPES))
        if undrawable.size:
            kind = mujoco.mjtGeom(int(types[undrawable[0]])).name
            raise RenderError(f"the renderer warp cannot draw geoms of type {kind}; use an OpenGL one")
        self.shadow_casters = self.visible & _concatenated(models, "geom_castshadow").astype(bool)
        boxes = _concatenated(models, "geom_aabb").astype(np.float64).reshape(-1, 2, 3)
        self._middle, self._half = boxes[:, 0], boxes[:, 1].copy()
        planes = types == _PLANE
        sizes = _concatenated(models, "geom_size")
        self._half[planes] = np.where(sizes[planes] > 0.0, sizes[planes], _INFINITE_PLANE_M) * (1.0, 1.0, 0.0)
        self._middle[planes] = 0.0
        self._meshes = [_mesh(model, mesh) for model in models for mesh in range(model.nmesh)]
        mip_maps = [_mip_map(model, index) for model in models for index in range(model.ntex)]
        self._levels = np.array([len(mip_map) for mip_map in mip_maps], dtype=np.int64)
        self._level_start = _starts(self._levels.tolist())
        self._textures = [level for mip_map in mip_maps for level in mip_map]
        self.textures = wp.array(self._textures, dtype=wp.Texture2D)
        self.geoms = self._make_geoms(types, sizes)
        self.appearance = self._make_appearance()
        self.update_lights()

    @property
    def worlds(self) -> int:
        """Number of worlds."""
        return len(self._models)

    def update_poses(self, datas: Sequence[mujoco.MjData]) -> None:
        """Copy the poses of geoms and lights."""
        positions = np.concatenate([data.geom_xpos for data in datas])
        rotations = np.concatenate([data.geom_xmat for data in datas]).reshape(-1, 3, 3)
        self.geoms.position = _row(positions, wp.vec3)
        self.geoms.rotation = _row(rotations, wp.mat33)
        centres = positions + np.einsum("nij,nj->ni", rotations, self._middle)
        reach = np.einsum("nij,nj->ni", np.abs(rotations), self._half) + _BOX_MARGIN_M
        self._lower = (centres - reach).astype(np.float32)
        self._upper = (centres + reach).astype(np.float32)
        self.appearance.light_position = _array(np.concatenate([data.light_xpos for data in datas]), wp.vec3)
        self.appearance.light_direction = _array(np.concatenate([data.light_xdir for data in datas]), wp.vec3)

    def update_lights(self) -> None:
        """Copy what a schedule of lights may have changed: lights, emission, ambient light."""
        appearance, models = self.appearance, self._models
        active = _concatenated(models, "light_active").astype(np.float32)[:, None]
        appearance.light_diffuse = _array(_concatenated(models, "light_diffuse") * active, wp.vec3)
        appearance.light_specular = _array(_concatenated(models, "light_specular") * active, wp.vec3)
        appearance.emission = _array(_concatenated(models, "mat_emission"), float)
        skies = [(model.mat_emission, sky_material(model)) for model in models]
        appearance.sky_brightness = _array(np.array([glow[sky] if sky >= 0 else 1.0 for glow, sky in skies]), float)
        ambient = [
            np.array(model.vis.headlight.ambient) * bool(model.vis.headlight.active)
            + (model.light_ambient * model.light_active[:, None]).sum(axis=0)
            for model in models
        ]
        appearance.ambient = _array(np.array(ambient), wp.vec3)

    def bvh(self, geoms: BoolArray) -> tuple[Any, wp.Bvh | None]:
        """Build a bounding volume hierarchy of some geoms at their current poses.

        Args:
            geoms: `(n,)` mask over the geoms of all worlds.

        Returns:
            The argument of kernels, and its owner, which must be kept until they have run; None without any geom.
        """
        bvh = rays.GeomBvh()
        chosen = np.flatnonzero(geoms)
        bvh.count = int(chosen.size)
        bvh.geoms = wp.array(chosen.astype(np.int32), dtype=int)
        bvh.roots = wp.zeros(self.worlds, dtype=int)
        if not chosen.size:
            return bvh, None
        owner = wp.Bvh(
            wp.array(self._lower[chosen], dtype=wp.vec3),
            wp.array(self._upper[chosen], dtype=wp.vec3),
            groups=wp.array(self.world_of_geom[chosen].astype(np.int32), dtype=int),
        )
        bvh.id = owner.id
        wp.launch(kernels.roots_of, dim=self.worlds, inputs=[owner.id], outputs=[bvh.roots])
        return bvh, owner

    def _make_geoms(self, types: NDArray[Any], sizes: NDArray[Any]) -> Any:
        models = self._models
        geoms = rays.Geoms()
        geoms.geom_type = wp.array(types.astype(np.int32), dtype=int)
        geoms.data = _row(_shifted(models, "geom_dataid", [model.nmesh for model in models]), int)
        geoms.material = _row(_shifted(models, "geom_matid", [model.nmat for model in models]), int)
        geoms.size = _row(sizes, wp.vec3)
        geoms.rgba = _row(_concatenated(models, "geom_rgba"), wp.vec4)
        geoms.mesh = wp.array(np.array([mesh.id for mesh in self._meshes], dtype=np.uint64), dtype=wp.uint64)
        geoms.none_int = wp.zeros(1, dtype=int)
        geoms.none_float = wp.zeros(1, dtype=float)
        geoms.none_edge = wp.zeros(1, dtype=wp.vec2i)
        geoms.none_points = wp.zeros((1, 1), dtype=wp.vec3)
        geoms.none_ids = wp.zeros(1, dtype=wp.uint64)
        geoms.none_rgba = wp.zeros(1, dtype=wp.vec4)
        geoms.none_roots = wp.zeros((1, 1), dtype=int)
        return geoms

    def _make_appearance(self) -> Any:
        models = self._models
        arrays = rays.Appearance()
        arrays.rgba = _row(_concatenated(models, "mat_rgba"), wp.vec4)
        textures = [model.mat_texid[:, _ROLE_RGB] for model in models]
        starts = _starts([model.ntex for model in models])
        texture = np.concatenate(
            [np.where(own >= 0, own + start, -1) for own, start in zip(textures, starts, strict=True)]
        )
        textured = texture >= 0
        first, levels = np.append(self._level_start, -1), np.append(self._levels, 1)
        arrays.texture = _array(np.where(textured, first[texture], -1), int)
        arrays.texture_levels = _array(np.where(textured, levels[texture], 1), int)
        sizes = np.column_stack([_concatenated(models, "tex_width"), _concatenated(models, "tex_height")])
        arrays.texture_size = _array(np.append(sizes, [[1, 1]], axis=0)[texture], wp.vec2)
        arrays.repeat = _array(_concatenated(models, "mat_texrepeat"), wp.vec2)
        arrays.uniform = _array(_concatenated(models, "mat_texuniform").astype(np.int32), int)
        arrays.specular = _array(_concatenated(models, "mat_specular"), float)
        arrays.shininess = _array(_concatenated(models, "mat_shininess"), float)
        arrays.face_start = _array(_shifted(models, "mesh_faceadr", [model.nmeshface for model in models]), int)
        arrays.face_texcoord = _array(_concatenated(models, "mesh_facetexcoord"), wp.vec3i)
        gradients = np.concatenate([texture_gradients(model) for model in models])
        arrays.face_along_u, arrays.face_along_v = (
            _array(gradients[:, 0], wp.vec3),
            _array(gradients[:, 1], wp.vec3),
        )
        arrays.texcoord = _array(_concatenated(models, "mesh_texcoord"), wp.vec2)
        arrays.texcoord_start = _array(
            _shifted(models, "mesh_texcoordadr", [model.nmeshtexcoord for model in models]), int
        )
        arrays.face_normal = _array(_concatenated(models, "mesh_facenormal"), wp.vec3i)
        arrays.normal_start = _array(_shifted(models, "mesh_normaladr", [model.nmeshnormal for model in models]), int)
        arrays.normal = _array(_concatenated(models, "mesh_normal"), wp.vec3)
        skies = [np.flatnonzero(model.tex_type == mujoco.mjtTexture.mjTEXTURE_SKYBOX) for model in models]
        arrays.sky = _array(
            np.array([first[start + sky[0]] if sky.size else -1 for sky, start in zip(skies, starts, strict=True)]), int
        )
        widths = [model.tex_width[sky[0]] if sky.size else 1 for sky, model in zip(skies, models, strict=True)]
        arrays.sky_width = _array(np.array(widths), int)
        lights = [model.nlight for model in models]
        arrays.light_start, arrays.light_count = _array(_starts(lights), int), _array(np.array(lights), int)
        arrays.light_type = _array(_concatenated(models, "light_type"), int)
        arrays.light_shadow = _array(_concatenated(models, "light_castshadow").astype(np.int32), int)
        arrays.light_attenuation = _array(_concatenated(models, "light_attenuation"), wp.vec3)
        arrays.light_cutoff = _array(np.deg2rad(_concatenated(models, "light_cutoff")), float)
        arrays.light_exponent = _array(_concatenated(models, "light_exponent"), float)
        return arrays


def _mesh(model: mujoco.MjModel, mesh: int) -> wp.Mesh:
    """A mesh on the device."""
    faces = slice(model.mesh_faceadr[mesh], model.mesh_faceadr[mesh] + model.mesh_facenum[mesh])
    points = slice(model.mesh_vertadr[mesh], model.mesh_vertadr[mesh] + model.mesh_vertnum[mesh])
    return wp.Mesh(
        wp.array(model.mesh_vert[points], dtype=wp.vec3), wp.array(model.mesh_face[faces].reshape(-1), dtype=int)
    )


def _mip_map(model: mujoco.MjModel, index: int) -> list[wp.Texture2D]:
    """Levels of a texture, largest first; only one for the sky, which is magnified."""
    start, width, height = model.tex_adr[index], model.tex_width[index], model.tex_height[index]
    channels = model.tex_nchannel[index]
    texels = model.tex_data[start : start + width * height * channels].reshape(height, width, channels)
    picture = np.zeros((height, width, 4), dtype=np.float32)
    picture[..., 3] = 1.0
    picture[..., : min(channels, 4)] = texels[..., :4] / np.float32(255.0)
    if model.tex_type[index] != mujoco.mjtTexture.mjTEXTURE_2D:
        return [wp.Texture2D(picture, filter_mode=wp.TextureFilterMode.LINEAR)]
    return [
        wp.Texture2D(
            np.ascontiguousarray(level),
            filter_mode=wp.TextureFilterMode.LINEAR,
            address_mode=wp.TextureAddressMode.WRAP,
        )
        for level in mip_levels(picture)
    ]


def mip_levels(picture: NDArray[np.float32]) -> list[NDArray[np.float32]]:
    """`(H, W, C)` levels of a texture, each half the size of the one before, down to one texel; texels are averaged."""
    levels: list[NDArray[np.float32]] = [picture]
    while max(levels[-1].shape[:2]) > 1:
        high, wide = levels[-1].shape[:2]
        half = max(wide // 2, 1), max(high // 2, 1)
        levels.append(np.asarray(cv2.resize(levels[-1], half, interpolation=cv2.INTER_AREA), dtype=np.float32))
    return levels


def texture_gradients(model: mujoco.MjModel) -> NDArray[np.float64]:
    """`(nmeshface, 2, 3)` gradients of u and v on each mesh face [1/m]; zeros on meshes without coordinates."""
    gradients = np.zeros((model.nmeshface, 2, 3))
    for mesh in range(model.nmesh):
        if model.mesh_texcoordadr[mesh] < 0:
            continue
        faces = slice(model.mesh_faceadr[mesh], model.mesh_faceadr[mesh] + model.mesh_facenum[mesh])
        corners = model.mesh_vert[model.mesh_vertadr[mesh] + model.mesh_face[faces]].astype(np.float64)
        spots = model.mesh_texcoord[model.mesh_texcoordadr[mesh] + model.mesh_facetexcoord[faces]].astype(np.float64)
        one, two = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        normal = np.cross(one, two)
        square = np.maximum((normal**2).sum(axis=1, keepdims=True), 1e-24)
        # Vectors in the face whose product with one edge is 1 and with the other 0.
        dual = np.stack([np.cross(two, normal), np.cross(normal, one)], axis=1) / square[:, None]
        gradients[faces] = np.einsum("feu,fex->fux", spots[:, 1:] - spots[:, :1], dual)
    return gradients


def _concatenated(models: Sequence[mujoco.MjModel], field: str) -> NDArray[Any]:
    return np.concatenate([getattr(model, field) for model in models])


def _starts(counts: Sequence[int]) -> NDArray[np.int64]:
    """Start of each block after concatenation."""
    return np.concatenate([[0], np.cumsum(counts)[:-1]]).astype(np.int64)


def _shifted(models: Sequence[mujoco.MjModel], field: str, counts: Sequence[int]) -> NDArray[Any]:
    """Indices into arrays of each model, as indices into the concatenated arrays; -1 stays."""
    return np.concatenate(
        [
            np.where(own >= 0, own + start, own)
            for own, start in zip([getattr(model, field) for model in models], _starts(counts), strict=True)
        ]
    )


def _array(values: NDArray[Any], dtype: Any) -> wp.array:
    """`(n,)` array on the device, with one zero if it would be empty."""
    return wp.array(_nonempty(values, dtype), dtype=dtype)


def _row(values: NDArray[Any], dtype: Any) -> wp.array:
    """The same with shape `(1, n)`."""
    return wp.array(_nonempty(values, dtype)[None], dtype=dtype, ndim=2)


def _nonempty(values: NDArray[Any], dtype: Any) -> NDArray[Any]:
    values = np.asarray(values, dtype=np.int32 if dtype in (int, wp.vec3i) else np.float32)
    return values if len(values) else np.zeros((1, *values.shape[1:]), dtype=values.dtype)
