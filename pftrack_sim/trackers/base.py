"""Base class of the built-in trackers, and the checks of every tracker's input and output."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal, Protocol, TypeAlias, cast, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.core import boxes
from pftrack_sim.core.boxes import Box
from pftrack_sim.core.errors import BoxError, ImageError, TrackerError
from pftrack_sim.core.records import Detections, Estimate, Image, TrackedBoxes

if TYPE_CHECKING:
    from pftrack_sim.trackers.recognition.memory import TargetMemory

Recognition: TypeAlias = Literal["none", "judge", "search"]
PRESETS = ("default", "paper")  # `paper`: the printed values only; `default`: the best values found since


@runtime_checkable
class NeedsTruth(Protocol):
    """A tracker that receives the ground truth of each frame, before `init` and before every `update`.

    It exists for references such as `oracle`: the tracker runner calls this method where a tracker has it. A tracker
    without it never gets the truth.
    """

    def receive_truth(self, box: Box, visible_fraction: float) -> None:
        """Receive the target's truth in the next frame.

        Args:
            box: `(4,)` true box [px]; NaN or without area if the target is not in view.
            visible_fraction: Share of its pixels in the image that are visible, in [0, 1]; of a recorded sequence 1
                where it has a box.
        """
        ...


@runtime_checkable
class NeedsDetections(Protocol):
    """A tracker that receives the detections of each frame, before `init` and before every `update`.

    Attributes:
        tracks: Everybody whom it follows in the last image, for the scores of multi-object tracking; None: not known.
    """

    tracks: TrackedBoxes | None

    def receive_detections(self, detections: Detections) -> None:
        """Receive the people that a detector found in the next frame."""
        ...


class BaseTracker(ABC):
    """A tracker that checks its input before the method gets it.

    Subclasses implement `_start`, which must reset all state, and `_follow`. Both get a contiguous `(H, W, 3)` uint8
    image, which they must not modify.

    Args:
        recognition: What a memory of the target does, see `TargetMemory`: nothing; it judges the estimates, whose
            confidence is then the memory's; or it also has the method start again where it finds a lost target.
    """

    def __init__(self, recognition: Recognition = "none") -> None:
        self._shape: tuple[int, ...] | None = None
        self._recognition: Recognition = recognition
        self._memory: TargetMemory | None = None

    def init(self, image: Image, box: ArrayLike) -> None:
        """Start on an image and reset all state. After an error the tracker is unchanged.

        The box may lie partly, but not wholly, outside the image.

        Raises:
            ImageError: The image is not `(H, W, 3)` uint8.
            BoxError: The box is NaN, has no area, or lies wholly outside the image.
        """
        pixels = checked_image(image)
        start = _checked_first_box(box, pixels)
        self._start(pixels, start)
        if self._recognition != "none":
            # Imported where it is needed: it loads OpenCV.
            from pftrack_sim.trackers.recognition.memory import TargetMemory

            self._memory = TargetMemory(pixels, start, searches=self._recognition == "search")
        self._shape = pixels.shape

    def update(self, image: Image) -> Estimate:
        """Estimate the target's box in the next image.

        Raises:
            TrackerError: `init` was not called.
            ImageError: The image is not `(H, W, 3)` uint8, or its size is not that given to `init`.
        """
        if self._shape is None:
            raise TrackerError("update was called before init: a tracker must be given the first box")
        pixels = checked_image(image)
        if pixels.shape != self._shape:
            before, now = (f"{shape[1]}x{shape[0]}" for shape in (self._shape, pixels.shape))
            raise ImageError(f"the image changed its size within a sequence: from {before} to {now} (width x height)")
        estimate = self._follow(pixels)
        if self._memory is None:
            return estimate
        judged = self._memory.judge(pixels, estimate.box)
        if judged.elsewhere and judged.box is not None:
            self._start(pixels, judged.box)
            return Estimate(judged.box, judged.confidence, judged.occluded)
        if judged.box is not None and self._moves_to(judged.box):
            return Estimate(judged.box, judged.confidence, judged.occluded, estimate.particles)
        return Estimate(estimate.box, judged.confidence, estimate.occluded or judged.occluded, estimate.particles)

    @abstractmethod
    def _start(self, image: Image, box: Box) -> None: ...

    @abstractmethod
    def _follow(self, image: Image) -> Estimate: ...

    def _moves_to(self, box: Box) -> bool:
        """Move the state to a `(4,)` box near the estimate, and say whether that is done: not by every method."""
        return False


def checked_image(image: object) -> Image:
    """A contiguous `(H, W, 3)` uint8 image with pixels; anything else raises `ImageError`."""
    if not isinstance(image, np.ndarray):
        raise ImageError(f"an image must be a numpy array (H, W, 3) uint8 RGB, got {type(image).__name__}")
    pixels = cast("np.ndarray[Any, np.dtype[Any]]", image)
    if pixels.ndim != 3 or pixels.shape[2] != 3 or 0 in pixels.shape:
        raise ImageError(f"an image must have shape (H, W, 3) in RGB, with H and W >= 1, got {pixels.shape}")
    if pixels.dtype != np.uint8:
        raise ImageError(f"an image must be uint8, 0..255, got {pixels.dtype}")
    return np.ascontiguousarray(pixels)


def _checked_first_box(box: ArrayLike, image: Image) -> Box:
    first = boxes.checked(box, what="first box")
    height_px, width_px = image.shape[:2]
    if boxes.area(first) == 0.0:
        raise BoxError(f"first box must have a width and height > 0, got {first.tolist()}")
    if boxes.area(boxes.clip(first, width_px, height_px)) == 0.0:
        raise BoxError(f"first box {first.tolist()} lies wholly outside the {width_px}x{height_px} image")
    return first


def as_estimate(output: object) -> Estimate:
    """What a tracker's `update` returned as a plain `Estimate`; an array, list or tuple of four numbers is a box.

    Raises:
        TrackerError: The output is neither.
        BoxError: The box is invalid.
        ParameterError: The confidence is not in [0, 1].
    """
    listed = isinstance(output, list | tuple) and len(cast("Sequence[Any]", output)) == 4
    if listed or (isinstance(output, np.ndarray) and output.size == 4):
        return Estimate(cast("Box", output))  # which checks it
    if not isinstance(output, Estimate):
        kind = type(cast("object", output)).__name__
        shape = f" of shape {np.shape(cast('ArrayLike', output))}" if isinstance(output, np.ndarray) else ""
        raise TrackerError(f"update must return an Estimate, or four numbers x, y, w, h, got {kind}{shape}")
    # Rebuilt, so that a subclass cannot change its values after this check.
    return Estimate(output.box, float(output.confidence), bool(output.occluded), output.particles)


def check_unmodified(given: Image, original: Image) -> None:
    """Raise TrackerError when a tracker modified the image it got."""
    if not np.array_equal(given, original):
        raise TrackerError("it wrote into the image it was given")
