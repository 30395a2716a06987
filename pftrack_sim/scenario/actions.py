"""What the target does on its way: a schedule of actions, `[[target.actions]]`.

Every action begins at `at_s` and lasts `duration_s`, slowing down, turning and rising included; before and after it the
target walks along its path.
"""

from __future__ import annotations

import itertools
from typing import Annotated, Literal, TypeAlias

from pydantic import Field

from pftrack_sim.scenario.section import NotNegative, Positive, Section

BACKWARD_SPEED_M_S = 0.9
TURNING_S = 3.9  # Of an action that faces about: slowing down and both turns; the rest is spent turned.

_At = Annotated[NotNegative, Field(description="When it begins.")]


class Stop(Section):
    """Stands still for a while."""

    kind: Literal["stop"]
    at_s: _At
    duration_s: Positive = Field(default=2.2, description="Slowing down included.")


class Turn(Section):
    """Faces about on the spot, walks back slowly, and faces about again."""

    kind: Literal["turn"]
    at_s: _At
    duration_s: Annotated[float, Field(ge=4.2, le=3600.0)] = Field(
        default=5.2, description="Slowing down and turns included."
    )

    @property
    def back_m(self) -> float:
        """How far it walks back along the path."""
        return BACKWARD_SPEED_M_S * (self.duration_s - TURNING_S)


class Approach(Section):
    """Faces about, walks back along the path towards a camera behind it, and faces about again."""

    kind: Literal["approach"]
    at_s: _At
    distance_m: Annotated[float, Field(ge=0.3, le=20.0)] = Field(default=2.0, description="How far it walks back.")
    speed_m_s: Annotated[float, Field(ge=0.3, le=1.4)] = Field(default=1.1, description="How fast.")

    @property
    def back_m(self) -> float:
        """How far it walks back along the path."""
        return self.distance_m

    @property
    def duration_s(self) -> float:
        """Slowing down and both turns included."""
        return TURNING_S + self.distance_m / self.speed_m_s


class Face(Section):
    """Stands, or walks on slowly, with the body turned relative to the camera."""

    kind: Literal["face"]
    at_s: _At
    duration_s: Annotated[float, Field(ge=3.2, le=3600.0)] = Field(
        default=4.5, description="Slowing down and turns included."
    )
    towards: Literal["camera", "away", "left", "right"] = Field(
        default="camera", description="Where the front of the body points, as seen in the image."
    )
    speed_m_s: Annotated[float, Field(ge=0.0, le=0.5)] = Field(
        default=0.0, description="Speed along the path meanwhile: steps to the side or back."
    )


class Lowering(Section):
    """Stops, and squats or bends forward, as to reach for something on the ground; then rises."""

    kind: Literal["crouch", "bend"]
    at_s: _At
    duration_s: Annotated[float, Field(ge=2.8, le=3600.0)] = Field(
        default=3.8, description="Slowing down and rising included."
    )
    picks_up: Literal["bag", "box"] | None = Field(default=None, description="Item in `carries` that it picks up.")
    puts_down: Literal["bag"] | None = Field(
        default=None, description="Item in `carries` that it puts down; a box would lie in its way."
    )


class Gesture(Section):
    """Stops and moves arms or head."""

    kind: Literal["wave", "look_around"]
    at_s: _At
    duration_s: Annotated[float, Field(ge=2.8, le=3600.0)] = Field(default=4.0, description="Slowing down included.")


class Sit(Section):
    """Stops, turns its back on a seat beside its path, sits down and rests; then rises, turns and walks on."""

    kind: Literal["sit"]
    at_s: _At
    duration_s: Annotated[float, Field(ge=6.6, le=3600.0)] = Field(
        default=9.0, description="Slowing down, turns, sitting down and rising included."
    )
    side: Literal["left", "right"] = Field(default="left", description="Side of its path on which the seat stands.")
    seat: Literal["bench", "couch"] = Field(default="bench", description="Seat that is put there.")


class Run(Section):
    """Runs."""

    kind: Literal["run"]
    at_s: _At
    duration_s: Positive = Field(default=3.0, description="Taking up the speed included.")
    speed_m_s: Annotated[float, Field(ge=2.2, le=3.2)] = Field(default=2.7, description="Speed of running.")


class Pace(Section):
    """Walks at another speed."""

    kind: Literal["pace"]
    at_s: _At
    duration_s: Positive = Field(default=4.0, description="Taking up the speed included.")
    speed_m_s: Annotated[float, Field(ge=0.3, le=2.2)] = Field(description="Walking speed.")


class WalkOff(Section):
    """Walks off fast, so that a slower robot falls behind and the target becomes small."""

    kind: Literal["walk_off"]
    at_s: _At
    duration_s: Positive = Field(default=5.0, description="Taking up the speed included.")
    speed_m_s: Annotated[float, Field(ge=0.3, le=2.2)] = Field(default=2.1, description="Walking speed.")


Action: TypeAlias = Annotated[
    Stop | Turn | Approach | Face | Lowering | Sit | Gesture | Run | Pace | WalkOff, Field(discriminator="kind")
]
"""An action of the target; one at a time."""


def end_s(action: Action) -> float:
    """When an action ends."""
    return action.at_s + action.duration_s


def overlap_problem(actions: tuple[Action, ...]) -> str | None:
    """What is wrong with the times of these actions; None if each ends before the next begins."""
    order = sorted(range(len(actions)), key=lambda index: actions[index].at_s)
    for first, second in itertools.pairwise(order):
        if end_s(actions[first]) > actions[second].at_s:
            pair = " and ".join(title(index, actions[index]) for index in (first, second))
            return f"actions must not overlap, got {pair}"
    return None


def title(index: int, action: Action) -> str:
    """Position in the list, kind and times of an action, for messages."""
    return f"actions.{index} ({action.kind}, {action.at_s:g} to {end_s(action):g} s)"
