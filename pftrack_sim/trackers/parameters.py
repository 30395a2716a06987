"""Parameters of a tracker: a frozen pydantic model, filled from a preset and the user's own values.

class Ko2012Parameters(Parameters):
    TUNED = {"particle_count": 400}
    particle_count: Count = 100
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Self, TypeAlias

from pydantic import BaseModel, ConfigDict, Field, ValidationError, ValidationInfo, field_validator

from pftrack_sim.core.errors import ParameterError, did_you_mean
from pftrack_sim.trackers.base import PRESETS, Recognition

Count: TypeAlias = Annotated[int, Field(ge=1, le=100_000)]
Share: TypeAlias = Annotated[float, Field(ge=0.0, le=1.0)]
NotNegative: TypeAlias = Annotated[float, Field(ge=0.0, le=1000.0)]
Positive: TypeAlias = Annotated[float, Field(ge=0.001, le=1000.0)]


class Parameters(BaseModel):
    """Base of the parameters of a tracker; field defaults are the preset `paper`. Without fields: no parameters."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    TUNED: ClassVar[Mapping[str, Any]] = {}
    """Values of the preset `default` where they differ from `paper`."""

    @field_validator("*", mode="before")
    @classmethod
    def _check_boolean(cls, value: object, info: ValidationInfo) -> object:
        """Keep booleans and numbers apart, which pydantic converts into each other."""
        assert info.field_name is not None
        wants_boolean = cls.model_fields[info.field_name].annotation is bool
        if isinstance(value, bool) != wants_boolean:
            raise ValueError("input should be True or False" if wants_boolean else "input should not be a boolean")
        return value

    @classmethod
    def from_preset(cls, tracker: str, preset: str, given: Mapping[str, Any]) -> Self:
        """Parameters of a preset, with the user's own values in place of its values; messages name the tracker.

        Raises:
            ParameterError: An unknown preset or parameter, or a value that is not allowed.
        """
        if preset not in PRESETS:
            near, known = did_you_mean(preset, PRESETS), ", ".join(PRESETS)
            raise ParameterError(f"{tracker}: unknown preset {preset!r}{near} (known: {known})")
        values = {**(cls.TUNED if preset == "default" else {}), **given}
        try:
            return cls.model_validate(values)
        except ValidationError as error:
            # Imported where it is needed: the model of scenarios takes a third of a second.
            from pftrack_sim.scenario.validation import problems

            lines = problems(error, values, cls.model_json_schema())
            raise ParameterError(f"{tracker}: {'; '.join(lines)}") from None


class RecognitionParameters(Parameters):
    """Parameters of a tracker that may have a memory of its target.

    Attributes:
        recognition: What a memory of the target does: `"none"`, `"judge"` or `"search"`, see `BaseTracker`. Not
            printed; in closed loop `"search"`, unless preset `paper` is asked for.
    """

    recognition: Recognition = "none"
