"""What a search has found, as `limits.json` in its run folder."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, TypeAlias

from pydantic import ValidationError

from pftrack_sim.benchmark.kept.checksums import Checksums
from pftrack_sim.benchmark.kept.files import write_bytes
from pftrack_sim.benchmark.limits.scale import Mixed
from pftrack_sim.core.errors import RunError
from pftrack_sim.core.inputs import parse_json, read_bytes
from pftrack_sim.core.text import one_line
from pftrack_sim.scenario.section import Section

LIMITS = "limits.json"
_MAX_BYTES = 16 << 20

Verdict: TypeAlias = Literal[
    "breaks",
    "never breaks within the range",
    "breaks below the lowest level",
    "broken from the start",
    "undecided",
    "not monotone",
]


class Tried(Section):
    """Outcomes at a level: successes, and all episodes in which there could be one."""

    level: float
    successes: int
    episodes: int


class Example(Section):
    """An episode near a breaking point."""

    level: float
    condition: str
    seed: int


class Limit(Section):
    """The breaking point of one tracker on one axis of one scenario; levels are in the axis' unit.

    Attributes:
        range: Lowest level above 0, and highest.
        typical: Level of severity 1; None for an axis of the run.
        breaking_point: Median of its posterior; None where it is not within the range or the verdict is not `breaks`.
        low: Lower end of its 95 % interval; None where it is open.
        high: Upper end; None where it is open.
        monotone_p: p-value of a success rate that never rises with the level.
        episodes: How many the tracker has run, those in which the target is never seen among them.
        stopped: Why no more were run.
        curve: Levels and posterior mean of the success rate there.
        held: The success nearest below the breaking point.
        failed: The failure nearest above it.
        mix: The axes that rise together, where there are several.
    """

    scenario: str
    axis: str
    unit: str
    range: tuple[float, float]
    typical: float | None
    tracker: str
    verdict: Verdict
    breaking_point: float | None
    low: float | None
    high: float | None
    monotone_p: float
    episodes: int
    stopped: str
    tried: tuple[Tried, ...]
    curve: tuple[tuple[float, float], ...]
    held: Example | None
    failed: Example | None
    mix: tuple[Mixed, ...] = ()


class Difference(Section):
    """Breaking point of `first` minus that of `second`, both of which break, with the ends of its 95 % interval.

    Attributes:
        correlation: Of the errors of both, from the outcomes of the episodes that both saw.
    """

    scenario: str
    axis: str
    unit: str
    first: str
    second: str
    difference: float
    low: float
    high: float
    correlation: float


class Limits(Section):
    """Content of `limits.json`."""

    format: Literal[1] = 1
    success: str
    at: float
    limits: tuple[Limit, ...]
    differences: tuple[Difference, ...]


def write_limits(path: Path, found: Limits) -> None:
    """Write what was found into a run folder."""
    write_bytes(path / LIMITS, (found.model_dump_json(indent=1) + "\n").encode())
    Checksums(path).update(LIMITS)


def read_limits(path: Path) -> Limits:
    """What a search has found, from its run folder.

    Raises:
        RunError: There is none, or it is damaged.
    """
    try:
        return Limits.model_validate(parse_json(read_bytes(path / LIMITS, _MAX_BYTES)))
    except FileNotFoundError:
        raise RunError(f"{path} has no limits: it has no {LIMITS}") from None
    except (OSError, ValueError, ValidationError) as error:
        raise RunError(f"{path / LIMITS} cannot be read: {one_line(str(error))}") from None
