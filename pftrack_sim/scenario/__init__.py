"""The scenario language: TOML in, checked and frozen values out, every range drawn per seed."""

from pftrack_sim.scenario.files import names
from pftrack_sim.scenario.load import Scenario, ScenarioLike, load
from pftrack_sim.scenario.model import ResolvedScenario, axis_without_effect, late_events
from pftrack_sim.scenario.validation import editor_schema

__all__ = [
    "ResolvedScenario",
    "Scenario",
    "ScenarioLike",
    "axis_without_effect",
    "editor_schema",
    "late_events",
    "load",
    "names",
]
