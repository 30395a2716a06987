"""Settings of a studio: what is simulated, who tracks, and who drives."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, cast

import tomli_w

from pftrack_sim import controllers
from pftrack_sim import scenario as scenarios
from pftrack_sim.benchmark.asked.plan import TrackerSpec
from pftrack_sim.core.errors import ParameterError, UnknownNameError
from pftrack_sim.core.text import one_line
from pftrack_sim.scenario import Scenario
from pftrack_sim.scenario.axes import Axis, axes_by_name
from pftrack_sim.scenario.ranges import is_range

SCRIPT, HAND = "script", "hand"
"""Drivers of the robot besides the controllers: the scenario's script, and the commands of a person."""

_STRONGEST = 4.0  # Severity at the right end of a slider


def drivers() -> list[str]:
    """Who can drive the robot."""
    return [SCRIPT, HAND, *controllers.names()]


@dataclass(frozen=True)
class Settings:
    """What a studio shows.

    Attributes:
        name: Of a scenario in `envs/`, or the path of a TOML file.
        overrides: Dotted keys and values.
        driver: `"script"`, `"hand"`, or the name of a controller, which takes the boxes of the first tracker.

    Raises:
        UnknownNameError: No such driver.
        ParameterError: A tracker given twice.
    """

    name: str = "plaza-walk"
    seed: int = 0
    overrides: Mapping[str, Any] = field(default_factory=dict[str, Any])
    trackers: tuple[TrackerSpec, ...] = ()
    driver: str = SCRIPT

    def __post_init__(self) -> None:
        if self.driver not in drivers():
            raise UnknownNameError("driver", self.driver, drivers())
        labels = [one.label for one in self.trackers]
        if repeated := sorted({label for label in labels if labels.count(label) > 1}):
            raise ParameterError(f"tracker given twice: {', '.join(repeated)}")

    def scenario(self) -> Scenario:
        """The scenario with its overrides.

        Raises:
            ScenarioError: It is not valid; every problem is listed.
        """
        return scenarios.load(self.name, self.overrides)

    def with_axis(self, axis: str, physical: float) -> Settings:
        """The same with a stress axis at a value of its headline, in the axis's own unit.

        Raises:
            UnknownNameError: No such axis.
        """
        if axis not in axes_by_name():
            raise UnknownNameError("stress axis", axis, axes_by_name())
        severity = physical / _at_severity_1(self._axis(axis))
        return replace(self, overrides={**self.overrides, f"axes.{axis}.severity": severity})

    def physical(self, axis: str) -> float:
        """Headline of a stress axis at the present severity, in the axis's own unit."""
        return self._axis(axis).physical

    def strongest(self, axis: str) -> float:
        """The same at the right end of its slider."""
        return _STRONGEST * _at_severity_1(self._axis(axis))

    def _axis(self, axis: str) -> Axis:
        return getattr(self.scenario().resolve(self.seed).axes, axis)

    def command_line(self) -> str:
        """The shell command that writes a video of the same episode, or runs it in closed loop."""
        labels = ",".join(one.base_label for one in self.trackers)
        words = ["pftrack-sim", "render", self.name, "--seed", str(self.seed), "--truth", "--video", "studio.mp4"]
        if self.driver not in (SCRIPT, HAND):
            words = ["pftrack-sim", "follow", self.name, "--seeds", str(self.seed), "--controllers", self.driver]
            labels = self.trackers[0].base_label if self.trackers else "oracle"
        words += ["--trackers", labels] if labels else []
        for key, value in self.overrides.items():
            words += ["--set", f"{key}={_toml_value(value)}"]
        return shlex.join(words)

    def toml(self) -> str:
        """The scenario as TOML, with the seed and the command in comments."""
        by_hand = "# The robot was driven by hand, which no file repeats.\n" if self.driver == HAND else ""
        note = f"# From {self.name!r} at seed {self.seed}. The same frames:\n# {one_line(self.command_line(), 4000)}\n"
        return note + by_hand + tomli_w.dumps(self.scenario().tree)


def _toml_value(value: object) -> str:
    """One value in one line."""
    written = tomli_w.dumps({"_": [value, 0]}).removeprefix("_ = [").rstrip()
    return "".join(line.strip() for line in written.splitlines()).removesuffix(",0,]")


def settings_of(scenario: Scenario, seed: int, trackers: tuple[TrackerSpec, ...] = ()) -> Settings:
    """Settings that show a loaded scenario: its name, and the overrides that lead from the file of this name to it.

    Raises:
        ParameterError: It was made from a dict, which has no name.
    """
    if scenario.name == "custom":
        raise ParameterError(
            "the studio shows a scenario by its name or file, got one from a dict: write it with "
            "tomli_w.dumps(scenario.tree) to a file"
        )
    overrides = dict(_differences(scenarios.load(scenario.name).tree, scenario.tree))
    return Settings(scenario.name, seed, overrides, trackers)


def _differences(old: Mapping[str, Any], new: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted keys, and values, of what differs in `new`."""
    for key, value in new.items():
        before = old.get(key, {})
        if isinstance(value, Mapping) and isinstance(before, Mapping) and not is_range(cast("object", value)):
            tables = cast("Mapping[str, Any]", before), cast("Mapping[str, Any]", value)
            yield from _differences(*tables, f"{above}{key}.")
        elif value != before:
            yield f"{above}{key}", value


def _at_severity_1(axis: Axis) -> float:
    return float(getattr(axis, type(axis).headline)) or 1.0
