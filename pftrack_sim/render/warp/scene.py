"""The geoms, meshes, materials, textures and lights of n worlds, concatenated into arrays on the device."""

# Warp is only partly typed.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate
from typing import Any, NamedTuple

import mujoco
import numpy as np
import warp as wp
from numpy.typing import NDArray

from pftrack_sim.core.errors import RenderError
from pftrack_sim.core.types import BoolArray, FloatArray
from pftrack_sim.render.backend import sky_material
from pftrack_sim.render.warp import kernels, rays
from pftrack_sim.render.warp.assets import Assets

_INFINITE_PLANE_M = 1e4
_BOX_MARGIN_M = 1e-4  # Rays are cast in single precision: slightly larger bounding boxes miss no hit

_APPEARANCE_FIELDS = {
    "repeat": ("mat_texrepeat", wp.vec2),
    "uniform": ("mat_texuniform", int),
    "specular": ("mat_specular", float),
    "shininess": ("mat_shininess", float),
    "face_texcoord": ("mesh_facetexcoord", wp.vec3i),
    "texcoord": ("mesh_texcoord", wp.vec2),
    "face_normal": ("mesh_facenormal", wp.vec3i),
    "normal": ("mesh_normal", wp.vec3),
    "light_type": ("light_type", int),
    "light_shadow": ("light_castshadow", int),
    "light_attenuation": ("light_attenuation", wp.vec3),
    "light_exponent": ("light_exponent", float),
}
"""Arrays of `rays.Appearance` that are concatenated fields of the models, and their types."""

_INDEX_FIELDS = {
    "face_start": ("mesh_faceadr", "nmeshface"),
    "texcoord_start": ("mesh_texcoordadr", "nmeshtexcoord"),
    "normal_start": ("mesh_normaladr", "nmeshnormal"),
}
"""Arrays of `rays.Appearance` that are indices, the model's fields, and the sizes of the arrays they point into."""


class Poses(NamedTuple):
    """The arrays of an `MjData` that are drawn."""

    geom_xpos: FloatArray
    geom_xmat: FloatArray
    light_xpos: FloatArray
    light_xdir: FloatArray


class SceneArrays:
    """Models on the device; geom g of world w is entry `geom_start[w] + g`.

    Args:
        models: One model per world.
        visible: Of each model, the `(ngeom,)` geoms that are drawn at all.
        assets: Of each model, its meshes and textures; None makes them.

    Raises:
        RenderError: A visible geom of a type that the ray caster cannot draw.
    """

    def __init__(
        self,
        models: Sequence[mujoco.MjModel],
        visible: Sequence[BoolArray],
        assets: Sequence[Assets] | None = None,
    ) -> None:
        self._models = tuple(models)
        self.worlds = len(models)
        self.geom_start = self._starts("ngeom")
        self.world_of_geom = np.repeat(np.arange(self.worlds), [model.ngeom for model in models])
        self.visible = np.concatenate(visible)
        types = self._field("geom_type")
        undrawable = np.flatnonzero(self.visible & ~np.isin(types, rays.GEOM_TYPES))
        if undrawable.size:
            name = mujoco.mjtGeom(int(types[undrawable[0]])).name
            raise RenderError(f"the renderer warp cannot draw geoms of type {name}; use an OpenGL one")
        self.shadow_casters = self.visible & self._field("geom_castshadow").astype(bool)
        boxes = self._field("geom_aabb").astype(np.float64).reshape(-1, 2, 3)
        self._middle, self._half = boxes[:, 0], boxes[:, 1].copy()
        planes = types == int(mujoco.mjtGeom.mjGEOM_PLANE)
        sizes = self._field("geom_size")[planes]
        self._half[planes] = np.where(sizes > 0.0, sizes, _INFINITE_PLANE_M) * (1.0, 1.0, 0.0)
        self._middle[planes] = 0.0
        self._assets = [Assets(model) for model in models] if assets is None else tuple(assets)
        self._meshes = [mesh for own in self._assets for mesh in own.meshes]
        self._textures = [levels for own in self._assets for levels in own.textures]
        self.textures = wp.array([level for levels in self._textures for level in levels], dtype=wp.Texture2D)
        self.geoms = self._make_geoms()
        self.appearance = self._make_appearance()
        self.update_lights()

    def update_poses(self, datas: Sequence[mujoco.MjData | Poses]) -> None:
        """Copy the poses of geoms and lights of each world."""
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
        appearance = self.appearance
        active = self._field("light_active").astype(np.float32)[:, None]
        appearance.light_diffuse = _array(self._field("light_diffuse") * active, wp.vec3)
        appearance.light_specular = _array(self._field("light_specular") * active, wp.vec3)
        appearance.emission = _array(self._field("mat_emission"), float)
        skies = [(model.mat_emission, sky_material(model)) for model in self._models]
        brightness = np.array([emission[sky] if sky >= 0 else 1.0 for emission, sky in skies])
        appearance.sky_brightness = _array(brightness, float)
        ambient = [
            np.array(model.vis.headlight.ambient) * bool(model.vis.headlight.active)
            + (model.light_ambient * model.light_active[:, None]).sum(axis=0)
            for model in self._models
        ]
        appearance.ambient = _array(np.array(ambient), wp.vec3)

    def bvh(self, geoms: BoolArray) -> tuple[Any, Any]:
        """Build a bounding volume hierarchy of some geoms, a `(n,)` mask over all worlds, at their current poses.

        Returns:
            The argument of kernels, and its owner, which must be kept until they have run.
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

    def _make_geoms(self) -> Any:
        geoms = rays.Geoms()
        geoms.geom_type = _array(self._field("geom_type"), int)
        geoms.data = _row(self._indices([model.geom_dataid for model in self._models], "nmesh"), int)
        geoms.material = _row(self._indices([model.geom_matid for model in self._models], "nmat"), int)
        geoms.size = _row(self._field("geom_size"), wp.vec3)
        geoms.rgba = _row(self._field("geom_rgba"), wp.vec4)
        geoms.mesh = wp.array(np.array([mesh.id for mesh in self._meshes], dtype=np.uint64), dtype=wp.uint64)
        for name, dtype in (("int", int), ("float", float), ("edge", wp.vec2i), ("ids", wp.uint64), ("rgba", wp.vec4)):
            setattr(geoms, f"none_{name}", wp.zeros(1, dtype=dtype))
        geoms.none_points = wp.zeros((1, 1), dtype=wp.vec3)
        geoms.none_roots = wp.zeros((1, 1), dtype=int)
        return geoms

    def _make_appearance(self) -> Any:
        models, arrays = self._models, rays.Appearance()
        for name, (field, dtype) in _APPEARANCE_FIELDS.items():
            setattr(arrays, name, _array(self._field(field), dtype))
        for name, (field, count) in _INDEX_FIELDS.items():
            setattr(arrays, name, _array(self._indices([getattr(model, field) for model in models], count), int))
        arrays.rgba = _row(self._field("mat_rgba"), wp.vec4)
        arrays.light_cutoff = _array(np.deg2rad(self._field("light_cutoff")), float)
        arrays.light_start = _array(self._starts("nlight"), int)
        arrays.light_count = _array(np.array([model.nlight for model in models]), int)
        gradients = np.concatenate([own.gradients for own in self._assets])
        arrays.face_along_u, arrays.face_along_v = (_array(gradients[:, axis], wp.vec3) for axis in (0, 1))
        # The last entry stands for materials without a texture, whose index is -1.
        levels = np.array([*map(len, self._textures), 1])
        first = np.array([*accumulate(levels[:-1], initial=0)])
        first[-1] = -1
        role = int(mujoco.mjtTextureRole.mjTEXROLE_RGB)
        texture = self._indices([model.mat_texid[:, role] for model in models], "ntex")
        arrays.texture, arrays.texture_levels = _array(first[texture], int), _array(levels[texture], int)
        sizes = np.column_stack([self._field("tex_width"), self._field("tex_height")])
        arrays.texture_size = _array(np.append(sizes, [[1, 1]], axis=0)[texture], wp.vec2)
        skies = [np.flatnonzero(model.tex_type == mujoco.mjtTexture.mjTEXTURE_SKYBOX)[:1] for model in models]
        sky = self._indices([own if own.size else np.array([-1]) for own in skies], "ntex")
        arrays.sky = _array(first[sky], int)
        arrays.sky_width = _array(np.append(self._field("tex_width"), 1)[sky], int)
        return arrays

    def _field(self, name: str) -> NDArray[Any]:
        """A field of all models, concatenated."""
        return np.concatenate([getattr(model, name) for model in self._models])

    def _starts(self, count: str) -> NDArray[np.int64]:
        """`(worlds,)` where the entries of each world begin in a concatenated array; `count` is a size of the model."""
        return np.array([0, *accumulate(getattr(model, count) for model in self._models)][:-1], dtype=np.int64)

    def _indices(self, indices: Sequence[NDArray[Any]], count: str) -> NDArray[Any]:
        """Indices of each model as indices into a concatenated array; -1 stays."""
        shifted = [np.where(own >= 0, own + start, -1) for own, start in zip(indices, self._starts(count), strict=True)]
        return np.concatenate(shifted)


def _array(values: NDArray[Any], dtype: Any) -> Any:
    """`(n,)` array on the device, with one zero if it would be empty."""
    return wp.array(_nonempty(values, dtype), dtype=dtype)


def _row(values: NDArray[Any], dtype: Any) -> Any:
    """The same with shape `(1, n)`."""
    return wp.array(_nonempty(values, dtype)[None], dtype=dtype, ndim=2)


def _nonempty(values: NDArray[Any], dtype: Any) -> NDArray[Any]:
    values = np.asarray(values, dtype=np.int32 if dtype in (int, wp.vec3i) else np.float32)
    return values if len(values) else np.zeros((1, *values.shape[1:]), dtype=values.dtype)
