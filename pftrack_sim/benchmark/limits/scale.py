"""The levels of a stress axis in its physical unit, and what of a condition makes them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pftrack_sim import scenario as scenarios
from pftrack_sim.benchmark.asked.plan import BOX_NOISE, LATENCY, RUN_AXES, START, Condition, ScenarioSpec
from pftrack_sim.core.errors import ParameterError, ScenarioError, UnknownNameError
from pftrack_sim.core.types import FloatArray
from pftrack_sim.render.capture.frame_capture import lens_of
from pftrack_sim.scenario import Scenario
from pftrack_sim.scenario.axes import axes_by_name
from pftrack_sim.scenario.section import Section

Range = tuple[float, float]
"""Lowest and highest level, in the unit of the axis."""

_SEVERITIES = (1.0 / 16.0, 8.0)  # where no range is given
_RUN_RANGES = {LATENCY: (5.0, 2000.0), BOX_NOISE: (0.01, 0.5)}
_PER_OCTAVE = 8
_LEAST, _MOST = 16, 64  # Levels besides 0

_LINEAR = ("light",)  # Stops are logarithms already
_WHOLE = ("distractors",)  # Half a person is a person


def is_linear(axis: str) -> bool:
    """Whether levels of an axis count by their differences; those of others count by their ratios."""
    return axis in _LINEAR


class Mixed(Section):
    """One of several axes that rise together.

    Attributes:
        share: Its severity over the level.
        typical: Level of severity 1, in its unit.
    """

    axis: str
    unit: str
    share: float
    typical: float


MIXES = ((1.0, 0.5), (1.0, 1.0), (0.5, 1.0))
"""Severities of two axes that rise together, between those that rise alone."""


@dataclass(frozen=True, eq=False)
class Scale:
    """Levels of one axis in one scenario.

    Attributes:
        axis: Name of the axis.
        unit: Unit of its levels, as a label.
        settings: `(L,)` rising severities, or levels of an axis of the run; the first is 0, no stress.
        typical: Level of severity 1; None for an axis of the run.
        mix: Of several axes at once, the share of the level that is each one's severity; the unit is a severity then.
    """

    axis: str
    unit: str
    settings: FloatArray
    typical: float | None
    mix: tuple[Mixed, ...] = ()

    @cached_property
    def levels(self) -> FloatArray:
        """`(L,)` the settings in the unit of the axis."""
        return self.settings if self.typical is None else self.settings * self.typical

    @property
    def coordinates(self) -> FloatArray:
        """`(L,)` on which a success rate is taken for a logistic function: logarithms, or the levels themselves."""
        if is_linear(self.axis):
            return np.where(self.levels > 0.0, self.levels, -math.inf)
        with np.errstate(divide="ignore"):
            return np.log(self.levels)

    def level(self, coordinate: float) -> float:
        """The level of a coordinate; 0 below, infinite above the range."""
        if math.isinf(coordinate):
            return 0.0 if coordinate < 0.0 else math.inf
        return coordinate if is_linear(self.axis) else math.exp(coordinate)

    def condition(self, index: int) -> Condition:
        """The condition of a level."""
        setting = float(self.settings[index])
        if self.mix:
            return Condition(levels=tuple((one.axis, float(f"{one.share * setting:.4g}")) for one in self.mix))
        return Condition(levels=((self.axis, setting),))


def make_scale(spec: ScenarioSpec, axis: str, wanted: Range | None, seed: int) -> Scale:
    """The levels of an axis in a scenario.

    Args:
        spec: The scenario.
        axis: A stress axis, or `latency` or `box_noise`.
        wanted: Its range in its unit; None: severities of 1/16 to 8, as far as the scenario accepts them.
        seed: Of the episode on which they are checked.

    Raises:
        UnknownNameError: No such axis.
        ParameterError: A range that is none, or that the axis has no levels in.
        ScenarioError: The axis has no effect in the scenario.
    """
    known = [*axes_by_name(), LATENCY, BOX_NOISE]
    if axis not in known:
        if axis == START:
            raise ParameterError("start is no stress: it has no breaking point")
        raise UnknownNameError("axis", axis, known)
    if wanted is not None and not 0.0 < wanted[0] < wanted[1] < math.inf:
        raise ParameterError(
            f"--axis {axis}=LOW:HIGH takes a range above 0, such as 0.5:5; got {wanted[0]:g}:{wanted[1]:g}"
        )
    if axis in RUN_AXES:
        settings = _spaced(axis, *(wanted or _RUN_RANGES[axis]))
        settings = np.concatenate([[0.0], settings])
        return Scale(axis, RUN_AXES[axis][0], settings, None)
    scenario = Scenario(spec.name, spec.tree)
    typical = scenarios.load(scenario, {f"axes.{axis}.severity": 1.0}).resolve(seed)
    problem = scenarios.axis_without_effect(typical, axis)
    if problem:
        raise ScenarioError(spec.name, [problem])
    stress = getattr(typical.axes, axis)
    if not stress.physical > 0.0:
        raise ParameterError(f"{spec.name}: {stress.headline} of the axis {axis} is 0: its levels have no unit")
    low, high = wanted or tuple(stress.physical * severity for severity in _SEVERITIES)
    severities = np.array([float(f"{level / stress.physical:.4g}") for level in _spaced(axis, low, high)])
    accepted = [one for one in severities if _accepts(scenario, axis, one, seed)]
    if len(accepted) < 3 or (wanted and len(accepted) < len(severities)):
        most = f"at most {accepted[-1] * stress.physical:.3g} {stress.unit}" if accepted else "none of these levels"
        raise ParameterError(f"{spec.name} takes {most} of the axis {axis}, got {low:.3g} to {high:.3g}")
    settings = np.array([0.0, *accepted])
    return Scale(axis, stress.unit, settings, stress.physical)


def mixed(first: Scale, second: Scale, shares: tuple[float, float]) -> Scale:
    """The levels of two stress axes that rise together: severities, as far as both scales have them.

    Raises:
        ParameterError: One is no stress axis, or they have no severities in common.
    """
    mix: list[Mixed] = []
    for scale, share in zip((first, second), shares, strict=True):
        if scale.typical is None or scale.axis in _WHOLE:
            raise ParameterError(f"--joint takes two axes of a scenario with levels of any size, and not {scale.axis}")
        mix.append(Mixed(axis=scale.axis, unit=scale.unit, share=share, typical=scale.typical))
    pairs = list(zip((first, second), shares, strict=True))
    low, high = (pick(scale.settings[end] / share for scale, share in pairs) for pick, end in ((max, 1), (min, -1)))
    if not low < high:
        raise ParameterError(f"the ranges of {first.axis} and {second.axis} have no severities in common")
    levels = np.array([0.0, *(float(f"{level:.4g}") for level in _spaced("", low, high))])
    name = " + ".join(f"{share:g} {scale.axis}" for scale, share in pairs)
    return Scale(name, "severity", levels, None, tuple(mix))


def _spaced(axis: str, low: float, high: float) -> FloatArray:
    if axis in _WHOLE:
        return np.arange(math.ceil(low), math.floor(high) + 1.0)
    if is_linear(axis):
        return np.linspace(low, high, _MOST)
    return np.geomspace(low, high, min(_MOST, max(_LEAST, 1 + round(_PER_OCTAVE * math.log2(high / low)))))


def _accepts(scenario: Scenario, axis: str, severity: float, seed: int) -> bool:
    try:
        lens_of(scenarios.load(scenario, {f"axes.{axis}.severity": severity}).resolve(seed))
    except ScenarioError:
        return False
    return True
