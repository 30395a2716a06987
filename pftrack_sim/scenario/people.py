"""The people of a scenario: the target, what it does and carries, other pedestrians, and people who belong together."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import Annotated, Literal, TypeAlias

from pydantic import Field

from pftrack_sim.scenario.clothes import Clothes
from pftrack_sim.scenario.mobility import ABLE, TOP_SHARE, TOP_SPEED_M_S, USUAL_SPEED_M_S, Mobility
from pftrack_sim.scenario.section import (
    Angle,
    Coordinate,
    NotNegative,
    Point,
    Positive,
    Section,
    Share,
    number,
    setting,
)
from pftrack_sim.scenario.thing import Thing

NAME = "^[A-Za-z][A-Za-z0-9_-]{0,31}$"
"""Pattern of names of targets and cameras."""

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


def title(index: int, action: Action) -> str:
    """Position in the list, kind and times of an action, for messages."""
    return f"actions.{index} ({action.kind}, {action.at_s:g} to {end_s(action):g} s)"


Item: TypeAlias = Literal["bag", "box", "backpack", "umbrella"]

_Channel = Annotated[int, Field(ge=0, le=255)]
_HANDS: dict[Item, frozenset[str]] = {
    "bag": frozenset({"left"}),
    "box": frozenset({"left", "right"}),
    "backpack": frozenset(),
    "umbrella": frozenset({"right"}),
}
_GRIPPING_S = 0.35


class Carried(Section):
    """A thing that the target carries from the start, or picks up."""

    item: Item = setting(
        ...,
        "'bag': in the left hand; 'box': before the chest, in both hands; 'backpack'; 'umbrella': open, in the right "
        "hand.",
    )
    colour: tuple[_Channel, _Channel, _Channel] = setting((60, 62, 70), "Red, green, blue, 0 to 255.")
    from_start: bool = setting(True, "Carried from the start; else it lies where an action `picks_up` the item.")


def held_share(carried: Carried, actions: Sequence[Action], time_s: float) -> float:
    """1 while a thing is carried, 0 while it lies on the ground, between while it is gripped or let go."""
    share = float(carried.from_start)
    for at_s, taken in grips_s(carried, actions):
        progress = min(max((time_s - at_s) / _GRIPPING_S, 0.0), 1.0)
        share += progress * (float(taken) - share)
    return share


def grips_s(carried: Carried, actions: Sequence[Action]) -> list[tuple[float, bool]]:
    """Times at which the hands close on a thing (True) or open (False)."""
    times: list[tuple[float, bool]] = []
    for action in actions:
        if isinstance(action, Lowering) and carried.item in (action.picks_up, action.puts_down):
            # Half way between having gone down and rising.
            times.append((0.5 * (action.at_s + 1.7 + end_s(action) - 1.1), action.picks_up == carried.item))
    return sorted(times)


MAX_PATH_M = 2000.0
GAZE_M = 1.1
"""Height of the point of a person to which the camera is turned."""
_GAZE_SHARE = 0.79  # The same of a child, as a share of its height
_BENCH_M = 1.25  # Least stature of who sits on a bench, or carries a bag clear of the ground
_HANDS_SHARE = 0.62  # Height of hands that carry something before the chest, as a share of the body's
_ON_FOOT = Lowering | Gesture | Sit


class Target(Section):
    """The person, or thing, to track."""

    path: Literal["points", "auto"] = setting(
        "points", "'points': through `path_m`; 'auto': drawn by seed where there is room, whatever `path_m` says."
    )
    path_m: tuple[Point, ...] = setting(
        (),
        "Points the target walks through; corners are rounded. It stops at the last one. Of a thing that is pushed "
        "the one where it lies at first.",
        max_length=1000,
    )
    path_length_m: float | None = setting(
        None, "Length of an 'auto' path; by default what is walked in the episode.", ge=1, le=500
    )
    path_turns: int | None = number(
        None,
        0,
        20,
        "Turns of an 'auto' path, each of 25 to 100 degrees; by default 2, or more where there is little room.",
    )
    speed_m_s: float = number(1.25, 0.3, 2.2, "Speed along the path.")
    height_m: float = number(1.74, 0.9, 2.1, "Body height; less than 1.48 is a child's.")
    uses: Mobility | None = setting(
        None, "A 'wheelchair', 'bicycle' or 'scooter' that it rides, a 'pram' that it pushes, or 'crutches'."
    )
    thing: Thing | None = setting(None, "What is tracked in the place of the person.")
    clothes: Clothes = Clothes()
    wardrobe: int = number(
        0,
        0,
        10000,
        "Number of the set of random clothes and builds: scenarios with different numbers show different people at "
        "the same seed; with 0, those of the place.",
    )
    init: Literal["body", "torso"] = setting(
        "body",
        "What the target's boxes enclose, from the selection to the score: 'body': the whole person; 'torso': the "
        "trunk from the hips to the neck, without the arms, as users often draw it.",
    )
    start_stride: Literal["median", "any"] = setting(
        "median",
        "Gait phase in the first frame, in which the target is selected: 'median': one at which the box has its "
        "median width over a stride; 'any': drawn from the seed.",
    )
    actions: tuple[Action, ...] = setting((), "What it does on its way, one thing at a time.", max_length=1000)

    carries: tuple[Carried, ...] = setting((), "What it carries, or picks up on its way.", max_length=100)

    def _contradictions(self) -> Iterator[str]:
        yield from self._wrong_path()
        yield from self._wrong_thing()
        yield from self._wrong_actions()
        yield from self._wrong_load()
        yield from self._wrong_mobility()

    def _wrong_path(self) -> Iterator[str]:
        if self.path == "points" and self.pushed and len(self.path_m) != 1:
            yield (
                f"path_m of a thing that is pushed must be the one point where it lies at first, got "
                f"{len(self.path_m)}; or set path = 'auto'"
            )
        different = len(dict.fromkeys(self.path_m))
        if self.path == "points" and not self.pushed and different < 2:
            yield f"path_m must have at least 2 different points, got {different}; or set path = 'auto'"
        length_m = sum(math.dist(one, other) for one, other in itertools.pairwise(self.path_m))
        if length_m > MAX_PATH_M:
            yield f"path_m must be at most {MAX_PATH_M:g} m long, got {length_m:g} m"

    @property
    def carried(self) -> bool:
        """Whether it is a thing in a person's hands."""
        return self.thing is not None and self.thing.moves == "carried"

    @property
    def pushed(self) -> bool:
        """Whether it is a thing that physics moves."""
        return self.thing is not None and self.thing.moves == "pushed"

    @property
    def top_m(self) -> float:
        """Height above the ground of the highest point of what is tracked."""
        return self._tall_m if self.thing is None else self.gaze_m + 0.5 * self.thing.height_m

    @property
    def _tall_m(self) -> float:
        return self.height_m * (TOP_SHARE.get(self.uses, 1.0) if self.uses else 1.0)

    @property
    def gaze_m(self) -> float:
        """Height of the point to which the camera is turned: of a thing about its middle."""
        if self.thing is None:
            return min(GAZE_M, _GAZE_SHARE * self._tall_m)
        return _HANDS_SHARE * self.height_m if self.carried else 0.5 * self.thing.height_m

    def _wrong_thing(self) -> Iterator[str]:
        thing, walks = self.thing, self.thing is None or self.carried
        if thing is not None and self.init == "torso":
            yield f"init = 'torso' needs a person, and the target is a thing ({thing.name!r})"
        if thing is not None and self.carries:
            yield "carries: a target that is a thing carries nothing, nor has its bearer a free hand"
        for index, one in enumerate(self.actions):
            if thing is not None and self.pushed:
                yield f"{title(index, one)}: {thing.name!r} is pushed: give it target.thing.pushes"
            if thing is not None and isinstance(one, _ON_FOOT) and (not walks or one.kind == "wave"):
                needed = "free hands" if walks else "legs"
                yield f"{title(index, one)} needs {needed}, and {thing.name!r} is {thing.moves}"

    def _wrong_actions(self) -> Iterator[str]:
        order = sorted(enumerate(self.actions), key=lambda one: one[1].at_s)
        for first, second in itertools.pairwise(order):
            if end_s(first[1]) > second[1].at_s:
                yield f"actions must not overlap, got {title(*first)} and {title(*second)}"

    def _wrong_load(self) -> Iterator[str]:
        items: list[Item] = [one.item for one in self.carries]
        if len(set(items)) < len(items):
            yield f"carries must be different items, got {', '.join(items)}"
        busy = [hand for item in items for hand in _HANDS[item]]
        if len(set(busy)) < len(busy):
            needs = "a box needs both hands, a bag the left, an umbrella the right"
            yield f"carries need more than two hands: {', '.join(items)} ({needs})"
        held = {one.item: one.from_start for one in self.carries}
        lowerings = sorted((one for one in self.actions if isinstance(one, Lowering)), key=lambda one: one.at_s)
        for action, taken in itertools.product(lowerings, (False, True)):
            item = action.picks_up if taken else action.puts_down
            if item is None:
                continue
            if held.get(item, taken) is taken:
                yield (
                    f"the {action.kind} at {action.at_s:g} s {'picks up' if taken else 'puts down'} {item!r}: it must "
                    f"be in carries (got {', '.join(items) or 'none'}), {'not ' if taken else ''}carried by then"
                )
            held[item] = taken
        never = [one.item for one in self.carries if not one.from_start and not grips_s(one, self.actions)]
        if never:
            why = f"a bend or crouch must pick it up (picks_up = {never[0]!r})"
            yield f"{never[0]!r} is not carried from the start: {why}"
        sits = [title(index, one) for index, one in enumerate(self.actions) if isinstance(one, Sit)]
        tall = [*sits, *("carrying a bag" for one in self.carries if one.item == "bag")]
        if tall and self.height_m < _BENCH_M:
            yield f"{tall[0]} needs a height_m of {_BENCH_M} or more, got {self.height_m:g}"

    def _wrong_mobility(self) -> Iterator[str]:
        if self.uses is None:
            return
        if self.thing is not None:
            yield f"uses = {self.uses!r} needs a person, and the target is a thing ({self.thing.name!r})"
        for one in self.carries:
            if one.item != "backpack":
                yield f"uses = {self.uses!r} needs both hands: carries {one.item!r}"
            if self.uses == "wheelchair":
                yield f"uses = {self.uses!r} has a back where carries {one.item!r} would be"
        with_it = self.uses if self.uses == "crutches" else f"a {self.uses}"
        for index, one in enumerate(self.actions):
            if one.kind not in ABLE[self.uses]:
                able = ", ".join(sorted(ABLE[self.uses]))
                yield f"{title(index, one)} is not possible with {with_it} (possible: {able})"
        paces = {f"{title(index, one)}: ": one for index, one in enumerate(self.actions) if isinstance(one, Pace)}
        for where, one in {"": self, **paces}.items():
            if one.speed_m_s > TOP_SPEED_M_S.get(self.uses, math.inf):
                most = f"at most {TOP_SPEED_M_S[self.uses]:g} ({USUAL_SPEED_M_S[self.uses]:g} is usual)"
                yield f"{where}uses = {self.uses!r} needs a speed_m_s of {most}, got {one.speed_m_s:g}"


class FurtherTarget(Section):
    """A further target by name: a person with a path, or one of the other people of the scenario."""

    name: str = setting(
        ...,
        "Name, as truth tells it; without `path_m` that of one of the scenario's people, as 'distractor-1'.",
        pattern=NAME,
    )
    path_m: tuple[Point, ...] = setting((), "Points the person walks through, as the target's.", max_length=1000)
    speed_m_s: float = number(1.25, 0.3, 2.2, "Speed along the path.")
    height_m: float = number(1.74, 0.9, 2.1, "Body height; less than 1.48 is a child's.")
    uses: Mobility | None = setting(
        None, "A 'wheelchair', 'bicycle' or 'scooter' that it rides, a 'pram' that it pushes, or 'crutches'."
    )
    clothes: Clothes = Clothes()
    actions: tuple[Action, ...] = setting((), "What it does on its way, but sit and pick up.", max_length=1000)

    @property
    def person(self) -> Target:
        """The person as a target is described."""
        return Target(**{key: value for key, value in self if key != "name"})

    def _contradictions(self) -> Iterator[str]:
        if self.path_m and any(isinstance(one, Sit) for one in self.actions):
            yield "actions: a further target has no seat to sit on"
        if self.path_m:
            _ = self.person  # Raises what is wrong with it
        elif self != FurtherTarget.model_construct(name=self.name):
            yield f"{self.name!r} has no path_m: it is somebody who is there, without other keys"


class Distractors(Section):
    """Other pedestrians."""

    count: int = number(3, 0, 12, "Number of pedestrians.")
    similarity: Share = setting(0.2, "Similarity of their clothes to the target's; 1 is the same clothes.")
    speed_m_s: float = number(1.2, 0.3, 2.2, "Mean walking speed.")
    changes_per_minute: float = number(
        0.0, 0, 60, "How often each changes its pace or, every third time, pauses for 1 to 3 s."
    )


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
