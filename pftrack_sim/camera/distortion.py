"""The lens: where a ray falls on the image, and which ray a pixel sees.

Brown's model as OpenCV writes it (Brown, "Decentering distortion of lenses", Photogrammetric Engineering 32, 1966):
with slopes x, y of a ray and r^2 = x^2 + y^2,

    x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2)
    y' = y (1 + k1 r^2 + k2 r^4 + k3 r^6) + p1 (r^2 + 2 y^2) + 2 p2 x y

The polynomial holds where it was fitted: on the image. Farther out it may turn back, and what lies far to the side
would appear in the image. So beyond the rays of the image's corners, and a little more, it goes on along its tangent.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.camera.pinhole import camera_matrix, focal_and_centre
from pftrack_sim.core.errors import ParameterError

Array = NDArray[np.float64]

_REACH = 1.1
"""The model holds this far beyond the ray of the farthest corner."""

_TURNING_BACK = 0.05
"""A lens that shrinks the image more than this, compared to its middle, counts as turning back."""

_SEARCH = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-9)

_ROUND_TRIP_PX = 1e-3


class Lens:
    """A pinhole with distortion.

    Args:
        K: `(3, 3)` camera matrix [px].
        coefficients: OpenCV's k1, k2, p1, p2, k3.
        size: Width and height of the image [px].

    Raises:
        ParameterError: Two rays of the image fall on the same pixel, or a pixel has no ray.
    """

    def __init__(self, K: ArrayLike, coefficients: Sequence[float], size: tuple[int, int]) -> None:
        self.size = size
        self.K = camera_matrix(np.asarray(K), *size)
        self.coefficients = np.array(coefficients, dtype=np.float64)
        if self.coefficients.shape != (5,) or not np.isfinite(self.coefficients).all():
            raise ParameterError(f"distortion needs five finite numbers k1, k2, p1, p2, k3, got {list(coefficients)}")
        self.bends = bool(self.coefficients.any())
        self._reach = np.inf
        if self.bends:
            self._reach = self._farthest()

    def pixels(self, slopes: ArrayLike) -> Array:
        """Where rays fall.

        Args:
            slopes: `(..., 2)` x / z and y / z, camera axes.

        Returns:
            `(..., 2)` x, y [px].
        """
        fx, fy, cx, cy = focal_and_centre(self.K)
        given = np.asarray(slopes, dtype=np.float64)
        if not self.bends:
            return given * (fx, fy) + (cx, cy)
        radius = np.sqrt(np.einsum("...i,...i->...", given, given))
        with np.errstate(invalid="ignore", divide="ignore"):
            beyond = np.where(radius > self._reach, radius / self._reach, 1.0)[..., None]
        inside = given / beyond
        bent = self._bent(inside) + (beyond - 1.0) * self._outwards(inside)
        return bent * (fx, fy) + (cx, cy)

    def slopes(self, pixels: ArrayLike) -> Array:
        """Which rays pixels see.

        Args:
            pixels: `(..., 2)` x, y [px], in the image or just beside it.

        Returns:
            `(..., 2)` x / z and y / z, camera axes.
        """
        fx, fy, cx, cy = focal_and_centre(self.K)
        given = np.asarray(pixels, dtype=np.float64)
        if not self.bends:
            return (given - (cx, cy)) / (fx, fy)
        flat = np.ascontiguousarray(given.reshape(-1, 1, 2))
        found = cv2.undistortPoints(flat, self.K, self.coefficients, criteria=_SEARCH)
        return np.asarray(found, dtype=np.float64).reshape(given.shape)

    def _bent(self, slopes: Array) -> Array:
        k1, k2, p1, p2, k3 = self.coefficients
        x, y = slopes[..., 0], slopes[..., 1]
        square = x * x + y * y
        radial = 1.0 + square * (k1 + square * (k2 + square * k3))
        return np.stack(
            [
                x * radial + 2.0 * p1 * x * y + p2 * (square + 2.0 * x * x),
                y * radial + p1 * (square + 2.0 * y * y) + 2.0 * p2 * x * y,
            ],
            axis=-1,
        )

    def _outwards(self, slopes: Array) -> Array:
        """Derivative of the bent slopes along the ray's own direction, times its length."""
        step = 1e-6
        return (self._bent(slopes * (1.0 + step)) - self._bent(slopes * (1.0 - step))) / (2.0 * step)

    def _farthest(self) -> float:
        """Slope up to which the model holds; refuses a lens that does not map the image one to one."""
        width, height = self.size
        problem = (
            f"the lens k1, k2, p1, p2, k3 = {[round(float(one), 6) for one in self.coefficients]} is not invertible "
            f"over the {width} x {height} image; weaken it, or narrow the field of view"
        )
        columns, rows = np.meshgrid(np.linspace(0.0, width, 33), np.linspace(0.0, height, 25))
        asked = np.stack([columns, rows], axis=-1)
        rays = self.slopes(asked)
        if not np.isfinite(rays).all():
            raise ParameterError(problem)
        reach = _REACH * float(np.sqrt((rays**2).sum(axis=-1)).max())
        fx, fy, cx, cy = focal_and_centre(self.K)
        back = self._bent(rays) * (fx, fy) + (cx, cy)
        if not np.abs(back - asked).max() < _ROUND_TRIP_PX:
            raise ParameterError(problem)
        # One to one: areas keep their sign from the middle out to the reach.
        angles, radii = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, 48), np.linspace(1e-3, reach, 64))
        disc = np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=-1)
        step = 1e-6
        right, down = np.array([step, 0.0]), np.array([0.0, step])
        across = (self._bent(disc + right) - self._bent(disc - right)) / (2.0 * step)
        down = (self._bent(disc + down) - self._bent(disc - down)) / (2.0 * step)
        area = across[..., 0] * down[..., 1] - across[..., 1] * down[..., 0]
        if not area.min() > _TURNING_BACK**2:
            raise ParameterError(problem)
        return reach
