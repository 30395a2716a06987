"""Number of render passes of a frame, from the motion in the image during readout and exposure."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from pftrack_sim.camera.distortion import Lens
from pftrack_sim.camera.remap import inverse_ground_range
from pftrack_sim.camera.shutter import Shutter
from pftrack_sim.camera.trajectory import CameraTrajectory, log_so3
from pftrack_sim.core.types import FloatArray
from pftrack_sim.render.capture.pose_history import PoseHistory
from pftrack_sim.render.renderer import geoms_drawn
from pftrack_sim.scene.layout import SCENERY_GROUP

_BAND_SHIFT_PX, _MOST_BANDS = 1.5, 6
"""Shift of scenery during readout that needs another band of rows; the error is at most half of it."""

_SAMPLE_SHIFT_PX, _MOST_SAMPLES = 1.0, 8  # Shift during the exposure that needs another sample
_MOST_PASSES = 16  # Most passes of a frame; bands are omitted beyond it

_ROTATION_SHIFT_PX, _MOST_ROTATIONS = 1.0, 32
"""Shift by camera rotation during the exposure that needs another resampling of a pass."""

_STILL_M = 2e-4  # Travel of the camera during a frame below which it stands still
NEAREST_M = 0.3  # Depth below which image motion is not evaluated
_PROBE_GRID = (8, 6)  # Rays across and down that probe the distance of the scenery


@dataclass(frozen=True)
class PassPlan:
    """Number of render passes.

    Attributes:
        edges: Edges of the runs of row bands, ascending from 0.
        samples: Passes over the exposure for each run.
        rotations: Times each pass is resampled, with the camera rotation of different instants.
    """

    edges: list[int]
    samples: int
    rotations: int


class PassPlanner:
    """Plans the render passes of frames with a number of row bands."""

    def __init__(self, model: mujoco.MjModel, lens: Lens, shutter: Shutter, bands: int) -> None:
        self._model, self._lens, self._shutter, self._bands = model, lens, shutter, bands
        groups = np.asarray(model.geom_group)
        self._drawn = geoms_drawn(model)
        bounded = np.asarray(model.geom_type) != int(mujoco.mjtGeom.mjGEOM_PLANE)
        self._scenery = np.flatnonzero((groups == SCENERY_GROUP) & bounded)

    def plan(self, trajectory: CameraTrajectory, history: PoseHistory, data: mujoco.MjData) -> PassPlan:
        """Plan a frame that is not taken at an instant; `data` is the scene at mid-exposure of the middle row."""
        shutter = self._shutter
        travels = np.ptp(trajectory.poses[:, :3, 3], axis=0).max() > _STILL_M
        points = self._scenery_points(trajectory.at(shutter.middle_s), data) if travels else np.empty((0, 3))
        runs = samples = rotations = 1
        if shutter.readout_s:
            start, end = shutter.middle_s - 0.5 * shutter.readout_s, shutter.middle_s + 0.5 * shutter.readout_s
            shifts, row_shares = self._shifts(trajectory, history, start, end)
            tall = shifts[shifts * row_shares > _BAND_SHIFT_PX]
            shift = max(self._scenery_shift(trajectory, points, start, end), tall.max(initial=0.0))
            runs = int(np.clip(np.ceil(shift / _BAND_SHIFT_PX), 1, min(_MOST_BANDS, self._bands)))
        if shutter.exposure_s:
            start, end = shutter.middle_s - 0.5 * shutter.exposure_s, shutter.middle_s + 0.5 * shutter.exposure_s
            shifts, _ = self._shifts(trajectory, history, start, end)
            shift = max(self._scenery_shift(trajectory, points, start, end), shifts.max(initial=0.0))
            samples = int(np.clip(np.ceil(shift / _SAMPLE_SHIFT_PX), 1, _MOST_SAMPLES))
            rotation = log_so3(trajectory.rotations(start).T @ trajectory.rotations(end))
            focal = float(self._lens.K[1, 1])
            shift = focal * np.hypot(rotation[0], rotation[1]) + 0.5 * abs(rotation[2]) * np.hypot(*self._lens.size)
            count = int(np.clip(np.ceil(shift / _ROTATION_SHIFT_PX), 1, _MOST_ROTATIONS))
            rotations = -(-count // samples)
        runs = min(runs, max(1, _MOST_PASSES // samples))
        edges = [int(edge) for edge in np.linspace(0, self._bands, runs + 1).round()]
        return PassPlan(edges, samples, rotations)

    def _shifts(
        self, trajectory: CameraTrajectory, history: PoseHistory, start_s: float, end_s: float
    ) -> tuple[FloatArray, FloatArray]:
        """Shifts of moving geoms in view [px], without camera rotation, and the share of image rows of each."""
        moving = np.flatnonzero(self._drawn[history.moving])
        pixels: list[FloatArray] = []
        depth = np.zeros(moving.size)
        R_world_camera = trajectory.rotations(self._shutter.middle_s)
        for when in (start_s, end_s):
            local = (history.geoms(when)[0][moving] - trajectory.positions(when)) @ R_world_camera
            depth = np.linalg.norm(local, axis=1) if self._lens.wide else local[:, 2]
            pixels.append(self._lens.K[0, 0] * self._seen(local))
        size = np.array(self._lens.size)
        in_view = depth > NEAREST_M
        if not self._lens.wide:
            in_view &= (np.abs(pixels[1]) < 0.75 * size).all(axis=1)
        shifts = np.linalg.norm(pixels[1] - pixels[0], axis=1)[in_view]
        radii = self._model.geom_rbound[history.moving[moving]][in_view]
        heights = 2.0 * radii * self._lens.K[1, 1] / depth[in_view]
        return shifts, np.minimum(heights / size[1], 1.0)

    def _scenery_points(self, pose: FloatArray, data: mujoco.MjData) -> FloatArray:
        """`(N, 3)` points of the scenery in view [m]: hits of a grid of rays, and the nearest point of each geom."""
        across, down = (
            (np.arange(count) + 0.5) / count * side for count, side in zip(_PROBE_GRID, self._lens.size, strict=True)
        )
        rays = self._lens.rays(np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2))
        directions = rays @ pose[:3, :3].T
        distances, geoms = np.empty(len(rays)), np.empty(len(rays), dtype=np.int32)
        groups = np.zeros(6, dtype=np.uint8)
        groups[SCENERY_GROUP] = 1
        ends = geoms, distances, None, len(rays), mujoco.mjMAXVAL
        mujoco.mj_multiRay(self._model, data, pose[:3, 3], directions.ravel(), groups, True, -1, *ends)
        hit = geoms >= 0
        return np.concatenate([pose[:3, 3] + distances[hit, None] * directions[hit], self._nearest_points(pose, data)])

    def _nearest_points(self, pose: FloatArray, data: mujoco.MjData) -> FloatArray:
        """`(N, 3)` nearest point of each scenery geom in view [m]; a thin pole may lie between the rays of the grid."""
        geoms = self._scenery
        axes = data.geom_xmat[geoms].reshape(-1, 3, 3)
        centres, half_sizes = self._model.geom_aabb[geoms, :3], self._model.geom_aabb[geoms, 3:]
        camera = np.einsum("nji,nj->ni", axes, pose[:3, 3] - data.geom_xpos[geoms]) - centres
        nearest = np.clip(camera, -half_sizes, half_sizes) + centres
        points = data.geom_xpos[geoms] + np.einsum("nij,nj->ni", axes, nearest)
        local = (points - pose[:3, 3]) @ pose[:3, :3]
        if self._lens.wide:
            return points[np.linalg.norm(local, axis=1) > NEAREST_M]
        limits = 0.5 * np.array(self._lens.size) / self._lens.K[(0, 1), (0, 1)]
        return points[(local[:, 2] > NEAREST_M) & (np.abs(self._seen(local)) < limits).all(axis=1)]

    def _scenery_shift(self, trajectory: CameraTrajectory, points: FloatArray, start_s: float, end_s: float) -> float:
        """Largest shift of scenery points [px], without camera rotation and the remapped travel over the ground."""
        if len(points) == 0:
            return 0.0
        pose = trajectory.at(self._shutter.middle_s)
        reference = self._seen((points - pose[:3, 3]) @ pose[:3, :3])
        offsets: list[FloatArray] = []
        for when in (start_s, end_s):
            position = trajectory.positions(when)
            rays = points - position
            remapped = rays + (position - pose[:3, 3]) * inverse_ground_range(rays, position)[:, None]
            offsets.append(self._seen(remapped @ pose[:3, :3]) - reference)
        return float(self._lens.K[0, 0] * np.linalg.norm(offsets[1] - offsets[0], axis=1).max())

    def _seen(self, local: FloatArray) -> FloatArray:
        """`(N, 2)` normalized coordinates of `(N, 3)` points in camera axes; of a wide lens `(N, 3)` directions."""
        if self._lens.wide:
            return local / np.maximum(np.linalg.norm(local, axis=1, keepdims=True), NEAREST_M)
        return np.asarray(local[:, :2] / np.maximum(local[:, 2:], NEAREST_M))
