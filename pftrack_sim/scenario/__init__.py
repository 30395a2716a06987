"""The scenario language: TOML in, checked and frozen values out, every range drawn per seed."""

from pftrack_sim.scenario.load import Scenario, ScenarioLike, load, names
from pftrack_sim.scenario.model import ResolvedScenario
from pftrack_sim.scenario.schema import editor_schema

__all__ = ["ResolvedScenario", "Scenario", "ScenarioLike", "editor_schema", "load", "names"]
