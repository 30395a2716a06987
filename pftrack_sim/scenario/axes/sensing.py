"""Stress axes of the camera and of the link to the tracker."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal, TypeAlias

from pydantic import Field, model_validator

from pftrack_sim.scenario.axes.base import Axis
from pftrack_sim.scenario.section import NotNegative, Positive

Source: TypeAlias = Literal["wind", "ground", "road"]
_Coefficient: TypeAlias = Annotated[float, Field(ge=-10.0, le=10.0)]
RoadClass: TypeAlias = Literal["A", "B", "C", "D", "E"]


MAX_SHAKE_DEG = 40.0
"""Strongest shake of the axis at any severity, RMS of each of pitch, yaw and roll [deg]."""


class JitterAxis(Axis):
    """Camera shake from the three sources of Ko et al. 2012: wind, ground vibration and road roughness."""

    headline: ClassVar[str] = "angular_rms_deg"
    unit: ClassVar[str] = "deg RMS"
    law: ClassVar[str] = (
        "RMS of wind and ground, and the height of the road's bumps, are multiplied by the severity; wind sways the "
        "mast about its foot with a first-order spectrum, ground is flat over its band, the road goes through wheels "
        "and suspension at the robot's speed"
    )
    source: ClassVar[str] = (
        "sources: Ko, Nam & Kwak 2012, section 1; ISO 8608:2016; Shinozuka & Deodatis 1991. Severity 1 is a camera "
        "that walks: heads of walking and running people turn at no more than 90 deg/s, in running at 3.2 Hz (medians; "
        "Grossman et al. 1988), and 1.5 deg RMS from 1 to 5 Hz have an RMS frequency of 3.2 Hz and 90 deg/s at three "
        "standard deviations"
    )

    sources: Annotated[tuple[Source, ...], Field(min_length=1, max_length=8)] = Field(
        default=("wind", "ground", "road"), description="Active sources."
    )
    wind_rms_deg: NotNegative = Field(default=0.5, description="Gusts: RMS of each of pitch, yaw and roll.")
    wind_corner_hz: Annotated[float, Field(gt=0.0, le=20.0)] = Field(
        default=0.8, description="Gusts: frequency above which they fade (spectrum 1 / (1 + (f / corner)^2))."
    )
    ground_rms_deg: NotNegative = Field(default=1.5, description="Vibration: RMS of each of pitch, yaw and roll.")
    ground_rms_mm: NotNegative = Field(default=10.0, description="Vibration: RMS along each of x, y and z.")
    ground_band_hz: tuple[Positive, Positive] = Field(
        default=(1.0, 5.0), description="Vibration: lowest and highest frequency."
    )
    road_class: RoadClass = Field(
        default="B", description="Roughness of the road by ISO 8608: A (very good) to E (very poor)."
    )

    @model_validator(mode="after")
    def _band_is_ordered(self) -> JitterAxis:
        if self.ground_band_hz[0] >= self.ground_band_hz[1]:
            raise ValueError(f"ground_band_hz must be [low, high] with low < high, got {list(self.ground_band_hz)}")
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


class BlurAxis(Axis):
    """Finite exposure time: the frame integrates light over it; at severity 0 the exposure is an instant."""

    headline: ClassVar[str] = "exposure_ms"
    unit: ClassVar[str] = "ms"
    law: ClassVar[str] = (
        "the exposure is multiplied by the severity; an edge that moves at v px/s is smeared over v x exposure, in "
        "linear light. The frame's time is the end of its exposure"
    )
    source: ClassVar[str] = (
        "law: Potmesil & Chakravarty 1983 (temporal box filter). Chosen: 20 ms is half of the frame interval at 25 Hz; "
        "severity 2, 40 ms, is the longest exposure at 25 Hz, and 4 that of a camera which slows down to 12 Hz"
    )

    exposure_ms: Annotated[float, Field(ge=0.0, le=200.0)] = Field(default=20.0, description="Exposure time.")


class RollingShutterAxis(Axis):
    """Rows are exposed one after the other, the top row first; at severity 0 all at once."""

    headline: ClassVar[str] = "readout_ms"
    unit: ClassVar[str] = "ms"
    law: ClassVar[str] = (
        "the readout is multiplied by the severity; a row at height y of H is exposed readout x (1 - y / H) before "
        "the frame's time, so an upright pole that moves at v px/s slants by v x readout over the image's height"
    )
    source: ClassVar[str] = (
        "law: Meingast, Geyer & Sastry 2005. Severity 1: 30.8 ms measured for an iPhone 3GS at 640x480 and 30 Hz; 2: "
        "57.8 and 60.8 ms for an HTC Desire and a Sony Ericsson W890i (Ringaby & Forssén 2012, with a blinking LED)"
    )

    readout_ms: Annotated[float, Field(ge=0.0, le=200.0)] = Field(
        default=30.8, description="Readout time from the top row to the bottom row."
    )


class DistortionAxis(Axis):
    """Brown-Conrady lens distortion in OpenCV's parameters; at severity 0 a pinhole camera."""

    headline: ClassVar[str] = "radial"
    unit: ClassVar[str] = "|k1|"
    law: ClassVar[str] = (
        "every coefficient is multiplied by the severity; a ray with slopes (x, y) falls where cv2.projectPoints puts "
        "it. The camera matrix stays as it is: the middle of the image keeps its scale"
    )
    source: ClassVar[str] = (
        "law: Brown 1966; OpenCV, camera calibration. Severity 2 is close to the calibration of the left camera of the "
        "EuRoC flying robot (k1 -0.283, k2 0.074; Burri et al. 2016); 4 is near the most that is invertible over an "
        "image of 50 deg"
    )

    k1: _Coefficient = Field(default=-0.125, description="Radial, r^2: negative is a barrel, positive a cushion.")
    k2: _Coefficient = Field(default=0.04, description="Radial, r^4.")
    p1: _Coefficient = Field(default=0.0, description="Tangential: the sensor is tilted about the horizontal.")
    p2: _Coefficient = Field(default=0.0, description="Tangential: the sensor is tilted about the vertical.")
    k3: _Coefficient = Field(default=0.0, description="Radial, r^6.")

    @property
    def coefficients(self) -> tuple[float, float, float, float, float]:
        """OpenCV's k1, k2, p1, p2, k3 at this severity."""
        s = self.severity
        return s * self.k1, s * self.k2, s * self.p1, s * self.p2, s * self.k3

    @property
    def radial(self) -> float:
        """Magnitude of k1 at severity 1."""
        return abs(self.k1)


class NoiseAxis(Axis):
    """Sensor noise by EMVA 1288: Poisson photoelectrons, Gaussian read noise, analogue gain."""

    headline: ClassVar[str] = "gain"
    unit: ClassVar[str] = "x analogue gain"
    law: ClassVar[str] = (
        "gain and read noise are multiplied by the severity; a white pixel is full_well_e / gain electrons, their "
        "number is Poisson, read noise in electrons is added, and the sum is clipped, display-coded and rounded"
    )
    source: ClassVar[str] = (
        "law: EMVA Standard 1288, release 4.0, section 2. Severity 1: a corridor of 80 lx at f/2 and 1/60 s needs ISO "
        "750 (N^2 / t = E S / 250, ISO 2720); 4: 20 lx, a street at night. Full well and read noise are chosen: round "
        "numbers for a small CMOS"
    )

    full_well_e: Annotated[float, Field(gt=0.0, le=25_000.0)] = Field(
        default=10000.0, description="Electrons of a white pixel at gain 1."
    )
    read_noise_e: NotNegative = Field(default=6.0, description="Standard deviation of the read noise [e-].")
    gain: Positive = Field(
        default=7.5, description="Analogue gain, as ISO / 100: less light is enough for white, with fewer electrons."
    )

    @property
    def white_e(self) -> float:
        """Electrons of a white pixel at this severity, above 0."""
        return self.full_well_e / (self.severity * self.gain)


MOST_DROPPED = 0.9  # Upper bound of the share of lost frames at any severity
WORST_QUALITY = 3  # Lower bound of the JPEG quality at any severity


class StreamAxis(Axis):
    """A radio link: JPEG compression, a lower frame rate, and frames lost in bursts.

    A lost frame is never delivered; the truth of a delivered frame is that of its capture time. In a closed loop the
    last command holds in between.
    """

    headline: ClassVar[str] = "dropped_share"
    unit: ClassVar[str] = "share of frames"
    law: ClassVar[str] = (
        "share dropped and loss of quality (100 - jpeg_quality) are multiplied by the severity, the rate is divided by "
        "it; frames are lost by a chain of two states whose bad state lasts burst_frames on average"
    )
    source: ClassVar[str] = (
        "law: Gilbert 1960, 'Capacity of a burst-noise channel'; Elliott 1963; 802.11g loses packets in such bursts, "
        "some of them longer still (Carvalho, Angeja & Navarro 2005, 'A new packet loss model of the IEEE 802.11g "
        "wireless network'); JPEG quality as in the Independent JPEG Group's library. The shares are chosen: no "
        "measurement of lost frames of a robot's video was found"
    )

    jpeg_quality: Annotated[int, Field(ge=1, le=100)] = Field(default=60, description="JPEG quality; 100 is best.")
    dropped_share: Annotated[float, Field(ge=0.0, le=MOST_DROPPED)] = Field(
        default=0.1, description="Share of the frames sent that are lost, in the long run."
    )
    burst_frames: Annotated[float, Field(ge=1.0, le=1000.0)] = Field(
        default=3.0, description="Mean number of frames lost in a row."
    )
    rate_hz: Positive = Field(
        default=20.0, description="Frames sent per second; no more than the camera takes are sent at any severity."
    )

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


class DetectorAxis(Axis):
    """Errors of a person detector: misses, box noise, false alarms, confidence and latency; frames do not change.

    At severity 0 everybody of whom a pixel shows is detected with the true box and score 1, at once.
    `truth.detector.DetectionModel` gives the detections.
    """

    headline: ClassVar[str] = "false_alarms"
    unit: ClassVar[str] = "false alarms / frame"
    law: ClassVar[str] = (
        "a person is detected with the probability (S(height / height_px) S(visible / visible_share) S(contrast / "
        "contrast_rms)) to the power of the severity, with S(x) = 1 - exp(-x^2.3), -x^1.6 and -x^2; noise of the "
        "centre and of the logarithm of the size, false alarms and latency are multiplied by the severity; errors "
        "last for correlation_s"
    )
    source: ClassVar[str] = (
        "severity 1 is Faster R-CNN on the test set of CityPersons (Zhang, Benenson & Schiele 2017; github.com/"
        "cvgroup-njust/CityPersons): log-average miss rates of 13.0 % for people of 50 px and more, visible by 65 % "
        "and more, 37.2 % for those of 50 to 75 px, 50.5 % for those visible by 20 to 65 %. Such rates are near those "
        "at 0.1 false alarms per image (Dollár et al. 2012). Latency: YOLOv3-416, 29 ms (Redmon & Farhadi 2018). "
        "Chosen: contrast, scores, correlation, and box noise (mean overlap with the true box 0.79)"
    )

    height_px: Positive = Field(default=56.0, description="Height at which 37 % are missed for their size alone.")
    visible_share: Positive = Field(default=0.57, description="Visible fraction at which 37 % are missed for it alone.")
    contrast_rms: Positive = Field(
        default=0.03, description="RMS contrast of the luminance in the box at which 37 % are missed for it alone."
    )
    box_noise: Annotated[float, Field(gt=0.0, le=1.0)] = Field(
        default=0.07, description="Standard deviation of the centre, as a share of width and height, and of log size."
    )
    false_alarms: NotNegative = Field(default=0.1, description="False positives per frame: boxes without a person.")
    lowest_score: Annotated[float, Field(ge=0.0, le=1.0)] = Field(
        default=0.3, description="Score of a detection that was nearly missed; 1 is the best."
    )
    correlation_s: Positive = Field(default=0.2, description="Time constant of the errors.")
    latency_ms: Annotated[float, Field(ge=0.0, le=2000.0)] = Field(
        default=29.0, description="Simulated time until the detections of a frame are there."
    )

    @property
    def latency_s(self) -> float:
        """Time until the detections of a frame are there, at this severity."""
        return 1e-3 * self.severity * self.latency_ms
