"""People beside a target, followed with it, so that who walks in front of it is not taken for it.

People who are dressed alike still differ in where they are and how large. All are predicted, and who is seen in a box
is the one to whose prediction it is nearest: d^2 + ln |S|, with the distance d in standard deviations and their
covariance S, which grows while somebody is not seen (Blackman and Popoli 1999, "Design and analysis of modern tracking
systems", section 6.4).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core import boxes
from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.recognition.person import UNSURE, KnownPerson, PersonView, look_at_all
from pftrack_sim.trackers.recognition.pyramid import ImagePyramid
from pftrack_sim.trackers.recognition.search import APART, Place, Reach, likeness_at, moved, person_at

EVERY, ROW, STEP = 4, 1.6, 0.4
"""Frames from one look for new people to the next, half the length of the row of points from which they are looked for,
and the points' distance, in the target's heights."""
SHIFT, GROWTH, WIDENING = 0.25, 0.12, 0.2
"""Standard deviations of a prediction for the next frame, in heights of the box and of the logarithm of its height, and
the share by which both are larger for each frame without a sight."""
UNLIKE = 0.1  # Standard deviation of one minus the product of the identities of two views of a person
CONTINUES = 4.0  # Squared distance from its prediction up to which a person in the box may be the target of before
GATE = 16.0  # Squared distance from a prediction beyond which a person is another
SAME, OTHER = 0.5, 0.3  # Overlap from which two boxes are of one person, and up to which they are of two
LEAST_SIZE = 0.6  # In the target's heights: who is farther away does not cover it
MOST, UNSEEN = 3, 15  # People who are followed, and frames without a sight after which one is given up
FAR = 2.5  # Distance from the target beyond which nobody is followed, in its heights
SMOOTHING = 0.5  # Share of the velocity that is kept
BEHIND, LEAVES = 0.4, 150
"""Confidence that a target which has just been hidden by somebody goes with them, and the frames in which it falls to
1/e."""
CLOSER = 0.9  # Share of its distance beside them that it keeps in a frame: else it would be seen
LEARNT = 0.1  # Weight of a new view in an identity


class _Sight(NamedTuple):
    place: Place
    identity: NDArray[np.float32]


@dataclass
class _Person:
    place: Place  # As predicted, until the frame is settled
    identity: NDArray[np.float32]  # Unit vector
    unseen: float = 0
    velocity: FloatArray = field(default_factory=lambda: np.zeros(2))  # Against the camera's motion [px per frame]
    seen: _Sight | None = None

    def distance(self, sight: _Sight) -> float:
        """Squared distance of a sight from what is predicted, in standard deviations."""
        wider = 1.0 + WIDENING * self.unseen
        unlike = (1.0 - float(sight.identity @ self.identity)) / UNLIKE
        return self.off(sight) / (wider * wider) + unlike * unlike

    def off(self, sight: _Sight) -> float:
        """The same of place and size alone, as if the last frame had been a sight."""
        growth = math.log(float(sight.place.size[1] / self.place.size[1])) / GROWTH
        shift = math.dist(sight.place.centre, self.place.centre) / (SHIFT * float(self.place.size[1]))
        return growth * growth + shift * shift

    def carry(self, place: Place) -> Place:
        """A predicted place, with a likeness of 0, that goes and grows with this person, who walks before it."""
        assert self.seen
        growth = float(self.seen.place.size[1] / self.place.size[1])
        beside = place.centre - (self.place.centre - self.velocity)
        return Place(0.0, growth * place.size, self.seen.place.centre + growth * beside * (CLOSER, 1.0))

    def cost(self, sight: _Sight) -> float:
        """Distance and ln |S| of the three dimensions that widen, but for a constant."""
        return self.distance(sight) + 6.0 * math.log(1.0 + WIDENING * self.unseen)


class Bystanders:
    """The people around a target. Each frame is a call of `look` and one of `settle`.

    Args:
        target: Whom they are not.
    """

    def __init__(self, target: KnownPerson) -> None:
        self._target = target
        self._people: list[_Person] = []
        self._frame = 0
        self.continues = True
        """Whether there is a person in the box about where the target was expected."""

    def look(self, pyramid: ImagePyramid, shift: FloatArray, place: Place, view: PersonView, target: Reach) -> Place:
        """Where the target is in the next image, in which its box is at a place with a view.

        Args:
            pyramid: The image.
            shift: `(2,)` the camera's since the last image [px].
            place: The box.
            view: What is seen in it.
            target: Where the target is predicted, after how many frames unseen.

        Returns:
            `place`; or, as somebody else is in the box, where the target is: with a likeness of 0 if it is hidden, and
            goes with who is before it.
        """
        self._pyramid = pyramid
        for one in self._people:
            one.place = one.place._replace(centre=one.place.centre + shift + one.velocity)
            seen = self._sight(one.place, looks=1)
            one.seen = seen if seen and one.distance(seen) < GATE else None
        off = self._target.off(view)
        here = _Sight(place if off is None else moved(place, off), view.identity)
        expected = _Person(Place(0.0, target.size, target.centre), self._target.identity, target.missed)
        self.continues = off is not None and expected.off(here) < CONTINUES
        before, sights = self._assigned(here, expected)
        if before is None:
            return place
        alike = [
            one.place._replace(likeness=likeness_at(self._target, pyramid, one.place.centre, one.place.size)[1])
            for one in sights
            if target.holds(one.place)
        ]
        best = max(alike, key=lambda one: one.likeness, default=None)
        return best if best and best.likeness >= UNSURE else before.carry(expected.place)

    def hold(self, place: Place) -> bool:
        """Whether one of them was seen at a place."""
        return any(one.seen is not None and _overlap(one.seen.place, place, SAME) for one in self._people)

    def settle(self, target: Place, *, sure: bool) -> None:
        """Take over who was seen, and, if the target is surely at a place, follow who else is beside it."""
        kept: list[_Person] = []
        for one in self._people:
            one.unseen = one.unseen + 1 if one.seen is None else 0
            if one.seen is not None:
                one.velocity = one.velocity + (1.0 - SMOOTHING) * (one.seen.place.centre - one.place.centre)
                one.place = one.seen.place
                mean = one.identity + np.float32(LEARNT) * (one.seen.identity - one.identity)
                one.identity = np.asarray(mean / np.linalg.norm(mean), dtype=np.float32)
            near = math.dist(one.place.centre, target.centre) < FAR * float(target.size[1])
            if near and one.unseen <= UNSEEN and not any(_overlap(one.place, other.place, SAME) for other in kept):
                kept.append(one)
        self._people = kept
        self._frame += 1
        if sure and self._frame % EVERY == 0:
            for sight in self._beside(target):
                others = [target, *(one.place for one in self._people)]
                apart = not any(_overlap(sight.place, other, OTHER) for other in others)
                if apart and len(self._people) < MOST and sight.place.size[1] > LEAST_SIZE * target.size[1]:
                    self._people.append(_Person(*sight))

    def _assigned(self, here: _Sight, target: _Person) -> tuple[_Person | None, list[_Sight]]:
        """Who of them is seen here, if anybody, and then where the target can be."""
        for one in self._people:
            if one.seen is None:
                continue
            if not _overlap(one.seen.place, here.place, SAME):
                if _swapped(target, here, one, one.seen):
                    one.seen, here = here, one.seen
                    return one, [here]
            elif target.cost(here) <= one.cost(one.seen):
                one.seen = None  # behind the target
            else:
                others = self._beside(target.place)
                for other in others:
                    if _swapped(target, other, one, here):
                        one.seen = other
                        return None, []
                return one, others
        return None, []

    def _beside(self, target: Place) -> list[_Sight]:
        """People in a row at both sides of a place, and in it, who are none of these."""
        height = float(target.size[1])
        right = np.arange(-ROW, ROW + 1e-6, STEP) * height
        points = target.centre + np.stack([right, np.zeros_like(right)], axis=1)
        near: list[Place] = []
        for point, view in zip(points, look_at_all(self._pyramid, points, height), strict=True):
            if (off := self._target.off(view)) is not None:
                near.append(moved(Place(view.person * view.visible, target.size, point), off))
        found: list[_Sight] = []
        for one in sorted(near, key=lambda one: -one.likeness):
            if all(math.dist(one.centre, other.place.centre) > APART * float(one.size[1]) for other in found):
                sight = self._sight(one)
                if sight and not self.hold(sight.place):
                    found.append(sight)
        return found

    def _sight(self, place: Place, looks: int = 2) -> _Sight | None:
        seen = person_at(self._target, self._pyramid, place, looks)
        return None if seen is None else _Sight(seen[0], seen[1].identity)


def behind(frames: int) -> float:
    """Confidence that a target is still behind who walked before it, after so many frames."""
    return BEHIND * math.exp(-frames / LEAVES)


def _swapped(one: _Person, seen: _Sight, other: _Person, other_seen: _Sight) -> bool:
    """Whether of two people who are seen each is rather where the other one seems to be."""
    return one.cost(other_seen) + other.cost(seen) < one.cost(seen) + other.cost(other_seen)


def _overlap(one: Place, other: Place, least: float) -> bool:
    return boxes.iou(one.box, other.box) >= least
