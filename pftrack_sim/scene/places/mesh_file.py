"""Files of triangle meshes, which the library trimesh reads: rooms, and things to track."""

from __future__ import annotations

import importlib
import importlib.util
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scenario.section import UpAxis
from pftrack_sim.scene.compiled_model import texels
from pftrack_sim.scene.places.meshes import TexturedMesh
from pftrack_sim.scene.places.room import MOST_TRIANGLES, Surface

_Y_UP = (".gltf", ".glb", ".obj")
_KINDS = (*_Y_UP, ".ply", ".stl")
_Z_FROM_Y = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


class FileMesh(NamedTuple):
    """A mesh of a file.

    Attributes:
        name: Of its node.
        triangles: `(F, 3, 3)` corners in units of the file, z up.
        uv: `(F, 3, 2)` texture coordinates, or None.
        solid: Whether it encloses something; else it is drawn from both sides.
    """

    name: str
    triangles: FloatArray
    uv: FloatArray | None
    surface: Surface
    solid: bool


def read_meshes(path: Path, up: UpAxis) -> list[FileMesh]:
    """The meshes of a file.

    Raises:
        ParameterError: It cannot be read, or has no triangles or too many.
    """
    if path.suffix.lower() not in _KINDS:
        raise ParameterError(f"not of a kind that is read ({', '.join(_KINDS)})")
    meshes = _loaded(path)
    count = sum(len(mesh.faces) for _, mesh in meshes)
    if not 0 < count <= MOST_TRIANGLES:
        raise ParameterError(f"has {count} triangles, 1 to {MOST_TRIANGLES} are drawn; simplify it first")
    y_up = up == "y" or (up == "auto" and path.suffix.lower() in _Y_UP)
    turn = _Z_FROM_Y if y_up else np.eye(3)
    found = [
        FileMesh(name, np.asarray(mesh.triangles, dtype=np.float64) @ turn.T, uv, surface, _is_solid(mesh))
        for name, mesh in meshes
        for surface, uv in (_surface(mesh),)
    ]
    if not all(np.isfinite(mesh.triangles).all() for mesh in found):
        raise ParameterError("has vertices that are no finite numbers")
    return found


def _loaded(path: Path) -> list[tuple[str, Any]]:
    """The meshes of a file in the frame of the file, with the names of their nodes."""
    if importlib.util.find_spec("trimesh") is None:
        raise ParameterError("meshes need trimesh: pip install 'pftrack-sim[mesh]'")
    trimesh = importlib.import_module("trimesh")
    try:
        scene = trimesh.load_scene(path, process=False)
        found: list[tuple[str, Any]] = []
        for node in sorted(scene.graph.nodes_geometry):
            pose, geometry = scene.graph[node]
            mesh = scene.geometry[geometry]
            if isinstance(mesh, trimesh.Trimesh):
                found.append((str(node), mesh.copy().apply_transform(pose)))
    except (ValueError, KeyError, TypeError, IndexError, AttributeError, OSError, NotImplementedError) as error:
        raise ParameterError(f"cannot be read as {path.suffix[1:].upper()}: {error}") from None
    return found


def _is_solid(mesh: Any) -> bool:
    return bool(mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 0.0)


def _surface(mesh: Any) -> tuple[Surface, FloatArray | None]:
    """Colour or texture of a mesh, and `(F, 3, 2)` texture coordinates of the corners of its triangles."""
    material = getattr(mesh.visual, "material", None)
    image = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
    uv = getattr(mesh.visual, "uv", None)
    if image is not None and uv is not None and len(uv) == len(mesh.vertices):
        factor = getattr(material, "baseColorFactor", None)
        red, green, blue = (1.0, 1.0, 1.0) if factor is None else (np.asarray(factor)[:3] / 255.0).tolist()
        return Surface((red, green, blue, 1.0), texels(np.asarray(image.convert("RGB")))), np.asarray(uv)[mesh.faces]
    if material is not None:
        colour = np.asarray(material.main_color, dtype=np.float64)
    else:
        colour = np.asarray(mesh.visual.vertex_colors, dtype=np.float64)[mesh.faces].reshape(-1, 4).mean(axis=0)
    red, green, blue = (colour[:3] / 255.0).tolist()
    return Surface((red, green, blue, 1.0)), None


def drawn(mesh: FileMesh, material: str, triangles_m: FloatArray) -> TexturedMesh | None:
    """`(F, 3, 3)` triangles of a mesh, moved to where they are, as flat faces; None if none has an area."""
    normals = np.cross(triangles_m[:, 1] - triangles_m[:, 0], triangles_m[:, 2] - triangles_m[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    kept = lengths > 1e-9
    if not kept.any():
        return None
    corners, normals = triangles_m[kept], np.repeat((normals[kept] / lengths[kept, None])[:, None], 3, axis=1)
    uv = np.zeros((0, 3, 2)) if mesh.uv is None else mesh.uv[kept]
    if not mesh.solid:
        corners, uv = np.concatenate([corners, corners[:, ::-1]]), np.concatenate([uv, uv[:, ::-1]])
        normals = np.concatenate([normals, -normals])
    faces = np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3)
    return TexturedMesh(material, corners.reshape(-1, 3), normals.reshape(-1, 3), uv.reshape(-1, 2), faces)
