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

from pftrack_sim.trackers.features.reduced import Reduced, reduced

Patches: TypeAlias = NDArray[np.float32]
"""`(N, d)` patches, row of points by row of points."""

Outliers: TypeAlias = Literal["most", "stable", "all"]
"""Which of the three components a pixel must be far from to be an outlier; see `PixelMixture.outlier_share`."""


def grid(width: float, height: float, point_count: int) -> tuple[int, int]:
    """Rows and columns of about `point_count` points, as far apart down as across, in a box; at least 2 of each."""
    columns = min(max(round(math.sqrt(point_count * width / height)), 2), max(point_count // 2, 2))
    return max(round(point_count / columns), 2), columns


class View:
    """One frame, from which patches are read; what they touch is made grey and reduced when it is first needed.

    The image is reduced to one or two pixels per point of a template of a given size, so that a large target costs no
    more than a small one and does not alias. What a patch is does not depend on what was read before.

    Args:
        image: `(H, W, 3)` uint8 RGB.
        size: Width and height of the template in the image [px].
        shape: Rows and columns of the template.
    """

    def __init__(self, image: NDArray[np.uint8], size: tuple[float, float], shape: tuple[int, int]) -> None:
        self._image, self._size, self._shape = image, size, shape
        self._covered = np.array([np.inf, np.inf, -np.inf, -np.inf])
        self._grey: NDArray[np.uint8]
        self._part: Reduced

    def patches(self, placements: NDArray[np.float64]) -> Patches:
        """The patches of many placements, read bilinearly between pixels; beyond the image, its edge repeats.

        Args:
            placements: `(N, 6)`.

        Returns:
            `(N, rows * columns)`, each of mean 0 and variance 1, or all 0 where everything is of one grey.
        """
        reach = 0.5 * (np.abs(placements[:, 2:4]) + np.abs(placements[:, 4:6]))
        near = (placements[:, :2] - reach).min(axis=0)
        far = (placements[:, :2] + reach).max(axis=0)
        if (near < self._covered[:2]).any() or (far > self._covered[2:]).any():
            self._cover(near, far)
        local = placements.copy()
        local[:, :2] -= self._part.origin
        local /= np.tile(self._part.step, 3)
        return read_patches(self._grey, local, self._shape)

    def _cover(self, near: NDArray[np.float64], far: NDArray[np.float64]) -> None:
        # The particles come after the state they stand around: room for them at once saves doing it twice.
        room = _ROOM * max(self._size)
        near, far = np.minimum(near - room, self._covered[:2]), np.maximum(far + room, self._covered[2:])
        hull = np.concatenate([near, far - near])
        points = np.array([self._shape[1], self._shape[0]])
        # Blocks are powers of two: an image twice as large is reduced to the same.
        block = np.exp2(np.floor(np.log2(np.maximum(self._size / points, 1.0)) + 1e-9))
        width, height = points * block
        self._part = reduced(self._image, hull[None], (float(width), float(height)), (int(points[0]), int(points[1])))
        self._grey = np.asarray(cv2.cvtColor(self._part.pixels, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
        self._covered = np.concatenate([near, far])


_ROOM = 0.3
"""Around what is asked for first, in sizes of the template."""


def read_patches(grey: NDArray[np.uint8], placements: NDArray[np.float64], shape: tuple[int, int]) -> Patches:
    """The patches of many placements in a grey image, read as it is.

    Args:
        grey: `(H, W)` uint8.
        placements: `(N, 6)`.
        shape: Rows and columns of the template.

    Returns:
        `(N, rows * columns)`, normalised as those of `View.patches`.
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
    right_most, lowest = np.float32(width - 1), np.float32(height - 1)
    count = rows * columns
    for n in range(placements.shape[0]):
        cx, cy, ux, uy, vx, vy = placements[n]
        # Pixel centres lie at half pixels: what is read at 0.5 is pixel 0.
        cx, cy = cx - 0.5, cy - 0.5
        across, along = 0.5 * (abs(ux) + abs(vx)), 0.5 * (abs(uy) + abs(vy))
        inside = cx - across >= 0 and cy - along >= 0 and cx + across < width - 1 and cy + along < height - 1
        step_x, step_y = np.float32(ux / columns), np.float32(uy / columns)
        for i in range(rows):
            v, u = (i + 0.5) / rows - 0.5, 0.5 / columns - 0.5
            x0, y0 = np.float32(cx + v * vx + u * ux), np.float32(cy + v * vy + u * uy)
            for j in range(columns):
                x, y = x0 + np.float32(j) * step_x, y0 + np.float32(j) * step_y
                if not inside:
                    x = min(max(x, np.float32(0.0)), right_most)
                    y = min(max(y, np.float32(0.0)), lowest)
                left, upper = np.int32(x), np.int32(y)
                right = left + 1 if inside else min(left + 1, width - 1)
                lower = upper + 1 if inside else min(upper + 1, height - 1)
                part, down = x - np.float32(left), y - np.float32(upper)
                one, other = np.float32(grey[upper, left]), np.float32(grey[lower, left])
                above = one + (np.float32(grey[upper, right]) - one) * part
                below = other + (np.float32(grey[lower, right]) - other) * part
                out[n, i * columns + j] = above + (below - above) * down
        total, squares = np.float64(0.0), np.float64(0.0)
        for k in range(count):
            total += out[n, k]
        mean = np.float32(total / count)
        for k in range(count):
            out[n, k] -= mean
            squares += out[n, k] * out[n, k]
        variance = squares / count
        scale = np.float32(1.0 / math.sqrt(variance)) if variance > _FLAT else np.float32(0.0)
        for k in range(count):
            out[n, k] *= scale


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
        outlier_c: c of Huber's function (12), in standard deviations of a component.
    """

    half_life: float
    sigma_wandering: float
    sigma_stable: float
    sigma_fixed: float
    sigma_min: float
    share_min: float
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


@njit(nogil=True, cache=True, error_model="numpy")
def _weigh(
    seen: NDArray[np.float32],
    heights: NDArray[np.float32],
    means: NDArray[np.float32],
    inverses: NDArray[np.float32],
    c: np.float32,
    out: NDArray[np.float64],
) -> None:
    """Fill `out` with log-likelihoods. The inner loops are plain enough for the compiler to make them vector code."""
    count = seen.shape[1]
    total = np.empty(count, np.float32)
    fraction = np.empty(count, np.float32)
    bits = np.empty(count, np.int32)
    power = bits.view(np.float32)
    half, straight = np.float32(0.5), np.float32(0.5) * c * c if c < np.inf else np.float32(0.0)
    for n in range(seen.shape[0]):
        total[:] = _IMPOSSIBLE
        for i in range(3):
            for k in range(count):
                x = abs(seen[n, k] - means[i, k]) * inverses[i, k]
                loss = half * x * x if x <= c else c * x - straight
                # exp(-loss) = 2^-whole 2^-rest; the first is written as the exponent of a float32.
                turns = min(loss * _LOG2_E, _FARTHEST)
                whole = np.int32(turns)
                fraction[k] = turns - np.float32(whole)
                bits[k] = np.int32((np.float32(127.0) - np.float32(whole)) * np.float32(8388608.0))
            for k in range(count):
                total[k] += heights[i, k] * power[k] * _two_to_minus(fraction[k])
        logarithm, product = 0.0, 1.0
        for k in range(count):
            product *= total[k]
            # A logarithm costs more than the rest: one for many pixels.
            if k % _TOGETHER == _TOGETHER - 1:
                logarithm += math.log(product)
                product = 1.0
        out[n] = logarithm + math.log(product)


@njit(nogil=True, cache=True, inline="always")
def _two_to_minus(x: np.float32) -> np.float32:
    """2^-x for x in [0, 1]: the polynomial of degree 6 through Chebyshev's points, to float32's last digits."""
    return _C0 + x * (_C1 + x * (_C2 + x * (_C3 + x * (_C4 + x * (_C5 + x * _C6)))))


_C0, _C1, _C2, _C3, _C4, _C5, _C6 = (
    np.float32(one)
    for one in np.polynomial.Chebyshev.interpolate(lambda x: 2.0**-x, 6, domain=[0.0, 1.0])
    .convert(kind=np.polynomial.Polynomial)
    .coef
)
_LOG2_E = np.float32(math.log2(math.e))
_FARTHEST = np.float32(120.0)
_TOGETHER = 8
_IMPOSSIBLE = np.float32(1e-30)
"""Least likelihood of a pixel: eight of them are still a float64 that is not 0."""
