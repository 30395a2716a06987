"""Patches of an image at any scale, from a pyramid of halved images."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.records import Image
from pftrack_sim.core.types import FloatArray

MIN_SIDE_PX = 4
MARGIN = 0.25
"""Margin of a part around the patch that it was made for, in sizes of the patch: others lie beside it."""

Span: TypeAlias = tuple[float, float]  # Least and greatest x, or y


@dataclass(frozen=True, eq=False)
class _Part:
    """A part of a level: the spans x, y [px of the level] that it serves, its first pixel x, y, and its pixels."""

    spans: tuple[Span, Span]
    first: tuple[int, int]
    pixels: Image

    @cached_property
    def grey(self) -> NDArray[np.uint8]:
        """`(h, w)` grey pixels."""
        return np.asarray(cv2.cvtColor(self.pixels, cv2.COLOR_RGB2GRAY), dtype=np.uint8)


class ImagePyramid:
    """An image and its halves, each level the mean of 2x2 pixels of the one below.

    Only the parts that patches touch are made, on demand: the cost does not depend on the size of the image.

    Args:
        image: `(H, W, 3)` uint8 RGB.
    """

    def __init__(self, image: Image) -> None:
        self._image = image
        self._parts: dict[int, _Part] = {}

    def patch(self, centre: FloatArray, side: float, count: int) -> Image:
        """A square part of the image, resampled; border pixels are replicated.

        Args:
            centre: `(2,)` x, y of its centre [px].
            side: Its side [px].
            count: Rows and columns of the result.

        Returns:
            `(count, count, 3)` uint8 RGB.
        """
        level = self._level(side / count)
        shrink = 0.5**level
        step, half = shrink * side / count, 0.5 * shrink * side
        x, y = shrink * float(centre[0]), shrink * float(centre[1])
        part = self._part(level, ((x - half, x + half), (y - half, y + half)))
        # OpenCV has pixel centres at whole numbers.
        left, top = (at - half - first + 0.5 * step - 0.5 for at, first in zip((x, y), part.first, strict=True))
        matrix = np.array([[step, 0.0, left], [0.0, step, top]])
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        out = cv2.warpAffine(part.pixels, matrix, (count, count), flags=flags, borderMode=cv2.BORDER_REPLICATE)
        return np.asarray(out, dtype=np.uint8)

    def grey_patches(self, centre: FloatArray, sizes: FloatArray, shape: tuple[int, int]) -> NDArray[np.uint8]:
        """`(N, rows, columns)` grey patches of `(N, 2)` widths and heights [px] around one centre, all of one `shape`.

        All are taken from the level that fits the one in the middle.
        """
        rows, columns = shape
        level = self._level(float((sizes[len(sizes) // 2] / (columns, rows)).min()))
        middle, sides = np.asarray(centre) * 0.5**level, sizes * 0.5**level
        reach = 0.5 * sides.max(axis=0)
        spans = [(float(at - far), float(at + far)) for at, far in zip(middle, reach, strict=True)]
        part = self._part(level, spans)
        across, down = ((np.arange(count) + 0.5) / count - 0.5 for count in (columns, rows))
        x, y = (middle - part.first - 0.5)[:, None, None, None] + np.zeros((2, len(sizes), rows, columns))
        x += sides[:, 0, None, None] * across
        y += sides[:, 1, None, None] * down[:, None]
        # One row for each patch: OpenCV's images have less than 32768 of them.
        across, down = (np.asarray(one.reshape(len(sizes), -1), dtype=np.float32) for one in (x, y))
        out = cv2.remap(part.grey, across, down, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return np.asarray(out, dtype=np.uint8).reshape(len(sizes), rows, columns)

    def _level(self, step: float) -> int:
        """The level whose pixels best fit samples that are `step` pixels of the image apart."""
        # A level is left when samples would lie 1.57 of its pixels apart: later they alias, earlier they blur.
        wanted = max(math.floor(math.log2(max(step, 1.0)) + 0.35), 0)
        coarsest = max(math.floor(math.log2(min(self._image.shape[:2]) / MIN_SIDE_PX)), 0)
        return min(wanted, coarsest)

    def _part(self, level: int, spans: Sequence[Span]) -> _Part:
        """The pixels of a level in the spans x, y [px of the level] and their neighbours."""
        known = self._parts.get(level)
        if known is not None and all(
            have[0] <= wanted[0] and wanted[1] <= have[1] for have, wanted in zip(known.spans, spans, strict=True)
        ):
            return known
        x, y = ((low - MARGIN * (high - low), high + MARGIN * (high - low)) for low, high in spans)
        (left, right), (top, bottom) = (
            _pixels(span, room >> level) for span, room in zip((x, y), self._image.shape[1::-1], strict=True)
        )
        pixels = self._image[top << level : bottom << level, left << level : right << level]
        for _ in range(level):
            half = pixels.shape[1] // 2, pixels.shape[0] // 2
            pixels = np.asarray(cv2.resize(pixels, half, interpolation=cv2.INTER_AREA), dtype=np.uint8)
        self._parts[level] = part = _Part((x, y), (left, top), pixels)
        return part


def _pixels(span: Span, room: int) -> tuple[int, int]:
    """First of `room` pixels in a span or beside it, and one after the last; at least one."""
    first = min(max(math.floor(span[0]) - 1, 0), room - 1)
    return first, min(max(math.ceil(span[1]) + 1, first + 1), room)
