"""Validation errors as lines (path of the key, value given, what is allowed), and the JSON Schema for editors."""

from __future__ import annotations

import copy
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from typing import Any

from pydantic import ValidationError

from pftrack_sim.core.errors import did_you_mean
from pftrack_sim.scenario.files import EXTENDS
from pftrack_sim.scenario.model import ResolvedScenario
from pftrack_sim.scenario.ranges import KeyPath, Tree, dotted, is_list, is_mapping

_PYTHON = re.compile(r"valid dictionary(?: or instance of \w+)?")
"""What pydantic calls a table."""


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
        elif kind in ("literal_error", "union_tag_invalid"):
            if kind == "union_tag_invalid":
                path, given = (*path, "kind"), context["tag"]
            words = str(context.get("expected_tags") or context["expected"]).replace(" or ", ", ")
            allowed = [word.strip("' ") for word in words.split(", ")]
            near = did_you_mean(str(given), allowed)
            yield f"{dotted(path)}: got {_short(given)}{near} (allowed: {', '.join(allowed)})"
        elif kind == "union_tag_not_found":
            yield f"{dotted(path)}.kind: required key is missing (it selects the kind of this table)"
        else:
            message = found["msg"].removeprefix("Value error, ")
            message = message[:1].lower() + _PYTHON.sub("table", message[1:].replace("valid tuple", "list"))
            # Of a whole table the message says itself which of its keys do not go together.
            got = "" if isinstance(given, Mapping) else f"got {_short(given)}: "
            yield f"{dotted(path)}: {got}{message}" if path else message


def _path_in(tree: object, loc: Sequence[str | int]) -> KeyPath:
    """Path of keys without the union tags that pydantic inserts."""
    path: list[str | int] = []
    node = tree
    for position, part in enumerate(loc):
        last = position == len(loc) - 1
        if is_mapping(node):
            if isinstance(part, str) and part in node:
                node = node[part]
            elif not last or node.get("kind") == part:
                continue
        elif is_list(node) and isinstance(part, int):
            node = node[part] if part < len(node) else None
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
        node = resolved_node(node, schema, value)
        node = node.get("items", {}) if isinstance(part, int) else node.get("properties", {}).get(part, {})
        # A table that may be left out is one of two alternatives.
        node = next((one for one in node.get("anyOf", ()) if "$ref" in one), node)
        value = value[part]
    known = sorted(resolved_node(node, schema, value).get("properties", {}))
    return [EXTENDS, *known] if not path and schema is json_schema() else known


def resolved_node(node: Any, schema: dict[str, Any], value: Any) -> Any:
    """A node of a schema with its references followed; of alternatives, that of the value's `kind`, or nothing."""
    while True:
        if "$ref" in node:
            node = schema["$defs"][node["$ref"].rsplit("/", 1)[1]]
        elif "discriminator" in node:
            kind = value.get("kind") if is_mapping(value) else None
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


def editor_schema() -> dict[str, Any]:
    """Schema for TOML editors: every leaf may also be a range."""
    schema = copy.deepcopy(json_schema())
    definitions: dict[str, dict[str, Any]] = schema["$defs"]
    for table in [schema, *definitions.values()]:
        properties: dict[str, dict[str, Any]] = table.get("properties", {})
        properties |= {key: _or_range(leaf) for key, leaf in properties.items() if key != "kind"}
    definitions["Range"] = {
        "description": "Drawn once per seed.",
        "oneOf": [
            _one_key("uniform", {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2}),
            _one_key("integer", {"type": "array", "items": {"type": "integer"}, "minItems": 2, "maxItems": 2}),
            _one_key("choice", {"type": "array", "minItems": 1}),
        ],
    }
    required = schema.pop("required")
    base = {"type": "string", "minLength": 1}
    schema["properties"][EXTENDS] = {
        "description": "Names or paths of scenarios, of which this one holds only what differs.",
        "anyOf": [base, {"type": "array", "items": base}],
    }
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        **schema,
        "anyOf": [{"required": required}, {"required": [EXTENDS]}],
        "title": "pftrack_sim scenario",
    }


def _one_key(name: str, value: dict[str, Any]) -> dict[str, Any]:
    return {"type": "object", "properties": {name: value}, "required": [name], "additionalProperties": False}


def _or_range(leaf: dict[str, Any]) -> dict[str, Any]:
    described = {key: leaf[key] for key in ("description", "default", "title") if key in leaf}
    bare = {key: value for key, value in leaf.items() if key not in described}
    if bare.get("type") == "array":
        # Points and bands: each number within may be a range of its own.
        if "items" in bare:
            bare["items"] = _or_range(bare["items"])
        if "prefixItems" in bare:
            bare["prefixItems"] = [_or_range(one) for one in bare["prefixItems"]]
    return {**described, "anyOf": [bare, {"$ref": "#/$defs/Range"}]}
