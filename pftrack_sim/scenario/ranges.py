"""Ranges in a scenario: any value may be drawn per seed instead of fixed.

    speed_m_s = {uniform = [1.1, 1.4]}      a real number between the two
    count     = {integer = [2, 5]}          a whole number, both ends included
    side      = {choice = ["left", "right"]}

Each draw has its own random stream, named after its key: adding a range changes no other draw.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, TypeAlias, TypeGuard

from pftrack_sim.core.random_streams import stream

Tree: TypeAlias = dict[str, Any]
KeyPath: TypeAlias = tuple[str | int, ...]

KINDS = ("uniform", "integer", "choice")
MAX_CHOICES = 1000  # Alternatives of a choice
MOST = 1e9  # Largest end of a range: drawing beyond would overflow


def dotted(path: KeyPath) -> str:
    """`("occluders", 0, "at_s")` as `occluders.0.at_s`."""
    return ".".join(str(part) for part in path)


def is_mapping(value: object) -> TypeGuard[Tree]:
    """Whether a value of a tree is a table or a range."""
    return isinstance(value, Mapping)


def is_range(value: object) -> TypeGuard[Tree]:
    """Whether a value of a tree is a range."""
    return is_mapping(value) and len(value) == 1 and next(iter(value)) in KINDS


def is_list(value: object) -> TypeGuard[list[Any]]:
    """Whether a value of a tree is a list."""
    return isinstance(value, (list, tuple))


def draw(value: Mapping[str, Any], seed: int, path: KeyPath) -> object:
    """One value of a well-formed range, drawn from the stream of its key."""
    kind, given = next(iter(value.items()))
    rng = stream(seed, "scenario", dotted(path))
    if kind == "uniform":
        return rng.uniform(float(given[0]), float(given[1]))
    if kind == "integer":
        return int(rng.integers(int(given[0]), int(given[1]), endpoint=True))
    return given[int(rng.integers(len(given)))]


def problem(value: Mapping[str, Any]) -> str | None:
    """Error message for a malformed range, or None."""
    kind, items = next(iter(value.items()))
    if not is_list(items) or not items:
        return f"{kind} needs a list, got {items!r}"
    if len(items) > MAX_CHOICES:
        return f"{kind} takes at most {MAX_CHOICES} values, got {len(items)}"
    if kind == "choice":
        return "a choice cannot hold ranges" if next(walk(items), None) is not None else None
    wanted = (int,) if kind == "integer" else (int, float)
    if len(items) != 2 or not all(isinstance(item, wanted) and not isinstance(item, bool) for item in items):
        noun = "whole numbers" if kind == "integer" else "numbers"
        return f"{kind} needs [low, high], two {noun}, got {list(items[:3])!r}"
    low, high = items
    if not (abs(low) <= MOST and abs(high) <= MOST):
        return f"{kind} takes numbers from {-MOST:g} to {MOST:g}"
    if not low <= high:
        return f"{kind} needs low <= high, got {list(items)!r}"
    return None


def walk(tree: object, path: KeyPath = ()) -> Iterator[tuple[KeyPath, Mapping[str, Any]]]:
    """Every range in a tree with the path of its key."""
    if is_range(tree):
        yield path, tree
    elif is_mapping(tree):
        for key, value in tree.items():
            yield from walk(value, (*path, key))
    elif is_list(tree):
        for index, value in enumerate(tree):
            yield from walk(value, (*path, index))


def replaced(tree: object, values: Mapping[KeyPath, object], path: KeyPath = ()) -> Any:
    """A copy of a tree with the values at some paths replaced."""
    if path in values:
        return values[path]
    if is_mapping(tree):
        return {key: replaced(value, values, (*path, key)) for key, value in tree.items()}
    if is_list(tree):
        return [replaced(value, values, (*path, index)) for index, value in enumerate(tree)]
    return tree
