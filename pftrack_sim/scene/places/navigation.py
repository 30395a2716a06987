"""Occupancy grid of a room from a file, and the walkable area whose footprints cover its occupied cells."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import islice
from typing import NamedTuple, cast

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

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
_ALONG_RAD = math.radians(0.5)  # Walls at a smaller angle to the rows are along them


class Grid(NamedTuple):
    """Occupancy grid on the ground.

    Attributes:
        blocked: `(rows, columns)` whether a cell is occupied.
        corner_m: x, y of the outer corner of the first cell.
        cell_m: Their size.
        yaw_rad: Angle of the rows to the world's x.
    """

    blocked: BoolArray
    corner_m: tuple[float, float]
    cell_m: float
    yaw_rad: float = 0.0

    def coarser(self) -> Grid:
        """The same with cells of twice the size."""
        rows, columns = self.blocked.shape
        even = np.pad(self.blocked, ((0, rows % 2), (0, columns % 2)), constant_values=True)
        halves = even.reshape(even.shape[0] // 2, 2, even.shape[1] // 2, 2)
        return self._replace(blocked=np.asarray(halves.any(axis=(1, 3))), cell_m=2.0 * self.cell_m)

    def xy(self, rows: ArrayLike, columns: ArrayLike) -> FloatArray:
        """`(N, 2)` places of N rows and columns, which count from the outer corner of the first cell [m]."""
        cosine, sine = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        local = self.cell_m * np.column_stack([np.asarray(columns), np.asarray(rows)])
        return local @ np.array([[cosine, sine], [-sine, cosine]]) + self.corner_m

    def turned(self, angle_rad: float) -> Grid:
        """The same with its cells along other axes; what is outside is blocked."""
        (rows, columns), turn = self.blocked.shape, self._replace(yaw_rad=angle_rad, corner_m=(0.0, 0.0), cell_m=1.0)
        corners = turn._replace(yaw_rad=-angle_rad).xy([0, 0, rows, rows], [0, columns, 0, columns])
        low: FloatArray = np.floor(corners.min(axis=0))
        width, height = (int(one) for one in np.ceil(corners.max(axis=0) - low).tolist())
        blocked = np.zeros(height * width, dtype=bool)
        row, column = np.indices((height, width)).reshape(2, -1)
        # A cell is blocked where one is that it overlaps by more than a little.
        for down, across in ((0.5, 0.5), (0.2, 0.2), (0.2, 0.8), (0.8, 0.2), (0.8, 0.8)):
            places = np.floor(turn.xy(row + down + low[1], column + across + low[0])).astype(np.intp)
            inside = ((places >= 0) & (places < (columns, rows))).all(axis=1)
            blocked |= ~inside
            blocked[inside] |= self.blocked[places[inside, 1], places[inside, 0]]
        x, y = self.xy(*np.split(turn.xy(low[1], low[0])[:, ::-1], 2, axis=1))[0].tolist()
        return Grid(blocked.reshape(height, width), (x, y), self.cell_m, self.yaw_rad + angle_rad)

    def walls_rad(self) -> float:
        """Angle of most of the borders to the rows, from -45 to 45 degrees."""
        smooth = cv2.GaussianBlur(self.blocked.astype(np.float32), (0, 0), 1.5)
        slope = cv2.Sobel(smooth, cv2.CV_64F, 1, 0) + 1j * cv2.Sobel(smooth, cv2.CV_64F, 0, 1)
        fourth = (slope**4 / np.maximum(np.abs(slope), 1e-9) ** 2).sum()
        return float(np.angle(fourth)) / 4.0


def area_of(grid: Grid) -> WalkableArea:
    """Footprints of all that stands in the way, bounds of the rest, and goals in its largest part.

    Rectangles lie along the rows or along most of the walls; where it still takes many, cells are made coarser, up to
    0.2 m.

    Raises:
        ParameterError: There is no room for a person, or it takes too many rectangles.
    """
    while True:
        tried = [grid, grid.turned(grid.walls_rad())] if abs(grid.walls_rad()) > _ALONG_RAD else [grid]
        ways = [(one, *_ways(one)) for one in tried]
        # What is reached from no side may be covered or not.
        most = _FEW_RECTANGLES if grid.cell_m < 0.11 else _MOST_RECTANGLES
        covers = [
            list(islice(rectangles(one.blocked & (away_m < _NEAR_M), one.blocked | (away_m > BODY_M)), most + 1))
            for one, away_m, _ in ways
        ]
        (used, away_m, goals), boxes = min(zip(ways, covers, strict=True), key=lambda pair: len(pair[1]))
        if len(boxes) <= most:
            break
        if most == _MOST_RECTANGLES:
            raise ParameterError(
                f"what stands in the way takes more than {most} rectangles of cells of {grid.cell_m:g} m: cut a part "
                "out of it, or take small things away"
            )
        grid = grid.coarser()
    edges = np.array(boxes).reshape(-1, 4)
    middles = used.xy(edges[:, :2].mean(axis=1), edges[:, 2:].mean(axis=1)).tolist()
    halves = (0.5 * used.cell_m * np.column_stack([edges[:, 3] - edges[:, 2], edges[:, 1] - edges[:, 0]])).tolist()
    footprints = [
        Footprint(f"obstacle-{number}", (x, y), (half_x, half_y), used.yaw_rad, HEAD_M)
        for number, ((x, y), (half_x, half_y)) in enumerate(zip(middles, halves, strict=True), start=1)
    ]
    rows, columns = np.nonzero(~used.blocked & (away_m <= BODY_M))
    corners = np.concatenate([used.xy(rows + down, columns + across) for down in (0, 1) for across in (0, 1)])
    bounds: list[float] = [*corners.min(axis=0).tolist(), *corners.max(axis=0).tolist()]
    rows, columns = np.nonzero(goals)
    spread = _spread(used.xy(rows + 0.5, columns + 0.5)).tolist()
    return WalkableArea(
        (bounds[0], bounds[1], bounds[2], bounds[3]),
        tuple(footprints),
        tuple((round(x, 3), round(y, 3)) for x, y in spread),
    )


def _ways(grid: Grid) -> tuple[FloatArray, BoolArray]:
    """Distance of each cell to the free configuration space of a person [m], and cells of goals in its largest part."""
    free = np.pad(~grid.blocked, 1).astype(np.uint8)
    away_m = grid.cell_m * (cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)[1:-1, 1:-1] - 0.5)
    middles = (away_m >= BODY_M).astype(np.uint8)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(middles, connectivity=4)
    areas = stats[:, cv2.CC_STAT_AREA] * grid.cell_m**2
    areas[0] = 0.0
    if areas.max() < _LEAST_M2:
        row, column = np.unravel_index(int(away_m.argmax()), away_m.shape)
        (x, y), room = grid.xy(row + 0.5, column + 0.5)[0], max(2.0 * float(away_m.max()), 0.0)
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
