"""Props that are the same for every seed: built once per process, and added to every place of the kind."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import lru_cache
from typing import NamedTuple, ParamSpec, TypeAlias, cast

from pftrack_sim.scene.places.meshes import Prop, TexturedMesh, merged_by_material

_Arguments = ParamSpec("_Arguments")

Collider: TypeAlias = tuple[float, float, float]
"""Half width along x, half width along y, height [m] of a box that stands on the ground."""


class FixedProp(NamedTuple):
    """The arguments of `PlaceBuilder.add` for a prop with one mesh per material."""

    name: str
    prop: Prop
    position: tuple[float, ...]
    yaw_rad: float
    collider: Collider | None
    casts_shadow: bool


class FixedProps:
    """Collects props in the order in which they are added."""

    def __init__(self) -> None:
        self.added: list[FixedProp] = []

    def add(
        self,
        name: str,
        prop: Iterable[TexturedMesh],
        position: Sequence[float] = (0.0, 0.0),
        yaw_rad: float = 0.0,
        collider: Collider | None = None,
        casts_shadow: bool = True,
    ) -> None:
        """See `PlaceBuilder.add`."""
        merged = _frozen(merged_by_material(prop))
        self.added.append(FixedProp(name, merged, tuple(position), yaw_rad, collider, casts_shadow))


Section: TypeAlias = Callable[..., None]
"""Adds props to the `FixedProps` given first; it draws nothing at random but from generators of its own."""


@lru_cache(maxsize=64)
def fixed_props(section: Section, *variant: bool) -> tuple[FixedProp, ...]:
    """What a section adds; built at the first call with the same variant."""
    props = FixedProps()
    section(props, *variant)
    return tuple(props.added)


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
