"""Laws of people who belong together."""

import math

import numpy as np
import pytest

from pftrack_sim.agents.path import Path
from pftrack_sim.agents.pedestrians.groups import GroupMember, group_places
from pftrack_sim.agents.pedestrians.target import TargetWalk
from pftrack_sim.scenario.axes import TargetAxis
from pftrack_sim.scenario.people import Companions, Group, Seated, Standing, Target, Walking

PATH = Path([[0.0, 0.0], [6.0, 0.0], [10.0, 4.0]])


def members_of(group: Group) -> tuple[TargetWalk, list[GroupMember]]:
    """The target, and the members of a group."""
    target = TargetWalk(PATH, Target(path_m=tuple(map(tuple, PATH.points_m.tolist()))), TargetAxis())
    return target, [GroupMember(place, target) for place in group_places([group], PATH)]


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_people_in_a_ring_look_at_its_middle_and_keep_their_distance(count: int):
    _, members = members_of(Standing(kind="stand", at_m=(3.0, 2.0), count=count, heading_deg=30.0))
    for member in members:
        away = math.atan2(2.0 - member.state[1], 3.0 - member.state[0])
        assert abs(math.remainder(member.heading_rad - away, 2.0 * math.pi)) < 1e-9
    places = np.array([member.state[:2] for member in members])
    gaps = np.hypot(*(places[:, None] - places).transpose(2, 0, 1))
    assert gaps[~np.eye(count, dtype=bool)].min(initial=9.0) > 0.8


def test_a_pair_walks_abreast_at_its_speed_and_stops_at_the_end():
    places = group_places([Walking(kind="walk", path_m=((0.0, 0.0), (5.0, 0.0)), speed_m_s=1.25)], PATH)
    times_s = np.linspace(0.0, 8.0, 161).tolist()
    left, right = (np.array([place(time_s, 0.0)[:2] for time_s in times_s]) for place in places)
    assert np.hypot(*(left - right).T).min() > 0.6
    steps = np.hypot(*np.diff(left, axis=0).T) / 0.05
    np.testing.assert_allclose(steps[:60], 1.25, atol=1e-6)
    assert (np.diff(steps) < 1e-6).all()
    assert steps[-1] < 1e-6
    assert left[-1, 0] == pytest.approx(5.0)


def test_two_on_a_bench_sit_side_by_side_and_look_the_same_way():
    _, members = members_of(Seated(kind="sit", at_m=(1.0, 1.0), heading_deg=90.0))
    assert [member.heading_rad for member in members] == pytest.approx([math.pi / 2] * 2)
    assert [member.state[0] for member in members] == pytest.approx([1.31, 0.69])
    assert all(member.posture.sit == 1.0 for member in members)


def test_a_companion_stays_beside_the_target_and_looks_at_it_when_both_stand():
    target, (member,) = members_of(Companions(kind="with_target", left_m=0.75))
    for tick in range(300):
        target.update(0.04, (1e3, 1e3, 0.0, 0.0), (1e3, 1e3))
        member.update(0.04, 0.04 * (tick + 1))
        assert math.dist(member.state[:2], target.state[:2]) < 0.9
        if tick == 59:
            assert abs(member.heading_rad) < 0.05
    assert target.s_m == pytest.approx(PATH.length_m, abs=0.01)
    (x, y), (target_x, target_y) = member.state[:2], target.state[:2]
    assert member.heading_rad == pytest.approx(math.atan2(target_y - y, target_x - x), abs=1e-6)
