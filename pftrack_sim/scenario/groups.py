"""People who belong together: groups that stand, sit or walk, and companions of the target, `[[groups]]`."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from pydantic import Field

from pftrack_sim.scenario.section import Angle, Coordinate, Point, Section, Share, number, setting


class _Group(Section):
    count: int = number(2, 1, 4, "Number of people.")
    similarity: Share = setting(0.2, "Similarity of their clothes to the target's.")


class Standing(_Group):
    """Stand in a ring and talk."""

    kind: Literal["stand"]
    at_m: Point = setting(..., "Middle of the ring.")
    heading_deg: Angle = setting(0.0, "Where the first one looks.")


class Seated(_Group):
    """Sit side by side; the bench is put there."""

    kind: Literal["sit"]
    count: int = number(2, 1, 2, "Number of people.")
    at_m: Point = setting(..., "Between their feet.")
    heading_deg: Angle = setting(0.0, "Where they look.")
    seat: Literal["bench", "couch"] = setting("bench", "What they sit on.")


class Walking(_Group):
    """Walk side by side along a path, and stop at its end; they do not avoid other people."""

    kind: Literal["walk"]
    path_m: tuple[Point, ...] = setting(..., "Points of the path.", min_length=2, max_length=100)
    speed_m_s: float = number(1.1, 0.3, 1.8, "Walking speed.")


class Companions(_Group):
    """Walk beside the target, and stop when it stops."""

    kind: Literal["with_target"]
    count: int = number(1, 1, 2, "Number of people.")
    left_m: Coordinate = setting(0.75, "Sideways distance of the first one from the target; positive is left.")


Group: TypeAlias = Annotated[Standing | Seated | Walking | Companions, Field(discriminator="kind")]
