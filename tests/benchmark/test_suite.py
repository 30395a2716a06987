"""Suites are validated, and their claims are tested by intervals over seeds."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pftrack_sim import trackers
from pftrack_sim.benchmark import Condition, Result, TrackerSpec
from pftrack_sim.benchmark.asked.from_names import parse_seeds, plan_all
from pftrack_sim.benchmark.asked.suite import is_suite, load_suite, make_suite, suite_names
from pftrack_sim.benchmark.said.claims import compare_with_paper, evaluate_claims
from pftrack_sim.core.errors import ParameterError, ScenarioError, UnknownNameError
from pftrack_sim.simulation.world import World
from pftrack_sim.trackers.registry import told
from tests.benchmark.small import frozen_suite

TABLE = {"title": "T", "columns": ["easy"], "printed": {"good": [1.0]}}
REACHES = {"kind": "reaches", "statement": "x", "tracker": "good", "value": 0.5}
HARD = Condition(levels=(("jitter", 4.0),))


def tree(**more: Any) -> dict[str, Any]:
    return {
        "title": "A test",
        "trackers": ["good", "bad", "same"],
        "run": [{"scenarios": ["easy", "hard"]}],
        "tables": [{"title": "Table 1", "columns": ["easy", "hard"], "printed": {"good": [90.0, 70.0]}}],
        "claims": [
            {"kind": "beats", "statement": "good beats bad", "tracker": "good", "others": ["bad"]},
            {"kind": "beats", "statement": "good beats both", "tracker": "good", "others": ["bad", "same"]},
            {"kind": "beats", "statement": "bad beats good", "tracker": "bad", "others": ["good"]},
            {
                "kind": "harder",
                "statement": "hard is harder",
                "harder": ["hard"],
                "easier": ["easy"],
                "trackers": ["good", "bad"],
            },
            {"kind": "reaches", "statement": "good reaches 0.5", "tracker": "good", "value": 0.5},
            {"kind": "reaches", "statement": "good reaches 0.9 where it is hard", "tracker": "good", "value": 0.9,
             "scenarios": ["hard"]},
        ],
        **more,
    }  # fmt: skip


def results(**identity: Any) -> list[Result]:
    """Ten seeds of three trackers on two scenarios.

    Args:
        identity: Preset, parameters, controller and latency of the trackers.
    """
    draws = np.random.default_rng(0)
    level = {"good": 0.9, "bad": 0.6, "same": 0.9}
    return [
        Result(
            TrackerSpec(name=tracker, **identity),
            name,
            Condition(),
            seed,
            {
                "mean_overlap": level[tracker] - 0.2 * (name == "hard") + 0.02 * draws.normal(),
                "success": math.nan,
                "stay": 0.2,
                "ms_median": 2.0 if tracker == "bad" else 4.0 if name == "hard" else 3.0,
                "fixed_size": 0.8,
                "follow_success": 1.0,
            },
        )
        for seed in range(10)
        for name in ("easy", "hard")
        for tracker in level
    ]


def test_claims_hold_fail_or_stay_undecided():
    found = {one.statement: one for one in evaluate_claims(make_suite("t", tree()), results())}
    assert [one.verdict for one in found.values()] == ["holds", "undecided", "fails", "holds", "holds", "fails"]
    (part,) = found["good beats bad"].comparisons
    assert part.difference.low < part.difference.mean < part.difference.high
    assert abs(part.difference.mean - 0.3) < 0.02
    assert part.difference.seeds == 10


def test_conditions_that_only_one_tracker_has_do_not_count():
    suite = make_suite("t", tree(claims=tree()["claims"][:1]))
    equal = [replace(one, values={**one.values, "mean_overlap": 0.5}) for one in results()]
    more = [replace(one, condition=HARD, values={**one.values, "mean_overlap": 0.1}) for one in equal
            if one.label == "bad"]  # fmt: skip
    (found,) = evaluate_claims(suite, [*equal, *more])
    assert (found.verdict, found.comparisons[0].difference.mean) == ("undecided", 0.0)


def test_conditions_count_by_controller_whatever_trackers_that_are_not_compared_have():
    suite = make_suite("t", tree(claims=tree()["claims"][:1]))
    found = [
        replace(one, tracker=TrackerSpec(name=one.label, controller=controller), condition=condition,
                values={**one.values, "mean_overlap": overlap})
        for one in results()
        for controller in ("servo", "servo-avoid")
        for condition, overlap in ((Condition(), 0.5), (HARD, 0.1))
    ]  # fmt: skip
    part = [one for one in found if (one.tracker.name, one.tracker.controller) != ("good", "servo")
            or one.condition != HARD]  # fmt: skip
    (equal,) = evaluate_claims(suite, part)
    assert (equal.verdict, equal.comparisons[0].difference.mean) == ("undecided", 0.0)
    better = [replace(one, values={**one.values, "mean_overlap": 0.2})
              if one.tracker.name == "good" and one.condition == HARD else one for one in found]  # fmt: skip
    without = [one for one in better if one.tracker.name != "same" or one.condition != HARD]
    assert evaluate_claims(suite, without) == evaluate_claims(suite, better)
    assert evaluate_claims(suite, without)[0].comparisons[0].difference.mean == pytest.approx(0.05)


def test_no_verdict_below_ten_seeds_and_all_parts_of_all_claims_are_corrected_together():
    suite = make_suite("t", tree())
    few = evaluate_claims(suite, [one for one in results() if one.seed < 9])
    assert {one.verdict for one in few} == {"needs 10 seeds"}
    (first, *_), (alone, *_) = (
        evaluate_claims(one, results()) for one in (suite, make_suite("t", tree(claims=tree()["claims"][:1])))
    )
    assert first.comparisons[0].difference.p > alone.comparisons[0].difference.p


@pytest.mark.parametrize("identity", [{"controller": "servo-avoid"}, {"latency_ms": 13.0, "controller": "servo"}])
def test_claims_name_trackers_whatever_their_latency_and_controller(identity: dict[str, Any]):
    suite = make_suite("t", tree())
    assert evaluate_claims(suite, results(**identity)) == evaluate_claims(suite, results())


def test_each_preset_has_its_own_verdicts_and_rows():
    """The preset `paper` has the scores of `bad` in place of those of `good`, and its times."""
    swapped = {"good": "bad", "bad": "good", "same": "same"}
    paper = [
        Result(
            TrackerSpec(name=swapped[one.tracker.name], preset="paper"),
            *(one.scenario, one.condition, one.seed, one.values),
        )
        for one in results()
    ]
    suite = make_suite("t", tree(claims=tree()["claims"][:1]))
    found = {one.preset: one for one in evaluate_claims(suite, [*paper, *results()])}
    assert {preset: one.verdict for preset, one in found.items()} == {"paper": "fails", "default": "holds"}
    first, second, *_ = compare_with_paper(suite.tables[0], [*paper, *results()])
    assert (first.tracker, second.tracker) == ("good[preset=paper]", "good")
    assert first.printed == second.printed
    assert abs(first.ours[-1].mean - 50.0) < 2.0
    assert abs(second.ours[-1].mean - 80.0) < 2.0


def test_columns_may_have_weights():
    table = {**tree()["tables"][0], "weights": [3000, 1000]}
    row, *_ = compare_with_paper(make_suite("t", tree(tables=[table])).tables[0], results())
    assert row.printed == (90.0, 70.0, 85.0)
    assert abs(row.ours[-1].mean - 85.0) < 2.0


def test_times_are_shown_over_those_of_the_first_row_and_one_number_is_the_mean():
    printed = {"bad": [10.0, 8.0], "good": [5.0, 6.0], "same": [3.0]}
    table = {"title": "Times", "columns": ["easy", "hard"], "measure": "frames_per_second", "printed": printed}
    rows = compare_with_paper(make_suite("t", tree(tables=[table])).tables[0], results())
    assert [one.tracker for one in rows] == list(printed)
    assert rows[1].printed == pytest.approx((0.5, 0.75, 11 / 18))
    assert rows[2].printed == pytest.approx((math.nan, math.nan, 1 / 3), nan_ok=True)
    # 2 ms against 3 and 4 ms: 500, 333 and 250 frames per second.
    assert [one.mean for one in rows[1].ours] == pytest.approx([2 / 3, 1 / 2, 7 / 12])


@pytest.mark.parametrize(("share", "verdict"), [(0.58, "holds"), (0.59, "fails")])
def test_a_claim_on_speed_compares_frames_per_second(share: float, verdict: str):
    claim = {"kind": "keeps_pace", "statement": "x", "tracker": "good", "others": ["bad"], "share": share}
    (found,) = evaluate_claims(make_suite("t", tree(claims=[claim])), results())
    assert found.verdict == verdict


def test_other_parameters_are_another_tracker():
    (first, *_) = evaluate_claims(make_suite("t", tree()), results(params={"particle_count": 5}))
    assert first.comparisons[0].difference.seeds == 0


def test_claims_on_following_need_controllers():
    claims = [{**REACHES, "measure": "follow_success"}]
    with pytest.raises(ScenarioError, match="measures of following need"):
        make_suite("t", tree(claims=claims))
    driving = make_suite("t", tree(claims=claims, controllers=["servo"]))
    (claim,) = evaluate_claims(driving, results())
    assert claim.verdict == "holds"


@pytest.mark.slow
def test_variants_distinguish_conditions_of_equal_levels():
    names = {one.condition.name for one in plan_all(["follow"], seeds=[0], closed_loop=True).episodes()}
    assert {"stranger occlusion=1", "lookalike occlusion=1", "latency=55", "jitter=0"} <= names


@pytest.mark.slow
def test_a_closed_loop_suite_can_be_run_in_open_loop():
    (driven,), (scripted,) = (
        plan_all(["kwon2005"], seeds=[0], closed_loop=closed_loop).suites for closed_loop in (True, False)
    )
    assert plan_all(["kwon2005"], seeds=[0], closed_loop=True).kind == "follow"
    assert plan_all(["kwon2005"], seeds=[0]).kind == "open"
    assert plan_all(["kwon2005"], seeds=[0], controllers=["servo"]).kind == "follow"
    assert {one.measure for one in driven.claims} == {"mean_overlap", "follow_tracking_rate"}
    assert {one.measure for one in scripted.claims} == {"mean_overlap"}
    with pytest.raises(ParameterError, match="latency is charged only where the tracker drives"):
        plan_all(["follow"], seeds=[0])


@pytest.mark.slow
@pytest.mark.parametrize("seed", [4, 9])
def test_every_occluding_pedestrian_of_the_follow_suite_has_room(seed: int):
    arranged = 0
    for episode in plan_all(["follow"], seeds=[seed], trackers=["oracle"], closed_loop=True).episodes():
        if "occlusion" in dict(episode.condition.levels):
            settings = episode.scenario.resolve(seed)
            assert len(World(settings, seed).people) == 1 + settings.distractors.count + 2
            arranged += 1
    assert arranged == 4 * 2 * 2


def test_a_claim_without_results_needs_some():
    assert {one.verdict for one in evaluate_claims(make_suite("t", tree()), [])} == {"needs 10 seeds"}


def test_results_are_in_the_unit_of_the_papers_table():
    row, stay, fixed_size = compare_with_paper(make_suite("t", tree()).tables[0], results())
    assert row.printed == (90.0, 70.0, 80.0)
    assert np.abs(np.array([one.mean for one in row.ours]) - row.printed).max() < 2.0
    assert all(one.low < one.mean < one.high for one in row.ours)
    assert [one.mean for one in stay.ours] == pytest.approx([20.0, 20.0, 20.0])
    assert [one.mean for one in fixed_size.ours] == pytest.approx([80.0, 80.0, 80.0])
    assert all(math.isnan(value) for value in (*stay.printed, *fixed_size.printed))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"trakers": []}, "did you mean 'trackers'"),
        ({"run": []}, "run"),
        ({"tables": [{**TABLE, "printed": {"good": [1.0, 2.0]}}]}, "must have 1 numbers, got 2"),
        ({"tables": [{**TABLE, "weights": [1.0, 2.0]}]}, "weights must have 1 numbers, got 2"),
        ({"tables": [{**TABLE, "columns": ["other"]}]}, r"no \[\[run\]\] has: other"),
        ({"tables": [{**TABLE, "printed": {"best": [1.0]}}]}, "`trackers` lacks: best"),
        ({"claims": [{"kind": "beat", "statement": "x"}]}, "did you mean 'beats'"),
        ({"claims": [{**REACHES, "others": ["bad"]}]}, "others"),
    ],
)
def test_mistakes_in_a_suite_are_reported(change: dict[str, Any], words: str):
    with pytest.raises(ScenarioError, match=words):
        make_suite("t", tree(**change))


def test_unreadable_suites_and_names_of_none(tmp_path: Path):
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


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.slow) if name in ("follow", "ladder", "stress") else name
        for name in suite_names()
    ],
)
def test_every_shipped_suite_names_what_exists(name: str):
    suite = load_suite(name)
    assert set(suite.trackers) <= set(trackers.names())
    # A tracker that is told where people are stands beside the others, in no verdict.
    assert not [name for claim in suite.claims for name in claim.compared if told(name)]
    assert parse_seeds(suite.seeds)
    loops = {one.loop == "closed" if one.loop else bool(suite.controllers) for one in suite.run}
    for closed in loops:
        for episode in plan_all([name], seeds=[0], closed_loop=closed).episodes():
            assert episode.scenario.resolve(0).frame_count > 1


def test_a_suite_has_a_part_in_each_loop(tmp_path: Path):
    suite = frozen_suite(tmp_path / "t.toml")
    assert list(plan_all([suite]).scenarios) == ["corridor"]
    driven = plan_all([suite], closed_loop=True)
    assert (list(driven.scenarios), driven.labels) == (["follow/plaza"], ("ncc+servo", "stay+servo"))
    Path(suite).write_text('title = "T"\ntrackers = ["stay"]\n[[run]]\nloop = "open"\nscenarios = ["corridor"]\n')
    with pytest.raises(ParameterError, match="has no part in closed loop"):
        plan_all([suite], closed_loop=True)


def test_a_frozen_suite_runs_with_its_versions_of_scenarios_only(tmp_path: Path):
    with pytest.raises(ScenarioError, match=r"corridor has version \d+ here, and it is frozen with 1"):
        plan_all([frozen_suite(tmp_path / "t.toml", corridor=1)])
    with pytest.raises(ScenarioError, match="`versions` must name every scenario"):
        load_suite(frozen_suite(tmp_path / "t.toml", hall=4))


def test_a_name_without_a_version_means_the_newest():
    newest = load_suite("standard")
    assert newest.name == max((one for one in suite_names() if one.startswith("standard-")), key=len)
    assert newest == load_suite(newest.name)
    assert is_suite("standard")
    with pytest.raises(UnknownNameError, match="unknown suite"):
        load_suite("ko2012-")


def test_the_plan_of_a_suite_contains_it(tmp_path: Path):
    path = tmp_path / "t.toml"
    path.write_text(
        'title = "T"\nseeds = "5:7"\npresets = ["paper", "default"]\ntrackers = ["ko2012", "stay"]\n'
        '[[run]]\nscenarios = ["corridor"]\naxes.jitter = [0.0, 1.0]\n'
        '[[run]]\nscenarios = ["plaza-walk"]\nchanges.duration_s = 2.0\n'
    )
    suite = load_suite(path)
    plan = plan_all([str(path)])
    assert [(one.scenario.name, one.condition.name, one.seed) for one in plan.episodes()] == [
        ("corridor", "jitter=0", 5),
        ("corridor", "jitter=0", 6),
        ("corridor", "jitter=1", 5),
        ("corridor", "jitter=1", 6),
        ("plaza-walk", "base", 5),
        ("plaza-walk", "base", 6),
    ]
    assert plan.labels == ("ko2012[preset=paper]", "ko2012", "stay[preset=paper]", "stay")
    assert plan_all([str(path)], preset="paper").labels == ("ko2012[preset=paper]", "stay[preset=paper]")
    assert plan.suites == (suite,)
    other = plan_all([str(path)], trackers=["stay"], seeds=[1], overrides={"duration_s": 1.0}, preset="default")
    assert (other.labels, other.episode_count) == (("stay",), 3)
    assert all(one.scenario.resolve(1).duration_s == 1.0 for one in other.episodes())
