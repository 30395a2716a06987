"""What the target does on its way: a schedule of actions, `[[target.actions]]`.

Every action begins at `at_s` and lasts `duration_s`, slowing down, turning and rising included; before and after it the
target walks along its path.
"""

from __future__ import annotations

import itertools
from typing import Annotated, Literal, TypeAlias

from pydantic import Field

from pftrack_sim.scenario.section import NotNegative, Positive, Section, number, setting

BACKWARD_SPEED_M_S = 0.9
TURNING_S = 3.9  # Of an action that faces about: slowing down and both turns; the rest is spent turned.


class _Action(Section):
    at_s: NotNegative = setting(..., "When it begins.")


class Stop(_Action):
    """Stands still for a while."""

    kind: Literal["stop"]
    duration_s: Positive = setting(2.2, "Slowing down included.")


class Turn(_Action):
    """Faces about on the spot, walks back slowly, and faces about again."""

    kind: Literal["turn"]
    duration_s: float = number(5.2, 4.2, 3600, "Slowing down and turns included.")

    @property
    def back_m(self) -> float:
        """How far it walks back along the path."""
        return BACKWARD_SPEED_M_S * (self.duration_s - TURNING_S)


class Approach(_Action):
    """Faces about, walks back along the path towards a camera behind it, and faces about again."""

    kind: Literal["approach"]
    distance_m: float = number(2.0, 0.3, 20, "How far it walks back.")
    speed_m_s: float = number(1.1, 0.3, 1.4, "How fast.")

    @property
    def back_m(self) -> float:
        """How far it walks back along the path."""
        return self.distance_m

    @property
    def duration_s(self) -> float:
        """Slowing down and both turns included."""
        return TURNING_S + self.distance_m / self.speed_m_s


class Face(_Action):
    """Stands, or walks on slowly, with the body turned relative to the camera."""

    kind: Literal["face"]
    duration_s: float = number(4.5, 3.2, 3600, "Slowing down and turns included.")
    towards: Literal["camera", "away", "left", "right"] = setting(
        "camera", "Where the front of the body points, as seen in the image."
    )
    speed_m_s: float = number(0.0, 0, 0.5, "Speed along the path meanwhile: steps to the side or back.")


class Lowering(_Action):
    """Stops, and squats or bends forward, as to reach for something on the ground; then rises."""

    kind: Literal["crouch", "bend"]
    duration_s: float = number(3.8, 2.8, 3600, "Slowing down and rising included.")
    picks_up: Literal["bag", "box"] | None = setting(None, "Item in `carries` that it picks up.")
    puts_down: Literal["bag"] | None = setting(None, "Item in `carries` that it puts down; a box would lie in its way.")


class Gesture(_Action):
    """Stops and moves arms or head."""

    kind: Literal["wave", "look_around"]
    duration_s: float = number(4.0, 2.8, 3600, "Slowing down included.")


class Sit(_Action):
    """Stops, turns its back on a seat beside its path, sits down and rests; then rises, turns and walks on."""

    kind: Literal["sit"]
    duration_s: float = number(9.0, 6.6, 3600, "Slowing down, turns, sitting down and rising included.")
    side: Literal["left", "right"] = setting("left", "Side of its path on which the seat stands.")
    seat: Literal["bench", "couch"] = setting("bench", "Seat that is put there.")


class Run(_Action):
    """Runs."""

    kind: Literal["run"]
    duration_s: Positive = setting(3.0, "Taking up the speed included.")
    speed_m_s: float = number(2.7, 2.2, 3.2, "Speed of running.")


class Pace(_Action):
    """Walks at another speed."""

    kind: Literal["pace"]
    duration_s: Positive = setting(4.0, "Taking up the speed included.")
    speed_m_s: float = number(..., 0.3, 2.2, "Walking speed.")


class WalkOff(_Action):
    """Walks off fast, so that a slower robot falls behind and the target becomes small."""

    kind: Literal["walk_off"]
    duration_s: Positive = setting(5.0, "Taking up the speed included.")
    speed_m_s: float = number(2.1, 0.3, 2.2, "Walking speed.")


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
