"""Level of the light axis: the largest change of the light within a second.

The brightness around the same corners of the background is compared from frame to frame. What it means in stops
depends on the camera's curve of tones, which is not known: the interval reaches from a display's (a power of 2.2) to
film's, whose shoulder compresses what is bright.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pftrack_sim.core.types import FloatArray
from pftrack_sim.measuring.jitter import Untold, stretches
from pftrack_sim.measuring.measured import Quantity
from pftrack_sim.measuring.motion import Step

_WITHIN_S = 1.0
_LEAST_EV = 0.2


def measure_light(steps: Sequence[Step], times_s: FloatArray) -> list[Quantity]:
    """The largest change of the brightness of the same surfaces within 1 s [EV], after the camera's own exposure.

    Raises:
        Untold: The background is not seen for long enough, or no change stands out.
    """
    known = stretches(steps, times_s)
    if not known:
        raise Untold("needs a background that is followed for 4 s")
    rate = 1.0 / float(np.median(np.diff(times_s)))
    lag = max(2, round(_WITHIN_S * rate))
    changes, at_s = [np.zeros((0, 2))], [np.zeros(0)]
    for own in known:
        stops = np.nan_to_num(np.array([one.stops for one in steps[own]]))
        level = np.concatenate([np.zeros((1, 2)), np.cumsum(stops, axis=0)])
        # Median of three: a single frame of flicker is no change that stays.
        level = np.median(np.stack([level[:-2], level[1:-1], level[2:]]), axis=0)
        changes.append(level[lag:] - level[:-lag])
        at_s.append(times_s[own.start + 1 + lag : own.stop])
    change = np.concatenate(changes)
    # Surfaces that come nearer drift darker or brighter: their usual drift is no change of the light.
    change = change - np.median(change, axis=0)
    spread = 1.483 * float(np.median(np.abs(change[:, 0])))
    most = int(np.abs(change[:, 0]).argmax())
    ends = np.sort(np.abs(change[most]))
    if ends[0] < max(_LEAST_EV, 4.0 * spread):
        raise Untold(f"no change of {max(_LEAST_EV, 4.0 * spread):.2g} EV or more within {_WITHIN_S:g} s")
    value = float(ends.mean())
    # Every second that holds the change shows it: it happens in the middle of them.
    whole = np.abs(change[:, 0]) > 0.9 * abs(change[most, 0])
    at = max(0.0, float(np.median(np.concatenate(at_s)[whole])) - 0.5 * _WITHIN_S)
    settings = {
        "axes.light.severity": 1.0,
        "axes.light.parts": ["change"],
        "axes.light.auto_exposure": False,
        "axes.light.dim_ev": -math.copysign(value, change[most, 0]),
        "axes.light.at_s": at,
    }
    low, high = max(0.0, float(ends[0]) - 2.0 * spread), float(ends[1]) + 2.0 * spread
    return [Quantity("change of light", value, low, high, "EV", len(change), "light", settings)]
