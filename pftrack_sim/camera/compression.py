"""Compression of frames on their way to the tracker."""

from __future__ import annotations

import cv2
import numpy as np

from pftrack_sim.core.errors import RenderError
from pftrack_sim.core.records import Image


def compressed(image: Image, quality: int) -> Image:
    """The frame as it comes out of a JPEG, colours at half the resolution.

    Args:
        image: `(H, W, 3)` uint8 RGB.
        quality: 1 to 100.

    Returns:
        `(H, W, 3)` uint8, a new array.

    Raises:
        RenderError: OpenCV was built without JPEG.
    """
    done, coded = cv2.imencode(".jpg", cv2.cvtColor(image, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, quality])
    if not done:
        raise RenderError("OpenCV cannot write JPEG: reinstall opencv-python-headless")
    return np.asarray(cv2.imdecode(coded, cv2.IMREAD_COLOR_RGB), dtype=np.uint8)
