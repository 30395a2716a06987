"""A tracker that is a particle filter on the target's box, whatever is observed in it.

The particles make a random walk, are weighted by what a subclass observes in their boxes, and the estimate is the mean
of the heaviest (Ko et al. 2012, eq. 10 to 13). A subclass learns the target from the first frame and observes later
ones; it may learn from its estimates too.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, Generic, Literal, TypeAlias, TypeVar

import numpy as np

from pftrack_sim.core import boxes, random_streams
from pftrack_sim.core.boxes import Box
from pftrack_sim.core.records import Estimate, Image
from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.base import BaseTracker
from pftrack_sim.trackers.features.camera_motion import CameraMotion
from pftrack_sim.trackers.features.image_region import ImageRegion, block_means, block_size
from pftrack_sim.trackers.filters import ParticleFilter, RandomWalk
from pftrack_sim.trackers.parameters import Count, NotNegative, Positive, RecognitionParameters, Share

NoiseUnit: TypeAlias = Literal["px", "box"]  # Unit of the dynamics' noise: pixels, or a share of the estimated box
MIN_SIZE_PX = 2.0
USUAL_RATE = 0.03  # Share of a new similarity in the running mean: after a second, a lasting change counts as usual
HELD_RATE = 0.003  # The same while the state is kept: what covers the target for some seconds does not become usual
CARRIED_SHARE = 0.75  # Of the particles, by the camera's motion; the others find a target that the camera follows


class WalkParameters(RecognitionParameters):
    """Parameters of particles on a box that make a random walk.

    Attributes:
        particle_count: Number of particles.
        sigma_centre: Noise of the centre per frame, in `sigma_unit`.
        sigma_size: Noise of width and height per frame, in `sigma_unit`.
        size_correlation: Correlation of the noises of width and height; 1 keeps the box's shape.
        sigma_unit: `"px"`, or `"box"`, see `noise_scales`: the noise then fits near and far targets and every image
            size.
        particles: Whether estimates contain the particles, as upright boxes.
    """

    particle_count: Count = 100
    sigma_centre: NotNegative = 4.0
    sigma_size: NotNegative = 1.0
    size_correlation: Share = 0.0
    sigma_unit: NoiseUnit = "px"
    particles: bool = False

    def sigma_px(self, state: FloatArray, factor: float = 1.0) -> tuple[float, float, float, float]:
        """Noise of x, y, width and height [px] about a `(4+,)` state; `factor` widens that of the centre."""
        position, width, height = noise_scales(state, self.sigma_unit)
        centre = self.sigma_centre * position * factor
        return centre, centre, self.sigma_size * width, self.sigma_size * height


WalkT = TypeVar("WalkT", bound=WalkParameters)


class WalkTracker(BaseTracker, Generic[WalkT]):
    """A tracker whose particles make a random walk; it draws from the stream `"tracker"` of the root seed."""

    def __init__(self, params: WalkT, seed: int) -> None:
        super().__init__(params.recognition)
        self.params = params
        self._seed = seed

    def _start_particles(self, state: FloatArray) -> None:
        """Put all particles at a `(D,)` state, with the random numbers of a new sequence."""
        self._rng = random_streams.stream(self._seed, "tracker")
        self._state, self._first_size = state, state[2:4].copy()
        self._filter = ParticleFilter(np.tile(state, (self.params.particle_count, 1)), self._rng)

    def _blocks(self, image: Image, near: FloatArray, points: tuple[int, int]) -> ImageRegion:
        """The region that `(N, 4)` boxes [px] touch; the target has about as many blocks as columns and rows."""
        return block_means(image, near, block_size(self._first_size, self._state[2:4], points))


TUNED_WALK: Mapping[str, Any] = {"sigma_centre": 0.2, "sigma_size": 0.025, "size_correlation": 1.0, "sigma_unit": "box"}
"""The random walk in the preset `default`: in shares of the box, whose shape it keeps."""
TUNED_FILTER: Mapping[str, Any] = {**TUNED_WALK, "top_count": 20, "hold_distance": 0.6, "redraw": "estimate"}
"""The filter of `ko2012` in the preset `default`, which others share."""


class BoxFilterParameters(WalkParameters):
    """Parameters of the filter, besides those of the random walk.

    Attributes:
        top_count: Number of the heaviest particles whose weighted mean is the estimate.
        hold_distance: Length of a jump of the centre, as a multiple of the square root of the box's area, at which the
            previous state is kept.
        redraw: Next particles: `"weights"`: systematic resampling; `"estimate"`: all at the new state.
        hold_below: Similarity of the new state, as a share of its running mean, below which the previous state is kept
            as after a jump; 0: never.
        held_noise: Factor on `sigma_centre` after such a frame or a jump.
        camera_motion: Whether most of the particles are first carried along by the shift of the whole image since the
            state was last estimated. Not in the papers.
    """

    sigma_centre: NotNegative = 1.0
    sigma_size: NotNegative = 0.64
    top_count: Count = 10
    hold_distance: NotNegative = 0.5
    redraw: Literal["weights", "estimate"] = "weights"
    hold_below: Share = 0.0
    held_noise: Positive = 1.0
    camera_motion: bool = False


ParametersT = TypeVar("ParametersT", bound=BoxFilterParameters)
SeenT = TypeVar("SeenT")


class BoxFilterTracker(WalkTracker[ParametersT], Generic[ParametersT, SeenT]):
    """The filter without its likelihood."""

    def _start(self, image: Image, box: Box) -> None:
        self._start_particles(boxes.to_states(box))
        self._usual, self._held = 0.0, False
        self._camera, self._shift = CameraMotion(), np.zeros(2)
        self._carry(image)
        self._learn_first(image, box)

    def _follow(self, image: Image) -> Estimate:
        self._carry(image)
        p, particle_filter = self.params, self._filter
        sigma = p.sigma_px(self._state, p.held_noise if self._held else 1.0)
        particle_filter.predict(self._dynamics(sigma))
        clip_states(particle_filter.states, image)
        # The next estimate lies among the particles, or is the previous one.
        near = boxes.from_states(np.concatenate([particle_filter.states, self._state[None]]))
        particles = near[:-1]
        seen = self.observe(image, near)
        particle_filter.weigh(self.log_likelihood(seen, particles))
        state = particle_filter.mean(p.top_count)
        box = boxes.from_states(state)
        similarity = self.similarity(seen, box)
        self._held = held = self._is_jump(state) or similarity < p.hold_below * self._usual
        rate = HELD_RATE if held else USUAL_RATE
        self._usual += (rate if self._usual else 1.0) * (similarity - self._usual)
        if not held:
            self._state, self._shift = state, np.zeros(2)
        # After a rejected jump the particles surround a wrong state: they restart at the previous one.
        if held or p.redraw == "estimate":
            particle_filter.restart(self._state)
        else:
            particle_filter.resample()
        if held:
            box = boxes.from_states(self._state)
            similarity = self.similarity(seen, box)
        else:
            self._learn(seen, box)
        return Estimate(box, similarity, held, particles if p.particles else None)

    def _moves_to(self, box: Box) -> bool:
        moved = boxes.to_states(box) - self._state
        self._state = self._state + moved
        self._filter.states[:, :4] += moved
        return True

    def _carry(self, image: Image) -> None:
        """Move part of the particles as the camera's motion has moved the image's content since the last estimate.

        A target behind a cover is later found near the place in the scene where it vanished, or, where the camera
        follows it, at the same place in the image: the likelihood decides between the two.
        """
        if self.params.camera_motion:
            self._shift += self._camera.shift(image)
            states = self._filter.states
            states[: math.ceil(CARRIED_SHARE * len(states)), :2] += self._shift

    def _is_jump(self, state: FloatArray) -> bool:
        """Whether a state is `hold_distance` or more from the previous one and from where the camera takes it."""
        jump = state[:2] - self._state[:2]
        moved = min(np.hypot(*jump), np.hypot(*(jump - self._shift)))
        return bool(moved >= self.params.hold_distance * math.sqrt(self._state[2] * self._state[3]))

    def _dynamics(self, sigma: tuple[float, float, float, float]) -> RandomWalk:
        """How the particles move in this frame, given the noise of x, y, w, h [px]."""
        return RandomWalk(sigma, self.params.size_correlation)

    @abstractmethod
    def _learn_first(self, image: Image, box: Box) -> None:
        """Learn the target from the first frame, in a `(4,)` box [px]; resets the model."""

    @abstractmethod
    def observe(self, image: Image, near: FloatArray) -> SeenT:
        """What a frame shows where boxes later asked for lie in the hull of `(N, 4)` boxes [px]."""

    @abstractmethod
    def log_likelihood(self, seen: SeenT, wanted: FloatArray) -> FloatArray:
        """`(N,)` logarithms of the likelihood of `(N, 4)` boxes [px]; -inf for impossible ones."""

    @abstractmethod
    def similarity(self, seen: SeenT, box: Box) -> float:
        """Similarity in [0, 1] of a `(4,)` box [px] with the target."""

    def _learn(self, seen: SeenT, box: Box) -> None:
        """Learn from the estimated `(4,)` box [px] of a frame; not called while the previous state is kept."""


def noise_scales(state: FloatArray, unit: NoiseUnit) -> tuple[float, float, float]:
    """Factors from `unit` to pixels of the noise of position, width and height.

    A share of the box is one of the square root of its area for the position (a camera shakes alike in both
    directions), and of width and height each for themselves.
    """
    if unit == "px":
        return 1.0, 1.0, 1.0
    width, height = float(state[2]), float(state[3])
    return math.sqrt(width * height), width, height


def clip_states(states: FloatArray, image: Image, min_size: float | FloatArray = MIN_SIZE_PX) -> None:
    """Clip `(N, 4+)` states in place: centres to the image, sizes to `min_size` [px] and twice the image."""
    height_px, width_px = image.shape[:2]
    low, high = np.zeros(4), np.array([width_px, height_px, 2.0 * width_px, 2.0 * height_px])
    low[2:] = min_size
    clipped = states[:, :4]
    np.maximum(clipped, low, out=clipped)  # `np.clip` takes four times as long for a hundred states
    np.minimum(clipped, high, out=clipped)
