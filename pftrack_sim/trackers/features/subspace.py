"""Incremental principal component analysis of vectors that arrive one by one (Lee et al. 2012, section IV)."""

from __future__ import annotations

from typing import Literal, TypeAlias

import numpy as np

from pftrack_sim.core.types import FloatArray

Memory: TypeAlias = Literal["growing", "sliding"]
"""What becomes of old vectors: `"growing"`: they stay, as in equations 6 and 7, or fade by the factor `forgetting`;
`"sliding"`: the oldest is dropped for each new one, as section II says."""


class Subspace:
    """Singular value decomposition U S V^T of a matrix A, updated by one vector at a time (eq. 6 and 7).

    Equation 6 writes [A B] as [U B~] R [V^T 0; 0 1], equation 7 decomposes R = [S, U^T B; 0, B~^T B]. (The paper
    prints B^T B in the corner; only the part of B outside U makes the equation true, as in Ross et al. 2008.) As
    printed, no mean is subtracted. The rank is at most the number of the first vectors.

    Args:
        vectors: `(d, n)` the first A: one vector per column, oldest first.
        memory: What becomes of old vectors.
        forgetting: Factor on S before each new vector (Ross et al. 2008, section 3.3) if `memory` is `"growing"`, in
            (0, 1]. 1, as printed, keeps all; f keeps about 1 / (1 - f^2) vectors.
    """

    def __init__(self, vectors: FloatArray, memory: Memory = "growing", forgetting: float = 1.0) -> None:
        self._memory, self._forgetting, self._limit = memory, forgetting, vectors.shape[1]
        self._truncate(*np.linalg.svd(vectors, full_matrices=False))

    def append(self, vector: FloatArray) -> None:
        """Append the `(d,)` vector B to A."""
        inside = self._u.T @ vector
        outside = vector - self._u @ inside
        # Orthogonalised twice, against rounding: U must stay orthonormal over thousands of frames.
        rest = self._u.T @ outside
        inside, outside = inside + rest, outside - self._u @ rest
        length = float(np.linalg.norm(outside))
        # The decomposition of A, in the basis U; V matters only where columns are dropped.
        past = self._s[:, None] * self._vt[:, 1:] if self._memory == "sliding" else np.diag(self._forgetting * self._s)
        rank, count = past.shape
        r = np.zeros((rank + 1, count + 1))
        r[:rank, :-1] = past
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
        """Keep the components above rounding errors, up to the limit."""
        rank = int(np.count_nonzero(s[: self._limit] > _TOLERANCE * s[0])) if s.size else 0
        self._u, self._s, self._vt = u[:, :rank], s[:rank], vt[:rank]


_TOLERANCE = 1e-13  # Components smaller than this share of the largest are rounding errors


def residuals(vectors: FloatArray, basis: FloatArray) -> FloatArray:
    """`(N,)` distances of `(N, d)` vectors to the subspace of an orthonormal `(d, k)` basis: ||z - U U^T z||.

    Lee et al. 2012, eq. 12 and 13, where a norm is meant.
    """
    rest = (vectors @ basis) @ basis.T
    np.subtract(vectors, rest, out=rest)
    return np.sqrt(np.einsum("ij,ij->i", rest, rest))
