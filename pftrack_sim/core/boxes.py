"""Boxes: `x, y, w, h`, float64, pixels, continuous coordinates.

Pixel (row i, column j) covers [j, j+1) x [i, i+1): a mask on columns 10..19 has x = 10 and w = 10. Functions do not
modify their arguments.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.core.errors import BoxError
from pftrack_sim.core.types import FloatArray, read_only

Box: TypeAlias = FloatArray  # `(4,)` x, y, w, h [px]

NO_BOX: Box = read_only(np.full(4, np.nan))


def checked(box: ArrayLike, *, what: str = "box") -> Box:
    """Validated `(4,)` float64 copy of a box x, y, w, h [px] with w and h >= 0; `what` is its name in the message.

    Raises:
        BoxError: Wrong shape, not numbers, NaN, infinite, or a negative size.
    """
    array = numbers_in(box)
    # NumPy reads a boolean among numbers as one of them.
    if array is None or (isinstance(box, Sequence) and any(isinstance(one, (bool, np.bool_)) for one in box)):
        raise BoxError(f"{what} must be four numbers x, y, w, h in pixels, got {box!r}")
    if array.shape != (4,):
        raise BoxError(f"{what} must have shape (4,) (x, y, w, h in pixels), got shape {array.shape}")
    numbers = array.tolist()
    if not all(map(math.isfinite, numbers)):
        raise BoxError(f"{what} must be finite, got {numbers}")
    if numbers[2] < 0 or numbers[3] < 0:
        raise BoxError(f"{what} must have a width and height >= 0, got w={numbers[2]:g}, h={numbers[3]:g}")
    return array


def numbers_in(values: ArrayLike) -> FloatArray | None:
    """Float64 copy of real numbers; None for anything else: texts, booleans, complex numbers, masked arrays."""
    try:
        given = np.asarray(values)
        is_numbers = given.dtype.kind in "iuf" and not isinstance(values, np.ma.MaskedArray)
        return np.array(given, dtype=np.float64) if is_numbers else None
    except (TypeError, ValueError):
        return None


def iou(first: ArrayLike, second: ArrayLike) -> float:
    """Overlap of two `(4,)` boxes: area of the intersection over area of the union (Ko et al. 2012, eq. 14).

    It is in [0, 1], and 0 when both are empty or any number is NaN.

    >>> iou([0, 0, 2, 2], [1, 0, 2, 2])
    0.3333333333333333
    """
    numbers = [*np.asarray(first, dtype=np.float64).tolist(), *np.asarray(second, dtype=np.float64).tolist()]
    x, y, w, h, u, v, p, q = numbers
    across, down = min(x + w, u + p) - max(x, u), min(y + h, v + q) - max(y, v)
    inner = max(across, 0.0) * max(down, 0.0)
    union = max(w, 0.0) * max(h, 0.0) + max(p, 0.0) * max(q, 0.0) - inner
    return min(inner / union, 1.0) if union > 0.0 and all(map(math.isfinite, numbers)) else 0.0


def pairwise_iou(first: ArrayLike, second: ArrayLike) -> FloatArray:
    """`(...)` overlaps of `(..., 4)` boxes [px] with the same of the second, by the rules of broadcasting.

    In [0, 1]; 0 where the union is empty or a number is not finite.
    """
    a, b = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    near = np.maximum(a[..., :2], b[..., :2])
    far = np.minimum(a[..., :2] + a[..., 2:], b[..., :2] + b[..., 2:])
    with np.errstate(invalid="ignore", over="ignore"):
        inner = np.clip(far - near, 0.0, None).prod(axis=-1)
        union = np.clip(a[..., 2:], 0.0, None).prod(axis=-1) + np.clip(b[..., 2:], 0.0, None).prod(axis=-1) - inner
        valid = np.isfinite(a).all(axis=-1) & np.isfinite(b).all(axis=-1) & (union > 0)
        # Rounding can leave the union of equal boxes a little smaller than their intersection.
        return np.minimum(np.divide(inner, union, out=np.zeros_like(inner), where=valid), 1.0)


def clip(box: ArrayLike, width_px: int, height_px: int) -> Box:
    """Part of a `(4,)` box inside the image; size 0 on the nearest border when it lies outside."""
    x, y, w, h = np.asarray(box, dtype=np.float64).tolist()
    width, height = float(width_px), float(height_px)
    left, right = min(max(x, 0.0), width), min(max(x + w, 0.0), width)
    top, bottom = min(max(y, 0.0), height), min(max(y + h, 0.0), height)
    return np.array([left, top, right - left, bottom - top])


def area(box: ArrayLike) -> float:
    """Width times height [px^2]; 0 for a box that is empty or not finite."""
    w, h = np.asarray(box, dtype=np.float64)[2:].tolist()
    return w * h if w > 0 and h > 0 and math.isfinite(w * h) else 0.0


def centre(box: ArrayLike) -> FloatArray:
    """`(..., 2)` centres x, y of `(..., 4)` boxes [px]."""
    array = np.asarray(box, dtype=np.float64)
    return array[..., :2] + 0.5 * array[..., 2:]


def to_states(boxes: FloatArray) -> FloatArray:
    """`(..., 4)` centre x, centre y, width and height of `(..., 4)` boxes [px]."""
    states = boxes.copy()
    states[..., :2] += 0.5 * boxes[..., 2:]
    return states


def from_states(states: FloatArray) -> FloatArray:
    """`(..., 4)` boxes [px] of `(..., D)` states that begin with centre x, centre y, width, height.

    >>> from_states(np.array([30.0, 40.0, 10.0, 20.0])).tolist()
    [25.0, 30.0, 10.0, 20.0]
    """
    boxes = states[..., :4].copy()
    boxes[..., :2] -= 0.5 * boxes[..., 2:]
    return boxes


def region_box(text: str, *, mask: str = "m") -> Box | None:
    """`(4,)` box [px] around a region as VOT and TraX write them; None where the text is none.

    A region is a rectangle `x,y,w,h`, a polygon `x,y,x,y,...` or a mask `mx,y,w,h,n,n,...`, whose lengths of runs of
    pixels outside and inside alternate row by row. The box of a mask without pixels has no size; that of a rectangle
    or polygon with NaN has NaN.

    Args:
        text: The region.
        mask: What a mask begins with.

    >>> [region_box(text).tolist() for text in ("10,20,30,25,28,40", "m10,20,5,4,7,2,3,2")]
    [[10.0, 20.0, 20.0, 20.0], [12.0, 21.0, 2.0, 2.0]]
    """
    try:
        values = np.array([float(field) for field in text.removeprefix(mask).split(",")])
    except ValueError:
        return None
    if np.isinf(values).any():
        return None
    if text.startswith(mask):
        return _mask_box(values)
    if values.size < 6:
        return values if values.size == 4 else None
    corners = values.reshape(-1, 2) if values.size % 2 == 0 else None
    return None if corners is None else np.concatenate([corners.min(axis=0), np.ptp(corners, axis=0)])


def _mask_box(values: FloatArray) -> Box | None:
    if values.size < 4 or (values != np.round(values)).any() or (values[2:] < 0).any():
        return None
    x, y, width, height = values[:4]
    ends = np.cumsum(values[4:])
    first, last = ends[:-1:2], ends[1::2] - 1.0
    if ends.size and ends[-1] > width * height:
        return None
    inside = last >= first
    first, last = first[inside], last[inside]
    if not first.size:
        return np.array([x, y, 0.0, 0.0])
    rows, columns = [first // width, last // width], [first % width, last % width]
    wraps = bool((rows[0] != rows[1]).any())  # a run over the end of a row has pixels in its last and first column
    left, right = (0.0, width - 1.0) if wraps else (columns[0].min(), columns[1].max())
    top, bottom = rows[0].min(), rows[1].max()
    return np.array([x + left, y + top, right - left + 1.0, bottom - top + 1.0])
