"""A classifier's score as likelihood: the future work that Ko et al. 2012 announce in their conclusion.

The histograms are those of `ko2012`, the classifier that of `klein2010`: AdaBoost chooses bins of both histograms that
tell the target from its surround, anew every frame.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.records import Image
from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.features.histogram import histograms
from pftrack_sim.trackers.features.image_region import crop
from pftrack_sim.trackers.papers.ko2012 import METHODS
from pftrack_sim.trackers.relatives.klein2010 import BoostedParameters, BoostedTracker, Measure

_METHOD = METHODS["ko2012"]
_FEATURES = tuple(one for one in (_METHOD.colour, _METHOD.texture) if one is not None)


class Ko2012ClassifierParameters(BoostedParameters):
    """Parameters, those of `klein2010` but for its features."""

    # A share of bins tells the classes apart less surely than a centre-surround feature, so that with the 0.65 of
    # `klein2010` nothing is learnt after the first frame on most sequences: docs/papers/relatives.md.
    TUNED: ClassVar[Mapping[str, Any]] = MappingProxyType({**BoostedParameters.TUNED, "learn_above": 0.5})


class Ko2012Classifier(BoostedTracker[Ko2012ClassifierParameters]):
    """The tracker; its features are the bins of the two histograms."""

    def _measure(self, image: Image, near: FloatArray) -> Measure:
        region = crop(image, near)
        codes = [feature.encode(region.pixels) for feature in _FEATURES]

        def measure(boxes: FloatArray, chosen: NDArray[np.intp] | None) -> FloatArray:
            local = region.to_region(boxes)
            parts = [histograms(one, local, feature.layout) for one, feature in zip(codes, _FEATURES, strict=True)]
            values = np.concatenate(parts, axis=1)
            return values if chosen is None else values[:, chosen]

        return measure


def make(name: str, *, seed: int, preset: str, **params: Any) -> Ko2012Classifier:
    """Make the tracker; raises ParameterError."""
    return Ko2012Classifier(Ko2012ClassifierParameters.from_preset(name, preset, params), seed)
