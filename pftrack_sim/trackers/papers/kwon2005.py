"""Kwon, Kim & Lim, "Person Tracking with a Mobile Robot using Particle Filters in Complex Environment".

Zhou, Chellappa & Moghaddam's appearance-adaptive particle filter (2004) on a robot that follows a person. The state is
the motion of a grey template; particles stand around the last estimate, shifted by an adaptive velocity and spread by
an adaptive noise (eq. 6 to 11); each is weighed by a mixture of three Gaussians per pixel that is learnt on line
(Jepson, Fleet & El-Maraghi 2003). Too many outliers (eq. 12) mean that the target is covered: the model freezes, and
the filter opens until the target is back. `kwon2005-no-occlusion` never raises that flag. (The paper prints no year.)
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
from pftrack_sim.trackers.features.template import MixtureNumbers, Outliers, PixelMixture, View, grid
from pftrack_sim.trackers.filters import ParticleFilter, RandomWalk
from pftrack_sim.trackers.filters.adaptive import AdaptiveSpread, shift, slopes
from pftrack_sim.trackers.params import Between, settle

Motion = Literal["similarity", "affine"]
MIN_SIZE_PX = 2.0


@dataclass(frozen=True)
class Params:
    """The numbers of the method; those of the preset `paper` stand here, the printed ones with their equation.

    Attributes:
        motion: `"similarity"`: the template moves, turns and grows; `"affine"`: its two sides do so each in its own way
            (Zhou et al. 2004). Not printed.
        point_count: About how many points d the template has. Not printed: 400.
        particle_count: J_0 (11). Not printed: 200.
        particle_count_max: J_max, when covered. Not printed: 500.
        noise: R_0 (9), a factor on the sigmas. Not printed: 1.
        noise_min: R_min (9). Not printed: 0.5.
        noise_max: R_max (9), when covered. Not printed: 2.5.
        sigma_centre: Standard deviation of U_0 in the centre, as a share of the square root of the box's area.
            Not printed: 0.05.
        sigma_scale: The same in the logarithm of the size; of the matrix' diagonal in affine motion. Not printed: 0.02.
        sigma_angle: The same in the angle [rad]; of the matrix' other diagonal in affine motion. Not printed: 0.02.
        velocity: Whether nu_t is added (8). Printed: it is.
        outlier_c: c of Huber's function (12). Printed: 1.3.
        occlusion_share: lambda: with more outliers than this share of the points, the target is covered. Printed: 0.2.
        outliers: Which component a pixel must be far from to be an outlier; see `PixelMixture.outlier_share`.
            Not printed: `"most"`, as Zhou et al.
        half_life: Frames after which what was seen counts half in the mixture. Not printed: 20.
        sigma_wandering: Standard deviation of W, in those of the patch. Not printed: 0.4.
        sigma_stable: Of S at the start. Not printed: 0.4.
        sigma_fixed: Of F. Not printed: 0.4.
        sigma_min: Least of S. Not printed: 0.2.
        share_min: Least mixing weight of a component. Not printed: 0.001.
        robust: Whether the likelihood has Huber's function in the place of the square. Printed for the outliers'
            influence in general (12): it has.
        independence: Share of the points that count as independent: the log-likelihood is multiplied by it. Not
            printed: 1, as Zhou et al. write the product over all points.
        particles: Whether estimates carry the particles.
    """

    motion: Motion = "similarity"
    point_count: Annotated[int, Between(4, 10_000)] = 400
    particle_count: Annotated[int, Between(1, 100_000)] = 200
    particle_count_max: Annotated[int, Between(1, 100_000)] = 500
    noise: Annotated[float, Between(0.001, 1000.0)] = 1.0
    noise_min: Annotated[float, Between(0.001, 1000.0)] = 0.5
    noise_max: Annotated[float, Between(0.001, 1000.0)] = 2.5
    sigma_centre: Annotated[float, Between(0.0, 10.0)] = 0.05
    sigma_scale: Annotated[float, Between(0.0, 10.0)] = 0.02
    sigma_angle: Annotated[float, Between(0.0, 10.0)] = 0.02
    velocity: bool = True
    outlier_c: Annotated[float, Between(0.001, 1000.0)] = 1.3
    occlusion_share: Annotated[float, Between(0.0, 1.0)] = 0.2
    outliers: Outliers = "most"
    half_life: Annotated[float, Between(0.1, 1e9)] = 20.0
    sigma_wandering: Annotated[float, Between(0.001, 1000.0)] = 0.4
    sigma_stable: Annotated[float, Between(0.001, 1000.0)] = 0.4
    sigma_fixed: Annotated[float, Between(0.001, 1000.0)] = 0.4
    sigma_min: Annotated[float, Between(0.001, 1000.0)] = 0.2
    share_min: Annotated[float, Between(1e-9, 0.3)] = 0.001
    robust: bool = True
    independence: Annotated[float, Between(1e-6, 1.0)] = 1.0
    particles: bool = False


PAPER = Params()
# `default` was found by a random search on four recorded sequences (BoBoT A and E, OTB Jogging-1 and David). A coarse
# template forgives what turns or bends; the flag listens to what is stable; and the velocity, printed as it is, is off:
# with few points its linear fit throws the particles off as often as it helps.
PRESETS = {
    "paper": PAPER,
    "default": replace(
        PAPER,
        point_count=25,
        particle_count=250,
        particle_count_max=600,
        noise_min=0.848,
        noise_max=1.72,
        sigma_centre=0.0978,
        sigma_scale=0.0056,
        sigma_angle=0.0015,
        velocity=False,
        outliers="stable",
        half_life=65.0,
        sigma_wandering=0.402,
        sigma_stable=0.596,
        sigma_fixed=0.355,
        sigma_min=0.232,
        independence=0.47,
    ),
}


class Kwon2005(BaseTracker):
    """The method with its numbers.

    Args:
        params: The numbers.
        seed: Root seed; the tracker draws from its stream `"tracker"`.
        notices_occlusion: Whether the flag is raised; without it the model learns from every estimate.
    """

    def __init__(self, params: Params, seed: int, *, notices_occlusion: bool) -> None:
        super().__init__()
        self.params = params
        self._seed = seed
        self._notices = notices_occlusion
        p = params
        self._spread = AdaptiveSpread(p.noise, p.noise_min, p.noise_max, p.particle_count, p.particle_count_max)
        self._size = np.ones(2)
        self._grid = (2, 2)
        self._state: NDArray[np.float64]
        self._filter: ParticleFilter
        self._model: PixelMixture
        self._slopes: NDArray[np.float32] | None = None
        self._patch: NDArray[np.float32]
        self._occluded = False

    def _start(self, image: Image, box: Box) -> None:
        p = self.params
        self._size = box[2:].copy()
        self._grid = grid(float(box[2]), float(box[3]), p.point_count)
        rest = [0.0, 0.0] if p.motion == "similarity" else [1.0, 0.0, 0.0, 1.0]
        self._state = np.concatenate([boxes.centre(box), rest])
        self._patch = self._view(image).patches(self._placements(self._state[None]))[0]
        sigmas = p.sigma_wandering, p.sigma_stable, p.sigma_fixed
        self._model = PixelMixture(
            self._patch, MixtureNumbers(p.half_life, *sigmas, p.sigma_min, p.share_min, p.outlier_c)
        )
        self._filter = ParticleFilter(self._state[None], random_streams.stream(self._seed, "tracker"))
        self._slopes = None
        self._occluded = False

    def _follow(self, image: Image) -> Estimate:
        """Steps 4 to 11 of the procedure in section 2.2."""
        p, moving, view = self.params, self._filter, self._view(image)
        velocity, factor, count = self._adapt(image, view)
        # As many are drawn as there may ever be: the next frame's draws do not depend on this one's J_t.
        moving.restart(self._state + velocity, p.particle_count_max)
        moving.predict(RandomWalk(tuple(factor * self._sigma())))
        moving.keep(count)
        moving.states = self._inside(moving.states, image)
        seen = view.patches(self._placements(moving.states))
        moving.weigh(p.independence * self._model.log_likelihood(seen, robust=p.robust))
        self._state = moving.mean()
        patch = view.patches(self._placements(self._state[None]))[0]
        self._slopes = slopes(moving.states - self._state, seen - patch) if p.velocity else None
        self._occluded = self._notices and self._model.outlier_share(patch, p.outliers) > p.occlusion_share
        confidence = self._model.likeness(patch)
        if not self._occluded:
            self._model.learn(patch)
            self._patch = patch
        shown = self._boxes(moving.states) if p.particles else None
        return Estimate(self._boxes(self._state[None])[0], confidence, self._occluded, shown)

    def _adapt(self, image: Image, view: View) -> tuple[NDArray[np.float64], float, int]:
        """Velocity nu_t (8), noise factor R_t (9) and number of particles J_t (11) of the frame to come (step 4)."""
        p, nowhere = self.params, np.zeros(self._state.size)
        if self._occluded:
            return nowhere, p.noise_max, p.particle_count_max
        velocity = nowhere
        predicted = view.patches(self._placements(self._state[None]))[0]
        if self._slopes is not None:
            velocity = shift(self._slopes, predicted - self._patch)
            arrived = self._inside((self._state + velocity)[None], image)
            predicted = view.patches(self._placements(arrived))[0]
        factor = self._spread.factor(self._model.error(predicted))
        return velocity, factor, self._spread.particles(factor)

    def _view(self, image: Image) -> View:
        width, height = self._boxes(self._state[None])[0, 2:]
        return View(image, (float(width), float(height)), self._grid)

    def _sigma(self) -> NDArray[np.float64]:
        """Standard deviation of U_0 in each component of the state."""
        p = self.params
        width, height = self._boxes(self._state[None])[0, 2:]
        centre = p.sigma_centre * math.sqrt(width * height)
        if p.motion == "similarity":
            return np.array([centre, centre, p.sigma_scale, p.sigma_angle])
        return np.array([centre, centre, p.sigma_scale, p.sigma_angle, p.sigma_angle, p.sigma_scale])

    def _inside(self, states: NDArray[np.float64], image: Image) -> NDArray[np.float64]:
        """The states with centres in the image and sizes between `MIN_SIZE_PX` and twice the image."""
        height_px, width_px = image.shape[:2]
        kept = states.copy()
        kept[:, :2] = np.clip(states[:, :2], 0.0, (width_px, height_px))
        low, high = MIN_SIZE_PX / float(self._size.min()), 2.0 * float(np.min((width_px, height_px) / self._size))
        low, high = min(low, 1.0), max(high, 1.0)
        if self.params.motion == "similarity":
            kept[:, 2] = np.clip(states[:, 2], math.log(low), math.log(high))
            return kept
        for columns in ([2, 4], [3, 5]):
            length = np.maximum(np.hypot(*states[:, columns].T), 1e-9)
            kept[:, columns] *= (np.clip(length, low, high) / length)[:, None]
        return kept

    def _placements(self, states: NDArray[np.float64]) -> NDArray[np.float64]:
        """`(N, 6)` placements of `(N, D)` states: x, y, log scale, angle, or x, y and a 2x2 matrix, row by row."""
        width, height = self._size
        if self.params.motion == "similarity":
            across, down = np.exp(states[:, 2]) * np.cos(states[:, 3]), np.exp(states[:, 2]) * np.sin(states[:, 3])
            return np.column_stack([states[:, :2], width * across, width * down, -height * down, height * across])
        return np.column_stack([states[:, :2], width * states[:, [2, 4]], height * states[:, [3, 5]]])

    def _boxes(self, states: NDArray[np.float64]) -> NDArray[np.float64]:
        """`(N, 4)` upright boxes [px] with the centres and the side lengths of the moved template."""
        placed = self._placements(states)
        sides = np.column_stack([np.hypot(placed[:, 2], placed[:, 3]), np.hypot(placed[:, 4], placed[:, 5])])
        return np.concatenate([placed[:, :2] - 0.5 * sides, sides], axis=1)


def make(name: str, *, seed: int, preset: str, **params: Any) -> Kwon2005:
    """Factory of both; `params` are those of `Params`.

    Args:
        name: `"kwon2005"` or `"kwon2005-no-occlusion"`.
        seed: Root seed.
        preset: One of `PRESETS`.
        params: The user's own numbers.

    Raises:
        ParameterError: An unknown preset or parameter, or a value that is not allowed.
    """
    settled = settle(name, PRESETS, preset, params)
    return Kwon2005(settled, seed, notices_occlusion=name == "kwon2005")


make_proposed = partial(make, "kwon2005")
make_no_occlusion = partial(make, "kwon2005-no-occlusion")
