"""A scenario to start from, and the lines that problems are about."""

import re
import tomllib

import pytest

from pftrack_sim import scenario
from pftrack_sim.scenario.template import line_of, template


def test_it_is_a_scenario_as_it_stands_and_with_any_of_its_defaults_switched_on():
    tree = tomllib.loads(template())
    plain = scenario.load(tree)
    assert plain.resolve(0).target.path == "auto"
    switched = re.sub(r"^# (?=\w+ = (?!\.\.\.))|^# (?=\[\w+(\.\w+)?\]$)", "", template(), flags=re.MULTILINE)
    with_defaults = tomllib.loads(switched)
    assert len(str(with_defaults)) > 4 * len(str(tree))
    # Tables whose keys have no defaults stay comments.
    del with_defaults["target"]["thing"]
    assert "digest" not in template(), "nobody writes what is read from files"
    assert scenario.load(with_defaults).resolve(0) == plain.resolve(0)


def test_every_key_has_its_meaning_above_it():
    lines = template().splitlines()
    keys = [k for k, line in enumerate(lines) if re.match(r"(# )?\w+ = ", line)]
    assert len(keys) > 90
    assert all(lines[k - 1].startswith("# ") and len(lines[k - 1]) > 8 for k in keys)


TEXT = """\
title = "t"

[place]
kind = "plaza"
[target]
path_m = [
  [0, 0],
]
[[target.actions]]
kind = "stop"
[[target.actions]]
kind = "bend"
at_s = 9.0
[axes]
jitter.severity = 2
"""


@pytest.mark.parametrize(
    ("problem", "line"),
    [
        ("title: required", 1),
        ("place.kind: got 'x'", 4),
        ("target.path_m: the target would walk through 'wall'", 6),
        ("target.path: no path of 12 m", 5),
        ("target.actions.0 (stop, 1 to 2 s): late", 9),
        ("target.actions.1.at_s: got 9", 13),
        ("axes.jitter: has no effect", 15),
        ("robot.route: required key is missing", None),
        ("a bench to sit on has no room", None),
    ],
)
def test_a_problem_is_found_on_its_line(problem: str, line: int | None):
    assert line_of(problem, TEXT) == line
