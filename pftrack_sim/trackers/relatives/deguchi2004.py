"""Deguchi, Kawanaka & Okatani 2004, "Object Tracking by the Mean-Shift of Regional Color Distribution ...", ICPR.

Mean shift moves the box to the nearest mode of its colour similarity with the first frame: fast, but lost when an
occluder or a jump takes the target out of the box. A particle filter runs beside it on the same similarity. It takes
over where the similarity at the mode is low, and hands back once mean shift from its estimate finds the target again
(Ko et al. 2012, section I and table 1).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from pftrack_sim.core import boxes
from pftrack_sim.core.boxes import Box
from pftrack_sim.core.records import Estimate, Image
from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.box_filter import TUNED_WALK, USUAL_RATE, WalkParameters, WalkTracker, clip_states
from pftrack_sim.trackers.features.histogram import COLUMNS, ROWS, epanechnikov_layout, histogram, similarities
from pftrack_sim.trackers.features.image_region import ImageRegion
from pftrack_sim.trackers.features.mean_shift import Partition, area_histograms, mean_shift
from pftrack_sim.trackers.features.pixel_codes import JOINT_COUNT, hsv_joint_codes
from pftrack_sim.trackers.filters import RandomWalk
from pftrack_sim.trackers.parameters import Count, Positive, Share

_LAYOUT, _WHOLE = epanechnikov_layout(1, JOINT_COUNT), Partition()
_Seen: TypeAlias = tuple[ImageRegion, NDArray[np.uint8]]  # A region of a frame, and its colour codes


class Deguchi2004Parameters(WalkParameters):
    """Parameters. Defaults are the preset `paper`; none of the publication's values is known here.

    Those of the particles' random walk: `WalkParameters`, here with one draw for width and height.

    Attributes:
        iteration_count: Greatest number of mean shift steps per start.
        size_step: Relative change of size that mean shift also tries, larger and smaller (Comaniciu et al. 2003: 0.1).
        size_gain: Share of the best size in the new one (Comaniciu et al. 2003: 0.1); the rest is the previous size.
        take_over_below: Similarity at the mode, as a share of its running mean, below which the particle filter takes
            over.
        hand_back_above: The same share from which on mean shift continues from the particles' estimate.
        lost_noise: Factor on `sigma_centre` while the particle filter has taken over.
        sharpness: lambda of the particles' likelihood exp(-lambda (1 - similarity)).
        top_count: Number of the heaviest particles whose weighted mean is the filter's estimate.
        seeded_share: Share of the particles that are put on the box of mean shift while it follows.
    """

    TUNED: ClassVar[Mapping[str, Any]] = {**TUNED_WALK, "top_count": 10}

    iteration_count: Annotated[int, Field(ge=1, le=1000)] = 20
    size_step: Share = 0.1
    size_gain: Share = 0.1
    take_over_below: Share = 0.8
    hand_back_above: Share = 0.8
    size_correlation: Share = 1.0
    lost_noise: Positive = 2.0
    sharpness: Annotated[float, Field(ge=0.0, le=10_000.0)] = 20.0
    top_count: Count = 100
    seeded_share: Share = 0.5


class Deguchi2004(WalkTracker[Deguchi2004Parameters]):
    """Mean shift with a particle filter beside it."""

    def _start(self, image: Image, box: Box) -> None:
        self._start_particles(boxes.to_states(box))
        self._usual, self._lost = 1.0, False
        region, codes = self._encode(image, box[None])
        local = region.to_region(box[None])
        self._histogram = histogram(codes, local[0], _LAYOUT)
        self._pulls = area_histograms(codes, _upright_states(local), _WHOLE, len(self._histogram))[0]

    def _follow(self, image: Image) -> Estimate:
        p = self.params
        noise = p.lost_noise if self._lost else 1.0
        self._filter.predict(RandomWalk(p.sigma_px(self._state, noise), p.size_correlation))
        clip_states(self._filter.states, image)
        particles = boxes.from_states(self._filter.states)
        box = boxes.from_states(self._state[None])
        # Mean shift may leave the particles behind by as much as a box.
        reach = np.concatenate([box[:, :2] - box[:, 2:], 3.0 * box[:, 2:]], axis=1)
        seen = self._encode(image, np.concatenate([particles, reach]))
        self._filter.weigh(p.sharpness * (self._similarities(seen, particles) - 1.0))
        spread = self._filter.mean(p.top_count)
        state, similarity = self._climb(seen, self._state)
        if self._lost or similarity < p.take_over_below * self._usual:
            state, similarity = self._climb(seen, spread)
            self._lost = similarity < p.hand_back_above * self._usual
            if self._lost:
                state = spread
                similarity = float(self._similarities(seen, boxes.from_states(spread)[None])[0])
        self._filter.resample()
        if not self._lost:
            self._usual += USUAL_RATE * (similarity - self._usual)
            self._filter.states[: round(p.seeded_share * p.particle_count)] = state
        clip_states(state[None], image)
        self._state = state
        return Estimate(boxes.from_states(state), similarity, self._lost, particles if p.particles else None)

    def _encode(self, image: Image, near: FloatArray) -> _Seen:
        """Colour codes of the region that `(N, 4)` boxes [px] touch, in blocks of about the points of a box."""
        region = self._blocks(image, near, (COLUMNS, ROWS))
        return region, hsv_joint_codes(region.pixels)

    def _similarities(self, seen: _Seen, wanted: FloatArray) -> FloatArray:
        """`(N,)` similarities of `(N, 4)` boxes [px] with the first one."""
        region, codes = seen
        return similarities(codes, region.to_region(wanted), _LAYOUT, self._histogram)

    def _climb(self, seen: _Seen, state: FloatArray) -> tuple[FloatArray, float]:
        """The `(4,)` state that mean shift reaches from a `(4,)` state, and its similarity in [0, 1].

        Of three sizes that of the greatest similarity is taken, and the size moves towards it.
        """
        p, (region, codes) = self.params, seen
        reached = np.tile(state, (3, 1))
        reached[:, 2:] *= [[1.0], [1.0 - p.size_step], [1.0 + p.size_step]]
        starts = _upright_states(region.to_region(boxes.from_states(reached)))
        ends = mean_shift(codes, starts, _WHOLE, self._pulls, p.iteration_count, 0.0)
        reached[:, :2] += (ends[:, :2] - starts[:, :2]) * region.step
        found = self._similarities(seen, boxes.from_states(reached))
        best = int(found.argmax())
        size = state[2:] + p.size_gain * (reached[best, 2:] - state[2:])
        return np.concatenate([reached[best, :2], size]), float(found[best])


def _upright_states(local: FloatArray) -> FloatArray:
    """`(N, 5)` states of mean shift: `(N, 4)` boxes [px of the region] at the angle 0."""
    return np.column_stack([boxes.to_states(local), np.zeros(len(local))])


def make(name: str, *, seed: int, preset: str, **params: Any) -> Deguchi2004:
    """Make the tracker; raises ParameterError."""
    return Deguchi2004(Deguchi2004Parameters.from_preset(name, preset, params), seed)
