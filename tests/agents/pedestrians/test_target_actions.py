"""The target's schedule: what it does on its path, without rendering."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from pftrack_sim import scenario
from pftrack_sim.agents.path import Path
from pftrack_sim.agents.pedestrians.target import TargetWalk, impossible_actions
from pftrack_sim.core.errors import ScenarioError
from pftrack_sim.scenario.axes import TargetAxis
from pftrack_sim.scenario.people import Target
from pftrack_sim.simulation.world import World

DT = 0.04
LINE = [[0.0, 0.0], [30.0, 0.0]]
FAR = (1e6, 1e6, 0.0, 0.0)


@dataclass
class Record:
    """Arc length, heading and posture of every tick."""

    s_m: np.ndarray
    heading_rad: np.ndarray
    postures: list[Any]

    @property
    def speed_m_s(self) -> np.ndarray:
        return np.gradient(self.s_m, DT)

    def during(self, from_s: float, to_s: float) -> slice:
        return slice(round(from_s / DT), round(to_s / DT))


def target(*actions: dict[str, Any]) -> Target:
    return Target.model_validate({"path_m": LINE, "speed_m_s": 1.2, "actions": actions})


def walked(
    *actions: dict[str, Any],
    seconds: float = 14.0,
    axis: TargetAxis | None = None,
    robot: tuple[float, float, float, float] = FAR,
    camera_m: tuple[float, float] = (-3.0, 0.0),
) -> Record:
    walk, rows = TargetWalk(Path(LINE), target(*actions), axis or TargetAxis()), []
    for _ in range(round(seconds / DT)):
        walk.update(DT, robot, camera_m)
        rows.append((walk.s_m, walk.heading_rad, walk.posture))
    s_m, heading, postures = zip(*rows, strict=True)
    return Record(np.array(s_m), np.array(heading), list(postures))


@pytest.mark.parametrize(
    ("kind", "speed_m_s"), [("run", 2.7), ("pace", 0.6), ("pace", 1.9), ("walk_off", 2.1)], ids=str
)
def test_the_speed_is_reached_and_given_up_again(kind: str, speed_m_s: float):
    record = walked({"kind": kind, "at_s": 3.0, "duration_s": 3.0, "speed_m_s": speed_m_s})
    assert record.speed_m_s[record.during(4.5, 5.8)] == pytest.approx(speed_m_s, abs=0.01)
    assert record.speed_m_s[record.during(1.0, 2.8)] == pytest.approx(1.2, abs=0.01)
    assert record.speed_m_s[record.during(7.5, 13.0)] == pytest.approx(1.2, abs=0.01)
    assert record.postures[130].running is (kind == "run")


@pytest.mark.parametrize("distance_m", [0.8, 2.5])
def test_an_approaching_target_walks_back_as_far_as_asked_facing_that_way(distance_m: float):
    record = walked({"kind": "approach", "at_s": 4.0, "distance_m": distance_m})
    farthest = record.s_m[record.during(4.0, 5.9)].max()
    assert farthest - record.s_m[record.during(6.0, 12.0)].min() == pytest.approx(distance_m, abs=0.1)
    back = record.speed_m_s < -0.05
    assert (np.abs(record.heading_rad[back] - np.pi) < 0.05).all()
    assert record.heading_rad[-1] == 0.0
    assert record.speed_m_s[-1] == pytest.approx(1.2, abs=0.01)


def test_an_approaching_target_stops_before_the_robot():
    def nearest(robot: tuple[float, float, float, float]) -> float:
        walk = TargetWalk(Path(LINE), target({"kind": "approach", "at_s": 5.0, "distance_m": 5.0}), TargetAxis())
        places = []
        for tick in range(300):
            # The robot is in its way from 5 s on.
            walk.update(DT, robot if tick > 125 else FAR, (3.5, 0.0))
            places.append(walk.s_m)
        return min(places[150:])

    assert nearest((3.5, 0.0, 0.0, 0.0)) > 3.5 + 0.6
    assert nearest(FAR) < 3.0, "it would have come nearer"


@pytest.mark.parametrize(("towards", "degrees"), [("camera", 180.0), ("left", 90.0), ("right", -90.0), ("away", 0.0)])
@pytest.mark.parametrize("speed_m_s", [0.0, 0.4])
def test_the_body_faces_the_direction_seen_by_the_camera(towards: str, degrees: float, speed_m_s: float):
    record = walked({"kind": "face", "at_s": 2.0, "duration_s": 5.0, "towards": towards, "speed_m_s": speed_m_s})
    faced = np.degrees(record.heading_rad[record.during(4.2, 5.4)])
    assert np.cos(np.radians(faced - degrees)) == pytest.approx(1.0, abs=1e-6)
    assert record.speed_m_s[record.during(4.2, 5.4)] == pytest.approx(speed_m_s, abs=0.01)
    assert record.heading_rad[-1] == 0.0


def test_facing_is_relative_to_the_camera_wherever_that_is():
    record = walked({"kind": "face", "at_s": 2.0, "towards": "camera"}, camera_m=(2.4, -4.0))
    assert np.degrees(record.heading_rad[round(4.5 / DT)]) == pytest.approx(-90.0, abs=8.0)


@pytest.mark.parametrize("kind", ["crouch", "bend", "wave", "look_around"])
@pytest.mark.parametrize("duration_s", [3.0, 6.0])
def test_postures_are_taken_while_standing_and_last_as_long_as_asked(kind: str, duration_s: float):
    record = walked({"kind": kind, "at_s": 2.0, "duration_s": duration_s})
    amounts = {
        "crouch": [one.crouch for one in record.postures],
        "bend": [one.bend for one in record.postures],
        "wave": [one.arms[1].share if one.arms[1] else 0.0 for one in record.postures],
        "look_around": [abs(one.look_rad) for one in record.postures],
    }
    taken = np.array(amounts.pop(kind))
    assert all(max(others) == 0.0 for others in amounts.values())
    during = record.during(2.0 + 1.7, 2.0 + duration_s - 1.1)
    assert taken[during].max() > 0.9
    assert np.ptp(taken[taken > 0.01].nonzero()[0]) > 0
    assert taken[: round(2.9 / DT)].max() == 0.0
    assert taken[round((2.0 + duration_s) / DT) :].max() == 0.0
    assert np.abs(record.speed_m_s[during]).max() < 1e-9
    # No jumps: half a second from upright to the whole posture at least.
    assert np.abs(np.diff(taken)).max() < 0.15


def test_a_schedule_of_nothing_is_the_plain_walk():
    plain = walked()
    assert (plain.s_m == walked(axis=TargetAxis(severity=0.0, at_s=0.0)).s_m).all()
    late = walked({"kind": "stop", "at_s": 13.0})
    assert late.s_m[: round(12.9 / DT)] == pytest.approx(plain.s_m[: round(12.9 / DT)], abs=1e-12)


def test_manoeuvres_of_the_axis_wait_for_the_scenarios_actions():
    axis = TargetAxis(severity=1.0, per_minute=10.0, manoeuvres=("crouch",), at_s=3.0, faster_m_s=0.0)
    alone, both = walked(axis=axis), walked({"kind": "bend", "at_s": 4.0, "duration_s": 4.0}, axis=axis)
    assert max(one.crouch for one in alone.postures[: round(6.8 / DT)]) == 1.0
    assert max(one.crouch for one in both.postures[: round(8.6 / DT)]) == 0.0
    assert max(one.bend for one in both.postures[: round(8.1 / DT)]) == 1.0
    assert max(one.crouch for one in both.postures) == 1.0


def test_what_the_path_is_too_short_for_is_named():
    found = impossible_actions(
        Path([[0.0, 0.0], [9.0, 0.0]]),
        target(
            {"kind": "approach", "at_s": 1.0, "distance_m": 3.0},
            {"kind": "pace", "at_s": 24.0, "speed_m_s": 0.5},
            {"kind": "stop", "at_s": 40.0},
        ),
        TargetAxis(),
        60.0,
    )
    assert len(found) == 2
    assert "target.actions.0 (approach, 1 to 7.62727 s): walks back 3.0 m, but is only 1.2 m along" in found[0]
    assert "target.actions.1 (pace, 24 to 28 s): only 0.0 m of its path" in found[1]
    settings = scenario.load(
        "easy/plaza-walk", {"target.actions": [{"kind": "approach", "at_s": 0.5, "distance_m": 5.0}]}
    )
    with pytest.raises(ScenarioError, match=r"walks back 5\.0 m"):
        World(settings.resolve(0), 0)


@pytest.mark.parametrize(
    ("actions", "message"),
    [
        (
            [{"kind": "stop", "at_s": 3.0}, {"kind": "bend", "at_s": 4.0}],
            r"must not overlap.*stop, 3 to 5.2 s.*bend, 4",
        ),
        ([{"kind": "bow", "at_s": 3.0}], r"target.actions.0.kind: got 'bow'.*allowed: .*'?bend"),
        ([{"kind": "run", "at_s": 14.0}], "ends after the episode, which lasts 16 s"),
        ([{"kind": "approach", "at_s": 3.0, "duration_s": 2.0}], "duration_s: unknown key"),
        ([{"kind": "run", "at_s": {"uniform": [2.0, 15.0]}}], "run, 15 to 18 s.*ends after the episode"),
    ],
)
def test_schedules_that_cannot_be_are_errors_before_the_first_frame(actions: list[Any], message: str):
    with pytest.raises(ScenarioError, match=message):
        scenario.load("easy/plaza-walk", {"target.actions": actions})


def test_an_override_of_the_duration_cuts_the_schedule():
    late = {"target.actions": [{"kind": "run", "at_s": 4.0}], "duration_s": 2.0}
    assert scenario.load("easy/plaza-walk", late).resolve(0).target.actions


def test_the_stress_axis_makes_nobody_faster_on_crutches_than_crutches_allow():
    axis = TargetAxis.model_validate({"severity": 5.0, "per_minute": 0.0})
    on_foot = Target.model_validate({"path_m": LINE, "speed_m_s": 0.9})
    speeds = []
    for one in (on_foot, on_foot.model_copy(update={"uses": "crutches"})):
        walk = TargetWalk(Path(LINE), one, axis)
        for _ in range(round(5.0 / DT)):
            walk.update(DT, FAR, (-3.0, 0.0))
        speeds.append(np.hypot(*walk.state[2:]))
    assert speeds == pytest.approx([1.4, 1.1])
