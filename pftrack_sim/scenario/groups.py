"""People who belong together: groups that stand, sit or walk, and companions of the target, `[[groups]]`."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from pydantic import Field

from pftrack_sim.scenario.section import Angle, Coordinate, Point, Section, Share


class _Group(Section):
    count: Annotated[int, Field(ge=1, le=4)] = Field(default=2, description="Number of people.")
    similarity: Share = Field(default=0.2, description="Similarity of their clothes to the target's.")


class Standing(_Group):
    """Stand in a ring and talk."""

    kind: Literal["stand"]
    at_m: Point = Field(description="Middle of the ring.")
    heading_deg: Angle = Field(default=0.0, description="Where the first one looks.")


class Seated(_Group):
    """Sit side by side; the bench is put there."""

    kind: Literal["sit"]
    count: Annotated[int, Field(ge=1, le=2)] = Field(default=2, description="Number of people.")
    at_m: Point = Field(description="Between their feet.")
    heading_deg: Angle = Field(default=0.0, description="Where they look.")
    seat: Literal["bench", "couch"] = Field(default="bench", description="What they sit on.")


class Walking(_Group):
    """Walk side by side along a path, and stop at its end; they do not avoid other people."""

    kind: Literal["walk"]
    path_m: Annotated[tuple[Point, ...], Field(min_length=2, max_length=100)] = Field(description="Points of the path.")
    speed_m_s: Annotated[float, Field(ge=0.3, le=1.8)] = Field(default=1.1, description="Walking speed.")


class Companions(_Group):
    """Walk beside the target, and stop when it stops."""

    kind: Literal["with_target"]
    count: Annotated[int, Field(ge=1, le=2)] = Field(default=1, description="Number of people.")
    left_m: Coordinate = Field(
        default=0.75, description="Sideways distance of the first one from the target; positive is left."
    )


Group: TypeAlias = Annotated[Standing | Seated | Walking | Companions, Field(discriminator="kind")]
