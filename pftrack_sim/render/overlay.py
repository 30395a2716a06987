"""What is true and what trackers say, drawn over a frame for people to look at.

The truth is white: dashed around the whole body, solid around what shows. Each tracker has a colour of its own, from
a palette that colour-blind people can tell apart (Okabe and Ito, "Color Universal Design", 2008), and is dashed while
it holds the target to be covered.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core import boxes
from pftrack_sim.core.boxes import Box
from pftrack_sim.core.records import Estimate, Frame, Image, Truth

Colour = tuple[int, int, int]

PALETTE: tuple[Colour, ...] = (
    (230, 159, 0),  # orange
    (86, 180, 233),  # sky blue
    (204, 121, 167),  # reddish purple
    (0, 158, 115),  # bluish green
    (240, 228, 66),  # yellow
    (213, 94, 0),  # vermillion
    (0, 114, 178),  # blue
)
"""Colours of the trackers, in the order they are given."""

_WHITE: Colour = (255, 255, 255)
_GREY: Colour = (190, 190, 190)
_SHADE: Colour = (20, 20, 20)
_PANEL_OPACITY = 0.62
_MAX_DOTS = 400
_MIN_LABEL_HEIGHT_PX = 200
"""Images lower than this have no room for names beside the legend."""

_MENTIONED_FROM = 0.98
"""A cover that takes less than the rest, a sole in the grass, is not worth a word."""


def draw_frame(frame: Frame, estimates: Mapping[str, Estimate]) -> Image:
    """A frame with its truth and what was said of it.

    Args:
        frame: The frame; its image stays as it is.
        estimates: By name, in the order of their colours.

    Returns:
        A new `(H, W, 3)` uint8 image.
    """
    return draw_boxes(frame.image, frame.truth, estimates, people=frame.people)


def draw_boxes(
    image: Image,
    truth: Truth,
    estimates: Mapping[str, Estimate],
    *,
    people: Sequence[Truth] = (),
    particles: bool = True,
) -> Image:
    """Boxes, a legend with overlaps, and a line about the target's state.

    Args:
        image: `(H, W, 3)` uint8 RGB; stays as it is.
        truth: The target.
        estimates: By name, in the order of their colours.
        people: Others to mark; the target among them is passed over.
        particles: Whether the centres of an estimate's particles are dotted.

    Returns:
        A new `(H, W, 3)` uint8 image.
    """
    canvas = np.array(image, dtype=np.uint8, order="C")
    style = _Style(canvas)
    others = [person for person in people if person.name != truth.name]
    for person in others:
        _outline(canvas, person.amodal_box, _GREY, 1, style.dash)
    _labels(canvas, style, others, truth)
    if particles:
        for colour, estimate in zip(_colours(len(estimates)), estimates.values(), strict=True):
            _dots(canvas, estimate.particles, colour)
    _outline(canvas, truth.amodal_box, _WHITE, 1, style.dash)
    _outline(canvas, truth.visible_box, _WHITE, 1, None)
    for colour, estimate in zip(_colours(len(estimates)), estimates.values(), strict=True):
        _outline(canvas, estimate.box, colour, style.line, style.dash if estimate.occluded else None)
    _legend(canvas, style, truth.box if truth.scored else None, estimates)
    _footer(canvas, style, truth)
    return canvas


def draw_recorded(
    image: Image, truth: Box, estimates: Mapping[str, Estimate], *, caption: str = "", particles: bool = True
) -> Image:
    """Boxes over a frame of a recorded sequence, of which nothing is known but a box.

    Args:
        image: `(H, W, 3)` uint8 RGB; stays as it is.
        truth: `(4,)` the box drawn by hand [px]; NaN where there is none.
        estimates: By name, in the order of their colours.
        caption: A line at the bottom.
        particles: Whether the centres of an estimate's particles are dotted.

    Returns:
        A new `(H, W, 3)` uint8 image.
    """
    canvas = np.array(image, dtype=np.uint8, order="C")
    style = _Style(canvas)
    if particles:
        for colour, estimate in zip(_colours(len(estimates)), estimates.values(), strict=True):
            _dots(canvas, estimate.particles, colour)
    _outline(canvas, truth, _WHITE, 1, None)
    for colour, estimate in zip(_colours(len(estimates)), estimates.values(), strict=True):
        _outline(canvas, estimate.box, colour, style.line, style.dash if estimate.occluded else None)
    _legend(canvas, style, truth if np.isfinite(truth).all() else None, estimates)
    if caption:
        _caption(canvas, style, caption)
    return canvas


class _Style:
    """Sizes that suit the image."""

    def __init__(self, image: Image) -> None:
        height = image.shape[0]
        self.text = int(min(20, max(9, round(height / 34))))
        self.line = 2 if height >= 200 else 1
        self.dash = max(3, height // 80)
        self.pad = max(2, self.text // 3)
        self.row = self.text + self.pad


def _colours(count: int) -> list[Colour]:
    return [PALETTE[index % len(PALETTE)] for index in range(count)]


def _outline(canvas: Image, box: NDArray[np.float64], colour: Colour, width: int, dash: int | None) -> None:
    """The edge of a box with a dark shade along it, so that it shows on any background.

    Args:
        canvas: Drawn on.
        box: `(4,)` [px]; NaN draws nothing.
        colour: Of the edge.
        width: Of the edge [px].
        dash: Length of dashes and gaps [px]; None is solid.
    """
    if not np.isfinite(box).all() or boxes.area(box) == 0.0:
        return
    height, width_px = canvas.shape[:2]
    # Far corners would overflow OpenCV's integers, and dashing along kilometres takes for ever.
    low = np.maximum(box[:2], -1e3)
    high = np.minimum(box[:2] + box[2:], (width_px + 1e3, height + 1e3))
    x0, y0 = (math.floor(v) for v in low)
    x1, y1 = (math.ceil(v) - 1 for v in high)
    if x1 < 0 or y1 < 0 or x0 >= width_px or y0 >= height:
        return
    cv2.rectangle(canvas, (x0 - 1, y0 - 1), (x1 + 1, y1 + 1), _SHADE, 1)
    if dash is None:
        for inset in range(width):
            cv2.rectangle(canvas, (x0 + inset, y0 + inset), (x1 - inset, y1 - inset), colour, 1)
        return
    for start in range(x0, x1 + 1, 2 * dash):
        for y in (y0, y1 - width + 1):
            cv2.rectangle(canvas, (start, y), (min(start + dash - 1, x1), y + width - 1), colour, cv2.FILLED)
    for start in range(y0, y1 + 1, 2 * dash):
        for x in (x0, x1 - width + 1):
            cv2.rectangle(canvas, (x, start), (x + width - 1, min(start + dash - 1, y1)), colour, cv2.FILLED)


def _dots(canvas: Image, particles: NDArray[np.float64] | None, colour: Colour) -> None:
    """A pixel at the centre of each particle's box."""
    if particles is None or len(particles) == 0:
        return
    step = math.ceil(len(particles) / _MAX_DOTS)
    centres = particles[::step, :2] + 0.5 * particles[::step, 2:]
    height, width = canvas.shape[:2]
    inside = np.isfinite(centres).all(axis=1) & (centres >= 0).all(axis=1) & (centres < (width, height)).all(axis=1)
    columns, rows = np.floor(centres[inside]).astype(np.intp).T
    canvas[rows, columns] = colour


def _labels(canvas: Image, style: _Style, people: Sequence[Truth], target: Truth) -> None:
    """Names above the boxes of other people, nearest first, where there is room for them beside the target."""
    height, width = canvas.shape[:2]
    size = style.text - 1
    x0, y0, *extent = target.box
    taken: list[tuple[int, int, int]] = []
    for person in sorted(people, key=lambda one: one.distance_m):
        if height < _MIN_LABEL_HEIGHT_PX or not np.isfinite(person.amodal_box).all():
            continue
        x, y = math.ceil(person.amodal_box[0]), math.floor(person.amodal_box[1]) - style.pad
        right = x + _width(person.name, size) + style.pad
        free = all(abs(y - row) > style.row or right < left or x > end for left, end, row in taken)
        aside = x > x0 + extent[0] or right < x0 or y < y0 or y - size > y0 + extent[1]
        if free and aside and x >= 0 and right <= width and size <= y < height:
            taken.append((x, right, y))
            _darken(canvas, x - 1, y - size + 1, right - x, size + style.pad - 1)
            _write(canvas, person.name, (x + 1, y), _GREY, size)


def _legend(canvas: Image, style: _Style, truth: Box | None, estimates: Mapping[str, Estimate]) -> None:
    """Top left: a line per tracker with its colour, name and overlap with the truth, where there is one."""
    rows: list[tuple[str, str, Colour, int | None]] = [("truth", "", _WHITE, None)]
    for (name, estimate), colour in zip(estimates.items(), _colours(len(estimates)), strict=True):
        overlap = f"{boxes.iou(estimate.box, truth):.2f}" if truth is not None else "-"
        rows.append((name, overlap, colour, style.dash if estimate.occluded else None))
    swatch = 2 * style.text
    name_width = max(_width(name, style.text) for name, *_ in rows)
    number_width = _width("0.00", style.text) + style.pad if estimates else 0
    panel = (swatch + name_width + number_width + 4 * style.pad, len(rows) * style.row + style.pad)
    _darken(canvas, 0, 0, *panel)
    for index, (name, overlap, colour, dash) in enumerate(rows):
        base = (index + 1) * style.row - style.pad // 3
        middle = base - style.text // 3
        if name == "truth" and index == 0:
            half = swatch // 2
            _line(canvas, style.pad, half, middle, 1, colour, style.dash)
            _line(canvas, style.pad + half, half, middle, 1, colour, None)
        else:
            _line(canvas, style.pad, swatch, middle, style.line, colour, dash)
        _write(canvas, name, (swatch + 2 * style.pad, base), _WHITE, style.text)
        right = panel[0] - style.pad - _width(overlap, style.text) if overlap else 0
        if overlap:
            _write(canvas, overlap, (right, base), colour, style.text)


def _footer(canvas: Image, style: _Style, truth: Truth) -> None:
    """Bottom: time, how much of the target shows, and what covers it; as much of it as fits."""
    if truth.state == "visible":
        shows = f"{100 * truth.visible_fraction:.0f} % visible"
    else:
        shows = truth.state.replace("_", " ")
    parts = [f"{truth.time_s:.1f} s", shows, f"{truth.distance_m:.1f} m"]
    if truth.occluders and truth.visible_fraction < _MENTIONED_FROM:
        parts.append("behind " + ", ".join(truth.occluders[:2]))
    room = canvas.shape[1] - 2 * style.pad
    while len(parts) > 1 and _width("   ".join(parts), style.text) > room:
        parts.pop()
    _caption(canvas, style, "   ".join(parts))


def _caption(canvas: Image, style: _Style, text: str) -> None:
    top = canvas.shape[0] - style.row - style.pad // 2
    _darken(canvas, 0, top, _width(text, style.text) + 2 * style.pad, canvas.shape[0] - top)
    _write(canvas, text, (style.pad, canvas.shape[0] - style.pad), _WHITE, style.text)


def _line(canvas: Image, x: int, length: int, y: int, width: int, colour: Colour, dash: int | None) -> None:
    step, piece = (2 * dash, dash) if dash is not None else (length, length)
    for start in range(x, x + length, step):
        end = min(start + piece, x + length) - 1
        cv2.rectangle(canvas, (start, y - width // 2), (end, y - width // 2 + width - 1), colour, cv2.FILLED)


def _darken(canvas: Image, x: int, y: int, width: int, height: int) -> None:
    area = canvas[max(y, 0) : y + height, max(x, 0) : x + width]
    area[:] = (area * (1.0 - _PANEL_OPACITY)).astype(np.uint8)


@lru_cache(maxsize=1)
def _font() -> Any:
    return cv2.FontFace("sans")


def _write(canvas: Image, text: str, at: tuple[int, int], colour: Colour, size: int) -> None:
    cv2.putText(canvas, text, at, colour, _font(), size, 500)


@lru_cache(maxsize=256)
def _width(text: str, size: int) -> int:
    """Width of a text [px]."""
    x, _, width, _ = cv2.getTextSize((10_000, 100), text, (0, 0), _font(), size, 500)
    return max(0, x + width)
