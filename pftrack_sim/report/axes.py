"""Tables about the stress axes for documents: what severity 1 is, and what each level changes in a profile."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, cast

from pftrack_sim.core.errors import RunError
from pftrack_sim.scenario.axes import axes_by_name

_LEAST_CHANGE = 0.25


def axes_rows() -> Iterator[list[str]]:
    """Rows of axis, headline at severity 1 with its unit, law, and source."""
    for name, axis in axes_by_name().items():
        yield [f"`{name}`", f"{axis(severity=1.0).physical:.3g} {axis.unit}", axis.law, axis.source]


def profile_rows(path: Path) -> Iterator[list[str]]:
    """Rows of condition, and the numbers of its profile that differ by a quarter from the first of the scenario.

    Args:
        path: `profile.json` of `pftrack-sim profile SCENARIO --axis ... --out DIR`.

    Raises:
        RunError: It cannot be read.
    """
    try:
        profiles = cast("dict[str, dict[str, float | None]]", json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError) as error:
        raise RunError(f"{path} cannot be read: {error}") from None
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
