"""Level of the blur axis: time for which each frame is exposed, by what a shaking camera smears.

Two frames of the same scene are smeared by exposure times velocity each. Smeared once more, each by the length of the
other, they are alike; for too short an exposure the frame that was turned faster stays less sharp, for too long a one
it is the sharper of both. Nothing is assumed of the scene, and nothing that blurs all frames alike takes part.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import cv2
import numpy as np

from pftrack_sim.core.types import FloatArray
from pftrack_sim.formats.images import ImageFiles, Images
from pftrack_sim.measuring.jitter import Untold, stretches, turn_rates
from pftrack_sim.measuring.measured import Quantity
from pftrack_sim.measuring.motion import Step

_APART, _PAIRS = 3, 60  # Frames between those of a pair, and number of pairs
_LEAST_PX = 1.5  # Smear of one frame of a pair beyond that of the other, were the exposure as long as the frame lasts
_WIDTH_PX, _SMOOTH_PX = 640, 0.8
_MARGIN = 0.05  # Share of a side that is left out at either end: what lay beside the image is not known
_SHARES, _SHARES_ENCODED = (0.65, 1.1), (0.8, 3.0)
"""Of the measured exposure, what intervals hold besides chance: encoders take off what is sharp."""
_MORE_S = 1.5e-3
_GUESSES = np.concatenate([[0.0], np.geomspace(0.05, 1.6, 16)])  # Exposures, as shares of the time between frames


def measure_exposure(images: Images, steps: Sequence[Step], times_s: FloatArray, focal_px: float) -> list[Quantity]:
    """Exposure of a frame [ms].

    Raises:
        Untold: The camera shakes too little, or the frames are not smeared as far as it can be told.
    """
    step_s = float(np.median(np.diff(times_s)))
    pairs = _pairs(steps, times_s, focal_px)
    speeds = np.linalg.norm(pairs[1], axis=2)
    if len(speeds) < 10 or np.median(speeds[:, 1] - speeds[:, 0]) * step_s < _LEAST_PX:
        raise Untold("the camera shakes too little to smear the image")
    sharper = _sharper(images, *pairs, step_s)
    value = _crossing(np.median(sharper, axis=0))
    if value == np.inf:
        raise Untold("frames are smeared for longer than one lasts")
    draws = np.random.default_rng(0).integers(len(sharper), size=(200, len(sharper)))
    ends = np.quantile(
        [_crossing(np.median(sharper[draw], axis=0)) for draw in draws], (0.025, 0.975), method="nearest"
    )
    shares = _SHARES if isinstance(images, ImageFiles) else _SHARES_ENCODED
    low = step_s * shares[0] * float(ends[0]) - _MORE_S
    high = min(step_s * shares[1] * float(ends[1]) + _MORE_S, step_s)
    if low <= 0.0:
        raise Untold(f"frames are not smeared, or exposed for less than {1e3 * high:.1f} ms")
    exposure = min(1e3 * step_s * value, 200.0)
    settings = {"axes.blur.severity": 1.0, "axes.blur.exposure_ms": exposure}
    return [Quantity("exposure", exposure, 1e3 * low, 1e3 * high, "ms", len(np.unique(pairs[0])), "blur", settings)]


def _pairs(steps: Sequence[Step], times_s: FloatArray, focal_px: float) -> tuple[list[tuple[int, int]], FloatArray]:
    """Near frames that differ most in speed, the slower one of a pair first; `(N, 2, 2)` their velocities [px/s]."""
    found: list[tuple[float, tuple[int, int], FloatArray]] = []
    for own in stretches(steps, times_s):
        rates, known = turn_rates(steps, times_s, own)
        velocities = focal_px * np.column_stack([-rates[:, 1], rates[:, 0]])
        speeds = np.linalg.norm(velocities, axis=1)
        told = np.flatnonzero(known[:-1] & known[1:]) + 1
        for one, apart in itertools.product(told.tolist(), range(1, _APART + 1)):
            if one + apart in told:
                slow, fast = sorted((one, one + apart), key=speeds.__getitem__)
                pair = own.start + slow, own.start + fast
                found.append((float(speeds[fast] - speeds[slow]), pair, velocities[[slow, fast]]))
    found.sort(key=lambda one: -one[0])
    kept = found[:_PAIRS]
    return [pair for _, pair, _ in kept], np.array([velocity for *_, velocity in kept]).reshape(-1, 2, 2)


def _sharper(images: Images, pairs: Sequence[tuple[int, int]], velocities: FloatArray, step_s: float) -> FloatArray:
    """`(N, G)` by how much the slower frame of each pair is the sharper one, by guess: log ratios of energies."""
    frames: dict[int, FloatArray] = {}
    scale = 1.0
    for index in sorted({one for pair in pairs for one in pair}):
        grey = np.asarray(cv2.cvtColor(images.read(index), cv2.COLOR_RGB2GRAY), dtype=np.float64)
        scale = min(1.0, _WIDTH_PX / grey.shape[1])
        if scale < 1.0:
            grey = np.asarray(
                cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), dtype=np.float64
            )
        frames[index] = np.asarray(cv2.GaussianBlur(grey, (0, 0), _SMOOTH_PX), dtype=np.float64)
    energies = np.array([
        [[_energy(frames[index], guess * step_s * scale * other) for guess in _GUESSES]
         for index, other in zip(pair, velocity[::-1], strict=True)]
        for pair, velocity in zip(pairs, velocities, strict=True)
    ])  # fmt: skip
    return np.log(energies[:, 0] / energies[:, 1])


def _energy(grey: FloatArray, smear_px: FloatArray) -> float:
    """Energy of the gradients of the middle of an image that is smeared along `smear_px`."""
    half = int(np.ceil(0.5 * float(np.abs(smear_px).max()))) + 1
    kernel = np.zeros((2 * half + 1, 2 * half + 1), dtype=np.float32)
    x, y = half + np.linspace(-0.5, 0.5, 65) * smear_px[:, None]
    left, top = np.floor(x).astype(int), np.floor(y).astype(int)
    for column, row in itertools.product(range(2), range(2)):
        share = np.abs(1 - column - (x - left)) * np.abs(1 - row - (y - top))
        np.add.at(kernel, (top + row, left + column), share)
    smeared = cv2.filter2D(grey, -1, kernel / kernel.sum(), borderType=cv2.BORDER_REPLICATE)
    rows, columns = (int(_MARGIN * side) for side in grey.shape)
    middle = np.asarray(smeared, dtype=np.float64)[rows : grey.shape[0] - rows, columns : grey.shape[1] - columns]
    return float((np.diff(middle, axis=0)[:, 1:] ** 2 + np.diff(middle, axis=1)[1:] ** 2).mean())


def _crossing(sharper: FloatArray) -> float:
    """The guess at which neither frame is sharper; 0 if the slower one never is, infinity if it always is."""
    after = np.flatnonzero(sharper <= 0.0)
    if not after.size:
        return np.inf
    last = int(after[0])
    if last == 0:
        return 0.0
    share = sharper[last - 1] / (sharper[last - 1] - sharper[last])
    return float(_GUESSES[last - 1] + share * (_GUESSES[last] - _GUESSES[last - 1]))
