"""Profile of a video: how hard its frames and true boxes are to track, whatever the tracker.

The size of the target is s = sqrt(w h) of its box. Frames in which it is not visible are left out, and so are steps to
and from them.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.core import boxes
from pftrack_sim.core.data_files import asset_table
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.records import Image
from pftrack_sim.core.types import FloatArray

QUANTILES = (0.10, 0.25, 0.50, 0.75, 0.90)  # Quantiles of recorded video that `recorded_quantiles` gives
_PATCH = (24, 48)  # Width and height [px].
_PATCHES_BETWEEN = 3  # Frames between the two patches of `ncc_to_previous`.
_BINS, _RANGES = [8, 8, 4], [0, 180, 0, 256, 0, 256]  # Of hue, saturation and value in OpenCV's units.
_CAMERA_VIEW = (160, 120)  # Width and height [px] of the image in which the camera's motion is measured.


@dataclass(frozen=True)
class Profile:
    """The numbers of one video; NaN where there are too few frames for one.

    Attributes:
        stay_overlap: Mean overlap of the first box in every frame, with the truth.
        step_median_per_s: Speed of the centre, in sizes of the target per second; median.
        step_p95_per_s: Its 95 % quantile.
        scale_p95_per_s: Change of ln s per second, absolute; 95 % quantile.
        excursion_sizes: Greatest distance of the centre from its first place, in sizes of the target at the start.
        size_ratio: Greatest s over least s.
        aspect_swing: 95 % quantile over 5 % quantile of w / h.
        size_share: s over the square root of the image's area; median.
        ncc_to_first: Normalised cross-correlation of the grey box, resized to 24 x 48, with that of the first frame;
            median.
        ncc_to_previous: The same with that of three frames before.
        colour_change: Bhattacharyya distance between the HSV histogram (8 x 8 x 4) of the box and that of the first;
            median.
        distinct_from_surround: The same between the box and the ring around it, a box twice as wide and high less
            the box.
        luma_swing: Standard deviation over mean of the box's mean grey.
        sharpness: Variance of the Laplacian of the grey box resized to 24 x 48 [grey levels squared]; median.
        camera_step_median_per_s: Shift of the image per second, by phase correlation of successive frames, as a share
            of the image's sides; median.
        camera_step_p95_per_s: Its 95 % quantile.
    """

    stay_overlap: float
    step_median_per_s: float
    step_p95_per_s: float
    scale_p95_per_s: float
    excursion_sizes: float
    size_ratio: float
    aspect_swing: float
    size_share: float
    ncc_to_first: float
    ncc_to_previous: float
    colour_change: float
    distinct_from_surround: float
    luma_swing: float
    sharpness: float
    camera_step_median_per_s: float
    camera_step_p95_per_s: float


NUMBERS = tuple(field.name for field in fields(Profile))  # Names of the numbers of a profile
_MEDIANS = ("ncc_to_first", "ncc_to_previous", "colour_change", "distinct_from_surround", "sharpness",
            "camera_step_median_per_s")  # fmt: skip


def recorded_quantiles() -> dict[str, tuple[float, ...]]:
    """For each number its `QUANTILES` over recorded sequences; source in `assets/recorded_profile.toml`."""
    return {name: tuple(asset_table("recorded_profile")["quantiles"][name]) for name in NUMBERS}


def mean_profile(profiles: list[Profile]) -> Profile:
    """Mean of each number over videos, without NaN; NaN where no video has it."""
    means: dict[str, float] = {}
    for name in NUMBERS:
        known = [value for one in profiles if np.isfinite(value := getattr(one, name))]
        means[name] = float(np.mean(known)) if known else np.nan
    return Profile(**means)


def ends_reached(name: str, values: Sequence[float]) -> Literal["both", "low", "high", "neither"]:
    """Ends of the recorded 10 to 90 % that a number reaches: its least value the low one, its greatest the high one."""
    low, *_, high = recorded_quantiles()[name]
    known = [value for value in values if np.isfinite(value)]
    below, above = any(value <= low for value in known), any(value >= high for value in known)
    return "both" if below and above else "low" if below else "high" if above else "neither"


class ProfileMeter:
    """Measures a profile frame by frame; it keeps no frame.

    Args:
        name: Name of the video in messages.
    """

    def __init__(self, name: str = "video") -> None:
        self._name = name
        self._times: list[float] = []
        self._shape: tuple[int, int] = (0, 0)
        self._boxes: list[FloatArray] = []
        self._seen: list[bool] = []
        self._first_patch: NDArray[np.float64] | None = None
        self._first_colours: FloatArray | None = None
        self._patches: deque[NDArray[np.float64] | None] = deque(maxlen=_PATCHES_BETWEEN + 1)
        self._last_view: NDArray[np.float32] | None = None
        self._window = cv2.createHanningWindow(_CAMERA_VIEW, cv2.CV_32F)
        self._values: dict[str, list[float]] = {name: [] for name in _MEDIANS}
        self._grey: list[float] = []

    def add(self, time_s: float, image: Image, box: ArrayLike, visible: bool) -> None:
        """Measure the next frame, `(H, W, 3)` uint8 RGB, with the target's box [px], NaN where it is unknown."""
        self._times.append(time_s)
        true_box = boxes.clip(box, image.shape[1], image.shape[0]) if visible else boxes.NO_BOX
        visible = visible and boxes.area(true_box) > 0.0  # A box beside the image shows nothing
        self._shape = image.shape[:2]
        self._boxes.append(np.array(box, dtype=np.float64))
        self._seen.append(visible)
        grey = np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY))
        self._add_camera(grey)
        self._patches.append(None)
        if visible and (area := _pixels(true_box, self._shape)) is not None:
            self._add_patch(grey[area])
            self._add_colours(image, true_box, area)

    def profile(self) -> Profile:
        """The numbers of the frames so far.

        Raises:
            ParameterError: No frame was added, or the target is visible in none.
        """
        seen = np.array(self._seen, dtype=bool)
        if not seen.any():
            raise ParameterError(
                f"{self._name}: the target is visible in none of {len(seen)} frames: it has no profile"
            )
        all_boxes = np.array(self._boxes)
        size = np.sqrt(all_boxes[:, 2] * all_boxes[:, 3])
        centre = boxes.centre(all_boxes)
        pairs = np.flatnonzero(seen[:-1] & seen[1:])
        lasts_s = np.diff(self._times)[pairs]
        step = np.linalg.norm(centre[pairs + 1] - centre[pairs], axis=1) / size[pairs] / lasts_s
        true = all_boxes[seen]
        aspect = true[:, 2] / true[:, 3]
        return Profile(
            stay_overlap=float(boxes.pairwise_iou(true[0], true).mean()),
            step_median_per_s=_quantile(step, 0.5),
            step_p95_per_s=_quantile(step, 0.95),
            scale_p95_per_s=_quantile(np.abs(np.log(size[pairs + 1] / size[pairs])) / lasts_s, 0.95),
            excursion_sizes=float(np.linalg.norm(centre[seen] - centre[seen][0], axis=1).max() / size[seen][0]),
            size_ratio=float(size[seen].max() / size[seen].min()),
            aspect_swing=_quantile(aspect, 0.95) / _quantile(aspect, 0.05),
            size_share=float(np.median(size[seen]) / np.sqrt(np.prod(self._shape))),
            luma_swing=float(np.std(self._grey) / np.mean(self._grey)) if any(self._grey) else np.nan,
            camera_step_p95_per_s=_quantile(self._values["camera_step_median_per_s"], 0.95),
            **{name: _quantile(values, 0.5) for name, values in self._values.items()},
        )

    def _add_camera(self, grey: NDArray[Any]) -> None:
        view = np.asarray(cv2.resize(grey, _CAMERA_VIEW, interpolation=cv2.INTER_AREA), dtype=np.float32)
        if self._last_view is not None:
            shift, _ = cv2.phaseCorrelate(self._last_view, view, self._window)
            speed = np.hypot(*(np.array(shift) / _CAMERA_VIEW)) / (self._times[-1] - self._times[-2])
            self._values["camera_step_median_per_s"].append(float(speed))
        self._last_view = view

    def _add_patch(self, grey: NDArray[Any]) -> None:
        resized = np.asarray(cv2.resize(grey, _PATCH, interpolation=cv2.INTER_AREA))
        patch = resized - resized.mean()
        self._grey.append(float(grey.mean()))
        self._values["sharpness"].append(float(np.asarray(cv2.Laplacian(resized, cv2.CV_64F)).var()))
        first = self._first_patch = patch if self._first_patch is None else self._first_patch
        self._values["ncc_to_first"].append(_correlation(patch, first))
        if len(self._patches) > _PATCHES_BETWEEN and (earlier := self._patches[0]) is not None:
            self._values["ncc_to_previous"].append(_correlation(patch, earlier))
        self._patches[-1] = patch

    def _add_colours(self, image: Image, box: FloatArray, area: tuple[slice, slice]) -> None:
        around = _pixels(np.concatenate([box[:2] - 0.5 * box[2:], 2.0 * box[2:]]), self._shape)
        assert around is not None
        rows, columns = (slice(a.start - b.start, a.stop - b.start) for a, b in zip(area, around, strict=True))
        hsv = np.asarray(cv2.cvtColor(image[around], cv2.COLOR_RGB2HSV), dtype=np.uint8)
        ring = np.full(hsv.shape[:2], 255, np.uint8)
        ring[rows, columns] = 0
        colours = _histogram(hsv, 255 - ring)
        if self._first_colours is None:
            self._first_colours = colours
        self._values["colour_change"].append(_distance(colours, self._first_colours))
        if ring.any():
            self._values["distinct_from_surround"].append(_distance(colours, _histogram(hsv, ring)))


def _pixels(box: FloatArray, shape: tuple[int, int]) -> tuple[slice, slice] | None:
    """Rows and columns of a box inside the image; None if it has none."""
    left, top, right, bottom = np.rint([box[0], box[1], box[0] + box[2], box[1] + box[3]]).astype(int)
    rows = slice(int(max(top, 0)), int(min(bottom, shape[0])))
    columns = slice(int(max(left, 0)), int(min(right, shape[1])))
    return None if rows.start >= rows.stop or columns.start >= columns.stop else (rows, columns)


def _histogram(hsv: NDArray[np.uint8], mask: NDArray[np.uint8]) -> FloatArray:
    counts = np.asarray(cv2.calcHist([hsv], [0, 1, 2], mask, _BINS, _RANGES), dtype=np.float64)
    return counts / counts.sum()


def _distance(p: FloatArray, q: FloatArray) -> float:
    """Bhattacharyya distance of two histograms that sum to 1."""
    return float(np.sqrt(max(1.0 - np.sqrt(p * q).sum(), 0.0)))


def _correlation(first: NDArray[np.float64], second: NDArray[np.float64]) -> float:
    """Normalised cross-correlation of two patches of mean 0; NaN if one is uniform."""
    norm = float(np.linalg.norm(first) * np.linalg.norm(second))
    return float((first * second).sum()) / norm if norm > 0.0 else np.nan


def _quantile(values: ArrayLike, share: float) -> float:
    known = np.asarray(values, dtype=np.float64)
    known = known[np.isfinite(known)]
    return float(np.quantile(known, share)) if known.size else np.nan
