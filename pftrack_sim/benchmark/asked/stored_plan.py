"""A plan that is stored with a run: reading it, and how it differs from the one that is asked for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, cast

from pydantic import ValidationError

from pftrack_sim.benchmark.asked.plan import Plan
from pftrack_sim.core.errors import RunError


def read_plan(record: object, source: str) -> Plan:
    """Make a plan of its JSON record; `source` is named in the message.

    Raises:
        RunError: It is no plan.
    """
    try:
        return Plan.model_validate(record)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise RunError(f"{source}: not a plan this version can read: {where or 'plan'}: {first['msg']}") from None


def differences(given: Plan, stored: Plan, *, limit: int = 5) -> list[str]:
    """Differences of two plans, one line each: `"trackers: stay there, ko2012 asked for"`."""
    records = _by_name(given), _by_name(stored)
    # The code of a tracker that only one of them has is no further difference.
    both = records[0]["code"].keys() & records[1]["code"].keys()
    for record in records:
        record["code"] = {name: digest for name, digest in record["code"].items() if name in both}
    found = list(_differences("", *records))
    return found[:limit] + ([f"and {len(found) - limit} more"] if len(found) > limit else [])


def _by_name(plan: Plan) -> dict[str, Any]:
    """The plan's record with names as keys, so that a difference is reported with the name and not the index."""
    record: dict[str, Any] = {**plan.model_dump(mode="json"), "trackers": list(plan.labels)}
    record["code"] = {name: digest[:12] for tracker in plan.trackers for name, digest in tracker.code.items()}
    for values, sweep in zip(record["sweeps"], plan.sweeps, strict=True):
        values["scenarios"] = {scenario.name: scenario.tree for scenario in sweep.scenarios}
        values["conditions"] = [condition.name for condition in sweep.conditions]
    return record | record.pop("sweeps")[0] if len(plan.sweeps) == 1 else record


def _differences(path: str, given: Any, stored: Any) -> Iterator[str]:
    if given == stored:
        return
    if isinstance(given, Mapping) and isinstance(stored, Mapping):
        mine, theirs = cast("Mapping[str, Any]", given), cast("Mapping[str, Any]", stored)
        if set(mine) & set(theirs):
            for key in dict.fromkeys([*mine, *theirs]):
                yield from _differences(f"{path}.{key}" if path else key, mine.get(key), theirs.get(key))
            return
    yield f"{path}: {_short(stored)} there, {_short(given)} asked for"


def _short(value: Any) -> str:
    if value is None:
        return "nothing"
    if isinstance(value, (Mapping, list)):
        value = ", ".join(str(item) for item in cast("list[object]", value))
    text = str(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
