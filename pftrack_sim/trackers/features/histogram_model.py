"""Appearance model of histograms of the first frame, and the likelihood of a particle under it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pftrack_sim.core.boxes import Box
from pftrack_sim.core.records import Image
from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.features.histogram import BinLayout, histogram, root_model
from pftrack_sim.trackers.features.histogram_kernels import BinTables, Codes, compare
from pftrack_sim.trackers.features.image_region import ImageRegion, crop, fill_in_region

LikelihoodForm: TypeAlias = Literal["linear", "exponential"]
"""With the Bhattacharyya distance d: `"linear"` is 1 - d^2, the similarity; `"exponential"` is exp(-lambda d^2)."""


@dataclass(frozen=True, eq=False)
class Feature:
    """A histogram of a box.

    Attributes:
        encode: Maps an `(H, W, 3)` uint8 RGB image to `(H, W, C)` pixel codes.
        layout: Weights and cells of the histogram.
    """

    encode: Callable[[Image], NDArray[np.uint8]]
    layout: BinLayout


class HistogramModel:
    """One histogram per feature, taken from the first frame and constant.

    Attributes:
        features: F features.
        histograms: The normalised histogram in each.
        tables: The derived tables of each layout.
        root_models: What the square roots of a box's counts are multiplied with in each feature.
    """

    def __init__(self, features: Sequence[Feature], image: Image, box: Box) -> None:
        self.features = tuple(features)
        region = crop(image, box[None])
        local = region.to_region(box[None])[0]
        self.histograms = tuple(
            histogram(feature.encode(region.pixels), local, feature.layout) for feature in self.features
        )
        self.tables = tuple(feature.layout.tables for feature in self.features)
        self.root_models = tuple(
            root_model(feature.layout, one) for feature, one in zip(self.features, self.histograms, strict=True)
        )

    def encode(self, image: Image, boxes: FloatArray) -> EncodedRegion:
        """Encode the part of an image that `(N, 4)` boxes [px] touch: the expensive step, done once for all boxes."""
        region = crop(image, boxes)
        return EncodedRegion(self, region, tuple(feature.encode(region.pixels) for feature in self.features))


@dataclass(frozen=True, eq=False)
class EncodedRegion:
    """A part of an image as pixel codes in every feature of a model."""

    model: HistogramModel
    region: ImageRegion
    codes: tuple[NDArray[np.uint8], ...]

    def similarities(self, boxes: FloatArray) -> FloatArray:
        """`(F, N)` Bhattacharyya similarities in [0, 1] of `(N, 4)` boxes [px] with the model in each feature.

        The boxes lie inside the hull of those that were encoded. The distance d of Ko et al. 2012, eq. 7, is `sqrt(1 -
        similarity)`.
        """
        out = np.empty((len(self.codes), len(boxes)))
        region, model = self.region, self.model
        _compare_all(self.codes, boxes, region.origin, region.step, model.tables, model.root_models, out)
        return out


# One call for all features: what a call costs is much beside the comparison of a single box.
@njit(nogil=True, cache=True)
def _compare_all(
    codes: tuple[Codes, ...],
    boxes: FloatArray,
    origin: FloatArray,
    step: FloatArray,
    tables: tuple[BinTables, ...],
    root_models: tuple[FloatArray, ...],
    out: NDArray[np.float64],
) -> None:
    """Fill `(F, N)` with the similarities of `(N, 4)` boxes [px of the image] in a region's codes of each feature."""
    local = np.empty((boxes.shape[0], 4))
    fill_in_region(boxes, origin, step, local)
    for f in range(len(codes)):
        compare(codes[f], local, tables[f], root_models[f], out[f])


def log_mixture(similarities: FloatArray, shares: FloatArray, form: LikelihoodForm, lambdas: FloatArray) -> FloatArray:
    """`(N,)` logarithms of a linear mixture of one likelihood per feature (Ko et al. 2012, eq. 9).

    -inf where all similarities are 0.

    Args:
        similarities: `(F, N)` Bhattacharyya similarities.
        shares: `(F,)` weight of each feature, summing to 1.
        form: Likelihood of each feature.
        lambdas: `(F,)` lambda of each feature; not used by `"linear"`.
    """
    likelihoods = similarities if form == "linear" else np.exp((similarities - 1.0) * lambdas[:, None])
    mixed = shares @ likelihoods
    if mixed.all():
        return np.log(mixed)
    # Only here, as it takes longer than the logarithms.
    with np.errstate(divide="ignore"):
        return np.log(mixed)
