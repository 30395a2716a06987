"""Lens distortion: from normalized image coordinates to pixels and back.

The Brown-Conrady model as in OpenCV (Brown, "Decentering distortion of lenses", Photogrammetric Engineering 32, 1966):
with normalized coordinates x, y and r^2 = x^2 + y^2,

    x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2)
    y' = y (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6) + p1 (r^2 + 2 y^2) + 2 p2 x y

The polynomial is valid where it was fitted, on the image. Farther out it may fold back, and objects far beside the view
would appear in the image. Beyond 1.1 times the radius of the image corners it is therefore continued linearly.

The equidistant model as in `cv2.fisheye` (Kannala and Brandt, "A generic camera model and calibration method for
conventional, wide-angle, and fish-eye lenses", IEEE PAMI 28(8), 2006): a ray at the angle t from the axis falls at
t (1 + k1 t^2 + k2 t^4 + k3 t^6 + k4 t^8) focal lengths from the principal point, up to where that no longer rises.
A *wide* lens of this kind sees more than 80 degrees off its axis: its rays have no normalized coordinates, and are
directions of length 1 instead.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.camera.pinhole import focal_and_centre
from pftrack_sim.camera.projection import LensNumbers, project
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.types import FloatArray

_VALID_RADII = 1.1  # The polynomial is used up to this multiple of the radius of the farthest corner
_LEAST_SCALE = 0.05  # Local magnification relative to the image centre below which a lens counts as folding
_PINHOLE_RAD = np.deg2rad(80.0)  # Angle from the axis up to which one pinhole image holds what a pixel sees
_WIDEST_RAD = np.deg2rad(150.0)
_SEEN = 1.1  # Bodies are cut at this multiple of the widest angle of an image, which is beyond its corners
_EQUIDISTANT = ("k1", "k2", "k3", "k4")
_ANGLES = np.linspace(0.0, 0.5 * np.pi, 1801)
_WIDE_ANGLES = np.linspace(0.0, 0.95 * np.pi, 4001)
_NEWTON_STEPS = 4
_POWERS = np.array([2, 4, 6, 8])

_INVERSION_CRITERIA = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-9)

_ROUND_TRIP_PX = 1e-3
_STEP = 1e-6


class Lens:
    """A pinhole camera with lens distortion.

    Args:
        K: `(3, 3)` camera matrix [px].
        coefficients: OpenCV's k1, k2, p1, p2, k3, and k4, k5, k6 of a rational polynomial; four numbers are k1 to k4 of
            an equidistant lens (`cv2.fisheye`).
        size: Width and height of the image [px].

    Raises:
        ParameterError: Coefficients of another number or not finite, or a lens that is not invertible over the image or
            sees more than 150 degrees off its axis.
    """

    def __init__(self, K: ArrayLike, coefficients: Sequence[float], size: tuple[int, int]) -> None:
        self.size = size
        focal_and_centre(K)  # Raises for what is no camera matrix.
        self.K = np.array(K, dtype=np.float64)
        self.coefficients = np.array(coefficients, dtype=np.float64)
        if self.coefficients.shape not in ((4,), (5,), (8,)) or not np.isfinite(self.coefficients).all():
            raise ParameterError(
                "distortion needs five finite numbers k1, k2, p1, p2, k3, eight with k4, k5, k6, or the four of an "
                f"equidistant lens, got {list(coefficients)}"
            )
        self.equidistant = len(self.coefficients) == 4
        self.distorts = distorts(self.coefficients)
        self._valid_radius = self._risen_angle(_ANGLES) if self.equidistant else np.inf
        farthest = np.hypot(*np.maximum(np.abs(self.K[:2, 2]), np.abs(self.K[:2, 2] - size)) / self.K[(0, 1), (0, 1)])
        self.wide = self.equidistant and self._valid_radius > _PINHOLE_RAD and farthest > self._height(_PINHOLE_RAD)
        """Whether it sees so far off its axis that an image is composed of several pinhole renderings."""
        if self.wide:
            self._valid_radius = self._widest_angle(float(farthest))
        elif self.distorts:
            self._valid_radius = self._checked_radius()

    def to_pixels(self, normalized: ArrayLike) -> FloatArray:
        """`(..., 2)` pixels of `(..., 2)` normalized image coordinates."""
        given = np.asarray(normalized, dtype=np.float64)
        return project(np.ascontiguousarray(given.reshape(-1, 2)), self.numbers).reshape(given.shape)

    @property
    def numbers(self) -> LensNumbers:
        """All numbers of the lens, for kernels."""
        coefficients = np.append(self.coefficients, np.zeros(8 - len(self.coefficients))).tolist()
        return *focal_and_centre(self.K), *coefficients, self._valid_radius, float(self.equidistant) + float(self.wide)

    def rays(self, pixels: ArrayLike) -> FloatArray:
        """`(..., 3)` directions of `(..., 2)` pixels: of a wide lens of length 1, else with 1 along the axis."""
        if not self.wide:
            normalized = self.to_normalized(pixels)
            return np.concatenate([normalized, np.ones((*normalized.shape[:-1], 1))], axis=-1)
        scaled = (np.asarray(pixels, dtype=np.float64) - self.K[:2, 2]) / self.K[(0, 1), (0, 1)]
        height = np.hypot(scaled[..., 0], scaled[..., 1])
        angle: FloatArray = np.interp(height, self._height(self._risen), self._risen)
        for _ in range(_NEWTON_STEPS):
            angle = angle - (self._height(angle) - height) / self._slope(angle)
        across = np.divide(np.sin(angle), height, out=np.ones_like(height), where=height > 0.0)
        return np.concatenate([across[..., None] * scaled, np.cos(angle)[..., None]], axis=-1)

    def _height(self, angle_rad: ArrayLike) -> FloatArray:
        """Image height of an equidistant lens [focal lengths]."""
        angle = np.asarray(angle_rad, dtype=np.float64)
        return angle * (1.0 + angle[..., None] ** _POWERS @ self.coefficients)

    def _slope(self, angle_rad: FloatArray) -> FloatArray:
        return 1.0 + angle_rad[..., None] ** _POWERS @ (self.coefficients * (3, 5, 7, 9))

    def to_normalized(self, pixels: ArrayLike) -> FloatArray:
        """`(..., 2)` normalized image coordinates of `(..., 2)` pixels in the image or just beside it."""
        fx, fy, cx, cy = focal_and_centre(self.K)
        given = np.asarray(pixels, dtype=np.float64)
        if not self.distorts:
            return (given - (cx, cy)) / (fx, fy)
        flat = np.ascontiguousarray(given.reshape(-1, 1, 2))
        undistort = cv2.fisheye.undistortPoints if self.equidistant else cv2.undistortPoints
        undistorted = undistort(flat, self.K, self.coefficients, criteria=_INVERSION_CRITERIA)
        return np.asarray(undistorted, dtype=np.float64).reshape(given.shape)

    def _risen_angle(self, angles: FloatArray) -> float:
        """The first of some angles from the axis from which the image height no longer rises, or the last [rad]."""
        falls = self._slope(angles) < _LEAST_SCALE
        return float(angles[np.argmax(falls) if falls.any() else -1])

    def _widest_angle(self, farthest: float) -> float:
        """Angle beyond the farthest corner of a wide lens's image; `ParameterError` where it does not see there."""
        width, height = self.size
        risen = self._risen_angle(_WIDE_ANGLES)
        self._risen = _WIDE_ANGLES[: np.searchsorted(_WIDE_ANGLES, risen)]
        seen = self._risen[: np.searchsorted(self._risen, _WIDEST_RAD)]
        if not farthest < self._height(seen[-1]):
            raise ParameterError(
                f"the equidistant lens k1, k2, k3, k4 = {[round(float(k), 6) for k in self.coefficients]} sees up to "
                f"{np.rad2deg(seen[-1]):.0f} degrees off its axis, and a corner of the {width} x {height} image is "
                "farther out: crop the image, or take a larger focal length"
            )
        return min(_SEEN * float(np.interp(farthest, self._height(seen), seen)), risen)

    def _checked_radius(self) -> float:
        """Radius up to which the polynomial is used; raises `ParameterError` where it is not invertible up to there."""
        width, height = self.size
        names = _EQUIDISTANT if self.equidistant else ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
        not_invertible = ParameterError(
            f"the lens {', '.join(names[: len(self.coefficients)])} = "
            f"{[round(float(k), 6) for k in self.coefficients]} is not invertible "
            f"over the {width} x {height} image; weaken it, or narrow the field of view"
        )
        columns, rows = np.meshgrid(np.linspace(0.0, width, 33), np.linspace(0.0, height, 25))
        pixels = np.stack([columns, rows], axis=-1)
        normalized = self.to_normalized(pixels)
        if not np.isfinite(normalized).all():
            raise not_invertible
        radii = np.sqrt((normalized**2).sum(axis=-1))
        if not np.abs(self.to_pixels(normalized) - pixels).max() < _ROUND_TRIP_PX:
            raise not_invertible
        if self.equidistant:
            return self._valid_radius
        radius = _VALID_RADII * float(radii.max())
        # The Jacobian keeps its sign from the centre to the radius.
        angles, radii = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, 48), np.linspace(1e-3, radius, 64))
        disc = np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=-1)
        steps = 2.0 * _STEP * self.K[(0, 1), (0, 1)]
        dx, dy = ((self.to_pixels(disc + h) - self.to_pixels(disc - h)) / steps for h in _STEP * np.eye(2))
        if not (dx[..., 0] * dy[..., 1] - dx[..., 1] * dy[..., 0]).min() > _LEAST_SCALE**2:
            raise not_invertible
        return radius


def distorts(coefficients: ArrayLike) -> bool:
    """Whether a lens of these coefficients is none of a pinhole."""
    return len(np.atleast_1d(coefficients)) == 4 or bool(np.any(coefficients))
