"""The dry run is where the episode goes, and gives what lies between its samples."""

import numpy as np
import pytest

from pftrack_sim import scenario
from pftrack_sim.agents.path import Path
from pftrack_sim.simulation.dry_run import DryRun, dry_run
from pftrack_sim.simulation.world import World

TIMES_S = np.arange(4) * 0.04
RUN = DryRun(
    TIMES_S,
    np.stack([TIMES_S, 2.0 * TIMES_S, 0.0 * TIMES_S], axis=1),
    np.stack([3.0 * TIMES_S, 0.0 * TIMES_S], axis=1),
    3.0 * TIMES_S,
    np.stack([0.0 * TIMES_S, -TIMES_S], axis=1),
    1.7,
    0.1,
)


@pytest.mark.parametrize(("until_s", "last_s"), [(0.0, 0.04), (0.05, 0.08), (0.08, 0.12), (9.0, 0.12)])
def test_the_beginning_reaches_the_first_sample_after_a_time(until_s: float, last_s: float):
    start = RUN.until(until_s)
    assert start.end_s == min(until_s, 0.1)
    assert start.times_s[-1] == last_s
    assert {len(rows) for rows in (start.camera_m, start.target_m, start.robot_m)} == {len(start.times_s)}


def test_between_samples_places_are_interpolated():
    np.testing.assert_allclose(RUN.robot_at(0.02), [[0.0, -0.02]])
    camera, target = RUN.at([0.02, 0.1])
    np.testing.assert_allclose(camera, [[0.02, 0.04, 0.0], [0.1, 0.2, 0.0]])
    np.testing.assert_allclose(target, [[0.06, 0.0], [0.3, 0.0]])


@pytest.mark.parametrize("name", ["warehouse", "hall", "hard/corridor", "ko2012/video-2"])
def test_camera_target_and_robot_are_there_in_the_episode(name: str):
    """Whatever the operator does: swings, stops, changes of distance, and a target that stops and turns."""
    settings = scenario.load(name, {"lights.shadows": False, "distractors.count": 0}).resolve(3)
    world = World(settings, 3, draws=False)
    path = Path(settings.target.path_m)
    rows = []
    while world.time_s < 12.0:
        world.advance()
        target_m = world.traffic.crowd.positions_m[0]
        rows.append((world.time_s, *world.camera_pose()[:3, 3], *target_m, *world.robot_pose()[:2]))
    times_s, *_ = episode = np.array(rows).T
    run = dry_run(settings, path, world.robot.script, 12.0)
    (camera, target), robot = run.at(times_s), run.robot_at(times_s)
    for dry, there, most_m in ((camera, episode[1:4], 0.07), (target, episode[4:6], 0.06), (robot, episode[6:], 0.06)):
        assert np.linalg.norm(dry.T - there, axis=0).max() < most_m
