"""`extends`: a scenario that names others and holds only what differs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TypeGuard

from pftrack_sim.core.errors import ScenarioError, UnknownNameError
from pftrack_sim.core.text import one_line
from pftrack_sim.scenario.ranges import Tree, is_list, is_mapping, is_range

KEY = "extends"
MEASURED = "measured"
"""Table that `pftrack-sim measure` writes beside the axes: where their numbers are from. No part of a scenario."""

_MOST = 16  # Bases of a scenario, those of its bases among them


def extended(name: str, tree: Tree, read: Callable[[str, Path | None], tuple[Path, Tree]], path: Path | None) -> Tree:
    """A tree with those of its bases below it: tables are merged, everything else is replaced.

    Args:
        name: The scenario's, for messages.
        tree: Contents of its file; its key `extends` names a base, or several, of which a later one wins.
        read: The path and tree of a base of this name; the second argument is the file that names it.
        path: Its file; None if it has none.

    Raises:
        ScenarioError: An unknown base, or a cycle, or more than 16 bases.
    """
    count = 0

    def below(tree: Tree, chain: tuple[Path, ...], file: Path | None) -> Tree:
        nonlocal count
        given = tree.get(KEY, [])
        bases = [given] if isinstance(given, str) else given
        if not is_list(bases) or not all(isinstance(one, str) for one in bases):
            raise ScenarioError(name, [f"{KEY}: takes a scenario's name or path, or a list of them, got {given!r}"])
        merged: Tree = {}
        for base in bases:
            count += 1
            try:
                base_path, base_tree = read(base, file)
            except UnknownNameError as error:
                raise ScenarioError(name, [f"{KEY}: {error}"]) from None
            if base_path in chain or count > _MOST:
                wrong = "a scenario extends itself" if base_path in chain else f"more than {_MOST} bases"
                words = " -> ".join(one_line(one.name, 60) for one in (*chain, base_path)[-6:])
                raise ScenarioError(name, [f"{KEY}: {wrong}: {words}"])
            merged = _merged(merged, below(base_tree, (*chain, base_path), base_path))
        own = {key: value for key, value in tree.items() if key not in (KEY, MEASURED)}
        return _merged(merged, own)

    return below(tree, (path,) if path is not None else (), path)


def _merged(base: Tree, own: Tree) -> Tree:
    result = dict(base)
    for key, value in own.items():
        below = base.get(key)
        if _is_table(value) and _is_table(below) and _same_kind(below, value):
            result[key] = _merged(below, value)
        else:
            result[key] = value
    return result


def _is_table(value: object) -> TypeGuard[Tree]:
    return is_mapping(value) and not is_range(value)


def _same_kind(base: Tree, own: Tree) -> bool:
    """Whether keys of both may stand together: a route of another kind has others."""
    return "kind" not in own or own["kind"] == base.get("kind")
