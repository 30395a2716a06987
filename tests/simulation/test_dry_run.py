"""A recorded dry run: its beginning, and what lies between its samples."""

from typing import Any

import numpy as np
import pytest

from pftrack_sim import scenario
from pftrack_sim.simulation import world as world_module
from pftrack_sim.simulation.dry_run import DryRun, dry_run
from pftrack_sim.simulation.world import World

TIMES_S = np.array([0.0, 0.04, 0.08, 0.12])
RUN = DryRun(
    TIMES_S, np.outer(TIMES_S, [1.0, 2.0, 0.0]), np.outer(TIMES_S, [3.0, 0.0]), np.outer(TIMES_S, [0.0, -1.0]), 1.7
)


@pytest.mark.parametrize(("until_s", "last_s"), [(0.0, 0.04), (0.05, 0.08), (0.08, 0.12), (9.0, 0.12)])
def test_the_beginning_reaches_the_first_sample_after_a_time(until_s: float, last_s: float):
    start = RUN.until(until_s)
    assert start.times_s[-1] == last_s
    assert {len(rows) for rows in (start.times_s, start.camera_m, start.target_m, start.robot_m)} == {
        len(start.times_s)
    }


def test_between_samples_places_are_interpolated():
    camera, target = RUN.at([0.02, 0.1])
    np.testing.assert_allclose(camera, [[0.02, 0.04, 0.0], [0.1, 0.2, 0.0]])
    np.testing.assert_allclose(target, [[0.06, 0.0], [0.3, 0.0]])
    np.testing.assert_allclose(RUN.robot_at(0.02), [[0.0, -0.02]])


def test_a_first_part_and_its_rest_are_the_whole_run(monkeypatch: pytest.MonkeyPatch):
    runs: list[DryRun] = []

    def both(*arguments: Any) -> DryRun:
        *common, until_s, height_m, first_s = arguments
        first = dry_run(*common, until_s, height_m, first_s)
        assert first.rest is not None
        assert first.until(until_s) is first
        runs.extend([first, first.whole(), dry_run(*common, until_s, height_m)])
        return first

    monkeypatch.setattr(world_module, "dry_run", both)
    World(scenario.load("plaza-walk", {"duration_s": 7.0}).resolve(1), 1, draws=False)
    first, whole, again = runs
    assert first.end_s == whole.end_s == again.end_s == whole.times_s[-1]
    assert len(first.times_s) < len(whole.times_s)
    for name in ("times_s", "camera_m", "target_m", "robot_m"):
        np.testing.assert_array_equal(getattr(whole, name), getattr(again, name))
        np.testing.assert_array_equal(getattr(first, name), getattr(whole, name)[: len(first.times_s)])
