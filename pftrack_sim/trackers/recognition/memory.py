"""Memory of a target for trackers of any kind: it judges their estimates, and says where to start again after a loss.

A tracker, a test of what it follows that remembers the target for long, and a search after a loss make a long-term
tracker (Kalal, Mikolajczyk and Matas 2012, "Tracking-learning-detection").
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pftrack_sim.core import boxes
from pftrack_sim.core.boxes import Box
from pftrack_sim.core.records import Image
from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.features.camera_motion import CameraMotion
from pftrack_sim.trackers.recognition.colour import ColourModel
from pftrack_sim.trackers.recognition.distractors import Distractors, occluded_confidence
from pftrack_sim.trackers.recognition.parts import PartColours, describe
from pftrack_sim.trackers.recognition.person import CLOSE_UP, SURE, UNLIKE, UNSURE, KnownPerson
from pftrack_sim.trackers.recognition.pyramid import ImagePyramid
from pftrack_sim.trackers.recognition.search import (
    FOUND,
    GAIN,
    PERSON_AFTER,
    SEARCH_AFTER,
    SETTLED,
    Doubt,
    Place,
    Reach,
    likeness_at,
    moved,
    ramp,
    search,
)

SAME = 0.3  # Overlap from which a place is that of the estimate
PATCH_PX, SURROUND = 128, 3.5
"""Side of the patch whose colours are learnt, and the same as a multiple of the square root of the target's area."""
COLOUR_RATE = 0.04  # Weight of a new frame in the colours
MIN_SIZE_PX = 3.0


class Judgement(NamedTuple):
    """What the memory says of an estimate.

    Attributes:
        confidence: That the box holds the target, in [0, 1].
        occluded: Whether the target is hidden, or not there at all.
        box: `(4,)` where the target is instead [px]; None: in the estimate.
        elsewhere: Whether that is another place, where the tracker should start again.
    """

    confidence: float
    occluded: bool
    box: Box | None = None
    elsewhere: bool = False


class TargetMemory:
    """How a target looks: a person by a network, anything else by its colours.

    Args:
        image: `(H, W, 3)` the first image.
        box: `(4,)` the target in it [px].
        searches: Whether a lost target is searched in the whole image, and a box that no longer fits a person put
            right.
    """

    def __init__(self, image: Image, box: Box, *, searches: bool) -> None:
        self._searches = searches
        pyramid = ImagePyramid(image)
        self._centre: FloatArray = boxes.centre(box)
        self._size: FloatArray = box[2:].copy()
        person = KnownPerson.found(pyramid, self._centre, self._size)
        self._looks = person or PartColours(describe(pyramid, self._centre, self._size))
        self._distractors = Distractors(person) if person else None
        self._camera = CameraMotion()
        self._camera.shift(image)
        self._colours = ColourModel()
        self._learn_colours(pyramid, 1.0)
        self._doubt = Doubt()
        self._missed = 0

    def judge(self, image: Image, box: Box) -> Judgement:
        """Judge the `(4,)` box [px] that a tracker estimates in the next image, and learn from it if it is sure."""
        pyramid, known = ImagePyramid(image), self._looks
        view, place = self._seen(pyramid, estimated := _place(box, image))
        now = None if place.size is estimated.size or place.likeness < UNSURE else place
        on_distractor = False
        found: Place | None = None
        if self._distractors:
            shift = self._camera.shift(image)
            self._centre = self._centre + shift
            last = Reach(self._centre, self._size, self._missed)
            assigned = self._distractors.associate(pyramid, shift, place, view, last).place
            on_distractor = assigned is not place
            if on_distractor:
                now, place = assigned if self._searches else None, place._replace(likeness=0.0)
                if assigned.likeness == 0.0:
                    self._centre, self._size = assigned.centre, assigned.size
                elif self._searches:
                    found = assigned
        self._doubt.see(place.likeness)
        attempt = self._doubt.search(SEARCH_AFTER if on_distractor or known.is_covered(view) else PERSON_AFTER)
        if found is None and self._searches and attempt is not None:
            found = self._find(image, pyramid, place.likeness, box, attempt)
        if found is not None:
            now = place = found
            on_distractor = False
            self._doubt.begin_again()
            view, _ = likeness_at(known, pyramid, place.centre, place.size)
        close = float(place.size[1]) > CLOSE_UP * image.shape[0]
        likeness = known.follow(view, place.likeness, close_up=close)
        self._missed = 0 if likeness >= UNSURE else self._missed + 1
        visible = not on_distractor and (likeness >= UNSURE or not known.is_covered(view))
        if self._searches and now is None and visible and (correction := known.correction(view)):
            now = place = moved(place, correction, SETTLED)
        trust = ramp(likeness, UNSURE, SURE)
        if trust > 0.0:
            self._centre, self._size = place.centre, place.size
            if not (self._doubt and self._distractors) or likeness > place.likeness:
                known.learn(view, trust)
                self._learn_colours(pyramid, COLOUR_RATE * trust)
        if self._distractors:
            sure = likeness >= SURE and not self._doubt
            self._distractors.update(place if sure else Place(0.0, self._size, self._centre), sure=sure)
        occluded = on_distractor and now is not None
        return Judgement(
            occluded_confidence(self._missed) if occluded else ramp(likeness, UNLIKE, 1.0),
            not on_distractor and likeness < UNSURE and known.is_covered(view),
            None if now is None else now.box,
            found is not None,
        )

    def _seen(self, pyramid: ImagePyramid, place: Place) -> tuple[Any, Place]:
        """How a place looks, and its likeness; or those of the person in it, where that is more like the target.

        A box beside its target, or of another size, is unlike the target.
        """
        known = self._looks
        view, likeness = likeness_at(known, pyramid, place.centre, place.size)
        if self._searches and likeness < SURE and (off := known.off(view)):
            fitted = moved(place, off)
            seen, alike = likeness_at(known, pyramid, fitted.centre, fitted.size)
            if alike > likeness:
                return seen, fitted._replace(likeness=alike)
        return view, place._replace(likeness=likeness)

    def _find(self, image: Image, pyramid: ImagePyramid, likeness: float, box: Box, attempt: int) -> Place | None:
        """The place most like the target that it can have reached, if it is alike enough and not the estimate's."""
        reach = Reach(self._centre, self._size, self._missed)
        places = search(image, pyramid, self._looks, self._colours, reach, attempt)
        if self._distractors:
            places = [one for one in places if not self._distractors.are_at(one)]
        if not places:
            return None
        best = places[0]
        if best.likeness < max(FOUND, likeness + GAIN) or boxes.iou(best.box, box) >= SAME:
            return None
        return best if boxes.area(boxes.clip(best.box, *image.shape[1::-1])) > 0.0 else None

    def _learn_colours(self, pyramid: ImagePyramid, rate: float) -> None:
        side = max(SURROUND * math.sqrt(float(self._size.prod())), 1.3 * float(self._size.max()))
        width, height = (float(one) * PATCH_PX / side for one in self._size)
        self._colours.learn(pyramid.patch(self._centre, side, PATCH_PX), width, height, rate)


def _place(box: Box, image: Image) -> Place:
    """An estimate as a place that can be looked at; its likeness is not known yet."""
    return Place(0.0, np.maximum(box[2:], MIN_SIZE_PX), np.clip(boxes.centre(box), 0.0, image.shape[1::-1]))
