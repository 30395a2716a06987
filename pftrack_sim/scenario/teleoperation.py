"""The person who drives the robot in open-loop episodes, and the sills that it drives over."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal, TypeAlias, cast

from pydantic import Field, model_validator

from pftrack_sim.scenario.section import Section

Character: TypeAlias = Literal["steady", "careful", "average", "hasty"]

CHARACTERS: dict[str, dict[str, Any]] = {
    "steady": {},
    "careful": {
        "reaction_s": 0.25,
        "dead_zone_deg": 4.0,
        "head_hz": 0.6,
        "head_damping": 0.8,
        "wander_deg": 7.0,
        "wander_s": 5.0,
        "stops_per_minute": 1.0,
        "stop_s": 1.0,
        "distance_ratio": 1.5,
        "distance_period_s": 24.0,
        "swing_m": 0.3,
        "swing_every_m": 8.0,
    },
    "average": {
        "reaction_s": 0.3,
        "dead_zone_deg": 4.0,
        "head_hz": 0.7,
        "head_damping": 0.6,
        "wander_deg": 9.0,
        "wander_s": 3.8,
        "glances_per_minute": 3.0,
        "glance_deg": 20.0,
        "glance_s": 0.8,
        "stops_per_minute": 2.0,
        "stop_s": 1.0,
        "stop_turn_deg": 20.0,
        "distance_ratio": 1.8,
        "distance_period_s": 20.0,
        "swing_m": 0.5,
        "swing_every_m": 8.0,
    },
    "hasty": {
        "reaction_s": 0.35,
        "dead_zone_deg": 4.0,
        "head_hz": 0.8,
        "head_damping": 0.45,
        "wander_deg": 12.0,
        "wander_s": 3.0,
        "glances_per_minute": 6.0,
        "glance_deg": 25.0,
        "glance_s": 0.8,
        "stops_per_minute": 3.0,
        "stop_s": 1.2,
        "stop_turn_deg": 30.0,
        "distance_ratio": 2.4,
        "distance_period_s": 16.0,
        "swing_m": 0.7,
        "swing_every_m": 7.0,
    },
}
"""Values that each character gives to the keys left out."""


class Operator(Section):
    """How the head follows the target and the base its route while the robot follows its script.

    The defaults are the steady operator: the head turns towards the target whenever it is more than 6 degrees off the
    middle, the base keeps its place. Whatever is random is drawn from streams of its own. The episode begins on the
    route, with the target in the middle. Robots driven by actions have no operator.
    """

    character: Character = Field(
        default="steady",
        description="Values of the keys left out: those of a steady, careful, average, hasty operator.",
    )
    reaction_s: Annotated[float, Field(ge=0.0, le=1.0)] = Field(
        default=0.0, description="Delay from a movement of the target to the operator's response; 0.2 to 0.4 in people."
    )
    dead_zone_deg: Annotated[float, Field(ge=0.0, le=20.0)] = Field(
        default=6.0, description="Errors of direction that the operator leaves as they are."
    )
    head_hz: Annotated[float, Field(ge=0.0, le=2.0)] = Field(
        default=0.0,
        description="Natural frequency of the second-order response of the head, 0.5 to 1 in manual tracking; 0 is a "
        "first-order response without overshoot.",
    )
    head_damping: Annotated[float, Field(ge=0.1, le=2.0)] = Field(
        default=0.7, description="Damping ratio of that response: 1 does not overshoot, 0.5 by 16 %, 0.3 by 37 %."
    )
    wander_deg: Annotated[float, Field(ge=0.0, le=40.0)] = Field(
        default=0.0,
        description="RMS angle by which the aim wanders sideways from the target; half as much up and down.",
    )
    wander_s: Annotated[float, Field(ge=0.5, le=60.0)] = Field(
        default=4.0, description="Mean period of that wandering: from one side to the other and back."
    )
    glances_per_minute: Annotated[float, Field(ge=0.0, le=30.0)] = Field(
        default=0.0, description="How often the camera looks elsewhere and returns."
    )
    glance_deg: Annotated[float, Field(gt=0.0, le=150.0)] = Field(
        default=25.0, description="Mean angle by which it looks to one side of the target, within 30 %."
    )
    glance_s: Annotated[float, Field(ge=0.1, le=20.0)] = Field(
        default=1.0, description="Mean time until it turns back, within 30 %."
    )
    keep_in_view: bool = Field(
        default=True,
        description="Whether the centre of the target stays in the image, at its edge at most, whatever the aim does.",
    )
    stops_per_minute: Annotated[float, Field(ge=0.0, le=20.0)] = Field(
        default=0.0, description="How often the base brakes to a stop; afterwards it catches up."
    )
    stop_s: Annotated[float, Field(ge=0.1, le=20.0)] = Field(
        default=2.0, description="Mean time for which it stands, within 30 %."
    )
    stop_turn_deg: Annotated[float, Field(ge=0.0, le=120.0)] = Field(
        default=0.0, description="Angle by which the body turns on the spot in a stop, to one side and back."
    )
    distance_ratio: Annotated[float, Field(ge=1.0, le=5.0)] = Field(
        default=1.0,
        description="Largest over smallest distance kept from the target; the route's is their geometric mean.",
    )
    distance_period_s: Annotated[float, Field(ge=2.0, le=3600.0)] = Field(
        default=20.0, description="Mean time from near to far and back, within 20 %."
    )
    swing_m: Annotated[float, Field(ge=0.0, le=3.0)] = Field(
        default=0.0,
        description="How far the base swings wide of its route, to each side in turn: up to this, where there is room.",
    )
    swing_every_m: Annotated[float, Field(ge=2.0, le=3600.0)] = Field(
        default=8.0, description="Mean distance from one swing to the left to the next."
    )

    @model_validator(mode="before")
    @classmethod
    def _with_character(cls, values: Any) -> Any:
        if not isinstance(values, Mapping):
            return values
        given = cast("Mapping[str, Any]", values)
        character = given.get("character", "steady")
        return {**CHARACTERS.get(character, {}), **given} if isinstance(character, str) else given


class Sills(Section):
    """Sills across the way of the robot, which shake it through its suspension."""

    height_mm: Annotated[float, Field(ge=0.0, le=15.0)] = Field(
        default=0.0, description="Height; thresholds of doors have up to 13 (ADA Standards 2010, 404.2.5)."
    )
    every_m: Annotated[float, Field(ge=0.5, le=1000.0)] = Field(
        default=4.0, description="Mean way from one to the next, within 30 %."
    )
