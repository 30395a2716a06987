"""Boxes and silhouettes of people in captured frames, with lens distortion, exposure and rolling shutter.

Outline points of each part are followed through the frame: their image positions at some instants, the instant at which
each lies on the row that is exposed, and the position at that instant. Silhouettes come from the render passes of the
image and are remapped by the same maps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pftrack_sim.camera.distortion import Lens
from pftrack_sim.camera.pinhole import normalized_coordinates
from pftrack_sim.camera.shutter import interpolate_pixels, solve_row_times
from pftrack_sim.core.types import FloatArray, IntArray
from pftrack_sim.render.capture.frame_capture import CapturedFrame, RenderPass
from pftrack_sim.render.culling import View
from pftrack_sim.truth.silhouettes import PeopleInView, Silhouette, SilhouetteFinder, pixels_around, poses_of

_SWEEP_INSTANTS = 5  # Instants of each point's exposure whose extent is the swept box
_MARGIN_PX = 3  # Pixels around a box that may belong to the person: rounding, and the error of bands

_BORDER_POINTS = 24
# Finer pixels along an edge of a pixel, in which silhouettes are found: everybody's, those partly hidden, and that of a
# target of which fewer than so many pixels are visible.
_FINER = (1, 3, 9)
_LITTLE_PX = 200


@dataclass(frozen=True, eq=False)
class Projection:
    """All people in a frame, and further bodies of which only boxes are wanted.

    Attributes:
        amodal_boxes: `(B, 4)` [px]; NaN for those behind the camera.
        swept_boxes: `(B, 4)` boxes over the whole exposure [px].
        silhouettes: By person, of those who may have pixels in the image.
    """

    amodal_boxes: FloatArray
    swept_boxes: FloatArray
    silhouettes: dict[int, Silhouette]


def project_people(captured: CapturedFrame, finder: SilhouetteFinder) -> Projection:
    """Project all people into a captured frame."""
    amodal, swept = _boxes(captured, finder)
    silhouettes: dict[int, Silhouette] = {}
    for person, box in enumerate(amodal[: finder.people_count]):
        rect = pixels_around(box, captured.capture.lens.size, _MARGIN_PX)
        if rect is not None:
            shape = rect.height, rect.width
            masks = np.zeros(shape, dtype=np.bool_), np.zeros(shape, dtype=np.bool_)
            silhouettes[person] = Silhouette(rect, *masks, np.full(shape, -1, dtype=np.int32))
    for render_pass in captured.mid_exposure_passes() if silhouettes else ():
        _remap(captured, render_pass, finder, silhouettes)
    return Projection(amodal, swept, silhouettes)


def _boxes(captured: CapturedFrame, finder: SilhouetteFinder) -> tuple[FloatArray, FloatArray]:
    """`(B, 4)` amodal and `(B, 4)` swept boxes [px]."""
    capture, trajectory, pose = captured.capture, captured.trajectory, captured.T_world_camera
    lens, shutter, near_m = capture.lens, capture.shutter, finder.segmenter.near_m
    middle_poses = poses_of(capture.scene_at(shutter.middle_s), finder.geoms)
    pinhole_boxes, depths, _ = finder.bodies.boxes(*middle_poses, pose, lens.K, near_m)
    amodal = np.full((len(pinhole_boxes), 4), np.nan)
    swept = amodal.copy()
    ahead = np.isfinite(pinhole_boxes).all(axis=1)
    if not ahead.any():
        return amodal, swept
    counts = np.diff(np.append(finder.bodies.starts, len(finder.geoms)))
    wanted, starts = np.repeat(ahead, counts), np.concatenate([[0], np.cumsum(counts[ahead])[:-1]]).astype(np.intp)
    points = finder.bodies.outlines(*middle_poses, pose, near_m, wanted)

    def world_points(positions: FloatArray, rotations: FloatArray) -> FloatArray:
        return points @ rotations[wanted].transpose(0, 2, 1) + positions[wanted, None]

    def pixels_at(when_s: float, camera: FloatArray) -> FloatArray:
        places = world_points(*poses_of(capture.scene_at(when_s), finder.geoms))
        return lens.to_pixels(normalized_coordinates(places, camera, near_m))

    pixels = np.stack([pixels_at(*sample) for sample in trajectory.samples()])
    sample_times = trajectory.sample_times_s
    row_times = solve_row_times(shutter, sample_times, pixels)
    # The extent of the points falls short of the outline. By how much is known exactly through a pinhole.
    pinhole_points = normalized_coordinates(world_points(*middle_poses), pose, near_m)
    exact = np.concatenate([pinhole_boxes[:, :2], pinhole_boxes[:, :2] + pinhole_boxes[:, 2:]], axis=1)
    missing = exact[ahead] - _extents(pinhole_points * lens.K[(0, 1), (0, 1)] + lens.K[:2, 2], starts)
    swept[ahead] = amodal[ahead] = _extents(interpolate_pixels(sample_times, pixels, row_times), starts) + missing
    if shutter.exposure_s:
        for offset in np.linspace(-0.5, 0.5, _SWEEP_INSTANTS) * shutter.exposure_s:
            extents = _extents(interpolate_pixels(sample_times, pixels, row_times + offset), starts) + missing
            swept[ahead, :2] = np.minimum(swept[ahead, :2], extents[:, :2])
            swept[ahead, 2:] = np.maximum(swept[ahead, 2:], extents[:, 2:])
    for person in np.flatnonzero((depths[:, 0] < near_m) & ahead):
        # Cut by the near plane: the box of the remaining part is known through a pinhole.
        amodal[person] = swept[person] = _distorted_extent(lens, exact[person])
    for extents in (amodal, swept):
        extents[:, 2:] -= extents[:, :2]
    return amodal, swept


def _extents(points: FloatArray, starts: IntArray) -> FloatArray:
    """`(B, 4)` left, top, right, bottom of bodies from `(S, N, 2)` points of their parts, ignoring NaN."""
    coordinates = np.ascontiguousarray(np.moveaxis(points, -1, 0))
    low, high = np.fmin.reduce(coordinates, axis=-1).T, np.fmax.reduce(coordinates, axis=-1).T
    return np.concatenate([np.fmin.reduceat(low, starts), np.fmax.reduceat(high, starts)], axis=1)


def _distorted_extent(lens: Lens, rectangle: FloatArray) -> FloatArray:
    """`(4,)` extent through the lens of a rectangle (left, top, right, bottom) in the pinhole image."""
    share = np.linspace(0.0, 1.0, _BORDER_POINTS)
    left, top, right, bottom = rectangle
    x, y = left + share * (right - left), top + share * (bottom - top)
    sides = [(x, top), (x, bottom), (left, y), (right, y)]
    border = np.concatenate([np.stack(np.broadcast_arrays(*side), axis=-1) for side in sides])
    pixels = lens.to_pixels((border - lens.K[:2, 2]) / lens.K[(0, 1), (0, 1)])
    return np.concatenate([pixels.min(axis=0), pixels.max(axis=0)])


def _remap(
    captured: CapturedFrame, render_pass: RenderPass, finder: SilhouetteFinder, silhouettes: dict[int, Silhouette]
) -> None:
    """Fill the rows of the silhouettes that a render pass serves."""
    capture = captured.capture
    rows = capture.rays.rows(*render_pass.bands)
    spans: dict[int, tuple[int, int]] = {}
    for person, silhouette in silhouettes.items():
        top, bottom = silhouette.rect.top, silhouette.rect.top + silhouette.rect.height
        if top < rows.stop and rows.start < bottom:
            spans[person] = max(rows.start, top), min(rows.stop, bottom)
    if not spans:
        return
    scene = capture.scene_of(render_pass)
    pose = scene.geom_xpos, scene.geom_xmat, render_pass.T_world_camera, render_pass.K
    view = PeopleInView(finder, View(*pose, finder.segmenter.near_m), capture.render_size)
    (pixel_map,) = render_pass.pixel_maps
    for person, (top, bottom) in spans.items():
        target = silhouettes[person]
        span = slice(top - target.rect.top, bottom - target.rect.top)
        columns = slice(target.rect.left, target.rect.left + target.rect.width)
        # Of a sliver beside an occluder, the nearest pixel of the rendered image may show what is beside it.
        for finer in _FINER:
            source = view.silhouette(person, finer)
            if source is None:
                break
            places = pixel_map[top - rows.start : bottom - rows.start, columns] + (0.0, render_pass.rows.start)
            nearest = np.floor(finer * (places + 0.5)).astype(np.intp)
            x, y = nearest[..., 0] - source.rect.left, nearest[..., 1] - source.rect.top
            inside = (x >= 0) & (x < source.rect.width) & (y >= 0) & (y < source.rect.height)
            x, y = np.where(inside, x, 0), np.where(inside, y, 0)
            target.amodal[span] = inside & source.amodal[y, x]
            target.visible[span] = inside & source.visible[y, x]
            target.top[span] = source.top[y, x]
            seen, whole = np.count_nonzero(target.visible[span]), np.count_nonzero(target.amodal[span])
            if not 0 < seen < whole or (finer > 1 and (person or seen >= _LITTLE_PX)):
                break
