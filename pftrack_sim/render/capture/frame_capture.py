"""Frames with lens distortion, finite exposure and rolling shutter, composed of pinhole renderings.

Where only the camera rotates, one rendered image holds all the light of the exposure, and each pixel is resampled along
its ray at its time (`camera.remap`). Where people move or the camera travels, more passes are rendered, as many as the
motion in the image requires (`pass_planner`):

- bands of rows, where near scenery shifts during readout; moving bodies need none of these, as each of their parts is
  rendered where it is when its row is exposed;
- samples over the exposure, where anything shifts other than by camera rotation;
- faces of a cube about the camera, as many as it sees, where the lens is wide. Each pixel is of the face that its own
  ray meets, so that they join without a gap.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import mujoco
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.camera.distortion import Lens, distorts
from pftrack_sim.camera.pinhole import focal_and_centre
from pftrack_sim.camera.projection import Readout, place_vertices
from pftrack_sim.camera.remap import (
    PixelMap,
    RadianceAccumulator,
    RayGrid,
    inverse_ground_range,
    normalized,
    resample,
)
from pftrack_sim.camera.shake import CameraShake
from pftrack_sim.camera.shutter import Shutter
from pftrack_sim.camera.trajectory import CameraTrajectory
from pftrack_sim.core.errors import ParameterError, ScenarioError
from pftrack_sim.core.records import Image
from pftrack_sim.core.types import FloatArray
from pftrack_sim.render.capture.pass_planner import PassPlan, PassPlanner
from pftrack_sim.render.capture.pose_history import PoseHistory
from pftrack_sim.render.culling import Bounds
from pftrack_sim.render.renderer import Renderer, clip_depths_m
from pftrack_sim.scenario import ResolvedScenario

_SHAKE_MARGIN_PX = 6
"""Margin of a rendered image for camera rotation within a frame; a larger rotation reduces its scale."""

_LARGEST_RATIO, _LARGEST_FISHEYE_RATIO = 1.6, 3.0
"""Largest size of a rendered image relative to the camera image; larger ones are rendered at a smaller scale."""

_FACE_HALF = 1.06  # Half the width of a face's image, of 1 its own half: what its last pixels are interpolated from
_LEAST_AHEAD = 0.1  # Rays that are less ahead of a face, of length 1, are none of its own
_FACES: FloatArray = np.array(
    [[(1, 0, 0), (0, 1, 0), (0, 0, 1)], [(0, 0, 1), (0, 1, 0), (-1, 0, 0)], [(0, 0, -1), (0, 1, 0), (1, 0, 0)],
     [(1, 0, 0), (0, 0, 1), (0, -1, 0)], [(1, 0, 0), (0, 0, -1), (0, 1, 0)], [(-1, 0, 0), (0, 1, 0), (0, 0, -1)]],
    dtype=np.float64,
)  # fmt: skip
"""`(6, 3, 3)` rotations by which the cameras of a cube's faces are turned: ahead, right, left, down, up, back."""

_POSES_PER_FRAME = 9  # Instants within a frame between which camera poses are interpolated
_MOST_TURN = 0.02  # Rotation [rad] between the instants of a `Readout`: its straight lines are off by turn^2 / 8


@dataclass(frozen=True, eq=False)
class RenderPass:
    """One rendered image of a frame.

    Attributes:
        bands: First and one past the last of the bands of image rows that it serves.
        offset_s: Mean offset of its light from the mid-exposure of each row.
        T_world_camera: `(4, 4)` pose of its camera.
        K: `(3, 3)` its camera matrix [px].
        rows: Rows of the rendered image that are used.
        pixel_maps: For each time it is resampled, `(rows, W, 2)` places in those rows.
        T_camera_render: `(4, 4)` by which its camera is turned; None where it looks as the camera of the frame does.
        masks: For each time, `(rows, W, 1)` 1 where a pixel is of it, else 0; None where all are.
    """

    bands: tuple[int, int]
    offset_s: float
    T_world_camera: FloatArray
    K: FloatArray
    rows: slice
    pixel_maps: tuple[PixelMap, ...]
    T_camera_render: FloatArray | None = None
    masks: tuple[NDArray[np.uint8], ...] | None = None


@dataclass(frozen=True, eq=False)
class CapturedFrame:
    """A captured frame and what the truth needs of its capture.

    Attributes:
        image: `(H, W, 3)` light on the sensor; None where no colours were asked for.
        capture: The `FrameCapture`.
        trajectory: Camera poses during the frame.
        readout: How the rows see the geoms.
        T_world_people: `(P, 4, 4)` root poses at mid-exposure of the middle row.
        body_positions: `(nbody, 3)` positions of all bodies at that instant [m].
    """

    image: Image | None
    capture: FrameCapture
    trajectory: CameraTrajectory
    readout: Readout
    T_world_people: FloatArray
    body_positions: FloatArray

    @property
    def T_world_camera(self) -> FloatArray:
        """`(4, 4)` camera pose at mid-exposure of the middle row."""
        return self.trajectory.at(self.capture.shutter.middle_s)


class FrameCapture:
    """Captures the frames of one episode."""

    def __init__(self, model: mujoco.MjModel, lens: Lens, shutter: Shutter, shake: CameraShake) -> None:
        self.lens, self.shutter = lens, shutter
        self.rays = RayGrid(lens)
        self._shake = shake
        self._planner = PassPlanner(model, lens, shutter, self.rays.bands)
        self._scratch = mujoco.MjData(model)
        self._bounds, self._near_m = Bounds(model), clip_depths_m(model)[0]
        self._history = PoseHistory(shutter.window_s)
        self._instant_passes: list[RenderPass] = []

    @cached_property
    def render_size(self) -> tuple[int, int]:
        """Width and height of the rendered images [px]."""
        if self.lens.wide:
            side = 2 * math.ceil(_FACE_HALF * float(max(focal_and_centre(self.lens.K)[:2])))
            return side, side
        low, high = _coordinate_range([self.rays.normalized])
        size = np.array(self.lens.size)
        beyond = (high - low) * focal_and_centre(self.lens.K)[:2] - size
        margin = np.ceil(0.5 * np.maximum(beyond, 0.0)) + (0 if self.shutter.instant else _SHAKE_MARGIN_PX)
        largest = _LARGEST_FISHEYE_RATIO if self.lens.equidistant else _LARGEST_RATIO
        width, height = (int(side) for side in np.minimum(size + 2 * margin, np.ceil(largest * size)))
        return width, height

    def record(
        self, data: mujoco.MjData, time_s: float, T_world_camera: FloatArray, T_world_people: FloatArray
    ) -> None:
        """Record the poses at a camera frame's time stamp. Every frame is recorded in order, captured or not.

        `T_world_camera` is the `(4, 4)` camera pose without camera shake, `T_world_people` `(P, 4, 4)` root poses.
        """
        self._time_s = time_s
        self._history.append(data, time_s, T_world_camera, T_world_people)
        self._scratch.light_xpos[:], self._scratch.light_xdir[:] = data.light_xpos, data.light_xdir

    def capture(self, renderer: Renderer | None) -> CapturedFrame:
        """Render and expose the frame recorded last, with a renderer of the model at `render_size`.

        Without a renderer, the frame serves the truth alone.
        """
        shutter, middle = self.shutter, self.shutter.middle_s
        instants = self._history.instants(shutter.window_s, _POSES_PER_FRAME)
        times = self._time_s + instants
        poses = [self._shake.displace(pose, t) for pose, t in zip(self._history.cameras(instants), times, strict=True)]
        self._trajectory = CameraTrajectory(instants, np.stack(poses))
        readout = self._readout()
        self._row_times = self._find_row_times(readout)
        if shutter.instant:
            plan = PassPlan([0, self.rays.bands], 1, 1)
        else:
            plan = self._planner.plan(self._trajectory, self._history, self.scene_at(middle))
        count = plan.samples * plan.rotations
        accumulator = RadianceAccumulator(count, (self.lens.size[1], self.lens.size[0], 3))
        offsets = shutter.exposure_s * ((np.arange(count) + 0.5) / count - 0.5)
        if renderer is not None:
            for sample_offsets in offsets.reshape(plan.samples, plan.rotations):
                for bands in itertools.pairwise(plan.edges):
                    for render_pass in self._render_passes(bands, sample_offsets):
                        self._draw(render_pass, renderer, accumulator)
        return CapturedFrame(
            accumulator.mean() if renderer is not None else None,
            self,
            self._trajectory,
            readout,
            self._history.people(middle),
            self._history.bodies(middle),
        )

    def _draw(self, render_pass: RenderPass, renderer: Renderer, accumulator: RadianceAccumulator) -> None:
        scene = self.scene_of(render_pass)
        image = renderer.color(scene, render_pass.T_world_camera, render_pass.K, rows=render_pass.rows)
        radiance, rows = accumulator.decode(image), self.rays.rows(*render_pass.bands)
        masks = render_pass.masks or itertools.repeat(None)
        for pixel_map, mask in zip(render_pass.pixel_maps, masks, strict=False):
            light = resample(radiance, pixel_map)
            accumulator.add(rows, light if mask is None else light * mask)

    def scene_of(self, render_pass: RenderPass) -> mujoco.MjData:
        """Scene of a render pass: every moving geom where it is when the middle of its rows in the pass is exposed.

        As the camera travels during the pass, moving geoms are displaced with it horizontally, so that feet stay on the
        ground.
        """
        moving = self._history.moving
        if moving.size == 0 or self.shutter.instant:
            return self.scene_at(0.0)
        first, last = self.shutter.row_s(self.rays.cell_px * np.array(render_pass.bands, dtype=np.float64))
        when = np.clip(self._row_times, first, last).mean(axis=0) + render_pass.offset_s
        self._history.write(self._scratch, when)
        cameras = self._trajectory.positions(when)
        # Points on the ground are displaced by the ray grid's map already.
        rays = self._scratch.geom_xpos[moving] - cameras
        share = 1.0 - np.clip(inverse_ground_range(rays, cameras), 0.0, 1.0)[:, None]
        self._scratch.geom_xpos[moving, :2] += share * (render_pass.T_world_camera[:2, 3] - cameras[:, :2])
        return self._scratch

    def scene_at(self, when_s: float) -> mujoco.MjData:
        """Scene at an instant of the frame."""
        self._history.write(self._scratch, when_s)
        return self._scratch

    @cached_property
    def pixel_rays(self) -> FloatArray:
        """`(H, W, 3)` directions of the centres of the pixels of the camera image, see `Lens.rays`."""
        bands, lens = self.rays.bands, self.lens
        if lens.wide:
            return lens.rays(np.moveaxis(np.indices(lens.size[::-1])[::-1], 0, -1) + 0.5)
        pixels = self.rays.pixel_map(0, bands, self.rays.normalized, lens.K)
        rays = (pixels + (0.5 - lens.K[:2, 2])) / lens.K[(0, 1), (0, 1)]
        return np.concatenate([rays, np.ones((*rays.shape[:2], 1))], axis=-1)

    def _readout(self) -> Readout:
        """How the rows see the geoms in the frame recorded last."""
        trajectory, shutter = self._trajectory, self.shutter
        times_s = trajectory.times_between(_MOST_TURN)
        cameras, poses = trajectory.at(times_s), self._history.poses(times_s)
        poses[..., 3] -= cameras[:, :3, 3, None]
        axes = cameras[:, :3, :3].transpose(0, 2, 1)
        local = (axes @ poses.reshape(len(poses), 3, -1)).reshape(poses.shape)
        timing = shutter.exposure_s, shutter.readout_s
        return Readout(times_s, local, *timing, self.lens.size, self.lens.numbers, self._near_m)

    def _find_row_times(self, readout: Readout) -> FloatArray:
        """`(2, moving)` mid-exposure of the first and of the last row of each moving geom."""
        moving = self._history.moving
        if moving.size == 0 or self.shutter.readout_s == 0.0:
            return np.full((2, moving.size), self.shutter.middle_s)
        corners = self._bounds.corners
        places = np.empty((len(corners), 4))
        place_vertices(moving, corners, self._bounds.corner_starts, readout, places)
        times = places[:, 3].reshape(-1, 8)[moving]
        return np.stack([times.min(axis=1), times.max(axis=1)])

    def _render_passes(self, bands: tuple[int, int], offsets_s: FloatArray) -> list[RenderPass]:
        """Render passes for the light of some bands of rows at offsets from the mid-exposure of each row."""
        if self._instant_passes:
            pose = self._trajectory.poses[0]
            turns = [(one, one.T_camera_render) for one in self._instant_passes]
            return [replace(one, T_world_camera=pose if turn is None else pose @ turn) for one, turn in turns]
        shutter, offset_s = self.shutter, float(offsets_s.mean())
        first, last = bands
        y_px = self.rays.y_px[first : last + 2]
        pose = self._trajectory.at(float(shutter.row_s(0.5 * (y_px[0] + y_px[-1]))) + offset_s)
        when = shutter.row_s(y_px) if shutter.readout_s else np.array(shutter.middle_s)
        rays = [self.rays.directions(first, last, self._trajectory.at(when + offset), pose) for offset in offsets_s]
        passes = (self._faces if self.lens.wide else self._pinhole)(bands, offset_s, pose, rays)
        if shutter.instant:
            self._instant_passes = passes
        return passes

    def _pinhole(
        self, bands: tuple[int, int], offset_s: float, pose: FloatArray, rays: Sequence[FloatArray]
    ) -> list[RenderPass]:
        """The pass that holds all of some rays at each time."""
        (first, last), grids = bands, [normalized(one) for one in rays]
        K = _fit_camera_matrix(self.lens, grids, self.render_size)
        rows = _rows_used(grids, K, self.render_size[1])
        pixel_maps = tuple(self.rays.pixel_map(first, last, grid, K, rows.start) for grid in grids)
        return [RenderPass(bands, offset_s, pose, K, rows, pixel_maps)]

    def _faces(
        self, bands: tuple[int, int], offset_s: float, pose: FloatArray, rays: Sequence[FloatArray]
    ) -> list[RenderPass]:
        """A pass for each face of a cube that some rays meet at some time."""
        (first, last), size = bands, self.render_size
        owners = [(self.rays.interpolated(first, last, one) @ _FACES[:, :, 2].T).argmax(axis=-1) for one in rays]
        K, passes = np.diag([0.5 * size[0] / _FACE_HALF, 0.5 * size[1] / _FACE_HALF, 1.0]), list[RenderPass]()
        K[:2, 2] = 0.5 * np.array(size)
        for face, turn in enumerate(_FACES):
            masks = tuple((owner == face).astype(np.uint8)[..., None] for owner in owners)
            if not any(mask.any() for mask in masks):
                continue
            turned = [one @ turn for one in rays]
            ahead = [np.maximum(one[..., 2:], _LEAST_AHEAD) for one in turned]
            grids = [one[..., :2] / depth for one, depth in zip(turned, ahead, strict=True)]
            maps = [self.rays.pixel_map(first, last, grid, K) for grid in grids]
            used = np.concatenate([one[..., 1][mask[..., 0] > 0] for one, mask in zip(maps, masks, strict=True)])
            top, bottom = max(math.floor(used.min()) - 1, 0), min(math.ceil(used.max()) + 2, size[1])
            T_camera_render = np.eye(4)
            T_camera_render[:3, :3] = turn
            maps = tuple(one - np.array([0, top], dtype=np.float32) for one in maps)
            rows, turned_pose = slice(top, bottom), pose @ T_camera_render
            passes.append(RenderPass(bands, offset_s, turned_pose, K, rows, maps, T_camera_render, masks))
        return passes


def is_instantaneous(settings: ResolvedScenario) -> bool:
    """Whether each frame of a scenario is taken at an instant through a pinhole."""
    axes = settings.axes
    instant = axes.blur.physical == 0.0 and axes.rolling_shutter.physical == 0.0
    return instant and not distorts(settings.distortion)


def make_frame_capture(settings: ResolvedScenario, model: mujoco.MjModel, shake: CameraShake) -> FrameCapture | None:
    """Frame capture of a scenario; None where each frame is taken at an instant through a pinhole.

    Raises:
        ScenarioError: The lens is not invertible over the image.
    """
    axes = settings.axes
    shutter = Shutter(1e-3 * axes.blur.physical, 1e-3 * axes.rolling_shutter.physical, settings.camera.height_px)
    return None if is_instantaneous(settings) else FrameCapture(model, lens_of(settings), shutter, shake)


def lens_of(settings: ResolvedScenario) -> Lens:
    """The lens of a scenario's camera.

    Raises:
        ScenarioError: It is not invertible over the image.
    """
    camera = settings.camera
    try:
        return Lens(camera.K, settings.distortion, (camera.width_px, camera.height_px))
    except ParameterError as error:
        key = "axes.distortion" if camera.calibrated is None else "camera.calibrated with axes.distortion"
        key = "camera.calibrated" if len(settings.distortion) == 4 else key
        raise ScenarioError(repr(settings.title), [f"{key}: {error}"]) from None


def _coordinate_range(grids: Sequence[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """`(2,)` smallest and largest normalized coordinates of `(rows, columns, 2)` grids, found on their borders."""
    border = np.concatenate([side for grid in grids for side in (grid[0], grid[-1], grid[:, 0], grid[:, -1])])
    return border.min(axis=0), border.max(axis=0)


def _rows_used(grids: Sequence[FloatArray], K: FloatArray, height_px: int) -> slice:
    """Rows of a rendered image that grids of normalized coordinates use, with a margin of two."""
    _, fy, _, cy = focal_and_centre(K)
    low = min(float(grid[..., 1].min()) for grid in grids) * fy + cy
    high = max(float(grid[..., 1].max()) for grid in grids) * fy + cy
    return slice(min(max(math.floor(low) - 2, 0), height_px - 1), max(min(math.ceil(high) + 2, height_px), 1))


def _fit_camera_matrix(lens: Lens, grids: Sequence[FloatArray], size: tuple[int, int]) -> FloatArray:
    """`(3, 3)` camera matrix of a rendered image that contains some rays, at the scale of the lens or smaller.

    The rays are `(rows, columns, 2)` grids of normalized coordinates; `size` is the rendered image's width and height
    [px].
    """
    low, high = _coordinate_range(grids)
    size_px = np.array(size)
    focal = np.array(focal_and_centre(lens.K)[:2])
    scale = min(1.0, float((size_px / ((high - low) * focal)).min()))
    centre = 0.5 * size_px - 0.5 * scale * focal * (low + high)
    if scale == 1.0:
        # On the pixel grid of the image, so that pixels without distortion are not interpolated.
        principal_point = lens.K[:2, 2]
        centre = principal_point + np.round(centre - principal_point)
    K = np.eye(3)
    K[0, 0], K[1, 1] = scale * focal
    K[:2, 2] = centre
    return K
