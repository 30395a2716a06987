"""Latencies of trackers: given, printed in papers, or measured once and stored in the plan."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from pftrack_sim.benchmark.asked.from_names import match_trackers
from pftrack_sim.benchmark.asked.plan import TrackerSpec
from pftrack_sim.benchmark.kept.folder import RunFolder, is_run
from pftrack_sim.benchmark.running.rollout import detected, rollout, simulated
from pftrack_sim.benchmark.running.tracker_runner import Isolation, make_runners
from pftrack_sim.core.errors import RunError
from pftrack_sim.scenario import Scenario
from pftrack_sim.simulation.simulation import Simulation
from pftrack_sim.trackers.isolation import Limits

FRAMES = 25
"""Frames of a measurement."""


def resolve_latencies(
    given: Mapping[str, float | None],
    trackers: Sequence[TrackerSpec],
    scenario: Scenario,
    run_folder: Path | None = None,
    *,
    isolation: Isolation = "auto",
    limits: Limits | None = None,
) -> dict[str, float]:
    """Latency of each tracker as a number [ms], by its `base_label`.

    Args:
        given: By a tracker's name (all its parameterisations) or `base_label` (one); None is measured.
        trackers: Trackers of the run.
        scenario: Measured on the first frames of its seed 0.
        run_folder: A run folder that may exist already: what its plan holds is not measured again.
        isolation: Which trackers run in a process of their own, as in the run.
        limits: Limits of those.

    Raises:
        UnknownNameError: A name or label that no tracker of the run has.
        RunError: The latency cannot be measured because the tracker fails.
    """
    stored: dict[str, float] = {}
    if run_folder is not None and is_run(run_folder):
        stored = {spec.base_label: spec.latency_ms for spec in RunFolder(run_folder).plan.trackers}
    latencies: dict[str, float] = {}
    for key, spec in match_trackers(given, trackers):
        value = given[key]
        if value is None:
            value = stored.get(spec.base_label) or measure_ms(spec, scenario, isolation=isolation, limits=limits)
        latencies[spec.base_label] = value
    return latencies


def measure_ms(
    tracker: TrackerSpec, scenario: Scenario, *, isolation: Isolation = "auto", limits: Limits | None = None
) -> float:
    """Median time per frame of a tracker on this machine [ms], rounded up to a tenth; at most `FRAMES` frames are used.

    Raises:
        RunError: The tracker fails, or the target does not appear.
    """
    (runner,) = make_runners([tracker], seed=0, isolation=isolation, limits=limits)
    try:
        with Simulation(scenario) as simulation:
            settings = scenario.resolve(0)
            frames = simulated(simulation, 0, until_s=(FRAMES - 1) / settings.camera.rate_hz)
            rollout(detected(frames, settings, 0), [runner])
    finally:
        runner.close()
    times = [ms for ms, status in zip(runner.ms, runner.statuses, strict=True) if status == "ok"]
    if runner.error is not None or not times:
        reason = runner.error or "the target did not appear"
        raise RunError(f"cannot measure the latency of {tracker.label}: {reason}")
    return max(math.ceil(10.0 * float(np.median(times))), 1) / 10.0
