"""Lee et al. 2012, "Robust Object Tracking in Mobile Robots ...", J. ICROS: its method, and what it is compared with.

The whole title: "Robust object tracking in mobile robots using object features and on-line learning based particle
filter". A particle filter on the box and its velocity (eq. 8 and 9), weighed by an HSV histogram (eq. 1) and a HOG
descriptor (eq. 2 to 5) of the box resized to 16x24, mixed linearly (eq. 14). Until frame 40 both are compared with the
first frame (eq. 10 and 11); from then on with the subspace of the last 40 estimates, learnt incrementally (eq. 6, 7, 12
and 13).
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated, Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core import boxes, random_streams
from pftrack_sim.core.boxes import Box
from pftrack_sim.core.records import Estimate, Image
from pftrack_sim.trackers.base import BaseTracker
from pftrack_sim.trackers.features.blocks import block_size, read_blocks
from pftrack_sim.trackers.features.colour import hsv_joint_codes
from pftrack_sim.trackers.features.histogram import distance_layout, histograms
from pftrack_sim.trackers.features.hog import COLUMNS, ROWS, hog
from pftrack_sim.trackers.features.subspace import SlidingSubspace, residuals
from pftrack_sim.trackers.filters import ConstantVelocity, ParticleFilter
from pftrack_sim.trackers.params import Between, settle

COLOUR_BINS = (8, 8, 4)
MIN_SIZE_SHARE = 0.1
"""Of the first box: no particle is narrower or lower. Not in pixels, which would tell image sizes apart."""
_LAYOUT = distance_layout(ROWS, COLUMNS, 1, math.prod(COLOUR_BINS))


@dataclass(frozen=True)
class Params:
    """The numbers of the method; those of the preset `paper` stand here, the printed ones with their equation.

    Attributes:
        particle_count: Number of particles. Printed: 100.
        noise_width: Half the width of the uniform noise of the box's width per frame (9), in `noise_unit`.
            Printed: 2.5 px.
        noise_height: The same of its height. Printed: 2.5 px.
        noise_velocity_x: The same of the velocity across. Printed: 6.5 px per frame.
        noise_velocity_y: The same of the velocity down. Printed: 2.5 px per frame.
        noise_unit: `"px"`, as printed (for 640x480 images), or `"box"`: a share of the estimated box, so that the
            noise fits near and far targets and every image size: the velocity's of the square root of its area,
            width's and height's each of itself.
        keep_shape: Whether width and height share one noise, so that the box keeps its shape: False as printed.
        start_spread: The first particles' centres lie uniformly around the given box, up to this share of its width
            and height away. Not printed: 0.1.
        alpha: Share of colour in the mixture (14). Printed: 0.1. Not used by colour alone.
        sigma_colour: Width of the colour's likelihood until learning starts (10). Printed: 0.4. As printed the
            exponent has 1 - D^2, which would favour whatever is least like the target: D^2 is meant.
        sigma_hog: The same of HOG's (11). Printed: 0.4.
        window: T and n: the frame at which learning starts, and how many estimates are learnt from. Printed: 40, both.
        component_count: Columns of U used in (12) and (13). Not printed: 10.
        learned_sigma_colour: Width of the colour's likelihood once it is learnt (12). Printed: 0.4.
        learned_sigma_hog: The same of HOG's (13). Printed: 0.4.
        learned_scale: Scale of the vectors that are learnt: `"sum"`: as they are compared before, summing to 1;
            `"length"`: of length 1; `"root"`: the square roots, of length 1 too, between which distances are those
            of Bhattacharyya. Not printed (the factor f of (5)): `"sum"`.
        learn_above: Least confidence at which `lee2012-checked` learns from an estimate, as a share of the mean of
            the last `window` it learnt from. Not in the paper, whose method learns from all; its conclusion names
            that as its weakness.
        particles: Whether estimates carry the particles.
    """

    particle_count: Annotated[int, Between(1, 100_000)] = 100
    noise_width: Annotated[float, Between(0.0, 1000.0)] = 2.5
    noise_height: Annotated[float, Between(0.0, 1000.0)] = 2.5
    noise_velocity_x: Annotated[float, Between(0.0, 1000.0)] = 6.5
    noise_velocity_y: Annotated[float, Between(0.0, 1000.0)] = 2.5
    noise_unit: Literal["px", "box"] = "px"
    keep_shape: bool = False
    start_spread: Annotated[float, Between(0.0, 10.0)] = 0.1
    alpha: Annotated[float, Between(0.0, 1.0)] = 0.1
    sigma_colour: Annotated[float, Between(0.001, 1000.0)] = 0.4
    sigma_hog: Annotated[float, Between(0.001, 1000.0)] = 0.4
    window: Annotated[int, Between(2, 1000)] = 40
    component_count: Annotated[int, Between(1, 1000)] = 10
    learned_sigma_colour: Annotated[float, Between(0.001, 1000.0)] = 0.4
    learned_sigma_hog: Annotated[float, Between(0.001, 1000.0)] = 0.4
    learned_scale: Literal["sum", "length", "root"] = "sum"
    learn_above: Annotated[float, Between(0.0, 1.0)] = 0.9
    particles: bool = False


PAPER = Params()
# `default` is the same method with other numbers, chosen by a coarse search on four recorded sequences (BoBoT A and E,
# OTB Jogging-1 and David): noise in step with the target's size, a box that keeps its shape, and likelihoods half as
# wide over few components, which tell particles apart.
PRESETS = {
    "paper": PAPER,
    "default": replace(
        PAPER,
        particle_count=400,
        noise_unit="box",
        noise_width=0.02,
        noise_height=0.02,
        noise_velocity_x=0.1,
        noise_velocity_y=0.05,
        keep_shape=True,
        sigma_colour=0.22,
        sigma_hog=0.22,
        component_count=4,
        learned_sigma_colour=0.15,
        learned_sigma_hog=0.15,
        learned_scale="root",
    ),
}


@dataclass(frozen=True)
class Method:
    """What is looked at, and whether it is learnt; the filter is the same.

    Attributes:
        shape: Whether HOG is looked at besides colour.
        learning: Whether it is learnt on line.
        checked: Whether only estimates like the target are learnt from.
    """

    shape: bool = True
    learning: bool = True
    checked: bool = False


METHODS = {
    "lee2012-color": Method(shape=False, learning=False),
    "lee2012-color-hog": Method(learning=False),
    "lee2012": Method(),
    "lee2012-checked": Method(checked=True),
}
"""The columns of table 3, in its order, and a variant that is not in the paper."""


class Lee2012(BaseTracker):
    """One of the methods with its numbers.

    Args:
        method: What is looked at.
        params: The numbers.
        seed: Root seed; the tracker draws from its stream `"tracker"`.
    """

    def __init__(self, method: Method, params: Params, seed: int) -> None:
        super().__init__()
        self.params = params
        self._method = method
        self._seed = seed
        self._filter: ParticleFilter
        self._models: tuple[_Model, ...]
        self._state = np.zeros(6)
        self._first_size = np.zeros(2)
        self._usual: deque[float] = deque(maxlen=params.window)

    def _start(self, image: Image, box: Box) -> None:
        p = self.params
        rng = random_streams.stream(self._seed, "tracker")
        self._state = np.concatenate([boxes.centre(box), box[2:], np.zeros(2)])
        states = np.tile(self._state, (p.particle_count, 1))
        states[:, :2] += rng.uniform(-1.0, 1.0, (p.particle_count, 2)) * p.start_spread * box[2:]
        self._filter = ParticleFilter(states, rng)
        self._usual.clear()
        self._first_size = np.array(box[2:])
        first = _Look(image, box[None], self._block(), self._method.shape).features(box[None])
        window = p.window if self._method.learning else 0
        share = p.alpha if self._method.shape else 1.0
        kinds = ((share, p.sigma_colour, p.learned_sigma_colour), (1.0 - share, p.sigma_hog, p.learned_sigma_hog))
        self._models = tuple(_Model(feature[0], *kind, window, p) for feature, kind in zip(first, kinds, strict=False))

    def _follow(self, image: Image) -> Estimate:
        height_px, width_px = image.shape[:2]
        moving = self._filter
        moving.predict(ConstantVelocity(self._reach(), self.params.keep_shape))
        moving.states[:, :2] = np.clip(moving.states[:, :2], 0.0, (width_px, height_px))
        moving.states[:, 2:4] = np.maximum(moving.states[:, 2:4], MIN_SIZE_SHARE * self._first_size)
        moving.states[:, 2:4] = np.minimum(moving.states[:, 2:4], (2.0 * width_px, 2.0 * height_px))
        particles = boxes.from_states(moving.states)
        look = _Look(image, particles, self._block(), self._method.shape)
        pairs = list(zip(self._models, look.features(particles), strict=True))
        with np.errstate(divide="ignore"):
            moving.weigh(np.log(sum(model.share * model.likelihood(seen) for model, seen in pairs)))
        self._state = moving.mean()
        moving.resample()
        box = boxes.from_states(self._state[None])
        pairs = list(zip(self._models, look.features(box), strict=True))
        confidence = min(sum(model.share * float(model.similarity(seen)[0]) for model, seen in pairs), 1.0)
        if not self._method.checked or self._believed(confidence):
            for model, seen in pairs:
                model.learn(seen[0])
        return Estimate(box[0], confidence, False, particles if self.params.particles else None)

    def _believed(self, confidence: float) -> bool:
        """Whether the target is there, as far as can be told from how like it the last were that were believed."""
        believed = not self._usual or confidence >= self.params.learn_above * sum(self._usual) / len(self._usual)
        if believed:
            self._usual.append(confidence)
        return believed

    def _block(self) -> tuple[float, float]:
        """Width and height of the blocks in which the image is read [px]."""
        return block_size(self._first_size, self._state[2:4], (COLUMNS, ROWS))

    def _reach(self) -> tuple[float, float, float, float]:
        """Half the width of the noise of w, h, vx, vy per frame [px]."""
        p = self.params
        if p.noise_unit == "px":
            return p.noise_width, p.noise_height, p.noise_velocity_x, p.noise_velocity_y
        width, height = float(self._state[2]), float(self._state[3])
        side = math.sqrt(width * height)
        return p.noise_width * width, p.noise_height * height, p.noise_velocity_x * side, p.noise_velocity_y * side


class _Look:
    """One image, read where the particles are.

    Args:
        image: `(H, W, 3)` uint8 RGB.
        near: `(N, 4)` boxes [px]; those asked for later lie within their hull.
        block: Width and height of the blocks in which the image is read [px].
        shape: Whether HOG is wanted.
    """

    def __init__(self, image: Image, near: NDArray[np.float64], block: tuple[float, float], shape: bool) -> None:
        self._part = read_blocks(image, near, block)
        self._codes = hsv_joint_codes(self._part.pixels, COLOUR_BINS)
        grey = cv2.cvtColor(self._part.pixels, cv2.COLOR_RGB2GRAY) if shape else None
        self._grey = None if grey is None else np.asarray(grey, dtype=np.uint8)

    def features(self, wanted: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        """Colour `(N, 256)` and, where it is wanted, HOG `(N, 192)` of `(N, 4)` boxes [px]."""
        local = self._part.local(wanted)
        colour = histograms(self._codes, local, _LAYOUT)
        return [colour] if self._grey is None else [colour, hog(self._grey, local)]


class _Model:
    """What the target looks like in one feature: the first frame until enough was seen, a subspace from then on.

    Args:
        first: `(d,)` the feature of the first frame.
        share: Its share of the mixture (14).
        sigma: Width of the likelihood of (10) or (11).
        learned_sigma: Width of the likelihood of (12) or (13).
        window: How many are learnt from; 0 for never.
        params: The numbers that both features share.
    """

    def __init__(
        self, first: NDArray[np.float64], share: float, sigma: float, learned_sigma: float, window: int, params: Params
    ) -> None:
        self.share = share
        self._root = np.sqrt(_divided(first[None], first[None].sum(axis=1))[0])
        self._sigmas = sigma, learned_sigma
        self._window = window
        self._count = params.component_count
        self._scale = params.learned_scale
        self._seen: deque[NDArray[np.float64]] = deque(maxlen=window)
        self._subspace: SlidingSubspace | None = None
        self.learn(first)

    def likelihood(self, seen: NDArray[np.float64]) -> NDArray[np.float64]:
        """`(N,)` p(z|x) of `(N, d)` features: (10) and (11) with D^2, (12) and (13) with the norm D."""
        learned = self._subspace is not None
        distance = self._distances(seen) if learned else 1.0 - self._coefficients(seen)
        sigma = self._sigmas[learned]
        return np.exp(-distance / (2.0 * sigma**2)) / math.sqrt(2.0 * math.pi * sigma**2)

    def similarity(self, seen: NDArray[np.float64]) -> NDArray[np.float64]:
        """`(N,)` how like the model, in [0, 1]: Bhattacharyya's coefficient, then the cosine with the subspace."""
        if self._subspace is None:
            return self._coefficients(seen)
        lengths = np.linalg.norm(self._scaled(seen), axis=1)
        share = np.divide(self._distances(seen), lengths, out=np.ones(len(seen)), where=lengths > 0.0)
        return np.sqrt(np.clip(1.0 - np.square(share), 0.0, 1.0))

    def learn(self, feature: NDArray[np.float64]) -> None:
        """Take in the `(d,)` feature of one more estimate, unseen whether the target is really there (as printed)."""
        if not self._window:
            return
        scaled = self._scaled(feature[None])[0]
        if self._subspace is not None:
            self._subspace.slide(scaled)
            return
        self._seen.append(scaled)
        if len(self._seen) == self._window:
            self._subspace = SlidingSubspace(np.column_stack(self._seen))
            self._seen.clear()

    def _coefficients(self, seen: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.minimum(np.sqrt(seen) @ self._root, 1.0)

    def _distances(self, seen: NDArray[np.float64]) -> NDArray[np.float64]:
        """`(N,)` D of (12) and (13); 1, the greatest there is, where there is nothing to see."""
        assert self._subspace is not None
        scaled = self._scaled(seen)
        return np.where(scaled.any(axis=1), residuals(scaled, self._subspace.basis(self._count)), 1.0)

    def _scaled(self, seen: NDArray[np.float64]) -> NDArray[np.float64]:
        if self._scale == "length":
            return _divided(seen, np.linalg.norm(seen, axis=1))
        shares = _divided(seen, seen.sum(axis=1))
        return np.sqrt(shares) if self._scale == "root" else shares


def make(name: str, *, seed: int, preset: str, **params: Any) -> Lee2012:
    """Factory of all three; `params` are those of `Params`.

    Args:
        name: One of `METHODS`.
        seed: Root seed.
        preset: One of `PRESETS`.
        params: The user's own numbers.

    Raises:
        ParameterError: An unknown preset or parameter, or a value that is not allowed.
    """
    return Lee2012(METHODS[name], settle(name, PRESETS, preset, params), seed)


make_color = partial(make, "lee2012-color")
make_color_hog = partial(make, "lee2012-color-hog")
make_proposed = partial(make, "lee2012")
make_checked = partial(make, "lee2012-checked")


def _divided(rows: NDArray[np.float64], by: NDArray[np.float64]) -> NDArray[np.float64]:
    """Each of the `(N, d)` rows divided by its number; rows of zeros stay."""
    return rows / np.where(by > 0.0, by, 1.0)[:, None]
