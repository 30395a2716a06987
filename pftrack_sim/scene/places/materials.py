"""Textures and materials of the places, by name.

A face shows a tiling texture (`tiling("paving")`) or one region of a texture atlas (`texture("steel")`).
`assets/draw_textures.py` draws the images. Materials whose name starts with "glow" emit light; those that start with
"glow-lamp" follow the brightness of the lamps.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from typing import TypeAlias

import cv2
import mujoco
import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.core.data_files import assets_dir
from pftrack_sim.core.errors import PftrackError
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scene.layout import SKY


@dataclass(frozen=True)
class TilingTexture:
    """A texture that repeats every `width_m` x `height_m`."""

    material: str
    width_m: float
    height_m: float

    def coordinates(self, unit: FloatArray, size_m: ArrayLike) -> FloatArray:
        """`(N, 2)` texture coordinates of `(N, 2)` positions in the unit square of a face.

        `size_m` is the width and height of the face, `(2,)` or one per position `(N, 2)`.
        """
        return unit * (np.asarray(size_m) / (self.width_m, self.height_m))


@dataclass(frozen=True)
class AtlasRegion:
    """One cell of a texture atlas of `columns` x `rows` cells, stretched over a face. Row 0 is the top."""

    material: str
    column: int
    row: int
    columns: int
    rows: int

    def coordinates(self, unit: FloatArray, size_m: ArrayLike) -> FloatArray:
        """`(N, 2)` texture coordinates of `(N, 2)` positions in the unit square of a face of any size.

        The rim of the cell is left out: in coarse mipmap levels neighbouring cells bleed into it.
        """
        inner = 0.03 + 0.94 * unit
        return (inner + np.array([self.column, self.rows - 1 - self.row])) / np.array([self.columns, self.rows])


Texture: TypeAlias = TilingTexture | AtlasRegion

_TILINGS = {
    "paving": TilingTexture("paving", 3.2, 3.2),
    "pavement": TilingTexture("pavement", 2.0, 2.0),
    "asphalt": TilingTexture("asphalt", 4.0, 4.0),
    "concrete": TilingTexture("concrete", 6.0, 6.0),
    "linoleum": TilingTexture("linoleum", 2.4, 2.4),
    "corridor-wall": TilingTexture("corridor-wall", 3.0, 2.8),
    "ceiling": TilingTexture("glow-lamp-ceiling", 1.2, 1.2),
    "roof": TilingTexture("glow-lamp-roof", 2.0, 2.0),
    "brick": TilingTexture("brick", 1.9, 1.9),
    "cladding": TilingTexture("cladding", 2.0, 2.0),
}

# Names of the cells of each atlas, row by row, as `assets/draw_textures.py` draws them.
_PARTS = (
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
_EMISSIVE = (*(f"{kind}-{k}" for kind in ("window", "display", "neon") for k in range(4)),
             "lamp-panel", "lamp-warm", "lamp-cold", "rear-light")  # fmt: skip
CARTONS = (*(name for name in _PARTS if name.startswith("carton")), "wrapped")


def _regions(atlas: str, columns: int, rows: int, names: Iterable[str]) -> dict[str, AtlasRegion]:
    return {
        name: AtlasRegion("glow-lamp" if name.startswith("lamp") else atlas, k % columns, k // columns, columns, rows)
        for k, name in enumerate(names)
    }


_REGIONS = {
    **_regions("parts", 8, 8, _PARTS),
    **_regions("glow", 4, 4, _EMISSIVE),
    **_regions("posters", 4, 4, (f"poster-{k}" for k in range(16))),
    **_regions("facades", 2, 2, ("facade-brick", "facade-cream", "facade-rose", "facade-office")),
    **_regions("shops", 1, 4, (f"shops-{k}" for k in range(4))),
}


def tiling(name: str) -> TilingTexture:
    """A repeating texture: `"paving"`, `"brick"`, ..."""
    return _TILINGS[name]


def texture(name: str) -> AtlasRegion:
    """A texture from an atlas.

    Surfaces of props (`"steel"`, `"carton-label"`, ...), 16 posters (`"poster-3"`; 7 and 15 are notice boards), house
    fronts (`"facade-brick"`: 12 m x 9 m of upper floors; `"shops-2"`: 12 m x 3.6 m of ground floor) and what emits
    light (`"window-1"`, `"display-0"`, `"neon-3"`, `"lamp-warm"`, `"rear-light"`).
    """
    return _REGIONS[name]


# Colours that multiply grey images.
_TINTS = {
    "asphalt": (0.62, 0.63, 0.66),
    "pavement": (0.93, 0.91, 0.87),
    "cladding": (0.72, 0.80, 0.86),
    "glow-lamp-roof": (0.72, 0.80, 0.86),
}
_IMAGES = {"glow-lamp": "glow", "glow-lamp-ceiling": "ceiling", "glow-lamp-roof": "cladding"}
# Lamps that shine downwards do not light the ceiling; this replaces the light that the floor reflects to it.
_EMISSION = {"glow-lamp-ceiling": 0.38, "glow-lamp-roof": 0.12}


def add_material(spec: mujoco.MjSpec, name: str) -> None:
    """Add a material and its texture to the spec, unless it has them.

    Raises:
        PftrackError: The image is missing from the installation.
    """
    if spec.material(name) is not None:
        return
    image = _IMAGES.get(name, name)
    if spec.texture(image) is None:
        _add_texture(spec, image, mujoco.mjtTexture.mjTEXTURE_2D)
    material = spec.add_material(name=name)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = image
    material.rgba = (*_TINTS.get(name, (1.0, 1.0, 1.0)), 1.0)
    # Light is computed per vertex, which makes highlights on large triangles wrong.
    material.specular = 0.0
    material.shininess = 0.0
    material.emission = _EMISSION.get(name, 0.85 if name.startswith("glow") else 0.0)


def add_skybox(spec: mujoco.MjSpec, name: str) -> None:
    """Add a skybox, `"sky-day"` or `"sky-night"`, and the material that holds its brightness."""
    _add_texture(spec, name, mujoco.mjtTexture.mjTEXTURE_SKYBOX)
    spec.add_material(name=SKY).emission = 1.0


def _add_texture(spec: mujoco.MjSpec, name: str, kind: mujoco.mjtTexture) -> None:
    pixels, width, height = read_image(name)
    spec.add_texture(name=name, type=kind, width=width, height=height, nchannel=3).data = pixels


@cache
def read_image(name: str) -> tuple[bytes, int, int]:
    """RGB bytes, width and height [px] of an image in `assets/textures`."""
    path = assets_dir() / "textures" / f"{name}.png"
    image = cv2.imread(str(path), cv2.IMREAD_COLOR_RGB)
    if image is None:
        raise PftrackError(f"texture {name!r} cannot be read from {path}: the installation is incomplete")
    return np.ascontiguousarray(image).tobytes(), image.shape[1], image.shape[0]
