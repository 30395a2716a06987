"""How far a body reaches in the image, without drawing it: amodal boxes in closed form.

Every shape is convex and lives in a frame of its own. A smooth shape is the hull of one or two ellipsoids: a sphere
or ellipsoid of one, a capsule of two spheres, a cylinder of two flat discs. A box or mesh is the hull of its vertices.
A vertical line x/z = t touches an ellipsoid with centre c and M = A A' (A: semi-axes as columns) where the plane
n = (1, 0, -t) is tangent, (n.c)^2 = n'Mn: a quadratic in t (the projection of the dual quadric: Hartley and Zisserman,
Multiple View Geometry, 2nd ed., section 8.3). Rows give y/z the same way.

What lies nearer than the near plane is cut off, as it is when drawn. Extents are u_min, v_min, u_max, v_max with
u = x/z and v = y/z in camera axes; NaN where nothing is left.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.camera.pinhole import focal_and_centre
from pftrack_sim.core.errors import ParameterError

Array: TypeAlias = NDArray[np.float64]
Kind: TypeAlias = Literal["ellipsoid", "capsule", "cylinder", "hull"]

_GROUP_STEP = 64
"""Hulls whose vertices fill equally many runs of this length are projected together."""

_RIM_POINTS = 96
"""Vertices per rim when a cylinder is cut by the near plane; 0.05 % of its radius short of the circle."""


@dataclass(frozen=True)
class Shape:
    """One convex part.

    Attributes:
        kind: What `size` and `points` mean.
        size: `(3,)` [m]: ellipsoid: semi-axes; capsule, cylinder: radius, half length along z (between the centres of
            a capsule's end spheres), unused. Unused for a hull.
        points: `(V, 3)` vertices of a hull [m]; empty otherwise.
    """

    kind: Kind
    size: tuple[float, float, float] = (0.0, 0.0, 0.0)
    points: Array | None = None


def sphere(radius_m: float) -> Shape:
    """A ball around the origin."""
    return Shape("ellipsoid", (radius_m, radius_m, radius_m))


def ellipsoid(semi_axes_m: ArrayLike) -> Shape:
    """An ellipsoid around the origin, its `(3,)` semi-axes along x, y and z."""
    a, b, c = (float(v) for v in np.asarray(semi_axes_m))
    return Shape("ellipsoid", (a, b, c))


def capsule(radius_m: float, half_length_m: float) -> Shape:
    """A capsule along z; `half_length_m` from its middle to the centre of each end sphere."""
    return Shape("capsule", (radius_m, half_length_m, 0.0))


def cylinder(radius_m: float, half_length_m: float) -> Shape:
    """A cylinder along z."""
    return Shape("cylinder", (radius_m, half_length_m, 0.0))


def cuboid(half_sizes_m: ArrayLike) -> Shape:
    """A box around the origin with `(3,)` half sizes."""
    return hull(CORNERS * np.asarray(half_sizes_m, dtype=np.float64))


def hull(points: ArrayLike) -> Shape:
    """The convex hull of `(V, 3)` vertices, V >= 1.

    Raises:
        ParameterError: No vertices, or not three coordinates each.
    """
    vertices = np.array(points, dtype=np.float64)
    if vertices.ndim != 2 or vertices.shape[0] < 1 or vertices.shape[1] != 3:
        raise ParameterError(f"a hull needs vertices of shape (V, 3), V >= 1, got {vertices.shape}")
    vertices.setflags(write=False)
    return Shape("hull", points=vertices)


CORNERS: Array = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
"""`(8, 3)` corners of the box with half sizes 1."""
CORNERS.setflags(write=False)


class Bodies:
    """The parts of several bodies, laid out so that the boxes of all come from a few array operations.

    Args:
        bodies: Shapes of each body; a body has at least one.

    Raises:
        ParameterError: A body without parts.
    """

    def __init__(self, bodies: Sequence[Sequence[Shape]]) -> None:
        for index, parts in enumerate(bodies):
            if not parts:
                raise ParameterError(f"body {index} has no parts to project")
        self.shapes: tuple[Shape, ...] = tuple(shape for parts in bodies for shape in parts)
        counts = np.array([len(parts) for parts in bodies], dtype=np.intp)
        self.starts = np.concatenate([[0], np.cumsum(counts)[:-1]]).astype(np.intp)
        """`(B,)` index of each body's first part."""
        part: list[int] = []
        offsets: list[float] = []
        axes: list[tuple[float, float, float]] = []
        for index, shape in enumerate(self.shapes):
            a, b, c = shape.size
            if shape.kind == "ellipsoid":
                ends = [(0.0, (a, b, c))]
            elif shape.kind == "capsule":
                ends = [(-b, (a, a, a)), (b, (a, a, a))]
            elif shape.kind == "cylinder":
                ends = [(-b, (a, a, 0.0)), (b, (a, a, 0.0))]
            else:
                ends = []
            for offset, semi_axes in ends:
                part.append(index)
                offsets.append(offset)
                axes.append(semi_axes)
        self._end_part = np.array(part, dtype=np.intp)
        self._end_offset = np.array(offsets, dtype=np.float64)
        self._end_axes = np.array(axes, dtype=np.float64).reshape(-1, 3)
        self._hulls = _grouped({i: shape.points for i, shape in enumerate(self.shapes) if shape.points is not None})

    def boxes(
        self, positions: ArrayLike, rotations: ArrayLike, T_world_camera: ArrayLike, K: ArrayLike, near_m: float
    ) -> tuple[Array, Array]:
        """Amodal boxes of all bodies and how deep they reach.

        Args:
            positions: `(S, 3)` of every part, in the order given [m], world frame.
            rotations: `(S, 3, 3)` of every part; maps its own axes to the world's.
            T_world_camera: `(4, 4)` camera pose.
            K: `(3, 3)` camera matrix [px].
            near_m: Depth below which nothing is seen.

        Returns:
            `(B, 4)` boxes x, y, w, h [px], not clipped to the image, NaN for a body with nothing in front of the
            near plane; `(B, 2)` smallest and largest depth of each body [m], whatever lies in front.
        """
        fx, fy, cx, cy = focal_and_centre(K)
        extents, depths = self.extents(positions, rotations, T_world_camera, near_m)
        # fmin and fmax pass over the NaN of parts that are cut off altogether.
        low = np.fmin.reduceat(extents[:, :2], self.starts) * (fx, fy) + (cx, cy)
        high = np.fmax.reduceat(extents[:, 2:], self.starts) * (fx, fy) + (cx, cy)
        nearest = np.minimum.reduceat(depths[:, 0], self.starts)
        farthest = np.maximum.reduceat(depths[:, 1], self.starts)
        return np.concatenate([low, high - low], axis=1), np.stack([nearest, farthest], axis=1)

    def extents(
        self, positions: ArrayLike, rotations: ArrayLike, T_world_camera: ArrayLike, near_m: float
    ) -> tuple[Array, Array]:
        """Extents of every part.

        Args:
            positions: `(S, 3)` [m], world frame.
            rotations: `(S, 3, 3)`.
            T_world_camera: `(4, 4)` camera pose.
            near_m: Depth below which nothing is seen; > 0.

        Returns:
            `(S, 4)` u_min, v_min, u_max, v_max and `(S, 2)` smallest and largest depth [m].

        Raises:
            ParameterError: `near_m` is not positive.
        """
        if not near_m > 0.0:
            raise ParameterError(f"near_m must be > 0, got {near_m}")
        pose = np.asarray(T_world_camera, dtype=np.float64)
        centres = (np.asarray(positions, dtype=np.float64) - pose[:3, 3]) @ pose[:3, :3]
        axes = pose[:3, :3].T @ np.asarray(rotations, dtype=np.float64)
        extents = np.empty((len(self.shapes), 4))
        depths = np.empty((len(self.shapes), 2))
        if self._end_part.size:
            self._smooth(centres, axes, extents, depths)
        for part, points in self._hulls:
            _fill_hulls(part, axes[part] @ points + centres[part][:, :, None], extents, depths)
        for index in np.flatnonzero(depths[:, 0] < near_m):
            shape = self.shapes[index]
            extents[index] = _cut(shape, centres[index], axes[index], near_m) if depths[index, 1] >= near_m else np.nan
        return extents, depths

    def lowest(self, positions: ArrayLike, rotations: ArrayLike) -> Array:
        """`(B,)` height of each body's lowest point [m].

        Args:
            positions: `(S, 3)` of every part [m], world frame.
            rotations: `(S, 3, 3)` of every part.
        """
        centres, axes = np.asarray(positions, dtype=np.float64), np.asarray(rotations, dtype=np.float64)
        lowest = np.full(len(self.shapes), np.inf)
        part = self._end_part
        if part.size:
            upright = axes[part, 2]
            scaled = upright * self._end_axes
            ends = centres[part, 2] + upright[:, 2] * self._end_offset - np.sqrt(np.einsum("nk,nk->n", scaled, scaled))
            np.minimum.at(lowest, part, ends)
        for part, points in self._hulls:
            lowest[part] = centres[part, 2] + (axes[part, 2:] @ points)[:, 0].min(axis=1)
        return np.minimum.reduceat(lowest, self.starts)

    def _smooth(self, centres: Array, axes: Array, extents: Array, depths: Array) -> None:
        """Fill in the smooth parts as if none was near the camera."""
        part = self._end_part
        own = axes[part]
        centre = centres[part] + own[:, :, 2] * self._end_offset[:, None]
        scaled = own * self._end_axes[:, None, :]
        low, high = _tangents(centre, scaled @ scaled.transpose(0, 2, 1))
        reach = np.sqrt(np.einsum("nk,nk->n", scaled[:, 2], scaled[:, 2]))
        # The ends of one part follow each other: reduce each run of equal parts.
        starts = np.flatnonzero(np.diff(part, prepend=-1))
        smooth = part[starts]
        extents[smooth, :2] = np.minimum.reduceat(low, starts)
        extents[smooth, 2:] = np.maximum.reduceat(high, starts)
        depths[smooth, 0] = np.minimum.reduceat(centre[:, 2] - reach, starts)
        depths[smooth, 1] = np.maximum.reduceat(centre[:, 2] + reach, starts)


def _grouped(hulls: Mapping[int, Array]) -> list[tuple[NDArray[np.intp], Array]]:
    """Hulls of about equally many vertices together: indices `(G,)` and vertices `(G, 3, V)`.

    Short hulls are filled up with their first vertex.
    """
    groups: dict[int, list[int]] = {}
    for index, points in hulls.items():
        groups.setdefault(-(-len(points) // _GROUP_STEP), []).append(index)
    stacked: list[tuple[NDArray[np.intp], Array]] = []
    for indices in groups.values():
        longest = max(len(hulls[index]) for index in indices)
        filled = [
            np.concatenate([hulls[index], np.broadcast_to(hulls[index][0], (longest - len(hulls[index]), 3))]).T
            for index in indices
        ]
        stacked.append((np.array(indices, dtype=np.intp), np.stack(filled)))
    return stacked


def _fill_hulls(part: NDArray[np.intp], local: Array, extents: Array, depths: Array) -> None:
    """Fill in hulls as if none was near the camera.

    Args:
        part: `(G,)` rows to fill.
        local: `(G, 3, V)` vertices [m], camera axes.
        extents: `(S, 4)` to be filled.
        depths: `(S, 2)` to be filled.
    """
    depth = local[:, 2]
    depths[part, 0] = depth.min(axis=1)
    depths[part, 1] = depth.max(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        slopes = local[:, :2] / depth[:, None]
    extents[part, :2] = slopes.min(axis=2)
    extents[part, 2:] = slopes.max(axis=2)


def _tangents(centre: Array, M: Array) -> tuple[Array, Array]:
    """Slopes of the tangents to ellipsoids that are wholly in front of the camera.

    Args:
        centre: `(N, 3)` [m], camera axes.
        M: `(N, 3, 3)` A A' of the semi-axes A [m^2].

    Returns:
        `(N, 2)` smallest and `(N, 2)` largest u, v; NaN where there is no tangent.
    """
    z = centre[:, 2:]
    quadratic = z * z - M[:, 2, 2, None]
    half_linear = centre[:, :2] * z - M[:, :2, 2]
    constant = centre[:, :2] ** 2 - M[:, (0, 1), (0, 1)]
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(half_linear**2 - quadratic * constant)
        return (half_linear - root) / quadratic, (half_linear + root) / quadratic


def _cut(shape: Shape, centre: Array, axes: Array, near: float) -> Array:
    """Extents of the part of a shape that lies beyond the near plane, which cuts it.

    The extreme slopes of a convex set beyond the plane lie on the set's own boundary, where a tangent touches it
    beyond the plane, or on the cut itself.

    Args:
        shape: The shape.
        centre: `(3,)` its origin [m], camera axes.
        axes: `(3, 3)` its axes in camera axes.
        near: Depth of the near plane [m].

    Returns:
        `(4,)` u_min, v_min, u_max, v_max.
    """
    a, b, c = shape.size
    if shape.kind == "ellipsoid":
        scaled = axes * (a, b, c)
        spread = scaled @ scaled.T
        slopes = [_touching(centre, spread, near), _ellipsoid_section(centre, spread, near)]
    elif shape.kind == "capsule":
        ends = [centre - b * axes[:, 2], centre + b * axes[:, 2]]
        spread = a * a * np.eye(3)
        slopes = [*(_touching(end, spread, near) for end in ends), _capsule_section(ends[0], ends[1], a, near)]
    else:
        points = _rims(a, b) if shape.kind == "cylinder" else shape.points
        assert points is not None
        slopes = [_hull_beyond(points @ axes.T + centre, near)]
    found = np.concatenate(slopes)
    return np.concatenate([np.fmin.reduce(found), np.fmax.reduce(found)])


def _touching(centre: Array, M: Array, near: float) -> Array:
    """`(2, 2)` slopes u, v of the two tangents of an ellipsoid; NaN where one does not touch beyond the plane."""
    slopes = np.stack(_tangents(centre[None], M[None]))[:, 0]
    for axis in (0, 1):
        for index in (0, 1):
            normal = np.zeros(3)
            normal[axis], normal[2] = 1.0, -slopes[index, axis]
            leaning = M @ normal
            length = float(normal @ leaning)
            touch = centre[2] - leaning[2] * float(normal @ centre) / length if length > 0.0 else centre[2]
            if not touch >= near:
                slopes[index, axis] = np.nan
    return slopes


def _ellipsoid_section(centre: Array, M: Array, near: float) -> Array:
    """`(2, 2)` smallest and largest u, v of the ellipse that the plane z = near cuts out of an ellipsoid."""
    step = near - centre[2]
    share = 1.0 - step * step / M[2, 2] if M[2, 2] > 0.0 else 0.0
    if not share >= 0.0:
        return np.full((2, 2), np.nan)
    lean = M[:2, 2] / M[2, 2] if M[2, 2] > 0.0 else np.zeros(2)
    middle = centre[:2] + lean * step
    half = np.sqrt(np.maximum(share * (M[(0, 1), (0, 1)] - lean * M[:2, 2]), 0.0))
    return np.stack([middle - half, middle + half]) / near


def _capsule_section(first: Array, second: Array, radius: float, near: float) -> Array:
    """`(2, 2)` smallest and largest u, v of what the plane z = near cuts out of a capsule.

    A capsule is a row of spheres along its axis; the plane cuts a circle out of each. The circle that reaches
    farthest along x is where its radius shrinks as fast as its centre advances.

    Args:
        first: `(3,)` centre of one end sphere [m], camera axes.
        second: `(3,)` centre of the other.
        radius: Radius [m].
        near: Depth of the plane [m].
    """
    direction = second - first
    reach = np.full((2, 2), np.nan)
    for axis in (0, 1):
        across, along = direction[axis], direction[2]
        for index, sign in ((0, -1.0), (1, 1.0)):
            positions = [0.0, 1.0]
            if along != 0.0:
                offset = -sign * radius * across * np.sign(along) / np.hypot(across, along)
                positions.append(float(np.clip((near - offset - first[2]) / along, 0.0, 1.0)))
            found: list[float] = []
            for position in positions:
                sphere_centre = first + position * direction
                rest = radius**2 - (near - sphere_centre[2]) ** 2
                if rest >= 0.0:
                    found.append(float(sphere_centre[axis] + sign * np.sqrt(rest)))
            if found:
                reach[index, axis] = (max(found) if sign > 0 else min(found)) / near
    return reach


def _hull_beyond(points: Array, near: float) -> Array:
    """`(2, 2)` smallest and largest u, v of a hull's part beyond the plane.

    What the plane cuts out of a hull is the hull of where it cuts the segments between vertices on either side.

    Args:
        points: `(V, 3)` vertices [m], camera axes; at least one beyond the plane.
        near: Depth of the plane [m].
    """
    ahead = points[points[:, 2] >= near]
    behind = points[points[:, 2] < near]
    share = (ahead[:, None, 2] - near) / (ahead[:, None, 2] - behind[None, :, 2])
    cuts = (ahead[:, None, :2] + share[..., None] * (behind[None, :, :2] - ahead[:, None, :2])).reshape(-1, 2) / near
    slopes = np.concatenate([ahead[:, :2] / ahead[:, 2:], cuts])
    return np.stack([slopes.min(axis=0), slopes.max(axis=0)])


def _rims(radius: float, half_length: float) -> Array:
    """`(2 * _RIM_POINTS, 3)` points on the two rims of a cylinder along z [m]."""
    angles = np.linspace(0.0, 2.0 * np.pi, _RIM_POINTS, endpoint=False)
    circle = radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return np.concatenate([np.column_stack([circle, np.full(_RIM_POINTS, z)]) for z in (-half_length, half_length)])
