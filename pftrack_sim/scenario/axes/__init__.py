"""The stress axes: each a table of a scenario, `[axes.<name>]`, with a severity and physical parameters."""

from __future__ import annotations

from typing import cast

from pftrack_sim.scenario.axes.base import Axis
from pftrack_sim.scenario.axes.scene import DistractorsAxis, LightAxis, OcclusionAxis, TargetAxis
from pftrack_sim.scenario.axes.sensing import (
    BlurAxis,
    DetectorAxis,
    DistortionAxis,
    JitterAxis,
    NoiseAxis,
    RollingShutterAxis,
    StreamAxis,
)
from pftrack_sim.scenario.section import Section


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
