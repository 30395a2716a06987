"""Scenarios as their authors see them: a commented one to start from, and the line that a problem is on."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from pftrack_sim.scenario.validation import json_schema, resolved_node

_START: dict[str, Any] = {
    "title": "My scenario",
    "duration_s": 12.0,
    "place": {"kind": "plaza"},
    "robot": {"gaze": "target", "route": {"kind": "trail", "distance_m": 3.5}},
    "camera": {"width_px": 640, "height_px": 480, "fovy_deg": 50.0},
    "target": {"path": "auto"},
    "distractors": {"count": 3},
}
_HEAD = """\
# What has a comment sign before it is the default. Units are in the keys, and any value may be a range that is drawn
# per seed: {uniform = [1.0, 1.4]}, {integer = [2, 5]} or {choice = [0.4, 0.8]}. `pftrack-sim map` draws it from above.
"""
_KEY = re.compile(r"""^\s*([\w"'.-]+)\s*=""")
_FILLED = ("model_digest", "motion_digest", "calibrated")  # From the files that other keys name
_TABLE = re.compile(r"^\s*(\[\[?)\s*([\w\"'. -]+?)\s*\]\]?")


def template() -> str:
    """A scenario with every key: what it needs is set, everything else is a comment with meaning and default."""
    return _HEAD + "\n".join(_lines(json_schema(), "", _START)) + "\n"


def _lines(node: Mapping[str, Any], path: str, given: Mapping[str, Any]) -> Iterator[str]:
    """Lines of a table: its own values, then the tables in it."""
    below: list[str] = []
    for key, leaf in node["properties"].items():
        if key in _FILLED:
            continue
        schema, name, own = json_schema(), f"{path}.{key}".lstrip("."), given.get(key, {})
        found, meaning = resolved_node(leaf, schema, own), " ".join(leaf.get("description", "").split())
        items = resolved_node(found.get("items", {}), schema, {})
        kinds = found.get("items", {}).get("discriminator", {}).get("mapping", {})
        if "properties" in found:
            about = " ".join(found.get("description", "").split("\n\n")[0].split())
            head, keys = ("" if key in given else "# ") + f"[{name}]", found["properties"]
            # Of the stress axes, how severe they are: `pftrack-sim list axes` tells the rest.
            shown = {"properties": {"severity": keys["severity"]}} if path == "axes" else found
            below += ["", f"# {about}", head, *_lines(shown, name, own)]
        elif kinds or "properties" in items or any("$ref" in one for one in leaf.get("anyOf", ())):
            below += ["", f"# {meaning}{' Kinds: ' if kinds else ''}{_listed(kinds)}"]
            below += [f"# [[{name}]]" if found.get("type") == "array" else f"# [{name}]"]
        else:
            options = _kinds(path) if key == "kind" else leaf.get("enum", [])
            yield f"# {meaning}{' ' if meaning and options else ''}{f'One of: {_listed(options)}' if options else ''}"
            default = leaf.get("default")
            # Numbers, texts and lists of them are written in JSON as they are in TOML.
            value = given.get(key, default)
            yield ("" if key in given else "# ") + f"{key} = {'...' if value is None else json.dumps(value)}"
    yield from below


def _listed(options: Iterable[object]) -> str:
    return ", ".join(map(str, options))


def _kinds(path: str) -> list[str]:
    """Kinds that the table at a path may be of."""
    node: Any = json_schema()
    for part in path.split("."):
        node = resolved_node(node, json_schema(), {})["properties"][part]
    return sorted(node.get("discriminator", {}).get("mapping", {}))


def line_of(problem: str, text: str) -> int | None:
    """The line of a scenario's text that a problem, which begins with its key's path, is about; None for none."""
    wanted = re.split(r"\.(?=\w)", re.split(r"[:, (]", problem, maxsplit=1)[0])
    best, length, table, counts = None, 0, list[str](), dict[str, int]()
    for number, line in enumerate(text.splitlines(), start=1):
        if (found := _TABLE.match(line)) is not None:
            brackets, name = found.groups()
            table = [part.strip(" \"'") for part in name.split(".")]
            if brackets == "[[":
                counts[name] = counts.get(name, -1) + 1
                table.append(str(counts[name]))
            path = table
        elif (found := _KEY.match(line)) is not None:
            path = [*table, *(part.strip("\"'") for part in found[1].split("."))]
        else:
            continue
        common = 0
        while common < min(len(path), len(wanted)) and path[common] == wanted[common]:
            common += 1
        # A key below what is asked for is about it, one beside it is not.
        if common > length and common in (len(path), len(wanted)):
            best, length = number, common
    return best
