"""People in captured frames: which geom each pixel shows, along its own ray, when its own row is exposed.

As `render.segmentation`, but through the lens, and every row sees the geoms where they are, from where the camera is,
at its mid-exposure. Nothing is resampled: a pixel shows a triangle if its ray passes inside the planes through the
camera and the three sides (Olano and Greer, "Triangle scan conversion using 2D homogeneous coordinates", Graphics
Hardware 1997), which needs neither straight rows nor clipping.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.camera.distortion import Lens
from pftrack_sim.camera.extents import Bodies
from pftrack_sim.camera.projection import Readout, Triangles, bound_triangles, place_vertices
from pftrack_sim.core.compiled import kernel, part_of_kernel
from pftrack_sim.core.types import BoolArray, FloatArray, IntArray
from pftrack_sim.render.capture.frame_capture import CapturedFrame
from pftrack_sim.render.culling import GROUND_CONTACT_M, Bounds, PixelRect, View
from pftrack_sim.render.segmentation import Segmentation, Segmenter
from pftrack_sim.truth.silhouettes import Measured, Scene, poses_of

_DEPTH_MARGIN_M = 0.1  # A geom that is farther than a person by less may be nearer when another row is exposed
_SHORT_PX = 4  # Columns up to which all are tried
_BEND, _MARGIN_PX = 0.5, 2.0  # How far the image of a box may reach beyond its corners, as a share of its size


class CapturedScene(Scene):
    """A captured frame."""

    def __init__(self, segmenter: Segmenter, bounds: Bounds, captured: CapturedFrame) -> None:
        capture = captured.capture
        self._lens, self._rays = capture.lens, capture.pixel_rays
        scene = capture.scene_at(capture.shutter.middle_s)
        poses = scene.geom_xpos.copy(), scene.geom_xmat.copy()
        super().__init__(segmenter, bounds, View(*poses, captured.T_world_camera, self._lens.K, segmenter.near_m))
        self._readout = captured.readout
        self._placed = _Placed(segmenter.triangles, self._readout)

    def measure(self, bodies: Bodies, geoms: IntArray) -> Measured:
        """See `Scene`."""
        poses, (pose, K, near_m) = poses_of(self.view, geoms), self.view[2:]
        ends = [*bodies.starts[1:], len(geoms)]
        pinhole, depths, lowest = bodies.boxes(*poses, pose, K, near_m)
        extents = self._placed.extents(geoms)
        if self._lens.wide:
            ends_m = (
                np.minimum.reduceat(extents[:, 8], bodies.starts),
                np.maximum.reduceat(extents[:, 9], bodies.starts),
            )
            depths, unseen = np.stack(ends_m, axis=1), ends_m[1] < near_m
        else:
            unseen = np.isnan(pinhole[:, 0])
        boxes, swept = (_boxes(extents[:, sides], bodies.starts) for sides in (slice(0, 4), slice(4, 8)))
        for found in (boxes, swept):
            found[unseen] = np.nan
            for body in np.flatnonzero((not self._lens.wide) & (depths[:, 0] < near_m) & (depths[:, 1] >= near_m)):
                parts = range(bodies.starts[body], ends[body])
                world = [poses[1][part] @ bodies.vertices[part].T + poses[0][part][:, None] for part in parts]
                seen = [(points.T - pose[:3, 3]) @ pose[:3, :3] for points in world]
                found[body] = _cut_box(self._lens, seen, near_m)
        return Measured(boxes, swept, depths, lowest)

    def add(self, found: Segmentation, geoms: IntArray) -> None:
        """See `Scene`."""
        left, top, *_ = found.rect
        shapes, placed = self.segmenter.detail.shapes(self.view, geoms), self._placed
        layers = found.ids, found.inverse_depth
        draw_rows(shapes, placed.triangles, placed.bounds(shapes), self._readout, self._rays, left, top, *layers)

    def may_occlude(self, rect: PixelRect, geoms: IntArray, farthest_m: float, lowest_m: float) -> BoolArray:
        """See `Scene`."""
        left, top, right, bottom, *_, nearest, farthest = self._box_extents[geoms].T
        margin = _BEND * np.maximum(right - left, bottom - top) + _MARGIN_PX
        near_m = self._readout.near_m
        beside = (left - margin > rect.left + rect.width) | (right + margin < rect.left)
        beside |= (top - margin > rect.top + rect.height) | (bottom + margin < rect.top)
        found = (farthest >= near_m) & (nearest <= farthest_m + _DEPTH_MARGIN_M) & ((nearest < near_m) | ~beside)
        # From above, a geom below a person's soles occludes nothing of the person.
        if self.view.T_world_camera[2, 3] > lowest_m:
            found &= self._tops_m[geoms] > lowest_m + GROUND_CONTACT_M
        return self._bounds.unbounded[geoms] | found

    @cached_property
    def _box_extents(self) -> FloatArray:
        """`(ngeom, 10)` extents of the bounding boxes of all geoms."""
        geoms = np.arange(len(self._bounds.unbounded))
        corners, starts = self._bounds.corners, self._bounds.corner_starts
        return place_vertices(geoms, corners, starts, self._readout, np.empty((len(corners), 4)))

    @cached_property
    def _tops_m(self) -> FloatArray:
        """`(ngeom,)` height of the highest point of all bounding boxes."""
        up = self.view.geom_xmat.reshape(-1, 3, 3)[:, 2]
        reach = np.einsum("ni,ni->n", up, self._bounds.middles) + np.einsum("ni,ni->n", np.abs(up), self._bounds.halves)
        return self.view.geom_xpos[:, 2] + reach


def _boxes(extents: FloatArray, starts: IntArray) -> FloatArray:
    """`(B, 4)` boxes of bodies from `(S, 4)` left, top, right, bottom of their parts [px]."""
    low, high = np.minimum.reduceat(extents[:, :2], starts), np.maximum.reduceat(extents[:, 2:], starts)
    return np.concatenate([low, high - low], axis=1)


def _cut_box(lens: Lens, parts: Sequence[FloatArray], near_m: float) -> FloatArray:
    """`(4,)` extent through the lens [px] of what is beyond the near plane of hulls of `(V, 3)` points in its axes."""
    points: list[FloatArray] = []
    for part in parts:
        ahead, behind = part[part[:, 2] >= near_m], part[part[:, 2] < near_m]
        share = (ahead[:, None, 2] - near_m) / (ahead[:, None, 2] - behind[:, 2])
        points += [ahead, (ahead[:, None] + share[..., None] * (behind - ahead[:, None])).reshape(-1, 3)]
    local = np.concatenate(points)
    pixels = lens.to_pixels(local[:, :2] / local[:, 2:])
    low = pixels.min(axis=0)
    return np.concatenate([low, pixels.max(axis=0) - low])


class _Placed:
    """Vertices and triangles of shapes in one frame, placed when they are first asked for; see `Detail`."""

    def __init__(self, triangles: Triangles, readout: Readout) -> None:
        self.triangles, self._readout = triangles, readout
        shapes = len(triangles.vertex_starts) - 1
        self._extents = np.empty((shapes, 10))
        self._places = np.empty((len(triangles.vertices), 4))
        self._bounds = np.empty((len(triangles.faces), 4), dtype=np.int32)
        self._is_placed, self._is_bound = np.zeros(shapes, dtype=np.bool_), np.zeros(shapes, dtype=np.bool_)

    def extents(self, shapes: IntArray) -> FloatArray:
        """`(N, 10)` extents of shapes."""
        new = shapes[~self._is_placed[shapes]]
        self._extents[new] = place_vertices(
            new, self.triangles.vertices, self.triangles.vertex_starts, self._readout, self._places
        )
        self._is_placed[new] = True
        return self._extents[shapes]

    def bounds(self, shapes: IntArray) -> NDArray[np.int32]:
        """`(F, 4)` bounds of all triangles, filled for some shapes."""
        self.extents(shapes)
        new = shapes[~self._is_bound[shapes]]
        bound_triangles(new, self.triangles, self._readout, self._places, self._bounds)
        self._is_bound[new] = True
        return self._bounds


@kernel
def draw_rows(
    shapes: IntArray,
    triangles: Triangles,
    bounds: NDArray[np.int32],
    readout: Readout,
    rays: FloatArray,
    left: int,
    top: int,
    ids: NDArray[np.int32],
    inverse_depth: NDArray[np.float32],
) -> None:
    """Draw geoms into `(h, w)` ids and inverse depths [1/m], whose first pixel is at `left`, `top` of the image.

    A triangle that faces away has no pixels. `(N,)` shapes are those of `Detail`, `(F, 4)` bounds of their triangles
    those of `bound_triangles`, and `(H, W, 3)` rays the directions of the pixels' centres.
    """
    height, width = ids.shape
    vertices, faces, vertex_starts, face_starts = triangles
    poses, known = np.empty((height, 3, 4)), np.empty(height, dtype=np.bool_)
    corners, sides = np.empty((3, 3)), np.empty((3, 3))
    for shape in shapes:
        geom = shape % readout.poses.shape[2]
        known[:] = False
        for face in range(face_starts[shape], face_starts[shape + 1]):
            low, high = max(bounds[face, 0] - left, 0), min(bounds[face, 2] - left, width)
            if low >= high:
                continue
            for row in range(max(bounds[face, 1] - top, 0), min(bounds[face, 3] - top, height)):
                if not known[row]:
                    known[row] = True
                    _pose(geom, top + row, readout, poses, row)
                for corner in range(3):
                    vertex = vertex_starts[shape] + faces[face, corner]
                    x, y, z = vertices[vertex, 0], vertices[vertex, 1], vertices[vertex, 2]
                    for axis in range(3):
                        turned = poses[row, axis, 0] * x + poses[row, axis, 1] * y + poses[row, axis, 2] * z
                        corners[corner, axis] = turned + poses[row, axis, 3]
                # Normals of the planes through the camera and each side, inwards if the triangle faces the camera.
                for side in range(3):
                    one, two = (side + 2) % 3, (side + 1) % 3
                    for axis in range(3):
                        here, after = (axis + 1) % 3, (axis + 2) % 3
                        sides[side, axis] = (
                            corners[one, here] * corners[two, after] - corners[one, after] * corners[two, here]
                        )
                volume = corners[0, 0] * sides[0, 0] + corners[0, 1] * sides[0, 1] + corners[0, 2] * sides[0, 2]
                if not volume > 0.0:
                    continue
                here, after = _span(sides, rays, top + row, left + low, left + high)
                for column in range(here - left, after - left):
                    x, y, z = rays[top + row, left + column]
                    a = sides[0, 0] * x + sides[0, 1] * y + sides[0, 2] * z
                    b = sides[1, 0] * x + sides[1, 1] * y + sides[1, 2] * z
                    c = sides[2, 0] * x + sides[2, 1] * y + sides[2, 2] * z
                    if a < 0.0 or b < 0.0 or c < 0.0:
                        continue
                    inverse = (a + b + c) / volume
                    single, present = np.float32(inverse), inverse_depth[row, column]
                    in_front = single > present or (single == present and geom > ids[row, column])
                    if in_front and inverse * readout.near_m <= 1.0:
                        inverse_depth[row, column] = single
                        ids[row, column] = geom


@part_of_kernel
def _span(sides: FloatArray, rays: FloatArray, row: int, low: int, high: int) -> tuple[int, int]:
    """First and one past the last of the columns of a row that may lie inside three planes.

    Along a row, the rays bend by about twice as much, at most, as at its quarters.
    """
    last = high - 1
    if last - low < _SHORT_PX:
        return low, high
    bend_x = bend_y = bend_z = 0.0
    for quarter in range(1, 4):
        column = low + quarter * (last - low) // 4
        share = (column - low) / (last - low)
        bend_x = max(bend_x, abs(rays[row, column, 0] - (1.0 - share) * rays[row, low, 0] - share * rays[row, last, 0]))
        bend_y = max(bend_y, abs(rays[row, column, 1] - (1.0 - share) * rays[row, low, 1] - share * rays[row, last, 1]))
        # Of rays with 1 along the axis it is rounding alone.
        bend_z = max(bend_z, abs(rays[row, column, 2] - (1.0 - share) * rays[row, low, 2] - share * rays[row, last, 2]))
    first, end = low, high
    for side in range(3):
        across, down, ahead = sides[side, 0], sides[side, 1], sides[side, 2]
        slack = 2.0 * (abs(across) * bend_x + abs(down) * bend_y + abs(ahead) * bend_z)
        before = across * rays[row, low, 0] + down * rays[row, low, 1] + ahead * rays[row, low, 2] + slack
        behind = across * rays[row, last, 0] + down * rays[row, last, 1] + ahead * rays[row, last, 2] + slack
        if before < 0.0 and behind < 0.0:
            return low, low
        if before < 0.0:
            first = max(first, low + int((last - low) * before / (before - behind)))
        elif behind < 0.0:
            end = min(end, low + int((last - low) * before / (before - behind)) + 2)
    return first, end


@part_of_kernel
def _pose(geom: int, image_row: int, readout: Readout, poses: FloatArray, row: int) -> None:
    """Fill a `(3, 4)` pose of a geom in the camera's axes at mid-exposure of a row of the image."""
    last = len(readout.times_s) - 1
    index, share = 0, 0.0
    if last:
        first_s = -0.5 * readout.exposure_s - readout.readout_s
        when_s = first_s + readout.readout_s * (image_row + 0.5) / readout.size[1]
        while index < last - 1 and readout.times_s[index + 1] <= when_s:
            index += 1
        share = (when_s - readout.times_s[index]) / (readout.times_s[index + 1] - readout.times_s[index])
    after = min(index + 1, last)
    for axis in range(3):
        for column in range(4):
            one, two = readout.poses[index, axis, geom, column], readout.poses[after, axis, geom, column]
            poses[row, axis, column] = (1.0 - share) * one + share * two
