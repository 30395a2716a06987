"""Models as the ray caster wants them: the geoms, meshes, materials, textures and lights of n worlds in one table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cv2
import mujoco
import numpy as np
import warp as wp
from numpy.typing import NDArray

from pftrack_sim.core.errors import RenderError
from pftrack_sim.render.gl.sky import sky_material
from pftrack_sim.render.warp import kernels, rays

_ROLE_RGB = int(mujoco.mjtTextureRole.mjTEXROLE_RGB)
_PLANE = int(mujoco.mjtGeom.mjGEOM_PLANE)
_ENDLESS_M = 1e4
_SLACK_M = 1e-4
"""Rays are cast in single precision: boxes a little too large lose nothing."""


class SceneTable:
    """What the device knows of some models. World w's geom g is entry `geom_start[w] + g`.

    Args:
        models: One model per world.
        visible: Of each, `(ngeom,)` which geoms are drawn at all.

    Raises:
        RenderError: A visible geom of a type that the ray caster cannot draw.
    """

    def __init__(self, models: Sequence[mujoco.MjModel], visible: Sequence[NDArray[np.bool_]]) -> None:
        self._models = tuple(models)
        self.geom_start = _starts([model.ngeom for model in models])
        self.world_of_geom = np.repeat(np.arange(len(models)), [model.ngeom for model in models])
        self.visible = np.concatenate(visible)
        kinds = _joined(models, "geom_type")
        undrawable = np.flatnonzero(self.visible & ~np.isin(kinds, rays.KINDS))
        if undrawable.size:
            kind = mujoco.mjtGeom(int(kinds[undrawable[0]])).name
            raise RenderError(f"the renderer warp cannot draw geoms of type {kind}; use an OpenGL one")
        self.casters = self.visible & _joined(models, "geom_castshadow").astype(bool)
        boxes = _joined(models, "geom_aabb").astype(np.float64).reshape(-1, 2, 3)
        self._middle, self._half = boxes[:, 0], boxes[:, 1].copy()
        planes = kinds == _PLANE
        sizes = _joined(models, "geom_size")
        self._half[planes] = np.where(sizes[planes] > 0.0, sizes[planes], _ENDLESS_M) * (1.0, 1.0, 0.0)
        self._middle[planes] = 0.0
        self._meshes = [mesh_of(model, mesh) for model in models for mesh in range(model.nmesh)]
        pyramids = [pyramid_of(model, index) for model in models for index in range(model.ntex)]
        self._levels = np.array([len(pyramid) for pyramid in pyramids], dtype=np.int64)
        self._level_start = _starts(self._levels.tolist())
        self._textures = [level for pyramid in pyramids for level in pyramid]
        self.textures = wp.array(self._textures, dtype=wp.Texture2D)
        self.geoms = self._make_geoms(kinds, sizes)
        self.looks = self._make_looks()
        self.relight()

    @property
    def worlds(self) -> int:
        """How many."""
        return len(self._models)

    def place(self, datas: Sequence[mujoco.MjData]) -> None:
        """Take over the positions of geoms and lights."""
        positions = np.concatenate([data.geom_xpos for data in datas])
        turns = np.concatenate([data.geom_xmat for data in datas]).reshape(-1, 3, 3)
        self.geoms.position = _table(positions, wp.vec3)
        self.geoms.turn = _table(turns, wp.mat33)
        centres = positions + np.einsum("nij,nj->ni", turns, self._middle)
        reach = np.einsum("nij,nj->ni", np.abs(turns), self._half) + _SLACK_M
        self._lower = (centres - reach).astype(np.float32)
        self._upper = (centres + reach).astype(np.float32)
        self.looks.light_position = _list(np.concatenate([data.light_xpos for data in datas]), wp.vec3)
        self.looks.light_direction = _list(np.concatenate([data.light_xdir for data in datas]), wp.vec3)

    def relight(self) -> None:
        """Take over what a schedule may have changed in the models: lights, what glows, light from everywhere."""
        looks, models = self.looks, self._models
        active = _joined(models, "light_active").astype(np.float32)[:, None]
        looks.light_diffuse = _list(_joined(models, "light_diffuse") * active, wp.vec3)
        looks.light_specular = _list(_joined(models, "light_specular") * active, wp.vec3)
        looks.emission = _list(_joined(models, "mat_emission"), float)
        skies = [(model.mat_emission, sky_material(model)) for model in models]
        looks.sky_brightness = _list(np.array([glow[sky] if sky >= 0 else 1.0 for glow, sky in skies]), float)
        ambient = [
            np.array(model.vis.headlight.ambient) * bool(model.vis.headlight.active)
            + (model.light_ambient * model.light_active[:, None]).sum(axis=0)
            for model in models
        ]
        looks.ambient = _list(np.array(ambient), wp.vec3)

    def tree(self, shown: NDArray[np.bool_]) -> tuple[Any, wp.Bvh | None]:
        """A search tree of some geoms where they are now.

        Args:
            shown: `(all geoms,)`

        Returns:
            What kernels take, and its owner, to be kept as long.
        """
        tree = rays.Tree()
        chosen = np.flatnonzero(shown)
        tree.count = int(chosen.size)
        tree.geoms = wp.array(chosen.astype(np.int32), dtype=int)
        tree.roots = wp.zeros(self.worlds, dtype=int)
        if not chosen.size:
            return tree, None
        # A world without any of these geoms still needs a group: rays of its own that meet nothing.
        groups = self.world_of_geom[chosen].astype(np.int32)
        lower, upper = self._lower[chosen], self._upper[chosen]
        owner = wp.Bvh(
            wp.array(lower, dtype=wp.vec3), wp.array(upper, dtype=wp.vec3), groups=wp.array(groups, dtype=int)
        )
        tree.id = owner.id
        wp.launch(kernels.roots_of, dim=self.worlds, inputs=[owner.id], outputs=[tree.roots])
        return tree, owner

    def _make_geoms(self, kinds: NDArray[Any], sizes: NDArray[Any]) -> Any:
        models = self._models
        geoms = rays.Geoms()
        geoms.kind = wp.array(kinds.astype(np.int32), dtype=int)
        geoms.data = _table(_shifted(models, "geom_dataid", [model.nmesh for model in models]), int)
        geoms.material = _table(_shifted(models, "geom_matid", [model.nmat for model in models]), int)
        geoms.size = _table(sizes, wp.vec3)
        geoms.rgba = _table(_joined(models, "geom_rgba"), wp.vec4)
        geoms.mesh = wp.array(np.array([mesh.id for mesh in self._meshes], dtype=np.uint64), dtype=wp.uint64)
        geoms.none_int = wp.zeros(1, dtype=int)
        geoms.none_float = wp.zeros(1, dtype=float)
        geoms.none_edge = wp.zeros(1, dtype=wp.vec2i)
        geoms.none_points = wp.zeros((1, 1), dtype=wp.vec3)
        geoms.none_ids = wp.zeros(1, dtype=wp.uint64)
        geoms.none_rgba = wp.zeros(1, dtype=wp.vec4)
        geoms.none_roots = wp.zeros((1, 1), dtype=int)
        return geoms

    def _make_looks(self) -> Any:
        models = self._models
        looks = rays.Looks()
        looks.rgba = _table(_joined(models, "mat_rgba"), wp.vec4)
        textures = [model.mat_texid[:, _ROLE_RGB] for model in models]
        starts = _starts([model.ntex for model in models])
        texture = np.concatenate(
            [np.where(own >= 0, own + start, -1) for own, start in zip(textures, starts, strict=True)]
        )
        textured = texture >= 0
        first, levels = np.append(self._level_start, -1), np.append(self._levels, 1)
        looks.texture = _list(np.where(textured, first[texture], -1), int)
        looks.texture_levels = _list(np.where(textured, levels[texture], 1), int)
        sizes = np.column_stack([_joined(models, "tex_width"), _joined(models, "tex_height")])
        looks.texture_size = _list(np.append(sizes, [[1, 1]], axis=0)[texture], wp.vec2)
        looks.repeat = _list(_joined(models, "mat_texrepeat"), wp.vec2)
        looks.uniform = _list(_joined(models, "mat_texuniform").astype(np.int32), int)
        looks.specular = _list(_joined(models, "mat_specular"), float)
        looks.shininess = _list(_joined(models, "mat_shininess"), float)
        looks.face_start = _list(_shifted(models, "mesh_faceadr", [model.nmeshface for model in models]), int)
        looks.face_texcoord = _list(_joined(models, "mesh_facetexcoord"), wp.vec3i)
        slopes = np.concatenate([texture_slopes(model) for model in models])
        looks.face_along_u, looks.face_along_v = _list(slopes[:, 0], wp.vec3), _list(slopes[:, 1], wp.vec3)
        looks.texcoord = _list(_joined(models, "mesh_texcoord"), wp.vec2)
        looks.texcoord_start = _list(
            _shifted(models, "mesh_texcoordadr", [model.nmeshtexcoord for model in models]), int
        )
        looks.face_normal = _list(_joined(models, "mesh_facenormal"), wp.vec3i)
        looks.normal_start = _list(_shifted(models, "mesh_normaladr", [model.nmeshnormal for model in models]), int)
        looks.normal = _list(_joined(models, "mesh_normal"), wp.vec3)
        skies = [np.flatnonzero(model.tex_type == mujoco.mjtTexture.mjTEXTURE_SKYBOX) for model in models]
        looks.sky = _list(
            np.array([first[start + sky[0]] if sky.size else -1 for sky, start in zip(skies, starts, strict=True)]), int
        )
        widths = [model.tex_width[sky[0]] if sky.size else 1 for sky, model in zip(skies, models, strict=True)]
        looks.sky_width = _list(np.array(widths), int)
        lights = [model.nlight for model in models]
        looks.light_start, looks.light_count = _list(_starts(lights), int), _list(np.array(lights), int)
        looks.light_kind = _list(_joined(models, "light_type"), int)
        looks.light_shadow = _list(_joined(models, "light_castshadow").astype(np.int32), int)
        looks.light_attenuation = _list(_joined(models, "light_attenuation"), wp.vec3)
        looks.light_cutoff = _list(np.deg2rad(_joined(models, "light_cutoff")), float)
        looks.light_exponent = _list(_joined(models, "light_exponent"), float)
        return looks


def mesh_of(model: mujoco.MjModel, mesh: int) -> wp.Mesh:
    """A mesh that rays can be cast at."""
    faces = slice(model.mesh_faceadr[mesh], model.mesh_faceadr[mesh] + model.mesh_facenum[mesh])
    points = slice(model.mesh_vertadr[mesh], model.mesh_vertadr[mesh] + model.mesh_vertnum[mesh])
    return wp.Mesh(
        wp.array(model.mesh_vert[points], dtype=wp.vec3), wp.array(model.mesh_face[faces].reshape(-1), dtype=int)
    )


def pyramid_of(model: mujoco.MjModel, index: int) -> list[wp.Texture2D]:
    """A texture and its halves; the sky is magnified, never shrunk, and needs none."""
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
        for level in halves(picture)
    ]


def halves(picture: NDArray[np.float32]) -> list[NDArray[np.float32]]:
    """A picture `(H, W, C)` and its halves down to one texel, each texel the mean of those it covers."""
    levels: list[NDArray[np.float32]] = [picture]
    while max(levels[-1].shape[:2]) > 1:
        high, wide = levels[-1].shape[:2]
        half = max(wide // 2, 1), max(high // 2, 1)
        levels.append(np.asarray(cv2.resize(levels[-1], half, interpolation=cv2.INTER_AREA), dtype=np.float32))
    return levels


def texture_slopes(model: mujoco.MjModel) -> NDArray[np.float64]:
    """`(nmeshface, 2, 3)` how fast u and v grow along each face of the meshes [1/m]; zeros where there are none."""
    slopes = np.zeros((model.nmeshface, 2, 3))
    for mesh in range(model.nmesh):
        if model.mesh_texcoordadr[mesh] < 0:
            continue
        faces = slice(model.mesh_faceadr[mesh], model.mesh_faceadr[mesh] + model.mesh_facenum[mesh])
        corners = model.mesh_vert[model.mesh_vertadr[mesh] + model.mesh_face[faces]].astype(np.float64)
        spots = model.mesh_texcoord[model.mesh_texcoordadr[mesh] + model.mesh_facetexcoord[faces]].astype(np.float64)
        one, two = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        normal = np.cross(one, two)
        square = np.maximum((normal**2).sum(axis=1, keepdims=True), 1e-24)
        # The vectors of the face that meet one edge with 1 and the other with 0.
        dual = np.stack([np.cross(two, normal), np.cross(normal, one)], axis=1) / square[:, None]
        slopes[faces] = np.einsum("feu,fex->fux", spots[:, 1:] - spots[:, :1], dual)
    return slopes


def _joined(models: Sequence[mujoco.MjModel], field: str) -> NDArray[Any]:
    return np.concatenate([getattr(model, field) for model in models])


def _starts(counts: Sequence[int]) -> NDArray[np.int64]:
    """Where each begins when they are put one after the other."""
    return np.concatenate([[0], np.cumsum(counts)[:-1]]).astype(np.int64)


def _shifted(models: Sequence[mujoco.MjModel], field: str, counts: Sequence[int]) -> NDArray[Any]:
    """Indices into tables of each model, made indices into the joined tables; -1 stays."""
    return np.concatenate(
        [
            np.where(own >= 0, own + start, own)
            for own, start in zip([getattr(model, field) for model in models], _starts(counts), strict=True)
        ]
    )


def _list(values: NDArray[Any], kind: Any) -> wp.array:
    """An array on the device; never empty."""
    values = np.asarray(values, dtype=np.int32 if kind in (int, wp.vec3i) else np.float32)
    if not len(values):
        values = np.zeros((1, *values.shape[1:]), dtype=values.dtype)
    return wp.array(values, dtype=kind)


def _table(values: NDArray[Any], kind: Any) -> wp.array:
    """The same with a first axis of one."""
    values = np.asarray(values, dtype=np.int32 if kind is int else np.float32)
    if not len(values):
        values = np.zeros((1, *values.shape[1:]), dtype=values.dtype)
    return wp.array(values[None], dtype=kind, ndim=2)
