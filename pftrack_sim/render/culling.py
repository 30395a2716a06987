"""Geoms that cannot change an image: out of view, or unable to occlude a person.

Decided from bounding boxes, and conservative: a geom that is ruled out changes no pixel.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import mujoco
import numpy as np

from pftrack_sim.camera.extents import CORNERS
from pftrack_sim.camera.pinhole import Intrinsics, focal_and_centre
from pftrack_sim.core.types import BoolArray, FloatArray, IntArray

_BOUNDED_TYPES = [
    int(getattr(mujoco.mjtGeom, f"mjGEOM_{name}"))
    for name in ("SPHERE", "CAPSULE", "ELLIPSOID", "CYLINDER", "BOX", "MESH")
]
"""Types of geoms that lie inside their `geom_aabb`."""

GROUND_CONTACT_M = 1e-4  # Soles penetrate the ground by up to this much without being occluded by it

_MARGIN_M, _MARGIN_PX = 0.01, 1.0  # OpenGL computes in single precision: a geom outside by less may still touch a pixel


class PixelRect(NamedTuple):
    """A rectangle of whole pixels: columns left .. left + width - 1, rows top .. top + height - 1."""

    left: int
    top: int
    width: int
    height: int

    @property
    def slices(self) -> tuple[slice, slice]:
        """Rows and columns, to index an image with."""
        return slice(self.top, self.top + self.height), slice(self.left, self.left + self.width)


class View(NamedTuple):
    """A camera in a scene.

    Attributes:
        geom_xpos: `(ngeom, 3)` positions of the geoms [m].
        geom_xmat: `(ngeom, 9)` their rotations.
        T_world_camera: `(4, 4)` camera pose.
        K: `(3, 3)` camera matrix [px].
        near_m: Depth of the near plane.
    """

    geom_xpos: FloatArray
    geom_xmat: FloatArray
    T_world_camera: FloatArray
    K: FloatArray
    near_m: float

    @property
    def intrinsics(self) -> Intrinsics:
        """Focal lengths fx, fy and principal point cx, cy [px]."""
        return focal_and_centre(self.K)


class ShadowMap(NamedTuple):
    """The square, across a distant light, in which it casts shadows.

    Attributes:
        direction: `(3,)` unit vector in which the light travels.
        right: `(3,)` unit vector along its rows.
        up: `(3,)` unit vector along its columns.
        centre: `(3,)` a point on the axis of the light through its middle [m].
        half_width_m: Half its width.
    """

    direction: FloatArray
    right: FloatArray
    up: FloatArray
    centre: FloatArray
    half_width_m: float


class Bounds:
    """Oriented bounding boxes of a model's geoms."""

    def __init__(self, model: mujoco.MjModel) -> None:
        boxes = np.array(model.geom_aabb, dtype=np.float64).reshape(-1, 2, 3)
        self.middles, self.halves = boxes[:, 0], boxes[:, 1]
        self.radii_m = np.linalg.norm(np.abs(boxes[:, 0]) + boxes[:, 1], axis=1)
        self.corners = (self.middles[:, None] + CORNERS * self.halves[:, None]).reshape(-1, 3)
        """`(8 ngeom, 3)` corners of the boxes, in the frame of each geom [m]."""
        self.corner_starts: IntArray = 8 * np.arange(len(boxes) + 1)
        """`(ngeom + 1,)` first corner of each geom."""
        self.unbounded: BoolArray = ~np.isin(model.geom_type, _BOUNDED_TYPES)
        """`(ngeom,)` geoms without a box: nothing is ever ruled out for them."""

    def in_view(self, view: View, rect: PixelRect, geoms: IntArray) -> BoolArray:
        """`(N,)` which geoms may be visible in a rectangle of the image."""
        return self.unbounded[geoms] | self._inside(view, geoms, *_planes(view, rect))

    def may_shade(self, view: View, rect: PixelRect, geoms: IntArray, shadows: ShadowMap) -> BoolArray:
        """`(N,)` which geoms may shade what is visible in a rectangle of the image, by the shadows of one light.

        A geom that the light sweeps away from a side of the view, or past the map, shades nothing in it.
        """
        normals, offsets = _planes(view, rect)
        away = normals @ shadows.direction <= 0.0
        across = np.stack([shadows.right, -shadows.right, shadows.up, -shadows.up])
        ends = shadows.half_width_m - across @ shadows.centre
        normals, offsets = np.concatenate([normals[away], across]), np.concatenate([offsets[away], ends])
        return self.unbounded[geoms] | self._inside(view, geoms, normals, offsets)

    def may_occlude(
        self, view: View, rect: PixelRect, geoms: IntArray, farthest_m: float, lowest_m: float
    ) -> BoolArray:
        """`(N,)` which geoms may occlude a person.

        Args:
            view: The camera.
            rect: Rectangle of the image around the person.
            geoms: `(N,)` ids.
            farthest_m: Depth of the person's farthest point.
            lowest_m: Height of the person's lowest point.
        """
        # From above, a geom below a person's soles occludes nothing of the person.
        least_m = lowest_m + GROUND_CONTACT_M if view.T_world_camera[2, 3] > lowest_m else -np.inf
        return self.unbounded[geoms] | self._inside(view, geoms, *_planes(view, rect, farthest_m, least_m))

    def _inside(self, view: View, geoms: IntArray, normals: FloatArray, offsets: FloatArray) -> BoolArray:
        """`(N,)` whether the boxes of geoms reach to the inner side of each of some planes, or miss it by a margin."""
        distances = normals @ view.geom_xpos[geoms].T + offsets[:, None]
        found = distances.min(axis=0) > -self.radii_m[geoms] - _MARGIN_M
        left = np.flatnonzero(found)
        if left.size:
            ids = geoms[left]
            turned = normals @ view.geom_xmat[ids].reshape(-1, 3, 3)
            reach = turned @ self.middles[ids, :, None] + np.abs(turned) @ self.halves[ids, :, None]
            found[left] = (distances.T[left] + reach[..., 0]).min(axis=1) > -_MARGIN_M
        return found


def _planes(
    view: View, rect: PixelRect, farthest_m: float = np.inf, least_m: float = -np.inf
) -> tuple[FloatArray, FloatArray]:
    """`(7, 3)` unit normals and `(7,)` offsets, in the world, of the planes that bound what is looked for.

    They are the near plane, the far one, the sides of a view, and a height. Points x inside have n.x + offset > 0.
    """
    fx, fy, cx, cy = view.intrinsics
    left, top = cx - rect.left + _MARGIN_PX, cy - rect.top + _MARGIN_PX
    right, bottom = rect.width + 2.0 * _MARGIN_PX - left, rect.height + 2.0 * _MARGIN_PX - top
    sides = _unit(fx, left), _unit(-fx, right), _unit(fy, top), _unit(-fy, bottom)
    inwards = np.array(
        [(0.0, 0.0, 1.0), (0.0, 0.0, -1.0)]
        + [(across, 0.0, ahead) for across, ahead in sides[:2]]
        + [(0.0, down, ahead) for down, ahead in sides[2:]]
    )
    normals = np.empty((7, 3))
    normals[:6] = inwards @ view.T_world_camera[:3, :3].T
    normals[6] = 0.0, 0.0, 1.0
    offsets = -normals @ view.T_world_camera[:3, 3]
    offsets[0] -= view.near_m
    offsets[1] += farthest_m
    offsets[6] = -_MARGIN_M - least_m
    return normals, offsets


def _unit(x: float, y: float) -> tuple[float, float]:
    length = math.hypot(x, y)
    return x / length, y / length
