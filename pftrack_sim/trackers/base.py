"""What every tracker demands of its input, said once and with its own clear error."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.core import boxes
from pftrack_sim.core.boxes import Box
from pftrack_sim.core.errors import BoxError, ImageError, TrackerError
from pftrack_sim.core.records import Estimate, Image


class BaseTracker(ABC):
    """A tracker that checks its input before the method sees it.

    A method implements `_start`, which must forget everything from before, and `_follow`. Both get an image that is
    `(H, W, 3)` uint8, contiguous, and not to be written to.
    """

    def __init__(self) -> None:
        self._shape: tuple[int, ...] | None = None

    def init(self, image: Image, box: ArrayLike) -> None:
        """Start on an image; everything from before is forgotten. Refused input leaves the tracker as it was.

        Args:
            image: `(H, W, 3)` uint8 RGB.
            box: `(4,)` the target's box [px]. It may be partly outside the image, but not wholly.

        Raises:
            ImageError: The image is not `(H, W, 3)` uint8.
            BoxError: The box is NaN, has no area, or lies wholly outside the image.
        """
        pixels = checked_image(image)
        start = checked_start(box, pixels)
        self._start(pixels, start)
        self._shape = pixels.shape

    def update(self, image: Image) -> Estimate:
        """Say where the target is in the next image.

        Args:
            image: `(H, W, 3)` uint8 RGB, of the size given to `init`.

        Raises:
            TrackerError: `init` was not called.
            ImageError: The image is not `(H, W, 3)` uint8, or its size changed.
        """
        if self._shape is None:
            raise TrackerError("update was called before init: a tracker must be given the first box")
        pixels = checked_image(image)
        if pixels.shape != self._shape:
            then, now = (f"{shape[1]}x{shape[0]}" for shape in (self._shape, pixels.shape))
            raise ImageError(f"the image changed its size within a sequence: from {then} to {now} (width x height)")
        return self._follow(pixels)

    @abstractmethod
    def _start(self, image: Image, box: Box) -> None: ...

    @abstractmethod
    def _follow(self, image: Image) -> Estimate: ...


def checked_image(image: object) -> NDArray[np.uint8]:
    """The image, contiguous, if it is one.

    Args:
        image: What should be `(H, W, 3)` uint8 RGB.

    Raises:
        ImageError: It is not an array, not uint8, not `(H, W, 3)`, or has no pixels.
    """
    if not isinstance(image, np.ndarray):
        raise ImageError(f"an image must be a numpy array (H, W, 3) uint8 RGB, got {type(image).__name__}")
    pixels = cast("NDArray[Any]", image)
    if pixels.ndim != 3 or pixels.shape[2] != 3 or 0 in pixels.shape:
        raise ImageError(f"an image must have shape (H, W, 3) in RGB, with H and W >= 1, got {pixels.shape}")
    if pixels.dtype != np.uint8:
        raise ImageError(f"an image must be uint8, 0..255, got {pixels.dtype}")
    return np.ascontiguousarray(pixels)


def checked_start(box: ArrayLike, image: NDArray[np.uint8]) -> Box:
    """The first box, if a target can lie there.

    Args:
        box: `(4,)` box [px].
        image: `(H, W, 3)`.

    Raises:
        BoxError: The box is NaN, has no area, or lies wholly outside the image.
    """
    start = boxes.checked(box, what="first box")
    height_px, width_px = image.shape[:2]
    if boxes.area(start) == 0.0:
        raise BoxError(f"first box must have a width and height > 0, got {start.tolist()}")
    if boxes.area(boxes.clip(start, width_px, height_px)) == 0.0:
        raise BoxError(f"first box {start.tolist()} lies wholly outside the {width_px}x{height_px} image")
    return start
