"""Sidibe, Fofi & Meriaudeau 2010, "Using visual saliency for object tracking with particle filters", EUSIPCO.

A particle filter whose likelihood is the product of one of colour and one of visual saliency: what differs from the
rest of the image keeps doing so when the light changes or something of the same colour passes. Known of the
publication are its idea and its features, the distribution of colour and the saliency (Ko et al. 2012, table 1); all
else is chosen here, see docs/papers/relatives.md.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from pftrack_sim.core.boxes import Box
from pftrack_sim.core.records import Image
from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.box_filter import TUNED_FILTER, BoxFilterParameters, BoxFilterTracker
from pftrack_sim.trackers.features.histogram import EncodedRegion, Feature, HistogramModel, epanechnikov_layout
from pftrack_sim.trackers.features.integral import integral_image, rectangle_means
from pftrack_sim.trackers.features.pixel_codes import hsv_joint_codes
from pftrack_sim.trackers.features.saliency import spectral_residual

COLOUR_BINS = (8, 8, 4)
MAP_PX = (32, 160)
"""Least and greatest width of the saliency map: below, it shows nothing; above, it costs more than the colours."""
_COLOUR = Feature(partial(hsv_joint_codes, bin_counts=COLOUR_BINS), epanechnikov_layout(1, math.prod(COLOUR_BINS)))


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
    TUNED: ClassVar[Mapping[str, Any]] = MappingProxyType(
        {
            **TUNED_FILTER,
            "lambda_saliency": 40.0,
        }
    )

    lambda_colour: Annotated[float, Field(ge=0.0, le=10_000.0)] = 20.0
    lambda_saliency: Annotated[float, Field(ge=0.0, le=10_000.0)] = 20.0
    target_px: Annotated[float, Field(ge=4.0, le=64.0)] = 16.0
    blur: Annotated[float, Field(ge=0.01, le=1.0)] = 0.1
    margin: Annotated[float, Field(ge=0.0, le=2.0)] = 0.25
    cells: Annotated[int, Field(ge=1, le=16)] = 6


@dataclass(frozen=True, eq=False)
class SaliencyMap:
    """The saliency of one image.

    Attributes:
        integral: `(h + 1, w + 1, 1)` integral image of the map.
        scale: `(4,)` factors from boxes in the image to boxes in the map.
        rectangles: `(R, 4)` cells in shares of a box.
    """

    integral: FloatArray
    scale: FloatArray
    rectangles: FloatArray

    def distributions(self, boxes: FloatArray) -> FloatArray:
        """`(N, R)` share of the saliency of each cell, of `(N, 4)` boxes [px]; 0 where nothing is salient."""
        channel = np.zeros(len(self.rectangles), np.intp)
        means = np.maximum(rectangle_means(self.integral, boxes * self.scale, self.rectangles, channel), 0.0)
        totals = means.sum(axis=1, keepdims=True)
        return np.divide(means, totals, out=np.zeros_like(means), where=totals > 0.0)


@dataclass(frozen=True, eq=False)
class ColourAndSaliency:
    """A frame's colours and saliency, compared with those of the first frame."""

    colours: EncodedRegion
    saliency: SaliencyMap
    root_model: FloatArray
    lambdas: tuple[float, float]

    def similarities(self, boxes: FloatArray) -> FloatArray:
        """`(2, N)` Bhattacharyya similarities of colour and of saliency."""
        saliency = np.minimum(np.sqrt(self.saliency.distributions(boxes)) @ self.root_model, 1.0)
        return np.stack([self.colours.similarities(boxes)[0], saliency])

    def log_likelihood(self, particles: FloatArray) -> FloatArray:
        """`(N,)` logarithms of the product of the likelihoods exp(-lambda d^2) of both."""
        return np.array(self.lambdas) @ (self.similarities(particles) - 1.0)

    def similarity(self, box: Box) -> float:
        """Mean of both similarities, weighted by their lambdas."""
        weights = np.array(self.lambdas) if any(self.lambdas) else np.ones(2)
        return min(float(weights @ self.similarities(box[None])[:, 0] / weights.sum()), 1.0)


class Sidibe2010(BoxFilterTracker[Sidibe2010Parameters, ColourAndSaliency]):
    """The tracker; it draws from the stream `"tracker"` of the root seed."""

    def _learn_first(self, image: Image, box: Box) -> None:
        p = self.params
        height, width = image.shape[:2]
        shrink = p.target_px / math.sqrt(float(box[2] * box[3]))
        columns = min(max(round(width * shrink), MAP_PX[0]), MAP_PX[1])
        self._size = (columns, max(round(height * columns / width), 1))
        self._blur_px = p.blur * math.sqrt(float(box[2] * box[3])) * columns / width
        edges = np.linspace(-p.margin, 1.0 + p.margin, p.cells + 1)
        x, y = np.meshgrid(edges[:-1], edges[:-1])
        side = np.full(x.size, edges[1] - edges[0])
        self._rectangles = np.column_stack([x.ravel(), y.ravel(), side, side])
        self._colours = HistogramModel((_COLOUR,), image, box)
        self._root_model = np.sqrt(self.saliency(image).distributions(box[None])[0])

    def saliency(self, image: Image) -> SaliencyMap:
        """The saliency of an image, at the scale that the first box gave."""
        height, width = image.shape[:2]
        found = spectral_residual(image, self._size, self._blur_px)
        scale = np.tile([self._size[0] / width, self._size[1] / height], 2)
        return SaliencyMap(integral_image(found), scale, self._rectangles)

    def _observe(self, image: Image, near: FloatArray) -> ColourAndSaliency:
        lambdas = (self.params.lambda_colour, self.params.lambda_saliency)
        return ColourAndSaliency(self._colours.encode(image, near), self.saliency(image), self._root_model, lambdas)


def make(name: str, *, seed: int, preset: str, **params: Any) -> Sidibe2010:
    """Make the tracker; raises ParameterError."""
    return Sidibe2010(Sidibe2010Parameters.from_preset(name, preset, params), seed)
