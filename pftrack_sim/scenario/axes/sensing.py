"""Stress axes of the camera and of the link to the tracker."""

from __future__ import annotations

import math
from typing import Annotated, Literal, TypeAlias

from pydantic import Field, model_validator

from pftrack_sim.scenario.axes.base import Axis
from pftrack_sim.scenario.section import Band, NotNegative, Positive, number, setting

Source: TypeAlias = Literal["wind", "ground", "road"]
_Coefficient: TypeAlias = Annotated[float, Field(ge=-10.0, le=10.0)]
RoadClass: TypeAlias = Literal["A", "B", "C", "D", "E"]


MAX_SHAKE_DEG = 40.0
"""Strongest shake of the axis at any severity, RMS of each of pitch, yaw and roll [deg]."""


class JitterAxis(Axis, name="jitter", headline="angular_rms_deg", unit="deg RMS"):
    """Camera shake from the three sources of Ko et al. 2012: wind, ground vibration and road roughness."""

    sources: tuple[Source, ...] = setting(("wind", "ground", "road"), "Active sources.", min_length=1, max_length=8)
    wind_rms_deg: NotNegative = setting(0.5, "Gusts: RMS of each of pitch, yaw and roll.")
    wind_corner_hz: float = setting(
        0.8, "Gusts: frequency above which they fade (spectrum 1 / (1 + (f / corner)^2)).", gt=0, le=20
    )
    ground_rms_deg: NotNegative = setting(1.5, "Vibration: RMS of each of pitch, yaw and roll.")
    ground_rms_mm: NotNegative = setting(10.0, "Vibration: RMS along each of x, y and z.")
    ground_band_hz: Band = setting((1.0, 5.0), "Vibration: lowest and highest frequency.")
    road_class: RoadClass = setting("B", "Roughness of the road by ISO 8608: A (very good) to E (very poor).")

    @model_validator(mode="after")
    def _shake_is_bounded(self) -> JitterAxis:
        if self.physical > MAX_SHAKE_DEG:
            raise ValueError(
                f"the camera may shake by at most {MAX_SHAKE_DEG:g} deg RMS, got {self.physical:g} deg: severity "
                f"{self.severity:g} times {self.angular_rms_deg:g} deg"
            )
        return self

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

    k1: _Coefficient = setting(-0.125, "Radial, r^2: negative is a barrel, positive a cushion.")
    k2: _Coefficient = setting(0.04, "Radial, r^4.")
    p1: _Coefficient = setting(0.0, "Tangential: the sensor is tilted about the horizontal.")
    p2: _Coefficient = setting(0.0, "Tangential: the sensor is tilted about the vertical.")
    k3: _Coefficient = setting(0.0, "Radial, r^6.")

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
