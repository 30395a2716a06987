"""JSON Schema of a scenario file, ranges included, for completion and validation in editors."""

from __future__ import annotations

import copy
from typing import Any, cast

from pftrack_sim.scenario.validation import json_schema


def editor_schema() -> dict[str, Any]:
    """Schema for TOML editors: every leaf may also be a range."""
    schema = copy.deepcopy(json_schema())
    definitions = cast("dict[str, dict[str, Any]]", schema["$defs"])
    for table in [schema, *definitions.values()]:
        properties = cast("dict[str, dict[str, Any]]", table.get("properties", {}))
        for key, leaf in properties.items():
            if key != "kind":
                properties[key] = _or_range(leaf)
    definitions["Range"] = {
        "description": "Drawn once per seed.",
        "oneOf": [
            _one_key("uniform", {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2}),
            _one_key("integer", {"type": "array", "items": {"type": "integer"}, "minItems": 2, "maxItems": 2}),
            _one_key("choice", {"type": "array", "minItems": 1}),
        ],
    }
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        **schema,
        "title": "pftrack_sim scenario",
    }


def _one_key(name: str, value: dict[str, Any]) -> dict[str, Any]:
    return {"type": "object", "properties": {name: value}, "required": [name], "additionalProperties": False}


def _or_range(leaf: dict[str, Any]) -> dict[str, Any]:
    described = {key: leaf[key] for key in ("description", "default", "title") if key in leaf}
    bare = {key: value for key, value in leaf.items() if key not in described}
    if bare.get("type") == "array":
        # Points and bands: each number within may be a range of its own.
        for key in ("items", "prefixItems"):
            if key in bare:
                inner = bare[key]
                bare[key] = (
                    [_or_range(cast("dict[str, Any]", item)) for item in cast("list[object]", inner)]
                    if isinstance(inner, list)
                    else _or_range(cast("dict[str, Any]", inner))
                )
    return {**described, "anyOf": [bare, {"$ref": "#/$defs/Range"}]}
