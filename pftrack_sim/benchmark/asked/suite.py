"""Suites: experiments as data, with what is run, the table that a paper printed, and the claims to test.

`envs/suites/<name>.toml`. Seeds of published figures are 1000-1999; scenarios are tuned on 0-999.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias, get_args

from pydantic import Field, ValidationError, model_validator

from pftrack_sim.core.data_files import envs_dir
from pftrack_sim.core.errors import ParameterError, ScenarioError, UnknownNameError
from pftrack_sim.core.inputs import is_file
from pftrack_sim.scenario.files import read_toml
from pftrack_sim.scenario.section import NotNegative, Positive, Section, Share
from pftrack_sim.scenario.validation import problems

Measure: TypeAlias = Literal["mean_overlap", "success", "follow_success", "follow_tracking_rate", "follow_within"]
"""A score in [0, 1] of every episode: see `score.Measures`, and `score.following.Following` for closed loop."""

Time: TypeAlias = Literal["ms_per_frame", "frames_per_second"]
"""From the median time of a tracker's update."""

Names: TypeAlias = Annotated[tuple[str, ...], Field(min_length=1)]


class Block(Section):
    """Scenarios with the same axes and overrides."""

    scenarios: Names = Field(description="Scenarios by name.")
    axes: dict[str, tuple[NotNegative, ...]] = Field(
        default_factory=dict, description="Severities of each axis (or of `axis.parameter`, its values); all combined."
    )
    changes: dict[str, Any] = Field(default_factory=dict, description="Dotted keys set in each scenario.")
    variant: str = Field(default="", description="Name of what `changes` change, put before the conditions' names.")
    loop: Literal["open", "closed"] | None = Field(default=None, description="Only in this loop; without: in both.")


class PaperTable(Section):
    """A table of a paper."""

    title: str = Field(description="Which table, and what its numbers are.")
    measure: Measure | Time = Field(default="mean_overlap", description="The measure compared with it.")
    scale: Positive = Field(default=100.0, description="Value of 1 in the table: 100 for per cent; not for times.")
    columns: Names = Field(description="Scenarios, in the table's order.")
    weights: tuple[Positive, ...] = Field(
        default=(), description="Weight of each column in the mean, its number of frames for instance; none: equal."
    )
    printed: Annotated[dict[str, tuple[float, ...]], Field(min_length=1)] = Field(
        description="The row of each tracker; a number alone is the mean. Times are shown over those of the first row."
    )

    @model_validator(mode="after")
    def _rows_are_full(self) -> PaperTable:
        count = len(self.columns)
        for name, row in {"weights": self.weights or self.columns, **self.printed}.items():
            if len(row) != count and (len(row) != 1 or name == "weights"):
                what = name if name == "weights" else f"printed.{name}"
                raise ValueError(f"{what} must have {count} numbers, got {len(row)}")
        return self

    @property
    def is_of_times(self) -> bool:
        """Whether its numbers depend on the machine, so that they are shown over those of the first row."""
        return self.measure in get_args(Time)


class _Claim(Section):
    statement: str = Field(description="The claim in words.")
    measure: Measure = "mean_overlap"


class _ClaimOfTracker(_Claim):
    tracker: str = Field(description="The tracker.")
    scenarios: tuple[str, ...] = Field(default=(), description="Scenarios; empty: all of the suite.")

    @property
    def compared(self) -> tuple[str, ...]:
        """Trackers on which the verdict depends."""
        return (self.tracker,)


class _ClaimOverOthers(_ClaimOfTracker):
    others: Names = Field(description="The trackers it is compared with, one by one.")

    @property
    def compared(self) -> tuple[str, ...]:
        """Trackers on which the verdict depends."""
        return self.tracker, *self.others


class Beats(_ClaimOverOthers):
    """A tracker scores higher than each of several others."""

    kind: Literal["beats"]


class Harder(_Claim):
    """Some scenarios are harder than others for each of several trackers."""

    kind: Literal["harder"]
    harder: Names = Field(description="Scenarios that are harder ...")
    easier: Names = Field(description="... than these.")
    trackers: Names = Field(description="For each of these trackers.")

    @property
    def compared(self) -> tuple[str, ...]:
        """Trackers on which the verdict depends."""
        return self.trackers


class Reaches(_ClaimOfTracker):
    """A tracker reaches a value."""

    kind: Literal["reaches"]
    value: Share = Field(description="Value that its mean over seeds reaches.")


class KeepsPace(_ClaimOverOthers):
    """A tracker processes nearly as many frames per second as each of several others."""

    kind: Literal["keeps_pace"]
    share: Positive = Field(description="Share of their frames per second that it reaches.")


Claim: TypeAlias = Annotated[Beats | Harder | Reaches | KeepsPace, Field(discriminator="kind")]


class Suite(Section):
    """An experiment; `load_suite` reads one.

    Attributes:
        name: The name in `envs/suites/`, or the path.
    """

    name: str
    title: str = Field(description="One line for lists.")
    source: str = Field(default="", description="The paper, and what of it is followed.")
    seeds: str = Field(default="0:5", description="Seeds as on the command line.")
    trackers: Names = Field(description="Trackers by name.")
    presets: Annotated[tuple[Literal["default", "paper"], ...], Field(min_length=1)] = Field(
        default=("default",), description="Presets that each tracker is run with."
    )
    controllers: tuple[str, ...] = Field(
        default=(), description="Controllers that drive the robot with the trackers' estimates; none: open loop."
    )
    versions: dict[str, int] = Field(
        default_factory=dict, description="Versions of scenarios that it is frozen with: with others it does not run."
    )
    run: Annotated[tuple[Block, ...], Field(min_length=1)] = Field(description="What is run, block by block.")
    tables: tuple[PaperTable, ...] = Field(default=(), description="The paper's tables.")
    claims: tuple[Claim, ...] = Field(default=(), description="Claims of the paper.")

    @property
    def scenarios(self) -> tuple[str, ...]:
        """Every scenario, once, in order."""
        return tuple(dict.fromkeys(name for block in self.run for name in block.scenarios))

    def part(self, *, closed: bool) -> Suite:
        """What of it is run in closed or in open loop; open without tables and claims about following.

        Raises:
            ParameterError: No part of it is in that loop.
        """
        run = tuple(one for one in self.run if one.loop != ("open" if closed else "closed"))
        if not run:
            raise ParameterError(f"the suite {self.name} has no part in {'closed' if closed else 'open'} loop")
        names = {name for one in run for name in one.scenarios}
        shared = {"run": run, "versions": {name: one for name, one in self.versions.items() if name in names}}
        if closed:
            return self.model_copy(update=shared)
        claims = tuple(one for one in self.claims if not one.measure.startswith("follow_"))
        tables = tuple(one for one in self.tables if not one.measure.startswith("follow_"))
        return self.model_copy(update={"controllers": (), "claims": claims, "tables": tables, **shared})

    @model_validator(mode="after")
    def _names_agree(self) -> Suite:
        places = [name for table in self.tables for name in table.columns]
        named = [name for table in self.tables for name in table.printed]
        for claim in self.claims:
            places += [*claim.harder, *claim.easier] if isinstance(claim, Harder) else claim.scenarios
            named += claim.compared
        known = set(self.scenarios)
        unknown = [name for name in dict.fromkeys(places) if name not in known]
        if unknown:
            raise ValueError(f"scenarios of a table or claim that no [[run]] has: {', '.join(unknown)}")
        measures = [one.measure for one in (*self.claims, *self.tables)]
        if not self.controllers and any(measure.startswith("follow_") for measure in measures):
            raise ValueError("measures of following need `controllers`")
        if self.versions and self.versions.keys() != known:
            names = ", ".join(sorted(self.versions.keys() ^ known))
            raise ValueError(f"`versions` must name every scenario of [[run]] and no other: {names}")
        missing = [name for name in dict.fromkeys(named) if name not in self.trackers]
        if missing:
            raise ValueError(f"trackers of a table or claim that `trackers` lacks: {', '.join(missing)}")
        return self


def suite_names() -> list[str]:
    """Names of the shipped suites, sorted."""
    return sorted(path.stem for path in (envs_dir() / "suites").glob("*.toml"))


def newest(name: str) -> str:
    """`NAME-3` of a name without a version where the shipped suites have versions 1 to 3 of it; others stay."""
    versions = [one.removeprefix(f"{name}-") for one in suite_names() if one.startswith(f"{name}-")]
    return f"{name}-{max(map(int, versions))}" if versions and all(one.isdecimal() for one in versions) else name


def is_suite(name: str) -> bool:
    """Whether a name is that of a shipped suite, or the path of a TOML file with a `[[run]]`."""
    if newest(name) in suite_names():
        return True
    path = Path(name)
    if path.suffix != ".toml" or not is_file(path):
        return False
    try:
        return "run" in read_toml(path, name)
    except ScenarioError:
        return False  # reported when it is read as a scenario


def load_suite(name: str | Path) -> Suite:
    """Read a suite.

    Args:
        name: A name in `envs/suites/`, also without its version, or a path to a TOML file.

    Raises:
        UnknownNameError: No such suite.
        ScenarioError: The file cannot be read, or is wrong; every mistake is listed.
    """
    name = newest(str(name))
    shipped = envs_dir() / "suites" / f"{name}.toml"
    path = shipped if name in suite_names() else Path(name)
    if not is_file(path):
        raise UnknownNameError("suite", name, suite_names())
    return make_suite(name, read_toml(path, name))


def make_suite(name: str, tree: Mapping[str, Any]) -> Suite:
    """Make a suite of a tree of tables.

    Raises:
        ScenarioError: It is wrong; every mistake is listed.
    """
    whole = {**tree, "name": name}
    try:
        return Suite.model_validate(whole)
    except ValidationError as error:
        raise ScenarioError(name, list(problems(error, whole, Suite.model_json_schema()))) from None
