"""Kernel that writes the poses of people's parts."""

from __future__ import annotations

from numba import njit

from pftrack_sim.core.types import FloatArray, IntArray


@njit(cache=True, nogil=True)
def write_parts(
    mocap_ids: IntArray,
    positions: FloatArray,
    quaternions: FloatArray,
    mocap_positions: FloatArray,
    mocap_quaternions: FloatArray,
) -> None:
    """Write `(P, 13, 3)` positions and `(P, 13, 4)` quaternions to the rows of `(P, 13)` mocap bodies."""
    for person in range(len(mocap_ids)):
        for part in range(mocap_ids.shape[1]):
            row = mocap_ids[person, part]
            mocap_positions[row] = positions[person, part]
            mocap_quaternions[row] = quaternions[person, part]
