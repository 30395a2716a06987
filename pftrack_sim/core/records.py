"""Records exchanged between the rooms: truth, estimates, frames. Frozen, with read-only arrays."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any, Literal, Protocol, Self, TypeAlias, cast, overload, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.core.boxes import Box, checked, numbers_in
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.text import one_line
from pftrack_sim.core.types import read_only

Image: TypeAlias = NDArray[np.uint8]  # `(H, W, 3)` RGB

State: TypeAlias = Literal["visible", "occluded", "out_of_view"]


def frozen_array(values: ArrayLike, shape: tuple[int, ...] | None = None) -> NDArray[np.float64]:
    """A read-only float64 copy of numbers in any form that numpy reads; an array that is one already is not copied.

    Raises:
        ParameterError: The shape differs from the one required, if any.
    """
    if isinstance(values, np.ndarray):
        given = cast("NDArray[Any]", values)
        is_frozen = not given.flags.writeable and given.base is None
        if is_frozen and given.dtype == np.float64 and given.shape == shape:
            return given
    array = np.array(values, dtype=np.float64)
    if shape is not None and array.shape != shape:
        raise ParameterError(f"expected an array of shape {shape}, got {array.shape}")
    return read_only(array)


def _numbers(values: ArrayLike, what: str) -> NDArray[np.float64]:
    array = numbers_in(values)
    if array is None:
        raise ParameterError(f"{what} must be numbers, got {one_line(repr(values), 60)}")
    return array


class _ArrayRecord:
    """Equality and pickling of a dataclass with arrays, and records of which some fields are found when first read."""

    @classmethod
    def deferred(cls, find: Callable[[], Self], **known: Any) -> Self:
        """A record of which the `known` fields are read at once; `find`, called at most once, gives the whole one."""
        record = object.__new__(cls)
        record.__dict__.update(known, _find=find)
        return record

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """Find the fields that are not known yet; anything else is missing."""
            if "_find" not in self.__dict__ or name not in self.__dataclass_fields__:
                raise AttributeError(f"{type(self).__name__!r} has no attribute {name!r}")
            self.__dict__.update(vars(self._find()))
            del self.__dict__["_find"]
            return self.__dict__[name]

    def __eq__(self, other: object) -> bool:
        """Equality of all fields, NaN equal to NaN."""
        if type(other) is not type(self):
            return NotImplemented
        pairs = zip(self._values(), other._values(), strict=True)
        return all(
            np.array_equal(mine, theirs, equal_nan=isinstance(mine, (float, np.ndarray))) for mine, theirs in pairs
        )

    __hash__ = None  # pyright: ignore[reportAssignmentType]

    def __reduce__(self) -> tuple[type[Any], tuple[Any, ...]]:
        # Through the constructor, so that arrays are read-only on the other side of a process boundary too.
        return type(self), self._values()

    def _values(self) -> tuple[Any, ...]:
        return tuple(getattr(self, one.name) for one in fields(cast("Any", self)))


@dataclass(frozen=True, eq=False)
class Truth(_ArrayRecord):
    """Ground truth of one person in one frame.

    Boxes are `(4,)` x, y, w, h [px]; poses are `(4, 4)` and map the second frame of their name into the first
    (`T_world_camera` maps camera to world; camera axes as OpenCV: x right, y down, z forward).

    With lens distortion, exposure or rolling shutter, boxes describe each row at its own mid-exposure, through the
    lens; poses are those at mid-exposure of the middle row. `docs/truth.md` has the definition for each effect.

    Attributes:
        name: `"target"`, `"distractor-1"`, `"crosser-1"`.
        box: Amodal box clipped to the image: the overlap is scored on it. Zero area when out of view.
        amodal_box: Extent of the whole body as if nothing occluded it and the image had no border. NaN when no part
            of the body is in front of the camera.
        visible_box: Extent of the pixels that show the person. NaN when there are none.
        swept_box: Extent of the whole body over the whole exposure, as if nothing occluded it and the image had no
            border; the amodal box itself where the exposure is an instant. NaN as the amodal box.
        visible_fraction: Visible pixels over the amodal pixels inside the image, in [0, 1]; 0 when there are none.
        truncation: Share of the amodal box's area outside the image, in [0, 1].
        state: `"visible"`: at least one pixel shows; `"occluded"`: inside the image, but fully occluded;
            `"out_of_view"`: no amodal pixel inside the image.
        occluders: Names of the occluders, sorted by occluded pixels, largest first.
        distance_m: From the camera to the centre of the pelvis, or of a thing.
        T_world_camera: `(4, 4)` camera pose.
        T_world_target: `(4, 4)` pose of the person or thing: origin on the ground below that centre, x forward, z up.
        K: `(3, 3)` camera matrix [px].
        distortion: `(5,)` OpenCV's k1, k2, p1, p2, k3; `(8,)` with k4, k5, k6; `(4,)` those of `cv2.fisheye`.
        time_s: Simulated time of the frame since the start of the episode.
        image_motion_px: Displacement of the centre of the amodal box since the previous frame that was delivered;
            0 in the first frame, NaN when either box is NaN.
        luminance: Mean of the visible pixels' 8-bit red, green and blue with ITU-R BT.709 weights, in [0, 1]; NaN when
            none is visible or there is no image.
    """

    name: str
    box: Box
    amodal_box: Box
    visible_box: Box
    swept_box: Box
    visible_fraction: float
    truncation: float
    state: State
    occluders: tuple[str, ...]
    distance_m: float
    T_world_camera: NDArray[np.float64]
    T_world_target: NDArray[np.float64]
    K: NDArray[np.float64]
    distortion: NDArray[np.float64]
    time_s: float
    image_motion_px: float
    luminance: float

    def __post_init__(self) -> None:
        lens = len(self.distortion) if len(self.distortion) in (4, 8) else 5
        shapes = {
            "box": (4,),
            "amodal_box": (4,),
            "visible_box": (4,),
            "swept_box": (4,),
            "T_world_camera": (4, 4),
            "T_world_target": (4, 4),
            "K": (3, 3),
            "distortion": (lens,),
        }
        for key, shape in shapes.items():
            object.__setattr__(self, key, frozen_array(getattr(self, key), shape))

    @property
    def scored(self) -> bool:
        """Whether this frame is scored: at least one pixel of the person is visible (Ko et al. 2012, section 4)."""
        return self.state == "visible"


class DeferredPeople(Sequence[Truth]):
    """People in view, the target first; the others are found when any of them, or their number, is first asked for.

    It equals, and is pickled as, the tuple of all.

    Args:
        target: Truth of the target.
        find: Finds the truth of the others; called at most once.
    """

    def __init__(self, target: Truth, find: Callable[[], tuple[Truth, ...]]) -> None:
        self._target, self._find = target, find
        self._found: tuple[Truth, ...] | None = None

    @property
    def everybody(self) -> tuple[Truth, ...]:
        """The target and all others."""
        if self._found is None:
            self._found = (self._target, *self._find())
            del self._find  # With it go the poses of the frame.
        return self._found

    @overload
    def __getitem__(self, index: int) -> Truth: ...

    @overload
    def __getitem__(self, index: slice) -> tuple[Truth, ...]: ...

    def __getitem__(self, index: int | slice) -> Truth | tuple[Truth, ...]:
        """The target without finding anybody else; or others."""
        return self._target if index == 0 else self.everybody[index]

    def __len__(self) -> int:
        return len(self.everybody)

    def __eq__(self, other: object) -> bool:
        """Equality with any sequence of the same truth."""
        return self.everybody == (other.everybody if isinstance(other, DeferredPeople) else other)

    __hash__ = None  # pyright: ignore[reportAssignmentType]

    def __repr__(self) -> str:
        return repr(self.everybody)

    def __reduce__(self) -> tuple[type[Any], tuple[Any, ...]]:
        return tuple, (self.everybody,)


@dataclass(frozen=True, eq=False)
class Estimate:
    """Output of a tracker for one frame.

    Attributes:
        box: `(4,)` x, y, w, h [px].
        confidence: Confidence in [0, 1] that `box` contains the target.
        occluded: Whether the tracker considers the target occluded.
        particles: `(N, 4)` boxes [px] for drawing, or None.
    """

    box: Box
    confidence: float = 1.0
    occluded: bool = False
    particles: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "box", read_only(checked(self.box, what="estimated box")))
        if not 0.0 <= self.confidence <= 1.0:
            raise ParameterError(f"confidence must be in [0, 1], got {self.confidence}")
        if self.particles is not None:
            particles = _numbers(self.particles, "particles")
            if particles.ndim != 2 or particles.shape[1] != 4:
                raise ParameterError(f"particles must have shape (N, 4), got {particles.shape}")
            object.__setattr__(self, "particles", read_only(particles))


@dataclass(frozen=True, eq=False)
class Detections(_ArrayRecord):
    """People that a detector found in one image, without identities.

    Attributes:
        boxes: `(N, 4)` x, y, w, h [px].
        scores: `(N,)` confidences in [0, 1].
        age_s: Time since the image in which they were found; above 0 for a detector that takes time.
    """

    boxes: NDArray[np.float64]
    scores: NDArray[np.float64]
    age_s: float = 0.0

    def __post_init__(self) -> None:
        boxes, scores = (_numbers(values, "boxes and scores of detections") for values in (self.boxes, self.scores))
        if boxes.shape != (len(scores), 4) or scores.ndim != 1:
            raise ParameterError(
                f"detections need boxes (N, 4) and scores (N,), got shapes {boxes.shape} and {scores.shape}"
            )
        if not (np.isfinite(boxes).all() and (boxes[:, 2:] >= 0.0).all()):
            raise ParameterError("the boxes of detections must be finite, with a width and height >= 0")
        if not ((scores >= 0.0) & (scores <= 1.0)).all():
            raise ParameterError("the scores of detections must be in [0, 1]")
        object.__setattr__(self, "boxes", read_only(boxes))
        object.__setattr__(self, "scores", read_only(scores))

    def __len__(self) -> int:
        return len(self.scores)


@dataclass(frozen=True, eq=False)
class TrackedBoxes(_ArrayRecord):
    """Everybody whom a multi-object tracker follows, in one image.

    Attributes:
        boxes: `(N, 4)` x, y, w, h [px].
        identities: `(N,)` whole numbers, all different; a person keeps one.
    """

    boxes: NDArray[np.float64]
    identities: NDArray[np.int64]

    def __post_init__(self) -> None:
        boxes, given = _numbers(self.boxes, "boxes of tracks"), np.asarray(self.identities)
        if given.dtype.kind not in "iuf" or not np.isfinite(given).all() or (given != np.round(given)).any():
            raise ParameterError(f"identities of tracks must be whole numbers, got {one_line(repr(given), 60)}")
        identities = given.astype(np.int64)
        if boxes.shape != (len(identities), 4) or identities.ndim != 1:
            raise ParameterError(
                f"tracks need boxes (N, 4) and identities (N,), got shapes {boxes.shape} and {identities.shape}"
            )
        if not np.isfinite(boxes).all() or len(np.unique(identities)) < len(identities):
            raise ParameterError("tracks need finite boxes, and an identity of its own for each")
        object.__setattr__(self, "boxes", read_only(boxes))
        object.__setattr__(self, "identities", read_only(identities))

    def __len__(self) -> int:
        return len(self.identities)

    def box(self, identity: int | None) -> Box | None:
        """The box of an identity, or None."""
        places = [] if identity is None else np.flatnonzero(self.identities == identity).tolist()
        return self.boxes[places[0]] if places else None


@dataclass(frozen=True, eq=False)
class Frame:
    """One image with its ground truth.

    Attributes:
        index: 0 for the first frame of the episode.
        time_s: Simulated time since the start of the episode.
        image: `(H, W, 3)` uint8 RGB, read-only; black where the simulation draws no images.
        truth: The target.
        people: Persons in view, the target first; targets are listed also when out of view.
        cameras: The same instant as other cameras take it, by name.
    """

    index: int
    time_s: float
    image: Image
    truth: Truth
    people: Sequence[Truth]
    cameras: Mapping[str, Frame] = field(default_factory=dict["str", "Frame"])


@runtime_checkable
class Tracker(Protocol):
    """Interface of a tracker: images in, estimates out.

    `init` resets the tracker: the same images then give the same estimates.
    """

    def init(self, image: Image, box: Box) -> None:
        """Initialise on `image` `(H, W, 3)` uint8 RGB, with the target at `box` `(4,)` [px]."""
        ...

    def update(self, image: Image) -> Estimate:
        """Estimate the target's box in the next image."""
        ...
