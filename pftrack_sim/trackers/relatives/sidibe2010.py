"""Sidibe, Fofi & Meriaudeau 2010, "Using visual saliency for object tracking with particle filters", EUSIPCO.

A particle filter whose likelihood is the product of one of colour and one of visual saliency: what differs from the
rest of the image keeps doing so when the light changes or something of the same colour passes. Known of the
publication are its idea and its features, the distribution of colour and the saliency (Ko et al. 2012, table 1); all
else is chosen here, see docs/papers/relatives.md.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache
from typing import Annotated, Any, ClassVar, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy.fft import irfft2, rfft2

from pftrack_sim.core.boxes import Box
from pftrack_sim.core.records import Image
from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.box_filter import TUNED_FILTER, BoxFilterParameters, BoxFilterTracker
from pftrack_sim.trackers.features.histogram import Encoded, Feature, HistogramModel, epanechnikov_layout
from pftrack_sim.trackers.features.image_region import shrink
from pftrack_sim.trackers.features.integral import integral_image, rectangle_means
from pftrack_sim.trackers.features.pixel_codes import JOINT_COUNT, hsv_joint_codes

MAP_PX = (32, 160)
"""Least and greatest width of the saliency map: below, it shows nothing; above, it costs more than the colours."""
_COLOUR = Feature(hsv_joint_codes, epanechnikov_layout(1, JOINT_COUNT))


class Sidibe2010Parameters(BoxFilterParameters):
    """Parameters. Defaults are the preset `paper`; all values are chosen, as none of the publication is known.

    Attributes:
        lambda_colour: lambda of the colour's likelihood exp(-lambda d^2), d the Bhattacharyya distance.
        lambda_saliency: The same of the saliency; 0 leaves it out.
        target_px: Square root of the target's area in the saliency map [px], which sets the scale of what is salient.
        blur: Width of the map's Gaussian as a share of `target_px`.
        margin: The saliency is compared in the box grown by this share of its size on every side, so that the contrast
            of the target with its surround counts.
        cells: Rows and columns of cells in that window.
    """

    # The filter is that of `ko2012`; the weight of the saliency was chosen on four recorded sequences (BoBoT A and E,
    # OTB Jogging-1 and David): docs/papers/relatives.md.
    TUNED: ClassVar[Mapping[str, Any]] = {**TUNED_FILTER, "lambda_saliency": 40.0}

    lambda_colour: Annotated[float, Field(ge=0.0, le=10_000.0)] = 20.0
    lambda_saliency: Annotated[float, Field(ge=0.0, le=10_000.0)] = 20.0
    target_px: Annotated[float, Field(ge=4.0, le=64.0)] = 16.0
    blur: Annotated[float, Field(ge=0.01, le=1.0)] = 0.1
    margin: Annotated[float, Field(ge=0.0, le=2.0)] = 0.25
    cells: Annotated[int, Field(ge=1, le=16)] = 6


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


ColourAndSaliency: TypeAlias = tuple[Encoded, FloatArray]  # Of one frame; the integral image of the saliency


class Sidibe2010(BoxFilterTracker[Sidibe2010Parameters, ColourAndSaliency]):
    """The tracker; it draws from the stream `"tracker"` of the root seed."""

    def __init__(self, params: Sidibe2010Parameters, seed: int) -> None:
        super().__init__(params, seed)
        self._lambdas = np.array([params.lambda_colour, params.lambda_saliency])

    def _learn_first(self, image: Image, box: Box) -> None:
        p = self.params
        height, width = image.shape[:2]
        shrink = p.target_px / math.sqrt(float(box[2] * box[3]))
        columns = min(max(round(width * shrink), MAP_PX[0]), MAP_PX[1])
        self._size = (columns, max(round(height * columns / width), 1))
        self._scale = np.tile([self._size[0] / width, self._size[1] / height], 2)
        self._blur_px = p.blur * math.sqrt(float(box[2] * box[3])) * columns / width
        edges = np.linspace(-p.margin, 1.0 + p.margin, p.cells + 1)
        x, y = np.meshgrid(edges[:-1], edges[:-1])
        side = np.full(x.size, edges[1] - edges[0])
        self._rectangles = np.column_stack([x.ravel(), y.ravel(), side, side])
        self._colours = HistogramModel((_COLOUR,), image, box)
        self._root_model = np.sqrt(self.distributions(integral_image(self.saliency(image)), box[None])[0])

    def saliency(self, image: Image) -> FloatArray:
        """The saliency of an image, at the scale that the first box gave; see `spectral_residual`."""
        return spectral_residual(image, self._size, self._blur_px)

    def distributions(self, integral: FloatArray, wanted: FloatArray) -> FloatArray:
        """`(N, R)` share of the saliency of each cell, of `(N, 4)` boxes [px]; 0 where nothing is salient."""
        means = np.maximum(rectangle_means(integral, wanted * self._scale, self._rectangles)[..., 0], 0.0)
        totals = means.sum(axis=1, keepdims=True)
        return np.divide(means, totals, out=np.zeros_like(means), where=totals > 0.0)

    def observe(self, image: Image, near: FloatArray) -> ColourAndSaliency:
        """Colours and saliency of a frame."""
        return self._colours.encode(image, near), integral_image(self.saliency(image))

    def similarities(self, seen: ColourAndSaliency, wanted: FloatArray) -> FloatArray:
        """`(2, N)` Bhattacharyya similarities of colour and of saliency of `(N, 4)` boxes [px]."""
        colours, saliency = seen
        salient = np.minimum(np.sqrt(self.distributions(saliency, wanted)) @ self._root_model, 1.0)
        return np.stack([self._colours.similarities(colours, wanted)[0], salient])

    def log_likelihood(self, seen: ColourAndSaliency, wanted: FloatArray) -> FloatArray:
        """`(N,)` logarithms of the product of the likelihoods exp(-lambda d^2) of both."""
        return self._lambdas @ (self.similarities(seen, wanted) - 1.0)

    def similarity(self, seen: ColourAndSaliency, box: Box) -> float:
        """Mean of both similarities, weighted by their lambdas."""
        weights = self._lambdas if self._lambdas.any() else np.ones(2)
        return min(float(weights @ self.similarities(seen, box[None])[:, 0] / weights.sum()), 1.0)


def make(name: str, *, seed: int, preset: str, **params: Any) -> Sidibe2010:
    """Make the tracker; raises ParameterError."""
    return Sidibe2010(Sidibe2010Parameters.from_preset(name, preset, params), seed)
