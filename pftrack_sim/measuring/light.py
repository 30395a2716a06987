"""Level of the light axis: the largest change of the light within a second, and flicker.

The brightness around the same corners of the background is compared from frame to frame. What it means in stops
depends on the camera's curve of tones, which is not known: the interval reaches from a display's (a power of 2.2) to
film's, whose shoulder compresses what is bright.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pftrack_sim.core.types import FloatArray
from pftrack_sim.measuring.jitter import Untold, stretches
from pftrack_sim.measuring.measured import Quantity
from pftrack_sim.measuring.motion import Step

_WITHIN_S = 1.0
_LEAST_EV = 0.2
_LEAST_DEPTH, _LEAST_SHARE = 0.01, 0.85
_LOWEST_HZ = 0.5
_LAMPS_HZ = (100.0, 120.0)


def measure_light(steps: Sequence[Step], times_s: FloatArray, doubts: list[str]) -> list[Quantity]:
    """The largest change within 1 s [EV], after the camera's own exposure, and flicker; doubts are appended.

    Raises:
        Untold: The background is not seen for long enough, or neither stands out.
    """
    known = stretches(steps, times_s)
    if not known:
        raise Untold("needs a background that is followed for 4 s")
    found, reasons = list[Quantity](), list[str]()
    for measure in (_change, _flicker):
        try:
            found.append(measure(steps, times_s, known, doubts))
        except Untold as reason:
            reasons.append(str(reason))
    if not found:
        raise Untold(", and ".join(reasons))
    parts = ["change" if one.axis else "flicker" for one in found]
    common = {"axes.light.severity": 1.0, "axes.light.parts": parts, "axes.light.auto_exposure": False}
    return [replace(one, settings={**common, **one.settings}) for one in found]


def _flicker(steps: Sequence[Step], times_s: FloatArray, known: Sequence[slice], doubts: list[str]) -> Quantity:
    """The line that holds most of the changes from frame to frame, in the longest stretch."""
    own = max(known, key=lambda one: one.stop - one.start)
    stops = np.array([one.stops for one in steps[own]])
    usual = float(np.nanmedian(np.abs(stops[:, 0])))
    good = np.isfinite(stops).all(axis=1) & (np.abs(stops[:, 0]) < 5.0 * max(usual, 0.02))  # without sudden changes
    if good.sum() < 50:
        raise Untold("no flicker stands out")
    before, after = times_s[own][good], times_s[own.start + 1 : own.stop + 1][good]
    stops: FloatArray = np.asarray(stops[good] - stops[good].mean(axis=0), dtype=np.float64)
    seconds = float(after[-1] - before[0])

    def line(hz: float) -> FloatArray:
        first, last = 2.0 * np.pi * hz * before, 2.0 * np.pi * hz * after
        return np.stack([np.sin(last) - np.sin(first), np.cos(last) - np.cos(first)], axis=1)

    all_hz = np.arange(_LOWEST_HZ, 0.49 / float(np.median(np.diff(times_s))), 0.25 / seconds)
    power = np.maximum((stops**2).sum(axis=0), 1e-12)
    shares = np.array([1.0 - np.linalg.lstsq(line(hz), stops[:, 0], rcond=None)[1].sum() / power[0] for hz in all_hz])
    hz = float(all_hz[shares.argmax()])
    share = float(shares.max())
    fit, rest = (np.asarray(one, dtype=np.float64) for one in np.linalg.lstsq(line(hz), stops, rcond=None)[:2])
    amplitude = np.hypot(*fit)
    error = np.sqrt(rest / len(stops) * np.trace(np.linalg.inv(line(hz).T @ line(hz))) / 2.0)
    # The fundamental of log2(1 + depth sin) has the amplitude 2 (1 - sqrt(1 - depth^2)) / (depth log 2).
    half = 0.5 * math.log(2.0) * np.stack([amplitude, amplitude - 2.0 * error, amplitude + 2.0 * error])
    depths = 2.0 * half / (1.0 + half**2)
    value = float(depths[0].mean())
    if share < _LEAST_SHARE or value < _LEAST_DEPTH:
        raise Untold("no flicker stands out")
    rate = 1.0 / float(np.median(np.diff(times_s)))
    lamps = [lamp for lamp in _LAMPS_HZ if abs(abs((lamp + 0.5 * rate) % rate - 0.5 * rate) - hz) < 0.3]
    others = f"lamps of {lamps[0]:g} Hz" if lamps else f"{rate - hz:.3g} or {rate + hz:.3g} Hz"
    doubts.append(f"faster flicker looks slower at {rate:.3g} frames a second: {hz:.2f} Hz may be {others}")
    settings = {"axes.light.flicker_hz": hz, "axes.light.flicker_depth": min(1.0, value)}
    # Encoders repeat blocks that hardly change, and so take off what the line does not hold.
    low, high = max(0.0, float(depths.min())), float(depths.max()) / share
    return Quantity("flicker", value, low, high, f"of the light at {hz:.2f} Hz", len(stops), settings=settings)


def _change(steps: Sequence[Step], times_s: FloatArray, known: Sequence[slice], _: list[str]) -> Quantity:
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
    settings = {"axes.light.dim_ev": -math.copysign(value, change[most, 0]), "axes.light.at_s": at}
    low, high = max(0.0, float(ends[0]) - 2.0 * spread), float(ends[1]) + 2.0 * spread
    return Quantity("change of light", value, low, high, "EV", len(change), "light", settings)
