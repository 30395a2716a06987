"""Appearance model of one feature that is learnt on line: the first frame, then a subspace (Lee et al. 2012)."""

from __future__ import annotations

import math
from typing import Annotated, Literal, TypeAlias

import numpy as np
from pydantic import Field

from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.parameters import RecognitionParameters

Normalisation: TypeAlias = Literal["sum", "length", "root"]
"""Of learnt vectors: to sum 1; to length 1; or the square root of the former, whose distances are Bhattacharyya's."""


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


class OnlineFeatureParameters(RecognitionParameters):
    """Parameters of learning; printed values have their equation.

    Attributes:
        window: T and n: the frame at which learning starts, and the number of estimates that A begins with. Printed:
            40, both.
        memory: What becomes of old estimates (`Memory`): `"growing"`, as (6) and (7) say, or `"sliding"`, as
            section II says.
        forgetting: Factor on the growing memory's singular values per frame. 1 as (6) and (7) print none.
        component_count: Columns of U in (12) and (13). Not printed: 10.
        learned_scale: Normalisation of learnt vectors (`Normalisation`). Not printed (the factor f of (5)):
            `"length"`, with which D of (12) and (13) has the range [0, 1] of D in (10) and (11), as their common sigma
            demands. With `"sum"` D is so small that all particles weigh the same.
        anchored: Whether the learned likelihood (12, 13) is multiplied by that of the first frame (10, 11), the only
            one that is certain to show the target. Not in the paper: False.
    """

    window: Annotated[int, Field(ge=2, le=1000)] = 40
    memory: Memory = "growing"
    forgetting: Annotated[float, Field(gt=0.0, le=1.0)] = 1.0
    component_count: Annotated[int, Field(ge=1, le=1000)] = 10
    learned_scale: Normalisation = "length"
    anchored: bool = False


class OnlineFeatureModel:
    """Appearance in one `(d,)` feature: that of the first frame until the window is full, a subspace afterwards.

    Args:
        first: `(d,)` the first frame's.
        sigmas: Widths of the likelihood under the first frame, (10) or (11), and under the subspace, (12) or (13).
        params: How it is learnt.
    """

    def __init__(self, first: FloatArray, sigmas: tuple[float, float], params: OnlineFeatureParameters) -> None:
        self._sigma, self._learned_sigma = sigmas
        self._params = params
        self._root = np.sqrt(_divide_rows(first[None], first[None].sum(axis=1))[0])
        self._window: list[FloatArray] = []
        self._subspace: Subspace | None = None
        self.learn(first)

    def likelihood(self, features: FloatArray) -> FloatArray:
        """`(N,)` p(z|x) of `(N, d)` features: (10) and (11) with D^2, (12) and (13) with D, or the product."""
        if self._subspace is None:
            return _likelihood(1.0 - self._bhattacharyya(features), self._sigma)
        vectors = _normalised(features, self._params.learned_scale)
        learned = _likelihood(self._distances(vectors, self._subspace), self._learned_sigma)
        if self._params.anchored:
            learned *= _likelihood(1.0 - self._bhattacharyya(features), self._sigma)
        return learned

    def similarity(self, features: FloatArray) -> FloatArray:
        """`(N,)` similarity in [0, 1]: Bhattacharyya with the first frame, or the cosine with the subspace."""
        if self._subspace is None:
            return self._bhattacharyya(features)
        vectors = _normalised(features, self._params.learned_scale)
        lengths = np.linalg.norm(vectors, axis=1)
        distances = self._distances(vectors, self._subspace)
        sine = np.divide(distances, lengths, out=np.ones(len(features)), where=lengths > 0.0)
        return np.sqrt(np.clip(1.0 - np.square(sine), 0.0, 1.0))

    def learn(self, feature: FloatArray) -> None:
        """Add the `(d,)` feature of one more estimate."""
        vector = _normalised(feature[None], self._params.learned_scale)[0]
        if self._subspace is not None:
            self._subspace.append(vector)
            return
        self._window.append(vector)
        if len(self._window) == self._params.window:
            self._subspace = Subspace(np.column_stack(self._window), self._params.memory, self._params.forgetting)
            self._window.clear()

    def _bhattacharyya(self, features: FloatArray) -> FloatArray:
        return np.minimum(np.sqrt(features) @ self._root, 1.0)

    def _distances(self, vectors: FloatArray, subspace: Subspace) -> FloatArray:
        """`(N,)` D of (12) and (13) of `(N, d)` normalised vectors; 1, its maximum, for those that are all 0."""
        return np.where(vectors.any(axis=1), residuals(vectors, subspace.basis(self._params.component_count)), 1.0)


def _normalised(features: FloatArray, scale: Normalisation) -> FloatArray:
    if scale == "length":
        return _divide_rows(features, np.linalg.norm(features, axis=1))
    shares = _divide_rows(features, features.sum(axis=1))
    return np.sqrt(shares) if scale == "root" else shares


def _likelihood(distances: FloatArray, sigma: float) -> FloatArray:
    return np.exp(-distances / (2.0 * sigma**2)) / math.sqrt(2.0 * math.pi * sigma**2)


def _divide_rows(rows: FloatArray, divisors: FloatArray) -> FloatArray:
    """`(N, d)` rows, each divided by one of the `(N,)` divisors; rows of zeros stay."""
    return rows / np.where(divisors > 0.0, divisors, 1.0)[:, None]
