"""The look of trackers, the same in videos, on pages and in figures: a colour, and a dash and a marker beside it.

Trackers of this package have theirs in every run. Another one, or one with parameters, has a colour by a digest of its
name, and of those that other trackers of the run have the next free one; where all are taken, colours repeat with other
dashes and markers. `stay` is grey and dashed, the oracle grey.

The colours are those of Okabe and Ito ("Color Universal Design", 2008), which colour-blind people can tell apart, but
for yellow and black, which cannot be seen on white or at night, and with a brown.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterable
from typing import NamedTuple

Colour = tuple[int, int, int]
"""Red, green and blue in 0..255."""

_TRACKERS: dict[Colour, str] = {  # in the order of the shapes; what is compared with each other differs in colour
    (213, 94, 0): "ko2012 chau2011 opencv-meanshift opencv-medianflow kwon2005-no-occlusion",  # vermillion
    (0, 114, 178): "lee2012 ko2012-hsv khan2011 ocsort opencv-nano",  # blue
    (0, 158, 115): "pftrack ko2012-rgb sidibe2010 opencv-kcf opencv-vit",  # bluish green
    (204, 121, 167): "opencv-csrt lee2012-color-hog deguchi2004 bytetrack opencv-dasiamrpn",  # reddish purple
    (230, 159, 0): "opencv-mil lee2012-color islam2009 norfair ko2012-classifier",  # orange
    (86, 180, 233): "ncc ko2012-cslbp klein2010 opencv-mosse opencv-camshift",  # sky blue
    (140, 109, 49): "kwon2005 ko2012-hsv-kernel yang2005 opencv-tld lee2012-checked",  # brown
}

COLOURS = tuple(_TRACKERS)

GREY: Colour = (136, 136, 136)
"""Of the references, and of the target where there is no picture behind it."""

SHAPES = (
    ("solid", "circle"),
    ("dash", "square"),
    ("dot", "triangle-up"),
    ("dashdot", "diamond"),
    ("longdash", "x"),
    ("longdashdot", "star"),
)
"""Dashes and markers, by the names of plotly."""

_PATTERNS: dict[str, tuple[int, ...]] = {
    "solid": (),
    "dash": (8, 4),
    "dot": (2, 3),
    "dashdot": (8, 3, 2, 3),
    "longdash": (14, 5),
    "longdashdot": (14, 4, 2, 4),
}


class Style(NamedTuple):
    """A colour, and what tells apart without it."""

    colour: Colour
    dash: str = "solid"
    marker: str = "circle"

    @property
    def hexadecimal(self) -> str:
        """The colour as CSS and matplotlib read it."""
        return "#{:02x}{:02x}{:02x}".format(*self.colour)

    @property
    def pattern(self) -> tuple[int, ...]:
        """What is drawn and left out of a line, in turn [px]; empty for a solid one."""
        return _PATTERNS[self.dash]


STAY = Style(GREY, "dash", "square")
_FIXED = {"oracle": Style(GREY), "stay": STAY, "oracle-visible": Style(GREY, *SHAPES[2])} | {
    name: Style(colour, *shape)
    for colour, names in _TRACKERS.items()
    for name, shape in zip(names.split(), SHAPES, strict=False)
}

# A label is the tracker with its parameters, and then latency, controller, and what it is told.
_BASE = re.compile(r"(.*?)(?:@[\d.e+-]+ms)?(?:\+[\w.:-]+)?(?: \(\w+\))?", re.DOTALL)


def styles_of(labels: Iterable[str]) -> dict[str, Style]:
    """The look of each tracker of a run, by label; it does not depend on their order, nor on which of them are shown.

    >>> styles_of(["mine:make", "ko2012", "stay"])["ko2012"] == styles_of(["ko2012+servo"])["ko2012+servo"]
    True
    """
    bases = {label: match[1] if (match := _BASE.fullmatch(label)) else label for label in labels}
    firsts = {bases[label]: label for label in sorted(bases, reverse=True)}
    found: dict[str, Style] = {}
    for label in sorted(bases, key=lambda one: (bases[one] not in _FIXED or firsts[bases[one]] != one, one)):
        base, taken = bases[label], set(found.values())
        if base in _FIXED:  # with another controller or latency it keeps its colour
            wanted = [_FIXED[base], *(Style(_FIXED[base].colour, *shape) for shape in SHAPES)]
        else:
            start, used = zlib.crc32(base.encode()) % len(COLOURS), {style.colour for style in taken}
            turned = COLOURS[start:] + COLOURS[:start]
            wanted = [Style(colour) for colour in turned if colour not in used]
            wanted += [Style(colour, *shape) for shape in SHAPES for colour in turned]
        found[label] = next((style for style in wanted if style not in taken), wanted[0])
    return {label: found[label] for label in bases}
