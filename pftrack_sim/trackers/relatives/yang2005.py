"""Yang, Duraiswami & Davis 2005, "Fast Multiple Object Tracking via a Hierarchical Particle Filter", ICCV.

Many particles, drawn quasi-randomly, are observed from coarse to fine: every stage of a cascade costs more than the one
before and sees only the particles that those before left. The stages are the mean colours of rectangles and edge
orientation histograms, both by integral images (the publication's abstract), Haar-like features, and a descriptor like
SIFT for the last (as Ko et al. 2012, section I and table 1, describe the method).
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Annotated, Any, ClassVar

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy.special import ndtri
from scipy.stats import qmc

from pftrack_sim.core.boxes import Box
from pftrack_sim.core.records import Image
from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.box_filter import TUNED_WALK, BoxFilterParameters, BoxFilterTracker
from pftrack_sim.trackers.features.hog import hog
from pftrack_sim.trackers.features.image_region import ImageRegion
from pftrack_sim.trackers.features.integral import integral_image, rectangle_means
from pftrack_sim.trackers.filters import RandomWalk
from pftrack_sim.trackers.parameters import Count, NotNegative, Positive

POINTS = (24, 48)
"""Columns and rows of blocks in the first box: the resolution at which the target is observed."""
ROWS, COLUMNS = 3, 2
"""Rectangles of colour and of edge orientation."""
DIRECTION_COUNT = 8
SIFT_CLIP = 0.2
"""Greatest value of a unit descriptor before it is normalised again (Lowe 2004)."""
STAGES: tuple[str, ...] = ("colour", "orientation", "haar", "sift")
_SOBOL_BITS = 64  # The sequence has 2^64 points, so that no tracker comes to its end
_LEAST_SHARE = 1e-12


class Yang2005Parameters(BoxFilterParameters):
    """Parameters. Defaults are the preset `paper`; none of the publication's values is known here.

    Those of the filter: `BoxFilterParameters`, here without a rejection of jumps, and with the mean of all particles.

    Attributes:
        particle_count: Number of particles; powers of two are covered best by the quasi-random sequence.
        sigma_colour: Width of the likelihood exp(-d^2 / 2 sigma^2) of the rectangles' colours; d is the root mean
            square difference, in shares of full scale.
        sigma_orientation: The same of edge orientations; d is the Bhattacharyya distance.
        sigma_haar: The same of the Haar-like features, as for colours.
        sigma_sift: The same of the descriptor; d is half the distance of unit vectors.
        keep_colour: Share of the particles that the stage of colour leaves.
        keep_orientation: Share of those that the stage of orientations leaves.
        keep_haar: Share of those that the stage of Haar-like features leaves.
        quasi_random: Whether the particles' noise is a Sobol sequence; otherwise its draws are independent.
    """

    TUNED: ClassVar[Mapping[str, Any]] = {
        **TUNED_WALK,
        "top_count": 10,
        "redraw": "estimate",
        "hold_below": 0.4,
        "held_noise": 2.0,
        "sigma_colour": 0.2,
    }

    particle_count: Count = 512
    sigma_centre: NotNegative = 4.0
    sigma_size: NotNegative = 1.0
    top_count: Count = 512
    hold_distance: NotNegative = 1000.0
    sigma_colour: Positive = 0.1
    sigma_orientation: Positive = 0.15
    sigma_haar: Positive = 0.1
    sigma_sift: Positive = 0.25
    keep_colour: Annotated[float, Field(gt=0.0, le=1.0)] = 0.25
    keep_orientation: Annotated[float, Field(gt=0.0, le=1.0)] = 0.5
    keep_haar: Annotated[float, Field(gt=0.0, le=1.0)] = 0.5
    quasi_random: bool = True


class CascadeRegion:
    """The features of one frame near the particles; each is computed when its stage first asks for it."""

    def __init__(self, region: ImageRegion) -> None:
        self._region = region
        self._grey = np.asarray(cv2.cvtColor(region.pixels, cv2.COLOR_RGB2GRAY), dtype=np.uint8)

    @cached_property
    def _colours(self) -> FloatArray:
        return integral_image(self._region.pixels)

    @cached_property
    def _orientations(self) -> FloatArray:
        return integral_image(orientation_channels(self._grey, DIRECTION_COUNT))

    @cached_property
    def _brightness(self) -> FloatArray:
        return integral_image(self._grey)

    def features(self, stage: str, wanted: FloatArray) -> FloatArray:
        """`(N, F)` features of a stage of `(N, 4)` boxes [px]; distances are those of `distances`."""
        local = self._region.to_region(wanted)
        if stage == "colour":
            return rectangle_means(self._colours, local, _CELLS).reshape(len(wanted), -1) / 255.0
        if stage == "orientation":
            # Differences of sums may be a rounding error below 0.
            energy = np.maximum(rectangle_means(self._orientations, local, _CELLS).reshape(len(wanted), -1), 0.0)
            # Square roots of shares: their scalar product is the Bhattacharyya similarity.
            return np.sqrt(energy / np.maximum(energy.sum(axis=1, keepdims=True), 1e-9))
        if stage == "haar":
            return rectangle_means(self._brightness, local, _HAAR_PARTS)[..., 0] @ _HAAR_SIGNS / 255.0
        return _unit(np.minimum(_unit(hog(self._grey, local)), SIFT_CLIP))


def orientation_channels(grey: NDArray[np.uint8], bin_count: int) -> NDArray[np.float32]:
    """`(H, W, bin_count)` gradient magnitude (Sobel, 3x3) of every pixel, in the channel of its edge's orientation.

    The first bin begins at a horizontal gradient; orientations are those of lines, 0 to 180 degrees, so that a dark
    target on a bright background has those of a bright one on a dark background.
    """
    right = np.asarray(cv2.Sobel(grey, cv2.CV_32F, 1, 0, ksize=3), dtype=np.float32)
    down = np.asarray(cv2.Sobel(grey, cv2.CV_32F, 0, 1, ksize=3), dtype=np.float32)
    angle = np.mod(np.arctan2(down, right), np.float32(np.pi))
    bins = np.minimum((angle * np.float32(bin_count / np.pi)).astype(np.intp), bin_count - 1)
    out = np.zeros((*grey.shape, bin_count), np.float32)
    np.put_along_axis(out, bins[..., None], np.hypot(right, down)[..., None], axis=2)
    return out


def _unit(vectors: FloatArray) -> FloatArray:
    """`(N, F)` vectors of length 1, or 0 where they are 0."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-9)


def distances(stage: str, features: FloatArray, model: FloatArray) -> FloatArray:
    """`(N,)` distances of `(N, F)` features from the `(F,)` ones of the target."""
    if stage == "orientation":
        return np.sqrt(np.maximum(1.0 - features @ model, 0.0))
    squares = np.square(features - model)
    return 0.5 * np.sqrt(squares.sum(axis=1)) if stage == "sift" else np.sqrt(squares.mean(axis=1))


class SobolNormals:
    """Quasi-random normal noise: a scrambled Sobol sequence through the inverse normal distribution.

    Its points cover the space more evenly than independent ones, most so if their number is a power of two: successive
    draws of 2^k points are then digital nets (Owen 1998). It goes on from draw to draw.

    Args:
        dimension: D, number of components.
        rng: Source of the scrambling.
    """

    def __init__(self, dimension: int, rng: np.random.Generator) -> None:
        self._sequence = qmc.Sobol(dimension, scramble=True, bits=_SOBOL_BITS, rng=rng)

    def draw(self, count: int) -> FloatArray:
        """`(count, D)` next values; of a number that is no power of two, the first of the next power."""
        uniform = self._sequence.random(1 << (count - 1).bit_length())[:count]
        # 0 and 1 lie at infinity.
        return np.asarray(ndtri(np.clip(uniform, _LEAST_SHARE, 1.0 - _LEAST_SHARE)), dtype=np.float64)


class Yang2005(BoxFilterTracker[Yang2005Parameters, CascadeRegion]):
    """Tracker by a cascade of observations."""

    def __init__(self, params: Yang2005Parameters, seed: int) -> None:
        super().__init__(params, seed)
        p = params
        sigmas = (p.sigma_colour, p.sigma_orientation, p.sigma_haar, p.sigma_sift)
        self._sigmas = dict(zip(STAGES, sigmas, strict=True))
        self._kept = dict(zip(STAGES, (p.keep_colour, p.keep_orientation, p.keep_haar, 1.0), strict=True))

    def _learn_first(self, image: Image, box: Box) -> None:
        self._normals = SobolNormals(4, self._rng).draw if self.params.quasi_random else None
        seen = self.observe(image, box[None])
        self._model = {stage: seen.features(stage, box[None])[0] for stage in STAGES}

    def _dynamics(self, sigma: tuple[float, float, float, float]) -> RandomWalk:
        return RandomWalk(sigma, self.params.size_correlation, self._normals)

    def observe(self, image: Image, near: FloatArray) -> CascadeRegion:
        """The features of a frame."""
        return CascadeRegion(self._blocks(image, near, POINTS))

    def survivors(self, seen: CascadeRegion, wanted: FloatArray) -> tuple[FloatArray, dict[str, NDArray[np.intp]]]:
        """`(N,)` logarithms of the likelihood of `(N, 4)` boxes [px], and the indices that each stage has observed.

        A stage adds its own logarithm and leaves the most likely so far; -inf for those that it rejects.
        """
        total = np.zeros(len(wanted))
        alive = np.arange(len(wanted))
        observed: dict[str, NDArray[np.intp]] = {}
        for stage in STAGES:
            observed[stage] = alive
            total[alive] += self._stage_log_likelihood(stage, seen, wanted[alive])
            count = max(round(self._kept[stage] * len(alive)), 1)
            order = np.argsort(-total[alive], kind="stable")  # ties are broken alike on every machine
            total[alive[order[count:]]] = -np.inf
            alive = np.sort(alive[order[:count]])
        return total, observed

    def log_likelihood(self, seen: CascadeRegion, wanted: FloatArray) -> FloatArray:
        """`(N,)` logarithms of the likelihood, see `survivors`."""
        return self.survivors(seen, wanted)[0]

    def similarity(self, seen: CascadeRegion, box: Box) -> float:
        """Geometric mean of the stages' likelihoods of a `(4,)` box [px], in [0, 1]."""
        logarithms = [float(self._stage_log_likelihood(stage, seen, box[None])[0]) for stage in STAGES]
        return float(np.exp(np.mean(logarithms)))

    def _stage_log_likelihood(self, stage: str, seen: CascadeRegion, wanted: FloatArray) -> FloatArray:
        away = distances(stage, seen.features(stage, wanted), self._model[stage])
        return -0.5 * np.square(away / self._sigmas[stage])


def _haar_features() -> tuple[FloatArray, FloatArray]:
    """Rectangles of the Haar-like features, and the `(R, F)` sign of each in each feature.

    In the box and in each of its quarters: left less right, upper less lower, and middle less both sides.
    """
    areas = [(0.0, 0.0, 1.0, 1.0), *((j / 2, i / 2, 0.5, 0.5) for i in range(2) for j in range(2))]
    halves = [(0.0, 0.0, 0.5, 1.0), (0.5, 0.0, 0.5, 1.0), (0.0, 0.0, 1.0, 0.5), (0.0, 0.5, 1.0, 0.5)]
    thirds = [(k / 3, 0.0, 1 / 3, 1.0) for k in range(3)]
    parts = [(x + a * w, y + b * h, c * w, d * h) for x, y, w, h in areas for a, b, c, d in (*halves, *thirds)]
    signs = np.array([[1, -1, 0, 0, 0, 0, 0], [0, 0, 1, -1, 0, 0, 0], [0, 0, 0, 0, -0.5, 1, -0.5]]).T
    return np.array(parts), np.asarray(np.kron(np.eye(len(areas)), signs), dtype=np.float64)


_CELLS = np.array([(j / COLUMNS, i / ROWS, 1 / COLUMNS, 1 / ROWS) for i in range(ROWS) for j in range(COLUMNS)])
_HAAR_PARTS, _HAAR_SIGNS = _haar_features()


def make(name: str, *, seed: int, preset: str, **params: Any) -> Yang2005:
    """Make the tracker; raises ParameterError."""
    return Yang2005(Yang2005Parameters.from_preset(name, preset, params), seed)
