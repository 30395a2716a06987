"""Kwon, Kim & Lim, "Person Tracking with a Mobile Robot using Particle Filters in Complex Environment".

The appearance-adaptive particle filter of Zhou, Chellappa & Moghaddam (2004) on a robot that follows a person. The
state is the planar motion of a grey template. Particles are drawn around the last estimate, with an adaptive velocity
and an adaptive noise (eq. 6 to 11); the likelihood is a mixture of three Gaussians per pixel that is learnt on line
(Jepson, Fleet & El-Maraghi 2003). Too many outliers (eq. 12) indicate an occlusion: the model is frozen, and noise and
number of particles are at their maximum until the target is visible again. `kwon2005-no-occlusion` detects no
occlusions. (The paper prints no year.)
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from pftrack_sim.core import boxes, random_streams
from pftrack_sim.core.boxes import Box
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.records import Estimate, Image
from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.base import BaseTracker
from pftrack_sim.trackers.features.camera_motion import CameraMotion
from pftrack_sim.trackers.features.patches import PatchSampler, grid_shape
from pftrack_sim.trackers.features.pixel_mixture import MixtureParameters, OutlierRule, PixelMixture
from pftrack_sim.trackers.filters import ParticleFilter, RandomWalk, adaptive_velocity, fit_slopes
from pftrack_sim.trackers.parameters import Count, Positive, Share

MotionModel: TypeAlias = Literal["similarity", "affine"]
Sigma: TypeAlias = Annotated[float, Field(ge=0.0, le=10.0)]
MIN_SIZE_PX = 2.0


class Kwon2005Parameters(MixtureParameters):
    """Parameters of both trackers, besides the mixture's. Defaults are the preset `paper`.

    Printed values have their equation.

    Attributes:
        motion: `"similarity"`: translation, scale and rotation of the template; `"affine"`: also shear and aspect
            (Zhou et al. 2004). Not printed.
        point_count: Approximate number of points d of the template. Not printed: 400.
        particle_count: J_0 (11). Not printed: 200.
        particle_count_max: J_max, during occlusions. Not printed: 500.
        noise: R_0 (9), a factor on the sigmas. Not printed: 1.
        noise_min: R_min (9). Not printed: 0.5.
        noise_max: R_max (9), during occlusions. Not printed: 2.5.
        sigma_centre: Standard deviation of U_0 in the centre, as a share of the square root of the box's area.
            Not printed: 0.05.
        sigma_scale: The same in the logarithm of the size; of the matrix' diagonal in affine motion. Not printed: 0.02.
        sigma_angle: The same in the angle [rad]; of the matrix' other diagonal in affine motion. Not printed: 0.02.
        velocity: Whether nu_t is added (8). Printed: it is.
        occlusion_share: lambda: the share of outliers above which the target is occluded. Printed: 0.2.
        outliers: Components that a pixel must be far from to be an outlier; see `PixelMixture.outlier_share`.
            Not printed: `"most"`, as Zhou et al.
        robust: Whether the likelihood has Huber's function in place of the square. Printed for the influence of
            outliers in general (12): it has.
        independence: Share of the points that count as independent: a factor on the log-likelihood. Not printed: 1, as
            Zhou et al. write the product over all points.
        hold_below: Correlation of the estimate's patch with the expected one below which the state is kept and the
            target counts as occluded. Not in the paper: 0, never.
        widen: Greatest factor on the noise while the state is kept: beyond `widen_after` frames the uncertainty grows
            as that of a random walk does, with the square root of the frames. Not in the paper: 1, never.
        widen_after: Frames that the state is kept before the noise grows. Not in the paper.
        camera_motion: Whether the state is carried along by the shift of the whole image since the last frame: part of
            the movement expected, nu_t (8), that does not depend on the target, so it also holds while the target is
            covered. Not in the paper.
        particles: Whether estimates contain the particles.
    """

    # Found by searches on recorded and simulated sequences of development: docs/papers/kwon2005.md. Outliers of the
    # stable component indicate occlusions, more than half of them: fewer change with the posture. 100 points measure
    # scale, which 25 hardly do. The velocity is off: with few points its linear fit misleads the particles as often as
    # it helps.
    TUNED: ClassVar[Mapping[str, Any]] = {
        "point_count": 100,
        "particle_count": 250,
        "particle_count_max": 600,
        "noise_min": 0.848,
        "noise_max": 1.72,
        "sigma_centre": 0.13,
        "sigma_scale": 0.025,
        "sigma_angle": 0.0015,
        "velocity": False,
        "outliers": "stable",
        "half_life": 65.0,
        "sigma_wandering": 0.8,
        "sigma_stable": 0.596,
        "sigma_fixed": 0.355,
        "sigma_min": 0.232,
        "independence": 0.47,
        "occlusion_share": 0.5,
        "hold_below": 0.65,
        "widen": 4.0,
        "camera_motion": True,
    }

    motion: MotionModel = "similarity"
    point_count: Annotated[int, Field(ge=4, le=10_000)] = 400
    particle_count: Count = 200
    particle_count_max: Count = 500
    noise: Positive = 1.0
    noise_min: Positive = 0.5
    noise_max: Positive = 2.5
    sigma_centre: Sigma = 0.05
    sigma_scale: Sigma = 0.02
    sigma_angle: Sigma = 0.02
    velocity: bool = True
    occlusion_share: Share = 0.2
    outliers: OutlierRule = "most"
    robust: bool = True
    independence: Annotated[float, Field(ge=1e-6, le=1.0)] = 1.0
    hold_below: Share = 0.0
    widen: Annotated[float, Field(ge=1.0, le=100.0)] = 1.0
    widen_after: Count = 8
    camera_motion: bool = False
    particles: bool = False

    def noise_factor(self, error: float) -> float:
        """R_t = max(min(R_0 sqrt(error), R_max), R_min) (9) of a prediction error >= 0, 1 where it is as expected."""
        return max(min(self.noise * math.sqrt(error), self.noise_max), self.noise_min)

    def particle_number(self, factor: float) -> int:
        """J_t = J_0 R_t / R_0 (11) of a factor R_t, rounded, in [1, J_max]."""
        return max(min(round(self.particle_count * factor / self.noise), self.particle_count_max), 1)


@dataclass(frozen=True, eq=False)
class TemplateMotion:
    """States of a template's planar motion: x, y [px], log scale, angle [rad]; or x, y and a 2x2 matrix, row by row.

    Attributes:
        model: Similarity or affine motion.
        size: `(2,)` width and height of the template in the first frame [px].
    """

    model: MotionModel
    size: FloatArray

    def initial_state(self, box: Box) -> FloatArray:
        """`(D,)` state of the first box."""
        rest = [0.0, 0.0] if self.model == "similarity" else [1.0, 0.0, 0.0, 1.0]
        return np.concatenate([boxes.centre(box), rest])

    def placements(self, states: FloatArray) -> FloatArray:
        """`(N, 6)` placements (see `patches`) of `(N, D)` states."""
        width, height = self.size
        if self.model == "similarity":
            scales, angles = np.exp(states[:, 2]), states[:, 3]
            cosines, sines = scales * np.cos(angles), scales * np.sin(angles)
            return np.column_stack([states[:, :2], width * cosines, width * sines, -height * sines, height * cosines])
        return np.column_stack([states[:, :2], width * states[:, [2, 4]], height * states[:, [3, 5]]])

    def boxes(self, states: FloatArray) -> FloatArray:
        """`(N, 4)` upright boxes [px] with the centres and side lengths of the moved template."""
        placed = self.placements(states)
        sides = np.column_stack([np.hypot(placed[:, 2], placed[:, 3]), np.hypot(placed[:, 4], placed[:, 5])])
        return np.concatenate([placed[:, :2] - 0.5 * sides, sides], axis=1)

    def sigma(self, state: FloatArray, centre: float, scale: float, angle: float) -> FloatArray:
        """`(D,)` noise of a state, given that of the centre as a share of the square root of the box's area."""
        width, height = self.boxes(state[None])[0, 2:]
        centre_px = centre * math.sqrt(width * height)
        if self.model == "similarity":
            return np.array([centre_px, centre_px, scale, angle])
        return np.array([centre_px, centre_px, scale, angle, angle, scale])

    def moved(self, state: FloatArray, box: Box) -> FloatArray:
        """A `(D,)` state with the centre and height of a `(4,)` box."""
        out = state.copy()
        out[:2] = boxes.centre(box)
        growth = float(box[3] / self.boxes(state[None])[0, 3])
        if self.model == "similarity":
            out[2] += math.log(growth)
        else:
            out[2:] *= growth
        return out

    def clip(self, states: FloatArray, image: Image) -> FloatArray:
        """`(N, D)` states with centres in the image and sizes between `MIN_SIZE_PX` and twice the image."""
        height_px, width_px = image.shape[:2]
        out = states.copy()
        out[:, :2] = np.clip(states[:, :2], 0.0, (width_px, height_px))
        low = min(MIN_SIZE_PX / float(self.size.min()), 1.0)
        high = max(2.0 * float(np.min((width_px, height_px) / self.size)), 1.0)
        if self.model == "similarity":
            out[:, 2] = np.clip(states[:, 2], math.log(low), math.log(high))
            return out
        for columns in ([2, 4], [3, 5]):
            length = np.maximum(np.hypot(*states[:, columns].T), 1e-9)
            out[:, columns] *= (np.clip(length, low, high) / length)[:, None]
        return out


class Kwon2005(BaseTracker):
    """The appearance-adaptive particle filter; it draws from the stream `"tracker"` of the root seed.

    Where no occlusions are detected, the model learns from every estimate.

    Raises:
        ParameterError: Limits of the noise or of the number of particles are not in order.
    """

    def __init__(self, params: Kwon2005Parameters, seed: int, *, detects_occlusions: bool) -> None:
        super().__init__(params.recognition)
        for names in (("noise_min", "noise", "noise_max"), ("particle_count", "particle_count_max")):
            values = [getattr(params, name) for name in names]
            if values != sorted(values):
                given = ", ".join(f"{value:g}" for value in values)
                raise ParameterError(f"kwon2005: expected {' <= '.join(names)}, got {given}")
        self.params = params
        self._seed = seed
        self._detects_occlusions = detects_occlusions

    def _start(self, image: Image, box: Box) -> None:
        p = self.params
        self._motion = TemplateMotion(p.motion, box[2:].copy())
        self._grid = grid_shape(float(box[2]), float(box[3]), p.point_count)
        self._state = self._motion.initial_state(box)
        self._patch = self._patches(self._sampler(image), self._state[None])[0]
        self._model = PixelMixture(self._patch, p)
        self._filter = ParticleFilter(self._state[None], random_streams.stream(self._seed, "tracker"))
        self._slopes: NDArray[np.floating[Any]] | None = None
        self._occluded = False
        self._held_frames = 0
        self._camera = CameraMotion()
        self._carry(image)

    def _follow(self, image: Image) -> Estimate:
        """Steps 4 to 11 of the procedure in section 2.2."""
        self._carry(image)
        p, particle_filter, sampler = self.params, self._filter, self._sampler(image)
        velocity, factor, count = self._adapt(image, sampler)
        # J_max particles are drawn, so that later random numbers do not depend on J_t.
        particle_filter.restart(self._state + velocity, p.particle_count_max)
        sigma = self._motion.sigma(self._state, p.sigma_centre, p.sigma_scale, p.sigma_angle)
        factor *= min(math.sqrt(1 + max(self._held_frames - p.widen_after, 0)), p.widen)
        particle_filter.predict(RandomWalk(tuple(factor * sigma)))
        particle_filter.truncate(count)
        particle_filter.states = self._motion.clip(particle_filter.states, image)
        patches = self._patches(sampler, particle_filter.states)
        particle_filter.weigh(p.independence * self._model.log_likelihood(patches, robust=p.robust))
        state = particle_filter.mean()
        patch = self._patches(sampler, state[None])[0]
        confidence = self._model.similarity(patch)
        held = self._detects_occlusions and confidence < p.hold_below
        self._held_frames = self._held_frames + 1 if held else 0
        if not held:
            self._state = state
        self._slopes = fit_slopes(particle_filter.states - state, patches - patch) if p.velocity else None
        outliers = self._model.outlier_share(patch, p.outliers)
        self._occluded = held or (self._detects_occlusions and outliers > p.occlusion_share)
        if not self._occluded:
            self._model.learn(patch)
            self._patch = patch
        particles = self._motion.boxes(particle_filter.states) if p.particles else None
        return Estimate(self._motion.boxes(self._state[None])[0], confidence, self._occluded, particles)

    def _moves_to(self, box: Box) -> bool:
        self._state = self._motion.moved(self._state, box)
        return True

    def _carry(self, image: Image) -> None:
        """Move the state as the camera's motion moves the image's content."""
        if self.params.camera_motion:
            moved = self._state.copy()
            moved[:2] += self._camera.shift(image)
            self._state = self._motion.clip(moved[None], image)[0]

    def _adapt(self, image: Image, sampler: PatchSampler) -> tuple[FloatArray, float, int]:
        """Velocity nu_t (8), noise factor R_t (9) and number of particles J_t (11) of the next frame (step 4)."""
        velocity = np.zeros(self._state.size)
        if self._occluded:
            return velocity, self.params.noise_max, self.params.particle_count_max
        predicted = self._patches(sampler, self._state[None])[0]
        if self._slopes is not None:
            velocity = adaptive_velocity(self._slopes, predicted - self._patch)
            shifted = self._motion.clip((self._state + velocity)[None], image)
            predicted = self._patches(sampler, shifted)[0]
        factor = self.params.noise_factor(self._model.prediction_error(predicted))
        return velocity, factor, self.params.particle_number(factor)

    def _sampler(self, image: Image) -> PatchSampler:
        width, height = self._motion.boxes(self._state[None])[0, 2:]
        return PatchSampler(image, (float(width), float(height)), self._grid)

    def _patches(self, sampler: PatchSampler, states: FloatArray) -> NDArray[np.float32]:
        return sampler.patches(self._motion.placements(states))


def make(name: str, *, seed: int, preset: str, **params: Any) -> Kwon2005:
    """Make `kwon2005` or `kwon2005-no-occlusion`; raises ParameterError."""
    settings = Kwon2005Parameters.from_preset(name, preset, params)
    return Kwon2005(settings, seed, detects_occlusions=name == "kwon2005")
