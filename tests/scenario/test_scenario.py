"""A scenario is right, or every mistake in it is named at once."""

import json
import pickle
from typing import Any, get_args

import pytest

from pftrack_sim import scenario
from pftrack_sim.core.errors import ParameterError, ScenarioError, UnknownNameError
from pftrack_sim.scenario import ranges
from pftrack_sim.scenario.axes import Manoeuvre, TargetAxis, axes_by_name


def minimal(**more: Any) -> dict[str, Any]:
    return {
        "title": "A test",
        "place": {"kind": "plaza"},
        "robot": {"route": {"kind": "trail"}},
        "target": {"path_m": [[0, 0], [8, 0]]},
        **more,
    }


def problems_of(tree: dict[str, Any], overrides: dict[str, Any] | None = None) -> str:
    with pytest.raises(ScenarioError) as caught:
        scenario.load(tree, overrides)
    return str(caught.value)


def test_a_minimal_scenario_has_every_default():
    resolved = scenario.load(minimal()).resolve(0)
    assert resolved.camera.width_px == 640
    assert resolved.axes.jitter.severity == 0
    assert resolved.frame_count == 360


def test_parameters_of_an_axis_without_a_severity_mean_what_they_say():
    given = {"axes": {"jitter": {"sources": ["wind"], "wind_rms_deg": 0.5}}}
    assert scenario.load(minimal(**given)).resolve(0).axes.jitter.physical == 0.5
    off = scenario.load(minimal(**given), {"axes.jitter.severity": 0}).resolve(0).axes.jitter
    assert (off.on, off.physical) == (False, 0.0)


@pytest.mark.parametrize("name", list(axes_by_name()))
def test_every_axis_says_what_it_does_and_starts_off(name: str):
    axis = axes_by_name()[name]
    assert axis.headline in {*axis.model_fields, *dir(axis)}
    assert axis().physical == 0.0
    assert axis(severity=2.0).physical == 2.0 * axis(severity=1.0).physical > 0.0
    assert all(words.strip() for words in (axis.__doc__ or "", axis.unit, axis.law, axis.source))


def test_ranges_are_drawn_per_seed_and_stay_inside():
    loaded = scenario.load(
        minimal(
            target={"path_m": [[0, 0], [8, {"uniform": [-1, 1]}]], "speed_m_s": {"uniform": [1.1, 1.3]}},
            distractors={"count": {"integer": [2, 4]}},
            camera={"mount": {"choice": ["left", "right"]}},
        )
    )
    drawn = [loaded.resolve(seed) for seed in range(40)]
    assert all(1.1 <= one.target.speed_m_s <= 1.3 for one in drawn)
    assert {one.distractors.count for one in drawn} == {2, 3, 4}
    assert {one.camera.mount for one in drawn} == {"left", "right"}
    assert loaded.resolve(7) == loaded.resolve(7)
    assert len({one.target.path_m[1][1] for one in drawn}) == 40


def test_another_range_changes_no_other_draw():
    one = minimal(target={"path_m": [[0, 0], [8, 0]], "speed_m_s": {"uniform": [1.1, 1.3]}})
    two = {**one, "camera": {"fovy_deg": {"uniform": [40, 60]}}}
    for seed in range(5):
        assert scenario.load(one).resolve(seed).target == scenario.load(two).resolve(seed).target


def test_every_mistake_is_told_at_once_with_path_value_allowed_and_nearest():
    message = problems_of(
        minimal(
            camera={"fovydeg": 50, "width_px": "wide"},
            place={"kind": "plazza"},
            robot={"route": {"kind": "trail", "distance_mm": 3}},
            lights={"schedule": [{"kind": "ramp", "from_s": 3, "to_s": 1, "ev": -1}, {"kind": "stp"}, {"ev": 1}]},
        )
    )
    assert "7 problems" in message
    assert "camera.fovydeg: unknown key (value 50); did you mean 'fovy_deg'? (allowed: calibrated, " in message
    assert "camera.width_px: got 'wide'" in message
    assert "place.kind: got 'plazza'; did you mean 'plaza'? (allowed: plaza, corridor, warehouse, street" in message
    assert "robot.route.distance_mm: unknown key (value 3); did you mean 'distance_m'?" in message
    assert "lights.schedule.0" in message
    assert "to_s must be later than from_s" in message
    assert "lights.schedule.1.kind: got 'stp'; did you mean 'step'?" in message
    assert "lights.schedule.2.kind: required key is missing" in message


def test_a_missing_table_is_named():
    tree = minimal()
    del tree["robot"]
    assert "robot: required key is missing" in problems_of(tree)


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ({"uniform": [2, 1]}, "low <= high"),
        ({"uniform": [1]}, "two numbers"),
        ({"uniform": 3}, "needs a list"),
        ({"integer": [1.5, 2]}, "two whole numbers"),
        ({"choice": []}, "needs a list"),
        ({"uniform": [1, 9]}, "less than or equal to 2.2"),
        (float("nan"), "finite"),
    ],
)
def test_a_wrong_range_or_value_is_refused_whatever_the_seed(value: object, words: str):
    message = problems_of(minimal(target={"path_m": [[0, 0], [8, 0]], "speed_m_s": value}))
    assert "target.speed_m_s" in message
    assert words in message


def test_another_kind_of_route_drops_what_belonged_to_the_old_one():
    trailing = minimal(robot={"route": {"kind": "trail", "distance_m": 4.0, "offset_m": 0.5}})
    assert scenario.load(trailing, {"robot.route.kind": "still"}).tree["robot"]["route"] == {"kind": "still"}
    beside = scenario.load(trailing, {"robot.route.kind": "beside", "robot.route.side": "left"})
    assert beside.tree["robot"]["route"] == {"kind": "beside", "distance_m": 4.0, "side": "left"}
    assert "points_m" in problems_of(trailing, {"robot.route.kind": "waypoints"})
    assert "did you mean 'still'" in problems_of(trailing, {"robot.route.kind": "stil"})


def test_overrides_reach_every_key_and_leave_the_original_alone():
    tree = minimal(occluders=[{"kind": "pillar", "at_s": 3}])
    before = json.dumps(tree)
    loaded = scenario.load(tree, {"camera.width_px": 320, "axes.jitter.severity": 2.0, "occluders.0.at_s": 5})
    resolved = loaded.resolve(0)
    assert (resolved.camera.width_px, resolved.axes.jitter.severity, resolved.occluders[0].at_s) == (320, 2.0, 5.0)
    assert json.dumps(tree) == before


@pytest.mark.parametrize(
    ("key", "words"),
    [
        ("camera.widthpx", "did you mean 'width_px'?"),
        ("title.x", "title is a value, not a table"),
        ("occluders.4.at_s", "no item '4' in a list of 1"),
        ("axes.jiter.severity", "did you mean 'jitter'?"),
    ],
)
def test_a_wrong_override_is_named(key: str, words: str):
    assert words in problems_of(minimal(occluders=[{"kind": "pillar", "at_s": 3}]), {key: 1})


def test_files_that_cannot_be_read(tmp_path):
    broken = tmp_path / "broken.toml"
    broken.write_text("title = ")
    with pytest.raises(ScenarioError, match="not valid TOML"):
        scenario.load(broken)
    with pytest.raises(ScenarioError, match="no such file"):
        scenario.load(tmp_path / "absent.toml")
    with pytest.raises(ScenarioError, match="folder"):
        scenario.load(tmp_path)
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ScenarioError, match="cannot be read"):
        scenario.load(binary)
    with pytest.raises(UnknownNameError, match="unknown scenario 'plaza-wal'"):
        scenario.load("plaza-wal")


def test_a_scenario_is_frozen_and_a_negative_seed_refused():
    loaded = scenario.load(minimal(target={"path_m": [[0, 0], [8, 0]], "speed_m_s": {"uniform": [1, 2]}}))
    with pytest.raises(ParameterError, match="seed must be >= 0"):
        loaded.resolve(-1)
    with pytest.raises(Exception, match="frozen"):
        loaded.resolve(0).camera.width_px = 3  # pyright: ignore[reportAttributeAccessIssue]


def test_errors_survive_a_process_boundary():
    for error in (ScenarioError("x", ["a", "b"]), UnknownNameError("tracker", "ko", ["ko2012"])):
        again = pickle.loads(pickle.dumps(error))
        assert str(again) == str(error)


def test_editor_schema_offers_every_key_and_ranges():
    schema = scenario.editor_schema()
    assert set(schema["properties"]) >= {"camera", "target", "axes", "occluders"}
    speed = schema["$defs"]["Target"]["properties"]["speed_m_s"]
    assert {"$ref": "#/$defs/Range"} in speed["anyOf"]
    assert "kind" in schema["$defs"]["TrailRoute"]["properties"]


def test_walk_and_replaced_are_inverse():
    tree = {"a": [{"b": {"uniform": [0, 1]}}, 3]}
    found = dict(ranges.walk(tree))
    assert list(found) == [("a", 0, "b")]
    assert ranges.replaced(tree, {("a", 0, "b"): 5}) == {"a": [{"b": 5}, 3]}


def test_a_scenario_that_an_override_shortened_can_be_loaded_again():
    short = scenario.load("plaza-walk", {"duration_s": 1.0})
    assert scenario.load(short, {"camera.width_px": 64}).resolve(0).duration_s == 1.0
    with pytest.raises(ScenarioError, match="ends after the episode, which lasts 1 s; only an override") as raised:
        scenario.load(dict(short.tree))
    assert str(raised.value).count("(face") == 1, "not once for every end of a range"


@pytest.mark.parametrize("kind", get_args(Manoeuvre))
def test_a_manoeuvre_of_the_target_axis_is_the_action_of_its_name(kind: Manoeuvre):
    action = TargetAxis(run_m_s=3.0).action(kind, 2.5)
    assert (action.kind, action.at_s) == (kind, 2.5)
    assert kind != "run" or action.model_dump()["speed_m_s"] == 3.0


def test_keys_that_do_not_go_together_are_one_problem_whatever_the_ranges():
    route = {"kind": "trail", "distance_m": {"uniform": [2.5, 3.0]}}
    found = problems_of(minimal(robot={"route": route, "wheelbase_m": 0.5}))
    assert found.count("wheelbase_m") == 1
    assert "'trail'" not in found, "not the whole table"


def test_a_list_is_asked_for_in_the_words_of_toml():
    assert "target.carries: got '[bag]': input should be a list" in problems_of(minimal(), {"target.carries": "[bag]"})


def test_a_uniform_range_of_a_whole_number_is_refused_on_reading():
    assert "distractors.count: got 4.12132: input should be a valid integer" in problems_of(
        minimal(), {"distractors.count": {"uniform": [2, 5]}}
    )
    whole = scenario.load(minimal(), {"distractors.count": {"integer": [2, 5]}})
    assert {whole.resolve(seed).distractors.count for seed in range(30)} == {2, 3, 4, 5}
