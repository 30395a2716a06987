"""A plan is every combination, once; names in it are safe as files."""

import pytest

from pftrack_sim.bench import make_plan, parse_seeds
from pftrack_sim.bench.plan import slug
from pftrack_sim.errors import ParameterError, ScenarioError, UnknownNameError


def test_every_combination_once():
    plan = make_plan(["plaza-walk", "corridor"], ["stay"], [0, 1], axes={"jitter": [0, 2]})
    assert len(plan.episodes) == 8
    assert len({episode.name for episode in plan.episodes}) == 8
    shaken = plan.episodes[2]
    assert shaken.condition.name == "jitter=2"
    assert shaken.scenario.resolve(0).axes.jitter.severity == 2
    assert plan.frame_count == sum(one.scenario.resolve(one.seed).frame_count for one in plan.episodes)


def test_severity_zero_is_the_base_scenario():
    zero, base = (
        make_plan(["plaza-walk"], ["stay"], [3], axes={"jitter": [0]}),
        make_plan(["plaza-walk"], ["stay"], [3]),
    )
    assert zero.episodes[0].scenario.resolve(3) == base.episodes[0].scenario.resolve(3)


def test_wrong_names_and_levels():
    with pytest.raises(UnknownNameError, match="did you mean 'plaza-walk'"):
        make_plan(["plaza-wlk"], ["stay"], [0])
    with pytest.raises(UnknownNameError, match="unknown axis 'jiter'; did you mean 'jitter'"):
        make_plan(["plaza-walk"], ["stay"], [0], axes={"jiter": [1]})
    with pytest.raises(ScenarioError, match="severity"):
        make_plan(["plaza-walk"], ["stay"], [0], axes={"jitter": [-1]})
    with pytest.raises(ParameterError, match="given twice: stay"):
        make_plan(["plaza-walk"], ["stay", "stay"], [0])
    with pytest.raises(ParameterError, match="at least one seed"):
        make_plan(["plaza-walk"], ["stay"], [])


@pytest.mark.parametrize("text", ["", "a", "3:3", "5:2", "1,,2", "-1", "1:2:3"])
def test_seeds_that_are_none(text: str):
    with pytest.raises(ParameterError, match="seeds are written"):
        parse_seeds(text)


@pytest.mark.parametrize("name", ["../../etc/passwd", "a/b", ".", "..", "", "a\0b", "con<script>", "x" * 10])
def test_no_name_leaves_the_folder(name: str):
    made = slug(name)
    assert made
    assert "/" not in made
    assert "\0" not in made
    assert not made.startswith(".")
