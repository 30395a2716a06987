"""What lofts are covered with: cloth that keeps its scale, or skin."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.scene.people.atlas import SKIN
from pftrack_sim.scene.people.cloth_texture import PITCH_M
from pftrack_sim.scene.people.mesh import TriangleMesh, around, tube

Array = NDArray[np.float64]


def cloth(
    rings: Array,
    region: tuple[int, int, int, int],
    centre_column: float,
    top_m: float,
    *,
    reach_m: float | None = None,
    first_row: float = 0.0,
) -> TriangleMesh:
    """A shell of cloth.

    Args:
        rings: `(R, N, 3)` points [m].
        region: Where its picture lies in the atlas.
        centre_column: Column of the picture that comes to the front.
        top_m: Height [m] that shows the first row.
        reach_m: Length [m] over which the picture's rows are stretched; None keeps the cloth's own scale.
        first_row: Row at `top_m`.
    """
    column, row, width, height = region
    pitch = PITCH_M if reach_m is None else reach_m / height
    columns = np.clip(around(rings, PITCH_M, centre_column), 1.0, width - 1.0)
    rows = np.clip(first_row + (top_m - rings[..., 2]) / pitch, 1.0, height - 1.0)
    rows = np.concatenate([rows, rows[:, :1]], axis=1)
    return tube(rings, np.stack([column + columns, row + rows], axis=-1))


def bare(rings: Array) -> TriangleMesh:
    """A shell of skin."""
    column, row, width, height = SKIN
    across = np.linspace(column + 4.0, column + width - 4.0, rings.shape[1] + 1)
    down = np.linspace(row + 4.0, row + height - 4.0, len(rings))
    return tube(rings, np.stack(np.broadcast_arrays(across[None], down[:, None]), axis=-1))
