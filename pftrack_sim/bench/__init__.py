"""Scenarios x seeds x trackers: who is better at what."""

from pftrack_sim.bench.plan import Condition, Contestant, Episode, Plan
from pftrack_sim.bench.planning import join_plans, make_plan, parse_seeds, plan_all
from pftrack_sim.bench.reading import Result, Run
from pftrack_sim.bench.run import Interrupted, new_run_path, run

__all__ = [
    "Condition",
    "Contestant",
    "Episode",
    "Interrupted",
    "Plan",
    "Result",
    "Run",
    "join_plans",
    "make_plan",
    "new_run_path",
    "parse_seeds",
    "plan_all",
    "run",
]
