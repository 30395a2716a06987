"""Klein, Schulz, Frintrop & Cremers 2010, "Adaptive real-time video-tracking for arbitrary objects", IROS.

A particle filter whose likelihood is the confidence of a classifier that tells the target from its surround. Its weak
classifiers threshold Haar-like centre-surround features of regions of a box; AdaBoost chooses and weights them anew in
every frame. Known of the publication are its idea and these parts (Ko et al. 2012, section I and table 1); all else is
chosen here, see docs/papers/relatives.md.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, TypeAlias, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from pftrack_sim.core.boxes import Box, centre, from_states
from pftrack_sim.core.records import Image
from pftrack_sim.core.types import BoolArray, FloatArray
from pftrack_sim.trackers.box_filter import TUNED_FILTER, BoxFilterParameters, BoxFilterTracker
from pftrack_sim.trackers.features.histogram import histograms
from pftrack_sim.trackers.features.image_region import block_means, crop, whole_block_size
from pftrack_sim.trackers.features.integral import integral_image, rectangle_means
from pftrack_sim.trackers.papers.ko2012 import METHODS
from pftrack_sim.trackers.parameters import NotNegative, Share

POINTS = (24, 48)
"""Least columns and rows of pixels in a box after downsampling."""
CHANNEL_COUNT = 3
_OPPONENTS = np.array([[1 / 3, 1 / 3, 1 / 3], [0.5, -0.5, 0.0], [-0.25, -0.25, 0.5]], np.float32)
Samples = Annotated[int, Field(ge=2, le=1000)]


class BoostedParameters(BoxFilterParameters):
    """Parameters of the filter, the samples and the training.

    Attributes:
        sharpness: lambda of the likelihood exp(lambda c), c the classifier's confidence in [-1, 1].
        soft: Whether weak classifiers grow more certain with the distance to their threshold, see `StrongClassifier`.
        rounds: Weak classifiers of the strong one.
        positive_count: Samples of the target: the estimated box and boxes near it.
        positive_spread: Greatest shift and change of size of these, as a share of the box.
        negative_count: Samples of the surround.
        negative_from: Least shift of these, or change of size, as a share of the box.
        negative_to: Greatest shift of these, as a share of the box.
        anchor: Weight of the first frame's samples, which alone are certain to show the target, beside those of later
            frames: 0 trains on these alone.
        memory: Number of past estimates that stay samples of the target, together as heavy as the present frame's.
        learn_above: Least confidence in [0, 1] of an estimate that is learnt from.
    """

    # The filter is that of `ko2012`; the rest was chosen on four recorded sequences (BoBoT A and E, OTB Jogging-1 and
    # David). The first frame and past estimates keep the classifier from learning its own drift:
    # docs/papers/relatives.md.
    TUNED: ClassVar[Mapping[str, Any]] = {
        **TUNED_FILTER,
        "soft": True,
        "anchor": 0.3,
        "memory": 40,
        "learn_above": 0.65,
    }

    sharpness: NotNegative = 10.0
    soft: bool = False
    rounds: Annotated[int, Field(ge=1, le=1000)] = 40
    positive_count: Samples = 15
    positive_spread: Annotated[float, Field(ge=0.0, le=0.5)] = 0.04
    negative_count: Samples = 45
    negative_from: Annotated[float, Field(gt=0.0, le=2.0)] = 0.25
    negative_to: Annotated[float, Field(gt=0.0, le=2.0)] = 0.75
    anchor: Share = 0.0
    memory: Annotated[int, Field(ge=0, le=1000)] = 0
    learn_above: Share = 0.0


class Klein2010Parameters(BoostedParameters):
    """Parameters. Defaults are the preset `paper`; all values are chosen, as none of the publication is known.

    Attributes:
        divisions: Regions have 1/1, 1/2, ... 1/`divisions` of a box's sides.
        centre: Side of a region's centre as a share of the region's.
    """

    divisions: Annotated[int, Field(ge=1, le=8)] = 3
    centre: Annotated[float, Field(ge=0.1, le=0.9)] = 0.5


_LEAST = 1e-9  # Differences of means below this share of them are rounding errors


@dataclass(frozen=True, eq=False)
class StrongClassifier:
    """A weighted vote of weak classifiers.

    Attributes:
        chosen: `(T,)` indices of their features, each one once.
        thresholds: `(T,)` threshold of each.
        slopes: `(T,)` positive where values above the threshold are the target's; 1 over half the distance of the
            classes' means.
        votes: `(T,)` weights >= 0, summing to 1.
    """

    chosen: NDArray[np.intp]
    thresholds: FloatArray
    slopes: FloatArray
    votes: FloatArray

    def score(self, features: FloatArray, *, soft: bool) -> FloatArray:
        """`(N,)` confidence in [-1, 1] of `(N, T)` values of the chosen features; 1: certainly the target.

        Args:
            features: Their values.
            soft: Whether a weak classifier's answer grows linearly from the threshold to the mean of each class;
                otherwise it is -1 or 1.
        """
        margins = (features - self.thresholds) * self.slopes
        answers = np.clip(margins, -1.0, 1.0) if soft else np.where(margins > 0.0, 1.0, -1.0)
        return answers @ self.votes


def train(features: FloatArray, positive: BoolArray, weights: FloatArray, rounds: int) -> StrongClassifier:
    """Train on `(M, K)` features of M samples, of which the `(M,)` positive ones show the target.

    `weights` are `(M,)` weights >= 0 of the samples; both classes have the same total. Of K features at most `rounds`
    are chosen, fewer where none is left that is right more often than not.
    """
    current = weights.copy()
    current[positive] /= float(weights[positive].sum())
    current[~positive] /= float(weights[~positive].sum())
    target, target_deviation = _moments(features[positive], current[positive])
    other, other_deviation = _moments(features[~positive], current[~positive])
    spread = target_deviation + other_deviation
    share = np.divide(target_deviation, spread, out=np.full_like(spread, 0.5), where=spread > 0.0)
    difference = target - other
    thresholds = target - share * difference
    differs = np.abs(difference) > _LEAST * (np.abs(target) + np.abs(other))
    slopes = np.divide(2.0, difference, out=np.zeros_like(difference), where=differs)
    # 1 where a weak classifier is right about a sample, -1 where it is wrong; 0 on the threshold.
    sides = np.sign((features - thresholds) * slopes)
    right = np.where(differs, sides * np.where(positive, 1.0, -1.0)[:, None], -1.0)
    chosen: list[int] = []
    votes: list[float] = []
    current = 0.5 * current
    least_error = 0.5 / len(features)
    for _ in range(min(rounds, features.shape[1])):
        errors: FloatArray = 0.5 * (1.0 - current @ right)
        errors[chosen] = 1.0
        best = int(errors.argmin())
        if errors[best] >= 0.5:
            break
        error = max(float(errors[best]), least_error)
        vote = 0.5 * math.log((1.0 - error) / error)
        current = current * np.exp(-vote * right[:, best])
        current /= current.sum()
        chosen.append(best)
        votes.append(vote)
    index = np.array(chosen, dtype=np.intp)
    share_of_vote = np.array(votes) / sum(votes) if votes else np.empty(0)
    return StrongClassifier(index, thresholds[index], slopes[index], share_of_vote)


def _moments(features: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """`(K,)` weighted means and standard deviations of `(M, K)` features, with `(M,)` weights summing to 1."""
    mean = weights @ features
    return mean, np.sqrt(weights @ np.square(features - mean))


Measure: TypeAlias = Callable[[FloatArray, NDArray[np.intp] | None], FloatArray]
"""`(N, T)` values of the `(T,)` chosen features, or of all, in `(N, 4)` boxes [px] of one image."""


BoostedT = TypeVar("BoostedT", bound=BoostedParameters)


class BoostedTracker(BoxFilterTracker[BoostedT, Measure]):
    """A particle filter on the confidence of a classifier that is trained every frame, on any features.

    It draws from the stream `"tracker"` of the root seed.

    Attributes:
        classifier: The strong classifier for the next frame.
    """

    def __init__(self, params: BoostedT, seed: int) -> None:
        super().__init__(params, seed)
        count = params.positive_count + params.negative_count
        self._positive = np.arange(count) < params.positive_count

    @abstractmethod
    def _measure(self, image: Image, near: FloatArray) -> Measure:
        """The features of an image where boxes lie in the hull of `(N, 4)` boxes [px], the last of the usual size."""

    def _learn_first(self, image: Image, box: Box) -> None:
        self._first = self.observe(image, box[None])(self._samples(box), None)
        self._past: deque[FloatArray] = deque(maxlen=self.params.memory)
        self.classifier = train(self._first, self._positive, np.ones(len(self._first)), self.params.rounds)

    def observe(self, image: Image, near: FloatArray) -> Measure:
        """The features of a frame, also in the samples around boxes."""
        reach = self.params.negative_to * near[-1, 2:]
        low, high = near[:, :2].min(axis=0) - reach, (near[:, :2] + near[:, 2:]).max(axis=0) + reach
        return self._measure(image, np.stack([np.concatenate([low, high - low]), near[-1]]))

    def confidences(self, seen: Measure, wanted: FloatArray) -> FloatArray:
        """`(N,)` confidence in [-1, 1] of `(N, 4)` boxes [px], of the classifier of the frames before."""
        return self.classifier.score(seen(wanted, self.classifier.chosen), soft=self.params.soft)

    def log_likelihood(self, seen: Measure, wanted: FloatArray) -> FloatArray:
        """`(N,)` logarithms of the likelihood of `(N, 4)` boxes [px]."""
        return self.params.sharpness * self.confidences(seen, wanted)

    def similarity(self, seen: Measure, box: Box) -> float:
        """Confidence of a `(4,)` box [px] in [0, 1]."""
        return min(max(0.5 + 0.5 * float(self.confidences(seen, box[None])[0]), 0.0), 1.0)

    def _learn(self, seen: Measure, box: Box) -> None:
        p = self.params
        if self.similarity(seen, box) < p.learn_above:
            return
        present = seen(self._samples(box), None)
        self._past.append(present[0])
        past = np.array(self._past).reshape(-1, present.shape[1])
        values = np.concatenate([self._first, present, past])
        positive = np.concatenate([self._positive, self._positive, np.ones(len(past), np.bool_)])
        weights = np.full(len(values), 1.0 - p.anchor)
        weights[: len(self._first)] = p.anchor
        weights[len(self._first) + len(present) :] *= p.positive_count / max(len(past), 1)
        self.classifier = train(values, positive, weights, p.rounds)

    def _samples(self, box: Box) -> FloatArray:
        """`(P + Q, 4)` boxes [px]: first the positive ones, then the negative ones."""
        p, rng = self.params, self._rng
        positive = rng.uniform(-p.positive_spread, p.positive_spread, (p.positive_count, 3))
        positive[0] = 0.0
        angle = rng.uniform(0.0, 2.0 * np.pi, p.negative_count)
        distance = rng.uniform(p.negative_from, max(p.negative_from, p.negative_to), p.negative_count)
        growth = rng.uniform(-p.positive_spread, p.positive_spread, p.negative_count)
        # Every third shows the target's place at a wrong size.
        growth[::3] = distance[::3] * rng.choice([-1.0, 1.0], len(distance[::3]))
        distance[::3] = 0.0
        negative = np.column_stack([distance * np.cos(angle), distance * np.sin(angle), growth])
        moves = np.concatenate([positive, negative])
        size = box[2:] * np.exp(moves[:, 2:])
        return from_states(np.concatenate([centre(box) + moves[:, :2] * box[2:], size], axis=1))


def opponent_integral(image: Image) -> FloatArray:
    """`(H + 1, W + 1, 3)` integral image of intensity, red minus green and blue minus yellow."""
    return integral_image(np.asarray(cv2.transform(image.astype(np.float32), _OPPONENTS)))


@dataclass(frozen=True, eq=False)
class CentreSurround:
    """A set of features; feature `region * CHANNEL_COUNT + channel` belongs to one region and one channel.

    Attributes:
        regions: `(R, 4)` regions in shares of a box.
        centres: `(R, 4)` their centres.
    """

    regions: FloatArray
    centres: FloatArray

    def values(self, integral: FloatArray, boxes: FloatArray, chosen: NDArray[np.intp] | None = None) -> FloatArray:
        """`(N, T)` values of the `(T,)` chosen features, or of all, in `(N, 4)` boxes [px]."""
        if chosen is None:
            return self._of(integral, boxes, slice(None)).reshape(len(boxes), -1)
        regions, place = np.unique(chosen // CHANNEL_COUNT, return_inverse=True)
        return self._of(integral, boxes, regions)[:, place, chosen % CHANNEL_COUNT]

    def _of(self, integral: FloatArray, boxes: FloatArray, regions: NDArray[np.intp] | slice) -> FloatArray:
        """`(N, R, 3)` values of some regions."""
        rectangles = np.concatenate([self.centres[regions], self.regions[regions]])
        means = rectangle_means(integral, boxes, rectangles)
        count = len(rectangles) // 2
        return means[:, :count] - means[:, count:]


def grid_of_regions(divisions: int, centre: float) -> CentreSurround:
    """Regions of twice the side of a box, and of 1/1, 1/2, ... 1/`divisions` of it, each half over the next.

    The grid reaches half a region beyond the box, so that some regions have one half on the target and the other on its
    surround. `centre` is the side of a region's centre as a share of the region's; with 1/2 the largest region's centre
    is the box.
    """
    regions = [(-0.5, -0.5, 2.0, 2.0)]
    for count in range(1, divisions + 1):
        side = 1.0 / count
        places = 0.5 * side * np.arange(-1, 2 * count)
        regions += [(x, y, side, side) for y in places for x in places]
    found = np.array(regions)
    centres = found.copy()
    centres[:, :2] += 0.5 * (1.0 - centre) * found[:, 2:]
    centres[:, 2:] *= centre
    return CentreSurround(found, centres)


class Klein2010(BoostedTracker[Klein2010Parameters]):
    """The tracker.

    Attributes:
        pool: All features.
    """

    def __init__(self, params: Klein2010Parameters, seed: int) -> None:
        super().__init__(params, seed)
        self.pool = grid_of_regions(params.divisions, params.centre)

    def _measure(self, image: Image, near: FloatArray) -> Measure:
        region = block_means(image, near, whole_block_size(image, near[-1, 2:], POINTS))
        integral = opponent_integral(region.pixels)

        def measure(boxes: FloatArray, chosen: NDArray[np.intp] | None) -> FloatArray:
            return self.pool.values(integral, region.to_region(boxes), chosen)

        return measure


_BINS = tuple(METHODS["ko2012"].values())


class Ko2012ClassifierParameters(BoostedParameters):
    """Parameters of `ko2012-classifier`, those of `klein2010` but for its features."""

    # A share of bins tells the classes apart less surely than a centre-surround feature, so that with the 0.65 of
    # `klein2010` nothing is learnt after the first frame on most sequences: docs/papers/relatives.md.
    TUNED: ClassVar[Mapping[str, Any]] = {**BoostedParameters.TUNED, "learn_above": 0.5}


class Ko2012Classifier(BoostedTracker[Ko2012ClassifierParameters]):
    """`ko2012-classifier`: the bins of the two histograms of `ko2012` as features, the future work of Ko et al. 2012.

    AdaBoost chooses the bins that tell the target from its surround, anew every frame.
    """

    def _measure(self, image: Image, near: FloatArray) -> Measure:
        region = crop(image, near)
        codes = [feature.encode(region.pixels) for feature in _BINS]

        def measure(boxes: FloatArray, chosen: NDArray[np.intp] | None) -> FloatArray:
            local = region.to_region(boxes)
            parts = [histograms(one, local, feature.layout) for one, feature in zip(codes, _BINS, strict=True)]
            values = np.concatenate(parts, axis=1)
            return values if chosen is None else values[:, chosen]

        return measure


def make(name: str, *, seed: int, preset: str, **params: Any) -> Klein2010 | Ko2012Classifier:
    """Make `klein2010` or `ko2012-classifier`; raises ParameterError."""
    if name == "klein2010":
        return Klein2010(Klein2010Parameters.from_preset(name, preset, params), seed)
    return Ko2012Classifier(Ko2012ClassifierParameters.from_preset(name, preset, params), seed)
