"""Sequences of images with boxes of one target, the annotations that are written, and what a layout does with both."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.boxes import NO_BOX
from pftrack_sim.core.errors import SequenceError
from pftrack_sim.core.records import Detections, Image, frozen_array
from pftrack_sim.core.types import FloatArray
from pftrack_sim.formats.images import Images

TARGET = 1
"""Identity of the target among people."""


@dataclass(frozen=True, eq=False)
class RecordedSequence:
    """Images with one true box each, from the first image that has a box on.

    Attributes:
        name: Name of the folder.
        images: All images; the first `start` are left out.
        truth: `(N, 4)` boxes x, y, w, h [px], read-only; NaN rows where the target is absent.
        rate_hz: Frames per second; None where the layout does not tell.
        start: Number of images before the first one with a box.
        detections: For each image what a detector found in it; None where the sequence has no file of it.
    """

    name: str
    images: Images
    truth: FloatArray
    rate_hz: float | None = None
    start: int = 0
    detections: tuple[Detections, ...] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "truth", frozen_array(self.truth, (len(self.images) - self.start, 4)))

    @classmethod
    def checked(
        cls,
        folder: Path,
        boxes_in: str,
        images: Images,
        truth: FloatArray,
        rate_hz: float | None = None,
        detections: tuple[Detections, ...] | None = None,
    ) -> RecordedSequence:
        """A sequence from its first frame with a box on; `boxes_in` is the file of the boxes within the folder.

        Raises:
            SequenceError: The numbers of images and boxes differ, or no frame has a box.
        """
        if len(images) != len(truth):
            raise SequenceError(f"{folder}: {len(images)} images but {len(truth)} boxes in {boxes_in}")
        known = np.flatnonzero(np.isfinite(truth).all(axis=1))
        if known.size == 0:
            raise SequenceError(f"{folder / boxes_in}: no frame has a box")
        first = int(known[0])
        found = None if detections is None else detections[first:]
        return cls(folder.resolve().name, images, truth[first:], rate_hz, first, found)

    def __len__(self) -> int:
        return len(self.truth)

    def image(self, index: int) -> Image:
        """`(H, W, 3)` uint8 RGB image of a frame from 0 to N - 1.

        Raises:
            IndexError: There is no such frame.
            SequenceError: The file cannot be read as an image.
        """
        if not 0 <= index < len(self):
            raise IndexError(f"{self.name} has frames 0 to {len(self) - 1}, got {index}")
        return self.images.read(self.start + index)

    def where(self, index: int) -> str:
        """File of a frame's image, for messages."""
        return self.images.where(self.start + index)


@dataclass(frozen=True)
class PersonBox:
    """One person in one frame.

    Attributes:
        identity: The same number for the same person throughout the sequence; `TARGET` is the target.
        box: x, y, w, h [px], clipped to the image.
        visible_fraction: Visible share of the person's pixels inside the image.
        truncation: Share of the whole box outside the image.
        visible_box: x, y, w, h [px] around the visible pixels; empty where there are none.
        mask: Run-length code of the visible pixels, column by column: numbers of pixels off and on by turns. Only for
            formats that need it.
        solid: Height, width, length of the 3D box [m], the middle of its lower face in the camera's frame [m], and its
            turn about the camera's y axis [rad]. Only for formats that need it.
    """

    identity: int
    box: tuple[float, ...]
    visible_fraction: float
    truncation: float = 0.0
    visible_box: tuple[float, ...] = ()
    mask: tuple[int, ...] = ()
    solid: tuple[float, ...] | None = None


@dataclass(frozen=True, eq=False)
class Annotations:
    """What is known of a sequence besides its images.

    Attributes:
        image_size_px: Width and height.
        people: Of each of `N` frames everybody in view.
        number: Place of the sequence in its data set, from 0.
        focal_and_centre_px: fx, fy, cx, cy of the camera.
        tags: `(N,)` for each attribute whether a frame has it: `"motion_change"`.
        detections: For each frame what a detector found in it; empty where they are not written.
    """

    name: str
    rate_hz: float
    image_size_px: tuple[int, int]
    people: tuple[tuple[PersonBox, ...], ...]
    number: int = 0
    focal_and_centre_px: tuple[float, float, float, float] = (1.0, 1.0, 0.0, 0.0)
    tags: Mapping[str, NDArray[np.bool_]] = field(default_factory=dict[str, NDArray[np.bool_]])
    detections: tuple[Detections, ...] = ()

    def __len__(self) -> int:
        return len(self.people)

    @property
    def target(self) -> list[PersonBox | None]:
        """The target in each frame; None where it is out of view."""
        return [next((one for one in people if one.identity == TARGET), None) for people in self.people]

    @property
    def visible_fraction(self) -> FloatArray:
        """`(N,)` visible share of the target's pixels inside the image; 0 where there are none."""
        return np.array([0.0 if one is None else one.visible_fraction for one in self.target])

    @property
    def boxes(self) -> FloatArray:
        """`(N, 4)` boxes of the target, clipped to the image; NaN rows where it cannot be seen."""
        return np.array([one.box if one is not None and one.visible_fraction > 0.0 else NO_BOX for one in self.target])


class Layout(ABC):
    """How a data set lays out its sequences."""

    title: str
    """The data set."""
    expects: str
    """Files of a sequence, for messages."""
    image: str
    """Path of an image within the folder of its sequence without its suffix, formatted with its number."""
    first = 1
    """Number of the first image."""
    sequences = "."
    """Folder of the sequences within the data set."""
    needs: frozenset[str] = frozenset()
    """`"masks"` and `"solids"`: what of `PersonBox` it writes besides boxes."""
    packed = False
    """Whether a sequence is a shard: an archive with a text for each image."""
    jpeg = False
    """Whether its readers look for `*.jpg`."""
    video = False
    """Whether a video may stand for the images: no public tool that reads the layout opens or counts them."""

    @abstractmethod
    def matches(self, folder: Path) -> bool:
        """Whether a folder has this layout."""

    @abstractmethod
    def read(self, folder: Path) -> RecordedSequence:
        """Read the sequence in a folder.

        Raises:
            SequenceError: Images or boxes are missing, damaged, or differ in number.
        """

    @abstractmethod
    def write(self, folder: Path, annotations: Annotations) -> None:
        """Write the annotations of a sequence into the folder that holds its images."""

    def index(self, root: Path, names: Sequence[str]) -> Iterator[tuple[str, Iterator[str]]]:
        """Files of the data set in `root` besides its sequences of these names, in pieces, by their path."""
        yield from ()
