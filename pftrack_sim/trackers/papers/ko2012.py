"""Ko, Nam & Kwak 2012, "Object Tracking Using Particle Filters in Moving Camera", J. KICS: its five methods.

A particle filter on the target's box (eq. 10) with a random walk (eq. 11). The likelihood is a linear mixture (eq. 9)
of the Bhattacharyya similarities (eq. 7) of two histograms with those of the first frame: HSV colour under an
Epanechnikov kernel (eq. 1) and CS-LBP texture in 4x4 cells (eq. 2 and 3). The estimate is the mean of the particles of
greatest weight (eq. 12); a jump of the estimate is rejected (eq. 13). The four methods of comparison (section IV) are
the same filter with one histogram.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Annotated, Any, ClassVar, Literal, TypeAlias

import numpy as np
from pydantic import Field

from pftrack_sim.core.boxes import Box
from pftrack_sim.core.records import Image
from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.box_filter import TUNED_FILTER, BoxFilterParameters, BoxFilterTracker
from pftrack_sim.trackers.features.histogram import (
    Encoded,
    Feature,
    HistogramModel,
    cell_layout,
    epanechnikov_layout,
    uniform_layout,
)
from pftrack_sim.trackers.features.pixel_codes import cs_lbp_codes, hsv_codes, rgb_codes
from pftrack_sim.trackers.parameters import Count, Share

COLOUR_BINS = 128
LikelihoodForm: TypeAlias = Literal["linear", "exponential"]
"""With the Bhattacharyya distance d: `"linear"` is 1 - d^2, the similarity; `"exponential"` is exp(-lambda d^2)."""


class Ko2012Parameters(BoxFilterParameters):
    """Parameters of all five methods. Defaults are the preset `paper`; printed values have their equation.

    Those of the filter: `BoxFilterParameters`. Printed: the noise (11), 1 px of the centre, 0.64 px of width and height
    (for 320x240 images). Not printed: the number of particles, N of the top-N mean (12) (with 1 it is the heaviest
    particle, as in the abstract), T of the jump (13), and how particles are redrawn: `"weights"` is section 3.1,
    `"estimate"` the abstract and section 3.3.2. Not in the paper: `size_correlation`, `hold_below`, `held_noise`,
    `camera_motion`.

    Attributes:
        alpha: Weight of texture in the mixture (9). Printed: 0.4. Not used by the methods of one histogram.
        likelihood: The printed weight (8, 9) is d^2, which would favour the least similar particle. Decreasing ones:
            `"linear"`, the Bhattacharyya similarity 1 - d^2, which hardly differs between particles, so that they walk
            at random where they are redrawn by weight; and `"exponential"`, exp(-lambda d^2).
        lambda_colour: lambda of colour's exponential likelihood. Not printed.
        lambda_texture: lambda of texture's exponential likelihood. Not printed.
    """

    # Found by a coarse search on four recorded sequences (BoBoT A and E, OTB Jogging-1 and David): noise relative to
    # the target's size for a shaking camera, constant shape, particles restarted at the new state (as in the abstract),
    # and a likelihood that separates particles. docs/papers/ko2012.md states the effect of each.
    TUNED: ClassVar[Mapping[str, Any]] = {**TUNED_FILTER, "hold_below": 0.88, "held_noise": 2.5, "camera_motion": True}

    particle_count: Count = 400
    alpha: Share = 0.4
    likelihood: LikelihoodForm = "exponential"
    lambda_colour: Annotated[float, Field(ge=0.0, le=10_000.0)] = 20.0
    lambda_texture: Annotated[float, Field(ge=0.0, le=10_000.0)] = 20.0


_HSV = partial(hsv_codes, bin_count=COLOUR_BINS)
_UNIFORM, _KERNEL = uniform_layout(3, COLOUR_BINS), epanechnikov_layout(3, COLOUR_BINS)
_TEXTURE = Feature(cs_lbp_codes, cell_layout())

METHODS: Mapping[str, Mapping[Literal["colour", "texture"], Feature]] = {
    "ko2012-rgb": {"colour": Feature(partial(rgb_codes, bin_count=COLOUR_BINS), _UNIFORM)},
    "ko2012-hsv": {"colour": Feature(_HSV, _UNIFORM)},
    "ko2012-hsv-kernel": {"colour": Feature(_HSV, _KERNEL)},
    "ko2012-cslbp": {"texture": _TEXTURE},
    "ko2012": {"colour": Feature(_HSV, _KERNEL), "texture": _TEXTURE},
}
"""Histograms of the methods (1) to (5) of table 2, in its order. Bins of (1) and (2) are not printed: as in (5)."""


def log_mixture(similarities: FloatArray, shares: FloatArray, form: LikelihoodForm, lambdas: FloatArray) -> FloatArray:
    """`(N,)` logarithms of a linear mixture of one likelihood per feature (9); -inf where all similarities are 0.

    Args:
        similarities: `(F, N)` Bhattacharyya similarities.
        shares: `(F,)` weight of each feature, summing to 1.
        form: Likelihood of each feature.
        lambdas: `(F,)` lambda of each feature; not used by `"linear"`.
    """
    likelihoods = similarities if form == "linear" else np.exp((similarities - 1.0) * lambdas[:, None])
    with np.errstate(divide="ignore"):
        return np.log(shares @ likelihoods)


class Ko2012(BoxFilterTracker[Ko2012Parameters, Encoded]):
    """One of `METHODS`; it draws from the stream `"tracker"` of the root seed."""

    def __init__(self, name: str, params: Ko2012Parameters, seed: int) -> None:
        super().__init__(params, seed)
        method = METHODS[name]
        self.features = tuple(method.values())
        weights = {"colour": 1.0 - params.alpha, "texture": params.alpha}
        lambdas = {"colour": params.lambda_colour, "texture": params.lambda_texture}
        self._shares = np.array([weights[cue] for cue in method] if len(method) > 1 else [1.0])
        self._lambdas = np.array([lambdas[cue] for cue in method])

    def _learn_first(self, image: Image, box: Box) -> None:
        self._model = HistogramModel(self.features, image, box)

    def observe(self, image: Image, near: FloatArray) -> Encoded:
        """The histograms of a frame."""
        return self._model.encode(image, near)

    def log_likelihood(self, seen: Encoded, wanted: FloatArray) -> FloatArray:
        """`(N,)` logarithms of (9) for `(N, 4)` boxes [px]."""
        return log_mixture(self._model.similarities(seen, wanted), self._shares, self.params.likelihood, self._lambdas)

    def similarity(self, seen: Encoded, box: Box) -> float:
        """Similarity of a `(4,)` box [px] with the model, in [0, 1]: (9) in the form `"linear"`."""
        return min(float(self._shares @ self._model.similarities(seen, box[None])[:, 0]), 1.0)


def make(name: str, *, seed: int, preset: str, **params: Any) -> Ko2012:
    """Make one of `METHODS`; raises ParameterError."""
    return Ko2012(name, Ko2012Parameters.from_preset(name, preset, params), seed)
