"""What a tracker's thinking costs here, measured once and then part of the plan: results repeat on any host."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from pftrack_sim.benchmark.folder import is_run, read_run_plan
from pftrack_sim.benchmark.plan import TrackerSpec
from pftrack_sim.benchmark.tracker_runner import enter
from pftrack_sim.core.errors import RunError, UnknownNameError
from pftrack_sim.scenario import Scenario
from pftrack_sim.simulation.simulation import Simulation

FRAMES = 25
"""Frames behind a measured latency."""


def settled(
    asked: Mapping[str, float | None], trackers: Sequence[TrackerSpec], scenario: Scenario, begun: Path | None = None
) -> dict[str, float]:
    """Latencies as numbers.

    Args:
        asked: By the tracker's name; None is to be measured.
        trackers: Who takes part.
        scenario: Measured on the first frames of its seed 0.
        begun: Run folder that may have been begun: then its plan says what was measured, and nothing is measured again.

    Raises:
        UnknownNameError: A name that does not take part.
        RunError: The tracker cannot be measured, for it fails.
    """
    by_name = {one.name: one for one in trackers}
    frozen: dict[str, float] = {}
    if begun is not None and is_run(begun):
        frozen = {one.name: one.latency_ms for one in read_run_plan(begun).trackers}
    found: dict[str, float] = {}
    for name, said in asked.items():
        if name not in by_name:
            raise UnknownNameError("tracker that latency is given for", name, by_name)
        found[name] = said if said is not None else frozen.get(name) or measure_ms(by_name[name], scenario)
    return found


def measure_ms(tracker: TrackerSpec, scenario: Scenario) -> float:
    """Median time that a tracker takes for a frame on this machine, rounded up to a tenth of a millisecond.

    Raises:
        RunError: It fails before it has seen `FRAMES` frames.
    """
    (entry,) = enter([tracker], seed=0)
    with Simulation(scenario) as simulation:
        frame = simulation.reset(0)
        for _ in range(min(FRAMES, simulation.frame_count) - 1):
            entry.see(frame.image, frame.truth.box, frame.truth.scored)
            frame = simulation.advance()
    if entry.failure is not None or "ok" not in entry.statuses:
        raise RunError(f"cannot measure the latency of {tracker.label}: {entry.failure or 'the target never appeared'}")
    taken = [ms for ms, status in zip(entry.ms, entry.statuses, strict=True) if status == "ok"]
    return max(math.ceil(10.0 * float(np.median(taken))), 1) / 10.0
