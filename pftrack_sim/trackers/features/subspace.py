"""Incremental principal component analysis of a sliding window (Lee et al. 2012, section IV; Ross et al. 2008)."""

from __future__ import annotations

import numpy as np

from pftrack_sim.core.types import FloatArray


class SlidingSubspace:
    """Singular value decomposition U S V^T of a sliding window of vectors, updated incrementally.

    As in the paper's equations 6 and 7, no mean is subtracted, and there is no forgetting besides the oldest vector.
    All components are kept, so that the decomposition stays exact; `basis` truncates.

    Args:
        vectors: `(d, n)` the window A: one vector per column, oldest first.
    """

    def __init__(self, vectors: FloatArray) -> None:
        u, s, vt = np.linalg.svd(vectors, full_matrices=False)
        self._truncate(u, s, vt)

    def slide(self, vector: FloatArray) -> None:
        """Drop the oldest vector and append one.

        Equation 6 writes [A B] as [U B~] R [V^T 0; 0 1], equation 7 decomposes R. Here A has lost its first column, so
        V^T has lost its first column and is no longer orthogonal: it becomes part of R, which then is
        [S V'^T, U^T B; 0, B~^T B]. (The paper prints B^T B in the corner; only the part of B outside U makes the
        equation true, as in Ross et al.)

        Args:
            vector: `(d,)` B, the newest.
        """
        inside = self._u.T @ vector
        outside = vector - self._u @ inside
        # Orthogonalised twice, against rounding: U must stay orthonormal over thousands of frames.
        rest = self._u.T @ outside
        inside, outside = inside + rest, outside - self._u @ rest
        length = float(np.linalg.norm(outside))
        rank, count = self._s.size, self._vt.shape[1]
        r = np.zeros((rank + 1, count))
        r[:rank, :-1] = self._s[:, None] * self._vt[:, 1:]
        r[:rank, -1] = inside
        if length > _TOLERANCE * max(float(np.linalg.norm(vector)), float(self._s[0]) if rank else 0.0):
            r[rank, -1] = length
            u = np.column_stack([self._u, outside / length])
        else:
            r, u = r[:rank], self._u
        if not r.size:
            return  # all vectors are zero so far
        rotation, s, vt = np.linalg.svd(r, full_matrices=False)
        self._truncate(u @ rotation, s, vt)

    def basis(self, count: int) -> FloatArray:
        """`(d, k)` first left singular vectors; k is `count`, or the rank where it is less."""
        return self._u[:, :count]

    def _truncate(self, u: FloatArray, s: FloatArray, vt: FloatArray) -> None:
        """Keep the components above rounding errors."""
        rank = int(np.count_nonzero(s > _TOLERANCE * s[0])) if s.size else 0
        self._u, self._s, self._vt = u[:, :rank], s[:rank], vt[:rank]


_TOLERANCE = 1e-13
"""Components smaller than this share of the largest are rounding errors."""


def residuals(vectors: FloatArray, basis: FloatArray) -> FloatArray:
    """Distance to a subspace, ||z - U U^T z|| (Lee et al. 2012, eq. 12 and 13, where a norm is meant).

    Args:
        vectors: `(N, d)` one z per row.
        basis: `(d, k)` U, orthonormal.

    Returns:
        `(N,)` distances, from 0 to the vector's length.
    """
    return np.linalg.norm(vectors - (vectors @ basis) @ basis.T, axis=1)
