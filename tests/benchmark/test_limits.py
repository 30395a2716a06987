"""Searches for breaking points: levels of axes, criteria of success, and runs that choose their own episodes."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small import SMALL, contents

from pftrack_sim.benchmark import RunStore, make_plan, plan_all
from pftrack_sim.benchmark.asked.from_names import join_plans, late_events
from pftrack_sim.benchmark.limits.found import Limits, read_limits
from pftrack_sim.benchmark.limits.scale import make_scale
from pftrack_sim.benchmark.limits.search import BATCH, Search, Wanted, find_limits, first_plan, make_searches
from pftrack_sim.benchmark.limits.success import Outcomes, parse_success
from pftrack_sim.benchmark.reading.check import check
from pftrack_sim.core.errors import ParameterError, RunError, ScenarioError, UnknownNameError
from pftrack_sim.core.random_streams import stream

TRACKED = parse_success(None, "open")
PLAN = make_plan(["corridor"], ["ncc", "stay"], range(400), overrides={**SMALL, "duration_s": 20})
SPEC = PLAN.scenarios["corridor"]


def falling(stress: float, point: float) -> float:
    return 1.0 / (1.0 + (stress / point) ** 8.0)


def searched(
    breaks_at: dict[str, float], rate: Callable[[float, float], float] = falling, **wanted: Any
) -> tuple[Search, Outcomes]:
    """A search and its outcomes, those of trackers with a known breaking point on the axis jitter [deg]."""
    (search,) = make_searches(PLAN, Wanted({"jitter": None}, TRACKED, **wanted))
    outcomes: dict[tuple[str, str, int, str], bool] = {}
    while batch := search.next_batch(outcomes):
        for level, seed in batch:
            draw = stream(seed, "outcome").random()
            for label, point in breaks_at.items():
                held = bool(draw < rate(float(search.scale.levels[level]), point))
                outcomes["corridor", search.scale.condition(level).name, seed, label] = held
    return search, outcomes


def test_levels_are_physical_and_0_is_the_scenario_itself():
    scale = make_scale(SPEC, "jitter", None, 0)
    assert scale.unit == "deg RMS"
    assert scale.levels[0] == 0.0
    assert scale.condition(0).levels == (("jitter", 0.0),)
    assert abs(scale.levels[-1] - 8.0 * math.hypot(0.5, 1.5)) < 1e-2
    for index in (1, 20, len(scale.levels) - 1):
        assert abs(scale.level(scale.coordinates[index]) - scale.levels[index]) < 1e-9
        (_, severity), *rest = scale.condition(index).levels
        assert not rest
        assert abs(severity * math.hypot(0.5, 1.5) - scale.levels[index]) < 1e-9


def test_levels_end_where_the_scenario_does_not_take_more_and_people_are_whole():
    assert abs(make_scale(SPEC, "occlusion", None, 0).levels[-1] - 7.0) < 0.6
    assert make_scale(SPEC, "distractors", (1.0, 6.0), 0).levels.tolist() == [0, 1, 2, 3, 4, 5, 6]
    lens = make_scale(SPEC, "distortion", None, 0)
    assert 4.0 < lens.settings[-1] < 8.0, "as far as the lens is invertible"
    light = make_scale(SPEC, "light", (0.5, 4.0), 0)
    assert np.ptp(np.diff(light.coordinates[1:])) < 1e-2
    noise = make_scale(SPEC, "box_noise", (0.01, 0.4), 0)
    assert (noise.unit, noise.typical, noise.condition(len(noise.levels) - 1).of_run) == (
        "share",
        None,
        {"box_noise": 0.4},
    )


@pytest.mark.parametrize(
    ("axis", "span", "words"),
    [
        ("start", None, "no breaking point"),
        ("jitter", (5.0, 1.0), "LOW:HIGH"),
        ("jitter", (0.0, 1.0), "LOW:HIGH"),
        ("occlusion", (0.2, 9.0), "at most 6"),
    ],
)
def test_what_is_no_axis_or_range_is_an_error(axis, span, words):
    with pytest.raises((ParameterError, UnknownNameError), match=words):
        make_scale(SPEC, axis, span, 0)


def test_an_axis_without_effect_in_the_scenario_is_an_error():
    short = make_plan(["corridor"], ["stay"], [0], overrides=SMALL).scenarios["corridor"]
    with pytest.raises(ScenarioError, match="has no effect"):
        make_scale(short, "occlusion", None, 0)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("overlapp >= 0.5 for 90 % of the episode", "did you mean 'overlap'"),
        ("overlap <= 0.5 for 90 % of the episode", "good where it is >="),
        ("overlap >= 0 for 90 % of the episode", "0 is always reached"),
        ("overlap >= 0.5 for 101 % of the episode", "at most 100 %"),
        ("followed to the end", "needs --follow"),
    ],
)
def test_what_is_no_criterion_is_an_error(text, words):
    with pytest.raises((ParameterError, UnknownNameError), match=words):
        parse_success(text, "open")


@pytest.mark.parametrize(
    ("wanted", "words"),
    [({"width": 0.0}, "width"), ({"budget": 8}, "24 episodes or more"), ({"at": 1.0}, "success rate")],
)
def test_what_cannot_be_reached_is_an_error(wanted, words):
    with pytest.raises(ParameterError, match=words):
        make_searches(PLAN, Wanted({"jitter": None}, TRACKED, **wanted))[0].next_batch({})


def test_a_search_finds_known_breaking_points_and_stops_when_they_are_known():
    search, outcomes = searched({"ncc": 1.5, "stay": 3.0}, width=0.4)
    one, other = search.limits(outcomes)
    for limit, true in ((one, 1.5), (other, 3.0)):
        assert limit.verdict == "breaks"
        assert limit.low < true < limit.high
        assert limit.high - limit.low <= 0.4 * limit.breaking_point
        assert limit.stopped.startswith("interval of")
        assert limit.held.level <= limit.breaking_point <= limit.failed.level
        assert sum(tried.episodes for tried in limit.tried) == limit.episodes == len(search.trials)
    (difference,) = search.differences(outcomes, [one, other])
    assert difference.low < 1.5 - 3.0 < difference.high < 0.0
    assert len({seed for _, seed in search.trials}) == len(search.trials)


def test_a_search_says_what_lies_outside_its_range_and_does_not_extrapolate():
    search, outcomes = searched({"ncc": 1e4, "stay": 1e-4}, budget=64)
    never, below = search.limits(outcomes)
    assert never.verdict == "never breaks within the range"
    assert below.verdict == "breaks below the lowest level"
    for limit in (never, below):
        assert (limit.breaking_point, limit.low, limit.high, limit.held, limit.failed) == (None,) * 5
        assert limit.stopped == "certain enough"
    assert search.differences(outcomes, [never, below]) == []


def test_two_axes_together_break_a_tracker_on_the_frontier_of_both():
    wanted = Wanted({"jitter": (0.5, 8.0), "noise": (2.0, 40.0)}, TRACKED, budget=40, joint=True)
    searches = make_searches(PLAN, wanted)
    assert [one.scale.axis for one in searches] == [
        "jitter", "noise", "1 jitter + 0.5 noise", "1 jitter + 1 noise", "0.5 jitter + 1 noise",
    ]  # fmt: skip
    typical = {one.scale.axis: one.scale.typical for one in searches[:2]}
    breaks_at = {"jitter": 2.0, "noise": 9.0}

    def stress(levels: dict[str, float]) -> float:
        return math.hypot(*(levels.get(axis, 0.0) * typical[axis] / point for axis, point in breaks_at.items()))

    for search in searches:
        outcomes: dict[tuple[str, str, int, str], bool] = {}
        while batch := search.next_batch(outcomes):
            for level, seed in batch:
                condition = search.scale.condition(level)
                held = bool(stream(seed, "outcome").random() < falling(stress(dict(condition.levels)), 1.0))
                outcomes |= {("corridor", condition.name, seed, label): held for label in ("ncc", "stay")}
        limit = search.limits(outcomes)[0]
        assert limit.verdict == "breaks"
        parts = {one.axis: one.share for one in limit.mix} or {limit.axis: 1.0 / typical[limit.axis]}
        assert stress({axis: share * limit.low for axis, share in parts.items()}) < 1.05
        assert stress({axis: share * limit.high for axis, share in parts.items()}) > 0.95
        assert abs(stress({axis: share * limit.breaking_point for axis, share in parts.items()}) - 1.0) < 0.3


def test_axes_that_cannot_rise_together_are_an_error():
    with pytest.raises(ParameterError, match="levels of any size, and not distractors"):
        make_searches(PLAN, Wanted({"jitter": None, "distractors": None}, TRACKED, joint=True))
    spans = {"jitter": (0.2, 0.4), "noise": (60.0, 120.0)}
    with pytest.raises(ParameterError, match="ranges of jitter and noise have no severities in common"):
        make_searches(PLAN, Wanted(spans, TRACKED, joint=True))


@pytest.mark.slow
def test_a_search_stops_at_its_budget_and_at_its_seeds():
    search, outcomes = searched(
        {"ncc": 1.5, "stay": 1.5}, lambda stress, point: 0.9 * (stress < point) + 0.05, budget=40
    )
    assert {one.stopped for one in search.limits(outcomes)} == {"budget used up"}
    assert len(search.trials) == 40
    search.seeds = search.seeds[:40]
    assert {one.stopped for one in search.limits(outcomes)} == {"seeds used up"}


@pytest.mark.slow
def test_a_success_rate_that_rises_again_has_no_breaking_point():
    search, outcomes = searched(
        {"ncc": 1.0, "stay": 1.5}, lambda stress, point: float(not point < stress < 4.0 * point)
    )
    for limit in search.limits(outcomes):
        assert limit.verdict == "not monotone"
        assert limit.monotone_p < 0.01
        assert (limit.breaking_point, limit.low, limit.high) == (None, None, None)


def test_episodes_in_which_the_target_is_never_seen_do_not_count():
    search, outcomes = searched({"ncc": 1.5, "stay": 3.0}, budget=40)
    seen = {key: held for key, held in outcomes.items() if key[2] % 2}
    assert {sum(tried.episodes for tried in limit.tried) for limit in search.limits(seen)} == {20}


def small_search(path: Path, budget: int = 24, **options: Any) -> Limits:
    plan = plan_all(["corridor"], trackers=["ncc", "stay"], seeds=range(40), overrides=SMALL)
    searches = make_searches(plan, Wanted({"jitter": (0.5, 8.0)}, TRACKED, budget=budget))
    return find_limits(first_plan(plan, searches), searches, path, **options)


@pytest.mark.slow
def test_the_same_search_gives_the_same_bits_and_can_be_resumed(tmp_path):
    whole = small_search(tmp_path / "whole")
    assert read_limits(tmp_path / "whole") == whole
    assert check(tmp_path / "whole").good
    assert [one.episodes for one in whole.limits] == [24, 24]

    class Stopped(Exception):
        pass

    def stop(progress: Any) -> None:
        if progress.done == BATCH + 3:
            raise Stopped

    with pytest.raises(Stopped):
        small_search(tmp_path / "parts", on_progress=stop)
    assert small_search(tmp_path / "parts") == whole
    assert contents(tmp_path / "parts") == contents(tmp_path / "whole")
    assert len(RunStore(tmp_path / "parts").plan.episodes()) == 24


@pytest.mark.slow
def test_the_number_of_workers_changes_nothing(tmp_path):
    assert small_search(tmp_path / "two", workers=2) == small_search(tmp_path / "none")
    assert contents(tmp_path / "two") == contents(tmp_path / "none")


@pytest.mark.slow
def test_what_drives_the_robot_follows_to_the_end(tmp_path):
    plan = plan_all(["follow/plaza"], trackers=["oracle"], seeds=range(40), overrides=SMALL, closed_loop=True)
    searches = make_searches(plan, Wanted({"jitter": (0.5, 2.0)}, parse_success(None, "follow"), budget=24))
    (limit,) = find_limits(first_plan(plan, searches), searches, tmp_path / "run").limits
    assert sum(tried.successes for tried in limit.tried) == limit.episodes == 24
    assert limit.verdict == "never breaks within the range"


def test_a_folder_without_limits_is_an_error(tmp_path):
    with pytest.raises(RunError, match=r"has no limits\.json"):
        read_limits(tmp_path)
    (tmp_path / "limits.json").write_text("{}")
    with pytest.raises(RunError, match="cannot be read"):
        read_limits(tmp_path)


def test_what_is_cut_off_is_said_once_for_all_levels_and_seeds():
    plans = [make_plan(["corridor"], ["ncc"], [k], axes={"jitter": (k,)}, overrides={"duration_s": 3}) for k in (1, 2)]
    (line,) = late_events(join_plans(plans))
    assert line.startswith("corridor lasts 3 s, so that these never happen: ")
