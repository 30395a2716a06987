"""Mean shift of a box to the nearest mode of its colour similarity (Comaniciu, Ramesh & Meer 2003)."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pftrack_sim.core.boxes import Box
from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.features.histogram import BinLayout
from pftrack_sim.trackers.features.histogram_kernels import BinTables, Codes, count_box, new_scratch

LEAST_STEP = 0.01
"""The box has arrived when a step is shorter than this share of its size."""


def mean_shift(codes: Codes, box: Box, layout: BinLayout, model: FloatArray, iteration_count: int) -> tuple[Box, float]:
    """The box after at most `iteration_count` steps uphill, and its Bhattacharyya similarity in [0, 1] with the model.

    Every point of the box pulls with sqrt(q_u / p_u), where u is the bin of its colour, q the model and p the histogram
    of the box: the gradient of their similarity under an Epanechnikov kernel, whose support are the points of the
    layout with a weight. The size is constant; points outside the image do not pull.

    Args:
        codes: `(H, W, 1)` bins of colours.
        box: `(4,)` start [px].
        layout: Weights of the points, one cell and one channel.
        model: `(layout.size,)` normalised histogram of the target.
        iteration_count: Greatest number of steps, >= 0.
    """
    out = np.array(box, dtype=np.float64)
    similarity = _climb(codes, out, layout.tables, layout.total, model, iteration_count)
    return out, min(similarity, 1.0)


@njit(nogil=True, cache=True)
def _climb(
    codes: Codes, box: FloatArray, tables: BinTables, total: float, model: FloatArray, iteration_count: int
) -> float:
    """Move `box`; return the similarity where it arrives."""
    scratch, counts, pulls = new_scratch(tables, codes.shape[2]), np.empty(model.size, np.int32), np.empty(model.size)
    for iteration in range(iteration_count + 1):
        count_box(codes, box, tables, scratch, counts)
        if iteration == iteration_count:
            break
        for k in range(model.size):
            pulls[k] = math.sqrt(model[k] * total / counts[k]) if counts[k] > 0 else 0.0
        x, y = _pull(codes, box, tables, pulls)
        box[0] += x * box[2]
        box[1] += y * box[3]
        if max(abs(x), abs(y)) < LEAST_STEP:
            iteration_count = iteration + 1  # only the similarity is left
    similarity = 0.0
    for k in range(model.size):
        similarity += math.sqrt(model[k] * counts[k] / total)
    return similarity


@njit(nogil=True, cache=True)
def _pull(codes: Codes, box: FloatArray, tables: BinTables, pulls: NDArray[np.float64]) -> tuple[float, float]:
    """Mean position of the points under their pulls, relative to the centre, in sizes of the box; 0 without any."""
    height, width = codes.shape[:2]
    rows, columns = tables.weights.shape
    mass, right, down = 0.0, 0.0, 0.0
    for i in range(rows):
        line = int(np.floor(box[1] + (i + 0.5) * box[3] / rows))
        if line < 0 or line >= height:
            continue
        for j in range(tables.spans[i, 0], tables.spans[i, 1]):
            column = int(np.floor(box[0] + (j + 0.5) * box[2] / columns))
            if column < 0 or column >= width:
                continue
            pull = float(pulls[codes[line, column, 0]])
            mass += pull
            right += pull * ((j + 0.5) / columns - 0.5)
            down += pull * ((i + 0.5) / rows - 0.5)
    if mass == 0.0:
        return 0.0, 0.0
    return right / mass, down / mass
