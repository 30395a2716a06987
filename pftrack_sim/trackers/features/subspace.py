"""Incremental principal component analysis of the last vectors seen (Lee et al. 2012, section IV; Ross et al. 2008)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


class SlidingSubspace:
    """The singular value decomposition U S V^T of a window of vectors, kept up to date as the window slides.

    As in the paper's equations 6 and 7 no mean is taken out, and nothing is forgotten but the oldest vector. All
    components are kept, so that the decomposition stays exact; how many are used is for `basis` to be told.

    Args:
        vectors: `(d, n)` the window A, one vector a column, oldest first.
    """

    def __init__(self, vectors: NDArray[np.float64]) -> None:
        u, s, vt = np.linalg.svd(vectors, full_matrices=False)
        self._keep(u, s, vt)

    def slide(self, vector: NDArray[np.float64]) -> None:
        """Drop the oldest vector and add one.

        Equation 6 writes [A B] as [U B~] R [V^T 0; 0 1], equation 7 decomposes R. Here A has lost its first column, so
        V^T has lost its first and is no longer orthogonal: it goes into R, which then is
        [S V'^T, U^T B; 0, B~^T B]. (The paper prints B^T B in the corner; only the part of B outside U makes the
        equation true, as in Ross et al.)

        Args:
            vector: `(d,)` B, the newest.
        """
        inside = self._u.T @ vector
        outside = vector - self._u @ inside
        # Once more, for what rounding left inside: U must stay orthonormal over thousands of frames.
        rest = self._u.T @ outside
        inside, outside = inside + rest, outside - self._u @ rest
        length = float(np.linalg.norm(outside))
        rank, count = self._s.size, self._vt.shape[1]
        r = np.zeros((rank + 1, count))
        r[:rank, :-1] = self._s[:, None] * self._vt[:, 1:]
        r[:rank, -1] = inside
        if length > _ROUNDING * max(float(np.linalg.norm(vector)), float(self._s[0]) if rank else 0.0):
            r[rank, -1] = length
            u = np.column_stack([self._u, outside / length])
        else:
            r, u = r[:rank], self._u
        if not r.size:
            return  # nothing but zeros so far, and one more
        turn, s, vt = np.linalg.svd(r, full_matrices=False)
        self._keep(u @ turn, s, vt)

    def basis(self, count: int) -> NDArray[np.float64]:
        """`(d, k)` the directions that matter most, orthonormal; k is `count`, or the rank where that is less."""
        return self._u[:, :count]

    @property
    def singular_values(self) -> NDArray[np.float64]:
        """`(rank,)` S, greatest first."""
        return self._s

    def _keep(self, u: NDArray[np.float64], s: NDArray[np.float64], vt: NDArray[np.float64]) -> None:
        rank = int(np.count_nonzero(s > _ROUNDING * s[0])) if s.size else 0
        self._u, self._s, self._vt = u[:, :rank], s[:rank], vt[:rank]


_ROUNDING = 1e-13
"""Directions shorter than this share of the longest are what rounding left over."""


def residuals(vectors: NDArray[np.float64], basis: NDArray[np.float64]) -> NDArray[np.float64]:
    """||z - U U^T z|| of many vectors (Lee et al. 2012, eq. 12 and 13, where a norm is meant).

    Args:
        vectors: `(N, d)` one z a row.
        basis: `(d, k)` U, orthonormal.

    Returns:
        `(N,)` lengths, from 0 to that of the vector.
    """
    return np.linalg.norm(vectors - (vectors @ basis) @ basis.T, axis=1)
