"""Distance transform of the edge image: an image of shape that changes smoothly where edges move a little."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.records import Image

_CHAMFER_PX = 3  # Mask of OpenCV's approximation of the Euclidean distance


def edge_distances(image: Image, thresholds: tuple[float, float], cap_px: float) -> NDArray[np.uint8]:
    """`(H, W)` distance of every pixel to the nearest edge, 0 on edges and 255 from `cap_px` on.

    Edges are those of Canny's detector on the grey image (ITU-R BT.601) with the lower and upper of the two thresholds.
    Beyond the cap all pixels count as equally far, so that one lost or new edge does not change a whole region.
    """
    grey = np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
    edges = np.asarray(cv2.Canny(grey, *thresholds), dtype=np.uint8)
    distances = cv2.distanceTransform(255 - edges, cv2.DIST_L2, _CHAMFER_PX)
    return np.asarray(cv2.convertScaleAbs(np.minimum(distances, cap_px), alpha=255.0 / cap_px), dtype=np.uint8)
