"""A thing that is tracked in the place of a person: what it is, and what moves it."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Literal

from pydantic import field_validator

from pftrack_sim.core.data_files import asset_table
from pftrack_sim.core.errors import UnknownNameError
from pftrack_sim.scenario.section import Angle, NotNegative, Section, UpAxis, number, setting


class Push(Section):
    """A kick."""

    at_s: NotNegative = setting(..., "When.")
    speed_m_s: float = number(..., 0.1, 12, "Speed that it then has.")
    direction_deg: Angle = setting(..., "Where to, counter-clockwise from x.")


class Thing(Section):
    """A thing to track, in the place of a person."""

    prop: str | None = setting(
        None, "One of the props of the places: 'ball', 'juice', 'cube', 'panda', 'car', 'forklift', ..."
    )
    model: str | None = setting(
        None,
        "In its place a file of meshes (glTF, GLB, OBJ, PLY or STL), relative to the scenario's; x ahead.",
    )
    model_digest: str = setting("", "Digest of that file and of those that it names, as they were read.")
    up: UpAxis = setting("auto", "Axis of the file that points up; 'auto': y in glTF, GLB and OBJ, else z.")
    moves: Literal["sliding", "rolling", "carried", "pushed"] = setting(
        "sliding",
        "'sliding': along the path, its front ahead; 'rolling': along the path, as a ball does; 'carried': in both "
        "hands of a person, who walks along the path and is no part of it; 'pushed': by physics: it is kicked, rolls, "
        "slides, bounces and comes to rest.",
    )
    height_m: float = number(..., 0.05, 4, "Height, to which it is scaled.")
    surface: str = setting("paint-red", "Surface of the parts of a prop that have none of their own, as a car's paint.")
    turn_deg: float = number(30.0, 0, 180, "Carried: how far the hands turn it to either side.")
    turn_s: float = number(5.0, 1, 3600, "Carried: time from one side to the other and back.")
    friction: float = number(0.5, 0, 2, "Pushed: Coulomb friction on floor and walls.")
    rolling_resistance: float = number(
        0.04, 0, 0.5, "Pushed: force that it takes to roll it, as a share of its weight."
    )
    restitution: float = number(
        0.7, 0.2, 0.95, "Pushed: share of its speed with which it bounces off a wall: 0.8 of a football."
    )
    pushes: tuple[Push, ...] = setting(
        (), "Pushed: kicks; left out, they are drawn by seed, one whenever it has come to rest.", max_length=1000
    )

    @field_validator("prop")
    @classmethod
    def _prop_is_known(cls, name: str | None) -> str | None:
        return None if name is None else _known("prop", name, asset_table("props"))

    @field_validator("surface")
    @classmethod
    def _surface_is_known(cls, name: str) -> str:
        table = asset_table("materials")
        atlases = (names for _, _, names in table["atlases"].values())
        return _known("surface", name, [*table["tilings"], *itertools.chain(*atlases)])

    def _contradictions(self) -> Iterator[str]:
        if self.prop is None and self.model is None:
            yield "needs prop, the name of a prop, or model, a file of meshes"
        if self.pushes and self.moves != "pushed":
            yield f"pushes need moves = 'pushed', got {self.moves!r}"

    @property
    def name(self) -> str:
        """That of the file, or the prop's."""
        return str(self.prop) if self.model is None else Path(self.model).stem


def _known(kind: str, name: str, names: Collection[str]) -> str:
    if name not in names:
        raise ValueError(str(UnknownNameError(kind, name, names)))
    return name
