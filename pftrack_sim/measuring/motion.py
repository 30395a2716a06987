"""Rotation of the camera from frame to frame, from features of the static background.

Corners are followed by pyramidal Lucas-Kanade flow, forward and back (Shi and Tomasi 1994; Bouguet 2000). Their motion
is that of a rotating camera (Longuet-Higgins and Prazdny 1980) that drives towards a plane of any slope: three angles
and three coefficients of inverse depth. Of 200 rotations, each by two corners, the one that most of the image agrees
with is taken (RANSAC), so that people are left out while they fill less than half of the texture; a robust fit follows.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.calibration import Calibration
from pftrack_sim.core.photometry import DISPLAY_GAMMA
from pftrack_sim.core.records import Image
from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.features.camera_motion import CameraMotion

PARTS = 2
"""Fits of their own: the cells of either colour of a chessboard."""

_CELLS = (8, 6)  # Columns and rows of the image in which corners are looked for
_PER_CELL = 8
_BACK_PX = 0.5  # A corner that is not found again within this is not followed
_LEAST = 12  # Corners of the background, without which there is no rotation
_LEAST_SHARE = 0.4  # Of the corners
_LEAST_CELLS, _LEAST_COLUMNS = 8, 5  # Of 48 and of 8 that hold corners of the background: fewer may be a person
_GUESSES = 200


@dataclass(frozen=True, eq=False)
class Step:
    """What happened between two frames.

    Attributes:
        rotation: `(3,)` rotation vector of the camera in its own axes (pitch, yaw, roll) [rad]; NaN if unknown.
        parts: `(PARTS, 3)` the same from the corners of a part of the image each; NaN where there are too few.
        corners: Number of corners followed.
        share: Share of them that belong to the static background.
        sheared: `(2,)` how much more the bottom row has pitched and yawed than the top row [rad]; NaN if unknown.
        cells: Number of the 48 cells of the image with such corners.
        stops: `(2,)` change of the brightness of the same surfaces [EV], for a display's curve of tones and for film's;
            NaN if unknown.
        difference: Mean absolute difference of the two images as they are [grey levels].
    """

    rotation: FloatArray
    parts: FloatArray
    sheared: FloatArray
    corners: int
    share: float
    cells: int
    stops: FloatArray
    difference: float

    @property
    def known(self) -> bool:
        """Whether the rotation is known."""
        return bool(np.isfinite(self.rotation).all())


class MotionMeter:
    """Measures the rotation between successive images.

    Args:
        camera: Camera that takes them.
    """

    def __init__(self, camera: Calibration) -> None:
        self._K, self._distortion = camera.K, camera.distortion
        self._undistort = cv2.fisheye.undistortPoints if camera.equidistant else cv2.undistortPoints
        self._rng = np.random.default_rng(0)
        self._shift = CameraMotion(certainty_min=0.2)
        self._grey: NDArray[np.uint8] | None = None

    def step(self, image: Image, hidden: FloatArray | None = None) -> Step | None:
        """Motion since the previous image, `(H, W, 3)` uint8 RGB; None for the first.

        `hidden` is the box [px] of something known to move in the previous image: no corner is taken from it.
        """
        grey = np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
        shift = self._shift.shift(image)
        before, self._grey = self._grey, grey
        if before is None:
            return None
        first, second = _followed(before, grey, shift, hidden)
        difference = float(np.abs(before.astype(np.int16) - grey).mean())
        unknown = np.full(3, np.nan)
        nothing = Step(
            unknown, np.full((PARTS, 3), np.nan), unknown[:2], len(first), 0.0, 0, np.full(2, np.nan), difference
        )
        if len(first) < _LEAST:
            return nothing
        a, b = (self._undistort(one[:, None], self._K, self._distortion)[:, 0].astype(float) for one in (first, second))
        middle, flow = 0.5 * (a + b), b - a
        pixel = 1.0 / float(self._K[0, 0])
        errors = _consensus(middle, flow, pixel, self._rng)
        static, loose = errors < 1.5 * pixel, errors < 4.0 * pixel
        rotation, static = _robust(middle, flow, static, pixel)
        cells = _cell(first, grey.shape)
        occupied = len(np.unique(cells[static]))
        wide = len(np.unique(cells[static] % _CELLS[0])) >= _LEAST_COLUMNS
        stops = _stops(before, grey, first[static], second[static])
        seen = replace(nothing, share=float(static.mean()), cells=occupied, stops=stops)
        if static.sum() < _LEAST or seen.share < _LEAST_SHARE or occupied < _LEAST_CELLS or not wide:
            return seen
        parts = np.array([_robust(middle, flow, static & part, pixel)[0] for part in _parts(cells)])
        rows = 0.5 * (first + second)[:, 1] / grey.shape[0] - 0.5
        sheared = _robust(middle, flow, loose, pixel, rows)[0][-2:]
        return replace(seen, rotation=rotation[:3], parts=parts[:, :3], sheared=sheared)


def _followed(
    before: NDArray[np.uint8], after: NDArray[np.uint8], shift: FloatArray, hidden: FloatArray | None
) -> tuple[FloatArray, FloatArray]:
    """`(N, 2)` places of the same corners in both images [px], spread over the image."""
    height, width = before.shape
    mask = np.full(before.shape, 255, np.uint8)
    if hidden is not None and np.isfinite(hidden).all():
        left, top, right, bottom = np.rint([*hidden[:2], *(hidden[:2] + hidden[2:])]).astype(int).clip(0)
        mask[top:bottom, left:right] = 0
    found: list[FloatArray] = []
    columns, rows = (
        [side * place // count for place in range(count + 1)]
        for side, count in zip((width, height), _CELLS, strict=True)
    )
    for (top, bottom), (left, right) in itertools.product(itertools.pairwise(rows), itertools.pairwise(columns)):
        area = slice(top, bottom), slice(left, right)
        corners: Any = cv2.goodFeaturesToTrack(before[area], _PER_CELL, 0.05, 4.0, mask=mask[area], blockSize=5)
        if corners is not None:
            found.append(np.asarray(corners[:, 0], dtype=np.float64) + np.array([left, top]))
    if not found:
        return np.zeros((0, 2)), np.zeros((0, 2))
    points = np.concatenate(found).astype(np.float32)
    strong = cv2.cornerMinEigenVal(before, 5)[points[:, 1].astype(int), points[:, 0].astype(int)] > 2e-5
    points = points[strong]
    # A change of the light is no motion: flow compares brightness.
    scale = float(before.std()) / max(float(after.std()), 1.0)
    offset = float(before.mean()) - scale * float(after.mean())
    after = np.asarray(np.clip(np.rint(scale * after + offset), 0.0, 255.0), dtype=np.uint8)
    if not len(points):
        return np.zeros((0, 2)), np.zeros((0, 2))
    guess = (points + shift).astype(np.float32)
    there, forward = _flow(before, after, points, guess)
    back, backward = _flow(after, before, there, points.copy())
    good = forward & backward & (np.linalg.norm(back - points, axis=1) < _BACK_PX)
    good &= ((there >= 0) & (there <= np.array([width - 1, height - 1]))).all(axis=1)
    return points[good].astype(np.float64), there[good].astype(np.float64)


def _flow(
    before: NDArray[np.uint8], after: NDArray[np.uint8], points: NDArray[np.float32], guess: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Where `(N, 2)` points are in the second image, and which of them are found."""
    there, found, _ = cv2.calcOpticalFlowPyrLK(
        before, after, points, guess, winSize=(15, 15), maxLevel=2, flags=cv2.OPTFLOW_USE_INITIAL_FLOW
    )
    return np.asarray(there, dtype=np.float32), np.asarray(found)[:, 0] == 1


def _cell(points: FloatArray, shape: tuple[int, ...]) -> NDArray[np.intp]:
    """`(N,)` cell of each point, row by row."""
    column, row = (points / (shape[1], shape[0]) * _CELLS).astype(int).T
    return row.clip(0, _CELLS[1] - 1) * _CELLS[0] + column.clip(0, _CELLS[0] - 1)


def _parts(cells: NDArray[np.intp]) -> tuple[NDArray[np.bool_], ...]:
    """Which of the cells belong to each part."""
    row, column = np.divmod(cells, _CELLS[0])
    black = (row + column) % 2 == 0
    return black, ~black


def _rotational(at: FloatArray) -> FloatArray:
    """`(N, 2, 3)` flow at normalised coordinates for a rotation about x, y and z."""
    x, y = at.T
    return np.stack(
        [np.stack([x * y, -(1.0 + x * x), y], axis=-1), np.stack([1.0 + y * y, -x * y, -x], axis=-1)], axis=1
    )


def _consensus(at: FloatArray, flow: FloatArray, pixel: float, rng: np.random.Generator) -> FloatArray:
    """`(N,)` errors of the points under the rotation that most agree with, within 1.5 px."""
    basis = _rotational(at)
    pairs = rng.integers(len(at), size=(_GUESSES, 2))
    matrices = basis[pairs].reshape(_GUESSES, 4, 3)
    guesses = np.linalg.pinv(matrices) @ flow[pairs].reshape(_GUESSES, 4, 1)
    errors = np.linalg.norm(flow - np.einsum("nij,gj->gni", basis, guesses[..., 0]), axis=2)
    losses = np.minimum(errors, 1.5 * pixel).sum(axis=1)
    return errors[losses.argmin()]


def _robust(
    at: FloatArray, flow: FloatArray, chosen: NDArray[np.bool_], pixel: float, rows: FloatArray | None = None
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """The rotation that fits the chosen points, `(3,)` [rad], and which of all points agree with it.

    Tukey's weights of a scale from the median, and a translation towards a plane, whose flow is
    (x, y) times an inverse depth linear in x and y.
    """
    if chosen.sum() < _LEAST // 2:
        return np.full(8, np.nan), chosen
    towards = at[:, :, None] * np.stack([np.ones(len(at)), *at.T], axis=-1)[:, None]
    basis = np.concatenate([_rotational(at), towards], axis=2)
    if chosen.sum() < 2 * _LEAST:
        basis = basis[:, :, :4]
    if rows is not None:
        basis = np.concatenate([basis, rows[:, None, None] * basis[:, :, :2]], axis=2)
    weights = chosen.astype(np.float64)
    solution, errors, scale = np.zeros(basis.shape[2]), np.zeros(len(at)), 0.0
    for _ in range(6):
        root = np.sqrt(weights)[:, None]
        rows = (basis * root[..., None]).reshape(-1, basis.shape[2])
        solution = np.asarray(np.linalg.lstsq(rows, (flow * root).ravel(), rcond=None)[0], dtype=np.float64)
        errors = np.asarray(np.linalg.norm(flow - basis @ solution, axis=1), dtype=np.float64)
        scale = max(4.7 * 0.85 * float(np.median(errors[chosen])), 0.15 * pixel)
        weights = np.where(chosen, (1.0 - np.minimum(errors / scale, 1.0) ** 2) ** 2, 0.0)
    return solution, errors < max(scale, 0.5 * pixel)


def _stops(before: NDArray[np.uint8], after: NDArray[np.uint8], first: FloatArray, second: FloatArray) -> FloatArray:
    """Median change of brightness around the points [EV] by both curves, of those that are neither black nor bright."""
    a, b = (
        np.asarray(cv2.blur(image, (7, 7)), dtype=np.float64)[points[:, 1].astype(int), points[:, 0].astype(int)]
        for image, points in ((before, np.rint(first)), (after, np.rint(second)))
    )
    usable = (a > 12.0) & (a < 200.0) & (b > 12.0) & (b < 200.0)
    if usable.sum() < _LEAST:
        return np.full(2, np.nan)
    a, b = a[usable], b[usable]
    return DISPLAY_GAMMA * np.median(np.log2([b / a, b * (255.0 - a) / (a * (255.0 - b))]), axis=1)
