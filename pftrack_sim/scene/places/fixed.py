"""Props that are the same for every seed: built once per process, and added to every place of the kind."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from typing import NamedTuple, ParamSpec, TypeAlias, cast

from pftrack_sim.scene.places.meshes import Prop, TexturedMesh, merged_by_material

_Arguments = ParamSpec("_Arguments")

Collider: TypeAlias = tuple[float, float, float]
"""Half width along x, half width along y, height [m] of a box that stands on the ground."""


class FixedProp(NamedTuple):
    """The arguments of `PlaceBuilder.add` for a prop that is the same for every seed."""

    name: str
    prop: Sequence[TexturedMesh]
    position: tuple[float, ...] = (0.0, 0.0)
    yaw_rad: float = 0.0
    collider: Collider | None = None
    casts_shadow: bool = True


Section: TypeAlias = Callable[..., Iterator[FixedProp]]
"""A part of a place; it draws nothing at random but from generators of its own."""


@lru_cache(maxsize=64)
def fixed_props(section: Section, *variant: bool) -> tuple[FixedProp, ...]:
    """The props of a section, with one mesh per material, built at the first call with the same variant; read-only."""
    return tuple(fixed._replace(prop=_frozen(merged_by_material(fixed.prop))) for fixed in section(*variant))


def built_once(build: Callable[_Arguments, Prop]) -> Callable[_Arguments, Prop]:
    """Keep the props of a function without randomness by its arguments, with one mesh per material; read-only."""

    @lru_cache(maxsize=128)
    def build_once(*arguments: _Arguments.args, **named: _Arguments.kwargs) -> Prop:
        return _frozen(merged_by_material(build(*arguments, **named)))

    return cast(Callable[_Arguments, Prop], build_once)


def _frozen(prop: Prop) -> Prop:
    """The prop, read-only from now on: environments in several threads share it."""
    for mesh in prop:
        for array in (mesh.vertices, mesh.normals, mesh.uv, mesh.faces):
            array.setflags(write=False)
    return prop
