"""A suite is an experiment as data: what is run, what a paper printed, and what it claims.

`envs/suites/<name>.toml`. Seeds of published figures are 1000-1999; scenarios are tuned on 0-999.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Field, ValidationError, model_validator

from pftrack_sim.core.data_files import envs_dir
from pftrack_sim.core.errors import ScenarioError, UnknownNameError
from pftrack_sim.scenario.section import NotNegative, Positive, Section, Share
from pftrack_sim.scenario.validation import problems

Measure: TypeAlias = Literal["mean_overlap", "success", "follow_success", "follow_tracking_rate", "follow_within"]
"""A number in [0, 1] that every episode has: see `score.Measures`, and `score.following.Following` where it drives."""

Names: TypeAlias = Annotated[tuple[str, ...], Field(min_length=1)]


class Block(Section):
    """Scenarios that are run alike."""

    scenarios: Names = Field(description="Scenarios by name.")
    axes: dict[str, tuple[NotNegative, ...]] = Field(
        default_factory=dict, description="Severities of each axis (or of `axis.parameter`, its values); all combined."
    )
    changes: dict[str, Any] = Field(default_factory=dict, description="Dotted keys set in each scenario.")
    word: str = Field(default="", description="Said before the conditions' names, where `changes` make them others.")


class PaperTable(Section):
    """A table as a paper prints it."""

    title: str = Field(description="Which table, and what its numbers are.")
    measure: Measure = Field(default="mean_overlap", description="Our number beside it.")
    scale: Positive = Field(default=100.0, description="What 1 is in the table: 100 for per cent.")
    columns: Names = Field(description="Scenarios, in the table's order.")
    printed: dict[str, tuple[float, ...]] = Field(description="For each tracker its row.")

    @model_validator(mode="after")
    def _rows_are_full(self) -> PaperTable:
        for tracker, row in self.printed.items():
            if len(row) != len(self.columns):
                raise ValueError(f"printed.{tracker} must have {len(self.columns)} numbers, got {len(row)}")
        return self


class Beats(Section):
    """A tracker is better than each of several others."""

    kind: Literal["beats"]
    says: str = Field(description="The claim in words.")
    tracker: str = Field(description="Which tracker.")
    others: Names = Field(description="Than which, each.")
    measure: Measure = "mean_overlap"
    scenarios: tuple[str, ...] = Field(default=(), description="Where; empty is everywhere in the suite.")


class Harder(Section):
    """Some scenarios are harder than others for each of several trackers."""

    kind: Literal["harder"]
    says: str = Field(description="The claim in words.")
    harder: Names = Field(description="Scenarios said to be harder ...")
    easier: Names = Field(description="... than these.")
    trackers: Names = Field(description="For each of these trackers.")
    measure: Measure = "mean_overlap"


class Reaches(Section):
    """A tracker reaches a value."""

    kind: Literal["reaches"]
    says: str = Field(description="The claim in words.")
    tracker: str = Field(description="Which tracker.")
    value: Share = Field(description="Mean over seeds that it reaches.")
    measure: Measure = "mean_overlap"
    scenarios: tuple[str, ...] = Field(default=(), description="Where; empty is everywhere in the suite.")


Claim: TypeAlias = Annotated[Beats | Harder | Reaches, Field(discriminator="kind")]


class Suite(Section):
    """An experiment. `load_suite` makes it.

    Attributes:
        name: The name in `envs/suites/`, or the path.
    """

    name: str
    title: str = Field(description="One line for lists.")
    source: str = Field(default="", description="The paper, and what of it is followed.")
    seeds: str = Field(default="0:5", description="Seeds as on the command line.")
    trackers: Names = Field(description="Trackers by name.")
    preset: Literal["default", "paper"] = "default"
    controllers: tuple[str, ...] = Field(
        default=(), description="Controllers that drive the robot with the trackers' answers; none: it has a script."
    )
    run: Annotated[tuple[Block, ...], Field(min_length=1)] = Field(description="What is run.")
    table: PaperTable | None = Field(default=None, description="The paper's table.")
    claims: tuple[Claim, ...] = Field(default=(), description="What the paper claims.")

    @property
    def scenarios(self) -> tuple[str, ...]:
        """Every scenario, once, in order."""
        return tuple(dict.fromkeys(name for block in self.run for name in block.scenarios))

    def scripted(self) -> Suite:
        """The same with the robot on its script, and without what is said of following."""
        claims = tuple(one for one in self.claims if not one.measure.startswith("follow_"))
        table = None if self.table is not None and self.table.measure.startswith("follow_") else self.table
        return self.model_copy(update={"controllers": (), "claims": claims, "table": table})

    @model_validator(mode="after")
    def _names_agree(self) -> Suite:
        known = set(self.scenarios)
        mentioned = [*(self.table.columns if self.table else ())]
        for claim in self.claims:
            mentioned += [*claim.harder, *claim.easier] if isinstance(claim, Harder) else claim.scenarios
        unknown = [name for name in dict.fromkeys(mentioned) if name not in known]
        if unknown:
            raise ValueError(f"scenarios of a table or claim that no [[run]] has: {', '.join(unknown)}")
        told = [*(self.table.printed if self.table else ())]
        for claim in self.claims:
            told += claim.trackers if isinstance(claim, Harder) else (claim.tracker,)
            told += claim.others if isinstance(claim, Beats) else ()
        missing = [name for name in dict.fromkeys(told) if name not in self.trackers]
        measures = [claim.measure for claim in self.claims] + ([self.table.measure] if self.table else [])
        if not self.controllers and any(measure.startswith("follow_") for measure in measures):
            raise ValueError("how well a robot followed can be claimed only where `controllers` drive it")
        if missing:
            raise ValueError(f"trackers of a table or claim that `trackers` lacks: {', '.join(missing)}")
        return self


def suite_names() -> list[str]:
    """Names of the shipped suites, sorted."""
    return sorted(path.stem for path in (envs_dir() / "suites").glob("*.toml"))


def is_suite(name: str) -> bool:
    """Whether a name on the command line is a suite: a shipped one, or a TOML file with a `[[run]]`."""
    if name in suite_names():
        return True
    path = Path(name)
    if path.suffix != ".toml" or not path.is_file():
        return False
    try:
        return "run" in tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError):
        return False  # whoever reads it as a scenario says what is wrong with it


def load_suite(name: str | Path) -> Suite:
    """A checked suite.

    Args:
        name: A name in `envs/suites/`, or a path to a TOML file.

    Raises:
        UnknownNameError: No such suite.
        ScenarioError: The file cannot be read, or is wrong: all mistakes at once.
    """
    shipped = envs_dir() / "suites" / f"{name}.toml"
    path = shipped if str(name) in suite_names() else Path(name)
    if not path.is_file():
        raise UnknownNameError("suite", str(name), suite_names())
    try:
        tree = tomllib.loads(path.read_text(encoding="utf-8"))
    except tomllib.TOMLDecodeError as error:
        raise ScenarioError(str(name), [f"not valid TOML: {error}"]) from None
    except (OSError, UnicodeDecodeError) as error:
        raise ScenarioError(str(name), [f"cannot be read: {error}"]) from None
    return checked_suite(str(name), tree)


def checked_suite(name: str, tree: Mapping[str, Any]) -> Suite:
    """The suite that a tree of tables says.

    Raises:
        ScenarioError: Every mistake in it.
    """
    whole = {**tree, "name": name}
    try:
        return Suite.model_validate(whole)
    except ValidationError as error:
        raise ScenarioError(name, list(problems(error, whole, _schema()))) from None


@cache
def _schema() -> dict[str, Any]:
    return Suite.model_json_schema()
