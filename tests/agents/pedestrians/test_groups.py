"""Laws of people who belong together."""

import math

import numpy as np
import pytest

from pftrack_sim.agents.path import Path
from pftrack_sim.agents.pedestrians.groups import group_members
from pftrack_sim.scenario.people import Companions, Seated, Standing, Walking

PATH = Path([[0.0, 0.0], [6.0, 0.0], [10.0, 4.0]])


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_people_in_a_ring_look_at_its_middle_and_keep_their_distance(count: int):
    states = np.zeros((count, 4))
    members = group_members([Standing(kind="stand", at_m=(3.0, 2.0), count=count, heading_deg=30.0)], PATH)
    for member, state in zip(members, states, strict=True):
        heading = member.reset(state, 0.0, np.zeros(2))
        away = math.atan2(2.0 - state[1], 3.0 - state[0])
        assert abs(math.remainder(heading - away, 2.0 * math.pi)) < 1e-9
    gaps = np.hypot(*(states[:, None, :2] - states[None, :, :2]).transpose(2, 0, 1))
    assert gaps[~np.eye(count, dtype=bool)].min(initial=9.0) > 0.8


def test_a_pair_walks_abreast_at_its_speed_and_stops_at_the_end():
    group = Walking(kind="walk", path_m=((0.0, 0.0), (5.0, 0.0)), speed_m_s=1.25)
    left, right = (member.track(np.linspace(0.0, 8.0, 161)) for member in group_members([group], PATH))
    assert np.hypot(*(left - right).T).min() > 0.6
    steps = np.hypot(*np.diff(left, axis=0).T) / 0.05
    np.testing.assert_allclose(steps[:60], 1.25, atol=1e-6)
    assert (np.diff(steps) < 1e-6).all()
    assert steps[-1] < 1e-6
    assert left[-1, 0] == pytest.approx(5.0)


def test_two_on_a_bench_sit_side_by_side_and_look_the_same_way():
    states = np.zeros((2, 4))
    members = group_members([Seated(kind="sit", at_m=(1.0, 1.0), heading_deg=90.0)], PATH)
    headings = [member.reset(state, 0.0, np.zeros(2)) for member, state in zip(members, states, strict=True)]
    assert headings == pytest.approx([math.pi / 2] * 2)
    assert states[:, 0] == pytest.approx([1.31, 0.69])
    assert all(member.posture.sit == 1.0 for member in members)


def test_a_companion_stays_beside_the_target_and_looks_at_it_when_both_stand():
    (member,) = group_members([Companions(kind="with_target", left_m=0.75)], PATH)
    state = np.zeros(4)
    heading, target_s_m = member.reset(state, 0.0, np.zeros(2)), 0.0
    for tick in range(200):
        target_s_m += 0.05 if tick < 60 else 0.0
        target_m = np.array(PATH.pose(target_s_m)[:2])
        heading = member.update(0.04, 0.04 * tick, target_s_m, target_m, state, heading)
        assert np.hypot(*(state[:2] - target_m)) < 0.9
        if tick == 59:
            assert abs(heading) < 0.05
    assert heading == pytest.approx(math.atan2(target_m[1] - state[1], target_m[0] - state[0]), abs=1e-6)
