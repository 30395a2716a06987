"""Lee et al. 2012, J. ICROS: its method and the two it is compared with.

"Robust object tracking in mobile robots using object features and on-line learning based particle filter". A particle
filter on the target's box and its velocity (eq. 8 and 9). The likelihood is a linear mixture (eq. 14) of an HSV
histogram (eq. 1) and a HOG descriptor (eq. 2 to 5) of the box resized to 16x24. Until frame 40 both are compared with
the first frame (eq. 10 and 11), afterwards with the subspace of the estimates, learnt by incremental PCA (eq. 6, 7, 12
and 13).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from pftrack_sim.core import boxes, random_streams
from pftrack_sim.core.boxes import Box
from pftrack_sim.core.records import Estimate, Image
from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.base import BaseTracker
from pftrack_sim.trackers.box_filter import NoiseUnit, clip_states, noise_scales
from pftrack_sim.trackers.features.histogram import distance_layout, histograms
from pftrack_sim.trackers.features.hog import COLUMNS, ROWS, hog
from pftrack_sim.trackers.features.image_region import ImageRegion, block_means, block_size
from pftrack_sim.trackers.features.online_feature import OnlineFeatureModel, OnlineFeatureParameters
from pftrack_sim.trackers.features.pixel_codes import JOINT_COUNT, hsv_joint_codes
from pftrack_sim.trackers.filters import ConstantVelocity, ParticleFilter
from pftrack_sim.trackers.parameters import Count, NotNegative, Positive, Share

MIN_SIZE_SHARE = 0.1
"""Least size of a particle as a share of the first box, which does not depend on the image's resolution."""
_LAYOUT = distance_layout(ROWS, COLUMNS, JOINT_COUNT)
_Seen: TypeAlias = tuple[ImageRegion, NDArray[np.uint8], NDArray[np.uint8] | None]


class Lee2012Parameters(OnlineFeatureParameters):
    """Parameters of all methods, besides those of learning. Defaults are the preset `paper`.

    Printed values have their equation.

    Attributes:
        particle_count: Number of particles. Printed: 100.
        noise_width: Half the range of the uniform noise of the box's width per frame (9), in `noise_unit`.
            Printed: 2.5 px.
        noise_height: The same of its height. Printed: 2.5 px.
        noise_velocity_x: The same of the horizontal velocity. Printed: 6.5 px per frame.
        noise_velocity_y: The same of the vertical velocity. Printed: 2.5 px per frame.
        noise_unit: `"px"`, as printed (for 640x480 images), or `"box"`, see `noise_scales`: the noise then fits near
            and far targets and every image size.
        keep_shape: Whether width and height share one noise, so that the box keeps its shape: False as printed.
        start: The first particles' centres are uniform over the whole `"image"`, as printed (section II), or around the
            `"box"`, up to `start_spread` of its width and height away.
        start_spread: See `start`. Not printed: 0.1.
        resampling: `"multinomial"`: particles are drawn independently, as in the printed pseudocode, or `"systematic"`.
        alpha: Weight of colour in the mixture (14). Printed: 0.1. Not used by colour alone.
        sigma_colour: Width of the colour's likelihood before learning (10). Printed: 0.4. The printed exponent has
            1 - D^2, which would favour the least similar particle: D^2 is meant.
        sigma_hog: The same of HOG (11). Printed: 0.4.
        learned_sigma_colour: Width of the colour's likelihood after learning (12). Printed: 0.4.
        learned_sigma_hog: The same of HOG (13). Printed: 0.4.
        learn_above: `lee2012-checked` learns from estimates of at least this confidence, as a share of the mean over
            the last `window` it learnt from. Not in the paper, whose method learns from all; its conclusion names that
            as its weakness.
        particles: Whether estimates contain the particles.
    """

    # Found by a coarse search on four recorded sequences (BoBoT A and E, OTB Jogging-1 and David): noise relative to
    # the target's size, constant shape, narrower likelihoods of the first frame, which separate particles, and few
    # components. The factor of the first frame keeps the subspace from learning its own drift: docs/papers/lee2012.md.
    TUNED: ClassVar[Mapping[str, Any]] = {
        "particle_count": 400,
        "noise_unit": "box",
        "noise_width": 0.02,
        "noise_height": 0.02,
        "noise_velocity_x": 0.1,
        "noise_velocity_y": 0.05,
        "keep_shape": True,
        "start": "box",
        "resampling": "systematic",
        "sigma_colour": 0.22,
        "sigma_hog": 0.22,
        "component_count": 4,
        "learned_scale": "root",
        "anchored": True,
    }

    particle_count: Count = 100
    noise_width: NotNegative = 2.5
    noise_height: NotNegative = 2.5
    noise_velocity_x: NotNegative = 6.5
    noise_velocity_y: NotNegative = 2.5
    noise_unit: NoiseUnit = "px"
    keep_shape: bool = False
    start: Literal["image", "box"] = "image"
    resampling: Literal["multinomial", "systematic"] = "multinomial"
    start_spread: Annotated[float, Field(ge=0.0, le=10.0)] = 0.1
    alpha: Share = 0.1
    sigma_colour: Positive = 0.4
    sigma_hog: Positive = 0.4
    learned_sigma_colour: Positive = 0.4
    learned_sigma_hog: Positive = 0.4
    learn_above: Share = 0.9
    particles: bool = False


@dataclass(frozen=True)
class Method:
    """Features of a method and how it learns.

    Attributes:
        uses_hog: Whether HOG is used besides colour.
        learns: Whether appearance is learnt on line.
        checks: Whether only estimates of high confidence are learnt from.
    """

    uses_hog: bool = True
    learns: bool = True
    checks: bool = False


METHODS = {
    "lee2012-color": Method(uses_hog=False, learns=False),
    "lee2012-color-hog": Method(learns=False),
    "lee2012": Method(),
    "lee2012-checked": Method(checks=True),
}
"""The columns of table 3, in its order, and a variant that is not in the paper."""


class Lee2012(BaseTracker):
    """One of `METHODS`; it draws from the stream `"tracker"` of the root seed."""

    def __init__(self, method: Method, params: Lee2012Parameters, seed: int) -> None:
        super().__init__(params.recognition)
        self.params = params
        self._method = method
        self._seed = seed

    def _start(self, image: Image, box: Box) -> None:
        p = self.params
        rng = random_streams.stream(self._seed, "tracker")
        self._state = np.concatenate([boxes.to_states(box), np.zeros(2)])
        states = np.tile(self._state, (p.particle_count, 1))
        offsets = rng.uniform(-1.0, 1.0, (p.particle_count, 2))
        if p.start == "image":
            states[:, :2] = 0.5 * (1.0 + offsets) * (image.shape[1], image.shape[0])
        else:
            states[:, :2] += offsets * p.start_spread * box[2:]
        self._filter = ParticleFilter(states, rng)
        self._learnt_confidences: deque[float] = deque(maxlen=p.window)
        self._first_size = np.array(box[2:])
        first = self._features(self._encode(image, box[None]), box[None])
        sigmas = (p.sigma_colour, p.learned_sigma_colour), (p.sigma_hog, p.learned_sigma_hog)
        self._shares = (p.alpha, 1.0 - p.alpha) if self._method.uses_hog else (1.0,)
        self._models = [OnlineFeatureModel(one[0], widths, p) for one, widths in zip(first, sigmas, strict=False)]

    def _follow(self, image: Image) -> Estimate:
        particle_filter = self._filter
        particle_filter.predict(ConstantVelocity(self._noise(), self.params.keep_shape))
        clip_states(particle_filter.states, image, MIN_SIZE_SHARE * self._first_size)
        particles = boxes.from_states(particle_filter.states)
        seen = self._encode(image, particles)
        parts = zip(self._shares, self._models, self._features(seen, particles), strict=True)
        with np.errstate(divide="ignore"):
            likelihood = sum(share * model.likelihood(features) for share, model, features in parts)
            particle_filter.weigh(np.log(likelihood))
        self._state = particle_filter.mean()
        particle_filter.resample(multinomial=self.params.resampling == "multinomial")
        box = boxes.from_states(self._state)
        features = self._features(seen, box[None])
        parts = zip(self._shares, self._models, features, strict=True)
        confidence = min(sum(share * float(model.similarity(feature)[0]) for share, model, feature in parts), 1.0)
        if self._method.learns and (not self._method.checks or self._is_reliable(confidence)):
            for model, feature in zip(self._models, features, strict=True):
                model.learn(feature[0])
        return Estimate(box, confidence, False, particles if self.params.particles else None)

    def _moves_to(self, box: Box) -> bool:
        moved = boxes.to_states(box) - self._state[:4]
        self._state[:4] += moved
        self._filter.states[:, :4] += moved
        return True

    def _is_reliable(self, confidence: float) -> bool:
        """Whether to learn from an estimate, given the confidence of those learnt from before."""
        past = self._learnt_confidences
        reliable = not past or confidence >= self.params.learn_above * sum(past) / len(past)
        if reliable:
            past.append(confidence)
        return reliable

    def _encode(self, image: Image, near: FloatArray) -> _Seen:
        """The region of `(N, 4)` boxes [px] in blocks, its colour codes, and its grey if used."""
        region = block_means(image, near, block_size(self._first_size, self._state[2:4], (COLUMNS, ROWS)))
        grey = cv2.cvtColor(region.pixels, cv2.COLOR_RGB2GRAY) if self._method.uses_hog else None
        return region, hsv_joint_codes(region.pixels), None if grey is None else np.asarray(grey, dtype=np.uint8)

    def _features(self, seen: _Seen, wanted: FloatArray) -> list[FloatArray]:
        """Colour `(N, 256)` and, if used, HOG `(N, 192)` of `(N, 4)` boxes [px]."""
        region, codes, grey = seen
        local = region.to_region(wanted)
        colour = histograms(codes, local, _LAYOUT)
        return [colour] if grey is None else [colour, hog(grey, local)]

    def _noise(self) -> tuple[float, float, float, float]:
        """Half the range of the noise of w, h, vx, vy per frame [px]."""
        p = self.params
        position, width, height = noise_scales(self._state, p.noise_unit)
        return (
            p.noise_width * width,
            p.noise_height * height,
            p.noise_velocity_x * position,
            p.noise_velocity_y * position,
        )


def make(name: str, *, seed: int, preset: str, **params: Any) -> Lee2012:
    """Make one of `METHODS`; raises ParameterError."""
    return Lee2012(METHODS[name], Lee2012Parameters.from_preset(name, preset, params), seed)
