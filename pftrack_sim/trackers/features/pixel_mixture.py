"""Mixture of three Gaussians per pixel of a patch, learnt on line (Jepson, Fleet & El-Maraghi 2003)."""

from __future__ import annotations

import math
from typing import Annotated, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from pftrack_sim.core.compiled import kernel, part_of_kernel
from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.features.patches import Patches
from pftrack_sim.trackers.parameters import Positive, RecognitionParameters

OutlierRule: TypeAlias = Literal["most", "stable", "all"]
"""Components that a pixel must be far from to be an outlier; see `PixelMixture.outlier_share`."""


class MixtureParameters(RecognitionParameters):
    """Parameters of a mixture; standard deviations in units of a patch's. Kwon et al. print c only.

    Attributes:
        half_life: Frames after which an observation's weight is halved.
        sigma_wandering: Standard deviation of W, the last patch; constant.
        sigma_stable: Initial standard deviation of S; learnt.
        sigma_fixed: Standard deviation of F, the first patch; constant.
        sigma_min: Least learnt standard deviation of S.
        share_min: Least mixing weight, so that no component vanishes.
        outlier_c: c of Huber's function (12), in standard deviations of a component.
    """

    half_life: Annotated[float, Field(ge=0.1, le=1e9)] = 20.0
    sigma_wandering: Positive = 0.6
    sigma_stable: Positive = 0.6
    sigma_fixed: Positive = 0.6
    sigma_min: Positive = 0.6
    share_min: Annotated[float, Field(ge=1e-9, le=0.3)] = 0.001
    outlier_c: Positive = 1.3


class PixelMixture:
    """For each pixel of a patch, a mixture of three Gaussians that is learnt on line from the first `(d,)` patch on.

    The components are W (wandering: the pixel in the last frame), S (stable: its mean over time) and F (fixed: the
    pixel in the first frame, in place of the lost component of Jepson et al.: Zhou, Chellappa & Moghaddam 2004).

    Attributes:
        shares: `(3, d)` mixing weights m of W, S, F; they sum to 1.
        means: `(3, d)` mu of W, S, F.
        sigmas: `(3, d)` sigma of W, S, F.
    """

    def __init__(self, first: NDArray[np.float32], params: MixtureParameters) -> None:
        self.params = params
        count = first.size
        start = first.astype(np.float64)
        sigmas = (params.sigma_wandering, params.sigma_stable, params.sigma_fixed)
        self.shares = np.full((3, count), 1.0 / 3.0)
        self.means = np.tile(start, (3, 1))
        self.sigmas = np.repeat(np.array(sigmas)[:, None], count, axis=1)
        self._first_moment = self.shares[1] * start
        self._second_moment = self.shares[1] * (np.square(start) + params.sigma_stable**2)
        self._rate = 1.0 - 0.5 ** (1.0 / params.half_life)

    def learn(self, patch: NDArray[np.float32]) -> None:
        """One step of on-line EM on a `(d,)` patch, with forgetting (Jepson et al. 2003, sec. 4; Zhou et al. 2004)."""
        observed = patch.astype(np.float64)
        # E step: ownership of each pixel. Relative to the best component, so that no pixel underflows in all.
        logs = np.log(self.shares / self.sigmas) - 0.5 * np.square((observed - self.means) / self.sigmas)
        owned = np.exp(logs - logs.max(axis=0))
        owned /= owned.sum(axis=0)
        # M step: moments with forgetting.
        kept = 1.0 - self._rate
        shares = kept * self.shares + self._rate * owned
        self._first_moment = kept * self._first_moment + self._rate * owned[1] * observed
        self._second_moment = kept * self._second_moment + self._rate * owned[1] * np.square(observed)
        mean = self._first_moment / shares[1]
        variance = self._second_moment / shares[1] - np.square(mean)
        self.means[0], self.means[1] = observed, mean
        self.sigmas[1] = np.sqrt(np.maximum(variance, self.params.sigma_min**2))
        # The moments of S are scaled with its share, so that they stay those of the same Gaussian.
        raised = np.maximum(shares, self.params.share_min)
        raised /= raised.sum(axis=0)
        self._first_moment *= raised[1] / shares[1]
        self._second_moment *= raised[1] / shares[1]
        self.shares = raised

    def log_likelihood(self, patches: Patches, *, robust: bool) -> FloatArray:
        """`(N,)` logarithms of sum_i m_i N(z; mu_i, sigma_i), multiplied over the pixels z of `(N, d)` patches.

        They are known up to a constant. A robust one has exp(-rho(x)) of (12) in place of exp(-x^2 / 2).
        """
        out = np.empty(len(patches))
        peaks, means, inverses = (
            part.astype(np.float32) for part in (self.shares / self.sigmas, self.means, 1.0 / self.sigmas)
        )
        _log_likelihood(patches, peaks, means, inverses, np.float32(self.params.outlier_c if robust else math.inf), out)
        return out

    def prediction_error(self, patch: NDArray[np.float32]) -> float:
        """Prediction error (10) of a `(d,)` patch: about 1 where pixels deviate by the components' sigmas."""
        loss = huber((patch - self.means) / self.sigmas, self.params.outlier_c)
        return 2.0 * float(np.einsum("ij,ij->", self.shares, loss)) / patch.size

    def outlier_share(self, patch: NDArray[np.float32], rule: OutlierRule) -> float:
        """Share of the pixels of a `(d,)` patch that are outliers, d_out / d: more than c standard deviations off.

        By the rule `"most"` they are counted for each of W, S and F, and the greatest number is taken (Zhou et al.
        2004); by `"stable"` for S alone; by `"all"` only pixels count that are off in all three.
        """
        out = np.abs(patch - self.means) > self.params.outlier_c * self.sigmas
        if rule == "stable":
            return float(out[1].mean())
        return float(out.mean(axis=1).max()) if rule == "most" else float(out.all(axis=0).mean())

    def similarity(self, patch: NDArray[np.float32]) -> float:
        """Correlation of a `(d,)` patch with the mixture's mean, in [0, 1]; 0 where it is negative."""
        expected = np.einsum("ij,ij->j", self.shares, self.means)
        lengths = float(np.linalg.norm(patch)) * float(np.linalg.norm(expected))
        return min(max(float(patch @ expected) / lengths, 0.0), 1.0) if lengths > 0.0 else 0.0


def huber(x: FloatArray, c: float) -> FloatArray:
    """Huber's rho (12): x^2 / 2 up to c, linear beyond."""
    size = np.abs(x)
    return np.where(size <= c, 0.5 * np.square(x), c * size - 0.5 * c * c)


@kernel
def _log_likelihood(
    patches: Patches,
    peaks: NDArray[np.float32],
    means: NDArray[np.float32],
    inverses: NDArray[np.float32],
    c: np.float32,
    out: FloatArray,
) -> None:
    """Fill `out` with the logarithms for each patch. The inner loops are vectorised."""
    total, half = np.empty(patches.shape[1], np.float32), np.float32(0.5)
    for n in range(patches.shape[0]):
        for k in range(total.size):
            total[k] = _LEAST
        for i in range(3):
            for k in range(total.size):
                x = abs(patches[n, k] - means[i, k]) * inverses[i, k]
                inner = min(x, c)
                total[k] += peaks[i, k] * _exp_minus(min(inner * (x - half * inner), _FARTHEST))
        logarithm, product = 0.0, 1.0
        for k in range(total.size):
            product *= total[k]
            # One logarithm for several pixels, as it costs more than the rest.
            if k % _TOGETHER == _TOGETHER - 1:
                logarithm += math.log(product)
                product = 1.0
        out[n] = logarithm + math.log(product)


_LEAST = np.float32(1e-30)  # Least likelihood of a pixel: a product of `_TOGETHER` is still above 0 in float64
_TOGETHER = 8
_FARTHEST = np.float32(80.0)  # Its exponential is far below the least likelihood
_C0, _C1, _C2, _C3, _C4, _C5, _C6, _C7 = (
    np.float32(value)
    for value in np.polynomial.Chebyshev.interpolate(lambda x: np.exp(-x), 7, domain=[0.0, 80 / 64])
    .convert(kind=np.polynomial.Polynomial)
    .coef
)


@part_of_kernel
def _exp_minus(x: np.float32) -> np.float32:
    """exp(-x) for x from 0 to `_FARTHEST`, to 1e-5 of its value: a polynomial for x / 64, squared six times.

    The function of the C library cannot be vectorised.
    """
    t = x * np.float32(1 / 64)
    y = _C0 + t * (_C1 + t * (_C2 + t * (_C3 + t * (_C4 + t * (_C5 + t * (_C6 + t * _C7))))))
    y *= y
    y *= y
    y *= y
    y *= y
    y *= y
    y *= y
    return y
