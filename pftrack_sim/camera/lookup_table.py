"""A table looked up at every pixel."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray


def look_up(wanted: NDArray[np.uint16], table: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """`table[wanted]`, without first making larger integers of all that is wanted, as numpy does.

    Args:
        wanted: Indices, any shape.
        table: `(65536,)`.

    Returns:
        Of the shape of `wanted`.
    """
    found = np.empty(wanted.shape, dtype=np.uint8)
    _look_up(wanted.reshape(-1), table, found.reshape(-1))
    return found


@njit(nogil=True, cache=True)
def _look_up(wanted: NDArray[np.uint16], table: NDArray[np.uint8], out: NDArray[np.uint8]) -> None:
    for k in range(wanted.size):
        out[k] = table[wanted[k]]
