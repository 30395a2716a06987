"""What a benchmark runs: scenarios x conditions x seeds, each drawn once and shown to every tracker."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pftrack_sim import scenario as scenarios
from pftrack_sim.errors import ParameterError, UnknownNameError
from pftrack_sim.scenario import Scenario, ScenarioLike
from pftrack_sim.scenario.axes import Axes


@dataclass(frozen=True)
class Condition:
    """One combination of axis levels; `()` is the scenario as it is.

    Attributes:
        levels: Pairs of axis name and severity.
    """

    levels: tuple[tuple[str, float], ...] = ()

    @property
    def name(self) -> str:
        """`"jitter=2"`, `"jitter=2,light=1"`, or `"base"`."""
        return ",".join(f"{axis}={level:g}" for axis, level in self.levels) or "base"

    @property
    def overrides(self) -> dict[str, float]:
        """The dotted keys that the levels set."""
        return {f"axes.{axis}.severity": level for axis, level in self.levels}


@dataclass(frozen=True)
class Episode:
    """One episode of the plan.

    Attributes:
        scenario: With the overrides of the plan and the condition applied.
        condition: Axis levels.
        seed: Root seed.
    """

    scenario: Scenario
    condition: Condition
    seed: int

    @property
    def name(self) -> str:
        """A name that is unique within the plan and safe as part of a file's name."""
        parts = [self.scenario.name] + ([self.condition.name] if self.condition.levels else [])
        return "__".join([*(slug(part) for part in parts), f"seed-{self.seed:04d}"])


@dataclass(frozen=True)
class Plan:
    """Everything a run will do.

    Attributes:
        episodes: In the order they are drawn.
        trackers: Names, in the order of the tables.
        preset: Preset of every tracker.
    """

    episodes: tuple[Episode, ...]
    trackers: tuple[str, ...]
    preset: str = "default"

    @property
    def frame_count(self) -> int:
        """Frames that will be drawn."""
        return sum(episode.scenario.frame_count(episode.seed) for episode in self.episodes)


def make_plan(
    names: Sequence[ScenarioLike],
    trackers: Sequence[str],
    seeds: Sequence[int],
    *,
    axes: Mapping[str, Sequence[float]] | None = None,
    overrides: Mapping[str, Any] | None = None,
    preset: str = "default",
) -> Plan:
    """The plan of all combinations.

    Args:
        names: Scenarios.
        trackers: Names for `trackers.make`.
        seeds: Root seeds.
        axes: Severities for each stress axis.
        overrides: Dotted keys set in every scenario.
        preset: Preset of every tracker.

    Raises:
        UnknownNameError: An unknown scenario or axis.
        ScenarioError: A wrong scenario, override or severity.
        ParameterError: No scenario, tracker or seed, or one given twice.
    """
    for what, given in {"scenario": names, "tracker": trackers, "seed": seeds}.items():
        if not given:
            raise ParameterError(f"a plan needs at least one {what}")
        twice = sorted({str(one) for one in given if list(given).count(one) > 1})
        if twice:
            raise ParameterError(f"{what} given twice: {', '.join(twice)}")
    known = list(Axes.model_fields)
    for axis in axes or {}:
        if axis not in known:
            raise UnknownNameError("axis", axis, known)
    episodes = [
        Episode(scenarios.load(name, {**(overrides or {}), **condition.overrides}), condition, seed)
        for name in names
        for condition in _conditions(axes or {})
        for seed in seeds
    ]
    return Plan(tuple(episodes), tuple(trackers), preset)


def _conditions(axes: Mapping[str, Sequence[float]]) -> Iterator[Condition]:
    for levels in itertools.product(*axes.values()):
        yield Condition(tuple(zip(axes, (float(level) for level in levels), strict=True)))


def slug(name: str) -> str:
    """A name as part of a file's name: no separators, no surprises.

    >>> slug("lee2012/db01"), slug("../../etc/x y")
    ('lee2012-db01', 'etc-x-y')
    """
    return re.sub(r"[^A-Za-z0-9._=-]+", "-", name).strip("-.") or "unnamed"


def parse_seeds(text: str) -> list[int]:
    """Seeds as the command line writes them: `3`, `0:20` (20 excluded), `1,5,9`, and mixtures.

    Raises:
        ParameterError: Not seeds.

    >>> parse_seeds("0:3,7")
    [0, 1, 2, 7]
    """
    seeds: list[int] = []
    for part in text.split(","):
        match = re.fullmatch(r"\s*(\d+)\s*(?::\s*(\d+)\s*)?", part)
        if not match or (match[2] is not None and int(match[2]) <= int(match[1])):
            raise ParameterError(f"seeds are written 3, 0:20 (20 excluded) or 1,5,9; got {text!r}")
        seeds += range(int(match[1]), int(match[2])) if match[2] is not None else [int(match[1])]
    return seeds
