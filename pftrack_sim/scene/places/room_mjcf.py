"""Scenes of MuJoCo: the geoms of their model at rest, and their lights."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np

from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.types import FloatArray, IntArray
from pftrack_sim.scenario.model import MjcfPlace
from pftrack_sim.scene.compiled_model import colours, mesh_corners, quaternion, texture_image
from pftrack_sim.scene.places.builder import Item
from pftrack_sim.scene.places.meshes import TexturedMesh
from pftrack_sim.scene.places.navigation import area_of, floor_height_m, grid_of
from pftrack_sim.scene.places.room import MOST_TRIANGLES, Room, Solid, Surface, distinct_names

_GEOM = mujoco.mjtGeom
_LEAST_OPACITY = 0.5  # What is more transparent is left out, the rest is opaque: the truth knows nothing between
_AROUND_M = 4.0  # Of a plane without limits, this much around everything else is a floor
_MOST_LIGHTS = 6


def read_mjcf(place: MjcfPlace) -> Room:
    """The room of an MJCF scene. What people and robot walk around is whatever is drawn or collides.

    Raises:
        ParameterError: MuJoCo cannot load it, it has no floor, or there is no room for a person.
    """
    try:
        model = mujoco.MjModel.from_xml_path(place.model)
    except (ValueError, mujoco.FatalError) as error:
        raise ParameterError(f"MuJoCo cannot load it: {error}") from None
    if model.nhfield or model.nskin or model.nflex:
        raise ParameterError("height fields, skins and flexes are not drawn here: take them out")
    if model.nmeshface > MOST_TRIANGLES:
        raise ParameterError(f"its meshes have {model.nmeshface} triangles, at most {MOST_TRIANGLES}")
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_camlight(model, data)
    rgba = colours(model)
    solid = (model.geom_contype | model.geom_conaffinity) != 0
    drawn = np.isin(model.geom_group, place.groups) & (rgba[:, 3] >= _LEAST_OPACITY)
    triangles = _triangles(model, data, np.flatnonzero(drawn | solid))
    floor_m = floor_height_m(triangles) if place.floor_m is None else place.floor_m
    area = area_of(grid_of(triangles, floor_m))
    surfaces = {f"room/{geom}": _surface(model, geom, rgba[geom]) for geom in np.flatnonzero(drawn).tolist()}
    solids, owners, down = list[Solid](), _owners(model), np.array([0.0, 0.0, floor_m])
    meshes: dict[str, list[TexturedMesh]] = {}
    for geom in np.flatnonzero(drawn).tolist():
        name, position = f"room/{geom}", data.geom_xpos[geom] - down
        if model.geom_type[geom] == _GEOM.mjGEOM_MESH:
            meshes.setdefault(owners[geom], []).append(
                _mesh(model, int(model.geom_dataid[geom]), name, data.geom_xmat[geom].reshape(3, 3), position)
            )
            continue
        form = {"type": _GEOM(int(model.geom_type[geom])), "size": model.geom_size[geom].tolist(), "material": name}
        solids.append(Solid(owners[geom], {**form, "pos": position, "quat": quaternion(data.geom_xmat[geom])}))
    items = tuple(Item(owner, tuple(parts)) for owner, parts in meshes.items())
    return Room(area, items, tuple(solids), surfaces, _lights(model, data, floor_m))


def _owners(model: Any) -> list[str]:
    """Body name for each geom: that of its body, or for what belongs to the world its own."""
    bodies = distinct_names(model.body(index).name or f"body-{index}" for index in range(model.nbody))
    own = distinct_names(model.geom(index).name or f"geom-{index}" for index in range(model.ngeom))
    taken = set(bodies)
    return [
        bodies[body] if body else own[geom] if own[geom] not in taken else f"{own[geom]}-geom"
        for geom, body in enumerate(model.geom_bodyid.tolist())
    ]


def _surface(model: Any, geom: int, rgba: FloatArray) -> Surface:
    red, green, blue, _ = rgba.tolist()
    material = int(model.geom_matid[geom])
    texture = -1 if material < 0 else int(model.mat_texid[material, int(mujoco.mjtTextureRole.mjTEXROLE_RGB)])
    emission = 0.0 if material < 0 else float(model.mat_emission[material])
    if texture < 0 or model.tex_type[texture] == mujoco.mjtTexture.mjTEXTURE_SKYBOX:
        return Surface((red, green, blue, 1.0), emission=emission)
    across, down = model.mat_texrepeat[material].tolist()
    image, uniform = texture_image(model, texture), bool(model.mat_texuniform[material])
    return Surface((red, green, blue, 1.0), image, (across, down), uniform, emission)


def _mesh(model: Any, mesh: int, surface: str, rotation: FloatArray, position: FloatArray) -> TexturedMesh:
    """A mesh in the world frame, with one vertex for each different place, normal and texture coordinate."""
    places, normals, uv, faces = mesh_corners(model, mesh)
    vertices = places @ rotation.T + position
    return TexturedMesh(surface, vertices, normals @ rotation.T, uv * (1.0, -1.0), faces.astype(np.int32))


def _triangles(model: Any, data: Any, geoms: IntArray) -> FloatArray:
    """`(N, 3, 3)` triangles of geoms: of meshes their own, of others those of the box around them."""
    found: list[FloatArray] = []
    boxes = np.asarray(model.geom_aabb, dtype=np.float64).reshape(-1, 2, 3)
    planes = [geom for geom in geoms.tolist() if model.geom_type[geom] == _GEOM.mjGEOM_PLANE]
    for geom in (geom for geom in geoms.tolist() if geom not in planes):
        mesh = int(model.geom_dataid[geom])
        if model.geom_type[geom] == _GEOM.mjGEOM_MESH:
            faces = slice(model.mesh_faceadr[mesh], model.mesh_faceadr[mesh] + model.mesh_facenum[mesh])
            local = model.mesh_vert[model.mesh_vertadr[mesh] + model.mesh_face[faces]].astype(np.float64)
        else:
            local = _box_triangles(*boxes[geom])
        found.append(local @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom])
    corners = np.concatenate([one.reshape(-1, 3) for one in found]) if found else np.zeros((1, 3))
    low, high = corners.min(axis=0) - _AROUND_M, corners.max(axis=0) + _AROUND_M
    for geom in planes:
        axes, middle = data.geom_xmat[geom].reshape(3, 3), data.geom_xpos[geom]
        # A side without a limit reaches around everything else.
        reach = np.abs(0.5 * (low + high) - middle) + 0.5 * (high - low)
        half = [size if size > 0.0 else float(np.abs(axes[:, axis]) @ reach)
                for axis, size in enumerate(model.geom_size[geom, :2].tolist())]  # fmt: skip
        quad = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * (*half, 0.0)
        found.append((quad @ axes.T + middle)[[[0, 1, 2], [0, 2, 3]]])
    if not found:
        raise ParameterError("there is nothing in it that is drawn or collides")
    return np.concatenate(found)


def _box_triangles(middle: FloatArray, half: FloatArray) -> FloatArray:
    """`(12, 3, 3)` triangles of a box along the axes."""
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=np.float64) * half + middle
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return corners[[side for a, b, c, d in quads for side in ((a, b, c), (a, c, d))]]


def _lights(model: Any, data: Any, floor_m: float) -> tuple[Mapping[str, Any], ...]:
    """Its brightest lights; the first distant one casts the shadows."""
    active = np.flatnonzero(np.asarray(model.light_active) != 0)
    brightest = active[np.argsort(-model.light_diffuse[active].sum(axis=1), kind="stable")][:_MOST_LIGHTS].tolist()
    distant = [one for one in brightest if model.light_type[one] == mujoco.mjtLightType.mjLIGHT_DIRECTIONAL]
    return tuple(
        {
            "type": mujoco.mjtLightType(int(model.light_type[one])),
            "pos": (data.light_xpos[one] - (0.0, 0.0, floor_m)).tolist(),
            "dir": data.light_xdir[one].tolist(),
            "diffuse": model.light_diffuse[one].tolist(),
            "ambient": [0.0, 0.0, 0.0],
            "specular": [0.0, 0.0, 0.0],
            "attenuation": model.light_attenuation[one].tolist(),
            "cutoff": float(model.light_cutoff[one]),
            "exponent": float(model.light_exponent[one]),
            "castshadow": one == (distant or [-1])[0],
        }
        for one in brightest
    )
