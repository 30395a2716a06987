"""Light and the numbers of a frame: a display-coded value is luminance to the power 1 / 2.2."""

from __future__ import annotations

DISPLAY_GAMMA = 2.2
"""Exponent of the display: luminance is the coded value to this power (ITU-R BT.709 displays, sRGB nearly so)."""


def gain(stops: float) -> float:
    """Factor on display-coded light for a change of so many stops."""
    return float(2.0 ** (stops / DISPLAY_GAMMA))
