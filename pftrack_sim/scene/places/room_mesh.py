"""Rooms of triangle meshes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pftrack_sim.core.errors import ParameterError
from pftrack_sim.scenario.model import MeshPlace
from pftrack_sim.scene.places.builder import Item
from pftrack_sim.scene.places.mesh_file import drawn, read_meshes
from pftrack_sim.scene.places.navigation import MOST_M, area_of, floor_height_m, grid_of
from pftrack_sim.scene.places.room import Room, Surface, distinct_names

_LEAST_M = 2.0


def read_mesh(place: MeshPlace) -> Room:
    """The room of a mesh file.

    Raises:
        ParameterError: It cannot be read, is too large or too small, has no floor, or no room for a person.
    """
    meshes = read_meshes(Path(place.model), place.up)
    parts = [place.scale * mesh.triangles for mesh in meshes]
    triangles = np.concatenate(parts)
    long_m = float(np.ptp(triangles.reshape(-1, 3), axis=0)[:2].max())
    if not _LEAST_M <= long_m <= MOST_M:
        raise ParameterError(
            f"it is {long_m:.3g} m long, {_LEAST_M:g} to {MOST_M:g} m are a room: set place.scale (0.001 for "
            "millimetres, 0.0254 for inches)"
        )
    floor_m = floor_height_m(triangles) if place.floor_m is None else place.floor_m
    area = area_of(grid_of(triangles, floor_m))
    items, surfaces = list[Item](), dict[str, Surface]()
    names = distinct_names(mesh.name for mesh in meshes)
    for name, mesh, own in zip(names, meshes, parts, strict=True):
        surfaces[f"room/{name}"] = mesh.surface
        shown = drawn(mesh, f"room/{name}", own - (0.0, 0.0, floor_m))
        if shown is not None:
            items.append(Item(name, (shown,)))
    return Room(area, tuple(items), surfaces=surfaces)
