"""The tracker `pftrack`; `docs/pftrack.md` describes the method and the evidence for each part."""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

import cv2
import numpy as np
from pydantic import Field

from pftrack_sim.core import boxes
from pftrack_sim.core.boxes import Box
from pftrack_sim.core.records import Estimate, Image
from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.base import BaseTracker
from pftrack_sim.trackers.features.camera_motion import CameraMotion
from pftrack_sim.trackers.parameters import NotNegative, Parameters, Share
from pftrack_sim.trackers.pftrack.colour import ColourModel
from pftrack_sim.trackers.pftrack.correlation import CorrelationFilter, vertex
from pftrack_sim.trackers.pftrack.hog_map import CELL_PX
from pftrack_sim.trackers.pftrack.pyramid import ImagePyramid
from pftrack_sim.trackers.pftrack.scale import ScaleFilter, core

MIN_SIZE_PX = 4.0
SLOW = 0.05
"""Weight of a new frame in the running means that the occlusion test compares with."""
APART = 0.15
"""Starts of the search nearer to each other than this share of the square root of the target's area count as one."""


class PftrackParameters(Parameters):
    """Parameters of `pftrack`.

    Attributes:
        cells: Cells of 4x4 pixels of the search window in each direction, even.
        padding: Side of the search window, as a multiple of the square root of the target's area.
        label_sigma: Standard deviation of the correlation filter's label, as a share of the square root of the area.
        search_window: Power of the Hann window over patches that are searched; patches that are learnt have power 1.
        ridge: Regularisation of the correlation filter, as a share of the mean spectral energy of the first patch.
        rate: Weight of a new frame of confidence 1 in the correlation filter.
        colour_share: Weight of the colour response; the correlation filter has the rest. At 0 no occlusion is reported.
        colour_rate: The same in the colour histograms.
        scale_count: Number of sizes compared, odd. 1: the size is constant.
        scale_step: Ratio of successive sizes.
        scale_rate: The same in the scale filter.
        scale_interval: The scale filter is applied every so many frames.
        scale_cells: Approximate number of cells of its patches.
        scale_core: Share of the shorter side of an elongated box that its patches keep; 1: all of it.
        scale_unsure: Confidence up to which the size is kept: of blurred targets it is measured too small.
        scale_sure: Confidence from which on a change of size is taken whole; between the two its share grows linearly.
        camera_motion: Whether the search starts also where the camera's motion takes the target.
        camera_certainty: Least sum of the phase correlation around its peak for a motion to be used; 1 is a pure shift.
        recentre: Distance of the target from the window's centre above which the window is put around it and evaluated
            once more, as a share of its side.
        momentum: Share of the target's own velocity by which the search starts ahead; 0: no such start.
        occlusion_peak: The target is occluded when the correlation response is below this share of its running mean ...
        occlusion_colour: ... and the colour response is below this share of its own.
        occlusion_hold: An occluded target whose score is below this share of its running mean is not followed; above
            it the box moves, but nothing is learnt.
    """

    cells: Annotated[int, Field(ge=8, le=128, multiple_of=2)] = 32
    padding: Annotated[float, Field(ge=1.1, le=10.0)] = 3.5
    label_sigma: Annotated[float, Field(gt=0.0, le=1.0)] = 0.07
    search_window: Share = 0.5
    ridge: NotNegative = 0.001
    rate: Share = 0.015
    colour_share: Share = 0.3
    colour_rate: Share = 0.04
    scale_count: Annotated[int, Field(ge=1, le=99)] = 17
    scale_step: Annotated[float, Field(gt=1.0, le=1.5)] = 1.04
    scale_rate: Share = 0.025
    scale_interval: Annotated[int, Field(ge=1, le=100)] = 2
    scale_cells: Annotated[int, Field(ge=4, le=1024)] = 36
    scale_core: Annotated[float, Field(gt=0.0, le=1.0)] = 0.4
    scale_unsure: Share = 0.4
    scale_sure: Share = 0.8
    camera_motion: bool = True
    camera_certainty: Share = 0.3
    recentre: NotNegative = 0.1
    momentum: Share = 0.7
    occlusion_peak: Share = 0.6
    occlusion_colour: Share = 0.85
    occlusion_hold: Share = 0.35


class Match(NamedTuple):
    """The best position in a window: its score, the two responses there, and its centre [px]."""

    score: float
    peak: float
    colour: float
    centre: FloatArray


class Pftrack(BaseTracker):
    """Correlation filter with colour, scale, camera motion and an occlusion test. It draws no random numbers."""

    def __init__(self, params: PftrackParameters) -> None:
        super().__init__()
        self.params = params
        self._size = np.ones(2)
        self._side = 1.0
        self._scale = 1.0
        self._centre = np.zeros(2)
        self._velocity = np.zeros(2)
        self._frame = 0
        self._filter: CorrelationFilter
        self._colour: ColourModel
        self._scales: ScaleFilter
        self._camera: CameraMotion
        self._usual: FloatArray | None = None

    def _start(self, image: Image, box: Box) -> None:
        p = self.params
        self._size, self._centre, self._scale, self._frame = box[2:].copy(), boxes.centre(box), 1.0, 0
        self._velocity = np.zeros(2)
        area_root = math.sqrt(float(self._size[0] * self._size[1]))
        # Around long thin targets the window still has some surround.
        self._side = max(p.padding * area_root, 1.3 * float(self._size.max()))
        width, height = (float(side) / self._side * p.cells for side in self._size)
        sigma = p.label_sigma * math.sqrt(width * height)
        self._filter = CorrelationFilter(p.cells, (width, height), sigma, p.ridge, p.search_window)
        self._colour = ColourModel()
        self._scales = ScaleFilter(core(self._size, p.scale_core), p.scale_count, p.scale_step, p.scale_cells)
        self._camera = CameraMotion(p.camera_certainty)
        self._usual = None
        pyramid = ImagePyramid(image)
        self._camera_shift(image)
        self._learn(pyramid, 1.0)

    def _follow(self, image: Image) -> Estimate:
        p = self.params
        self._frame += 1
        pyramid = ImagePyramid(image)
        shift = self._camera_shift(image)
        found = self._search(pyramid, image, shift)
        now = np.array([found.score, found.peak, found.colour])
        usual = now if self._usual is None else self._usual
        unseen, weak, recoloured = now < usual * (p.occlusion_hold, p.occlusion_peak, p.occlusion_colour)
        occluded = bool(weak and recoloured)
        confidence = min(max(found.peak / max(float(usual[1]), 1e-6), 0.0), 1.0)
        carried = self._centre + shift
        self._centre = _inside(carried, image) if occluded and unseen else found.centre
        if not occluded:
            self._velocity = 0.5 * (self._velocity + found.centre - carried)
            self._usual = usual + SLOW * (now - usual)
            if p.scale_count > 1 and self._frame % p.scale_interval == 0:
                self._rescale(pyramid, image, confidence)
            self._learn(pyramid, confidence)
        size = self._scale * self._size
        return Estimate(np.concatenate([self._centre - 0.5 * size, size]), confidence, occluded)

    def _camera_shift(self, image: Image) -> FloatArray:
        return self._camera.shift(image) if self.params.camera_motion else np.zeros(2)

    def _search(self, pyramid: ImagePyramid, image: Image, shift: FloatArray) -> Match:
        """The best match from where the camera's motion takes the target, where it was, and where it was going."""
        side, apart = self._scale * self._side, APART * self._scale * math.sqrt(float(self._size.prod()))
        carried = self._centre + shift
        starts = [_inside(carried, image)]
        for place in (self._centre, carried + self.params.momentum * self._velocity):
            inside = _inside(place, image)
            if min(math.hypot(*(inside - other)) for other in starts) > apart:
                starts.append(inside)
        matches = [self._match(pyramid, image, start) for start in starts]
        chosen = max(range(len(matches)), key=lambda k: matches[k].score)
        start, best = starts[chosen], matches[chosen]
        # Hann's window weakens a target far from the centre.
        if math.hypot(*(best.centre - start)) > self.params.recentre * side:
            again = self._match(pyramid, image, best.centre)
            best = again if again.score > best.score else best
        return best

    def _match(self, pyramid: ImagePyramid, image: Image, centre: FloatArray) -> Match:
        """The best position in the window around a centre."""
        p = self.params
        patch = self._patch(pyramid, centre)
        peaks = self._filter.respond(self._filter.spectrum(patch, searched=True))
        scores, colours = peaks, None
        if p.colour_share > 0.0:
            pixels = self._colour.respond(patch, *self._size_in_patch())
            colours = np.asarray(cv2.resize(pixels, (p.cells, p.cells), interpolation=cv2.INTER_LINEAR))
            scores = (1.0 - p.colour_share) * peaks + p.colour_share * colours
        row, column = divmod(int(scores.argmax()), p.cells)
        rows = [float(scores[(row + k) % p.cells, column]) for k in (-1, 0, 1)]
        columns = [float(scores[row, (column + k) % p.cells]) for k in (-1, 0, 1)]
        offset = np.array([column + vertex(*columns), row + vertex(*rows)]) - p.cells // 2
        at = _inside(centre + offset * (self._scale * self._side / p.cells), image)
        colour = 1.0 if colours is None else float(colours[row, column])
        return Match(float(scores[row, column]), float(peaks[row, column]), colour, at)

    def _rescale(self, pyramid: ImagePyramid, image: Image, confidence: float) -> None:
        p = self.params
        share = min(max((confidence - p.scale_unsure) / max(p.scale_sure - p.scale_unsure, 1e-6), 0.0), 1.0)
        if share == 0.0:
            return
        scale = self._scale * self._scales.factor(pyramid, self._centre, self._scale) ** share
        least = min(MIN_SIZE_PX / float(self._size.min()), 1.0)
        most = max(2.0 * min(image.shape[1] / float(self._size[0]), image.shape[0] / float(self._size[1])), 1.0)
        self._scale = min(max(scale, least), most)

    def _learn(self, pyramid: ImagePyramid, confidence: float) -> None:
        """Learn at the estimate, at rates in proportion to the confidence: a covered target is learnt little."""
        p = self.params
        patch = self._patch(pyramid, self._centre)
        self._filter.learn(self._filter.spectrum(patch), p.rate * confidence)
        if p.colour_share > 0.0:
            self._colour.learn(patch, *self._size_in_patch(), p.colour_rate * confidence)
        if p.scale_count > 1 and self._frame % p.scale_interval == 0:
            self._scales.learn(pyramid, self._centre, self._scale, p.scale_rate * confidence)

    def _patch(self, pyramid: ImagePyramid, centre: FloatArray) -> Image:
        return pyramid.patch(centre, self._scale * self._side, CELL_PX * self.params.cells)

    def _size_in_patch(self) -> tuple[float, float]:
        """Width and height of the target in a patch [px of the patch]."""
        width, height = self._size * (CELL_PX * self.params.cells / self._side)
        return float(width), float(height)


def _inside(point: FloatArray, image: Image) -> FloatArray:
    """The nearest point of the image to `(2,)` x, y [px]."""
    return np.clip(point, 0.0, (image.shape[1], image.shape[0]))


def make(name: str, *, seed: int, preset: str, **params: Any) -> Pftrack:
    """Make `pftrack`, which uses no random numbers; raises ParameterError."""
    return Pftrack(PftrackParameters.from_preset(name, preset, params))
