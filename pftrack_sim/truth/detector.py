"""A person detector, modelled on the truth: what it misses, how far its boxes are off, and what it sees wrongly.

    model = DetectionModel(settings, seed)        # per episode
    detections = model.detect(people, image)      # per delivered frame, in order; image=None: contrast is not limiting

Numpy alone: no renderer is needed. The detections of a frame depend on the seed, the truth and the image of that frame,
and not on the calls before, except for the latency.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

import numpy as np

from pftrack_sim.core.boxes import clip
from pftrack_sim.core.photometry import LUMINANCE
from pftrack_sim.core.random_streams import stream
from pftrack_sim.core.records import DeferredPeople, Detections, Image, Truth
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scenario.camera import seed_of_camera
from pftrack_sim.scenario.model import ResolvedScenario

# Shapes of the Weibull functions of `DetectorAxis`, from the miss rates in its source.
_HEIGHT_POWER, _VISIBLE_POWER, _CONTRAST_POWER = 2.3, 1.6, 2.0
_SCORE_POWER = 3.0
_FALSE_MARGIN = 0.3  # Largest margin of a false alarm: its score is seldom that of a person
_ASPECT = 0.41  # Width over height of pedestrians (Dollár et al. 2012, section 2.2)
# Logarithm of the least and greatest height of a false alarm as a share of the image's; uniform between them.
_LOG_HEIGHT = math.log(0.1), math.log(0.8)
_SAMPLES = 32  # Contrast is measured on at most this many rows and columns of a box
_CHUNK = 64
_TINY_S = 1e-9


class DetectionModel:
    """Detections of one episode, whose scenario describes the detector in `axes.detector`.

    Of the root seed the stream `"detector"` is used, of a seed of its own for each camera.
    """

    def __init__(self, settings: ResolvedScenario, seed: int) -> None:
        self._axis, self._seed = settings.axes.detector, seed_of_camera(seed, settings.viewed)
        camera = settings.viewing.camera
        self._size = camera.width_px, camera.height_px
        self._rate_hz = settings.camera.rate_hz
        self._errors: dict[str, _CorrelatedNoise] = {}
        self._alarms = _FalseAlarms(
            self._size, self._axis.severity * self._axis.false_alarms, self._per_frame, self._seed
        )
        self._pending: deque[tuple[float, Detections]] = deque()
        self._ready = Detections(np.empty((0, 4)), np.empty(0))
        self._ready_s: float | None = None

    def detect(self, people: Sequence[Truth], image: Image | None = None) -> Detections:
        """Detections, by score, of the latest frame whose detector has finished at the time of a frame.

        Args:
            people: Truth of everybody in view in this frame, of which one at least; frames come in their order.
            image: `(H, W, 3)` the frame; None: contrast limits nothing.
        """
        if isinstance(people, DeferredPeople) and not self._axis.latency_s:
            return Detections.deferred(lambda: self._of_frame(people, image))
        now_s = people[0].time_s
        self._pending.append((now_s, self._of_frame(people, image)))
        while self._pending and self._pending[0][0] + self._axis.latency_s <= now_s + _TINY_S:
            self._ready_s, self._ready = self._pending.popleft()
        if self._ready_s is None or self._ready_s == now_s:
            return self._ready
        return Detections(self._ready.boxes, self._ready.scores, now_s - self._ready_s)

    @property
    def _per_frame(self) -> float:
        """Share of an error that is still there one frame later."""
        return float(np.exp(-1.0 / (self._rate_hz * self._axis.correlation_s)))

    def _of_frame(self, people: Sequence[Truth], image: Image | None) -> Detections:
        seen = [one for one in people if one.scored]
        if not self._axis.on:
            return _sorted(np.array([one.box for one in seen]).reshape(-1, 4), np.ones(len(seen)))
        index = round(people[0].time_s * self._rate_hz)
        found = [self._one(one, image, index) for one in seen]
        rows = np.array([row for row in found if row is not None]).reshape(-1, 5)
        rows = np.concatenate([rows, self._alarms.at(index)])
        return _sorted(rows[:, :4], 1.0 - min(1.0, self._axis.severity) * (1.0 - self._score(rows[:, 4])))

    def _one(self, person: Truth, image: Image | None, index: int) -> FloatArray | None:
        """`(5,)` box and margin of a person; None when missed."""
        if person.name not in self._errors:
            rng = stream(self._seed, "detector", person.name)
            self._errors[person.name] = _CorrelatedNoise(rng, self._per_frame, 5)
        miss, *shift = self._errors[person.name].at(index).tolist()
        probability = self._probability(person, image)
        margin = probability - 0.5 * math.erfc(-miss / math.sqrt(2.0))
        if margin <= 0.0:
            return None
        noise = self._axis.severity * self._axis.box_noise * np.array(shift)
        size = person.box[2:] * np.exp(noise[2:])
        centre = person.box[:2] + 0.5 * person.box[2:] + noise[:2] * person.box[2:]
        box = clip(np.concatenate([centre - 0.5 * size, size]), *self._size)
        return np.append(box, margin) if (box[2:] >= 1.0).all() else None

    def _probability(self, person: Truth, image: Image | None) -> float:
        """Probability with which a person is detected; the law is that of `DetectorAxis`."""
        axis = self._axis
        probability = _weibull(person.box[3] / axis.height_px, _HEIGHT_POWER)
        probability *= _weibull(person.visible_fraction / axis.visible_share, _VISIBLE_POWER)
        if image is not None:
            probability *= _weibull(contrast(image, person.box) / axis.contrast_rms, _CONTRAST_POWER)
        return float(probability**axis.severity)

    def _score(self, margin: FloatArray) -> FloatArray:
        """Confidence of detections: it rises with how far they are from being missed."""
        lowest = self._axis.lowest_score
        return lowest + (1.0 - lowest) * (1.0 - (1.0 - margin) ** _SCORE_POWER)


def contrast(image: Image, box: FloatArray) -> float:
    """RMS contrast in a `(4,)` box: standard deviation of the luminance of its pixels, black 0 and white 1."""
    height, width = image.shape[:2]
    left, top, right, bottom = *np.floor(box[:2]).astype(int), *np.ceil(box[:2] + box[2:]).astype(int)
    columns = slice(max(0, left), min(width, right), max(1, (right - left) // _SAMPLES))
    rows = slice(max(0, top), min(height, bottom), max(1, (bottom - top) // _SAMPLES))
    pixels = image[rows, columns] @ LUMINANCE
    return float(pixels.std()) / 255.0 if pixels.size else 0.0


def _sorted(boxes: FloatArray, scores: FloatArray) -> Detections:
    """The best first, then from left to right: the order tells nothing of who is who."""
    order = np.lexsort((boxes[:, 0], -scores))
    return Detections(boxes[order], scores[order])


def _weibull(ratio: float, power: float) -> float:
    return 1.0 - float(np.exp(-(ratio**power)))


class _CorrelatedNoise:
    """Unit normal first-order autoregressive sequences, the same however they are asked for."""

    def __init__(self, rng: np.random.Generator, kept: float, count: int) -> None:
        self._rng, self._kept = rng, kept
        self._rows: list[FloatArray] = [rng.standard_normal(count)]

    def at(self, index: int) -> FloatArray:
        """`(count,)` values of a frame."""
        fresh = np.sqrt(1.0 - self._kept**2)
        while len(self._rows) <= index:
            drawn = fresh * self._rng.standard_normal((_CHUNK, len(self._rows[0])))
            for row in drawn:
                self._rows.append(self._kept * self._rows[-1] + row)
        return self._rows[index]


class _FalseAlarms:
    """False positives: they begin at a Poisson rate, last for a geometric time, and do not move in the image."""

    def __init__(self, size: tuple[int, int], per_frame: float, kept: float, seed: int) -> None:
        self._rng, self._size, self._kept, self._births = stream(seed, "detector"), size, kept, per_frame * (1.0 - kept)
        self._alive = np.empty((0, 7))  # First frame and the one after the last, box, margin
        self._drawn = 0
        self._draw(self._rng.poisson(per_frame), 0)

    def at(self, index: int) -> FloatArray:
        """`(M, 5)` boxes and margins in a frame."""
        while self._births and self._drawn < index:
            self._drawn += 1
            self._draw(self._rng.poisson(self._births), self._drawn)
        there = (self._alive[:, 0] <= index) & (index < self._alive[:, 1])
        return self._alive[there, 2:]

    def _draw(self, count: int, index: int) -> None:
        width_px, height_px = self._size
        for _ in range(count):
            size = height_px * np.exp(self._rng.uniform(*_LOG_HEIGHT)) * np.array([_ASPECT, 1.0])
            centre = self._rng.uniform(0.0, 1.0, 2) * (width_px, height_px)
            box = clip(np.concatenate([centre - 0.5 * size, size]), width_px, height_px)
            end = index + self._rng.geometric(1.0 - self._kept)
            row = [index, end, *box, self._rng.uniform(0.0, _FALSE_MARGIN)]
            self._alive = np.concatenate([self._alive, [row]])
