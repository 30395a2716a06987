"""A path drawn by seed: where there is room, of the length and the turns asked for, or a clear error."""

from itertools import pairwise
from math import dist

import numpy as np
import pytest

from pftrack_sim import scenario
from pftrack_sim.agents.path import Path
from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap
from pftrack_sim.core.errors import ScenarioError
from pftrack_sim.scene.build import walkable_area
from pftrack_sim.simulation.target_path import CLEARANCE_M, target_path
from pftrack_sim.simulation.world import World

AUTO = {"target.path": "auto", "target.path_length_m": 11.0, "target.path_turns": 3}


@pytest.mark.parametrize("name", ["plaza-walk", "corridor", "warehouse", "street-night", "hall", "park"])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_path_of_this_length_and_turns_keeps_clear_of_everything(name: str, seed: int):
    settings = scenario.load(name, AUTO).resolve(seed)
    path = target_path(settings, seed)
    points = path.points_m.tolist()
    assert sum(dist(one, other) for one, other in pairwise(points)) == pytest.approx(11.0, abs=0.01)
    headings = [np.arctan2(*np.subtract(other, one)[::-1]) for one, other in pairwise(points)]
    turns = np.abs((np.diff(headings) + np.pi) % (2 * np.pi) - np.pi)
    assert len(turns) == 3
    assert np.degrees(turns).min() > 24.9
    assert np.degrees(turns).max() < 100.1
    walked = np.stack(path.at(np.arange(0.0, path.length_m, 0.05))[:2], axis=1)
    assert ObstacleMap(walkable_area(settings, seed)).clearance_m(walked).min() > CLEARANCE_M - 0.01


def test_the_seed_decides_and_the_scenario_keeps_its_own_path():
    auto, own = scenario.load("corridor", AUTO), scenario.load("corridor")
    first, again, other = (target_path(auto.resolve(seed), seed) for seed in (4, 4, 5))
    assert first == again != other
    assert target_path(own.resolve(4), 4) == Path(own.resolve(4).target.path_m)
    world = World(auto.resolve(4), 4, draws=False)
    assert world.path == first
    assert np.allclose(world.traffic.crowd.positions_m[0], first.points_m[0], atol=1e-6)


def test_where_there_is_no_room_the_longest_way_is_told_with_its_ends():
    settings = scenario.load("corridor", AUTO | {"target.path_length_m": 60.0, "target.path_turns": 0}).resolve(0)
    with pytest.raises(ScenarioError, match=r"target\.path: no path of 6.* 0 turns .* from -?\d+\.\d, -?\d+\.\d to"):
        World(settings, 0)


def test_a_path_of_points_needs_two():
    with pytest.raises(ScenarioError, match=r"at least 2 different points, got 1; or set path = 'auto'"):
        scenario.load("corridor", {"target.path_m": [[0, 0]]})
