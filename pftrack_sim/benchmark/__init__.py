"""The benchmark: scenarios x conditions x seeds x trackers, run, stored and compared."""

from pftrack_sim.benchmark.asked.from_names import join_plans, make_plan, parse_seeds, plan_all
from pftrack_sim.benchmark.asked.plan import Condition, Episode, Plan, TrackerSpec
from pftrack_sim.benchmark.reading.store import RunStore
from pftrack_sim.benchmark.reading.summary import Result
from pftrack_sim.benchmark.running.run import Interrupted, new_run_path, run

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
