"""Level of the noise axis: photon transfer, the variance of pixels against their level (EMVA Standard 1288).

The difference of two successive frames, one shifted by whole pixels onto the other, is noise where the image is flat.
Its variance in 8x8 px falls with the level by the camera's curve of tones and rises in the dark by read noise: gain,
read noise and the curve's stops are found together, by the distribution that the axis itself draws from.
"""

from __future__ import annotations

import functools

import cv2
import numpy as np
import scipy
from numpy.typing import NDArray

from pftrack_sim.camera.noise import QUANTILES, quantile_table
from pftrack_sim.core.photometry import gain as tone_gain
from pftrack_sim.core.records import Image
from pftrack_sim.core.types import FloatArray
from pftrack_sim.formats.images import ImageFiles, Images
from pftrack_sim.measuring.jitter import Untold
from pftrack_sim.measuring.measured import Quantity
from pftrack_sim.scenario.axes import NoiseAxis

_LOSSLESS = (".bmp", ".png")
_SIDE = 8  # Of a block [px]
_MARGIN = 0.2  # Of each side of the image: towards the corners the lens darkens after the noise
_LEVELS = np.arange(20.0, 244.0, 4.0)
_LEAST, _FLATTEST = 60, 0.25  # Blocks of a level, and the share of them that is used
_GAINS, _READS_E, _STOPS = np.geomspace(0.35, 60.0, 25), np.geomspace(1.5, 24.0, 5), np.linspace(0.0, 4.0, 9)
_TOLD = (0.4, 45.0)  # Gains that can be told: less is lost in rounding, more in black
_ERROR, _INDEPENDENT = 0.12, 0.3  # Of the logarithm of a variance, and the share of levels that are independent
_MOST_ERROR, _MOST_ALIKE, _ALIKE = 0.25, 0.25, 0.1


class NoiseMeter:
    """Collects the differences of up to 200 pairs of successive frames of these images."""

    def __init__(self, images: Images) -> None:
        self._lossless = isinstance(images, ImageFiles) and images.paths[0].suffix.lower() in _LOSSLESS
        self._every = 1 + len(images) // 200
        self._before: Image | None = None
        self._blocks: list[FloatArray] = []

    def add(self, index: int, image: Image) -> None:
        """Take the next frame, `(H, W, 3)` uint8, of which green counts."""
        before, self._before = self._before, image
        if not self._lossless or before is None or index % self._every:
            return
        first, second = (np.asarray(one[..., 1], dtype=np.float32) for one in (before, image))
        right, down = (round(one) for one in cv2.phaseCorrelate(first, second)[0])
        rows, columns = (slice(round(_MARGIN * side), round((1.0 - _MARGIN) * side)) for side in first.shape)
        if abs(right) > columns.start or abs(down) > rows.start:
            return
        there = second[rows.start + down : rows.stop + down, columns.start + right : columns.stop + right]
        here = first[rows, columns]
        middle, difference = 0.5 * (here + there), here - there
        if not difference.any():
            return
        texture = np.asarray(cv2.GaussianBlur(middle, (0, 0), 1.5), dtype=np.float32)
        levels, changes = _blocks(middle), _blocks(difference)
        changes = changes - changes.mean(axis=(1, 2), keepdims=True)
        power = (changes**2).sum(axis=(1, 2))
        alike = (changes[:, :, 1:] * changes[:, :, :-1]).sum(axis=(1, 2)) / np.maximum(power, 1e-9)
        usable = (levels.min(axis=(1, 2)) > 2.0) & (levels.max(axis=(1, 2)) < 253.0)
        variance = 0.5 * power / (_SIDE**2 - 1)
        columns_of = [levels.mean(axis=(1, 2)), _blocks(texture).var(axis=(1, 2)), variance, alike]
        self._blocks.append(np.stack(columns_of, axis=1)[usable])

    def measure(self, doubts: list[str]) -> list[Quantity]:
        """Gain and read noise; doubts are appended.

        Raises:
            Untold: The images are compressed, too little of them is flat, or their noise follows no law of photons.
        """
        if not self._lossless:
            raise Untold("JPEG and video encoders take noise away: it needs PNG or BMP as the camera gives them")
        blocks = np.concatenate([np.zeros((0, 4)), *self._blocks])
        variances, alike = np.full(len(_LEVELS), np.nan), [np.zeros(0)]
        for place, level in enumerate(_LEVELS):
            own = blocks[np.abs(blocks[:, 0] - level) <= 2.0]
            if len(own) < _LEAST:
                continue
            flat = own[own[:, 1] <= np.quantile(own[:, 1], _FLATTEST)]
            variances[place] = np.median(flat[:, 2]) / _MEDIAN
            alike.append(flat[:, 3])
        known = np.isfinite(variances)
        if known.sum() < 10:
            raise Untold(f"needs flat parts of ten levels of brightness, {int(known.sum())} are there")
        neighbours = float(np.median(np.concatenate(alike)))
        if neighbours > _MOST_ALIKE:
            raise Untold(
                f"neighbouring pixels change alike (r = {neighbours:.2f}): what was noise is compressed or smoothed"
            )
        errors = (np.log(variances[known] + 1e-3) - _model()[..., known]) / _ERROR
        losses = 0.5 * _INDEPENDENT * (np.minimum(np.abs(errors), 3.0) ** 2).sum(axis=-1)
        best = errors.reshape(losses.size, -1)[losses.argmin()]
        if float(np.median(np.abs(best))) * _ERROR > _MOST_ERROR:
            raise Untold("the variance follows no law of photons over the levels: compressed, smoothed or sharpened")
        likely = np.exp(losses.min() - losses)
        gain, low, high = _interval(_GAINS, likely.sum(axis=(1, 2)))
        if low < _TOLD[0] or high > _TOLD[1]:
            raise Untold(f"its gain may be outside {_TOLD[0]:g} to {_TOLD[1]:g}: {low:.2g} to {high:.2g}")
        read, least, most = _interval(_READS_E, likely.sum(axis=(0, 2)))
        axis = {"severity": 1.0, "full_well_e": _FULL_WELL_E, "gain": gain, "read_noise_e": read}
        settings = {f"axes.noise.{key}": value for key, value in axis.items()}
        if neighbours > _ALIKE:
            doubts.append(
                f"noise of neighbouring pixels is alike (r = {neighbours:.2f}): the axis draws each by itself"
            )
        pairs = len(self._blocks)
        return [
            Quantity("noise", gain, low, high, NoiseAxis.unit, pairs, "noise", settings),
            Quantity("read noise", read, least, most, "e-", pairs),
        ]


_FULL_WELL_E = float(NoiseAxis().full_well_e)
_FREEDOM = _SIDE**2 - 1.0
_MEDIAN = float(scipy.stats.chi2.ppf(0.5, _FREEDOM)) / _FREEDOM


def _blocks(image: NDArray[np.float32]) -> FloatArray:
    """`(N, 8, 8)` of an image."""
    height, width = (side // _SIDE for side in image.shape)
    cut = image[: height * _SIDE, : width * _SIDE].reshape(height, _SIDE, width, _SIDE)
    return np.asarray(cut.swapaxes(1, 2).reshape(-1, _SIDE, _SIDE), dtype=np.float64)


@functools.cache
def _model() -> FloatArray:
    """`(gains, reads, stops, levels)` logarithms of the variance of pixels whose mean is at a level."""
    codes = np.linspace(1e-6, 1.0 - 1e-6, 256)
    tones = [np.rint(255.0 / (1.0 + (1.0 - codes) / codes / tone_gain(stops))) for stops in _STOPS.tolist()]
    result = np.empty((len(_GAINS), len(_READS_E), len(_STOPS), len(_LEVELS)))
    for i, gain in enumerate(_GAINS.tolist()):
        for j, read in enumerate(_READS_E.tolist()):
            table = quantile_table(_FULL_WELL_E / gain, read)[:, QUANTILES // 256 :: QUANTILES // 128]
            for k, tone in enumerate(tones):
                drawn = tone.astype(np.float32)[table]
                result[i, j, k] = np.interp(_LEVELS, drawn.mean(axis=1), drawn.var(axis=1))
    return np.log(result + 1e-3)


def _interval(values: FloatArray, likely: FloatArray) -> tuple[float, float, float]:
    """Median and 95 % interval of a distribution over values that are evenly spaced in their logarithm."""
    below = np.cumsum(likely / likely.sum()) - 0.5 * likely / likely.sum()
    middle, low, high = np.exp(np.interp([0.5, 0.025, 0.975], below, np.log(values))).tolist()
    return middle, low, high
