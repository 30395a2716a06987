"""A scenario that extends others is what they are, but for what it says itself."""

from pathlib import Path
from typing import Any

import jsonschema
import pytest

from pftrack_sim import scenario
from pftrack_sim.core.errors import ScenarioError
from pftrack_sim.scenario import editor_schema


def refused(given: Any) -> str:
    with pytest.raises(ScenarioError) as caught:
        scenario.load(given)
    return str(caught.value)


def test_only_what_differs_changes():
    base = scenario.load("corridor").tree
    own = scenario.load({"extends": "corridor", "camera": {"rate_hz": 10.0}, "target": {"speed_m_s": 1.0}}).tree
    expected = {**base, "camera": {**base["camera"], "rate_hz": 10.0}, "target": {**base["target"], "speed_m_s": 1.0}}
    assert own == expected


def test_lists_ranges_and_tables_of_another_kind_are_replaced():
    changes = {
        "lights": {"schedule": []},
        "place": {"clutter": {"choice": [0.5, 1.0]}},
        "robot": {"route": {"kind": "still"}},
    }
    own = scenario.load({"extends": "corridor", **changes}).tree
    assert own["lights"]["schedule"] == []
    assert own["place"] == {"kind": "corridor", "clutter": {"choice": [0.5, 1.0]}}
    assert own["robot"]["route"] == changes["robot"]["route"]


def test_bases_are_files_beside_and_later_ones_win(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    folder = tmp_path / "robots"
    folder.mkdir()
    (folder / "shaky.toml").write_text(
        "[axes.jitter]\nground_rms_deg = 0.4\n[axes.noise]\ngain = 3.0\n[measured.jitter]\nlevel = 0.4\n"
    )
    (folder / "mine.toml").write_text('extends = ["corridor", "shaky.toml"]\n[axes.noise]\ngain = 5.0\n')
    monkeypatch.chdir(tmp_path)
    resolved = scenario.load("robots/mine.toml").resolve(0)
    assert resolved.axes.jitter.ground_rms_deg == 0.4
    assert resolved.axes.noise.gain == 5.0
    assert resolved.place.kind == "corridor"


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"extends": "coridor"}, "did you mean 'corridor'"),
        ({"extends": "none.toml"}, "no such file"),
        ({"extends": 3}, "extends: takes a scenario's name or path"),
        ({"extend": "corridor"}, "did you mean 'extends'"),
        ({"extends": "corridor", "camera": {"width": 3}}, "camera.width: unknown key"),
        ({"extends": ["corridor"] * 17}, "more than 16 bases"),
    ],
)
def test_a_wrong_base_is_said(given: dict[str, Any], said: str):
    assert said in refused(given)


def test_a_cycle_is_said(tmp_path: Path):
    (tmp_path / "a.toml").write_text('extends = "b.toml"\n')
    (tmp_path / "b.toml").write_text('extends = "a.toml"\n')
    assert "a scenario extends itself: a.toml -> b.toml -> a.toml" in refused(tmp_path / "a.toml")


def test_the_schema_for_editors_knows_it():
    jsonschema.validate({"extends": "corridor"}, editor_schema())
    jsonschema.validate({"extends": ["corridor", "mine.toml"], "duration_s": 3.0}, editor_schema())
    for wrong in ({"duration_s": 3.0}, {"extends": 3}):
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate(wrong, editor_schema())
