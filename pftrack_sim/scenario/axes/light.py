"""Light that changes: by stops, flickering, in pools, in colour; and how the camera's automatics answer."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal, TypeAlias

from pydantic import Field, model_validator

from pftrack_sim.scenario.axes.axis import Axis
from pftrack_sim.scenario.section import NotNegative, Positive

Part: TypeAlias = Literal["change", "colour", "flicker", "pools"]

WHITE_K = 6504.0
"""Colour temperature of the light that the scenarios are drawn in."""

WARMEST_K, COLDEST_K = 2000.0, 25000.0
"""Colours of light that a frame can hold: beyond them a primary would have to be negative."""


class LightAxis(Axis):
    """Light that drops and returns, changes its colour, flickers, and lies in pools along the way.

    Change and colour share one course: at `at_s` the light falls by `dim_ev`, stays so for `hold_s`, returns, and does
    the same again every `every_s`.
    """

    headline: ClassVar[str] = "dim_ev"
    unit: ClassVar[str] = "EV"
    law: ClassVar[str] = (
        "stops, flicker depth and shift of colour in mired (1e6 / K) are multiplied by the severity, times and "
        "frequencies stay; -1 EV halves the luminance of everything that the light falls on, the sky included"
    )
    source: ClassVar[str] = (
        "Ko, Nam & Kwak 2012, table 2 (light and colour change); Lee et al. 2012 (sudden changes at night); IEEE "
        "1789-2015 (flicker depth); Kim et al. 2002, US 7024034 (Planckian locus)"
    )

    parts: Annotated[tuple[Part, ...], Field(min_length=1)] = Field(
        default=("change", "colour", "flicker", "pools"), description="Which changes; the others are left out."
    )
    lights: Literal["all", "sun", "lamps"] = Field(default="all", description="Which lights change their brightness.")
    dim_ev: Annotated[float, Field(ge=-5.0, le=10.0)] = Field(
        default=1.0, description="Change: stops by which the light falls; negative rises."
    )
    at_s: NotNegative = Field(default=2.0, description="Change: when it begins first.")
    rate_ev_s: NotNegative = Field(default=0.0, description="Change: stops per second of a ramp; 0 is a step.")
    hold_s: Positive = Field(default=2.0, description="Change: how long the light stays changed.")
    every_s: Positive = Field(default=5.0, description="Change: from one beginning to the next.")
    temperature_k: Annotated[float, Field(ge=WARMEST_K, le=COLDEST_K)] = Field(
        default=4200.0, description="Colour: temperature of the light while it is changed; 6504 is white."
    )
    flicker_hz: Positive = Field(default=6.0, description="Flicker: frequency; above half the frame rate it aliases.")
    flicker_depth: Annotated[float, Field(ge=0.0, le=1.0)] = Field(
        default=0.1, description="Flicker: (brightest - darkest) / (brightest + darkest) of the luminance."
    )
    pool_ev: Annotated[float, Field(ge=0.0, le=10.0)] = Field(
        default=0.7, description="Pools: stops from below a lamp to midway between two."
    )
    pool_every_m: Positive = Field(default=8.0, description="Pools: distance between lamps along the target's path.")
    auto_exposure: bool = Field(default=False, description="Whether the camera holds the first frame's mean luminance.")
    exposure_lag_s: NotNegative = Field(default=0.5, description="Auto-exposure: time constant; 0 answers at once.")
    exposure_range_ev: Annotated[float, Field(gt=0.0, le=10.0)] = Field(
        default=4.0, description="Auto-exposure: most stops that it adds or takes away."
    )
    auto_white_balance: bool = Field(
        default=False, description="Whether the camera holds the first frame's mean colour."
    )
    white_balance_lag_s: NotNegative = Field(default=1.5, description="White balance: time constant; 0: at once.")

    @model_validator(mode="after")
    def _a_change_ends_before_the_next(self) -> LightAxis:
        ramp_s = abs(self.dim_ev) / self.rate_ev_s if self.rate_ev_s > 0.0 else 0.0
        if 2.0 * ramp_s + self.hold_s > self.every_s:
            raise ValueError(
                f"every_s must leave room for two ramps and hold_s, {2.0 * ramp_s + self.hold_s:g} s at severity 1, "
                f"got {self.every_s:g}"
            )
        return self

    def course(self, time_s: float) -> float:
        """Share of the change that is on at this time, in [0, 1].

        A ramp takes as long at every severity as at severity 1 with its rate: a higher severity is steeper.
        """
        since_s = time_s - self.at_s
        if since_s < 0.0:
            return 0.0
        # A step that falls on a frame is seen in that frame, whichever way the quotient was rounded.
        phase_s = math.fmod(since_s + 1e-9, self.every_s)
        ramp_s = abs(self.dim_ev) / self.rate_ev_s if self.rate_ev_s > 0.0 else 0.0
        if ramp_s == 0.0:
            return 1.0 if phase_s < self.hold_s else 0.0
        return min(1.0, max(0.0, min(phase_s / ramp_s, (2.0 * ramp_s + self.hold_s - phase_s) / ramp_s)))

    def ev(self, time_s: float, walked_m: float, flicker_rad: float) -> float:
        """Stops that this axis adds to the light.

        Args:
            time_s: Since the start of the episode.
            walked_m: How far the target has come along its path; it starts below a lamp.
            flicker_rad: Phase of the flicker at the start.
        """
        stops = 0.0
        if "change" in self.parts:
            stops -= self.severity * self.dim_ev * self.course(time_s)
        if "pools" in self.parts:
            stops -= self.severity * self.pool_ev * math.sin(math.pi * walked_m / self.pool_every_m) ** 2
        if "flicker" in self.parts:
            depth = min(0.95, self.severity * self.flicker_depth)
            stops += math.log2(1.0 + depth * math.sin(2.0 * math.pi * self.flicker_hz * time_s + flicker_rad))
        return stops

    def light_k(self, time_s: float) -> float:
        """Colour temperature of the light [K]; `WHITE_K` while it is unchanged."""
        if "colour" not in self.parts:
            return WHITE_K
        white = 1e6 / WHITE_K
        mired = white + self.severity * self.course(time_s) * (1e6 / self.temperature_k - white)
        return 1e6 / min(1e6 / WARMEST_K, max(1e6 / COLDEST_K, mired))
