"""Depth and optical flow of a frame, from the known shape and pose of every geom."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.types import BoolArray, FloatArray
from pftrack_sim.render.culling import View
from pftrack_sim.truth.silhouettes import poses_of


@dataclass(frozen=True, eq=False)
class SceneGeometry:
    """What every pixel of a frame shows, where the frame is an instant through a pinhole.

    Attributes:
        ids: `(H, W)` geom at the centre of each pixel; -1 for none.
        depth_m: `(H, W)` depth of the surface there, along the optical axis; infinite for none.
        view: Poses of all geoms and of the camera.
    """

    ids: NDArray[np.int32]
    depth_m: FloatArray
    view: View

    def flow_to(self, later: SceneGeometry) -> tuple[FloatArray, BoolArray]:
        """Motion of what each pixel shows, to a later frame of the same model.

        Every geom is rigid, so the motion is exact for the surface at the pixel's centre, whether it is still visible
        later or not.

        Returns:
            `(H, W, 2)` displacement across and down [px], and `(H, W)` where it is known: on a geom that is before the
            camera later too. It is 0 elsewhere.
        """
        known, pose, later_pose = self.ids >= 0, self.view.T_world_camera, later.view.T_world_camera
        rows, columns = np.nonzero(known)
        geoms, depth = self.ids[known].astype(np.intp), self.depth_m[known]
        (positions, rotations), (later_positions, later_rotations) = (
            poses_of(one, geoms) for one in (self.view, later.view)
        )
        fx, fy, cx, cy = self.view.intrinsics
        pixels = np.stack([columns + 0.5, rows + 0.5], axis=1)
        slopes = (pixels - (cx, cy)) / (fx, fy)
        points = np.column_stack([slopes * depth[:, None], depth])
        world = points @ pose[:3, :3].T + pose[:3, 3]
        local = np.einsum("nji,nj->ni", rotations, world - positions)
        moved = np.einsum("nij,nj->ni", later_rotations, local) + later_positions
        seen = (moved - later_pose[:3, 3]) @ later_pose[:3, :3]
        before = seen[:, 2] > self.view.near_m
        fx, fy, cx, cy = later.view.intrinsics
        ahead = seen[before]
        flow = np.zeros((*self.ids.shape, 2))
        valid = np.zeros(self.ids.shape, dtype=np.bool_)
        rows, columns = rows[before], columns[before]
        flow[rows, columns] = ahead[:, :2] / ahead[:, 2:] * (fx, fy) + (cx, cy) - pixels[before]
        valid[rows, columns] = True
        return flow, valid
