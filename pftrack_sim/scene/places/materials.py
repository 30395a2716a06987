"""Textures and materials of the places, by name.

A face shows a texture that repeats or one region of a texture atlas.
`assets/materials.toml` names them, `assets/draw_textures.py` draws the images.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TypeAlias

import cv2
import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.core.data_files import asset_table, assets_dir
from pftrack_sim.core.errors import PftrackError
from pftrack_sim.core.types import FloatArray, read_only
from pftrack_sim.scene.layout import SKY
from pftrack_sim.scene.scene_spec import SceneSpec


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

_TABLE = asset_table("materials")
_TEXTURES: dict[str, Texture] = {name: TilingTexture(*values) for name, values in _TABLE["tilings"].items()} | {
    name: AtlasRegion("glow-lamp" if name.startswith("lamp") else atlas, k % columns, k // columns, columns, rows)
    for atlas, (columns, rows, names) in _TABLE["atlases"].items()
    for k, name in enumerate(names)
}
CARTONS = (*(name for name in _TEXTURES if name.startswith("carton")), "wrapped")


def texture(name: str) -> Texture:
    """A texture that repeats (`"paving"`, `"brick"`, ...), or one region of an atlas.

    Regions are surfaces of props (`"steel"`, `"carton-label"`, ...), 16 posters (`"poster-3"`; 7 and 15 are notice
    boards), house fronts (`"facade-brick"`: 12 m x 9 m of upper floors; `"shops-2"`: 12 m x 3.6 m of ground floor) and
    what emits light (`"window-1"`, `"display-0"`, `"neon-3"`, `"lamp-warm"`, `"rear-light"`).
    """
    return _TEXTURES[name]


def add_material(spec: SceneSpec, name: str) -> None:
    """Add a material and its texture to the spec, unless it has them."""
    if spec.material(name) is not None:
        return
    image = _TABLE["images"].get(name, name)
    if spec.texture(image) is None:
        spec.add_image_file(image, image_file(image))
    material = spec.add_material(name=name)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = image
    material.rgba = (*_TABLE["tints"].get(name, (1.0, 1.0, 1.0)), 1.0)
    # Light is computed per vertex, which makes highlights on large triangles wrong.
    material.specular = material.shininess = 0.0
    material.emission = _TABLE["emission"].get(name, 0.85 if name.startswith("glow") else 0.0)


def add_skybox(spec: SceneSpec, name: str) -> None:
    """Add a skybox, `"sky-day"` or `"sky-night"`, and the material that holds its brightness."""
    spec.add_image(name, read_image(name), mujoco.mjtTexture.mjTEXTURE_SKYBOX)
    spec.add_material(name=SKY).emission = 1.0


@cache
def image_file(name: str) -> Path:
    """The file of an image in `assets/textures`.

    Raises:
        PftrackError: It is missing from the installation.
    """
    path = assets_dir() / "textures" / f"{name}.png"
    if not path.is_file():
        raise PftrackError(f"there is no texture {name!r} at {path}: the installation is incomplete")
    return path


@cache
def read_image(name: str) -> NDArray[np.uint8]:
    """`(H, W, 3)` RGB image in `assets/textures`; read-only."""
    path = image_file(name)
    image = cv2.imread(str(path), cv2.IMREAD_COLOR_RGB)
    if image is None:
        raise PftrackError(f"texture {name!r} cannot be read from {path}: the installation is incomplete")
    return read_only(np.ascontiguousarray(image, dtype=np.uint8))
