"""Props with fixed dimensions, described in `assets/props.toml`."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.core.data_files import asset_table
from pftrack_sim.scene.places.fixed import built_once
from pftrack_sim.scene.places.materials import Texture, texture
from pftrack_sim.scene.places.meshes import (
    ALL_FACES,
    SIDES,
    Prop,
    TexturedMesh,
    box,
    cylinder,
    laid_on_side,
    loft,
    merged_by_material,
    quad,
    rotated,
    translated,
)

_FACES = {"all": ALL_FACES, "sides": SIDES, "wall": ("-y", "+x", "-x", "+z")}


@built_once
def load_prop(name: str, **textures: str) -> Prop:
    """Build a prop of the catalogue, once per set of textures.

    `textures` are those of the parts that the catalogue marks with `$`.
    """
    return tuple(mesh for primitive in asset_table("props")[name] for mesh in _meshes(primitive, textures))


def _meshes(primitive: dict[str, Any], textures: dict[str, str]) -> list[TexturedMesh]:
    """One mesh per position of a primitive."""
    arguments = dict(primitive)
    shape = next(iter(arguments))
    name: str = arguments.pop(shape)
    surface = texture(textures[name[1:]] if name.startswith("$") else name)
    if shape == "loft":
        return [loft(surface, **arguments)]
    if "faces" in arguments:
        arguments["faces"] = _FACES[arguments["faces"]]
    build = {"box": box, "quad": quad, "cylinder": cylinder, "wheel": _wheel}[shape]
    return [build(surface, position, **arguments) for position in arguments.pop("at")]


def _wheel(tread: Texture, hub: ArrayLike, radius: float, width: float) -> TexturedMesh:
    """A wheel that rolls along x; its disc faces away from y = 0."""
    x, y, z = np.asarray(hub, dtype=np.float64).tolist()
    wheel = laid_on_side(
        (
            cylinder(tread, (0, 0, -0.5 * width), radius, width, 12),
            cylinder(texture("wheel"), (0, 0, 0.5 * width), radius, 0.005, 12),
        )
    )
    outwards = rotated(wheel, np.pi) if y > 0.0 else wheel
    return merged_by_material(translated(outwards, x, y, z))[0]
