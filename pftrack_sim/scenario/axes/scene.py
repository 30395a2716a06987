"""Stress axes of what happens in the scene: occlusions, distractors, the target, light."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal, TypeAlias

from pydantic import Field, model_validator

from pftrack_sim.scenario.actions import Action, Lowering, Run, Stop, Turn
from pftrack_sim.scenario.axes.base import Axis
from pftrack_sim.scenario.section import NotNegative, Positive, Share


class OcclusionAxis(Axis):
    """Occluders between the camera and the target at given times, in addition to the scenario's own.

    They move with the line of sight, so that one second of occlusion is one second in every scenario: cabinets and low
    carts that drive themselves, and pedestrians who walk along.
    """

    headline: ClassVar[str] = "duration_s"
    unit: ClassVar[str] = "s"
    law: ClassVar[str] = (
        "the target's centre line is behind an occluder for duration_s, times the severity, until end_s; the next "
        "cover ends every_s later. A higher severity begins earlier: what follows the end is the same at every severity"
    )
    source: ClassVar[str] = (
        "full and partial occlusion: Ko et al. 2012, table 2 and figure 5. Severity 1: the target of a recording of "
        "VOT-LT2018 is gone for 40 frames on average (Kristan et al. 2018), 1.3 s at 30 Hz. Beyond 3 s even trackers "
        "that detect people anew bridge less than a tenth of the gaps (Dendorfer et al. 2022)"
    )

    kind: Literal["pillar", "wall", "stranger", "lookalike"] = Field(
        default="pillar",
        description="'pillar': a cabinet as tall as people; 'wall': a low cart that covers from the feet upwards; "
        "'stranger': a pedestrian in other clothes; 'lookalike': one in the same.",
    )
    duration_s: Positive = Field(default=1.3, description="How long each one covers the centre line at severity 1.")
    share: Annotated[float, Field(gt=0.0, le=1.0)] = Field(
        default=1.0, description="Share of the target's visible body that a wall covers; others cover it whole."
    )
    count: Annotated[int, Field(ge=0, le=6)] = Field(default=1, description="How many.")
    end_s: NotNegative = Field(default=7.0, description="When the first one ends, at every severity.")
    every_s: Positive = Field(default=6.0, description="From the end of one to the end of the next.")
    depth: Annotated[float, Field(ge=0.3, le=0.7)] = Field(
        default=0.5, description="Where it passes on the line from the camera (0) to the target (1), if there is room."
    )

    @property
    def spans_s(self) -> tuple[tuple[float, float], ...]:
        """Beginning and length of each cover at this severity; none at severity 0."""
        if not self.on:
            return ()
        length = self.severity * self.duration_s
        return tuple((self.end_s + number * self.every_s - length, length) for number in range(self.count))

    @property
    def events_s(self) -> tuple[float, ...]:
        """When each cover begins."""
        return tuple(at_s for at_s, _ in self.spans_s)

    @property
    def compared_from_s(self) -> float:
        """The end of the first cover: before it, a higher severity leaves fewer frames."""
        return self.end_s

    @model_validator(mode="after")
    def _covers_fit(self) -> OcclusionAxis:
        length = self.severity * self.duration_s
        if self.count and length > self.end_s:
            raise ValueError(f"a cover of {length:g} s cannot end at end_s = {self.end_s:g}: it would begin before 0 s")
        if self.count > 1 and length > self.every_s:
            raise ValueError(f"every_s must be at least the {length:g} s that each cover lasts, got {self.every_s:g}")
        return self

    @property
    def likeness(self) -> Share:
        """Similarity of the crossing pedestrian's clothes to the target's."""
        return 1.0 if self.kind == "lookalike" else 0.0


class DistractorsAxis(Axis):
    """Look-alikes who come near the target, in addition to the scenario's own pedestrians.

    Some come along the target's path and pass close by it. Others cross between the camera and the target, cover it for
    a moment, and walk on in another direction: a tracker that moves over to them is led away.
    """

    headline: ClassVar[str] = "count"
    unit: ClassVar[str] = "people"
    law: ClassVar[str] = (
        "count, times the severity and rounded up, people come near the target, the first at at_s and one every "
        "every_s; by turns one crosses the line of sight in cover_s and one passes the target at distance_m. Their "
        "similarity is a Bhattacharyya coefficient, the same at any severity"
    )
    source: ClassVar[str] = (
        "Lee et al. 2012, tables 2 and 3: 39 look-alikes in 8 recordings of 572 s together, 4.1 a minute, and 7.0 in "
        "the densest. Severity 1, 2 in an episode of 16 s, is near that of the densest; 0.5 near the mean. They are "
        "dressed alike, as in the uniform crowds of Ghimire et al. 2022 (arXiv:2205.10553)"
    )

    count: Annotated[int, Field(ge=0, le=8)] = Field(default=2, description="How many come near at severity 1.")
    similarity: Share = Field(
        default=1.0, description="Similarity of clothes and build to the target's; 1 is a twin, 0 clearly different."
    )
    where: Literal["both", "across", "beside"] = Field(
        default="both",
        description="'across': they cross between camera and target; 'beside': they pass the target; 'both': by turns.",
    )
    distance_m: Annotated[float, Field(ge=0.55, le=3.0)] = Field(
        default=0.8, description="Beside: distance of the centres when nearest to the target."
    )
    cover_s: Annotated[float, Field(ge=0.2, le=2.0)] = Field(
        default=0.4, description="Across: how long each covers the target's centre line; 0.4 s is a walk past."
    )
    at_s: NotNegative = Field(default=3.0, description="When the first is nearest, or in the middle of its crossing.")
    every_s: Positive = Field(default=1.5, description="From one to the next.")

    @property
    def times_s(self) -> tuple[float, ...]:
        """When each is nearest to the target, or in front of it, at this severity; none at severity 0."""
        # A half is a person too: severity 0.5 of one person is not severity 0.
        return tuple(self.at_s + number * self.every_s for number in range(math.ceil(self.severity * self.count)))

    @property
    def events_s(self) -> tuple[float, ...]:
        """When each person is nearest."""
        return self.times_s

    @property
    def passings_s(self) -> tuple[float, ...]:
        """Times at which people pass beside the target."""
        return {"both": self.times_s[1::2], "across": (), "beside": self.times_s}[self.where]

    @property
    def crossings_s(self) -> tuple[tuple[float, float], ...]:
        """Beginning and length of each cover by people who cross."""
        times = {"both": self.times_s[0::2], "across": self.times_s, "beside": ()}[self.where]
        return tuple((time_s - 0.5 * self.cover_s, self.cover_s) for time_s in times)


Manoeuvre: TypeAlias = Literal["stop", "turn", "crouch", "run"]


class TargetAxis(Axis):
    """Manoeuvres of the target on its path, changes of the robot's distance, and a target that leaves the view."""

    headline: ClassVar[str] = "per_minute"
    unit: ClassVar[str] = "manoeuvres / min"
    law: ClassVar[str] = (
        "per_minute, faster_m_s, range_m and leave_s are multiplied by the severity; manoeuvres come in the order "
        "given, evenly in time or, where that is too fast, one after the other"
    )
    source: ClassVar[str] = (
        "changes of posture, scale and view: Ko et al. 2012 and Kwon et al. 2005. The rates are chosen, since neither "
        "paper counts them: at severity 1 a manoeuvre every 5 s, each kind once in an episode of 20 s"
    )

    per_minute: NotNegative = Field(default=12.0, description="Manoeuvres a minute at severity 1; 0 for none.")
    manoeuvres: Annotated[tuple[Manoeuvre, ...], Field(min_length=1, max_length=100)] = Field(
        default=("stop", "run", "crouch", "turn"),
        description="In this order, over and over. 'stop': stands still for a while; 'turn': faces about on the spot, "
        "walks back, and faces about again; 'crouch': stops, squats and rises; 'run': runs for a while.",
    )
    at_s: NotNegative = Field(default=2.0, description="When the first manoeuvre begins.")
    run_m_s: Annotated[float, Field(ge=2.2, le=3.2)] = Field(default=2.7, description="Speed of running.")
    faster_m_s: NotNegative = Field(default=0.1, description="Added to the walking speed at severity 1.")
    range_m: NotNegative = Field(
        default=0.4, description="How far the robot swings ahead of and behind its place beside or behind the target."
    )
    period_s: Positive = Field(
        default=12.0, description="Period of that swing; a short one asks for more than the robot's top speed."
    )
    leave_s: NotNegative = Field(default=0.5, description="How long the target is out of view at severity 1.")
    leave_at_s: NotNegative = Field(default=9.0, description="When it leaves; the operator's camera turns away.")

    def action(self, manoeuvre: Manoeuvre, at_s: float) -> Action:
        """A manoeuvre that begins at this time."""
        match manoeuvre:
            case "stop":
                return Stop(kind="stop", at_s=at_s)
            case "turn":
                return Turn(kind="turn", at_s=at_s)
            case "crouch":
                return Lowering(kind="crouch", at_s=at_s)
            case "run":
                return Run(kind="run", at_s=at_s, speed_m_s=self.run_m_s)

    @property
    def events_s(self) -> tuple[float, ...]:
        """When the target leaves the view, where that is all this axis does; otherwise it acts all the time."""
        others = self.severity * (self.faster_m_s + self.range_m + self.per_minute)
        return (self.leave_at_s,) if self.away_s > 0.0 and not others else ()

    @property
    def every_s(self) -> float:
        """Time from the beginning of a manoeuvre to the beginning of the next; infinite for none."""
        rate = self.severity * self.per_minute
        return 60.0 / rate if rate > 0.0 else float("inf")

    @property
    def swing_m(self) -> float:
        """Amplitude of the robot's swing at this severity."""
        return self.severity * self.range_m

    @property
    def away_s(self) -> float:
        """Time for which the target is out of view at this severity."""
        return self.severity * self.leave_s


Part: TypeAlias = Literal["change", "colour", "flicker", "pools", "patches", "noise"]

WHITE_K = 6504.0  # Colour temperature of the light that the scenarios are drawn in
WARMEST_K, COLDEST_K = 2000.0, 25000.0  # Range of colour temperatures without negative primaries


class LightAxis(Axis):
    """Light that drops and returns, changes its colour, flickers, and varies along the path and from place to place.

    Change and colour share one time course: at `at_s` the light falls by `dim_ev`, stays for `hold_s`, returns, and
    repeats every `every_s`.
    """

    headline: ClassVar[str] = "dim_ev"
    unit: ClassVar[str] = "EV"
    law: ClassVar[str] = (
        "stops, flicker depth, shift of colour in mired (1e6 / K) and share of shade are multiplied by the severity, "
        "times and frequencies stay; -1 EV halves the luminance of everything that the light falls on, the sky included"
    )
    source: ClassVar[str] = (
        "changes: Ko, Nam & Kwak 2012, table 2 (light and colour), and Lee et al. 2012 (sudden, by day and night). "
        "Severity 1: 2 stops, from an office of 320 lx into a corridor of 80 lx; 4: 8 stops, from open sun (100000 lx) "
        "into a room (300 lx; CIBSE Code for Interior Lighting: 8.4), of which the exposure corrects 4. Colour at 1: "
        "from D65 to CIE illuminant A, tungsten. Flicker, pools and patches are chosen; Kim et al. 2002, US 7024034 "
        "(Planckian locus)"
    )

    parts: Annotated[tuple[Part, ...], Field(min_length=1, max_length=100)] = Field(
        default=("change", "colour", "flicker", "pools", "patches", "noise"),
        description="Which changes; the others are left out. 'noise': the sensor's at gain 1, which dark frames show.",
    )
    lights: Literal["all", "sun", "lamps"] = Field(default="all", description="Which lights change their brightness.")
    dim_ev: Annotated[float, Field(ge=-5.0, le=10.0)] = Field(
        default=2.0, description="Change: stops by which the light falls; negative rises."
    )
    at_s: NotNegative = Field(default=2.0, description="Change: when it begins first.")
    rate_ev_s: NotNegative = Field(default=0.0, description="Change: stops per second of a ramp; 0 is a step.")
    hold_s: Positive = Field(default=2.0, description="Change: how long the light stays changed.")
    every_s: Positive = Field(default=5.0, description="Change: from one beginning to the next.")
    temperature_k: Annotated[float, Field(ge=WARMEST_K, le=COLDEST_K)] = Field(
        default=2856.0, description="Colour: temperature of the light while it is changed; 6504 is white."
    )
    flicker_hz: Positive = Field(default=6.0, description="Flicker: frequency; above half the frame rate it aliases.")
    flicker_depth: Annotated[float, Field(ge=0.0, le=1.0)] = Field(
        default=0.1, description="Flicker: (brightest - darkest) / (brightest + darkest) of the luminance."
    )
    pool_ev: Annotated[float, Field(ge=0.0, le=10.0)] = Field(
        default=0.7, description="Pools: stops from below a lamp to midway between two."
    )
    pool_every_m: Positive = Field(default=8.0, description="Pools: distance between lamps along the target's path.")
    patch_share: Annotated[float, Field(ge=0.0, le=0.9)] = Field(
        default=0.2, description="Patches: share of the ground in shade, added to `lights.patches` (needs shadows)."
    )
    auto_exposure: bool = Field(default=True, description="Whether the camera holds the first frame's mean luminance.")
    exposure_lag_s: NotNegative = Field(default=0.5, description="Auto-exposure: time constant; 0 answers at once.")
    exposure_range_ev: Annotated[float, Field(gt=0.0, le=10.0)] = Field(
        default=4.0, description="Auto-exposure: largest correction in stops."
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

    @property
    def events_s(self) -> tuple[float, ...]:
        """When the change begins first, where it is the only part."""
        return (self.at_s,) if self.on and self.parts == ("change",) else ()

    def course(self, time_s: float) -> float:
        """Share of the full change at this time, in [0, 1].

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
        """Stops that this axis adds to the light, `time_s` after the start of the episode.

        The target, which starts below a lamp, has walked `walked_m` along its path; `flicker_rad` is the flicker's
        phase at the start.
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

    @property
    def noisy(self) -> bool:
        """Whether the sensor has the noise of gain 1."""
        return self.on and "noise" in self.parts

    @property
    def shade(self) -> float:
        """Share of the ground in shade at this severity."""
        return self.severity * self.patch_share if "patches" in self.parts else 0.0

    def light_k(self, time_s: float) -> float:
        """Colour temperature of the light [K]; `WHITE_K` while it is unchanged."""
        if "colour" not in self.parts:
            return WHITE_K
        white = 1e6 / WHITE_K
        mired = white + self.severity * self.course(time_s) * (1e6 / self.temperature_k - white)
        return 1e6 / min(1e6 / WARMEST_K, max(1e6 / COLDEST_K, mired))
