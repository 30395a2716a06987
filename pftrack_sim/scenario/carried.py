"""Things that the target carries, `[[target.carries]]`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Literal, TypeAlias

from pydantic import Field

from pftrack_sim.scenario.actions import Action, Lowering, end_s
from pftrack_sim.scenario.section import Section, setting

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


def carrying_problem(carries: Sequence[Carried], actions: Sequence[Action]) -> str | None:
    """What is wrong with the things carried; None if all can be held, picked up and put down as asked."""
    items: list[Item] = [one.item for one in carries]
    if len(set(items)) < len(items):
        return f"carries must be different items, got {', '.join(items)}"
    busy = [hand for item in items for hand in _HANDS[item]]
    if len(set(busy)) < len(busy):
        needs = "a box needs both hands, a bag the left, an umbrella the right"
        return f"carries need more than two hands: {', '.join(items)} ({needs})"
    held = {one.item: one.from_start for one in carries}
    for action in sorted(actions, key=lambda one: one.at_s):
        if isinstance(action, Lowering):
            for item, taken in ((action.puts_down, False), (action.picks_up, True)):
                if item is None:
                    continue
                if item not in held or held[item] is taken:
                    verb = "picks up" if taken else "puts down"
                    known = "none" if not items else ", ".join(items)
                    return (
                        f"the {action.kind} at {action.at_s:g} s {verb} {item!r}: it must be in carries "
                        f"(got {known}), {'not ' if taken else ''}carried by then"
                    )
                held[item] = taken
    never = [one.item for one in carries if not one.from_start and not grips_s(one, actions)]
    if never:
        return f"{never[0]!r} is not carried from the start: a bend or crouch must pick it up (picks_up = {never[0]!r})"
    return None
