"""Base class of the stress axes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Unpack, cast

from pydantic import ConfigDict, model_validator

from pftrack_sim.core.data_files import asset_table
from pftrack_sim.scenario.section import Section, number


class Axis(Section):
    """A stress axis: a table of physical parameters, and a severity that scales them.

    The parameters are those of severity 1, the typical value. At severity 0 the scenario is the base to the bit,
    for any parameters. A table with parameters and no severity has severity 1.

    Attributes:
        headline: Parameter on the x axis of degradation plots.
        unit: Its unit, as a label.
        law: Effect of the severity on the parameters, and of the parameters on the frame.
        source: Reference for the typical values and the law.
    """

    headline: ClassVar[str]
    unit: ClassVar[str]
    law: ClassVar[str]
    source: ClassVar[str]

    def __init_subclass__(cls, name: str, headline: str, unit: str, **config: Unpack[ConfigDict]) -> None:
        """Take law and source of the axis `name` from `assets/axes.toml`."""
        super().__init_subclass__(**config)
        cls.headline, cls.unit = headline, unit
        cls.law, cls.source = (asset_table("axes")[name][key] for key in ("law", "source"))

    severity: float = number(
        0, 0, 20, "0: the base scenario to the bit; 1: typical; 2: twice that. 1 where only parameters are given."
    )

    @model_validator(mode="before")
    @classmethod
    def _parameters_alone_mean_severity_1(cls, given: object) -> object:
        if not isinstance(given, Mapping):
            return given
        table = cast("Mapping[str, object]", given)
        return {**table, "severity": 1.0} if table and "severity" not in table else table

    @property
    def on(self) -> bool:
        """Whether the severity is above 0."""
        return self.severity > 0.0

    @property
    def physical(self) -> float:
        """The headline at this severity, in its unit; 0 at severity 0."""
        return self.severity * float(getattr(self, type(self).headline))

    @property
    def events_s(self) -> tuple[float, ...]:
        """When each of its events begins at this severity; none for an axis that acts all the time."""
        return ()

    @property
    def compared_from_s(self) -> float:
        """Time from which frames are compared between severities."""
        return 0.0
