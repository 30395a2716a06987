"""Props described in TOML: those of `assets/props.toml`, which says how, and those of a single place."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache, wraps
from typing import Any, ParamSpec, cast

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.core.data_files import asset_table
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scene.places.materials import Texture, texture
from pftrack_sim.scene.places.meshes import (
    ALL_FACES,
    SIDES,
    Prop,
    TexturedMesh,
    box,
    cylinder,
    ellipsoid,
    laid_on_side,
    loft,
    merged_by_material,
    quad,
    rotated,
    rough_ellipsoid,
    translated,
)

_Arguments = ParamSpec("_Arguments")

_FACES = {
    "all": ALL_FACES,
    "sides": SIDES,
    "wall": ("-y", "+x", "-x", "+z"),
    "ends": ("+x", "-x"),
    "flanks": ("+y", "-y"),
    "lids": ("+z", "-z"),
    "rest": ("+y", "-y", "+z", "-z"),
}


def built_once(build: Callable[_Arguments, Prop]) -> Callable[_Arguments, Prop]:
    """Keep the props of a function without randomness by its arguments, with one mesh per material; read-only."""

    @lru_cache(maxsize=128)
    @wraps(build)
    def build_once(*arguments: _Arguments.args, **named: _Arguments.kwargs) -> Prop:
        return merged_by_material(build(*arguments, **named), frozen=True)

    return cast(Callable[_Arguments, Prop], build_once)


@built_once
def load_prop(name: str, **textures: str) -> Prop:
    """Build a prop of the catalogue, once per set of textures, which are those that it marks with `$`."""
    return tuple(described_meshes(asset_table("props")[name], textures))


def described_meshes(primitives: Sequence[dict[str, Any]], textures: dict[str, str]) -> Iterator[TexturedMesh]:
    """The meshes of a description: one per position of each of its primitives."""
    for primitive in primitives:
        arguments: dict[str, Any] = {
            key: textures[value[1:]] if isinstance(value, str) and value.startswith("$") else value
            for key, value in primitive.items()
        }
        shape = next(iter(arguments))
        name: str = arguments.pop(shape)
        if shape == "loft":
            yield loft(texture(name), **arguments)
            continue
        positions = _positions(arguments.pop("at"), *arguments.pop("repeat", (1, 0, 0, 0)))
        if shape == "prop":
            prop = load_prop(name, **arguments)
            for x, y, z in positions.tolist():
                yield from translated(prop, x, y, z)
            continue
        if "faces" in arguments:
            arguments["faces"] = _FACES[arguments["faces"]]
        for position in positions:
            yield _SHAPES[shape](texture(name), position, **arguments)


def _positions(at: ArrayLike, count: int, *step: float) -> FloatArray:
    """`(N, 3)` positions, each repeated `count` times in steps."""
    steps = np.arange(count)[:, None] * np.array(step, dtype=np.float64)
    return (np.asarray(at, dtype=np.float64)[:, None] + steps).reshape(-1, 3)


def _wheel(tread: Texture, hub: FloatArray, radius: float, width: float) -> TexturedMesh:
    """A wheel that rolls along x; its disc faces away from y = 0."""
    x, y, z = hub.tolist()
    wheel = laid_on_side(
        (
            cylinder(tread, (0, 0, -0.5 * width), radius, width, 12),
            cylinder(texture("wheel"), (0, 0, 0.5 * width), radius, 0.005, 12),
        )
    )
    outwards = rotated(wheel, np.pi) if y > 0.0 else wheel
    return merged_by_material(translated(outwards, x, y, z))[0]


def _blob(surface: Texture, centre: FloatArray, radii: ArrayLike) -> TexturedMesh:
    return rough_ellipsoid(surface, centre, radii, np.random.default_rng(0), 0.05, 8)


_SHAPES: dict[str, Callable[..., TexturedMesh]] = {
    "box": box,
    "quad": quad,
    "cylinder": cylinder,
    "wheel": _wheel,
    "blob": _blob,
    "ball": ellipsoid,
}
