"""Truth of a frame that is no instant through a pinhole: every point of a body is sent its own way.

The outline of each part is followed through the frame: where its points are at some instants, when each meets the row
that is exposed just then, and where that is in the image. The pixels of a person come from the drawings that the
picture comes from, fetched by the same map.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.camera.distortion import Lens
from pftrack_sim.camera.extents import Bodies
from pftrack_sim.camera.outlines import Outlines
from pftrack_sim.camera.pinhole import normalized_coordinates
from pftrack_sim.camera.shutter import interpolate_pixels, solve_row_times
from pftrack_sim.render.backend import PixelRect, Renderer
from pftrack_sim.render.capture.frame_capture import CapturedFrame
from pftrack_sim.render.capture.render_pass import RenderPass
from pftrack_sim.truth.silhouettes import Silhouette, Silhouettes, pixels_around

Array = NDArray[np.float64]

_SWEEPS = 5
"""Instants of each point's exposure that a swept box is the extent of."""

_MARGIN_PX = 3
"""Pixels around a box in which a person's pixels are looked for: rounding, and what bands leave."""

_BORDER_POINTS = 24


@dataclass(frozen=True, eq=False)
class Traced:
    """What a frame shows of everybody.

    Attributes:
        amodal: `(P, 4)` boxes of everybody's whole outline [px]; NaN for those behind the camera.
        swept: `(P, 4)` the same over the whole exposure.
        found: By person, those with pixels that may be in the image.
    """

    amodal: Array
    swept: Array
    found: dict[int, Silhouette]


def trace(
    taken: CapturedFrame,
    renderer: Renderer,
    bodies: Bodies,
    outlines: Outlines,
    geoms: NDArray[np.intp],
    silhouettes: Silhouettes,
) -> Traced:
    """Find everybody in a frame.

    Args:
        taken: The frame.
        renderer: What it was drawn with.
        bodies: Shapes of the people.
        outlines: Of the same parts.
        geoms: Geom ids of the parts.
        silhouettes: Finds pixels on a drawing.
    """
    amodal, swept = _boxes(taken, bodies, outlines, geoms, renderer.near_m)
    size = taken.capture.lens.size
    wanted = {
        person: rect for person, box in enumerate(amodal) if (rect := pixels_around(box, size, _MARGIN_PX)) is not None
    }
    found = {
        person: Silhouette(
            rect,
            np.zeros((rect.height, rect.width), dtype=np.bool_),
            np.zeros((rect.height, rect.width), dtype=np.bool_),
            np.full((rect.height, rect.width), -1, dtype=np.int32),
        )
        for person, rect in wanted.items()
    }
    for drawing in taken.mid_exposure_passes() if found else ():
        _fetch(taken, drawing, renderer, bodies, geoms, silhouettes, found)
    return Traced(amodal, swept, found)


def _boxes(
    taken: CapturedFrame, bodies: Bodies, outlines: Outlines, geoms: NDArray[np.intp], near_m: float
) -> tuple[Array, Array]:
    """`(P, 4)` amodal and `(P, 4)` swept boxes [px]."""
    lens, shutter, flight = taken.capture.lens, taken.capture.shutter, taken.trajectory
    limbs = _limbs(taken, geoms, shutter.middle_s)
    straight, depths = bodies.boxes(*limbs, taken.T_world_camera, lens.K, near_m)
    amodal = np.full((len(straight), 4), np.nan)
    swept = amodal.copy()
    ahead = np.isfinite(straight).all(axis=1)
    if not ahead.any():
        return amodal, swept
    counts = np.diff(np.append(bodies.starts, len(geoms)))
    wanted, starts = np.repeat(ahead, counts), np.concatenate([[0], np.cumsum(counts[ahead])[:-1]]).astype(np.intp)
    points = outlines.find(*limbs, taken.T_world_camera, near_m, wanted)
    own = geoms[wanted]
    seen: list[Array] = []
    for when, pose in flight.samples():
        world = _placed(points, *_limbs(taken, own, when))
        seen.append(lens.to_pixels(normalized_coordinates(world, pose, near_m)))
    track = np.stack(seen)
    when = solve_row_times(shutter, flight.sample_times_s, track)
    # What the points miss of the outline is known through a pinhole, and nearly the same here.
    world = _placed(points, *_limbs(taken, own, shutter.middle_s))
    plain = normalized_coordinates(world, taken.T_world_camera, near_m) * lens.K[(0, 1), (0, 1)] + lens.K[:2, 2]
    exact = np.concatenate([straight[:, :2], straight[:, :2] + straight[:, 2:]], axis=1)
    missed = exact[ahead] - _extent(plain, starts)
    swept[ahead] = amodal[ahead] = _extent(interpolate_pixels(flight.sample_times_s, track, when), starts) + missed
    if shutter.exposure_s:
        for offset in np.linspace(-0.5, 0.5, _SWEEPS) * shutter.exposure_s:
            there = _extent(interpolate_pixels(flight.sample_times_s, track, when + offset), starts) + missed
            swept[ahead, :2] = np.minimum(swept[ahead, :2], there[:, :2])
            swept[ahead, 2:] = np.maximum(swept[ahead, 2:], there[:, 2:])
    for person in np.flatnonzero((depths[:, 0] < near_m) & ahead):
        # The near plane cuts the body: its outline is that of the cut, whose box is known through a pinhole.
        amodal[person] = swept[person] = _through(lens, exact[person])
    return _as_boxes(amodal), _as_boxes(swept)


def _limbs(taken: CapturedFrame, geoms: NDArray[np.intp], when_s: float) -> tuple[Array, Array]:
    data = taken.capture.scene_at(when_s)
    return data.geom_xpos[geoms], data.geom_xmat[geoms].reshape(-1, 3, 3)


def _placed(points: Array, positions: Array, rotations: Array) -> Array:
    """`(S, N, 3)` points of parts in the world."""
    return points @ rotations.transpose(0, 2, 1) + positions[:, None]


def _extent(points: Array, starts: NDArray[np.intp]) -> Array:
    """`(B, 4)` left, top, right, bottom of bodies, from `(S, N, 2)` points of their parts; NaN without any."""
    across = np.ascontiguousarray(np.moveaxis(points, -1, 0))
    low, high = np.fmin.reduce(across, axis=-1).T, np.fmax.reduce(across, axis=-1).T
    return np.concatenate([np.fmin.reduceat(low, starts), np.fmax.reduceat(high, starts)], axis=1)


def _through(lens: Lens, corners: Array) -> Array:
    """Extent of a rectangle of the pinhole's image, through the lens."""
    share = np.linspace(0.0, 1.0, _BORDER_POINTS)
    x, y = corners[0] + share * (corners[2] - corners[0]), corners[1] + share * (corners[3] - corners[1])
    border = np.concatenate(
        [
            np.stack(np.broadcast_arrays(*side), axis=-1)
            for side in ((x, corners[1]), (x, corners[3]), (corners[0], y), (corners[2], y))
        ]
    )
    seen = lens.to_pixels((border - lens.K[:2, 2]) / lens.K[(0, 1), (0, 1)])
    return np.concatenate([seen.min(axis=0), seen.max(axis=0)])


def _as_boxes(extents: Array) -> Array:
    return np.concatenate([extents[:, :2], extents[:, 2:] - extents[:, :2]], axis=1)


def _fetch(
    taken: CapturedFrame,
    drawing: RenderPass,
    renderer: Renderer,
    bodies: Bodies,
    geoms: NDArray[np.intp],
    silhouettes: Silhouettes,
    found: dict[int, Silhouette],
) -> None:
    """Fill in the rows of the silhouettes that a drawing serves."""
    rows = taken.capture.rays.rows(*drawing.bands)
    here = {
        person: (max(rows.start, one.rect.top), min(rows.stop, one.rect.top + one.rect.height))
        for person, one in found.items()
        if one.rect.top < rows.stop and rows.start < one.rect.top + one.rect.height
    }
    if not here:
        return
    data, drawn_px = taken.capture.scene_of(drawing), (renderer.width_px, renderer.height_px)
    limbs = data.geom_xpos[geoms], data.geom_xmat[geoms].reshape(-1, 3, 3)
    boxes, depths = bodies.boxes(*limbs, drawing.T_world_camera, drawing.K, renderer.near_m)
    rects: dict[int, PixelRect] = {}
    for person in here:
        rect = pixels_around(boxes[person], drawn_px)
        if rect is not None:
            rects[person] = rect
    lowest = bodies.lowest(*limbs)
    drawn = silhouettes.find(renderer, data, drawing.T_world_camera, drawing.K, rects, depths[:, 1], lowest)
    (places,) = drawing.pixel_maps
    for person, source in drawn.items():
        (top, bottom), own = here[person], found[person]
        columns = slice(own.rect.left, own.rect.left + own.rect.width)
        nearest = np.rint(places[top - rows.start : bottom - rows.start, columns]).astype(np.intp)
        x, y = nearest[..., 0] - source.rect.left, nearest[..., 1] + drawing.rows.start - source.rect.top
        inside = (x >= 0) & (x < source.rect.width) & (y >= 0) & (y < source.rect.height)
        x, y = np.where(inside, x, 0), np.where(inside, y, 0)
        target = slice(top - own.rect.top, bottom - own.rect.top)
        own.amodal[target] = inside & source.amodal[y, x]
        own.visible[target] = inside & source.visible[y, x]
        own.top[target] = source.top[y, x]
