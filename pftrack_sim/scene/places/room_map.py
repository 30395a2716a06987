"""Maps of ROS's map_server: a YAML file and an image, whose dark pixels are walls."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.calibration import numbers_of, yaml_storage
from pftrack_sim.core.data_files import asset_table
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.inputs import read_bytes
from pftrack_sim.core.types import BoolArray
from pftrack_sim.scenario.model import MapPlace
from pftrack_sim.scene.places.builder import Item
from pftrack_sim.scene.places.materials import texture
from pftrack_sim.scene.places.meshes import TexturedMesh, box, merged_by_material, quad, rotated, translated
from pftrack_sim.scene.places.navigation import BODY_M, MOST_M, Grid, area_of, rectangles
from pftrack_sim.scene.places.room import Room

_MOST_BYTES = 1 << 27
_MOST_WALLS = 8000
_SPECK = 3
_TILE_M = 8.0  # Walls in tiles of this size are one body: what is out of view is left out


def read_map(place: MapPlace) -> Room:
    """The rooms of a map, between walls of one height, a floor and a ceiling.

    Raises:
        ParameterError: The file or its image cannot be read, or there is no room for a person.
    """
    table = asset_table("places/room")
    grid, walls = _read(Path(place.model))
    # Of about 5 cm, where the map is finer.
    ways = grid
    while ways.cell_m <= 0.026:
        ways = ways.coarser()
    area = area_of(ways)
    tiles: dict[tuple[int, int], list[TexturedMesh]] = {}
    while len(boxes := _visible(walls, grid)) > _MOST_WALLS and walls.cell_m < 0.1:
        grid, walls = grid.coarser(), walls.coarser()
    if len(boxes) > _MOST_WALLS:
        raise ParameterError(f"the walls take {len(boxes)} boxes, at most {_MOST_WALLS}")
    (x, y), cell, height = walls.corner_m, walls.cell_m, place.wall_m
    for low, high, left, right in boxes:
        size = cell * (right - left), cell * (high - low), height
        centre = 0.5 * cell * (left + right), 0.5 * cell * (low + high), 0.5 * height
        tile = int(centre[0] // _TILE_M), int(centre[1] // _TILE_M)
        tiles.setdefault(tile, []).append(box(texture(table["wall"]), centre, size))
    items = [
        Item(f"wall-{number}", merged_by_material(translated(rotated(meshes, walls.yaw_rad), x, y)))
        for number, meshes in enumerate(tiles.values(), start=1)
    ]
    west, south, east, north = area.bounds_m
    corner, across, along = (west - 0.5, south - 0.5), east - west + 1.0, north - south + 1.0
    cells = max(1, round(across / 4.0)), max(1, round(along / 4.0))
    floor = quad(texture(table["floor"]), (*corner, 0.0), (across, 0, 0), (0, along, 0), cells)
    above = quad(
        texture(table["ceiling"]), (corner[0], corner[1] + along, height), (across, 0, 0), (0, -along, 0), cells
    )
    items += [Item("floor", (floor,), shadow=False), Item("ceiling", (above,), shadow=False)]
    return Room(area, tuple(items), sky=False)


def _read(path: Path) -> tuple[Grid, Grid]:
    """Grids of what is not free and of walls."""
    storage = yaml_storage(path)
    image, mode = storage.getNode("image").string(), storage.getNode("mode").string() or "trinary"
    cell = storage.getNode("resolution").real()
    origin = numbers_of(storage.getNode("origin"))
    if not image or mode != "trinary" or not 0.001 <= cell <= 2.0 or len(origin) != 3 or not np.isfinite(origin).all():
        raise ParameterError(
            f"needs image, resolution (0.001 to 2 m), origin [x, y, yaw] and mode trinary, as map_server "
            f"writes them; got image {image!r}, resolution {cell:g}, origin {origin.tolist()}, mode {mode!r}"
        )
    pixels = _pixels(path.parent / image)
    if max(pixels.shape) * cell > MOST_M:
        raise ParameterError(f"the map is {max(pixels.shape) * cell:.0f} m long, at most {MOST_M:g} m")
    dark = pixels / 255.0 if storage.getNode("negate").real() else 1.0 - pixels / 255.0
    occupied, free = (
        storage.getNode(key).real() if not storage.getNode(key).empty() else default
        for key, default in (("occupied_thresh", 0.65), ("free_thresh", 0.25))
    )
    dark[_specks(dark >= free)] = 0.0
    # Rows of the image count from the top.
    grid = Grid(dark[::-1] >= free, (float(origin[0]), float(origin[1])), cell, float(origin[2]))
    return grid, grid._replace(blocked=dark[::-1] > occupied)


def _specks(blocked: BoolArray) -> BoolArray:
    """Cells of the noise of a range finder: parts of at most `_SPECK` cells."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(blocked.astype(np.uint8), connectivity=8)
    small: BoolArray = np.asarray(stats[:, cv2.CC_STAT_AREA] <= _SPECK)
    return small[np.asarray(labels, dtype=np.intp)]


def _visible(walls: Grid, free: Grid) -> list[tuple[int, int, int, int]]:
    """Rectangles of the walls beside rooms that are wide enough for people: no others are seen."""
    _, labels = cv2.connectedComponents((~walls.blocked).astype(np.uint8), connectivity=4)
    away = cv2.distanceTransform((~free.blocked).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    rooms = np.unique(labels[away * free.cell_m >= BODY_M])
    beside = cv2.dilate(np.isin(labels, rooms[rooms > 0]).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    return list(rectangles(beside & walls.blocked, walls.blocked))


def _pixels(path: Path) -> NDArray[np.float64]:
    """`(H, W)` grey levels, 0 to 255."""
    try:
        image = cv2.imdecode(np.frombuffer(read_bytes(path, _MOST_BYTES), np.uint8), cv2.IMREAD_GRAYSCALE)
    except (OSError, cv2.error) as error:
        raise ParameterError(
            f"the map's image {path.name} cannot be read: {getattr(error, 'strerror', error)}"
        ) from None
    if image is None:
        raise ParameterError(f"the map's image {path.name} cannot be read: no PGM or PNG")
    return np.asarray(image, dtype=np.float64)
