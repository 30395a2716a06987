"""Triangles of COLLADA files (`.dae`), as most robots of ROS have them; MuJoCo reads none. Library: pycollada."""

from __future__ import annotations

import importlib
import io
import xml.etree.ElementTree as ET
from typing import Any

import numpy as np

from pftrack_sim.core.types import FloatArray, IntArray

_SURFACES = ("library_images", "library_effects", "library_materials", "bind_material")


def read_collada(content: bytes) -> tuple[FloatArray, IntArray]:
    """`(V, 3)` vertices [m] and `(F, 3)` triangles of all geometry of a file, placed by its scene.

    Colours and textures are left out; the up axis is that of the numbers, as in RViz.

    Raises:
        ImportError: pycollada is missing, which the extra `mesh` brings.
        ValueError: It is no COLLADA, or holds no triangles.
    """
    library: Any = importlib.import_module("collada")
    try:
        root = ET.fromstring(content)
        # Materials are not wanted, and a broken one would take its geometry along.
        for parent in list(root.iter()):
            for child in [one for one in parent if one.tag.rpartition("}")[2] in _SURFACES]:
                parent.remove(child)
        document = library.Collada(io.BytesIO(ET.tostring(root)))
        scenes = document.scenes if document.scene is None else [document.scene]
        lists = [one for scene in scenes for body in scene.objects("geometry") for one in body.primitives()]
        triangles = [one.triangleset() if hasattr(one, "triangleset") else one for one in lists]
        # Lines have two corners.
        soups = [one.vertex[one.vertex_index] for one in triangles if one.vertex_index.shape[-1] == 3]
    except (ET.ParseError, library.DaeError, ValueError, KeyError, IndexError) as error:
        raise ValueError(f"no COLLADA: {error}") from None
    corners = np.concatenate([np.empty((0, 3, 3)), *soups]).reshape(-1, 3)
    if not len(corners):
        raise ValueError("holds no triangles")
    vertices, faces = np.unique(corners, axis=0, return_inverse=True)
    return float(document.assetInfo.unitmeter or 1.0) * vertices, faces.reshape(-1, 3)
