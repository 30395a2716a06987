"""The stress axes: each a table of a scenario, `[axes.<name>]`, with a severity and physical parameters."""

from __future__ import annotations

from pftrack_sim.scenario.axes.axis import Axis
from pftrack_sim.scenario.axes.distractors import DistractorsAxis
from pftrack_sim.scenario.axes.jitter import JitterAxis
from pftrack_sim.scenario.axes.light import LightAxis
from pftrack_sim.scenario.axes.noise import NoiseAxis
from pftrack_sim.scenario.axes.occlusion import OcclusionAxis
from pftrack_sim.scenario.axes.stream import StreamAxis
from pftrack_sim.scenario.axes.target import TargetAxis
from pftrack_sim.scenario.section import Section


class Axes(Section):
    """Stress axes. Severity 0 leaves the scenario as it is."""

    jitter: JitterAxis = JitterAxis()
    occlusion: OcclusionAxis = OcclusionAxis()
    light: LightAxis = LightAxis()
    distractors: DistractorsAxis = DistractorsAxis()
    noise: NoiseAxis = NoiseAxis()
    stream: StreamAxis = StreamAxis()
    target: TargetAxis = TargetAxis()


def axes_by_name() -> dict[str, type[Axis]]:
    """The class of every axis, in the order of the lists."""
    found: dict[str, type[Axis]] = {}
    for name, field in Axes.model_fields.items():
        assert isinstance(field.annotation, type)
        assert issubclass(field.annotation, Axis)
        found[name] = field.annotation
    return found


__all__ = [
    "Axes",
    "Axis",
    "DistractorsAxis",
    "JitterAxis",
    "LightAxis",
    "NoiseAxis",
    "OcclusionAxis",
    "StreamAxis",
    "TargetAxis",
    "axes_by_name",
]
