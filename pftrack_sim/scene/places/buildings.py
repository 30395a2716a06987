"""House fronts with awnings, balconies and lit windows, and the fronts of a station hall."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pftrack_sim.scene.places.catalogue import load_prop
from pftrack_sim.scene.places.materials import texture
from pftrack_sim.scene.places.meshes import ALL_FACES, SIDES, Prop, TexturedMesh, box, quad, translated

_WIDTH_M = 12.0
_SHOP_HEIGHT_M = 3.6
_STOREY_HEIGHT_M = 3.0


def house(
    rng: np.random.Generator,
    kind: str,
    shop: int,
    awning: str = "",
    balconies: bool = False,
    storeys: int = 3,
    lit: bool = False,
    fine: bool = False,
) -> Prop:
    """A front of three shops and upper floors, 12 m wide from x = 0, that faces -y at y = 0.

    `kind` is that of the upper floors: `"brick"`, `"cream"`, `"rose"` or `"office"`; `shop` the image of the shops, 0
    to 3; `awning` the cloth of their awnings, if they have any; `storeys` the floors above them, 1 to 3. If `lit`, some
    windows emit light. `fine` subdivides the walls for street lamps: light is computed per vertex.
    """
    stone = texture("stone")
    height = _STOREY_HEIGHT_M * storeys
    top = _SHOP_HEIGHT_M + height
    shop_cells, wall_cells = ((12, 3), (8, 3)) if fine else ((1, 1), (1, 1))
    wall = quad(texture(f"facade-{kind}"), (0, 0, _SHOP_HEIGHT_M), (_WIDTH_M, 0, 0), (0, 0, height), wall_cells)
    # Fewer storeys show the lower part of the image.
    v = wall.uv[:, 1]
    shown = v.min() + (v - v.min()) * storeys / 3.0
    meshes = [
        quad(texture(f"shops-{shop}"), (0, 0, 0), (_WIDTH_M, 0, 0), (0, 0, _SHOP_HEIGHT_M), shop_cells),
        replace(wall, uv=np.column_stack([wall.uv[:, 0], shown])),
        box(stone, (0.5 * _WIDTH_M, -0.1, _SHOP_HEIGHT_M + 0.12), (_WIDTH_M, 0.3, 0.24), ALL_FACES),
        box(stone, (0.5 * _WIDTH_M, -0.2, top), (_WIDTH_M, 0.6, 0.36), ALL_FACES),
        box(texture("steel-dark"), (0.5 * _WIDTH_M, 0.6, top + 0.3), (_WIDTH_M, 1.4, 0.5), ALL_FACES),
        box(texture("steel"), (0.06, -0.08, 0.5 * top), (0.12, 0.12, top), SIDES),
        # Side walls, visible along a gap between houses.
        quad(texture("concrete"), (0, 10.0, 0), (0, -10.0, 0), (0, 0, top)),
        quad(texture("concrete"), (_WIDTH_M, 0, 0), (0, 10.0, 0), (0, 0, top)),
    ]
    if awning:
        for index in range(3):
            meshes += translated(load_prop("awning", cloth=awning), index * _WIDTH_M / 3.0 + 0.2, 0.0)
    if balconies:
        for index in range(4):
            meshes += translated(load_prop("balcony"), (index + 0.5) * _WIDTH_M / 4.0, 0.0, _SHOP_HEIGHT_M + 0.55)
    if lit:
        meshes += _lit_windows(rng, storeys)
    return tuple(meshes)


def _lit_windows(rng: np.random.Generator, storeys: int) -> Prop:
    """Lit shop windows, neon signs and windows of flats; the positions match the images of the fronts."""
    meshes: list[TexturedMesh] = []
    shop_width = _WIDTH_M / 3.0
    for index in range(3):
        left = index * shop_width
        if rng.random() < 0.62:
            for start in (0.04, 0.616):
                display = texture(f"display-{rng.integers(4)}")
                corner = (left + start * shop_width, -0.03, 0.46)
                meshes.append(quad(display, corner, (0.33 * shop_width, 0, 0), (0, 0, 2.1)))
        if rng.random() < 0.4:
            neon = texture(f"neon-{rng.integers(4)}")
            meshes.append(box(neon, (left + 0.5 * shop_width, -0.5, 3.1), (0.9, 0.9, 0.62), ("-y", "+x", "-x")))
    for storey in range(storeys):
        for column in range(4):
            if rng.random() < 0.28:
                x, z = (column + 0.5) * _WIDTH_M / 4.0, _SHOP_HEIGHT_M + _STOREY_HEIGHT_M * storey + 0.72
                window = texture(f"window-{rng.integers(4)}")
                meshes.append(quad(window, (x - 0.55, -0.03, z), (1.1, 0, 0), (0, 0, 1.5)))
    return tuple(meshes)


def station_front(length: float, first: int) -> Prop:
    """Shops up to 3.6 m, from image `first` on, a ledge, and windows up to a roof at 7 m; at y = 0, facing -y."""
    count, start, upper = max(2, round(length / 12.0)), -0.5 * length, 7.0 - _SHOP_HEIGHT_M
    step, windows = length / count, max(2, round(length / 3.0))
    pane, sill = length / windows, _SHOP_HEIGHT_M + 0.8
    shops = [
        quad(texture(f"shops-{(first + k) % 4}"), (start + k * step, 0, 0), (step, 0, 0), (0, 0, 3.6), (10, 3))
        for k in range(count)
    ]
    lights = [
        quad(texture("lamp-cold"), (start + (k + 0.12) * pane, -0.03, sill), (0.76 * pane, 0, 0), (0, 0, 2))
        for k in range(windows)
    ]
    return (
        *shops,
        quad(texture("cladding"), (start, 0, _SHOP_HEIGHT_M), (length, 0, 0), (0, 0, upper), (windows, 3)),
        box(texture("stone"), (0, -0.15, _SHOP_HEIGHT_M + 0.1), (length, 0.4, 0.3), ALL_FACES),
        *lights,
    )
