"""Profiles of scenarios and of recorded sequences: how hard their videos are, without a tracker."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from pftrack_sim.benchmark.datasets.recorded import rate_of
from pftrack_sim.benchmark.running.rollout import Sample, recorded, rollout, simulated
from pftrack_sim.formats import RecordedSequence
from pftrack_sim.scenario import Scenario
from pftrack_sim.score.profile import Profile, ProfileMeter, mean_profile
from pftrack_sim.simulation.simulation import Simulation


def profile_scenario(
    scenario: Scenario,
    seeds: Sequence[int],
    *,
    backend: str | None = None,
    on_frame: Callable[[], None] = lambda: None,
) -> Profile:
    """Mean profile of a scenario's episodes, in which the robot follows its script.

    Raises:
        ParameterError: The target is never visible in an episode.
    """
    profiles: list[Profile] = []
    for seed in seeds:
        with Simulation(scenario, backend=backend) as simulation:
            profiles.append(_measure(f"{scenario.name}, seed {seed}", simulated(simulation, seed), on_frame))
    return mean_profile(profiles)


def profile_sequence(sequence: RecordedSequence, *, on_frame: Callable[[], None] = lambda: None) -> Profile:
    """Profile of a recorded sequence.

    Raises:
        SequenceError: An image cannot be read.
    """
    return _measure(sequence.name, recorded(sequence, rate_of(sequence)), on_frame)


def _measure(name: str, samples: Iterable[Sample], on_frame: Callable[[], None]) -> Profile:
    meter = ProfileMeter(name)

    def measure(sample: Sample) -> None:
        meter.add(sample.time_s, sample.image, sample.true_box, sample.visible_fraction > 0.0)
        on_frame()

    rollout(samples, (), [measure])
    return meter.profile()
