"""The tree of a scenario as TOML."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import cast

from pftrack_sim.scenario.ranges import Tree, is_range


def toml_text(tree: Tree) -> str:
    """A tree of tables, lists, texts, numbers and booleans as TOML; parsed again it is the same tree.

    >>> print(toml_text({"title": "walk", "target": {"path_m": [[0, 0], [9, {"uniform": [-1.5, 1.5]}]]}}))
    title = "walk"
    <BLANKLINE>
    [target]
    path_m = [[0, 0], [9, {uniform = [-1.5, 1.5]}]]
    <BLANKLINE>
    """
    return "\n".join(_lines(tree, ())).lstrip("\n") + "\n"


def toml_value(value: object) -> str:
    """One value; tables are written inline."""
    if isinstance(value, Mapping):
        pairs = cast("Mapping[str, object]", value).items()
        return "{" + ", ".join(f"{_key(key)} = {toml_value(one)}" for key, one in pairs) + "}"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return "[" + ", ".join(map(toml_value, cast("Sequence[object]", value))) + "]"
    if isinstance(value, float):
        return repr(float(value))  # shortest text that is read as the same number; inf and nan are TOML too
    return json.dumps(value).replace("\x7f", "\\u007f")


def _lines(table: Mapping[str, object], path: tuple[str, ...]) -> list[str]:
    below = [key for key, value in table.items() if isinstance(value, Mapping) and not is_range(cast("object", value))]
    lines = [f"{_key(key)} = {toml_value(value)}" for key, value in table.items() if key not in below]
    if path and (lines or not below):
        lines = ["", f"[{'.'.join(map(_key, path))}]", *lines]
    for key in below:
        lines += _lines(cast("Mapping[str, object]", table[key]), (*path, key))
    return lines


def _key(key: str) -> str:
    return key if key and all(one.isascii() and (one.isalnum() or one in "_-") for one in key) else json.dumps(key)
