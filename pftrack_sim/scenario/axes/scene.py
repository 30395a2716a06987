"""Stress axes of what happens in the scene: occlusions, distractors, the target, light."""

from __future__ import annotations

import math
from typing import Literal, TypeAlias

from pydantic import model_validator

from pftrack_sim.scenario.actions import Action, Lowering, Run, Stop, Turn
from pftrack_sim.scenario.axes.base import Axis
from pftrack_sim.scenario.section import NotNegative, Positive, Share, number, setting


class OcclusionAxis(Axis, name="occlusion", headline="duration_s", unit="s"):
    """Occluders between the camera and the target at given times, in addition to the scenario's own.

    They move with the line of sight, so that one second of occlusion is one second in every scenario: cabinets and low
    carts that drive themselves, and pedestrians who walk along.
    """

    kind: Literal["pillar", "wall", "stranger", "lookalike"] = setting(
        "pillar",
        "'pillar': a cabinet as tall as people; 'wall': a low cart that covers from the feet upwards; 'stranger': a "
        "pedestrian in other clothes; 'lookalike': one in the same.",
    )
    duration_s: Positive = setting(1.3, "How long each one covers the centre line at severity 1.")
    share: float = setting(
        1.0, "Share of the target's visible body that a wall covers; others cover it whole.", gt=0, le=1
    )
    count: int = number(1, 0, 6, "How many.")
    end_s: NotNegative = setting(7.0, "When the first one ends, at every severity.")
    every_s: Positive = setting(6.0, "From the end of one to the end of the next.")
    depth: float = number(0.5, 0.3, 0.7, "Where it passes between the camera (0) and the target (1), if there is room.")

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


class DistractorsAxis(Axis, name="distractors", headline="count", unit="people"):
    """Look-alikes who come near the target, in addition to the scenario's own pedestrians.

    Some come along the target's path and pass close by it. Others cross between the camera and the target, cover it for
    a moment, and walk on in another direction: a tracker that moves over to them is led away.
    """

    count: int = number(2, 0, 8, "How many come near at severity 1.")
    similarity: Share = setting(1.0, "Similarity of clothes and build to the target's: 1 a twin, 0 clearly different.")
    where: Literal["both", "across", "beside"] = setting(
        "both", "'across': they cross between camera and target; 'beside': they pass the target; 'both': by turns."
    )
    distance_m: float = number(0.8, 0.55, 3, "Beside: distance of the centres when nearest to the target.")
    cover_s: float = number(0.4, 0.2, 2, "Across: how long each covers the target's centre line; 0.4 s is a walk past.")
    at_s: NotNegative = setting(3.0, "When the first is nearest, or in the middle of its crossing.")
    every_s: Positive = setting(1.5, "From one to the next.")

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


class TargetAxis(Axis, name="target", headline="per_minute", unit="manoeuvres / min"):
    """Manoeuvres of the target on its path, changes of the robot's distance, and a target that leaves the view."""

    per_minute: NotNegative = setting(12.0, "Manoeuvres a minute at severity 1; 0 for none.")
    manoeuvres: tuple[Manoeuvre, ...] = setting(
        ("stop", "run", "crouch", "turn"),
        "In this order, over and over. 'stop': stands still for a while; 'turn': faces about on the spot, walks "
        "back, and faces about again; 'crouch': stops, squats and rises; 'run': runs for a while.",
        min_length=1,
        max_length=100,
    )
    at_s: NotNegative = setting(2.0, "When the first manoeuvre begins.")
    run_m_s: float = number(2.7, 2.2, 3.2, "Speed of running.")
    faster_m_s: NotNegative = setting(0.1, "Added to the walking speed at severity 1.")
    range_m: NotNegative = setting(
        0.4, "How far the robot swings ahead of and behind its place relative to the target."
    )
    period_s: Positive = setting(12.0, "Period of that swing; a short one asks for more than the robot's top speed.")
    leave_s: NotNegative = setting(0.5, "How long the target is out of view at severity 1.")
    leave_at_s: NotNegative = setting(9.0, "When it leaves; the operator's camera turns away.")

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


class LightAxis(Axis, name="light", headline="dim_ev", unit="EV"):
    """Light that drops and returns, changes its colour, flickers, and varies along the path and from place to place.

    Change and colour share one time course: at `at_s` the light falls by `dim_ev`, stays for `hold_s`, returns, and
    repeats every `every_s`.
    """

    parts: tuple[Part, ...] = setting(
        ("change", "colour", "flicker", "pools", "patches", "noise"),
        "Which changes; the others are left out. 'noise': the sensor's at gain 1, which dark frames show.",
        min_length=1,
        max_length=100,
    )
    lights: Literal["all", "sun", "lamps"] = setting("all", "Which lights change their brightness.")
    dim_ev: float = number(2.0, -5, 10, "Change: stops by which the light falls; negative rises.")
    at_s: NotNegative = setting(2.0, "Change: when it begins first.")
    rate_ev_s: NotNegative = setting(0.0, "Change: stops per second of a ramp; 0 is a step.")
    hold_s: Positive = setting(2.0, "Change: how long the light stays changed.")
    every_s: Positive = setting(5.0, "Change: from one beginning to the next.")
    temperature_k: float = number(
        2856.0, WARMEST_K, COLDEST_K, "Colour: temperature of the changed light; 6504 is white."
    )
    flicker_hz: Positive = setting(6.0, "Flicker: frequency; above half the frame rate it aliases.")
    flicker_depth: float = number(0.1, 0, 1, "Flicker: (brightest - darkest) / (brightest + darkest) of the luminance.")
    pool_ev: float = number(0.7, 0, 10, "Pools: stops from below a lamp to midway between two.")
    pool_every_m: Positive = setting(8.0, "Pools: distance between lamps along the target's path.")
    patch_share: float = number(
        0.2, 0, 0.9, "Patches: share of ground in shade, added to `lights.patches` (needs shadows)."
    )
    auto_exposure: bool = setting(True, "Whether the camera holds the first frame's mean luminance.")
    exposure_lag_s: NotNegative = setting(0.5, "Auto-exposure: time constant; 0 answers at once.")
    exposure_range_ev: float = setting(4.0, "Auto-exposure: largest correction in stops.", gt=0, le=10)
    auto_white_balance: bool = setting(False, "Whether the camera holds the first frame's mean colour.")
    white_balance_lag_s: NotNegative = setting(1.5, "White balance: time constant; 0: at once.")

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
