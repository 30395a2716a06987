"""What was measured: levels with their intervals, as a table and as a TOML file that a scenario extends."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

import tomli_w
from pydantic import ValidationError

from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.inputs import parse_toml, read_bytes
from pftrack_sim.core.text import one_line
from pftrack_sim.scenario.axes import axes_by_name
from pftrack_sim.scenario.files import MEASURED
from pftrack_sim.scenario.section import Section, setting

_MAX_BYTES = 1 << 20


@dataclass(frozen=True)
class Quantity:
    """A measured number and its 95 % interval.

    Attributes:
        frames: Number of frames, or of samples, that it is from.
        axis: The stress axis whose level it is; empty for none.
        settings: Dotted keys of a scenario and the values that give it this level.
    """

    name: str
    value: float
    low: float
    high: float
    unit: str
    frames: int
    axis: str = ""
    settings: Mapping[str, Any] = field(default_factory=dict[str, Any])


@dataclass(frozen=True)
class Measured:
    """What a material tells.

    Attributes:
        source: Its name.
        quantities: What could be told.
        left_out: What could not, and why.
        doubts: What may be wrong with the numbers.
    """

    source: str
    quantities: tuple[Quantity, ...]
    left_out: Mapping[str, str] = field(default_factory=dict[str, str])
    doubts: tuple[str, ...] = ()


class Level(Section):
    """A level of a stress axis, as the table `measured` of a file has it."""

    level: float = setting(..., "In the axis' unit.", ge=0)
    low: float = setting(..., "Lower end of its 95 % interval.", ge=0)
    high: float = setting(..., "Upper end.", ge=0)
    unit: str = setting(..., "Unit of all three.")
    source: str = setting("", "What it was measured in.")
    frames: int = setting(0, "From how many frames or samples.")


def as_toml(found: Measured) -> str:
    """The text of a file that a scenario extends: parameters of the axes, and the table `measured`."""
    tree: dict[str, Any] = {}
    for one in found.quantities:
        for key, value in one.settings.items():
            *tables, last = key.split(".")
            node = tree
            for table in tables:
                node = node.setdefault(table, {})
            node[last] = _rounded(value)
        if one.axis:
            level = {"level": one.value, "low": one.low, "high": one.high}
            row = {key: _rounded(value) for key, value in level.items()}
            tree.setdefault(MEASURED, {})[one.axis] = {
                **row, "unit": one.unit, "source": found.source, "frames": one.frames
            }  # fmt: skip
    notes = [f"# {name}: left out: {why}" for name, why in found.left_out.items()]
    notes += [f"# {doubt}" for doubt in found.doubts]
    return "\n".join([f"# Measured in {found.source}; a scenario takes it: extends = [\"corridor\", \"THIS FILE\"]",
                      *notes, "", tomli_w.dumps(tree)])  # fmt: skip


def read_levels(path: Path) -> dict[str, Level]:
    """Levels by axis, from a file that `measure` has written.

    Raises:
        ParameterError: It cannot be read, has no table `measured`, or one with another content.
    """
    try:
        table = parse_toml(read_bytes(path, _MAX_BYTES).decode()).get(MEASURED)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else one_line(str(error))
        raise ParameterError(f"{path}: cannot be read as TOML: {reason}") from None
    if not isinstance(table, dict) or not table:
        raise ParameterError(f"{path}: has no table [{MEASURED}.AXIS]; pftrack-sim measure writes one with --out")
    levels: dict[str, Level] = {}
    for axis, row in cast("dict[str, object]", table).items():
        try:
            levels[axis] = Level.model_validate(row)
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            where = ".".join(str(part) for part in (MEASURED, axis, *first["loc"]))
            raise ParameterError(f"{path}: {where}: {first['msg'].lower()}") from None
        known = axes_by_name()
        if axis not in known or levels[axis].unit != known[axis].unit:
            wanted = f"in {known[axis].unit}" if axis in known else f"one of {', '.join(known)}"
            raise ParameterError(f"{path}: {MEASURED}.{axis} must be {wanted}, got {levels[axis].unit!r}")
    return levels


def _rounded(value: Any) -> Any:
    if isinstance(value, float):
        return float(f"{value:.4g}")
    return [_rounded(one) for one in cast("list[Any]", value)] if isinstance(value, list) else value
