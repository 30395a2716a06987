"""Validation errors as readable lines: path of the key, value given, what is allowed, nearest valid key."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from typing import Any, cast

from pydantic import ValidationError

from pftrack_sim.core.errors import did_you_mean
from pftrack_sim.scenario.model import ResolvedScenario
from pftrack_sim.scenario.ranges import KeyPath, Tree, dotted


def problems(error: ValidationError, tree: Tree, schema: dict[str, Any] | None = None) -> Iterator[str]:
    """One line per validation error that pydantic raised for a tree whose ranges were already replaced.

    `schema` is the JSON Schema of the validated model; that of a scenario if None.
    """
    schema = schema if schema is not None else json_schema()
    for found in error.errors(include_url=False):
        path = _path_in(tree, found["loc"])
        kind = found["type"]
        given = found.get("input")
        context = found.get("ctx", {})
        if kind == "extra_forbidden":
            allowed = _allowed_keys(path[:-1], tree, schema)
            yield (
                f"{dotted(path)}: unknown key (value {_short(given)}){did_you_mean(str(path[-1]), allowed)} "
                f"(allowed: {', '.join(allowed) or 'none'})"
            )
        elif kind == "missing":
            yield f"{dotted(path)}: required key is missing"
        elif kind == "literal_error":
            allowed = [word.strip("' ") for word in str(context["expected"]).replace(" or ", ", ").split(", ")]
            near = did_you_mean(str(given), allowed)
            yield f"{dotted(path)}: got {_short(given)}{near} (allowed: {', '.join(allowed)})"
        elif kind == "union_tag_invalid":
            allowed = [word.strip("' ") for word in str(context["expected_tags"]).split(", ")]
            tag = context["tag"]
            yield f"{dotted(path)}.kind: got {tag!r}{did_you_mean(str(tag), allowed)} (allowed: {', '.join(allowed)})"
        elif kind == "union_tag_not_found":
            yield f"{dotted(path)}.kind: required key is missing (it selects the kind of this table)"
        else:
            message = found["msg"].removeprefix("Value error, ")
            message = message[:1].lower() + message[1:]
            yield f"{dotted(path) or 'scenario'}: got {_short(given)}: {message}"


def _path_in(tree: object, loc: Sequence[str | int]) -> KeyPath:
    """Path of keys without the union tags that pydantic inserts."""
    path: list[str | int] = []
    node = tree
    for position, part in enumerate(loc):
        last = position == len(loc) - 1
        if isinstance(node, Mapping):
            table = cast("Mapping[str | int, object]", node)
            if part in table:
                node = table[part]
            elif not last or table.get("kind") == part:
                continue
        elif isinstance(node, (list, tuple)) and isinstance(part, int):
            items = cast("Sequence[object]", node)
            node = items[part] if part < len(items) else None
        path.append(part)
    return tuple(path)


@cache
def json_schema() -> dict[str, Any]:
    """JSON Schema of a scenario without ranges."""
    return ResolvedScenario.model_json_schema()


def _allowed_keys(path: KeyPath, tree: object, schema: dict[str, Any]) -> list[str]:
    """Keys allowed in the table at `path`; for a union, those of the alternative selected by its `kind`."""
    node: Any = schema
    value: Any = tree
    for part in path:
        node = _resolved(node, schema, value)
        node = node.get("items", {}) if isinstance(part, int) else node.get("properties", {}).get(part, {})
        value = value[part]
    return sorted(_resolved(node, schema, value).get("properties", {}))


def _resolved(node: Any, schema: dict[str, Any], value: Any) -> Any:
    while True:
        if "$ref" in node:
            node = schema["$defs"][node["$ref"].rsplit("/", 1)[1]]
        elif "discriminator" in node:
            kind = cast("Mapping[str, Any]", value).get("kind") if isinstance(value, Mapping) else None
            reference = node["discriminator"]["mapping"].get(kind)
            if reference is None:
                return {}
            node = {"$ref": reference}
        else:
            return node


def _short(value: object) -> str:
    if isinstance(value, float) and math.isfinite(value):
        return f"{value:g}"
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
