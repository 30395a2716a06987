"""People in captured frames, with lens distortion, exposure and rolling shutter: row by row, along the pixels' rays."""

from __future__ import annotations

import numpy as np

from pftrack_sim.camera.distortion import Lens
from pftrack_sim.camera.extents import Bodies
from pftrack_sim.core.types import FloatArray, IntArray
from pftrack_sim.render.capture.frame_capture import CapturedFrame
from pftrack_sim.render.culling import Bounds, View
from pftrack_sim.render.row_segmentation import RowSegmenter
from pftrack_sim.render.segmentation import Segmenter
from pftrack_sim.truth.silhouettes import Measured, poses_of

_BORDER_POINTS = 24


class CapturedScene(RowSegmenter):
    """A `Scene` of a captured frame."""

    def __init__(self, segmenter: Segmenter, bounds: Bounds, captured: CapturedFrame) -> None:
        capture = captured.capture
        self._lens = capture.lens
        scene = capture.scene_at(capture.shutter.middle_s)
        poses = scene.geom_xpos.copy(), scene.geom_xmat.copy()
        view = View(*poses, captured.T_world_camera, self._lens.K, segmenter.near_m)
        super().__init__(segmenter, bounds, captured.readout, capture.pixel_rays, view)

    def measure(self, bodies: Bodies, geoms: IntArray) -> Measured:
        """Measure bodies, whose `(S,)` parts are geoms."""
        poses, (pose, K, near_m) = poses_of(self.view, geoms), self.view[2:]
        pinhole, depths, lowest = bodies.boxes(*poses, pose, K, near_m)
        extents = self.extents(geoms)
        boxes, swept = (self._boxes(extents[:, sides], bodies.starts) for sides in (slice(0, 4), slice(4, 8)))
        for found in (boxes, swept):
            found[np.isnan(pinhole[:, 0])] = np.nan
            # Cut by the near plane: the box of the remaining part is known through a pinhole.
            for body in np.flatnonzero((depths[:, 0] < near_m) & (depths[:, 1] >= near_m)):
                found[body] = _through(self._lens, pinhole[body])
        return Measured(boxes, swept, depths, lowest)

    @staticmethod
    def _boxes(extents: FloatArray, starts: IntArray) -> FloatArray:
        """`(B, 4)` boxes of bodies from `(S, 4)` left, top, right, bottom of their parts [px]."""
        low, high = np.minimum.reduceat(extents[:, :2], starts), np.maximum.reduceat(extents[:, 2:], starts)
        return np.concatenate([low, high - low], axis=1)


def _through(lens: Lens, box: FloatArray) -> FloatArray:
    """`(4,)` extent through the lens of a box in the pinhole image [px]."""
    share = np.linspace(0.0, 1.0, _BORDER_POINTS)
    left, top, width, height = box
    x, y = left + share * width, top + share * height
    sides = [(x, top), (x, top + height), (left, y), (left + width, y)]
    border = np.concatenate([np.stack(np.broadcast_arrays(*side), axis=-1) for side in sides])
    pixels = lens.to_pixels((border - lens.K[:2, 2]) / lens.K[(0, 1), (0, 1)])
    low = pixels.min(axis=0)
    return np.concatenate([low, pixels.max(axis=0) - low])
