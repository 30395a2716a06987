"""Grey patches under a motion of the plane, and a model of each of their pixels that is learnt on line.

A *placement* says where a template lies in the image: `(6,)` cx, cy, ux, uy, vx, vy, its centre [px] and the two
vectors that its width and its height have become [px]. A patch is the image read at ROWS x COLUMNS points of it, less
its mean and divided by its standard deviation, so that brightness and contrast do not matter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, TypeAlias

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from pftrack_sim.trackers.appearance.reduced import reduced

Patches: TypeAlias = NDArray[np.float32]
"""`(N, d)` patches, row of points by row of points."""

Outliers: TypeAlias = Literal["most", "stable", "all"]
"""Which of the three components a pixel must be far from to be an outlier; see `PixelMixture.outlier_share`."""


def grid(width: float, height: float, point_count: int) -> tuple[int, int]:
    """Rows and columns of about `point_count` points, as far apart down as across, in a box; at least 2 of each."""
    columns = min(max(round(math.sqrt(point_count * width / height)), 2), max(point_count // 2, 2))
    return max(round(point_count / columns), 2), columns


def patches(image: NDArray[np.uint8], placements: NDArray[np.float64], shape: tuple[int, int]) -> Patches:
    """The patches of many placements.

    The image is first reduced to about one pixel per point of the first placement, so that a large target costs no more
    than a small one and does not alias. Points between pixels are read bilinearly; beyond the image, its edge repeats.

    Args:
        image: `(H, W, 3)` uint8 RGB.
        placements: `(N, 6)`.
        shape: Rows and columns of the template.

    Returns:
        `(N, rows * columns)`, each of mean 0 and variance 1, or all 0 where everything is of one grey.
    """
    reach = 0.5 * (np.abs(placements[:, 2:4]) + np.abs(placements[:, 4:6]))
    hulls = np.concatenate([placements[:, :2] - reach, 2.0 * reach], axis=1)
    size = (float(np.hypot(*placements[0, 2:4])), float(np.hypot(*placements[0, 4:6])))
    part = reduced(image, hulls, size, (shape[1], shape[0]))
    grey = np.asarray(cv2.cvtColor(part.pixels, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
    local = placements.copy()
    local[:, :2] -= part.origin
    local /= np.tile(part.step, 3)
    return read_patches(grey, local, shape)


def read_patches(grey: NDArray[np.uint8], placements: NDArray[np.float64], shape: tuple[int, int]) -> Patches:
    """The patches of many placements in a grey image, read as it is.

    Args:
        grey: `(H, W)` uint8.
        placements: `(N, 6)`.
        shape: Rows and columns of the template.

    Returns:
        `(N, rows * columns)`, normalised as those of `patches`.
    """
    out = np.empty((len(placements), shape[0] * shape[1]), np.float32)
    _read(grey, placements, shape[0], shape[1], out)
    return out


@njit(nogil=True, cache=True)
def _read(
    grey: NDArray[np.uint8], placements: NDArray[np.float64], rows: int, columns: int, out: NDArray[np.float32]
) -> None:
    """Fill `out`; nothing is allocated."""
    height, width = grey.shape
    for n in range(placements.shape[0]):
        cx, cy, ux, uy, vx, vy = placements[n]
        total, squares = 0.0, 0.0
        for i in range(rows):
            v = (i + 0.5) / rows - 0.5
            # Pixel centres lie at half pixels: what is read at 0.5 is pixel 0.
            x0, y0 = cx + v * vx - 0.5, cy + v * vy - 0.5
            for j in range(columns):
                u = (j + 0.5) / columns - 0.5
                x = min(max(x0 + u * ux, 0.0), width - 1.0)
                y = min(max(y0 + u * uy, 0.0), height - 1.0)
                left, upper = int(x), int(y)
                right, lower = min(left + 1, width - 1), min(upper + 1, height - 1)
                along, down = np.float32(x - left), np.float32(y - upper)
                one, other = np.float32(grey[upper, left]), np.float32(grey[lower, left])
                above = one + (np.float32(grey[upper, right]) - one) * along
                below = other + (np.float32(grey[lower, right]) - other) * along
                value = above + (below - above) * down
                out[n, i * columns + j] = value
                total += value
                squares += np.float64(value) * value
        count = rows * columns
        mean = total / count
        variance = squares / count - mean * mean
        scale = np.float32(1.0 / math.sqrt(variance)) if variance > _FLAT else np.float32(0.0)
        centre = np.float32(mean)
        for k in range(count):
            out[n, k] = (out[n, k] - centre) * scale


_FLAT = 1e-3
"""Variances below this [grey levels squared] are rounding: there is nothing to see."""


@dataclass(frozen=True)
class MixtureNumbers:
    """What a mixture is told; standard deviations are in those of a patch.

    Attributes:
        half_life: Frames after which what was seen counts half.
        sigma_wandering: Of W, the last patch; fixed.
        sigma_stable: Of S at the start; learnt.
        sigma_fixed: Of F, the first patch; fixed.
        sigma_min: Least standard deviation that S may learn.
        share_min: Least mixing weight, so that no component is lost for good.
        restart_share: Below this mixing weight S starts again from what is seen now, as at the first frame.
        outlier_c: c of Huber's function (12), in standard deviations of a component.
    """

    half_life: float
    sigma_wandering: float
    sigma_stable: float
    sigma_fixed: float
    sigma_min: float
    share_min: float
    restart_share: float
    outlier_c: float


class PixelMixture:
    """For each pixel of a patch, a mixture of three Gaussians that is learnt on line.

    W, what the pixel was in the last frame (two-frame variation); S, what it has stably been; F, what it was in the
    first frame (Jepson, Fleet & El-Maraghi 2003, with F in the place of their lost component: Zhou, Chellappa &
    Moghaddam 2004).

    Args:
        first: `(d,)` patch.
        numbers: What it is told.
    """

    def __init__(self, first: NDArray[np.float32], numbers: MixtureNumbers) -> None:
        self.numbers = numbers
        count = first.size
        start = first.astype(np.float64)
        sigmas = (numbers.sigma_wandering, numbers.sigma_stable, numbers.sigma_fixed)
        self.shares = np.full((3, count), 1.0 / 3.0)
        """`(3, d)` mixing weights m of W, S, F; they sum to 1."""
        self.means = np.tile(start, (3, 1))
        """`(3, d)` mu of W, S, F."""
        self.sigmas = np.repeat(np.array(sigmas)[:, None], count, axis=1)
        """`(3, d)` sigma of W, S, F."""
        self._first_moment = self.shares[1] * start
        self._second_moment = self.shares[1] * (np.square(start) + numbers.sigma_stable**2)
        self._rate = 1.0 - 0.5 ** (1.0 / numbers.half_life)

    @property
    def expected(self) -> NDArray[np.float64]:
        """`(d,)` mean of the mixture at each pixel."""
        return np.einsum("ij,ij->j", self.shares, self.means)

    def learn(self, patch: NDArray[np.float32]) -> None:
        """One step of on-line EM with exponential forgetting (Jepson et al. 2003, section 4; Zhou et al. 2004).

        Args:
            patch: `(d,)`.
        """
        seen = patch.astype(np.float64)
        n = self.numbers
        # E: which component explains each pixel. Relative to the best, so that no pixel is impossible in all.
        logs = np.log(self.shares / self.sigmas) - 0.5 * np.square((seen - self.means) / self.sigmas)
        owned = np.exp(logs - logs.max(axis=0))
        owned /= owned.sum(axis=0)
        # M: moments that forget.
        kept = 1.0 - self._rate
        shares = kept * self.shares + self._rate * owned
        self._first_moment = kept * self._first_moment + self._rate * owned[1] * seen
        self._second_moment = kept * self._second_moment + self._rate * owned[1] * np.square(seen)
        mean = self._first_moment / shares[1]
        variance = self._second_moment / shares[1] - np.square(mean)
        self.means[0], self.means[1] = seen, mean
        self.sigmas[1] = np.sqrt(np.maximum(variance, n.sigma_min**2))
        # A share that is raised takes its moments along: they stay those of the same Gaussian.
        raised = np.maximum(shares, n.share_min)
        raised /= raised.sum(axis=0)
        self._first_moment *= raised[1] / shares[1]
        self._second_moment *= raised[1] / shares[1]
        self.shares = raised
        self._restart(raised[1] < n.restart_share, seen)

    def _restart(self, lost: NDArray[np.bool_], seen: NDArray[np.float64]) -> None:
        """Let S begin anew at some pixels (Jepson et al. 2003, section 4).

        What has changed for good is explained by W alone: S would never own any of it, and so never learn it.
        """
        if not lost.any():
            return
        self.shares[:, lost] = 1.0 / 3.0
        self.means[1, lost] = seen[lost]
        self.sigmas[1, lost] = self.numbers.sigma_stable
        self._first_moment[lost] = seen[lost] / 3.0
        self._second_moment[lost] = (np.square(seen[lost]) + self.numbers.sigma_stable**2) / 3.0

    def log_likelihood(self, seen: Patches, *, robust: bool) -> NDArray[np.float64]:
        """Logarithm of the product over the pixels of sum_i m_i N(z; mu_i, sigma_i).

        Args:
            seen: `(N, d)`.
            robust: Whether exp(-x^2 / 2) gives way to exp(-rho(x)) of (12).

        Returns:
            `(N,)` logarithms, up to a constant.
        """
        out = np.empty(len(seen))
        c = self.numbers.outlier_c if robust else math.inf
        heights = (self.shares / self.sigmas).astype(np.float32)
        means, inverses = self.means.astype(np.float32), (1.0 / self.sigmas).astype(np.float32)
        _weigh(seen, heights, means, inverses, np.float32(c), out)
        return out

    def error(self, patch: NDArray[np.float32]) -> float:
        """Prediction error (10): about 1 where pixels are as far off as the components' sigmas say.

        Args:
            patch: `(d,)`.
        """
        loss = huber((patch - self.means) / self.sigmas, self.numbers.outlier_c)
        return 2.0 * float(np.einsum("ij,ij->", self.shares, loss)) / patch.size

    def outlier_share(self, patch: NDArray[np.float32], among: Outliers) -> float:
        """Share of the pixels that are outliers: more than c standard deviations off, d_out / d.

        Args:
            patch: `(d,)`.
            among: `"most"`: counted for each of W, S and F, and the greatest number taken (Zhou et al. 2004);
                `"stable"`: for S alone; `"all"`: only pixels that none of the three explains.
        """
        out = np.abs(patch - self.means) > self.numbers.outlier_c * self.sigmas
        if among == "stable":
            return float(out[1].mean())
        return float(out.mean(axis=1).max()) if among == "most" else float(out.all(axis=0).mean())

    def likeness(self, patch: NDArray[np.float32]) -> float:
        """Correlation of a patch with what the mixture expects, in [0, 1]; 0 where it is negative.

        Args:
            patch: `(d,)`.
        """
        expected = self.expected
        lengths = float(np.linalg.norm(patch)) * float(np.linalg.norm(expected))
        return min(max(float(patch @ expected) / lengths, 0.0), 1.0) if lengths > 0.0 else 0.0


def huber(x: NDArray[np.float64], c: float) -> NDArray[np.float64]:
    """Huber's rho (12): x^2 / 2 up to c, a straight line beyond."""
    size = np.abs(x)
    return np.where(size <= c, 0.5 * np.square(x), c * size - 0.5 * c * c)


@njit(nogil=True, cache=True)
def _weigh(
    seen: NDArray[np.float32],
    heights: NDArray[np.float32],
    means: NDArray[np.float32],
    inverses: NDArray[np.float32],
    c: np.float32,
    out: NDArray[np.float64],
) -> None:
    """Fill `out` with log-likelihoods; nothing is allocated."""
    count = seen.shape[1]
    for n in range(seen.shape[0]):
        total, product, pending = 0.0, 1.0, 0
        for k in range(count):
            likelihood = np.float32(0.0)
            for i in range(3):
                x = abs(seen[n, k] - means[i, k]) * inverses[i, k]
                loss = np.float32(0.5) * x * x if x <= c else c * x - np.float32(0.5) * c * c
                likelihood += heights[i, k] * np.exp(-loss)
            product *= max(likelihood, _IMPOSSIBLE)
            pending += 1
            # A logarithm costs more than the rest: one for many pixels.
            if pending == _TOGETHER:
                total += math.log(product)
                product, pending = 1.0, 0
        out[n] = total + math.log(product)


_TOGETHER = 8
_IMPOSSIBLE = np.float32(1e-30)
"""Least likelihood of a pixel: eight of them are still a float64 that is not 0."""
