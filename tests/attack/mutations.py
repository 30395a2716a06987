"""Structure-aware mutations of trees of settings, of text, and of files."""

from __future__ import annotations

import copy
import os
import shutil
from pathlib import Path
from typing import Any

from hypothesis import strategies as st

NASTY = st.sampled_from(
    [
        *(0, 1, -1, 2**31, 2**63, 2**70, 10**400, -(10**400)),
        *(0.0, -0.0, 1e-300, 1e-3, 1e9, 3e7, 1e308, -1e308, float("nan"), float("inf"), float("-inf")),
        *("", "x", "\udcff", "\x00", "\x1b[2J", "x" * 5000, "=1+1", "../../etc/passwd", "a:b", "$x^{", "人"),
        *(None, True, False, b"bytes", object(), (), [], {}, [[]], {"": {}}, [0] * 5000, {"kind": "nonsense"}),
        *({"uniform": [0, 1]}, {"uniform": [1, 0]}, {"uniform": [-1e308, 1e308]}, {"uniform": "ab"}, {"uniform": []}),
        *({"integer": [0, 2**70]}, {"integer": [0.5, 1]}, {"integer": [True, False]}, {"choice": []}),
        *({"choice": [{"choice": [1]}]}, {"choice": list(range(3000))}, {"uniform": [0, 1], "choice": [1]}),
    ]
)
"""Values that somebody may write anywhere."""


def deep(levels: int) -> Any:
    tree: Any = 1
    for level in range(levels):
        tree = [tree] if level % 2 else {"a": tree}
    return tree


VALUES = NASTY | st.sampled_from([1, 20, 30, 200]).map(deep) | st.floats() | st.integers() | st.text(max_size=40)


def paths(tree: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Every place in a tree."""
    items = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, (list, tuple)) else ()
    return [path, *(below for key, value in items for below in paths(value, (*path, key)))]


def mutated(tree: Any, data: Any) -> Any:
    """The tree with one to three of its places replaced, removed, renamed, repeated or wrapped."""
    changed = copy.deepcopy(tree)
    for _ in range(data.draw(st.integers(1, 3), label="changes")):
        path = data.draw(st.sampled_from(paths(changed)), label="path")
        if not path:
            continue
        node = changed
        for key in path[:-1]:
            node = node[key]
        how = data.draw(st.sampled_from(["replace", "remove", "rename", "repeat", "wrap"]), label="how")
        if how == "remove":
            del node[path[-1]]
        elif how == "rename" and isinstance(node, dict):
            node[data.draw(st.text(max_size=20) | st.just("x" * 5000), label="name")] = node.pop(path[-1])
        elif how == "repeat" and isinstance(node[path[-1]], list):
            node[path[-1]] = node[path[-1]] * data.draw(st.integers(0, 3000), label="times")
        elif how == "wrap":
            node[path[-1]] = {data.draw(st.sampled_from(["uniform", "integer", "choice", "x"])): [node[path[-1]]] * 2}
        else:
            # Copied: a later change within it would change the list of values.
            node[path[-1]] = copy.deepcopy(data.draw(VALUES, label="value"))
    return changed


def mutated_bytes(content: bytes, data: Any) -> bytes:
    """The content with a bit flipped, a piece cut, repeated or put in."""
    place = data.draw(st.integers(0, max(len(content) - 1, 0)), label="place")
    how = data.draw(st.sampled_from(["flip", "cut", "end", "repeat", "insert"]), label="how")
    length = data.draw(st.integers(1, 200), label="length")
    if how == "flip" and content:
        bit = 1 << data.draw(st.integers(0, 7), label="bit")
        return content[:place] + bytes([content[place] ^ bit]) + content[place + 1 :]
    if how == "cut":
        return content[:place] + content[place + length :]
    if how == "end":
        return content[:place]
    if how == "repeat":
        return content[:place] + content[place : place + length] * 50 + content[place + length :]
    return content[:place] + data.draw(st.binary(max_size=60), label="bytes") + content[place:]


def mutate_folder(folder: Path, data: Any) -> str:
    """Change one file of a folder; returns its path within it."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    path = data.draw(st.sampled_from(files), label="file")
    other = data.draw(st.sampled_from(files), label="other")
    how = data.draw(
        st.sampled_from(["bytes", "bytes", "bytes", "remove", "swap", "rename", "folder", "pipe", "link"]), label="do"
    )
    if how == "bytes":
        path.write_bytes(mutated_bytes(path.read_bytes(), data))
    elif how == "rename":
        path.rename(path.with_name(data.draw(st.sampled_from(["a", f"{path.stem}0{path.suffix}"]), label="name")))
    elif how == "swap":
        if path != other:
            shutil.copy(other, path)
    else:
        path.unlink()
        if how == "folder":
            path.mkdir()
        elif how == "pipe":
            os.mkfifo(path)
        elif how == "link":
            path.symlink_to(data.draw(st.sampled_from(["/dev/zero", "/nowhere", ".", path.name])))
    return path.relative_to(folder).as_posix()
