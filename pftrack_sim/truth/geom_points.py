"""Points on the surface of a geom, whose hull is the geom."""

from __future__ import annotations

import mujoco
import numpy as np

from pftrack_sim.camera.extents import CORNERS
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.types import FloatArray

_SPHERE_POINTS, _RIM_POINTS = 2000, 96
"""Vertices of a sphere and of each rim of a cylinder: 0.1 % of the radius short of the surface."""


def surface_points(model: mujoco.MjModel, geom: int) -> FloatArray:
    """`(V, 3)` vertices of a geom in its own frame [m]; of a curved one, points on its surface.

    Raises:
        ParameterError: A geom type without a finite convex shape (plane, height field).
    """
    kind, size = mujoco.mjtGeom(int(model.geom_type[geom])), np.asarray(model.geom_size[geom])
    match kind:
        case mujoco.mjtGeom.mjGEOM_SPHERE:
            return size[0] * _unit_sphere()
        case mujoco.mjtGeom.mjGEOM_ELLIPSOID:
            return size * _unit_sphere()
        case mujoco.mjtGeom.mjGEOM_CAPSULE:
            return np.concatenate([size[0] * _unit_sphere() + (0.0, 0.0, z) for z in (-size[1], size[1])])
        case mujoco.mjtGeom.mjGEOM_CYLINDER:
            angles = 2.0 * np.pi * np.arange(_RIM_POINTS) / _RIM_POINTS
            circle = size[0] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
            return np.concatenate([np.column_stack([circle, np.full(_RIM_POINTS, z)]) for z in (-size[1], size[1])])
        case mujoco.mjtGeom.mjGEOM_BOX:
            return CORNERS * size
        case mujoco.mjtGeom.mjGEOM_MESH:
            mesh = int(model.geom_dataid[geom])
            first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
            return np.asarray(model.mesh_vert[first : first + count], dtype=np.float64)
        case _:
            raise ParameterError(f"geom {model.geom(geom).name!r} of a person has type {kind.name}, which has no box")


def _unit_sphere() -> FloatArray:
    """`(V, 3)` points spread evenly over the unit sphere (Fibonacci spiral)."""
    index = np.arange(_SPHERE_POINTS)
    height = 1.0 - (2.0 * index + 1.0) / _SPHERE_POINTS
    angle = index * np.pi * (3.0 - np.sqrt(5.0))
    radius = np.sqrt(1.0 - height * height)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)
