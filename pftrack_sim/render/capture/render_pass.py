"""One drawing of a frame: where its camera stands, how it is framed, and which of its rows are looked at."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.camera.distortion import Lens
from pftrack_sim.camera.pinhole import focal_and_centre
from pftrack_sim.camera.remap import Map

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class RenderPass:
    """One drawing of a frame, and what is taken from it.

    Attributes:
        bands: First and one past the last of the bands of rows that it serves.
        sample_s: Distance of its light from each row's mid-exposure.
        T_world_camera: `(4, 4)` its camera's pose.
        K: `(3, 3)` its camera's matrix [px].
        rows: Its own rows that are looked at.
        places: For each time it is resampled, `(rows, W, 2)` where each pixel looks, as indices of pixels (x, y) of
            those rows.
    """

    bands: tuple[int, int]
    sample_s: float
    T_world_camera: Array
    K: Array
    rows: slice
    places: tuple[Map, ...]


def reach(slopes: Sequence[Array]) -> tuple[Array, Array]:
    """`(2,)` smallest and `(2,)` largest x / z and y / z: of the borders, which lie around all the rest."""
    border = np.concatenate([side for one in slopes for side in (one[0], one[-1], one[:, 0], one[:, -1])])
    return border.min(axis=0), border.max(axis=0)


def rows_seen(slopes: Sequence[Array], K: Array, height_px: int) -> slice:
    """The rows of a drawing that are looked at: a band of the image needs no more than its own."""
    _, fy, _, cy = focal_and_centre(K)
    low = min(float(one[..., 1].min()) for one in slopes) * fy + cy
    high = max(float(one[..., 1].max()) for one in slopes) * fy + cy
    return slice(min(max(math.floor(low) - 2, 0), height_px - 1), max(min(math.ceil(high) + 2, height_px), 1))


def framed(lens: Lens, slopes: Sequence[Array], drawn_px: tuple[int, int]) -> Array:
    """`(3, 3)` camera matrix of a drawing that shows some rays: the lens' own scale, unless they do not fit."""
    low, high = reach(slopes)
    size = np.array(drawn_px)
    focal = np.array(focal_and_centre(lens.K)[:2])
    scale = min(1.0, float((size / ((high - low) * focal)).min()))
    centre = 0.5 * size - 0.5 * scale * focal * (low + high)
    if scale == 1.0:
        # On the pixel grid of the image: what is not bent is not resampled.
        own = lens.K[:2, 2]
        centre = own + np.round(centre - own)
    K = np.eye(3)
    K[0, 0], K[1, 1] = scale * focal
    K[:2, 2] = centre
    return K
