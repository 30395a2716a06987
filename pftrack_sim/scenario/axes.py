"""The stress axes: each a table of a scenario, `[axes.<name>]`, with a severity and physical parameters.

First those of what happens in the scene, then those of the camera and of the link to the tracker.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, ClassVar, Literal, TypeAlias, Unpack, cast

from pydantic import ConfigDict, model_validator

from pftrack_sim.core.data_files import asset_table
from pftrack_sim.scenario.people import Action, Lowering, Run, Stop, Turn
from pftrack_sim.scenario.section import Band, NotNegative, Positive, Section, Share, number, setting


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

    def _contradictions(self) -> Iterator[str]:
        length = self.severity * self.duration_s
        if self.count and length > self.end_s:
            yield f"a cover of {length:g} s cannot end at end_s = {self.end_s:g}: it would begin before 0 s"
        if self.count > 1 and length > self.every_s:
            yield f"every_s must be at least the {length:g} s that each cover lasts, got {self.every_s:g}"


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
    def events_s(self) -> tuple[float, ...]:
        """When each is nearest to the target, or in front of it."""
        # A half is a person too: severity 0.5 of one person is not severity 0.
        return tuple(self.at_s + number * self.every_s for number in range(math.ceil(self.severity * self.count)))

    @property
    def passings_s(self) -> tuple[float, ...]:
        """Times at which people pass beside the target."""
        return {"both": self.events_s[1::2], "across": (), "beside": self.events_s}[self.where]

    @property
    def crossings_s(self) -> tuple[tuple[float, float], ...]:
        """Beginning and length of each cover by people who cross."""
        times = {"both": self.events_s[0::2], "across": self.events_s, "beside": ()}[self.where]
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
        if manoeuvre == "run":
            return Run(kind="run", at_s=at_s, speed_m_s=self.run_m_s)
        kind: Any = {"stop": Stop, "turn": Turn, "crouch": Lowering}[manoeuvre]
        return kind(kind=manoeuvre, at_s=at_s)

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


WHITE_K = 6504.0  # Colour temperature of the light that the scenarios are drawn in
WARMEST_K, COLDEST_K = 2000.0, 25000.0  # Range of colour temperatures without negative primaries


class LightAxis(Axis, name="light", headline="dim_ev", unit="EV"):
    """Light that drops and returns, changes its colour, flickers, and varies along the path and from place to place.

    Change and colour share one time course: at `at_s` the light falls by `dim_ev`, stays for `hold_s`, returns, and
    repeats every `every_s`.
    """

    parts: tuple[Literal["change", "colour", "flicker", "pools", "patches", "noise"], ...] = setting(
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

    def _contradictions(self) -> Iterator[str]:
        changed_s = 2.0 * self._ramp_s + self.hold_s
        if changed_s > self.every_s:
            needed = f"two ramps and hold_s, {changed_s:g} s at severity 1"
            yield f"every_s must leave room for {needed}, got {self.every_s:g}"

    @property
    def _ramp_s(self) -> float:
        """Length of a ramp: at every severity as long as at severity 1, so that a higher one is steeper."""
        return abs(self.dim_ev) / self.rate_ev_s if self.rate_ev_s > 0.0 else 0.0

    @property
    def events_s(self) -> tuple[float, ...]:
        """When the change begins first, where it is the only part."""
        return (self.at_s,) if self.on and self.parts == ("change",) else ()

    def course(self, time_s: float) -> float:
        """Share of the full change at this time, in [0, 1]."""
        since_s = time_s - self.at_s
        if since_s < 0.0:
            return 0.0
        # A step that falls on a frame is seen in that frame, whichever way the quotient was rounded.
        phase_s, ramp_s = math.fmod(since_s + 1e-9, self.every_s), self._ramp_s
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


RoadClass: TypeAlias = Literal["A", "B", "C", "D", "E"]

MAX_SHAKE_DEG, MAX_SHAKE_MM = 40.0, 10_000.0
"""Strongest shake of the axis at any severity, RMS of each of pitch, yaw and roll [deg], and along x, y and z [mm]."""


class JitterAxis(Axis, name="jitter", headline="angular_rms_deg", unit="deg RMS"):
    """Camera shake from the three sources of Ko et al. 2012: wind, ground vibration and road roughness."""

    sources: tuple[Literal["wind", "ground", "road"], ...] = setting(
        ("wind", "ground", "road"), "Active sources.", min_length=1, max_length=8
    )
    wind_rms_deg: NotNegative = setting(0.5, "Gusts: RMS of each of pitch, yaw and roll.")
    wind_corner_hz: float = setting(
        0.8, "Gusts: frequency above which they fade (spectrum 1 / (1 + (f / corner)^2)).", gt=0, le=20
    )
    ground_rms_deg: NotNegative = setting(1.5, "Vibration: RMS of each of pitch, yaw and roll.")
    ground_rms_mm: NotNegative = setting(10.0, "Vibration: RMS along each of x, y and z.")
    ground_band_hz: Band = setting((1.0, 5.0), "Vibration: lowest and highest frequency.")
    road_class: RoadClass = setting("B", "Roughness of the road by ISO 8608: A (very good) to E (very poor).")

    def _contradictions(self) -> Iterator[str]:
        if self.physical > MAX_SHAKE_DEG:
            yield (
                f"the camera may shake by at most {MAX_SHAKE_DEG:g} deg RMS, got {self.physical:g} deg: severity "
                f"{self.severity:g} times {self.angular_rms_deg:g} deg"
            )
        if (far_mm := self.severity * self.ground_rms_mm) > MAX_SHAKE_MM:
            yield f"the camera may shake by at most {MAX_SHAKE_MM:g} mm RMS, got {far_mm:g} mm"

    @property
    def angular_rms_deg(self) -> float:
        """RMS of each of pitch, yaw and roll by wind and ground together, at severity 1 (the road's is its own)."""
        wind = self.wind_rms_deg if "wind" in self.sources else 0.0
        ground = self.ground_rms_deg if "ground" in self.sources else 0.0
        return math.hypot(wind, ground)

    @property
    def roughness(self) -> float:
        """Factor on the heights of the road's bumps: the severity, or 0 without a road."""
        return self.severity if "road" in self.sources else 0.0


class BlurAxis(Axis, name="blur", headline="exposure_ms", unit="ms"):
    """Finite exposure time: the frame integrates light over it; at severity 0 the exposure is an instant."""

    exposure_ms: float = number(20.0, 0, 200, "Exposure time.")


class RollingShutterAxis(Axis, name="rolling_shutter", headline="readout_ms", unit="ms"):
    """Rows are exposed one after the other, the top row first; at severity 0 all at once."""

    readout_ms: float = number(30.8, 0, 200, "Readout time from the top row to the bottom row.")


class DistortionAxis(Axis, name="distortion", headline="radial", unit="|k1|"):
    """Brown-Conrady lens distortion in OpenCV's parameters; at severity 0 a pinhole camera."""

    k1: float = number(-0.125, -10.0, 10.0, "Radial, r^2: negative is a barrel, positive a cushion.")
    k2: float = number(0.04, -10.0, 10.0, "Radial, r^4.")
    p1: float = number(0.0, -10.0, 10.0, "Tangential: the sensor is tilted about the horizontal.")
    p2: float = number(0.0, -10.0, 10.0, "Tangential: the sensor is tilted about the vertical.")
    k3: float = number(0.0, -10.0, 10.0, "Radial, r^6.")

    @property
    def coefficients(self) -> tuple[float, float, float, float, float]:
        """OpenCV's k1, k2, p1, p2, k3 at this severity."""
        s = self.severity
        return s * self.k1, s * self.k2, s * self.p1, s * self.p2, s * self.k3

    @property
    def radial(self) -> float:
        """Magnitude of k1 at severity 1."""
        return abs(self.k1)


class NoiseAxis(Axis, name="noise", headline="gain", unit="x analogue gain"):
    """Sensor noise by EMVA 1288: Poisson photoelectrons, Gaussian read noise, analogue gain."""

    full_well_e: float = setting(10000.0, "Electrons of a white pixel at gain 1.", gt=0, le=25_000)
    read_noise_e: NotNegative = setting(6.0, "Standard deviation of the read noise [e-].")
    gain: Positive = setting(7.5, "Analogue gain, as ISO / 100: less light is enough for white, with fewer electrons.")

    @property
    def white_e(self) -> float:
        """Electrons of a white pixel at this severity, above 0."""
        return self.full_well_e / (self.severity * self.gain)


MOST_DROPPED = 0.9  # Upper bound of the share of lost frames at any severity
WORST_QUALITY = 3  # Lower bound of the JPEG quality at any severity


class StreamAxis(Axis, name="stream", headline="dropped_share", unit="share of frames"):
    """A radio link: JPEG compression, a lower frame rate, and frames lost in bursts.

    A lost frame is never delivered; the truth of a delivered frame is that of its capture time. In a closed loop the
    last command holds in between.
    """

    jpeg_quality: int = number(60, 1, 100, "JPEG quality; 100 is best.")
    dropped_share: float = number(0.1, 0, MOST_DROPPED, "Share of the frames sent that are lost, in the long run.")
    burst_frames: float = number(3.0, 1, 1000, "Mean number of frames lost in a row.")
    rate_hz: Positive = setting(20.0, "Frames sent per second; no more than the camera takes are sent at any severity.")

    @property
    def quality(self) -> int:
        """JPEG quality at this severity."""
        return max(WORST_QUALITY, round(100.0 - self.severity * (100.0 - self.jpeg_quality)))

    @property
    def lost(self) -> float:
        """Share of frames lost at this severity."""
        return min(MOST_DROPPED, self.severity * self.dropped_share)

    @property
    def sent_hz(self) -> float:
        """Frames sent per second at this severity, above 0."""
        return self.rate_hz / self.severity

    @property
    def transitions(self) -> tuple[float, float]:
        """Probabilities per frame of falling into the bad state, and of leaving it.

        Bursts become longer than `burst_frames` where the share of lost frames demands it.
        """
        odds = self.lost / (1.0 - self.lost)
        leave = 1.0 / max(self.burst_frames, odds)
        return leave * odds, leave


class DetectorAxis(Axis, name="detector", headline="false_alarms", unit="false alarms / frame"):
    """Errors of a person detector: misses, box noise, false alarms, confidence and latency; frames do not change.

    At severity 0 everybody of whom a pixel shows is detected with the true box and score 1, at once.
    `truth.detector.DetectionModel` gives the detections.
    """

    height_px: Positive = setting(56.0, "Height at which 37 % are missed for their size alone.")
    visible_share: Positive = setting(0.57, "Visible fraction at which 37 % are missed for it alone.")
    contrast_rms: Positive = setting(
        0.03, "RMS contrast of luminance in the box at which 37 % are missed for it alone."
    )
    box_noise: float = setting(
        0.07, "Standard deviation of the centre, as a share of width and height, and of log size.", gt=0, le=1
    )
    false_alarms: NotNegative = setting(0.1, "False positives per frame: boxes without a person.")
    lowest_score: float = number(0.3, 0, 1, "Score of a detection that was nearly missed; 1 is the best.")
    correlation_s: Positive = setting(0.2, "Time constant of the errors.")
    latency_ms: float = number(29.0, 0, 2000, "Simulated time until the detections of a frame are there.")

    @property
    def latency_s(self) -> float:
        """Time until the detections of a frame are there, at this severity."""
        return 1e-3 * self.severity * self.latency_ms


class Axes(Section):
    """Stress axes. Severity 0 leaves the scenario as it is."""

    jitter: JitterAxis = JitterAxis()
    occlusion: OcclusionAxis = OcclusionAxis()
    distractors: DistractorsAxis = DistractorsAxis()
    target: TargetAxis = TargetAxis()
    light: LightAxis = LightAxis()
    noise: NoiseAxis = NoiseAxis()
    stream: StreamAxis = StreamAxis()
    blur: BlurAxis = BlurAxis()
    rolling_shutter: RollingShutterAxis = RollingShutterAxis()
    distortion: DistortionAxis = DistortionAxis()
    detector: DetectorAxis = DetectorAxis()


def axes_by_name() -> dict[str, type[Axis]]:
    """The class of every axis, in the order of the lists."""
    return {name: cast("type[Axis]", field.annotation) for name, field in Axes.model_fields.items()}
