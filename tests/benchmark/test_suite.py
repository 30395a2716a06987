"""A suite is checked whole, and its claims are judged by their intervals over seeds."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pftrack_sim import trackers
from pftrack_sim.benchmark.claims import beside_the_paper, judge
from pftrack_sim.benchmark.planning import parse_seeds, plan_all, plan_suite
from pftrack_sim.benchmark.suite import checked_suite, is_suite, load_suite, suite_names
from pftrack_sim.core.errors import ParameterError, ScenarioError, UnknownNameError
from pftrack_sim.simulation.world import World


def tree(**more: Any) -> dict[str, Any]:
    return {
        "title": "A test",
        "trackers": ["good", "bad", "same"],
        "run": [{"scenarios": ["easy", "hard"]}],
        "table": {"title": "Table 1", "columns": ["easy", "hard"], "printed": {"good": [90.0, 70.0]}},
        "claims": [
            {"kind": "beats", "says": "good beats bad", "tracker": "good", "others": ["bad"]},
            {"kind": "beats", "says": "good beats both", "tracker": "good", "others": ["bad", "same"]},
            {"kind": "beats", "says": "bad beats good", "tracker": "bad", "others": ["good"]},
            {
                "kind": "harder",
                "says": "hard is harder",
                "harder": ["hard"],
                "easier": ["easy"],
                "trackers": ["good", "bad"],
            },
            {"kind": "reaches", "says": "good reaches 0.5", "tracker": "good", "value": 0.5},
            {"kind": "reaches", "says": "good reaches 0.9 where it is hard", "tracker": "good", "value": 0.9,
             "scenarios": ["hard"]},
        ],
        **more,
    }  # fmt: skip


def rows() -> list[dict[str, Any]]:
    draws = np.random.default_rng(0)
    level = {"good": 0.9, "bad": 0.6, "same": 0.9}
    return [
        {
            "tracker": tracker,
            "scenario": name,
            "seed": seed,
            "mean_overlap": level[tracker] - 0.2 * (name == "hard") + 0.02 * draws.normal(),
            "success": math.nan,
        }
        for seed in range(8)
        for name in ("easy", "hard")
        for tracker in level
    ]


def test_claims_hold_fail_or_stay_undecided():
    found = {one.says: one for one in judge(checked_suite("t", tree()), rows())}
    assert [one.verdict for one in found.values()] == ["holds", "undecided", "fails", "holds", "holds", "fails"]
    (part,) = found["good beats bad"].parts
    assert part.low < part.difference < part.high
    assert abs(part.difference - 0.3) < 0.02
    assert part.seeds == 8


def test_the_preset_of_a_suite_is_no_other_tracker():
    named = [{**row, "tracker": f"{row['tracker']}[preset=paper]"} for row in rows()]
    assert judge(checked_suite("t", tree()), named) == judge(checked_suite("t", tree()), rows())


@pytest.mark.parametrize("more", ["+servo-avoid", "@13ms+servo", "[preset=paper]@7.5ms+my_robot:make"])
def test_what_drives_and_how_late_makes_no_other_tracker(more: str):
    named = [{**row, "tracker": row["tracker"] + more} for row in rows()]
    assert judge(checked_suite("t", tree()), named) == judge(checked_suite("t", tree()), rows())


def test_following_is_claimed_only_where_something_follows():
    claims = [{"kind": "reaches", "says": "x", "tracker": "good", "value": 0.5, "measure": "follow_success"}]
    with pytest.raises(ScenarioError, match="only where `controllers` drive it"):
        checked_suite("t", tree(claims=claims))
    driving = checked_suite("t", tree(claims=claims, controllers=["servo"]))
    (finding,) = judge(driving, [{**row, "follow_success": 1.0} for row in rows()])
    assert finding.verdict == "holds"


def test_a_word_tells_conditions_of_equal_levels_apart():
    names = {one.condition.name for one in plan_suite(load_suite("follow"), seeds=[0]).episodes()}
    assert {"stranger occlusion=1", "lookalike occlusion=1", "latency=55", "jitter=0"} <= names


def test_a_suite_that_is_driven_can_be_run_on_the_script_too():
    (driven,), (scripted,) = (plan_all(["kwon2005"], seeds=[0], drive=drive).suites for drive in (True, False))
    assert plan_all(["kwon2005"], seeds=[0], drive=True).kind == "follow"
    assert plan_all(["kwon2005"], seeds=[0]).kind == "open"
    assert plan_all(["kwon2005"], seeds=[0], controllers=["servo"]).kind == "follow"
    assert {one.measure for one in driven.claims} == {"mean_overlap", "follow_success"}
    assert {one.measure for one in scripted.claims} == {"mean_overlap"}
    with pytest.raises(ParameterError, match="latency is charged only where the tracker drives"):
        plan_all(["follow"], seeds=[0])


@pytest.mark.slow
@pytest.mark.parametrize("seed", [4, 9])
def test_everybody_who_comes_between_in_the_follow_suite_has_room(seed: int):
    arranged = 0
    for episode in plan_suite(load_suite("follow"), seeds=[seed], trackers=["oracle"]).episodes():
        if "occlusion" in dict(episode.condition.levels):
            settings = episode.scenario.resolve(seed)
            assert len(World(settings, seed).people) == 1 + settings.distractors.count + 2
            arranged += 1
    assert arranged == 4 * 2 * 2


def test_a_claim_without_results_is_undecided():
    assert {one.verdict for one in judge(checked_suite("t", tree()), [])} == {"undecided"}


def test_the_papers_table_and_ours_are_in_one_unit():
    (row,) = beside_the_paper(checked_suite("t", tree()), rows())
    assert row.printed == (90.0, 70.0)
    assert np.abs(np.array(row.ours) - row.printed).max() < 2.0
    assert all(low < ours < high for low, ours, high in zip(row.low, row.ours, row.high, strict=True))
    assert abs(row.ours_mean[0] - 80.0) < 2.0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"trakers": []}, "did you mean 'trackers'"),
        ({"run": []}, "run"),
        ({"table": {"title": "T", "columns": ["easy"], "printed": {"good": [1.0, 2.0]}}}, "must have 1 numbers, got 2"),
        ({"table": {"title": "T", "columns": ["other"], "printed": {}}}, r"no \[\[run\]\] has: other"),
        ({"table": {"title": "T", "columns": ["easy"], "printed": {"best": [1.0]}}}, "`trackers` lacks: best"),
        ({"claims": [{"kind": "beat", "says": "x"}]}, "did you mean 'beats'"),
    ],
)
def test_a_wrong_suite_is_told(change: dict[str, Any], words: str):
    with pytest.raises(ScenarioError, match=words):
        checked_suite("t", tree(**change))


def test_unknown_and_unreadable_suites(tmp_path: Path):
    with pytest.raises(UnknownNameError, match="unknown suite"):
        load_suite("quik")
    broken = tmp_path / "broken.toml"
    broken.write_text("title = ")
    with pytest.raises(ScenarioError, match="not valid TOML"):
        load_suite(broken)
    assert not is_suite(str(broken))
    assert not is_suite("plaza-walk")
    good = tmp_path / "good.toml"
    good.write_text('title = "T"\ntrackers = ["stay"]\n[[run]]\nscenarios = ["corridor"]\n')
    assert is_suite(str(good))
    assert load_suite(good).scenarios == ("corridor",)


@pytest.mark.parametrize("name", suite_names())
def test_every_shipped_suite_names_what_exists(name: str):
    suite = load_suite(name)
    assert set(suite.trackers) <= set(trackers.names())
    assert parse_seeds(suite.seeds)
    for episode in plan_suite(suite, seeds=[0]).episodes():
        assert episode.scenario.resolve(0).frame_count > 1


def test_a_suite_becomes_a_plan_that_carries_it():
    suite = checked_suite(
        "t",
        {
            "title": "T",
            "seeds": "5:7",
            "preset": "paper",
            "trackers": ["ko2012", "stay"],
            "run": [
                {"scenarios": ["corridor"], "axes": {"jitter": [0.0, 1.0]}},
                {"scenarios": ["plaza-walk"], "changes": {"duration_s": 2.0}},
            ],
        },
    )
    plan = plan_suite(suite)
    assert [(one.scenario.name, one.condition.name, one.seed) for one in plan.episodes()] == [
        ("corridor", "jitter=0", 5),
        ("corridor", "jitter=0", 6),
        ("corridor", "jitter=1", 5),
        ("corridor", "jitter=1", 6),
        ("plaza-walk", "base", 5),
        ("plaza-walk", "base", 6),
    ]
    assert plan.labels == ("ko2012[preset=paper]", "stay[preset=paper]")
    assert plan.suites == (suite,)
    other = plan_suite(suite, trackers=["stay"], seeds=[1], overrides={"duration_s": 1.0}, preset="default")
    assert (other.labels, other.episode_count) == (("stay",), 3)
    assert all(one.scenario.resolve(1).duration_s == 1.0 for one in other.episodes())
