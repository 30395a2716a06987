"""Ground truth and estimates drawn over a frame.

Truth is white: dashed for the amodal box, solid for the visible box. Each tracker has its colour and marker of the run;
its box is dashed while it reports the target as occluded, and that of `stay` always.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Any

import cv2
import numpy as np

from pftrack_sim.core import boxes
from pftrack_sim.core.boxes import Box
from pftrack_sim.core.palette import STAY, Colour, Style, styles_of
from pftrack_sim.core.records import Estimate, Frame, Image, Truth
from pftrack_sim.core.types import FloatArray

_WHITE: Colour = (255, 255, 255)
_GREY: Colour = (190, 190, 190)
_SHADE: Colour = (20, 20, 20)
_PANEL_OPACITY = 0.62
_MAX_PARTICLES = 400
_MIN_LABEL_HEIGHT_PX = 200  # Lower images have no room for the names of other people
_MAX_PANEL = 0.08  # Share of the image for the legend
# Corners of markers within [-1, 1]; a circle has 12.
_MARKERS = {
    "circle": np.array([(math.cos(a), math.sin(a)) for a in np.linspace(0.0, 2.0 * math.pi, 12, endpoint=False)]),
    "square": np.array([(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)]),
    "triangle-up": np.array([(0.0, -1.0), (1.0, 0.8), (-1.0, 0.8)]),
    "diamond": np.array([(0.0, -1.2), (1.2, 0.0), (0.0, 1.2), (-1.2, 0.0)]),
    "x": np.array([(0, -0.4), (0.7, -1), (1, -0.7), (0.4, 0), (1, 0.7), (0.7, 1),
                   (0, 0.4), (-0.7, 1), (-1, 0.7), (-0.4, 0), (-1, -0.7), (-0.7, -1)]),
    "star": np.array([((1.2 if k % 2 == 0 else 0.5) * math.sin(k * math.pi / 5),
                       (-1.2 if k % 2 == 0 else -0.5) * math.cos(k * math.pi / 5)) for k in range(10)]),
}  # fmt: skip
_OCCLUDERS_BELOW = 0.98  # Visible fraction below which occluders are named: grass over a sole is not


def draw_frame(frame: Frame, estimates: Mapping[str, Estimate], styles: Mapping[str, Style] | None = None) -> Image:
    """Draw the truth and the estimates of a frame; see `draw_boxes`."""
    return draw_boxes(frame.image, frame.truth, estimates, people=frame.people, styles=styles)


def draw_boxes(
    image: Image,
    truth: Truth,
    estimates: Mapping[str, Estimate],
    *,
    people: Sequence[Truth] = (),
    particles: bool = True,
    styles: Mapping[str, Style] | None = None,
) -> Image:
    """A copy of an image with boxes, a legend with overlaps, and a line with the target's state.

    Args:
        image: `(H, W, 3)` uint8 RGB.
        truth: The target.
        estimates: By tracker name.
        people: Other people to mark; the target among them is ignored.
        particles: Whether the centres of an estimate's particles are drawn.
        styles: By tracker name; default: those of a run of exactly these trackers.
    """
    canvas = _Canvas(image, styles or styles_of(estimates))
    others = [person for person in people if person.name != truth.name]
    for person in others:
        canvas.outline(person.amodal_box, _GREY, 1, dashed=True)
    canvas.labels(others, truth)
    if particles:
        canvas.particles(estimates)
    canvas.outline(truth.amodal_box, _WHITE, 1, dashed=True)
    canvas.outline(truth.visible_box, _WHITE, 1)
    canvas.estimates(estimates)
    canvas.legend(truth.box if truth.scored else None, estimates)
    canvas.caption(*_state(truth))
    return canvas.image


def draw_recorded(
    image: Image,
    truth: Box,
    estimates: Mapping[str, Estimate],
    *,
    caption: str,
    styles: Mapping[str, Style],
) -> Image:
    """A copy of a frame of a recorded sequence with boxes; its truth is an annotated `(4,)` box [px], or NaN.

    The caption is a line at the bottom; the other arguments are those of `draw_boxes`.
    """
    canvas = _Canvas(image, styles)
    canvas.particles(estimates)
    canvas.outline(truth, _WHITE, 1)
    canvas.estimates(estimates)
    canvas.legend(truth if np.isfinite(truth).all() else None, estimates)
    if caption:
        canvas.caption(caption)
    return canvas.image


class _Canvas:
    """A copy of an image, with line and text sizes that suit its height."""

    def __init__(self, image: Image, styles: Mapping[str, Style]) -> None:
        self._styles = styles
        self.image = np.array(image, dtype=np.uint8, order="C")
        self.height, self.width = self.image.shape[:2]
        self._text_px = int(min(20, max(9, round(self.height / 34))))
        self._line_px = 2 if self.height >= 200 else 1
        self._dash_px = max(3, self.height // 80)
        self._pad_px = max(2, self._text_px // 3)
        self._row_px = self._text_px + self._pad_px

    def estimates(self, estimates: Mapping[str, Estimate]) -> None:
        for name, estimate in estimates.items():
            self.outline(estimate.box, self._styles[name].colour, self._line_px, dashed=self._is_dashed(name, estimate))
            if self.height >= _MIN_LABEL_HEIGHT_PX and np.isfinite(estimate.box).all():
                # At the upper right corner: the middle of boxes may lie on each other.
                x, y = (
                    np.clip(estimate.box[:2] + estimate.box[2] * np.array([1.0, 0.0]), -1e3, 1e5).astype(int).tolist()
                )
                self._mark(name, x, y)

    def outline(self, box: FloatArray, colour: Colour, width: int, *, dashed: bool = False) -> None:
        """Draw the edge of a box [px], with a dark line outside it for contrast; a box with NaN is not drawn."""
        if not np.isfinite(box).all() or boxes.area(box) == 0.0:
            return
        # Clipped: far corners would overflow OpenCV's integers and cost very many dashes.
        low = np.maximum(box[:2], -1e3)
        high = np.minimum(box[:2] + box[2:], (self.width + 1e3, self.height + 1e3))
        x0, y0 = (math.floor(v) for v in low)
        x1, y1 = (math.ceil(v) - 1 for v in high)
        if x1 < 0 or y1 < 0 or x0 >= self.width or y0 >= self.height:
            return
        cv2.rectangle(self.image, (x0 - 1, y0 - 1), (x1 + 1, y1 + 1), _SHADE, 1)
        if not dashed:
            for inset in range(width):
                cv2.rectangle(self.image, (x0 + inset, y0 + inset), (x1 - inset, y1 - inset), colour, 1)
            return
        dash = self._dash_px
        for x in range(x0, x1 + 1, 2 * dash):
            for y in (y0, y1 - width + 1):
                self._fill(x, y, min(dash, x1 + 1 - x), width, colour)
        for y in range(y0, y1 + 1, 2 * dash):
            for x in (x0, x1 - width + 1):
                self._fill(x, y, width, min(dash, y1 + 1 - y), colour)

    def particles(self, estimates: Mapping[str, Estimate]) -> None:
        """Draw a pixel at the centre of each particle's box."""
        for name, estimate in estimates.items():
            if estimate.particles is None or len(estimate.particles) == 0:
                continue
            states = estimate.particles[:: math.ceil(len(estimate.particles) / _MAX_PARTICLES)]
            centres = states[:, :2] + 0.5 * states[:, 2:]
            size = (self.width, self.height)
            inside = np.isfinite(centres).all(axis=1) & (centres >= 0).all(axis=1) & (centres < size).all(axis=1)
            columns, rows = np.floor(centres[inside]).astype(np.intp).T
            self.image[rows, columns] = self._styles[name].colour

    def labels(self, people: Sequence[Truth], target: Truth) -> None:
        """Write names above the boxes of other people, nearest first, where neither a name nor the target is."""
        if self.height < _MIN_LABEL_HEIGHT_PX:
            return
        size = self._text_px - 1
        x0, y0, width, height = target.box
        placed: list[tuple[int, int, int]] = []
        for person in sorted(people, key=lambda person: person.distance_m):
            if not np.isfinite(person.amodal_box).all():
                continue
            x, y = math.ceil(person.amodal_box[0]), math.floor(person.amodal_box[1]) - self._pad_px
            right = x + _text_width(person.name, size) + self._pad_px
            free = all(abs(y - row) > self._row_px or right < left or x > end for left, end, row in placed)
            off_target = x > x0 + width or right < x0 or y < y0 or y - size > y0 + height
            if free and off_target and x >= 0 and right <= self.width and size <= y < self.height:
                placed.append((x, right, y))
                self._darken(x - 1, y - size + 1, right - x, size + self._pad_px - 1)
                self._write(person.name, x + 1, y, _GREY, size)

    def legend(self, truth: Box | None, estimates: Mapping[str, Estimate]) -> None:
        """Top left: each tracker's colour, name and overlap with the truth.

        Where that has no room, only the overlaps, in one line; of more trackers the first by name, and how many more.
        """
        pad, text = self._pad_px, self._text_px
        overlaps = {name: boxes.iou(one.box, truth) if truth is not None else math.nan
                    for name, one in estimates.items()}  # fmt: skip
        if self._panel_width(estimates) * self._panel_height(1 + len(estimates)) <= self._room:
            self._named(overlaps, estimates, truth=True)
            return
        number_width = _text_width("0.00", text) + pad
        if len(estimates) * number_width + pad <= self.width:
            self._darken(0, 0, len(estimates) * number_width + pad, self._row_px + pad // 2)
            for at, (name, overlap) in enumerate(overlaps.items()):
                self._write(_number(overlap), at * number_width + pad, self._row_px - pad // 3, self._ink(name), text)
            return
        names = list(estimates)
        shown = names[:1]
        while self._panel_width(names[: len(shown) + 1]) * self._panel_height(len(shown) + 2) <= self._room:
            shown = names[: len(shown) + 1]
        rest = [overlaps[name] for name in names[len(shown) :]]
        between = f": {min(rest):.2f} to {max(rest):.2f}" if truth is not None else ""
        self._named({name: overlaps[name] for name in shown}, estimates, more=f"and {len(rest)} more{between}")

    @property
    def _room(self) -> float:
        return _MAX_PANEL * self.width * self.height

    def _panel_width(self, names: Iterable[str]) -> int:
        """Of a legend with these names."""
        widest = max(_text_width(name, self._text_px) for name in ("truth", *names))
        number = _text_width("0.00", self._text_px) + self._pad_px if names else 0
        return 2 * self._text_px + widest + number + 4 * self._pad_px

    def _panel_height(self, rows: int) -> int:
        return rows * self._row_px + self._pad_px

    def _named(
        self,
        overlaps: Mapping[str, float],
        estimates: Mapping[str, Estimate],
        *,
        truth: bool = False,
        more: str = "",
    ) -> None:
        """A row for each tracker, above them the truth's, below them what there is no room for."""
        pad, text, swatch = self._pad_px, self._text_px, 2 * self._text_px
        width = max(self._panel_width(overlaps), _text_width(more, text) + 2 * pad)
        self._darken(0, 0, width, self._panel_height(len(overlaps) + truth + bool(more)))
        base = self._row_px - pad // 3
        if truth:
            self._line(pad, text, base - text // 3, 1, _WHITE, dashed=True)
            self._line(pad + text, text, base - text // 3, 1, _WHITE)
            self._write("truth", swatch + 2 * pad, base, _WHITE, text)
            base += self._row_px
        for name, overlap in overlaps.items():
            style, y, number = self._styles[name], base - text // 3, _number(overlap)
            self._line(pad, swatch, y, self._line_px, style.colour, dashed=self._is_dashed(name, estimates[name]))
            self._mark(name, pad + swatch // 2, y)
            self._write(name, swatch + 2 * pad, base, _WHITE, text)
            self._write(number, width - pad - _text_width(number, text), base, self._ink(name), text)
            base += self._row_px
        if more:
            self._write(more, pad, base, _GREY, text)

    def _ink(self, name: str) -> Colour:
        """A tracker's colour, lightened so that it can be read on a dark panel."""
        red, green, blue = ((value + 255) // 2 for value in self._styles[name].colour)
        return red, green, blue

    def _is_dashed(self, name: str, estimate: Estimate) -> bool:
        return estimate.occluded or self._styles[name] == STAY

    def _mark(self, name: str, x: int, y: int) -> None:
        """Draw a tracker's marker about a pixel, with a dark edge."""
        colour, _, marker = self._styles[name]
        points = np.round(0.5 * self._text_px * _MARKERS[marker] + np.array([x, y])).astype(np.int32)
        cv2.fillPoly(self.image, [points], colour)
        cv2.polylines(self.image, [points], isClosed=True, color=_SHADE)

    def caption(self, *parts: str) -> None:
        """Bottom left: as many parts as fit, at least the first."""
        count = len(parts)
        while count > 1 and _text_width("   ".join(parts[:count]), self._text_px) > self.width - 2 * self._pad_px:
            count -= 1
        text = "   ".join(parts[:count])
        top = self.height - self._row_px - self._pad_px // 2
        self._darken(0, top, _text_width(text, self._text_px) + 2 * self._pad_px, self.height - top)
        self._write(text, self._pad_px, self.height - self._pad_px, _WHITE, self._text_px)

    def _line(self, x: int, length: int, y: int, width: int, colour: Colour, *, dashed: bool = False) -> None:
        dash = self._dash_px if dashed else length
        for start in range(x, x + length, 2 * dash):
            self._fill(start, y - width // 2, min(dash, x + length - start), width, colour)

    def _fill(self, x: int, y: int, width: int, height: int, colour: Colour) -> None:
        cv2.rectangle(self.image, (x, y), (x + width - 1, y + height - 1), colour, cv2.FILLED)

    def _darken(self, x: int, y: int, width: int, height: int) -> None:
        area = self.image[max(y, 0) : y + height, max(x, 0) : x + width]
        area[:] = (area * (1.0 - _PANEL_OPACITY)).astype(np.uint8)

    def _write(self, text: str, x: int, y: int, colour: Colour, size: int) -> None:
        cv2.putText(self.image, text, (x, y), colour, _font(), size, 500)


def _number(overlap: float) -> str:
    return "-" if math.isnan(overlap) else f"{overlap:.2f}"


def _state(truth: Truth) -> list[str]:
    """Time, visibility, distance and occluders of the target."""
    if truth.state == "visible":
        visibility = f"{100 * truth.visible_fraction:.0f} % visible"
    else:
        visibility = truth.state.replace("_", " ")
    parts = [f"{truth.time_s:.1f} s", visibility, f"{truth.distance_m:.1f} m"]
    if truth.occluders and truth.visible_fraction < _OCCLUDERS_BELOW:
        parts.append("behind " + ", ".join(truth.occluders[:2]))
    return parts


@lru_cache(maxsize=1)
def _font() -> Any:
    return cv2.FontFace("sans")


@lru_cache(maxsize=256)
def _text_width(text: str, size: int) -> int:
    """Width of a text [px]."""
    x, _, width, _ = cv2.getTextSize((10_000, 100), text, (0, 0), _font(), size, 500)
    return max(0, x + width)
