"""Where people and robot may go in a room from a file: a grid of cells, merged into the rectangles of its area."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple, cast

import cv2
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.types import BoolArray, FloatArray, IntArray
from pftrack_sim.scene.layout import Footprint, WalkableArea

ANKLE_M, HEAD_M = 0.15, 2.0
"""Heights above the floor between which whatever there is stands in the way."""

MOST_M = 250.0
"""Longest side of a room."""

BODY_M = 0.4
"""Half the width that people need: that of their routes."""

_NEAR_M = 0.75  # Distance from the middles of people within which obstacles matter to them
_GOAL_M = 0.5  # Distance of goals from everything

_LEAST_M2 = 1.0  # Of the middles of people: a smaller place is none
_MOST_RECTANGLES, _FEW_RECTANGLES = 600, 160
_GOALS = 14


class Grid(NamedTuple):
    """Cells on the ground.

    Attributes:
        blocked: `(rows, columns)` cells that nobody can stand in; rows count along y.
        corner_m: x, y of the lowest corner of the first.
        cell_m: Their size.
    """

    blocked: BoolArray
    corner_m: tuple[float, float]
    cell_m: float

    def coarser(self) -> Grid:
        """The same with cells of twice the size."""
        rows, columns = self.blocked.shape
        even = np.pad(self.blocked, ((0, rows % 2), (0, columns % 2)), constant_values=True)
        halves = even.reshape(even.shape[0] // 2, 2, even.shape[1] // 2, 2)
        return Grid(np.asarray(halves.any(axis=(1, 3))), self.corner_m, 2.0 * self.cell_m)

    def xy(self, rows: IntArray, columns: IntArray) -> FloatArray:
        """`(N, 2)` middles of cells [m]."""
        middles: FloatArray = np.column_stack([columns + 0.5, rows + 0.5]).astype(np.float64)
        return middles * self.cell_m + self.corner_m


def area_of(grid: Grid) -> WalkableArea:
    """Footprints of all that stands in the way, bounds of the rest, and goals in its largest part.

    Cells are made coarser, up to 0.2 m, where it takes many rectangles to cover them.

    Raises:
        ParameterError: There is no room for a person, or it takes too many rectangles.
    """
    while True:
        away_m, goals = _ways(grid)
        # What is reached from no side may be covered or not.
        boxes = list(rectangles(grid.blocked & (away_m < _NEAR_M), grid.blocked | (away_m > BODY_M)))
        if len(boxes) <= _FEW_RECTANGLES or grid.cell_m > 0.11:
            break
        grid = grid.coarser()
    if len(boxes) > _MOST_RECTANGLES:
        raise ParameterError(f"what stands in the way takes {len(boxes)} rectangles, at most {_MOST_RECTANGLES}")
    cell, (x, y) = grid.cell_m, grid.corner_m
    footprints = [
        Footprint(
            f"obstacle-{number}",
            (x + 0.5 * cell * (left + right), y + 0.5 * cell * (low + high)),
            (0.5 * cell * (right - left), 0.5 * cell * (high - low)),
            height_m=HEAD_M,
        )
        for number, (low, high, left, right) in enumerate(boxes, start=1)
    ]
    rows, columns = np.nonzero(~grid.blocked & (away_m <= BODY_M))
    bounds = (
        x + cell * float(columns.min()),
        y + cell * float(rows.min()),
        x + cell * float(columns.max() + 1),
        y + cell * float(rows.max() + 1),
    )
    spread = _spread(grid.xy(*np.nonzero(goals))).tolist()
    return WalkableArea(bounds, tuple(footprints), tuple((round(x, 3), round(y, 3)) for x, y in spread))


def _ways(grid: Grid) -> tuple[FloatArray, BoolArray]:
    """Distance of each cell from the middles of people [m], and cells of goals, in the largest connected place."""
    free = np.pad(~grid.blocked, 1).astype(np.uint8)
    away_m = grid.cell_m * (cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)[1:-1, 1:-1] - 0.5)
    middles = (away_m >= BODY_M).astype(np.uint8)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(middles, connectivity=4)
    areas = stats[:, cv2.CC_STAT_AREA] * grid.cell_m**2
    areas[0] = 0.0
    if areas.max() < _LEAST_M2:
        row, column = np.unravel_index(int(away_m.argmax()), away_m.shape)
        (x, y), room = grid.xy(np.array([row]), np.array([column]))[0], max(2.0 * float(away_m.max()), 0.0)
        raise ParameterError(
            f"there is no room for a person: the widest free place, at {x:.1f}, {y:.1f}, is {room:.1f} m wide, "
            f"and {2.0 * BODY_M:.1f} m are needed, with {_LEAST_M2:g} m2 to move in"
        )
    largest = labels == int(areas.argmax())
    roomy = largest & (away_m >= _GOAL_M)
    large = np.isin(labels, np.flatnonzero(areas >= _LEAST_M2))
    to_middle = cv2.distanceTransform((~large).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return grid.cell_m * to_middle.astype(np.float64), roomy if roomy.any() else largest


def rectangles(wanted: BoolArray, allowed: BoolArray) -> Iterator[tuple[int, int, int, int]]:
    """Rectangles of allowed cells that cover all wanted ones: first and last row, first and last column, ends excluded.

    Each is the larger of the two that grow from the first cell left along its row, or its column, first.
    """
    left = wanted.copy()
    for row in range(len(left)):
        while left[row].any():
            column = int(left[row].argmax())
            low, high = _run(allowed[row], column)
            bottom, top = _run(np.asarray(allowed[:, low:high].all(axis=1)), row)
            wide = bottom, top, low, high
            bottom, top = _run(allowed[:, column], row)
            low, high = _run(np.asarray(allowed[bottom:top].all(axis=0)), column)
            tall = bottom, top, low, high
            best = max(wide, tall, key=lambda box: int(left[box[0] : box[1], box[2] : box[3]].sum()))
            left[best[0] : best[1], best[2] : best[3]] = False
            yield best


def _run(cells: NDArray[np.bool_], at: int) -> tuple[int, int]:
    """Begin and end of the run of true cells around one."""
    before, after = np.flatnonzero(~cells[:at]), np.flatnonzero(~cells[at:])
    return int(before[-1]) + 1 if len(before) else 0, at + int(after[0]) if len(after) else len(cells)


def _spread(points_m: FloatArray) -> FloatArray:
    """Some of `(N, 2)` points, each far from all before."""
    points_m = points_m[:: max(1, len(points_m) // 20_000)]
    chosen = [int(np.hypot(*(points_m - points_m.mean(axis=0)).T).argmin())]
    away_m = np.full(len(points_m), np.inf)
    for _ in range(min(_GOALS, len(points_m)) - 1):
        away_m = np.minimum(away_m, np.hypot(*(points_m - points_m[chosen[-1]]).T))
        chosen.append(int(away_m.argmax()))
    return points_m[chosen]


def grid_of(triangles_m: FloatArray, floor_m: float) -> Grid:
    """Grid of a room from its `(N, 3, 3)` triangles: cells without a floor are blocked, too.

    Raises:
        ParameterError: The room is too large.
    """
    corners = triangles_m[:, :, :2].reshape(-1, 2)
    low: FloatArray = corners.min(axis=0)
    size: FloatArray = corners.max(axis=0) - low
    if size.max() > MOST_M:
        raise ParameterError(f"it is {size.max():.0f} m long, at most {MOST_M:g} m")
    cell = 0.05 if size.max() <= 40.0 else 0.1
    columns, rows = (np.ceil(size / cell).astype(int) + 1).tolist()
    floor = np.zeros((rows, columns), np.uint8)
    for triangle in triangles_m[np.abs(triangles_m[:, :, 2] - floor_m).max(axis=1) < ANKLE_M]:
        pixels = (triangle[:, :2] - low) * (256.0 / cell) - 128.0
        cv2.fillConvexPoly(floor, np.rint(pixels).astype(np.int32), 1, shift=8)
    blocked = cast(BoolArray, floor == 0)
    x, y = ((_points_between(triangles_m, cell, floor_m + ANKLE_M, floor_m + HEAD_M) - low) / cell).astype(int).T
    blocked[y, x] = True
    return Grid(blocked, (float(low[0]), float(low[1])), cell)


def _points_between(triangles_m: FloatArray, cell_m: float, low_m: float, high_m: float) -> FloatArray:
    """`(N, 2)` points, no farther apart than a cell, on the parts of triangles between two heights."""
    found: list[FloatArray] = []
    while len(triangles_m):
        z = triangles_m[:, :, 2]
        triangles_m = triangles_m[(z.max(axis=1) > low_m) & (z.min(axis=1) < high_m)]
        sides = np.linalg.norm(triangles_m - np.roll(triangles_m, -1, axis=1), axis=2)
        small = sides.max(axis=1, initial=0.0) <= cell_m
        inside = triangles_m[small].reshape(-1, 3)
        found.append(inside[(inside[:, 2] >= low_m) & (inside[:, 2] <= high_m), :2])
        # The others are cut in two across their longest side.
        large, longest = triangles_m[~small], sides[~small].argmax(axis=1)
        a, b, c = (large[np.arange(len(large)), (longest + step) % 3] for step in range(3))
        middle = 0.5 * (a + b)
        triangles_m = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
    return np.concatenate(found) if found else np.empty((0, 2))


def floor_height_m(triangles_m: FloatArray) -> float:
    """Height of the lowest of the large level surfaces that face up.

    Raises:
        ParameterError: There is none.
    """
    normals = np.cross(triangles_m[:, 1] - triangles_m[:, 0], triangles_m[:, 2] - triangles_m[:, 0])
    area = 0.5 * np.linalg.norm(normals, axis=1)
    for level in (normals[:, 2] > 1.9 * area, np.abs(normals[:, 2]) > 1.9 * area):
        heights, weights = triangles_m[level, :, 2].mean(axis=1), area[level]
        if weights.sum() < 4.0 * _LEAST_M2:
            continue
        bins: IntArray = np.rint(heights / 0.05).astype(np.intp)
        areas = np.bincount(bins - bins.min(), weights)
        lowest = int(np.flatnonzero(areas >= 0.5 * areas.max())[0]) + bins.min()
        return float(np.average(heights[bins == lowest], weights=weights[bins == lowest]))
    raise ParameterError(
        "no floor was found: there are no level surfaces of 4 m2; is another axis up, or the scale wrong?"
    )
