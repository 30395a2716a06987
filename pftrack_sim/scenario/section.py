"""Base class and number types of all tables of a scenario."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Any, Literal, Self, TypeAlias

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

Coordinate: TypeAlias = Annotated[float, Field(ge=-500.0, le=500.0)]
Point: TypeAlias = tuple[Coordinate, Coordinate]  # x, y on the ground [m], world frame
Angle: TypeAlias = Annotated[float, Field(ge=-3600.0, le=3600.0)]  # An angle that may go around [deg]

UpAxis: TypeAlias = Literal["auto", "y", "z"]  # Of a file of meshes; "auto": y in glTF, GLB and OBJ, else z
Share: TypeAlias = Annotated[float, Field(ge=0.0, le=1.0)]
Positive: TypeAlias = Annotated[float, Field(gt=0.0, le=10_000.0)]
Seconds: TypeAlias = Annotated[float, Field(ge=0.001, le=3600.0)]
NotNegative: TypeAlias = Annotated[float, Field(ge=0.0, le=10_000.0)]


def _ordered(band: tuple[float, float]) -> tuple[float, float]:
    if band[0] >= band[1]:
        raise ValueError("must be [low, high] with low < high")
    return band


Band: TypeAlias = Annotated[tuple[Positive, Positive], AfterValidator(_ordered)]  # Lowest and highest frequency [Hz]


class Section(BaseModel):
    """Base of every table: frozen, unknown keys are errors."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, ser_json_inf_nan="null")

    def _contradictions(self) -> Iterable[str]:
        """What is wrong with values that do not go together; the first of them refuses the table."""
        return ()

    @model_validator(mode="after")
    def _without_contradictions(self) -> Self:
        for wrong in self._contradictions():
            raise ValueError(wrong)
        return self


def setting(default: Any, meaning: str, **bounds: Any) -> Any:
    """A key of a table, with its default (`...`: required), its meaning, and bounds as those of `pydantic.Field`."""
    return Field(default=default, description=meaning, **bounds)


def number(default: Any, low: float, high: float, meaning: str) -> Any:
    """A key whose value is a number from `low` to `high`."""
    return setting(default, meaning, ge=low, le=high)
