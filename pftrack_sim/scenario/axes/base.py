"""What the stress axes have in common."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, cast

from pydantic import Field, model_validator

from pftrack_sim.scenario.section import NotNegative, Section


class Axis(Section):
    """A stress axis: a table of physical parameters, and a severity that scales them.

    The parameters are those of severity 1, the typical value. At severity 0 the scenario is the base to the bit,
    whatever the parameters. A table that gives parameters and no severity means them as they stand: severity 1.

    Subclasses say what they do in their docstring and in these:

    Attributes:
        headline: The parameter that a plot of the axis is drawn over.
        unit: Its unit, as a label.
        law: What severity s does to the parameters, and what they do to the frame.
        source: Where the typical values and the law come from.
    """

    headline: ClassVar[str]
    unit: ClassVar[str]
    law: ClassVar[str]
    source: ClassVar[str]

    severity: NotNegative = Field(
        default=0.0,
        description="0: the base scenario to the bit; 1: typical; 2: twice that. 1 where only parameters are given.",
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
        """Whether it does anything."""
        return self.severity > 0.0

    @property
    def physical(self) -> float:
        """The headline at this severity, in its unit; 0 at severity 0."""
        return self.severity * float(getattr(self, type(self).headline))
