"""Every number of a scenario has bounds that make sense in the world, and every file has a size."""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from pftrack_sim import scenario as scenarios
from pftrack_sim.core.errors import ParameterError, PftrackError, ScenarioError
from pftrack_sim.core.inputs import check_tree, parse_toml
from pftrack_sim.scenario.model import ResolvedScenario

BASE = {"title": "x", "place": {"kind": "plaza"}, "robot": {"route": {"kind": "still"}}}


def nested(levels: int) -> Any:
    tree: Any = 1
    for _ in range(levels):
        tree = [tree]
    return tree


def numbers(schema: dict[str, Any], path: str = "") -> Iterator[tuple[str, dict[str, Any]]]:
    """Every number and list in a JSON Schema, with where it stands."""
    if schema.get("type") in ("number", "integer", "array") and "enum" not in schema:
        yield path, schema
    for key, value in schema.items():
        if isinstance(value, dict):
            yield from numbers(value, f"{path}.{key}")
        elif isinstance(value, list):
            for index, item in enumerate(value):
                if isinstance(item, dict):
                    yield from numbers(item, f"{path}.{key}.{index}")


def test_every_number_and_list_is_bounded():
    found = list(numbers(ResolvedScenario.model_json_schema()))
    assert len(found) > 100
    unbounded = [
        path
        for path, schema in found
        if not (
            schema.get("maxItems", 10**9) <= 1000
            if schema["type"] == "array"
            else {"minimum", "exclusiveMinimum"} & set(schema) and schema.get("maximum", 10**9) <= 25_000
        )
    ]
    assert unbounded == []


@pytest.mark.parametrize(
    "values",
    [
        {"target.path_m": [[0, 0], [1e9, 0]]},
        {"target.path_m": [[0, 0], [1e308, 0]]},
        {"target.path_m": [[0, 0], [3e7, 0]]},
        {"target.path_m": [[-400 + 800 * (k % 2), k] for k in range(100)]},
        {"target.path_m": [[k / 10, 0] for k in range(5000)]},
        {"duration_s": 1e9},
        {"duration_s": 1e-300},
        {"axes.occlusion.severity": 1000},
        {"axes.distractors.severity": 1e12},
        {"axes.noise.severity": 1e308},
        {"robot.max_speed_m_s": 1e300},
        {"version": 10**30},
        {"duration_s": {"uniform": [-1e308, 1e308]}},
        {"duration_s": {"uniform": [1, float("inf")]}},
        {"camera.width_px": {"integer": [0, 2**70]}},
        {"camera.width_px": {"integer": [-(10**400), 10**400]}},
        {"camera.width_px": {"choice": [320] * 5000}},
        {"title": "x" * 100_000},
        {"title": "\udcff"},
        {"x" * 5000: 1},
        {"occluders": nested(3000)},
        {".".join("a" * 3000): 1},
        {"x.y": 1, "\x1b[2J": 2},
        {f"key{number}": 1 for number in range(3000)},
        {"place.kind": {"choice": [{"choice": [{"choice": ["plaza"]}]}]}},
    ],
)
def test_values_that_cannot_be_are_one_short_error(values: dict[str, Any]):
    with pytest.raises(ScenarioError) as caught:
        scenarios.load("plaza-walk", values).resolve(0)
    assert len(str(caught.value)) < 20_000
    assert str(caught.value).replace("\n", "").isprintable()


def test_a_dict_that_contains_itself_is_an_error():
    tree: dict[str, Any] = dict(BASE)
    tree["target"] = tree
    with pytest.raises(ScenarioError, match="levels deep"):
        scenarios.load(tree)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("x = " + "[" * 500 + "]" * 500, "levels deep"),
        ("x = " + "{a = " * 500 + "1" + "}" * 500, "levels deep"),
        ("[" + ".".join("a" * 100_000) + "]", "levels deep"),
        ("[" + ".".join(["'a'"] * 30_000) + "]", "levels deep"),
        ("\n".join(f"k{n} = 1" for n in range(3_300_000)), "larger than"),
        ("\n".join(f"k{n}=1" for n in range(25_000)), "more than 20000 values"),
        ("x = 1" + "0" * 100_000, "digits|TOML"),
        ("x = 1e999999", "finite|inf"),
        ('title = "\\u001b[2J"', "control characters"),
        ("\0", "TOML"),
    ],
)
def test_a_file_that_would_take_for_ever_is_one_error(tmp_path: Path, content: str, words: str):
    (tmp_path / "x.toml").write_text(content)
    with pytest.raises(ScenarioError, match=words):
        scenarios.load(tmp_path / "x.toml")


def test_names_that_no_file_can_have_are_unknown(tmp_path: Path):
    for name in ("x" * 5000, "a/" * 3000, "\0", "\udcff", "/dev/zero", str(tmp_path), "x" * 300 + ".toml"):
        with pytest.raises(PftrackError) as caught:
            scenarios.load(name)
        assert len(str(caught.value)) < 3000


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
def test_a_pipe_is_no_scenario(tmp_path: Path):
    os.mkfifo(tmp_path / "x.toml")
    with pytest.raises(ScenarioError, match="regular file"):
        scenarios.load(tmp_path / "x.toml")


def test_the_bounds_of_a_tree():
    check_tree({"a": [1, {"b": "text"}]})
    for tree in ([[]] * 30_000, "x" * 3000, {"\x00": 1}):
        with pytest.raises(ValueError, match=r"more than|cannot be shown"):
            check_tree(tree)
    assert parse_toml("a.b = 1") == {"a": {"b": 1}}


def test_seeds_and_levels_are_bounded():
    from pftrack_sim.benchmark import make_plan, parse_seeds

    for text in ("0:99999999999999", "9" * 5000, "0:1000000,1"):
        with pytest.raises(ParameterError, match=r"at most|given twice: 1"):
            parse_seeds(text)
    levels = [float(level) for level in range(200)]
    with pytest.raises(ParameterError, match="at most"):
        make_plan(["plaza-walk"], ["stay"], [0], axes=dict.fromkeys(("jitter", "noise", "blur", "light"), levels))
