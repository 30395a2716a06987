"""Events after the end of an episode are found, and only those."""

from typing import Any

import pytest

from pftrack_sim import scenario

BASE: dict[str, Any] = {
    "duration_s": 4.0,
    "occluders": [{"kind": "pillar", "at_s": 3.0}, {"kind": "walker", "at_s": 5.0}],
    "lights.schedule": [{"kind": "step", "at_s": 9.0, "ev": 1.0}],
    "target.actions": [{"kind": "stop", "at_s": 2.0, "duration_s": 5.0}, {"kind": "wave", "at_s": 8.0}],
}


def settings(**changes: Any) -> scenario.ResolvedScenario:
    return scenario.load("easy/corridor", {**BASE, **changes}).resolve(0)


def test_what_begins_after_the_end_is_named():
    assert scenario.late_events(settings()) == [
        "target.actions.1 (wave) at 8 s",
        "occluders.1 (walker) at 5 s",
        "lights.schedule.0 (step) at 9 s",
    ]
    assert scenario.late_events(settings(duration_s=10.0)) == []
    twice = settings(**{"axes.occlusion": {"severity": 1.0, "count": 2, "end_s": 3.0}, "occluders": []})
    assert "axes.occlusion, event 2 at 7.7 s" in scenario.late_events(twice)


@pytest.mark.parametrize(
    ("axis", "table", "words"),
    [
        ("occlusion", {"severity": 1.0}, "ends at 7 s"),
        ("occlusion", {"severity": 0.0}, None),
        ("occlusion", {"severity": 1.0, "end_s": 3.0}, None),
        ("distractors", {"severity": 1.0, "at_s": 4.0}, "begins at 4 s"),
        ("distractors", {"severity": 1.0}, None),
        ("light", {"severity": 1.0, "parts": ["change"], "at_s": 5.0}, "begins at 5 s"),
        ("light", {"severity": 1.0, "at_s": 5.0}, None),
        ("target", {"severity": 1.0, "per_minute": 0.0, "faster_m_s": 0.0, "range_m": 0.0}, "begins at 9 s"),
        ("target", {"severity": 1.0}, None),
        ("jitter", {"severity": 1.0}, None),
    ],
)
def test_an_axis_has_an_effect_if_something_of_it_is_within_the_episode(
    axis: str, table: dict[str, Any], words: str | None
):
    found = scenario.axis_without_effect(settings(**{f"axes.{axis}": table}), axis)
    assert found is None if words is None else words in (found or "")
