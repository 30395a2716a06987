"""The benchmark: scenarios x conditions x seeds x trackers, run, stored and compared."""

from typing import TYPE_CHECKING, Any

from pftrack_sim.benchmark.asked.from_names import join_plans, make_plan, parse_seeds, plan_all
from pftrack_sim.benchmark.asked.plan import Condition, Episode, Plan, TrackerSpec
from pftrack_sim.benchmark.reading.store import RunStore
from pftrack_sim.benchmark.reading.summary import Result

if TYPE_CHECKING:
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


def __getattr__(name: str) -> Any:
    """What runs episodes, imported when it is first asked for: a stored run is read without the simulator."""
    if name not in ("Interrupted", "new_run_path", "run"):
        raise AttributeError(f"module 'pftrack_sim.benchmark' has no attribute {name!r}")
    from pftrack_sim.benchmark.running import run as module

    return getattr(module, name)
