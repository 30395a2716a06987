"""Boxes around regions as VOT and TraX write them: polygons, and masks as lengths of runs."""

from __future__ import annotations

import numpy as np

from pftrack_sim.core.boxes import Box
from pftrack_sim.core.types import FloatArray


def polygon_box(values: FloatArray) -> Box:
    """`(4,)` box [px] around a polygon `(x, y, x, y, ...)`; NaN where a corner is."""
    corners = values.reshape(-1, 2)
    return np.concatenate([corners.min(axis=0), np.ptp(corners, axis=0)])


def mask_box(values: FloatArray) -> Box | None:
    """`(4,)` box [px] around the pixels of a mask, of zero size without any; None if the numbers are no mask.

    Args:
        values: x, y, width and height [px], then the lengths of runs of pixels outside and inside by turns, row by row.

    >>> mask_box(np.array([10.0, 20, 5, 4, 7, 2, 3, 2])).tolist()
    [12.0, 21.0, 2.0, 2.0]
    """
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
