"""Appearance model of one feature that is learnt on line: the first frame, then a subspace (Lee et al. 2012)."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.features.subspace import Memory, Subspace, residuals

Normalisation: TypeAlias = Literal["sum", "length", "root"]
"""Of learnt vectors: to sum 1; to length 1; or the square root of the former, whose distances are Bhattacharyya's."""


@dataclass(frozen=True)
class FeatureSettings:
    """Settings of one feature.

    Attributes:
        share: Its weight in the mixture (14).
        sigma: Width of the likelihood (10) or (11) under the first frame.
        learned_sigma: Width of the likelihood (12) or (13) under the subspace.
        window: Number of vectors that the subspace begins with; 0 disables learning.
        component_count: Columns of U in (12) and (13).
        normalisation: Of learnt vectors.
        memory: What becomes of old vectors.
        forgetting: Factor of a growing memory per vector.
        anchored: Whether the likelihood under the subspace is multiplied by that under the first frame.
    """

    share: float
    sigma: float
    learned_sigma: float
    window: int
    component_count: int
    normalisation: Normalisation
    memory: Memory
    forgetting: float
    anchored: bool


class OnlineFeatureModel:
    """Appearance in one `(d,)` feature: that of the first frame until the window is full, a subspace afterwards."""

    def __init__(self, first: FloatArray, settings: FeatureSettings) -> None:
        self.share = settings.share
        self._settings = settings
        self._root = np.sqrt(_divide_rows(first[None], first[None].sum(axis=1))[0])
        self._window: deque[FloatArray] = deque(maxlen=settings.window)
        self._subspace: Subspace | None = None
        self.learn(first)

    def likelihood(self, features: FloatArray) -> FloatArray:
        """`(N,)` p(z|x) of `(N, d)` features: (10) and (11) with D^2, (12) and (13) with D, or the product."""
        out = np.ones(len(features))
        if self._subspace is None or self._settings.anchored:
            out *= _likelihood(1.0 - self._bhattacharyya(features), self._settings.sigma)
        if self._subspace is not None:
            distances = self._distances(self._normalised(features), self._subspace)
            out *= _likelihood(distances, self._settings.learned_sigma)
        return out

    def similarity(self, features: FloatArray) -> FloatArray:
        """`(N,)` similarity in [0, 1]: Bhattacharyya with the first frame, or the cosine with the subspace."""
        if self._subspace is None:
            return self._bhattacharyya(features)
        vectors = self._normalised(features)
        lengths = np.linalg.norm(vectors, axis=1)
        distances = self._distances(vectors, self._subspace)
        sine = np.divide(distances, lengths, out=np.ones(len(features)), where=lengths > 0.0)
        return np.sqrt(np.clip(1.0 - np.square(sine), 0.0, 1.0))

    def learn(self, feature: FloatArray) -> None:
        """Add the `(d,)` feature of one more estimate."""
        if not self._settings.window:
            return
        vector = self._normalised(feature[None])[0]
        if self._subspace is not None:
            self._subspace.append(vector)
            return
        self._window.append(vector)
        if len(self._window) == self._settings.window:
            self._subspace = Subspace(np.column_stack(self._window), self._settings.memory, self._settings.forgetting)
            self._window.clear()

    def _bhattacharyya(self, features: FloatArray) -> FloatArray:
        return np.minimum(np.sqrt(features) @ self._root, 1.0)

    def _distances(self, vectors: FloatArray, subspace: Subspace) -> FloatArray:
        """`(N,)` D of (12) and (13) of `(N, d)` normalised vectors; 1, its maximum, for those that are all 0."""
        return np.where(vectors.any(axis=1), residuals(vectors, subspace.basis(self._settings.component_count)), 1.0)

    def _normalised(self, features: FloatArray) -> FloatArray:
        if self._settings.normalisation == "length":
            return _divide_rows(features, np.linalg.norm(features, axis=1))
        sums = features.sum(axis=1)
        if self._settings.normalisation == "root":
            return np.sqrt(_divide_rows(features, sums))
        return _divide_rows(features, sums)


def _likelihood(distances: FloatArray, sigma: float) -> FloatArray:
    return np.exp(-distances / (2.0 * sigma**2)) / math.sqrt(2.0 * math.pi * sigma**2)


def _divide_rows(rows: FloatArray, divisors: FloatArray) -> FloatArray:
    """`(N, d)` rows, each divided by one of the `(N,)` divisors; rows of zeros stay."""
    return rows / np.where(divisors > 0.0, divisors, 1.0)[:, None]
