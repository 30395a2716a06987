"""What a small network says of a box: where in it a person is, how much of the person can be seen, and who it is.

The network was trained on people that the simulator draws, whose boxes, identities and covers are known exactly
(`examples/train_person.py`): 190,000 parameters, evaluated by OpenCV.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.data_files import assets_dir
from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.recognition.parts import FIRST_LIKENESS, RATE, Histograms, PartColours, describe
from pftrack_sim.trackers.recognition.pyramid import ImagePyramid

NETWORK = "person.onnx"  # Among the assets
ROWS, COLUMNS = 80, 40  # Of a patch
REACH = 1.5  # Height of a patch, in heights of the box

IS_PERSON = 0.5  # Least probability of a person
PART = 0.4  # Least visible share of a person whose place and size are measured
FILLS = (0.2, 0.35)
"""A person whose first box is off by more, in shift and growth, is not what was selected."""
WIDEST = 0.55  # Width over height of a first box: a wider one holds something else, or only a face
FITS = (0.04, 0.1)
"""A first box that is off by less, in shift and growth, fits: a single view says no more of how it was drawn."""
SLACK = (0.04, 0.05)
"""Nothing is corrected up to this shift and growth, by which views of a person vary."""

SLOPE = 1.08
"""Of the likeness over the vectors' product: a product of 0.88 of the usual one is as alike as colours of 0.87."""
STRETCH = 1.45
"""Of the mean of both likenesses, so that 0.87 lies between the target's views and those of other people."""
UNSURE, SURE = 0.87, 0.95
"""Likeness below which a box does not hold the target, and from which on it does; between the two the target is learnt
more slowly."""
UNLIKE = 0.7
"""Likeness at which the confidence is 0."""
RECENT, CONTINUOUS = 0.07, 0.93
"""Weight of a new view in the short-term mean of the identity, and its least product with that mean if it is a view of
the same person."""
FADE = 0.0012  # Most that the likeness of a person who is followed without a break falls in a frame
CLOSE_UP = 0.85  # Height of a box, as a share of the image's, from which on another person hardly fits in between
OTHERS, NEW = 32, 0.96
"""Most people besides the target who are remembered, and the product with its identity from which on one of them is
rather the target."""
PROBABLY, SURELY = 0.02, 0.05
"""By how much a view is more like somebody else than like the target if it is probably, or surely, of somebody else."""
COVERED = 0.79
"""Likeness of a person of whom nothing is seen, from which it grows with the visible share."""


class PersonView(NamedTuple):
    """What is seen in a box.

    Attributes:
        shift: `(2,)` of the person's centre from the box's, right and down, in heights of the box.
        growth: Logarithm of the person's height over the box's.
        visible: Share of the person that can be seen, in [0, 1].
        person: Probability that the box holds a person.
        identity: `(32,)` unit vector; the product of two is near 1 for views of one person.
        parts: Colours of the parts of the box; None where they were not asked for.
    """

    shift: FloatArray
    growth: float
    visible: float
    person: float
    identity: NDArray[np.float32]
    parts: Histograms | None = None


def look(pyramid: ImagePyramid, centre: FloatArray, size: FloatArray) -> PersonView:
    """Look at a box of `(2,)` width and height [px] around `(2,)` x, y; its width is not used."""
    return look_at_all(pyramid, centre[None], float(size[1]))[0]


def look_at_all(pyramid: ImagePyramid, centres: FloatArray, height_px: float) -> list[PersonView]:
    """Look at boxes of one height [px] around `(N, 2)` x, y."""
    if not len(centres):
        return []
    side, first = REACH * height_px, (ROWS - COLUMNS) // 2
    squares = np.stack([pyramid.patch(centre, side, ROWS) for centre in centres])
    patches = squares[:, :, first : first + COLUMNS].transpose(0, 3, 1, 2).astype(np.float32) / np.float32(255)
    network = _network()
    network.setInput(np.ascontiguousarray(patches))
    vectors, numbers = network.forward(["embedding", "box"])
    views: list[PersonView] = []
    for vector, (right, down, growth, _, visible, person) in zip(vectors, numbers.tolist(), strict=True):
        identity = np.asarray(vector / np.linalg.norm(vector), dtype=np.float32)
        views.append(PersonView(np.array([right, down]), growth, _share(visible), _share(person), identity))
    return views


class KnownPerson:
    """Running means of a person's identity and colours, and of the likeness that views usually have with them.

    How well each and both tell a target from other people: docs/pftrack.md.
    """

    def __init__(self, first: PersonView) -> None:
        assert first.parts is not None
        self._first, self._offset = first, _beyond(FITS, first.shift, first.growth)
        self._mean, self._parts = first.identity.copy(), PartColours(first.parts)
        self._usual, self._count = FIRST_LIKENESS, 1
        self._recent, self._carried = first.identity.copy(), SURE
        self._others = np.empty((0, len(first.identity)), np.float32)

    @classmethod
    def found(cls, pyramid: ImagePyramid, centre: FloatArray, size: FloatArray) -> KnownPerson | None:
        """The person in a box; None where there is none, or none who fills it as people fill their boxes."""
        view = cls.describe(pyramid, centre, size)
        shift, growth = FILLS
        fills = abs(view.growth) < growth and float(np.abs(view.shift).max()) < shift
        fills = fills and float(size[0]) < WIDEST * float(size[1])
        return cls(view) if fills and view.person > IS_PERSON and view.visible > PART else None

    @staticmethod
    def describe(pyramid: ImagePyramid, centre: FloatArray, size: FloatArray) -> PersonView:
        """What is seen in a box of `(2,)` width and height [px] around `(2,)` x, y."""
        return look(pyramid, centre, size)._replace(parts=describe(pyramid, centre, size))

    @property
    def identity(self) -> NDArray[np.float32]:
        """`(32,)` mean of the person's identity, a unit vector."""
        return np.asarray(self._mean / np.linalg.norm(self._mean), dtype=np.float32)

    def meet(self, identity: NDArray[np.float32]) -> None:
        """Remember the `(32,)` identity of somebody else, who may be taken for the person later."""
        if float(identity @ self.identity) < NEW:
            self._others = np.concatenate([self._others, identity[None]])[-OTHERS:]

    def is_other(self, found: PersonView, margin: float) -> bool:
        """Whether a view is more like somebody else who was met than like the person, by a margin."""
        return float((self._others @ found.identity).max(initial=-1.0)) > float(found.identity @ self.identity) + margin

    def likeness(self, found: PersonView) -> float:
        """Likeness with the person, on the scale of `PartColours.likeness`; of others who were met at most `UNLIKE`."""
        identity, colours = self.alike(found)
        seen = found.visible / self._first.visible
        most = COVERED + 1.25 * (1.0 - COVERED) * seen
        if self.is_other(found, SURELY):
            most = min(most, UNLIKE)
        return min(1.0 - STRETCH * (1.0 - 0.5 * (identity + colours)), most)

    def follow(self, found: PersonView, likeness: float, *, close_up: bool = False) -> float:
        """The likeness of the followed box in the next frame; `likeness` is that of its view with the long-term means.

        A person who turns or walks into shade becomes unlike the long-term means gradually; a change to another person
        is sudden. From `SURE` on, the likeness therefore falls by `FADE` a frame at most, as long as the identity stays
        close to its short-term mean (short- and long-term memory: Ye et al. 2023, arXiv:2309.11727). It does not fall
        in a `close_up`: the image truncates the person or shows them from above, rare in what the network learnt from.
        """
        close = float(found.identity @ self._recent) >= CONTINUOUS * float(np.linalg.norm(self._recent))
        continuous = likeness > UNLIKE and (close_up or (close and not self.is_covered(found)))
        self._recent += np.float32(RECENT) * (found.identity - self._recent)
        if likeness >= SURE:
            self._carried = SURE
        else:
            self._carried = self._carried - (0.0 if close_up else FADE) if continuous else 0.0
        return max(likeness, self._carried)

    def learn(self, found: PersonView, trust: float) -> None:
        """Learn a view of the person with weight `trust` in [0, 1]."""
        identity, _ = self.alike(found)
        self._count += 1
        rate = max(1.0 / self._count, RATE) * trust  # a mean of the first frames, then a slow one
        self._mean += np.float32(rate) * (found.identity - self._mean)
        self._usual *= 1.0 + rate * (identity - 1.0) / SLOPE
        assert found.parts is not None
        self._parts.learn(found.parts, trust)

    def alike(self, found: PersonView) -> tuple[float, float]:
        """Likeness of identity and of colours, each as a share of what is usual."""
        assert found.parts is not None
        product = float(found.identity @ self._mean) / float(np.linalg.norm(self._mean)) / self._usual
        return 1.0 - SLOPE * (1.0 - product), self._parts.likeness(found.parts)

    def is_covered(self, found: PersonView) -> bool:
        """Whether most of the person is hidden; one who is lit or turned otherwise is only less alike."""
        return found.person < IS_PERSON or found.visible < PART * self._first.visible

    def correction(self, found: PersonView) -> tuple[FloatArray, float] | None:
        """By how much the person is off the box, `(2,)` in its heights, and the logarithm of the person's growth in it.

        Both are against the first box where it does not fit as those of the training do (`FITS`); None where too little
        of a person is seen.
        """
        off = self.off(found)
        if off is None:
            return None
        return _beyond(SLACK, *off)

    def off(self, found: PersonView) -> tuple[FloatArray, float] | None:
        """The same without the slack that views have."""
        if found.person < IS_PERSON or found.visible < PART:
            return None
        shift, growth = self._offset
        return found.shift - shift, found.growth - growth


def _beyond(slack: tuple[float, float], shift: FloatArray, growth: float) -> tuple[FloatArray, float]:
    most, grown = slack
    return shift - np.clip(shift, -most, most), growth - min(max(growth, -grown), grown)


@cache
def _network() -> Any:
    return cv2.dnn.readNetFromONNX(str(assets_dir() / NETWORK))


def _share(logit: float) -> float:
    return 1.0 / (1.0 + math.exp(-min(max(logit, -50.0), 50.0)))
