"""Search of the whole image for a target, by its colours and its looks."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import cv2
import numpy as np

from pftrack_sim.core.boxes import Box
from pftrack_sim.core.records import Image
from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.recognition.colour import ColourModel
from pftrack_sim.trackers.recognition.parts import PartColours
from pftrack_sim.trackers.recognition.person import PROBABLY, SURE, UNSURE, KnownPerson, PersonView, look, look_at_all
from pftrack_sim.trackers.recognition.pyramid import ImagePyramid

Looks = KnownPerson | PartColours

SEARCH_AFTER, SEARCH_INTERVAL = 6, 3
"""Frames in doubt until the whole image is searched, and from one search to the next."""
PERSON_AFTER = 15
"""The same for a box that holds a person who is hardly covered: more likely the target, turned or lit otherwise."""
SURE_FRAMES, ALIKE_FRAMES = 5, 15
"""Frames in which the target is sure, or not unlike, that end a doubt."""
FOUND, GAIN = 0.9, 0.04
"""Least likeness of a place that is taken, and by how much it is more alike than the estimate."""
COMPARED = 3  # Places of a search that are looked at closely
SETTLED = 0.3
"""Share of a person's distance from the box, and of the difference in size, that is made good in a frame."""

SCALES = (0.65, 0.8, 1.0, 1.25, 1.55)
"""Sizes at which a lost target is searched, as shares of that at which it was last sure ..."""
ZOOMS, ZOOMS_AFTER = (1.0, 0.42, 1.0, 2.4), 8
"""... times one of these in each search after so many: what passed the camera comes back smaller or larger. The ranges
touch; colours alone find much at other sizes that is not the target."""
LEAST_PX, MOST = 8.0, 1.5  # Heights that are searched, in pixels and as a share of the image's
PEOPLE_ZOOMS = ((1.0, 0.6, 1.6), (1.0, 0.38, 2.5))
"""Sizes of people that a search looks for, as shares of the target's last one: a view shows sizes up to a third off."""
GRID, POINTS = 0.4, 300
"""Distance of the points from which people are looked for, in their heights, and how many there are at most."""
PEOPLE, LOOKS, APART = 8, 2, 0.3
"""Most people who are looked at closely, how many times, and their least distance, in heights."""
REACH, REACH_RATE, GROWTH, GROWTH_RATE = 1.5, 0.1, 0.2, 0.02
"""Greatest distance at which a target is searched, in its heights, and greatest logarithm of the ratio of sizes: right
after it was lost, and what each further frame adds."""
WIDTH_PX, SEARCHED = 10.0, 3
"""Width of the target in the image that is searched by colour, and places taken at each size."""


class Reach(NamedTuple):
    """Where a lost target can be, and how large.

    Attributes:
        centre: `(2,)` its last centre [px].
        size: `(2,)` its last size [px].
        missed: Frames since then; infinite for a target that may be anywhere.
    """

    centre: FloatArray
    size: FloatArray
    missed: float

    @property
    def distance_px(self) -> float:
        """Greatest distance from the last centre."""
        return (REACH + REACH_RATE * self.missed) * float(self.size[1])

    def holds(self, place: Place) -> bool:
        """Whether a place is near enough, and about as large."""
        growth = abs(math.log(float(place.size[1] / self.size[1])))
        near = math.dist(place.centre, self.centre) <= self.distance_px
        return near and growth <= GROWTH + GROWTH_RATE * self.missed


class Place(NamedTuple):
    """A box of `(2,)` size [px] around a `(2,)` centre, and its likeness to the target."""

    likeness: float
    size: FloatArray
    centre: FloatArray

    @property
    def box(self) -> Box:
        """`(4,)` [px]."""
        return np.concatenate([self.centre - 0.5 * self.size, self.size])


class Doubt:
    """Whether it is in doubt that a tracker follows its target: from a frame in which it is unlike until it is sure.

    Its looks should not be learnt meanwhile: behind a cover the box may have gone over to what covered the target,
    which looks more and more usual if it is learnt.

    Args:
        unlike: Likeness below which a frame begins a doubt.
        sure: Likeness of a frame that helps to end it.
    """

    def __init__(self, unlike: float = UNSURE, sure: float = SURE) -> None:
        self._limits = unlike, sure
        self._frames = self._sure = self._alike = 0

    def __bool__(self) -> bool:
        return self._frames > 0

    def see(self, likeness: float) -> None:
        """Take the likeness of the next frame."""
        unlike, sure = self._limits
        if likeness < unlike:
            self._sure = self._alike = 0
        elif not self._frames:
            return
        else:
            self._alike += 1
            self._sure = self._sure + 1 if likeness >= sure else 0
        ended = self._sure >= SURE_FRAMES or self._alike >= ALIKE_FRAMES
        self._frames = 0 if ended else self._frames + 1

    def begin_again(self) -> None:
        """Doubt a place that was found as a target that has just become unlike."""
        self._frames = 1
        self._sure = self._alike = 0

    def search(self, after: int) -> int | None:
        """Number of the search that is due in this frame, if the first one is due after so many frames; or None."""
        waited = self._frames - after
        return waited // SEARCH_INTERVAL if waited >= 0 and waited % SEARCH_INTERVAL == 0 else None


def likeness_at(looks: Looks, pyramid: ImagePyramid, centre: FloatArray, size: FloatArray) -> tuple[Any, float]:
    """How a box looks, and its likeness to the target: `PersonView` of a person, else `Histograms`."""
    known: Any = looks  # Each describes what it compares.
    view = known.describe(pyramid, centre, size)
    return view, known.likeness(view)


def search(
    image: Image,
    pyramid: ImagePyramid,
    looks: Looks,
    colours: ColourModel,
    reach: Reach,
    attempt: int,
) -> list[Place]:
    """Places of people or, for other targets, with the target's colours, the most alike first.

    Their sizes are about its last one, at `PEOPLE_ZOOMS` or at `SCALES` of one of `ZOOMS`, which the number of the
    search since the target was last sure chooses. Their centres are within reach, of people their sizes as well.
    """
    if isinstance(looks, KnownPerson):
        return sorted(_people(image, pyramid, looks, reach, attempt), key=lambda one: -one.likeness)
    found: list[Place] = []
    zoom = ZOOMS[attempt % len(ZOOMS)] if attempt >= ZOOMS_AFTER else 1.0
    for wanted in (zoom * scale * reach.size for scale in SCALES):
        if not LEAST_PX < wanted[1] < MOST * image.shape[0]:
            continue
        for centre in _colour_peaks(image, colours, wanted):
            if math.dist(centre, reach.centre) <= reach.distance_px:
                found.append(Place(likeness_at(looks, pyramid, centre, wanted)[1], wanted, centre))
    return sorted(found, key=lambda one: -one.likeness)


def _people(image: Image, pyramid: ImagePyramid, known: KnownPerson, reach: Reach, attempt: int) -> list[Place]:
    """People whom the network sees from the points of a grid, each looked at again where it says that they are."""
    found: list[Place] = []
    for zoom in PEOPLE_ZOOMS[attempt % len(PEOPLE_ZOOMS)]:
        wanted = zoom * reach.size
        height = float(wanted[1])
        if not LEAST_PX < height < MOST * image.shape[0]:
            continue
        step = max(GRID * height, math.sqrt(image.shape[0] * image.shape[1] / POINTS))
        across, down = (np.arange(0.5 * step, side, step) for side in image.shape[1::-1])
        grid = np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)
        grid = grid[np.hypot(*(grid - reach.centre).T) <= reach.distance_px]
        for centre, view in zip(grid, look_at_all(pyramid, grid, height), strict=True):
            if (off := known.off(view)) is not None:
                found.append(moved(Place(view.person * view.visible, wanted, centre), off))
    places: list[Place] = []
    for place in sorted(found, key=lambda one: -one.likeness):
        apart = APART * float(place.size[1])
        if len(places) < PEOPLE and all(math.dist(place.centre, one.centre) > apart for one in places):
            place, _ = person_at(known, pyramid, place) or (place, None)
            if reach.holds(place):
                seen, likeness = likeness_at(known, pyramid, place.centre, place.size)
                if not known.is_other(seen, PROBABLY):
                    places.append(place._replace(likeness=likeness))
    return places


def person_at(
    known: KnownPerson, pyramid: ImagePyramid, place: Place, looks: int = LOOKS
) -> tuple[Place, PersonView] | None:
    """The place of the person who is seen from a place, looked at so many times, and the last view; or None."""
    view: PersonView | None = None
    for _ in range(looks):
        view = look(pyramid, place.centre, place.size)
        off = known.off(view)
        if off is None:
            return None
        place = moved(place, off)
    return None if view is None else (place, view)


def moved(place: Place, off: tuple[FloatArray, float], share: float = 1.0) -> Place:
    """A place moved by a share of a person's shift and growth, see `KnownPerson.off`."""
    shift, growth = off
    return place._replace(
        size=place.size * math.exp(share * growth), centre=place.centre + share * shift * place.size[1]
    )


def ramp(value: float, low: float, high: float) -> float:
    """0 up to `low`, 1 from `high` on, linear between the two."""
    return min(max((value - low) / max(high - low, 1e-6), 0.0), 1.0)


def _colour_peaks(image: Image, colours: ColourModel, size: FloatArray) -> list[FloatArray]:
    """Centres [px] of boxes of `(2,)` size with the most of the target's colours that do not overlap by half."""
    zoom = min(WIDTH_PX / float(size[0]), 1.0)
    shape = [max(round(zoom * side), 8) for side in image.shape[1::-1]]
    small = np.asarray(cv2.resize(image, shape, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    width, height = (float(side) * zoom for side in size)
    response = colours.respond(small, width, height)
    x_half, y_half = max(int(0.5 * width), 1), max(int(0.5 * height), 1)
    peaks: list[FloatArray] = []
    for _ in range(SEARCHED):
        row, column = divmod(int(response.argmax()), response.shape[1])
        peaks.append(np.array([column + 0.5, row + 0.5]) / zoom)
        response[max(row - y_half, 0) : row + y_half + 1, max(column - x_half, 0) : column + x_half + 1] = -1.0
    return peaks
