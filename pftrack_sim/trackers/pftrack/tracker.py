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
from pftrack_sim.trackers.pftrack.correlation import CorrelationFilter, vertex
from pftrack_sim.trackers.pftrack.hog_map import CELL_PX
from pftrack_sim.trackers.pftrack.scale import ScaleFilter, core
from pftrack_sim.trackers.recognition.colour import ColourModel
from pftrack_sim.trackers.recognition.distractors import Distractors, occluded_confidence
from pftrack_sim.trackers.recognition.parts import PartColours, describe
from pftrack_sim.trackers.recognition.person import CLOSE_UP, SURE, UNLIKE, UNSURE, KnownPerson
from pftrack_sim.trackers.recognition.pyramid import ImagePyramid
from pftrack_sim.trackers.recognition.search import (
    COMPARED,
    FOUND,
    GAIN,
    PERSON_AFTER,
    SEARCH_AFTER,
    SETTLED,
    Doubt,
    Place,
    Reach,
    likeness_at,
    person_at,
    ramp,
    search,
)

MIN_SIZE_PX = 4.0
CONTINUOUS, PASSING = 0.9, 30
"""Least likeness of a person who has been in full view, and in the gate of their prediction, since they were sure, and
the frames that a distractor may occlude them meanwhile."""
SLOW, FORGETTING = 0.05, 0.1
"""Weight of a new frame that is sure in the running means of the responses, and the share of it that others have."""
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
        rate: Weight of a new frame that is sure in the correlation filter.
        colour_share: Weight of the colour response; the correlation filter has the rest.
        colour_rate: The same in the colour histograms.
        scale_count: Number of sizes compared, odd. 1: the size is constant.
        scale_step: Ratio of successive sizes.
        scale_rate: The same in the scale filter.
        scale_interval: The scale filter is applied every so many frames.
        scale_cells: Approximate number of cells of its patches.
        scale_core: Share of the shorter side of an elongated box that its patches keep; 1: all of it.
        scale_unsure: Share of the correlation response's running mean up to which the size is kept: of blurred targets
            it is measured too small.
        scale_sure: The same from which on a change of size is taken whole; between the two its share grows linearly.
        camera_motion: Whether the search starts also where the camera's motion takes the target.
        camera_certainty: Least sum of the phase correlation around its peak for a motion to be used; 1 is a pure shift.
        recentre: Distance of the target from the window's centre above which the window is put around it and evaluated
            once more, as a share of its side.
        momentum: Share of the target's own velocity by which the search starts ahead; 0: no such start.
        unsure_likeness: Likeness of the person or of the parts' colours, as a share of the usual one, below which the
            target is occluded and nothing is learnt ...
        sure_likeness: ... and from which on everything is; between the two the rates grow linearly.
        occlusion_hold: An occluded target whose score is below this share of its running mean is not followed; above
            it the box moves.
        search_after: After so many frames of doubt, see `Doubt`, the whole image is searched; 0: never.
        found_likeness: A place found is taken from this likeness on ...
        found_peak: ... and from this share of the correlation response's running mean on ...
        found_gain: ... and, where the target is not occluded, if it is more alike by this.
        person_gain: Share of a person's distance from the box, and of the difference in size, that is made good in a
            frame; 0: people are known by their colours alone, as other targets are.
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
    unsure_likeness: Share = UNSURE
    sure_likeness: Share = SURE
    occlusion_hold: Share = 0.35
    search_after: Annotated[int, Field(ge=0, le=1000)] = SEARCH_AFTER
    found_likeness: Share = FOUND
    found_peak: Share = 0.5
    found_gain: Share = GAIN
    person_gain: Share = SETTLED


class Match(NamedTuple):
    """The best position in a window: its score, the correlation response there, its centre [px], and the scale."""

    score: float
    peak: float
    centre: FloatArray
    scale: float


class Seen(NamedTuple):
    """A match, and how it looks, with the likeness to the target: `PersonView` of a person, else `Histograms`."""

    match: Match
    looks: Any
    likeness: float


class Step(NamedTuple):
    """Where the target is taken to be in a frame.

    Attributes:
        seen: The best match, or a place found elsewhere.
        carried: `(2,)` predicted centre [px]: the last one moved by the camera's motion, or behind its occluder.
        behind: Whether a distractor occludes the target.
        elsewhere: Whether the target was found in another place.
    """

    seen: Seen
    carried: FloatArray
    behind: bool = False
    elsewhere: bool = False


class Pftrack(BaseTracker):
    """Correlation filter with colour, scale and camera motion that knows people by a network, and all by their colours.

    It draws no random numbers.
    """

    def __init__(self, params: PftrackParameters) -> None:
        super().__init__()
        self.params = params

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
        self._doubt, self._sure_scale, self._missed = Doubt(p.unsure_likeness, p.sure_likeness), 1.0, 0
        pyramid = ImagePyramid(image)
        person = KnownPerson.found(pyramid, self._centre, self._size) if p.person_gain > 0.0 else None
        self._looks = person or PartColours(describe(pyramid, self._centre, self._size))
        self._distractors = Distractors(person) if person else None
        self._continuous, self._passing = person is not None, False
        self._camera_shift(image)
        self._learn(pyramid, 1.0)

    def _follow(self, image: Image) -> Estimate:
        p = self.params
        self._frame += 1
        pyramid = ImagePyramid(image)
        shift = self._camera_shift(image)
        seen = self._place(pyramid, self._search(pyramid, image, shift))
        if seen.likeness < p.unsure_likeness:
            # The filter may have left a person in full view for somebody near the camera.
            seen = self._where_predicted(pyramid, image, shift) or seen
        if self._usual is None:
            self._usual = np.array([seen.match.score, seen.match.peak])
        step = self._associate(pyramid, image, shift, seen)
        if not step.elsewhere:
            step = self._recover(pyramid, image, step)
        seen, found, known = step.seen, step.seen.match, self._looks
        covered = known.is_covered(seen.looks)
        close = self._scale * float(self._size[1]) > CLOSE_UP * image.shape[0]
        likeness = known.follow(seen.looks, seen.likeness, close_up=close)
        occluded = likeness < p.unsure_likeness
        self._missed = self._missed + 1 if occluded else 0
        hold = step.behind or (occluded and found.score < p.occlusion_hold * self._usual[0])
        self._centre = _inside(step.carried, image) if hold else found.centre
        peak = min(max(found.peak / max(float(self._usual[1]), 1e-6), 0.0), 1.0)
        if not hold and p.scale_count > 1 and self._frame % p.scale_interval == 0:
            self._rescale(pyramid, image, peak)
        # No distractor is in the box: a person in it who is unlike the target may be the target, turned or in shade.
        if not step.behind and not (occluded and covered):
            self._settle(known.correction(seen.looks), image)
        if not occluded:
            self._adapt(pyramid, step, likeness, peak)
        now = Place(likeness, self._scale * self._size, self._centre)
        if self._distractors:
            self._continuous = likeness >= p.sure_likeness or (self._continuous and not step.elsewhere)
            sure = self._continuous and not occluded and not self._doubt
            self._distractors.update(now, sure=sure)
        if step.behind:
            return Estimate(now.box, occluded_confidence(self._missed))
        return Estimate(now.box, ramp(likeness, UNLIKE, 1.0), occluded and (hold or covered))

    def _associate(self, pyramid: ImagePyramid, image: Image, shift: FloatArray, seen: Seen) -> Step:
        """The target's place by association with its own track and the distractors'."""
        carried = self._centre + shift
        if self._distractors is None:
            return Step(seen, carried)
        at = Place(seen.likeness, seen.match.scale * self._size, seen.match.centre)
        ahead = Reach(carried + self.params.momentum * self._velocity, self._scale * self._size, self._missed)
        assigned, in_gate, in_front = self._distractors.associate(pyramid, shift, at, seen.looks, ahead)
        in_view = assigned is at and in_gate and not self._looks.is_covered(seen.looks)
        in_view = in_view and (self._missed == 0 or seen.likeness > UNLIKE)
        # Its passing ends when the target is in view without it, whatever is not detected in single frames.
        self._passing = in_front or (self._passing and not in_view)
        self._continuous = self._continuous and (in_view or (self._passing and self._missed <= PASSING))
        if assigned is at:
            least = CONTINUOUS if self._continuous and in_view else 0.0
            return Step(seen._replace(likeness=max(seen.likeness, least)), carried)
        if assigned.likeness > 0.0:
            return self._begin_at(self._seen_at(pyramid, image, assigned))
        self._velocity, self._sure_scale = np.zeros(2), self._scale
        return Step(seen._replace(likeness=0.0), assigned.centre, behind=True)

    def _recover(self, pyramid: ImagePyramid, image: Image, step: Step) -> Step:
        """The same step, or another place in the image, where a search is due and finds one."""
        p = self.params
        self._doubt.see(step.seen.likeness)
        in_view = not step.behind and not self._looks.is_covered(step.seen.looks)
        attempt = self._doubt.search(max(p.search_after, PERSON_AFTER) if in_view else p.search_after)
        if not p.search_after or attempt is None:
            return step
        other = self._find(pyramid, image, step.seen, attempt)
        return self._begin_at(other) if other else step

    def _begin_at(self, seen: Seen) -> Step:
        """The target was found at another place."""
        self._scale, self._velocity = seen.match.scale, np.zeros(2)
        self._doubt.begin_again()
        return Step(seen, seen.match.centre, elsewhere=True)

    def _adapt(self, pyramid: ImagePyramid, step: Step, likeness: float, peak: float) -> None:
        """Update velocity and usual responses, and learn the appearance as far as it is sure."""
        p, seen, found = self.params, step.seen, step.seen.match
        assert self._usual is not None
        trust = ramp(likeness, p.unsure_likeness, p.sure_likeness)
        self._velocity = 0.5 * (self._velocity + found.centre - step.carried)
        self._usual = self._usual + SLOW * max(trust, FORGETTING) * (np.array([found.score, found.peak]) - self._usual)
        if trust > 0.0:
            self._learn(pyramid, peak * trust)
            if not (self._doubt and self._distractors) or likeness > seen.likeness:
                self._looks.learn(seen.looks, trust)
            self._sure_scale = self._scale

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
        matches = [self._match(pyramid, image, start, self._scale) for start in starts]
        chosen = max(range(len(matches)), key=lambda k: matches[k].score)
        start, best = starts[chosen], matches[chosen]
        # Hann's window weakens a target far from the centre.
        if math.hypot(*(best.centre - start)) > self.params.recentre * side:
            again = self._match(pyramid, image, best.centre, self._scale)
            best = again if again.score > best.score else best
        return best

    def _match(self, pyramid: ImagePyramid, image: Image, centre: FloatArray, scale: float) -> Match:
        """The best position of a target of this scale in the window around a centre."""
        p = self.params
        patch = self._patch(pyramid, centre, scale)
        peaks = self._filter.respond(self._filter.spectrum(patch, searched=True))
        scores = peaks
        if p.colour_share > 0.0:
            pixels = self._colour.respond(patch, *self._size_in_patch())
            colours = np.asarray(cv2.resize(pixels, (p.cells, p.cells), interpolation=cv2.INTER_LINEAR))
            scores = (1.0 - p.colour_share) * peaks + p.colour_share * colours
        row, column = divmod(int(scores.argmax()), p.cells)
        rows = [float(scores[(row + k) % p.cells, column]) for k in (-1, 0, 1)]
        columns = [float(scores[row, (column + k) % p.cells]) for k in (-1, 0, 1)]
        offset = np.array([column + vertex(*columns), row + vertex(*rows)]) - p.cells // 2
        at = _inside(centre + offset * (scale * self._side / p.cells), image)
        return Match(float(scores[row, column]), float(peaks[row, column]), at, scale)

    def _place(self, pyramid: ImagePyramid, match: Match) -> Seen:
        looks, likeness = likeness_at(self._looks, pyramid, match.centre, match.scale * self._size)
        return Seen(match, looks, likeness)

    def _where_predicted(self, pyramid: ImagePyramid, image: Image, shift: FloatArray) -> Seen | None:
        """The target where the camera's motion alone would take it, if a person like it is there."""
        place = Place(0.0, self._scale * self._size, _inside(self._centre + shift, image))
        found = person_at(self._looks, pyramid, place, looks=1) if isinstance(self._looks, KnownPerson) else None
        seen = None if found is None else self._seen_at(pyramid, image, found[0])
        return None if seen is None or seen.likeness < self.params.unsure_likeness else seen

    def _seen_at(self, pyramid: ImagePyramid, image: Image, at: Place) -> Seen:
        """The target at a place where it was seen."""
        match = self._match(pyramid, image, at.centre, float(at.size[1] / self._size[1]))
        looks, likeness = likeness_at(self._looks, pyramid, at.centre, at.size)
        return Seen(match._replace(centre=at.centre), looks, likeness)

    def _find(self, pyramid: ImagePyramid, image: Image, now: Seen, attempt: int) -> Seen | None:
        """The best place in the whole image where the target may be; None where no other is as sure as asked for.

        Places are proposed by colour at several sizes, ordered by their looks, and compared by the filter.
        """
        p = self.params
        assert self._usual is not None
        # People walk; where other targets can be is not known.
        missed = self._missed if self._distractors else math.inf
        reach = Reach(self._centre, self._sure_scale * self._size, missed)
        proposed = search(image, pyramid, self._looks, self._colour, reach, attempt)
        least = max(p.found_likeness, 0.0 if now.likeness < p.unsure_likeness else now.likeness + p.found_gain)
        best: Seen | None = None
        for one in proposed[:COMPARED]:
            scale = float(one.size[1] / self._size[1])
            place = self._place(pyramid, self._match(pyramid, image, one.centre, scale))
            if self._distractors and self._distractors.are_at(Place(0.0, scale * self._size, place.match.centre)):
                continue
            sure = place.likeness >= least and place.match.peak >= p.found_peak * self._usual[1]
            if sure and (best is None or place.match.score > best.match.score):
                best = place
        return best

    def _rescale(self, pyramid: ImagePyramid, image: Image, peak: float) -> None:
        p = self.params
        share = ramp(peak, p.scale_unsure, p.scale_sure)
        if share == 0.0:
            return
        self._set_scale(self._scale * self._scales.factor(pyramid, self._centre, self._scale) ** share, image)

    def _settle(self, correction: tuple[FloatArray, float] | None, image: Image) -> None:
        """Move the box towards the person in it, and to the person's size."""
        if correction is not None:
            gain, (shift, growth) = self.params.person_gain, correction
            self._centre = _inside(self._centre + gain * self._scale * float(self._size[1]) * shift, image)
            self._set_scale(self._scale * math.exp(gain * growth), image)

    def _set_scale(self, scale: float, image: Image) -> None:
        least = min(MIN_SIZE_PX / float(self._size.min()), 1.0)
        most = max(2.0 * min(image.shape[1] / float(self._size[0]), image.shape[0] / float(self._size[1])), 1.0)
        self._scale = min(max(scale, least), most)

    def _learn(self, pyramid: ImagePyramid, trust: float) -> None:
        """Learn at the estimate, at rates in proportion to `trust` in [0, 1]."""
        p = self.params
        patch = self._patch(pyramid, self._centre, self._scale)
        self._filter.learn(self._filter.spectrum(patch), p.rate * trust)
        self._colour.learn(patch, *self._size_in_patch(), p.colour_rate * trust)
        if p.scale_count > 1 and self._frame % p.scale_interval == 0:
            self._scales.learn(pyramid, self._centre, self._scale, p.scale_rate * trust)

    def _patch(self, pyramid: ImagePyramid, centre: FloatArray, scale: float) -> Image:
        return pyramid.patch(centre, scale * self._side, CELL_PX * self.params.cells)

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
