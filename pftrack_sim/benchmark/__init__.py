"""Scenarios x seeds x trackers: who is better at what."""

from pftrack_sim.benchmark.plan import Condition, Episode, Plan, TrackerSpec
from pftrack_sim.benchmark.planning import join_plans, make_plan, parse_seeds, plan_all
from pftrack_sim.benchmark.reading import Result, Run
from pftrack_sim.benchmark.run import Interrupted, new_run_path, run

__all__ = [
    "Condition",
    "Episode",
    "Interrupted",
    "Plan",
    "Result",
    "Run",
    "TrackerSpec",
    "join_plans",
    "make_plan",
    "new_run_path",
    "parse_seeds",
    "plan_all",
    "run",
]
