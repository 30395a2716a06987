"""Khan, Gu & Backhouse 2011, IEEE Trans. CSVT.

"Robust visual object tracking using multi-mode anisotropic mean shift and particle filters". The box has five
parameters: centre, width, height and angle. Each of a few particles (the publication needs fewer than 20) climbs by
mean shift over the areas of a divided box to the nearest mode before it is weighted, and the histograms of the
reference object are learnt on line. Known of the publication are its abstract and its place in Ko et al. 2012 (section
I and table 1); how the parts are joined is chosen here, see docs/papers/relatives.md.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from pftrack_sim.core import boxes
from pftrack_sim.core.boxes import Box
from pftrack_sim.core.records import Estimate, Image
from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.box_filter import TUNED_WALK, USUAL_RATE, WalkParameters, WalkTracker, clip_states
from pftrack_sim.trackers.features.image_region import ImageRegion, block_means, block_size
from pftrack_sim.trackers.features.mean_shift import SIDE, Partition, area_histograms, mean_shift
from pftrack_sim.trackers.features.pixel_codes import JOINT_COUNT, hsv_joint_codes
from pftrack_sim.trackers.filters import RandomWalk
from pftrack_sim.trackers.parameters import Count, Share

_REACH = 1.0  # Mean shift may leave the particles behind by as much as this share of a box


class Khan2011Parameters(WalkParameters):
    """Parameters. Defaults are the preset `paper`; of the publication's values only the number of particles is known.

    Those of the particles' random walk: `WalkParameters`.

    Attributes:
        particle_count: Number of particles; the publication: fewer than 20.
        sigma_angle: Noise of the angle per frame [rad].
        rows: Rows of areas that the box is divided into.
        columns: Columns of areas.
        iteration_count: Greatest number of mean shift steps per particle and frame.
        shape_gain: Share of the size's and angle's change estimated by mean shift that is made.
        sharpness: lambda of the likelihood exp(-lambda (1 - s)), s the mean similarity of the areas.
        learning_rate: Share of the estimate's histograms in those of the reference object, per frame.
        learn_above: Similarity of an estimate, as a share of its running mean, from which on it is learnt from.
    """

    # Chosen on four recorded sequences (BoBoT A and E, OTB Jogging-1 and David): docs/papers/relatives.md.
    TUNED: ClassVar[Mapping[str, Any]] = {**TUNED_WALK, "shape_gain": 0.2, "learning_rate": 0.005, "learn_above": 0.95}

    particle_count: Count = 15
    sigma_angle: Annotated[float, Field(ge=0.0, le=math.pi)] = 0.02
    rows: Annotated[int, Field(ge=1, le=6)] = 2
    columns: Annotated[int, Field(ge=1, le=6)] = 2
    iteration_count: Annotated[int, Field(ge=0, le=1000)] = 10
    shape_gain: Share = 0.5
    sharpness: Annotated[float, Field(ge=0.0, le=10_000.0)] = 20.0
    learning_rate: Share = 0.02
    learn_above: Share = 0.9


class Khan2011(WalkTracker[Khan2011Parameters]):
    """The tracker."""

    def __init__(self, params: Khan2011Parameters, seed: int) -> None:
        super().__init__(params, seed)
        self._partition = Partition(params.rows, params.columns)

    def _start(self, image: Image, box: Box) -> None:
        self._start_particles(np.append(boxes.to_states(box), 0.0))
        region, codes = self._encode(image, self._state[None])
        found = area_histograms(codes, region.to_region(self._state[None]), self._partition, JOINT_COUNT)[0]
        totals = found.sum(axis=1, keepdims=True)
        self._model = np.divide(found, totals, out=np.zeros_like(found), where=totals > 0.0)
        self._usual = 1.0

    def _follow(self, image: Image) -> Estimate:
        p, particle_filter = self.params, self._filter
        walk = RandomWalk(p.sigma_px(self._state), p.size_correlation)
        walked = walk.draw(particle_filter.states[:, :4], self._rng)
        angles = particle_filter.states[:, 4] + p.sigma_angle * self._rng.standard_normal(p.particle_count)
        particle_filter.states = np.column_stack([walked, angles])
        clip_states(particle_filter.states, image)
        region, codes = self._encode(image, particle_filter.states)
        local = region.to_region(particle_filter.states)
        climbed = mean_shift(codes, local, self._partition, self._model, p.iteration_count, p.shape_gain)
        particle_filter.states = _to_image(climbed, region)
        clip_states(particle_filter.states, image)
        similarities, _ = self._compare(codes, region.to_region(particle_filter.states))
        particle_filter.weigh(p.sharpness * (similarities - 1.0))
        self._state = particle_filter.mean()
        particles = upright(particle_filter.states)
        particle_filter.resample()
        found, histograms = self._compare(codes, region.to_region(self._state[None]))
        similarity = float(found[0])
        if similarity >= p.learn_above * self._usual:
            self._model += p.learning_rate * (histograms[0] - self._model)
        self._usual += USUAL_RATE * (similarity - self._usual)
        return Estimate(upright(self._state[None])[0], similarity, False, particles if p.particles else None)

    def _compare(self, codes: NDArray[np.uint8], local: FloatArray) -> tuple[FloatArray, FloatArray]:
        """`(N,)` mean similarities in [0, 1] of the areas of `(N, 5)` states [px of the region], and the histograms."""
        histograms = area_histograms(codes, local, self._partition, JOINT_COUNT)
        return np.minimum(np.sqrt(histograms * self._model).sum(axis=2).mean(axis=1), 1.0), histograms

    def _encode(self, image: Image, states: FloatArray) -> tuple[ImageRegion, NDArray[np.uint8]]:
        """Colour codes around `(N, 5)` states, in square blocks, about as many as points in the present box."""
        hull = upright(states)
        hull = np.concatenate([hull[:, :2] - _REACH * hull[:, 2:], (1.0 + 2.0 * _REACH) * hull[:, 2:]], axis=1)
        # Square, as a rotated box would not stay one in blocks of another shape.
        first, now = (np.full(2, math.sqrt(float(size[0] * size[1]))) for size in (self._first_size, self._state[2:4]))
        block, _ = block_size(first, now, (SIDE, SIDE))
        block = min(block, float(min(image.shape[:2])))
        region = block_means(image, hull, (block, block))
        return region, hsv_joint_codes(region.pixels)


def upright(states: FloatArray) -> FloatArray:
    """`(N, 4)` upright boxes [px] around the ellipses inscribed in `(N, 5)` states."""
    cosine, sine = np.cos(states[:, 4]), np.sin(states[:, 4])
    width, height = states[:, 2], states[:, 3]
    size = np.column_stack([np.hypot(width * cosine, height * sine), np.hypot(width * sine, height * cosine)])
    return boxes.from_states(np.concatenate([states[:, :2], size], axis=1))


def _to_image(states: FloatArray, region: ImageRegion) -> FloatArray:
    found = states.copy()
    found[:, :4] *= region.step[0]
    found[:, :2] += region.origin
    return found


def make(name: str, *, seed: int, preset: str, **params: Any) -> Khan2011:
    """Make the tracker; raises ParameterError."""
    return Khan2011(Khan2011Parameters.from_preset(name, preset, params), seed)
