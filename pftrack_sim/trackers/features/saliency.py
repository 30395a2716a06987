"""Visual saliency of an image: the spectral residual (Hou & Zhang, CVPR 2007)."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft2, rfft2

from pftrack_sim.core.records import Image
from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.features.image_region import shrink

AVERAGE_SIZE = 3
"""Side of the mean filter that gives the expected log spectrum; Hou & Zhang: 3."""
_LEAST = 1e-6  # Amplitudes below this share of the mean's are rounding errors
_OPPONENTS = np.array([[1.0, 1.0, 1.0], [1.0, -1.0, 0.0], [-0.5, -0.5, 1.0]], np.float32)


def spectral_residual(image: Image, size: tuple[int, int], blur_px: float) -> FloatArray:
    """`(height, width)` saliency in [0, 1] of an `(H, W, 3)` image, reduced to `size` = (width, height) [px].

    The log amplitude spectrum of natural images is smooth; what deviates from its local mean, transformed back with the
    phase, marks the places that differ from the rest. The map is the squared amplitude of that under a Gaussian of
    `blur_px`, summed over intensity and the colour opponents red-green and blue-yellow, over its maximum. 0 everywhere
    in a uniform image. Before, the image is freed from its jumps at the borders, which would be salient: the spectrum
    takes it for periodic.
    """
    reduced = shrink(image, size).astype(np.float32)
    channels = np.moveaxis(np.asarray(cv2.transform(reduced, _OPPONENTS)), 2, 0)
    spectrum = rfft2(channels) - _smooth_spectrum(channels)
    least = _LEAST * float(reduced.mean()) * reduced[..., 0].size
    # The mean of a channel has no place, and its amplitude says nothing about those beside it.
    spectrum[:, 0, 0] = 0.0
    amplitude = np.abs(spectrum)
    amplitude[:, 0, 0] = amplitude[:, 0, 1]
    if float(amplitude.max()) <= least:
        return np.zeros((size[1], size[0]))
    residuals = np.stack([_residual(one, least) for one in amplitude])
    squares = np.square(irfft2(spectrum * residuals, s=channels.shape[1:])).sum(axis=0)
    blurred = np.asarray(cv2.GaussianBlur(squares, (0, 0), blur_px, borderType=cv2.BORDER_REPLICATE), dtype=np.float64)
    return blurred / max(float(blurred.max()), np.finfo(np.float64).tiny)


def _residual(amplitude: NDArray[np.float32], least: float) -> NDArray[np.float32]:
    """`(h, w // 2 + 1)` factors that leave of an amplitude spectrum the exponential of its log residual."""
    log_amplitude = np.log(np.maximum(amplitude, least))
    mean = np.asarray(cv2.blur(log_amplitude, (AVERAGE_SIZE, AVERAGE_SIZE), borderType=cv2.BORDER_REFLECT_101))
    # exp(log A - mean) / A; amplitudes that are rounding errors have no phase.
    return np.where(amplitude > least, np.exp(-mean), 0.0).astype(np.float32)


def _smooth_spectrum(channels: NDArray[np.float32]) -> NDArray[np.complex64]:
    """Half spectrum of the smooth image that has the jumps of `(C, h, w)` channels across opposite borders.

    The periodic plus smooth decomposition: Moisan, "Periodic plus smooth image decomposition", JMIV 2011, eq. 9 to 11.
    """
    height, width = channels.shape[1:]
    jumps = np.zeros_like(channels)
    across = channels[:, 0] - channels[:, -1]
    jumps[:, 0] += across
    jumps[:, -1] -= across
    along = channels[:, :, 0] - channels[:, :, -1]
    jumps[:, :, 0] += along
    jumps[:, :, -1] -= along
    smooth = np.asarray(rfft2(jumps) / _negative_laplacian(height, width), dtype=np.complex64)
    smooth[:, 0, 0] = 0.0
    return smooth


@lru_cache(maxsize=4)
def _negative_laplacian(height: int, width: int) -> NDArray[np.float32]:
    """Half spectrum of the negative discrete Laplace operator, -1 at the mean."""
    rows = 2.0 * np.cos(2.0 * np.pi / height * np.arange(height, dtype=np.float64))
    columns = 2.0 * np.cos(2.0 * np.pi / width * np.arange(width // 2 + 1, dtype=np.float64))
    laplacian = rows[:, None] + columns[None] - 4.0
    laplacian[0, 0] = 1.0
    out = (-laplacian).astype(np.float32)
    out.flags.writeable = False
    return out
