"""Colours of trackers, the same in videos, on pages and in figures.

They are those of Okabe and Ito ("Color Universal Design", 2008), which colour-blind people can tell apart, but for
yellow and black, which cannot be seen on white or at night, and with a brown.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

Colour = tuple[int, int, int]
"""Red, green and blue in 0..255."""

TRACKERS: tuple[Colour, ...] = (
    (213, 94, 0),  # vermillion
    (0, 114, 178),  # blue
    (0, 158, 115),  # bluish green
    (204, 121, 167),  # reddish purple
    (230, 159, 0),  # orange
    (86, 180, 233),  # sky blue
    (140, 109, 49),  # brown
)
"""In the order of the trackers of a run; they repeat after the last."""

ORACLE: Colour = (136, 136, 136)
"""Of the oracle, and of the target where there is no picture behind it."""

_ORACLE_LABEL = re.compile(r"oracle(?![\w:.-])")


def colours_of(labels: Iterable[str]) -> dict[str, Colour]:
    """The colour of each tracker of a run, by label.

    Args:
        labels: All trackers of the run, in the plan's order: colours do not depend on which of them are shown.

    >>> colours_of(["oracle+servo", "a", "b"])
    {'oracle+servo': (136, 136, 136), 'a': (213, 94, 0), 'b': (0, 114, 178)}
    """
    places = places_of(labels)
    return {label: ORACLE if place is None else TRACKERS[place % len(TRACKERS)] for label, place in places.items()}


def places_of(labels: Iterable[str]) -> dict[str, int | None]:
    """The place of each tracker among those of a run that are no oracle; None for an oracle."""
    unique = dict.fromkeys(labels)
    others = [label for label in unique if not _ORACLE_LABEL.match(label)]
    return dict.fromkeys(unique) | {label: place for place, label in enumerate(others)}


def hexadecimal(colour: Colour) -> str:
    """A colour as CSS and matplotlib read it.

    >>> hexadecimal(ORACLE)
    '#888888'
    """
    return "#{:02x}{:02x}{:02x}".format(*colour)
