"""What is planned, and what is suspicious, before anything is rendered."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from room_files import scenario_of, write_mjcf

from pftrack_sim import scenario
from pftrack_sim.simulation.overview import overview

STILL: dict[str, Any] = {"robot.route": {"kind": "still", "start_m": [-3.0, 0.0]}, "robot.gaze": "forward"}


def test_a_sound_scenario_has_ways_and_events_and_nothing_suspicious():
    found = overview(scenario.load("plaza-walk").resolve(1), 1)
    assert found.suspicious == ()
    assert [event.title.split()[0] for event in found.events] == ["pedestrian"]
    assert found.run is not None
    assert np.allclose(found.run.target_m[0], found.path_m[0])
    assert len(found.people_m) == 1


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({**STILL, "target.path_m": [[-5, 0], [-30, 0]]}, "target.path_m: the target would leave the walkable area"),
        ({"occluders": [{"kind": "pillar", "at_s": 2.0, "duration_s": 9.0}]}, "occluders.0: "),
        ({"occluders": [{"kind": "walker", "at_s": 400.0}]}, "occluders.0 (walker) at 400 s: after the end"),
        ({"target.path_m": [[2, 0], [4, 0]]}, "target.path_m: the target is at the end of its 2.0 m"),
        ({"robot.max_speed_m_s": 0.5}, "robot.max_speed_m_s: 0.5 is less than target.speed_m_s"),
        (
            {**STILL, "target.path_m": [[-1, 0], [2, 0], [2.0, -1.0], [-3.3, -1.3]]},
            "robot.gaze: the camera looks elsewhere from",
        ),
    ],
)  # fmt: skip
def test_what_is_suspicious_is_said_with_its_key(changes: dict[str, Any], words: str):
    settings = scenario.load("easy/corridor", {"distractors.count": 0, **changes}).resolve(0)
    found = overview(settings, 0).suspicious
    assert any(line.startswith(words) for line in found), found


def test_a_target_behind_the_furniture_is_suspicious_and_its_spans_are_told(tmp_path: Path):
    tree = scenario_of("mjcf", write_mjcf(tmp_path)) | {"duration_s": 5.5}
    (line,) = overview(scenario.load(tree).resolve(0), 0).suspicious
    assert re.fullmatch(r"target\.path: something of the place hides the target from 2\.\d to [45]\.\d s", line)
