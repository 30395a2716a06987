"""Depth and optical flow of a frame, from the known shape and pose of every geom."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.camera.pinhole import focal_and_centre
from pftrack_sim.core.types import BoolArray, FloatArray


@dataclass(frozen=True, eq=False)
class SceneGeometry:
    """What every pixel of a frame shows, where the frame is an instant through a pinhole.

    Attributes:
        ids: `(H, W)` geom at the centre of each pixel; -1 for none.
        depth_m: `(H, W)` depth of the surface there, along the optical axis; infinite for none.
        T_world_camera: `(4, 4)` camera pose, OpenCV axes.
        K: `(3, 3)` camera matrix [px].
        positions: `(G, 3)` positions of all geoms [m].
        rotations: `(G, 3, 3)` their rotations.
        near_m: Depth of the near plane.
    """

    ids: NDArray[np.int32]
    depth_m: FloatArray
    T_world_camera: FloatArray
    K: FloatArray
    positions: FloatArray
    rotations: FloatArray
    near_m: float

    def flow_to(self, later: SceneGeometry) -> tuple[FloatArray, BoolArray]:
        """Motion of what each pixel shows, to a later frame of the same model.

        Every geom is rigid, so the motion is exact for the surface at the pixel's centre, whether it is still visible
        later or not.

        Returns:
            `(H, W, 2)` displacement across and down [px], and `(H, W)` where it is known: on a geom that is before the
            camera later too. It is 0 elsewhere.
        """
        known = self.ids >= 0
        rows, columns = np.nonzero(known)
        geoms, depth = self.ids[known], self.depth_m[known]
        fx, fy, cx, cy = focal_and_centre(self.K)
        pixels = np.stack([columns + 0.5, rows + 0.5], axis=1)
        slopes = (pixels - (cx, cy)) / (fx, fy)
        points = np.column_stack([slopes * depth[:, None], depth])
        world = points @ self.T_world_camera[:3, :3].T + self.T_world_camera[:3, 3]
        local = np.einsum("nji,nj->ni", self.rotations[geoms], world - self.positions[geoms])
        moved = np.einsum("nij,nj->ni", later.rotations[geoms], local) + later.positions[geoms]
        seen = (moved - later.T_world_camera[:3, 3]) @ later.T_world_camera[:3, :3]
        before = seen[:, 2] > self.near_m
        fx, fy, cx, cy = focal_and_centre(later.K)
        ahead = seen[before]
        flow = np.zeros((*self.ids.shape, 2))
        valid = np.zeros(self.ids.shape, dtype=np.bool_)
        rows, columns = rows[before], columns[before]
        flow[rows, columns] = ahead[:, :2] / ahead[:, 2:] * (fx, fy) + (cx, cy) - pixels[before]
        valid[rows, columns] = True
        return flow, valid
