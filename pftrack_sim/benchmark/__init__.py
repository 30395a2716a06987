"""The benchmark: scenarios x conditions x seeds x trackers, run, stored and compared."""

from pftrack_sim.benchmark.plan import Condition, Episode, Plan, TrackerSpec
from pftrack_sim.benchmark.planning import join_plans, make_plan, plan_all
from pftrack_sim.benchmark.run import Interrupted, new_run_path, run
from pftrack_sim.benchmark.seeds import parse_seeds
from pftrack_sim.benchmark.store import RunStore
from pftrack_sim.benchmark.summary import Result

__all__ = [
    "Condition",
    "Episode",
    "Interrupted",
    "Plan",
    "Result",
    "RunStore",
    "TrackerSpec",
    "join_plans",
    "make_plan",
    "new_run_path",
    "parse_seeds",
    "plan_all",
    "run",
]
