"""Amodal boxes of bodies from the vertices of their parts, without rendering.

Every part is the convex hull of its vertices, so its extent is that of the projected vertices. What lies nearer than
the near plane is cut off, as in the rendered image.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.camera.pinhole import Intrinsics, focal_and_centre
from pftrack_sim.core.compiled import kernel
from pftrack_sim.core.types import FloatArray, IntArray

CORNERS: FloatArray = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
"""`(8, 3)` corners of the box with half sizes 1."""
CORNERS.setflags(write=False)


class Bodies:
    """The S parts of B bodies.

    Args:
        bodies: `(V, 3)` vertices of each body's parts [m], in the frame of the part; at least one part per body.
    """

    def __init__(self, bodies: Sequence[Sequence[FloatArray]]) -> None:
        self._ends = np.cumsum([0, *(len(parts) for parts in bodies)])
        self.starts: IntArray = self._ends[:-1]
        """`(B,)` index of each body's first part."""
        self.vertices = [np.array(vertices, dtype=np.float64) for parts in bodies for vertices in parts]
        self._joined = np.concatenate(self.vertices)
        self._first = np.cumsum([0, *(len(vertices) for vertices in self.vertices)])

    def boxes(
        self, positions: ArrayLike, rotations: ArrayLike, T_world_camera: ArrayLike, K: ArrayLike, near_m: float
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Amodal boxes, depth ranges and lowest heights of all bodies.

        Args:
            positions: `(S, 3)` of the parts [m], world frame.
            rotations: `(S, 3, 3)` from the frame of each part to the world frame.
            T_world_camera: `(4, 4)` camera pose.
            K: `(3, 3)` camera matrix [px].
            near_m: Distance of the near plane.

        Returns:
            `(B, 4)` boxes x, y, w, h [px], not clipped to the image, NaN for a body behind the near plane; `(B, 2)`
            smallest and largest depth of each body [m]; `(B,)` height of its lowest point [m].

        Raises:
            ParameterError: An invalid camera matrix.
        """
        # Copies: for arrays that are read-only, the kernel would be compiled once more.
        places, turned = np.array(positions, dtype=np.float64), np.array(rotations, dtype=np.float64)
        pose = np.array(T_world_camera, dtype=np.float64, order="C")
        found = project_bodies(
            self._joined, self._first, self._ends, places, turned, pose, focal_and_centre(K), float(near_m)
        )
        return found[:, :4], found[:, 4:6], found[:, 6]


@kernel
def project_bodies(
    vertices: FloatArray,
    first: IntArray,
    ends: IntArray,
    positions: FloatArray,
    rotations: FloatArray,
    pose: FloatArray,
    intrinsics: Intrinsics,
    near_m: float,
) -> FloatArray:
    """Boxes of bodies, as far as they are beyond the near plane.

    Args:
        vertices: `(V, 3)` of all parts, one part after the other [m].
        first: `(S + 1,)` index of each part's first vertex.
        ends: `(B + 1,)` index of each body's first part.
        positions: `(S, 3)` of the parts in the world [m].
        rotations: `(S, 3, 3)` to the world.
        pose: `(4, 4)` T_world_camera.
        intrinsics: Focal lengths fx, fy and principal point cx, cy [px].
        near_m: Depth of the near plane.

    Returns:
        `(B, 7)` box x, y, w, h [px], NaN for a body behind the plane; smallest and largest depth and lowest height [m].
    """
    fx, fy, cx, cy = intrinsics
    bodies, local, axes = np.empty((len(ends) - 1, 7)), np.empty((len(vertices), 3)), np.empty((3, 4))
    for body in range(len(ends) - 1):
        # Normalized image coordinates.
        left, top, right, bottom = np.inf, np.inf, -np.inf, -np.inf
        nearest, farthest, lowest = np.inf, -np.inf, np.inf
        for part in range(ends[body], ends[body + 1]):
            for axis in range(3):
                axes[axis, 3] = 0.0
                for column in range(3):
                    axes[axis, column] = 0.0
                    axes[axis, 3] += pose[column, axis] * (positions[part, column] - pose[column, 3])
                    for along in range(3):
                        axes[axis, column] += pose[along, axis] * rotations[part, along, column]
            near, far = np.inf, -np.inf
            for index in range(first[part], first[part + 1]):
                x, y, z = vertices[index, 0], vertices[index, 1], vertices[index, 2]
                for axis in range(3):
                    local[index, axis] = axes[axis, 0] * x + axes[axis, 1] * y + axes[axis, 2] * z + axes[axis, 3]
                depth = local[index, 2]
                height = rotations[part, 2, 0] * x + rotations[part, 2, 1] * y + rotations[part, 2, 2] * z
                height += positions[part, 2]
                near, far, lowest = min(near, depth), max(far, depth), min(lowest, height)
                if depth >= near_m:
                    u, v = local[index, 0] / depth, local[index, 1] / depth
                    left, right = min(left, u), max(right, u)
                    top, bottom = min(top, v), max(bottom, v)
            nearest, farthest = min(nearest, near), max(farthest, far)
            if near < near_m <= far:
                # The section with the plane is the hull of its intersections with the segments between its two sides.
                for ahead in range(first[part], first[part + 1]):
                    for behind in range(first[part], first[part + 1]):
                        if local[ahead, 2] >= near_m > local[behind, 2]:
                            share = (local[ahead, 2] - near_m) / (local[ahead, 2] - local[behind, 2])
                            u = (local[ahead, 0] + share * (local[behind, 0] - local[ahead, 0])) / near_m
                            v = (local[ahead, 1] + share * (local[behind, 1] - local[ahead, 1])) / near_m
                            left, right = min(left, u), max(right, u)
                            top, bottom = min(top, v), max(bottom, v)
        x, y = left * fx + cx, top * fy + cy
        if farthest < near_m:
            x = y = np.nan
        bodies[body, 0], bodies[body, 1] = x, y
        # From pixels to pixels: a box within the image is then its own clipped box to the bit.
        bodies[body, 2], bodies[body, 3] = right * fx + cx - x, bottom * fy + cy - y
        bodies[body, 4], bodies[body, 5], bodies[body, 6] = nearest, farthest, lowest
    return bodies
