"""Photometry: display coding, luminance and the colour of black bodies."""

from __future__ import annotations

import numpy as np

from pftrack_sim.core.types import FloatArray, read_only

DISPLAY_GAMMA = 2.2
"""Exponent of the display: luminance is the display-coded value to this power (ITU-R BT.709, approximately sRGB)."""

LUMINANCE = read_only(np.array([0.2126, 0.7152, 0.0722]))
"""Weights of linear red, green and blue in luminance (ITU-R BT.709)."""

_RGB_OF_XYZ = np.array(
    [[3.2404542, -1.5371385, -0.4985314], [-0.9692660, 1.8760108, 0.0415560], [0.0556434, -0.2040259, 1.0572252]]
)
"""Linear sRGB from CIE XYZ (IEC 61966-2-1)."""


def gain(stops: float) -> float:
    """Factor on display-coded light for a change of its luminance by stops [EV]."""
    return float(2.0 ** (stops / DISPLAY_GAMMA))


def chromaticity(kelvin: float) -> tuple[float, float]:
    """CIE 1931 x, y of a black body.

    Cubic fits of Kim et al. 2002 (US patent 7024034), exact to 0.0005 from 1667 K to 25000 K.
    """
    t = 1e3 / kelvin
    if kelvin <= 4000.0:
        x = -0.2661239 * t**3 - 0.2343589 * t**2 + 0.8776956 * t + 0.179910
    else:
        x = -3.0258469 * t**3 + 2.1070379 * t**2 + 0.2226347 * t + 0.240390
    if kelvin <= 2222.0:
        y = -1.1063814 * x**3 - 1.34811020 * x**2 + 2.18555832 * x - 0.20219683
    elif kelvin <= 4000.0:
        y = -0.9549476 * x**3 - 1.37418593 * x**2 + 2.09137015 * x - 0.16748867
    else:
        y = 3.0817580 * x**3 - 5.87338670 * x**2 + 3.75112997 * x - 0.37001483
    return x, y


def tint(kelvin: float, white_k: float) -> FloatArray:
    """`(3,)` factors on linear red, green and blue for light of one colour temperature, with `white_k` shown as white.

    Grey keeps its luminance.
    """
    factors = _primaries(kelvin) / _primaries(white_k)
    return factors / (LUMINANCE @ factors)


def _primaries(kelvin: float) -> FloatArray:
    """Linear red, green and blue of a black body at unit luminance."""
    x, y = chromaticity(kelvin)
    return _RGB_OF_XYZ @ np.array([x / y, 1.0, (1.0 - x - y) / y])
