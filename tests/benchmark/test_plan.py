"""A plan has every combination once, and safe file names."""

import math
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from pftrack_sim.benchmark import Plan, TrackerSpec, join_plans, make_plan, parse_seeds
from pftrack_sim.benchmark.asked.from_names import code_of
from pftrack_sim.benchmark.keys import slug
from pftrack_sim.core.errors import ParameterError, PftrackError, ScenarioError, UnknownNameError


def test_every_combination_once():
    plan = make_plan(["plaza-walk", "corridor"], ["stay"], [0, 1], axes={"jitter": [0, 2]})
    episodes = list(plan.episodes())
    assert len(episodes) == plan.episode_count == 8
    assert len({episode.name for episode in episodes}) == len({episode.path for episode in episodes}) == 8
    shaken = episodes[2]
    assert shaken.condition.name == "jitter=2"
    assert shaken.scenario.resolve(0).axes.jitter.severity == 2
    assert plan.frame_count == sum(one.scenario.resolve(one.seed).frame_count for one in episodes)


def test_severity_zero_is_the_base_scenario():
    zero, base = (make_plan(["plaza-walk"], ["stay"], [3], axes=axes) for axes in ({"jitter": [0]}, {}))
    assert zero.episode(0).scenario.resolve(3) == base.episode(0).scenario.resolve(3)


def test_a_parameter_of_an_axis_is_swept_at_severity_1():
    plan = make_plan(["plaza-walk"], ["stay"], [0], axes={"jitter.ground_rms_deg": [0.5, 2]})
    first, second = (one.scenario.resolve(0).axes.jitter for one in plan.episodes())
    assert (first.severity, first.ground_rms_deg) == (1.0, 0.5)
    assert (second.severity, second.ground_rms_deg) == (1.0, 2.0)


def test_a_plan_goes_through_json_unchanged_and_any_change_shows():
    trackers = [TrackerSpec(name="ko2012", preset="paper", params={"particle_count": 20}), "stay"]
    plan = make_plan(["plaza-walk", "corridor"], trackers, [0, 5], axes={"jitter": [0, 1.5]})
    again = Plan.model_validate_json(plan.model_dump_json())
    assert again == plan
    assert again.asked == plan.asked
    assert list(again.episodes())[3].scenario.tree == list(plan.episodes())[3].scenario.tree
    longer = make_plan(
        ["plaza-walk", "corridor"], trackers, [0, 5], axes={"jitter": [0, 1.5]}, overrides={"duration_s": 3}
    )
    assert longer.asked.keys().isdisjoint(plan.asked)
    with pytest.raises(ValidationError, match="format"):
        Plan.model_validate({**plan.model_dump(mode="json"), "format": 7})


def test_plans_are_joined_and_shuffled_without_losing_an_episode():
    parts = [make_plan(["plaza-walk"], ["stay"], [0, 1], axes={"jitter": [level]}) for level in (1, 2)]
    joined = join_plans(parts)
    assert joined.episode_count == 4
    paths = [one.path for one in joined.episodes()]
    mixed = [one.path for one in joined.episodes(shuffle=3)]
    assert mixed != paths
    assert sorted(mixed) == sorted(paths)
    with pytest.raises(ParameterError, match="scenario given twice: plaza-walk"):
        join_plans([parts[0], parts[0]])


def test_each_part_holds_every_tracker_and_scenario_and_together_they_hold_each_episode_once():
    trackers = ["oracle", "stay", "ncc", "ko2012", "lee2012"]
    plan = make_plan(["plaza-walk", "corridor"], trackers, range(20), controllers=["servo"])
    parts = [plan.episodes(part=(k, 10)) for k in range(1, 11)]
    assert sorted(one.number for part in parts for one in part) == list(range(plan.episode_count))
    for part in parts:
        assert [one.number for one in part] == sorted(one.number for one in part)
        assert len({one.trackers[0].name for one in part}) > 1
        assert {one.spec.name for one in part} == {"plaza-walk", "corridor"}
    seen = [tracker for part in parts for tracker in {one.trackers[0].name for one in part}]
    assert len(seen) > 40, "of 10 parts, nearly each holds all five trackers"


def test_the_code_of_controllers_and_the_files_of_models_are_part_of_a_plan(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    module, model = tmp_path / "driver_of_mine.py", tmp_path / "weights.bin"
    module.write_text("from pftrack_sim.controllers import make as builtin\nmake = lambda **_: builtin('still')\n")
    model.write_bytes(b"1")
    monkeypatch.syspath_prepend(tmp_path)
    spec = TrackerSpec(name="stay", params={"weights": str(model)}, controller="driver_of_mine:make")
    before = code_of(spec)
    assert list(before) == ["stay", "driver_of_mine:make", str(model)]
    for file in (module, model):
        file.write_bytes(file.read_bytes() + b"#")
    after = code_of(spec)
    assert [name for name in before if after[name] != before[name]] == ["driver_of_mine:make", str(model)]


@pytest.mark.parametrize(
    ("wrong", "error", "words"),
    [
        ({"trackers": ["stay", "stay"]}, ParameterError, "given twice: stay"),
        ({"seeds": []}, ParameterError, "at least one seed"),
        ({"seeds": [-1]}, ParameterError, r"^plan: .*, got -1$"),
        ({"axes": {"jitter": [-1]}}, ScenarioError, "severity"),
        (
            {"axes": {"occlusion": [0, 1]}, "overrides": {"duration_s": 3.0}},
            ScenarioError,
            r"corridor occlusion=1.*\n.*its first event ends at 7 s",
        ),
        ({"axes": {"box_noise": [0.6]}}, ParameterError, r"a share of the sides in \[0, 0.5\], got 0.6"),
        ({"axes": {"start": [1.0]}}, ParameterError, r"a share of the episode in \[-1, 1\), got 1"),
        ({"axes": {"start": [-1.5]}}, ParameterError, r"a share of the episode in \[-1, 1\), got -1.5"),
        ({"axes": {"start": [0.5]}, "controllers": ["servo"]}, ParameterError, "only in open loop"),
        ({"axes": {"latency": [5.0]}}, ParameterError, "latency is charged only where the tracker drives"),
        ({"latency_ms": {"stay": 7.0}}, ParameterError, "latency is charged only where the tracker drives"),
        ({"latency_ms": {"stay": -1.0}, "controllers": ["servo"]}, ParameterError, "0 to 10000 ms, got -1"),
        ({"axes": {"latency": [math.nan]}, "controllers": ["servo"]}, ParameterError, "0 to 10000 ms, got nan"),
        ({"latency_ms": {"ko2012": 5.0}, "controllers": ["servo"]}, UnknownNameError, "ko2012.*known: stay"),
        ({"controllers": ["still", "still"]}, ParameterError, r"given twice: stay\+still"),
        ({"controllers": ["sevro"]}, UnknownNameError, "did you mean 'servo'"),
    ],
)
def test_impossible_plans_are_refused(wrong: dict[str, Any], error: type[PftrackError], words: str):
    """Other wrong names are tested on the command line."""
    with pytest.raises(error, match=words):
        make_plan(**{"names": ["corridor"], "trackers": ["stay"], "seeds": [0], **wrong})


@pytest.mark.parametrize("text", ["", "a", "1,,2", "-1", "1:2:3", "1,3:3", "1,5:2"])
def test_invalid_seeds(text: str):
    none = f"seeds {text[2:]} are none: the second number is excluded"
    with pytest.raises(ParameterError, match=none if text in ("1,3:3", "1,5:2") else "seeds are written"):
        parse_seeds(text)


@pytest.mark.parametrize("name", ["../../etc/passwd", "a/b", ".", "..", "", "a\0b", "con<script>", "x" * 10])
def test_no_name_leaves_the_folder(name: str):
    made = slug(name)
    assert made
    assert "/" not in made
    assert "\0" not in made
    assert not made.startswith(".")
