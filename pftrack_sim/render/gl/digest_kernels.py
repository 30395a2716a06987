"""Digests of 64 bits of textures and meshes: equal for equal content, and else equal by a chance of 2^-64."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

_ODD = np.uint64(0x9E3779B97F4A7C15)
_HALF = np.uint64(32)


@njit(cache=True, nogil=True, inline="always")
def _mixed(state: np.uint64, word: np.uint64) -> np.uint64:
    """Another state for every other word: both steps can be undone."""
    product = (state ^ word) * _ODD
    return product ^ (product >> _HALF)


@njit(cache=True, nogil=True)
def words_digest(words: NDArray[np.uint64]) -> np.uint64:
    """Digest of `(N,)` words; four at a time, which do not wait for each other."""
    first, second, third, fourth = np.uint64(1), np.uint64(2), np.uint64(3), np.uint64(4)
    whole = len(words) // 4 * 4
    for index in range(0, whole, 4):
        first = _mixed(first, words[index])
        second = _mixed(second, words[index + 1])
        third = _mixed(third, words[index + 2])
        fourth = _mixed(fourth, words[index + 3])
    for index in range(whole, len(words)):
        first = _mixed(first, words[index])
    return _mixed(_mixed(_mixed(first, second), third), fourth)


@njit(cache=True, nogil=True)
def rows_digests(
    digests: NDArray[np.uint64], words: NDArray[np.uint32], starts: NDArray[np.int32], counts: NDArray[np.int32]
) -> None:
    """Go on with `(N,)` digests of meshes, each over its `counts` rows of `(R, C)` words from `starts` on.

    A negative start is that of a mesh without such rows.
    """
    for mesh in range(len(digests)):
        digest = _mixed(digests[mesh], np.uint64(counts[mesh]))
        if starts[mesh] >= 0:
            for row in range(starts[mesh], starts[mesh] + counts[mesh]):
                for column in range(words.shape[1]):
                    digest = _mixed(digest, np.uint64(words[row, column]))
        digests[mesh] = digest
