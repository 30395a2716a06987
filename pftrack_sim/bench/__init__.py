"""Scenarios x seeds x trackers: who is better at what."""

from pftrack_sim.bench.plan import Condition, Episode, Plan, make_plan, parse_seeds
from pftrack_sim.bench.run import Result, new_run_path, run

__all__ = ["Condition", "Episode", "Plan", "Result", "make_plan", "new_run_path", "parse_seeds", "run"]
