"""Houses in a row: drawn fronts with what stands out of them."""

from __future__ import annotations

import numpy as np

from pftrack_sim.scene.places.shapes import ALL_FACES, SIDES, Piece, Shape, Skin, box, quad
from pftrack_sim.scene.places.surfaces import facade, lit, part, shops

HOUSE_WIDTH_M = 12.0
SHOP_HEIGHT_M = 3.6
FLOORS_HEIGHT_M = 9.0


def house(
    kind: str,
    shop: int,
    awning: str | None = None,
    balconies: bool = False,
    storeys: int = 3,
    lamps_on: np.random.Generator | None = None,
    width: float = HOUSE_WIDTH_M,
    finely: bool = False,
) -> Piece:
    """A front of three shops and upper floors, from x = 0 to `width`, that faces -y at y = 0.

    Args:
        kind: Upper floors, one of `surfaces.FACADES`.
        shop: Which strip of shops.
        awning: Cloth over the shop windows; None for none.
        balconies: Whether the first floor has balconies.
        storeys: Floors above the shops, 1 to 3.
        lamps_on: Night: draws which windows are lit; None is day.
        width: Up to 12 m; the pictures are squeezed, not cut.
        finely: Cut into small cells, so that street lamps can be seen on it: light is computed per vertex.
    """
    stone = part("stone")
    upper = facade(kind)
    height = FLOORS_HEIGHT_M * storeys / 3.0
    top = SHOP_HEIGHT_M + height
    low, high = ((12, 3), (8, 3)) if finely else ((1, 1), (1, 1))
    pieces: list[Shape] = [quad(shops(shop), (0, 0, 0), (width, 0, 0), (0, 0, SHOP_HEIGHT_M), low)]
    wall = quad(upper, (0, 0, SHOP_HEIGHT_M), (width, 0, 0), (0, 0, height), high)
    uv = wall.uv.copy()
    # Fewer storeys show the lower part of the picture.
    uv[:, 1] = uv[:, 1].min() + (uv[:, 1] - uv[:, 1].min()) * storeys / 3.0
    pieces.append(Shape(wall.material, wall.points, wall.normals, uv, wall.faces))
    pieces.append(box(stone, (0.5 * width, -0.1, SHOP_HEIGHT_M + 0.12), (width, 0.3, 0.24), ALL_FACES))
    pieces.append(box(stone, (0.5 * width, -0.2, top), (width, 0.6, 0.36), ALL_FACES))
    pieces.append(box(part("steel-dark"), (0.5 * width, 0.6, top + 0.3), (width, 1.4, 0.5), ALL_FACES))
    pieces.append(box(part("steel"), (0.06, -0.08, 0.5 * top), (0.12, 0.12, top), SIDES))
    for side in (0.0, width):
        # Side walls, for those who look along a gap.
        out = -1.0 if side == 0.0 else 1.0
        start = (side, 10.0 if out < 0 else 0.0, 0.0)
        pieces.append(quad(part("concrete"), start, (0, out * 10.0, 0), (0, 0, top)))
    third = width / 3.0
    if awning is not None:
        for index in range(3):
            left = index * third + 0.2
            pieces += _awning(part(awning), left, third - 0.4)
    if balconies:
        for index in range(4):
            pieces += _balcony((index + 0.5) * width / 4.0, SHOP_HEIGHT_M + 0.55)
    if lamps_on is not None:
        pieces += _night(lamps_on, width, storeys)
    return tuple(pieces)


def _awning(cloth: Skin, left: float, width: float) -> Piece:
    down, out = 0.55, 1.15
    high = 2.75
    return (
        quad(cloth, (left, -out, high - down), (width, 0, 0), (0, out, down)),
        quad(cloth, (left + width, -out, high - down), (-width, 0, 0), (0, out, down)),
        quad(cloth, (left, -out, high - down - 0.22), (width, 0, 0), (0, 0, 0.22)),
    )


def _balcony(x: float, z: float) -> Piece:
    iron = part("steel-dark")
    bars = [box(iron, (x - 0.8 + 0.2 * k, -0.85, z + 0.5), (0.03, 0.03, 0.9), SIDES) for k in range(9)]
    rails = [box(iron, (x, -0.85, z + 0.97), (1.7, 0.05, 0.05), ALL_FACES)]
    rails += [box(iron, (x + s * 0.83, -0.43, z + 0.97), (0.05, 0.85, 0.05), ALL_FACES) for s in (-1, 1)]
    box_of_flowers = box(part("flowers-red"), (x, -0.97, z + 0.75), (1.3, 0.2, 0.26), ALL_FACES)
    return (box(part("concrete"), (x, -0.43, z), (1.8, 0.9, 0.14), ALL_FACES), *bars, *rails, box_of_flowers)


def _night(rng: np.random.Generator, width: float, storeys: int) -> Piece:
    pieces: list[Shape] = []
    third = width / 3.0
    for index in range(3):
        left = index * third
        if rng.random() < 0.62:
            # Shop windows, where the picture of the front has them.
            for start in (0.04, 0.616):
                skin = lit("display", int(rng.integers(4)))
                pieces.append(quad(skin, (left + start * third, -0.03, 0.46), (0.33 * third, 0, 0), (0, 0, 2.1)))
        if rng.random() < 0.4:
            skin = lit("neon", int(rng.integers(4)))
            pieces.append(box(skin, (left + 0.5 * third, -0.5, 3.1), (0.9, 0.9, 0.62), ("-y", "+x", "-x")))
    for storey in range(storeys):
        for column in range(4):
            if rng.random() < 0.28:
                x = (column + 0.5) * width / 4.0
                z = SHOP_HEIGHT_M + 3.0 * storey + 0.72
                pieces.append(quad(lit("window", int(rng.integers(4))), (x - 0.55, -0.03, z), (1.1, 0, 0), (0, 0, 1.5)))
    return tuple(pieces)
