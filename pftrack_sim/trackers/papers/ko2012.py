"""Ko, Nam & Kwak 2012, "Object Tracking Using Particle Filters in Moving Camera", J. KICS: its five methods.

A particle filter on the box of the target (eq. 10) with a random walk (eq. 11), weighed by two histograms of the first
frame: HSV colour under an Epanechnikov kernel (eq. 1) and CS-LBP texture in 4x4 cells (eq. 2 and 3), compared by
Bhattacharyya (eq. 7) and mixed linearly (eq. 9). The estimate is the mean of the heaviest particles (eq. 12), and a
jump is not believed (eq. 13). The four methods it is compared with (section IV) are the same filter with one histogram.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core import boxes, random_streams
from pftrack_sim.core.boxes import Box
from pftrack_sim.core.records import Estimate, Image
from pftrack_sim.trackers.base import BaseTracker
from pftrack_sim.trackers.features.colour import hsv_codes, rgb_codes
from pftrack_sim.trackers.features.histogram import cell_layout, epanechnikov_layout, flat_layout
from pftrack_sim.trackers.features.likelihood import Form, log_mixture
from pftrack_sim.trackers.features.model import Feature, HistogramModel
from pftrack_sim.trackers.features.texture import PATTERN_COUNT, cs_lbp_codes
from pftrack_sim.trackers.filters import ParticleFilter, RandomWalk
from pftrack_sim.trackers.params import Between, settle

COLOUR_BINS = 128
MIN_SIZE_PX = 2.0
_LEAST = np.array([0.0, 0.0, MIN_SIZE_PX, MIN_SIZE_PX])


@dataclass(frozen=True)
class Params:
    """The numbers of the method; those of the preset `paper` stand here, the printed ones with their equation.

    Attributes:
        particle_count: Number of particles. Not printed: 100.
        sigma_centre: Noise of the centre per frame (11), in `sigma_unit`. Printed: 1 px.
        sigma_size: Noise of width and height per frame (11), in `sigma_unit`. Printed: 0.64 px.
        size_correlation: Correlation of the noises of width and height: 0 as printed, where each goes its own way; 1
            keeps the box's shape. Not in the paper.
        sigma_unit: `"px"`, as printed (for 320x240 images), or `"box"`: a share of the estimated box, so that the
            noise fits near and far targets and every image size: the centre's of the square root of its area (a
            camera shakes alike both ways), width's and height's each of itself.
        alpha: Share of texture in the mixture (9). Printed: 0.4. Not used by the methods of one histogram.
        likelihood: `"linear"`: the Bhattacharyya coefficient 1 - d^2, the decreasing function of d nearest to what
            is printed; `"exponential"`: exp(-lambda d^2). As printed (8, 9) the weight is d^2, which would favour
            whatever is least like the target.
        lambda_colour: Sharpness of the colour's exponential likelihood. Not printed.
        lambda_texture: Sharpness of the texture's exponential likelihood. Not printed.
        top_count: N of the top-N mean (12). Not printed: 10. With 1 it is the heaviest particle, as in the abstract.
        hold_distance: T of the hold (13), as a multiple of the square root of the box's area. Not printed: 0.5.
        redraw: Where the next particles start: `"weights"`: systematic resampling; `"estimate"`: all at the new
            state, which the text of section 3.3.2 can also be read to mean.
        particles: Whether estimates carry the particles.
    """

    particle_count: Annotated[int, Between(1, 100_000)] = 100
    sigma_centre: Annotated[float, Between(0.0, 1000.0)] = 1.0
    sigma_size: Annotated[float, Between(0.0, 1000.0)] = 0.64
    size_correlation: Annotated[float, Between(0.0, 1.0)] = 0.0
    sigma_unit: Literal["px", "box"] = "px"
    alpha: Annotated[float, Between(0.0, 1.0)] = 0.4
    likelihood: Form = "linear"
    lambda_colour: Annotated[float, Between(0.0, 10_000.0)] = 20.0
    lambda_texture: Annotated[float, Between(0.0, 10_000.0)] = 20.0
    top_count: Annotated[int, Between(1, 100_000)] = 10
    hold_distance: Annotated[float, Between(0.0, 1000.0)] = 0.5
    redraw: Literal["weights", "estimate"] = "weights"
    particles: bool = False


PAPER = Params()
# `default` is the same method with other numbers, chosen by a coarse search on four recorded sequences (BoBoT A and E,
# OTB Jogging-1 and David): noise in step with the target's size, which a shaking camera needs; a box that keeps its
# shape; particles that start at the new state, as the abstract says; and a likelihood that tells particles apart.
# docs/papers/ko2012.md says what each of them is worth.
PRESETS = {
    "paper": PAPER,
    "default": replace(
        PAPER,
        particle_count=400,
        sigma_centre=0.2,
        sigma_size=0.025,
        size_correlation=1.0,
        sigma_unit="box",
        likelihood="exponential",
        lambda_colour=20.0,
        lambda_texture=20.0,
        top_count=20,
        hold_distance=0.6,
        redraw="estimate",
    ),
}


@dataclass(frozen=True, eq=False)
class Method:
    """What is looked at; None is left out. All five methods share the filter and its numbers (section IV)."""

    colour: Feature | None = None
    texture: Feature | None = None


_HSV = partial(hsv_codes, bin_count=COLOUR_BINS)
_FLAT, _KERNEL = flat_layout(3, COLOUR_BINS), epanechnikov_layout(3, COLOUR_BINS)
_TEXTURE = Feature(cs_lbp_codes, cell_layout(4, 4, 1, PATTERN_COUNT))

METHODS = {
    "ko2012-rgb": Method(colour=Feature(partial(rgb_codes, bin_count=COLOUR_BINS), _FLAT)),
    "ko2012-hsv": Method(colour=Feature(_HSV, _FLAT)),
    "ko2012-hsv-kernel": Method(colour=Feature(_HSV, _KERNEL)),
    "ko2012-cslbp": Method(texture=_TEXTURE),
    "ko2012": Method(colour=Feature(_HSV, _KERNEL), texture=_TEXTURE),
}
"""Methods (1) to (5) of table 2, in its order. Bins of (1) and (2) are not printed: as in the proposed method."""


class Ko2012(BaseTracker):
    """One of the methods with its numbers.

    Args:
        method: What is looked at.
        params: The numbers.
        seed: Root seed; the tracker draws from its stream `"tracker"`.
    """

    def __init__(self, method: Method, params: Params, seed: int) -> None:
        super().__init__()
        self.params = params
        self.features, self._shares, self._sharpness = _mixture(method, params)
        self._seed = seed
        self._model: HistogramModel
        self._filter: ParticleFilter
        self._state = np.zeros(4)

    def _start(self, image: Image, box: Box) -> None:
        self._model = HistogramModel(self.features, image, box)
        self._state = _state(box)
        states = np.tile(self._state, (self.params.particle_count, 1))
        self._filter = ParticleFilter(states, random_streams.stream(self._seed, "tracker"))

    def _follow(self, image: Image) -> Estimate:
        height_px, width_px = image.shape[:2]
        moving = self._filter
        moving.predict(RandomWalk(self._sigma(), self.params.size_correlation))
        most = np.array([width_px, height_px, 2.0 * width_px, 2.0 * height_px])
        np.clip(moving.states, _LEAST, most, out=moving.states)
        particles = boxes.from_states(moving.states)
        # The estimate lies among the particles, unless it is held.
        look = self._model.look(image, np.concatenate([particles, boxes.from_states(self._state[None])]))
        alike = look.similarities(particles)
        moving.weigh(log_mixture(alike, self._shares, self.params.likelihood, self._sharpness))
        state = moving.mean(self.params.top_count)
        held = self._jumped(state)
        if not held:
            self._state = state
        # After a hold the particles stand around a false state: they start again from the one that is kept.
        if held or self.params.redraw == "estimate":
            moving.restart(self._state)
        else:
            moving.resample()
        box = boxes.from_states(self._state[None])
        confidence = float(self._shares @ look.similarities(box)[:, 0])
        return Estimate(box[0], min(confidence, 1.0), held, particles if self.params.particles else None)

    def _sigma(self) -> tuple[float, ...]:
        """Noise of x, y, w, h per frame [px]."""
        p = self.params
        if p.sigma_unit == "px":
            return p.sigma_centre, p.sigma_centre, p.sigma_size, p.sigma_size
        width, height = float(self._state[2]), float(self._state[3])
        side = math.sqrt(width * height)
        return p.sigma_centre * side, p.sigma_centre * side, p.sigma_size * width, p.sigma_size * height

    def _jumped(self, state: NDArray[np.float64]) -> bool:
        limit_px = self.params.hold_distance * float(np.sqrt(self._state[2] * self._state[3]))
        return float(np.hypot(*(state[:2] - self._state[:2]))) >= limit_px


def make(name: str, *, seed: int, preset: str, **params: Any) -> Ko2012:
    """Factory of all five; `params` are those of `Params`.

    Args:
        name: One of `METHODS`.
        seed: Root seed.
        preset: One of `PRESETS`.
        params: The user's own numbers.

    Raises:
        ParameterError: An unknown preset or parameter, or a value that is not allowed.
    """
    return Ko2012(METHODS[name], settle(name, PRESETS, preset, params), seed)


make_rgb = partial(make, "ko2012-rgb")
make_hsv = partial(make, "ko2012-hsv")
make_hsv_kernel = partial(make, "ko2012-hsv-kernel")
make_cslbp = partial(make, "ko2012-cslbp")
make_proposed = partial(make, "ko2012")


def _mixture(method: Method, params: Params) -> tuple[tuple[Feature, ...], NDArray[np.float64], NDArray[np.float64]]:
    """The features with the `(F,)` share and the `(F,)` sharpness of each (9)."""
    parts = (
        (method.colour, 1.0 - params.alpha, params.lambda_colour),
        (method.texture, params.alpha, params.lambda_texture),
    )
    features, shares, sharpness = zip(*(part for part in parts if part[0] is not None), strict=True)
    return features, np.array(shares if len(features) > 1 else [1.0]), np.array(sharpness)


def _state(box: Box) -> NDArray[np.float64]:
    """`(4,)` centre x, y, width, height of a box (10) [px]."""
    return np.concatenate([boxes.centre(box), box[2:]])
