"""A dry run is simulated as far as it is asked for, and gives what lies between its samples."""

from collections.abc import Iterator

import numpy as np
import pytest

from pftrack_sim import scenario
from pftrack_sim.simulation import world as world_module
from pftrack_sim.simulation.dry_run import DryRun, Sample
from pftrack_sim.simulation.world import World


def run_of(taken: list[float]) -> DryRun:
    """A sample every 40 ms; times of those that have been taken are added to the list."""

    def samples() -> Iterator[Sample]:
        for tick in range(4):
            time_s = 0.04 * tick
            taken.append(time_s)
            yield Sample(time_s, (time_s, 2.0 * time_s, 0.0), (3.0 * time_s, 0.0), (0.0, -time_s))

    return DryRun.of(samples(), 1.7, 0.12)


@pytest.mark.parametrize(("until_s", "last_s"), [(0.0, 0.04), (0.05, 0.08), (0.08, 0.12), (9.0, 0.12)])
def test_the_beginning_reaches_the_first_sample_after_a_time_and_no_more_is_simulated(until_s: float, last_s: float):
    taken: list[float] = []
    start = run_of(taken).until(until_s)
    assert taken == []
    assert start.times_s[-1] == taken[-1] == last_s
    assert {len(rows) for rows in (start.camera_m, start.target_m, start.robot_m)} == {len(start.times_s)}


def test_between_samples_places_are_interpolated():
    taken: list[float] = []
    run = run_of(taken)
    np.testing.assert_allclose(run.robot_at(0.02), [[0.0, -0.02]])
    assert taken == [0.0, 0.04]
    camera, target = run.at([0.02, 0.1])
    np.testing.assert_allclose(camera, [[0.02, 0.04, 0.0], [0.1, 0.2, 0.0]])
    np.testing.assert_allclose(target, [[0.06, 0.0], [0.3, 0.0]])


def test_near_things_the_robot_is_simulated_among_everything_and_to_the_bit_as_alone(monkeypatch: pytest.MonkeyPatch):
    """Bits are those of the robot alone until it touches something."""
    walker = {"kind": "walker", "at_s": 1.0, "duration_s": 0.3}
    changes = {"duration_s": 7.0, "lights.shadows": False, "occluders": [walker], "groups": []}
    settings = scenario.load("plaza-walk", changes).resolve(1)
    real, geoms, runs = world_module.simulated, list[int](), list[list[Sample]]()

    def recorded(model: object, *arguments: object) -> Iterator[Sample]:
        geoms.append(model.ngeom)
        runs.append([])
        for sample in real(model, *arguments):
            runs[-1].append(sample)
            yield sample

    monkeypatch.setattr(world_module, "simulated", recorded)
    World(settings, 1, draws=False)
    assert len(runs) == 1
    assert 2.0 < runs[0][-1].time_s < 3.0
    # Something is that near wherever the robot is.
    monkeypatch.setattr(world_module, "ROBOT_RADIUS_M", 100.0)
    World(settings, 1, draws=False)
    assert geoms[0] == geoms[1] < geoms[2]
    assert len(runs[1]) == 1
    assert runs[2] == runs[0]
