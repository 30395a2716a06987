"""Reading of files and trees from outside: regular files of bounded size, trees of bounded depth and size."""

from __future__ import annotations

import errno
import json
import os
import re
import stat
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

from pftrack_sim.core.text import printable

# Bounds of a tree of settings: levels, values and keys, characters of a text.
MAX_DEPTH, MAX_VALUES, MAX_TEXT = 24, 20_000, 2_000

_KEY_PART = r"""(?:(?<![\w-])[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+"""
_LONG_KEY = re.compile(f"(?:{_KEY_PART}){{{MAX_DEPTH}}}", re.ASCII)


_SAFE_PATH, _SET_HERE = "PYTHONSAFEPATH", "set by pftrack-sim"


def keep_off_working_folder() -> None:
    """Let no Python process that this one starts look for modules in the working folder, as `python -c` does."""
    os.environ.setdefault(_SAFE_PATH, _SET_HERE)


def environment_of_programs() -> dict[str, str]:
    """Environment for third-party programs, without what `keep_off_working_folder` has set."""
    return {name: value for name, value in os.environ.items() if (name, value) != (_SAFE_PATH, _SET_HERE)}


def is_file(path: Path) -> bool:
    """Whether a path is a regular file; False for names that no file can have."""
    try:
        return stat.S_ISREG(path.stat().st_mode)
    except (OSError, ValueError):
        return False


def read_bytes(path: Path, limit_bytes: int) -> bytes:
    """Content of a regular file; pipes and devices are refused without waiting for them.

    Raises:
        OSError: It cannot be read, is no regular file, or is larger than `limit_bytes`.
    """
    try:
        opened = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    except ValueError:  # a name with a zero byte
        raise OSError(errno.EINVAL, "no file can have this name") from None
    with open(opened, "rb") as file:
        found = os.fstat(file.fileno())
        if not stat.S_ISREG(found.st_mode):
            raise OSError(errno.EINVAL, "not a regular file")
        content = file.read(limit_bytes + 1)
    if len(content) > limit_bytes:
        raise OSError(errno.EFBIG, f"larger than {limit_bytes} bytes, the most that is read")
    return content


def parse_toml(text: str) -> dict[str, Any]:
    """Parse TOML into a tree within the bounds of `check_tree`.

    Raises:
        ValueError: It is not TOML, or too large or too deep.
    """
    # The parser takes the square of a key's parts.
    if _LONG_KEY.search(text):
        raise ValueError(f"nested more than {MAX_DEPTH} levels deep")
    try:
        tree = tomllib.loads(text)
    except RecursionError:
        raise ValueError(f"nested more than {MAX_DEPTH} levels deep") from None
    check_tree(tree)
    return tree


def parse_json(content: bytes) -> Any:
    """Parse JSON.

    Raises:
        ValueError: It is not JSON, or nested too deep.
    """
    try:
        return json.loads(content)
    except RecursionError:
        raise ValueError("nested too deeply") from None


def check_tree(tree: object, max_values: int = MAX_VALUES) -> None:
    """Check the bounds of a tree of tables and lists.

    Raises:
        ValueError: It is deeper than `MAX_DEPTH`, has more than `max_values` values, longer texts than `MAX_TEXT`, or
            texts that cannot be shown.
    """
    level: list[object] = [tree]
    count = 0
    for _ in range(MAX_DEPTH):
        below: list[object] = []
        for node in level:
            if isinstance(node, Mapping):
                table = cast("Mapping[object, object]", node)
                below += table.values()
                level_texts = [key for key in table if isinstance(key, str)]
            elif isinstance(node, (list, tuple)):
                below += cast("list[object]", node)
                continue
            else:
                level_texts = [node] if isinstance(node, str) else []
            if any(len(text) > MAX_TEXT for text in level_texts):
                raise ValueError(f"a text of more than {MAX_TEXT} characters")
            if any(printable(text) != text for text in level_texts if not text.isprintable()):
                raise ValueError("a text that cannot be shown: it has control characters or surrogates")
        count += len(below)
        if count > max_values:
            raise ValueError(f"more than {max_values} values")
        if not below:
            return
        level = below
    raise ValueError(f"nested more than {MAX_DEPTH} levels deep")
