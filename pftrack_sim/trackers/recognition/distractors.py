"""Tracks of the people beside a target, so that a distractor that occludes it is not taken for it.

People in similar clothes still differ in position and size. Target and distractors are predicted, and a detection goes
to the track with the least d^2 + ln |S|: d is the distance in standard deviations, and S the covariance, which grows
while a track has no detection (association of the nearest neighbour: Blackman and Popoli 1999, "Design and analysis of
modern tracking systems", section 6.4).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core import boxes
from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.recognition.person import PROBABLY, UNSURE, KnownPerson, PersonView, look_at_all
from pftrack_sim.trackers.recognition.pyramid import ImagePyramid
from pftrack_sim.trackers.recognition.search import APART, LOOKS, Place, Reach, likeness_at, moved, person_at

EVERY, ROW, STEP = 4, 1.6, 0.4
"""Frames from one search for new people to the next, half the length of the row of points that it starts from, and the
points' distance, in heights of the target."""
NEARER = 1.8  # Height of the people whom a second row searches for, in heights of the target: they can occlude it
SHIFT, GROWTH, WIDENING = 0.25, 0.12, 0.2
"""Standard deviations of a prediction one frame ahead: of the position, in heights of the box, and of the logarithm of
the height; and the share by which both grow with each frame without a detection."""
UNLIKE = 0.1  # Standard deviation of one minus the product of the identities of two views of a person
TARGET_GATE, GATE = 4.0, 16.0  # Greatest d^2 of a detection that continues the target's track, or a distractor's
UNSEEN = 9.0  # What a target without a detection costs
SAME, OTHER = 0.5, 0.3  # Overlap from which two boxes are of one person, and up to which they are of two
BEHIND, HIDDEN = 0.85, 0.5
"""A distractor below this height, in heights of the target, is behind it: more than this share of the box inside the
target's, it is hidden, and a detection there is the target."""
IN_FRONT, MEETS = 1.1, 0.1
"""From this height on, in heights of the target, a distractor is in front of it and cannot be occluded by it; from this
overlap of the boxes on, one of the two occludes the other."""
LEAST_HEIGHT = 0.6  # Of a distractor, in heights of the target: a smaller one is behind the target
MOST, MISSED = 3, 15  # Distractors that are tracked, and frames without a detection after which a track ends
FAR = 2.5  # Distance from the target, in its heights, beyond which a track ends
SMOOTHING = 0.5  # Weight of the former velocity
OCCLUDED, DECAY_FRAMES = 0.4, 150
"""Confidence of a target that a distractor has just occluded, and the frames in which it falls to 1/e."""
CLOSER = 0.9  # Factor per frame of an occluded target's offset across its occluder: were it large, it would be seen
LEARNT = 0.1  # Weight of a new view in a track's identity
EXCHANGED, TWICE = 0.08, 2
"""A box and a track were exchanged if both are more like each other's identity, together by this, in so many frames."""
MET = 5  # Frames beside a sure target from which on a track's person is remembered when it ends


class Association(NamedTuple):
    """Where the target is by association.

    Attributes:
        place: The tracker's; or another one where a distractor is in that box: its likeness is 0 if the target is
            occluded, and assumed to stay behind its occluder.
        in_gate: Whether a person was detected in the tracker's box, within the gate of the target's prediction, who is
            more like the target than like a distractor that meets the box.
        in_front: Whether a distractor meets the predicted target that is not behind it.
    """

    place: Place
    in_gate: bool
    in_front: bool


class _Detection(NamedTuple):
    place: Place
    identity: NDArray[np.float32]


@dataclass
class _Track:
    place: Place  # The prediction, until the frame's update
    identity: NDArray[np.float32]  # Unit vector
    missed: float = 0
    apart: int = 0  # Frames in which it was seen beside a target that was sure: it is somebody else
    exchanged: int = 0  # Frames in a row in which it looks like the target, and the person in the box like its own
    velocity: FloatArray = field(default_factory=lambda: np.zeros(2))  # Relative to the camera's motion [px per frame]
    detection: _Detection | None = None

    def cost(self, detection: _Detection) -> float:
        """d^2 + ln |S|, up to a constant; position and height, three numbers, are what S grows in."""
        return self.distance(detection) + 6.0 * math.log(1.0 + WIDENING * self.missed)

    def distance(self, detection: _Detection) -> float:
        """d^2 of position, height and identity."""
        wider = 1.0 + WIDENING * self.missed
        unlike = (1.0 - float(detection.identity @ self.identity)) / UNLIKE
        return self.motion(detection) / (wider * wider) + unlike * unlike

    def reaches(self, detection: _Detection) -> bool:
        """Whether position and height can be those of this track now."""
        wider = 1.0 + WIDENING * self.missed
        return self.motion(detection) < TARGET_GATE * wider * wider

    def is_more_alike(self, detection: _Detection, other: _Track) -> bool:
        """Whether a detection looks more like this track than like another."""
        return float(detection.identity @ self.identity) > float(detection.identity @ other.identity)

    def learn(self, detection: _Detection) -> None:
        """Learn a view of somebody who is not the target, which is sure elsewhere."""
        self.apart += 1
        mean = self.identity + np.float32(LEARNT) * (detection.identity - self.identity)
        self.identity = np.asarray(mean / np.linalg.norm(mean), dtype=np.float32)

    def is_other(self, target: NDArray[np.float32], *, sure: bool) -> bool:
        """Whether its detection is not the target, whose identity is given.

        The track may have gone over to a target that looks alike, but not if that was `sure` elsewhere a frame before.
        """
        if self.detection is None or not self.apart:
            return False
        view = self.detection.identity
        return sure or float(view @ target) <= float(view @ self.identity) + PROBABLY

    def motion(self, detection: _Detection) -> float:
        """d^2 of position and height alone, one frame after the last detection."""
        growth = math.log(float(detection.place.size[1] / self.place.size[1])) / GROWTH
        shift = math.dist(detection.place.centre, self.place.centre) / (SHIFT * float(self.place.size[1]))
        return growth * growth + shift * shift

    def occluded_by_it(self, target: Place) -> Place:
        """The predicted target, with a likeness of 0, if it stays behind this track, its occluder.

        Its height and size stay: a robot that approaches comes nearer to the occluder than to the target.
        """
        assert self.detection
        offset = float(target.centre[0] - (self.place.centre[0] - self.velocity[0]))
        centre = np.array([self.detection.place.centre[0] + CLOSER * offset, target.centre[1]])
        return Place(0.0, target.size, centre)


class Distractors:
    """Tracks of the people around a target. Each frame is a call of `associate` and one of `update`.

    Args:
        target: Whom they are not.
    """

    def __init__(self, target: KnownPerson) -> None:
        self._target = target
        self._tracks: list[_Track] = []
        self._frame, self._sure = 0, False

    def associate(
        self, pyramid: ImagePyramid, shift: FloatArray, place: Place, view: PersonView, target: Reach
    ) -> Association:
        """Where the target is in the next image, by association of detections with its track and the distractors'.

        Args:
            pyramid: The image.
            shift: `(2,)` motion of the image's content since the last image [px].
            place: The target's box as estimated by the tracker.
            view: What is seen in it.
            target: The target's prediction, with the frames since its last detection.
        """
        self._pyramid = pyramid
        expected = _Track(Place(0.0, target.size, target.centre), self._target.identity, target.missed)
        for track in self._tracks:
            track.place = track.place._replace(centre=track.place.centre + shift + track.velocity)
            detection = None if _hidden(track.place, expected.place) else self._detect(track.place, looks=1)
            track.detection = detection if detection and track.distance(detection) < GATE else None
        off = self._target.off(view)
        in_box = _Detection(place if off is None else moved(place, off), view.identity)
        seen = [(track, track.detection.place) for track in self._tracks if track.detection]
        for track in self._tracks:
            exchanged = off is not None and _exchanged(expected, in_box, track)
            track.exchanged = track.exchanged + 1 if exchanged else 0
        in_gate = off is not None and expected.motion(in_box) < TARGET_GATE
        in_gate = in_gate and not any(
            track.is_more_alike(in_box, expected) and _overlap(at, in_box.place, MEETS) for track, at in seen
        )
        in_front = any(at.size[1] > BEHIND * target.size[1] and _overlap(at, expected.place, MEETS) for _, at in seen)
        return Association(self._place(place, in_box, expected), in_gate, in_front)

    def _place(self, place: Place, in_box: _Detection, target: _Track) -> Place:
        """`Association.place`, and new tracks of people who are too far from the occluded target to be it."""
        for track in self._tracks:
            if track.exchanged >= TWICE and (own := track.detection):
                track.detection, track.exchanged = in_box, 0
                return self._compared(own.place)
        occluder, detections = self._assigned(in_box, target)
        if occluder is None:
            return place
        tall = LEAST_HEIGHT * float(target.place.size[1])
        near: list[_Detection] = []
        for one in detections:
            if target.reaches(one):
                near.append(one)
            elif one.place.size[1] > tall:  # a distractor that was not tracked yet
                self._tracks.append(_Track(*one, detection=one))
        alike = [self._compared(one.place) for one in near]
        best = max(alike, key=lambda one: one.likeness, default=None)
        return best if best and best.likeness >= UNSURE else occluder.occluded_by_it(target.place)

    def _compared(self, place: Place) -> Place:
        """A place with its likeness to the target."""
        return place._replace(likeness=likeness_at(self._target, self._pyramid, place.centre, place.size)[1])

    def are_at(self, place: Place) -> bool:
        """Whether one of them was detected at a place, and is not the target that its track has gone over to."""
        return any(
            one.detection
            and _overlap(one.detection.place, place, SAME)
            and one.is_other(self._target.identity, sure=self._sure)
            for one in self._tracks
        )

    def update(self, target: Place, *, sure: bool) -> None:
        """Update the tracks with their detections, and begin new ones beside a target that is surely at a place."""
        self._sure = sure
        kept: list[_Track] = []
        for track in self._tracks:
            track.missed = track.missed + 1 if track.detection is None else 0
            if track.detection is not None:
                track.velocity = track.velocity + (1.0 - SMOOTHING) * (
                    track.detection.place.centre - track.place.centre
                )
                track.place = track.detection.place
                if sure:
                    track.learn(track.detection)
            near = math.dist(track.place.centre, target.centre) < FAR * float(target.size[1])
            if near and track.missed <= MISSED and not any(_overlap(track.place, one.place, SAME) for one in kept):
                kept.append(track)
        former, self._tracks = self._tracks, kept
        self._frame += 1
        if sure and self._frame % EVERY == 0:
            for detection in [*self._beside(target), *self._beside(target, NEARER)]:
                others = [target, *(one.place for one in self._tracks)]
                apart = not any(_overlap(detection.place, other, OTHER) for other in others)
                if apart and detection.place.size[1] > LEAST_HEIGHT * target.size[1]:
                    self._tracks.append(_Track(*detection, apart=1))
        # The nearest to the camera, who can occlude the target, are the tallest in the image.
        self._tracks.sort(key=lambda one: -float(one.place.size[1]) / (1.0 + WIDENING * one.missed))
        del self._tracks[MOST:]
        for track in former:
            if track.apart >= MET and not any(track is one for one in self._tracks):
                self._target.meet(track.identity)

    def _assigned(self, in_box: _Detection, target: _Track) -> tuple[_Track | None, list[_Detection]]:
        """The distractor in the target's box, or None; and the detections that can be the target then."""
        for track in self._tracks:
            if track.detection is None:
                continue
            if not _overlap(track.detection.place, in_box.place, SAME):
                if _swapped(target, in_box, track, track.detection):
                    track.detection, in_box = in_box, track.detection
                    return track, [in_box]
            elif target.cost(in_box) <= track.cost(track.detection):
                if track.place.size[1] < IN_FRONT * target.place.size[1]:
                    track.detection = None  # occluded by the target
            else:
                others = self._beside(target.place)
                stays = track.cost(track.detection)
                for other in others:
                    if target.cost(in_box) + track.cost(other) < stays + min(target.cost(other), UNSEEN):
                        track.detection = other
                        return None, []
                return track, others
        return None, []

    def _beside(self, target: Place, zoom: float = 1.0) -> list[_Detection]:
        """Detections from a row of points through a place that belong to none of the tracks.

        They are looked at as people of the place's size times `zoom`.
        """
        size = zoom * target.size
        height = float(size[1])
        count = round(ROW / zoom / STEP)
        right = np.arange(-count, count + 1) * STEP * height
        points = target.centre + np.stack([right, np.zeros_like(right)], axis=1)
        near: list[Place] = []
        for point, view in zip(points, look_at_all(self._pyramid, points, height), strict=True):
            if (off := self._target.off(view)) is not None:
                near.append(moved(Place(view.person * view.visible, size, point), off))
        found: list[_Detection] = []
        for one in sorted(near, key=lambda one: -one.likeness):
            if all(math.dist(one.centre, other.place.centre) > APART * float(one.size[1]) for other in found):
                detection = self._detect(one)
                if detection and not self.are_at(detection.place):
                    found.append(detection)
        return found

    def _detect(self, place: Place, looks: int = LOOKS) -> _Detection | None:
        seen = person_at(self._target, self._pyramid, place, looks)
        return None if seen is None else _Detection(seen[0], seen[1].identity)


def occluded_confidence(frames: int) -> float:
    """Confidence of a target that a distractor has occluded for so many frames."""
    return OCCLUDED * math.exp(-frames / DECAY_FRAMES)


def _swapped(one: _Track, detection: _Detection, other: _Track, other_detection: _Detection) -> bool:
    """Whether two tracks fit each other's detections better than their own."""
    return one.cost(other_detection) + other.cost(detection) < one.cost(detection) + other.cost(other_detection)


def _exchanged(target: _Track, in_box: _Detection, other: _Track) -> bool:
    """Whether another track has gone over to the target, and the box to that track's person, by their identities."""
    if other.detection is None or not other.apart or _overlap(other.detection.place, in_box.place, SAME):
        return False
    gain = (other.detection.identity - in_box.identity) @ (target.identity - other.identity)
    return float(gain) > EXCHANGED


def _hidden(one: Place, target: Place) -> bool:
    """Whether a person is behind the target and mostly hidden by it."""
    areas = boxes.area(one.box), boxes.area(target.box)
    overlap = boxes.iou(one.box, target.box)
    return one.size[1] < BEHIND * target.size[1] and overlap / (1.0 + overlap) * sum(areas) > HIDDEN * areas[0]


def _overlap(one: Place, other: Place, least: float) -> bool:
    return boxes.iou(one.box, other.box) >= least
