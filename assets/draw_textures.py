"""Draws every texture of the package. Deterministic: the same numpy and OpenCV give the same files.

    python assets/draw_textures.py [FOLDER]

Surfaces that repeat (paving, asphalt, ...) tile without a seam because their noise is filtered on a torus. Atlases
hold many small pictures in equal cells, so that a whole bench or car is one mesh with one material. Files without
colour are stored with one channel; the material tints them.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import occluders
from brushes import Canvas
from fronts import facades, posters, shops
from parts import parts
from shining import glow
from skies import sky_day, sky_night
from tiling import (
    asphalt,
    brick,
    ceiling,
    cladding,
    concrete,
    corridor_wall,
    grass,
    gravel,
    linoleum,
    pavement,
    paving,
)
from toys import toys


def generator(name: str) -> np.random.Generator:
    """One stream per picture, so that changing one leaves the others as they were."""
    return np.random.default_rng([20240607, *name.encode()])


PICTURES: dict[str, Callable[[np.random.Generator], Canvas]] = {
    "paving": paving,
    "pavement": pavement,
    "asphalt": asphalt,
    "concrete": concrete,
    "grass": grass,
    "gravel": gravel,
    "linoleum": linoleum,
    "corridor-wall": corridor_wall,
    "ceiling": ceiling,
    "brick": brick,
    "cladding": cladding,
    "facades": facades,
    "shops": shops,
    "posters": posters,
    "parts": parts,
    "toys": toys,
    "glow": glow,
    "sky-day": sky_day,
    "sky-night": sky_night,
}

OCCLUDERS = {
    "occluder-concrete": occluders.concrete,
    "occluder-brick": occluders.brick,
    "occluder-crate": occluders.crate,
}


def main() -> None:
    """Write every picture."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).resolve().parent / "textures"
    folder.mkdir(parents=True, exist_ok=True)
    images = {name: draw() for name, draw in OCCLUDERS.items()}
    for name, draw in PICTURES.items():
        # Steps of four grey levels are invisible under texture filtering and halve the files.
        images[name] = np.clip(np.round(draw(generator(name)) / 4.0) * 4.0, 0, 255).astype(np.uint8)
    for name, pixels in images.items():
        stored = pixels if pixels.ndim == 2 else cv2.cvtColor(pixels, cv2.COLOR_RGB2BGR)
        path = folder / f"{name}.png"
        cv2.imwrite(str(path), stored, [cv2.IMWRITE_PNG_COMPRESSION, 9])
        print(f"{path.name}: {stored.shape[1]} x {stored.shape[0]}, {path.stat().st_size / 1024:.0f} KiB")


if __name__ == "__main__":
    main()
