"""Tables of profiles for documents: what conditions change, and scenarios by tier beside recorded video."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, cast

import numpy as np

from pftrack_sim.core.errors import RunError
from pftrack_sim.scenario import load
from pftrack_sim.score.profile import ends_reached, recorded_quantiles

_LEAST_CHANGE = 0.25


def profile_table(path: Path) -> Iterator[list[str]]:
    """Head and rows: of what conditions change if a name has one, as `corridor jitter=2`; else of scenarios by tier.

    Args:
        path: `profile.json` of `pftrack-sim profile SCENARIO... --out DIR`.

    Raises:
        RunError: It cannot be read.
        UnknownNameError: A name is none of a scenario.
    """
    try:
        profiles = cast("dict[str, dict[str, float | None]]", json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError) as error:
        raise RunError(f"{path} cannot be read: {error}") from None
    if any(" " in name for name in profiles):
        yield ["Condition", "profile: from the base scenario's to"]
        yield from _condition_rows(profiles)
    else:
        yield from _tier_rows(profiles)


def _condition_rows(profiles: Mapping[str, Mapping[str, float | None]]) -> Iterator[list[str]]:
    """Rows of condition, and the numbers of its profile that differ by a quarter from the first of the scenario."""
    bases: dict[str, Mapping[str, Any]] = {}
    for name, numbers in profiles.items():
        base = bases.setdefault(name.partition(" ")[0], numbers)
        if numbers is not base:
            pairs = {key: (base[key], value) for key, value in numbers.items() if base[key] and value is not None}
            changed = [
                f"`{key}` {before:.3g} -> {after:.3g}"
                for key, (before, after) in pairs.items()
                if before and abs(math.log(max(after, 1e-9) / before)) > math.log1p(_LEAST_CHANGE)
            ]
            yield [name, ", ".join(changed) or "none by a quarter"]


def _tier_rows(profiles: Mapping[str, Mapping[str, float | None]]) -> Iterator[list[str]]:
    """Head and rows of a number's medians and, by tier, its least and greatest."""
    tiers = {name: load(name).tree.get("tier", "easy") for name in profiles}
    shown = [tier for tier in ("real", "hard", "easy") if tier in tiers.values()]
    yield [
        *("number", "recorded 25 to 75 %", f"median of {len(tiers)}"),
        *(f"median of {list(tiers.values()).count(tier)} `{tier}`" for tier in shown),
        *("recorded 10 to 90 %", *(f"`{tier}`" for tier in shown), "ends reached"),
    ]
    for key, (low, quarter, _, three_quarters, high) in recorded_quantiles().items():
        values = {name: value for name, numbers in profiles.items() if (value := numbers[key]) is not None}
        by_tier = [[value for name, value in values.items() if tiers[name] == tier] for tier in shown]
        medians = [float(np.median(some)) if some else np.nan for some in (list(values.values()), *by_tier)]
        outside = ["" if quarter <= median <= three_quarters else " (outside)" for median in medians]
        yield [
            *(f"`{key}`", f"{quarter:.3g} to {three_quarters:.3g}"),
            *(f"{median:.3g}{mark}" for median, mark in zip(medians, outside, strict=True)),
            f"{low:.3g} to {high:.3g}",
            *(f"{min(some):.3g} to {max(some):.3g}" if some else "-" for some in by_tier),
            ends_reached(key, list(values.values())),
        ]
