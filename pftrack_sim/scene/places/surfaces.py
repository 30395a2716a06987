"""Materials and textures of the places, by name.

A skin is a tiling surface (`TILES`) or one cell of an atlas (`part("steel")`, `poster(3)`). Materials are made in the
spec the first time a shape that needs them is put there. The pictures are drawn by `assets/draw_textures.py`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import cv2
import mujoco
import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.core.data_files import assets_dir
from pftrack_sim.core.errors import PftrackError
from pftrack_sim.scene.layout import SKY
from pftrack_sim.scene.places.shapes import Array

SHINING = "glow"
"""Prefix of materials that shine by themselves; `glow-lamp` follows the lamps."""


@dataclass(frozen=True)
class Tiles:
    """A surface that repeats.

    Attributes:
        material: Name of the material.
        width_m: Width of one repeat.
        height_m: Height of one repeat.
    """

    material: str
    width_m: float
    height_m: float

    def mapped(self, unit: Array, size_m: ArrayLike) -> Array:
        """`(N, 2)` repeats of the texture at `(N, 2)` positions in the unit square of a face."""
        return unit * (np.asarray(size_m) / (self.width_m, self.height_m))


@dataclass(frozen=True)
class Cell:
    """One picture of an atlas, stretched over a face.

    Attributes:
        material: Name of the material.
        column: From the left.
        row: From the top.
        columns: Cells across the atlas.
        rows: Cells down the atlas.
    """

    material: str
    column: int
    row: int
    columns: int
    rows: int

    def mapped(self, unit: Array, size_m: ArrayLike) -> Array:
        """`(N, 2)` coordinates in the atlas; the rim is left out, where neighbours bleed in at a distance."""
        inner = 0.03 + 0.94 * unit
        return (inner + np.array([self.column, self.rows - 1 - self.row])) / np.array([self.columns, self.rows])


_TILES = {
    "paving": Tiles("paving", 3.2, 3.2),
    "pavement": Tiles("pavement", 2.0, 2.0),
    "asphalt": Tiles("asphalt", 4.0, 4.0),
    "concrete": Tiles("concrete", 6.0, 6.0),
    "linoleum": Tiles("linoleum", 2.4, 2.4),
    "corridor-wall": Tiles("corridor-wall", 3.0, 2.8),
    "ceiling": Tiles("glow-lamp-ceiling", 1.2, 1.2),
    "roof": Tiles("glow-lamp-roof", 2.0, 2.0),
    "brick": Tiles("brick", 1.9, 1.9),
    "cladding": Tiles("cladding", 2.0, 2.0),
}

# Row by row, in the order of `assets/parts.py`.
_PARTS: tuple[str, ...] = (
    "wood-light", "wood-dark", "wood-green", "wood-plain", "steel", "steel-dark", "steel-blue", "paint-orange",
    "paint-red", "paint-yellow", "hazard", "rubber", "chrome", "white", "paint-silver", "paint-blue",
    "carton-plain", "carton-label", "carton-arrows", "carton-fragile", "carton-logo", "carton-white", "carton-blue",
    "wrapped",
    "leaves-dark", "leaves-light", "hedge", "bark", "soil", "flowers-red", "flowers-yellow", "terracotta",
    "side-glass", "front-glass", "nose", "tail", "wheel", "concrete", "stone", "awning-red",
    "awning-green", "awning-blue", "awning-sand", "fabric-red", "fabric-blue", "fabric-green", "radiator", "grille",
    "books", "magazines", "clock", "door-wood", "door-window", "door-red", "fruit", "sign-exit",
    "sign-stop", "sign-parking", "sign-aisle", "slats", "paint-green", "paint-maroon", "paint-black", "paint-cream",
)  # fmt: skip

FACADES = ("brick", "cream", "rose", "office")
CARTONS = (*(name for name in _PARTS if name.startswith("carton")), "wrapped")
CAR_PAINTS = (
    "paint-silver",
    "paint-blue",
    "paint-red",
    "paint-green",
    "paint-maroon",
    "paint-black",
    "paint-cream",
    "white",
)


def tiles(name: str) -> Tiles:
    """A surface that repeats: `"paving"`, `"brick"`, ..."""
    return _TILES[name]


def part(name: str) -> Cell:
    """A small surface for furniture: `"steel"`, `"wood-dark"`, `"carton-label"`, ..."""
    row, column = divmod(_PARTS.index(name), 8)
    return Cell("parts", column, row, 8, 8)


def poster(index: int) -> Cell:
    """One of 16 posters; 7 and 15 are notice boards."""
    row, column = divmod(index % 16, 4)
    return Cell("posters", column, row, 4, 4)


def facade(kind: str) -> Cell:
    """12 m x 9 m of upper floors of a kind in `FACADES`."""
    row, column = divmod(FACADES.index(kind), 2)
    return Cell("facades", column, row, 2, 2)


def shops(index: int) -> Cell:
    """12 m x 3.6 m of ground floor with three shops; 4 to choose from."""
    return Cell("shops", 0, index % 4, 1, 4)


def lit(kind: str, index: int = 0) -> Cell:
    """What shines: `"window"`, `"display"` and `"neon"` (4 each), `"panel"`, `"warm"`, `"cold"`, `"red"`."""
    rows = {"window": 0, "display": 1, "neon": 2}
    if kind in rows:
        return Cell("glow", index % 4, rows[kind], 4, 4)
    lamp = "glow" if kind == "red" else "glow-lamp"
    return Cell(lamp, ("panel", "warm", "cold", "red").index(kind), 3, 4, 4)


# Tint of the grey pictures, and how much a surface shines in the sun.
_TINTS = {
    "asphalt": (0.62, 0.63, 0.66),
    "pavement": (0.93, 0.91, 0.87),
    "cladding": (0.72, 0.80, 0.86),
    "glow-lamp-roof": (0.72, 0.80, 0.86),
}
_FILES = {"glow-lamp": "glow", "glow-lamp-ceiling": "ceiling", "glow-lamp-roof": "cladding"}
# Lamps that shine downwards light no ceiling; what the floor throws back at it is this.
_EMISSION = {"glow-lamp-ceiling": 0.38, "glow-lamp-roof": 0.12}


def add_material(spec: mujoco.MjSpec, name: str) -> None:
    """Make a material and its texture in the spec, once.

    Raises:
        PftrackError: The picture is missing from the installation.
    """
    if any(material.name == name for material in spec.materials):
        return
    picture = _FILES.get(name, name)
    if not any(texture.name == picture for texture in spec.textures):
        _add_texture(spec, picture, mujoco.mjtTexture.mjTEXTURE_2D)
    material = spec.add_material(name=name)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = picture
    material.rgba = (*_TINTS.get(name, (1.0, 1.0, 1.0)), 1.0)
    # Light is computed per vertex: highlights on large triangles would only look wrong.
    material.specular = 0.0
    material.shininess = 0.0
    material.emission = _EMISSION.get(name, 0.85 if name.startswith(SHINING) else 0.0)


def add_sky(spec: mujoco.MjSpec, name: str) -> None:
    """Put up a sky: `"sky-day"` or `"sky-night"`."""
    _add_texture(spec, name, mujoco.mjtTexture.mjTEXTURE_SKYBOX)
    spec.add_material(name=SKY).emission = 1.0


def _add_texture(spec: mujoco.MjSpec, name: str, kind: mujoco.mjtTexture) -> None:
    pixels, width, height = _picture(name)
    texture = spec.add_texture(name=name, type=kind, width=width, height=height, nchannel=3)
    texture.data = pixels


@cache
def _picture(name: str) -> tuple[bytes, int, int]:
    # Decoded once per process: a reset is then a copy.
    path = assets_dir() / "textures" / f"{name}.png"
    image = cv2.imread(str(path), cv2.IMREAD_COLOR_RGB)
    if image is None:
        raise PftrackError(f"texture {name!r} cannot be read from {path}: the installation is incomplete")
    return np.ascontiguousarray(image).tobytes(), image.shape[1], image.shape[0]
