"""Comparison of two trackers, or of two runs: paired, honest about few seeds."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pftrack_sim import score
from pftrack_sim.benchmark import RunStore, make_plan, run
from pftrack_sim.benchmark.reading.summary import paired_by_seed
from pftrack_sim.benchmark.said.comparison import Difference, compare_runs
from pftrack_sim.core.errors import ParameterError, PftrackError, RunError, UnknownNameError
from tests.benchmark.small import SMALL

SCENARIOS = ("plaza-walk", "corridor")


def make_run(
    path: Path, trackers: list[str], seeds: list[int], names: Sequence[str] = SCENARIOS, **overrides: Any
) -> RunStore:
    plan = make_plan(names, trackers=trackers, seeds=seeds, overrides={**SMALL, **overrides})
    return run(plan, path, workers=0, videos="none")


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> RunStore:
    return make_run(tmp_path_factory.mktemp("run") / "one", ["oracle", "stay"], [0, 1])


def test_two_trackers_of_one_run_are_paired_by_episode(stored: RunStore):
    found = compare_runs(stored, stored)
    assert found.names == ("oracle", "stay")
    assert [row.scenario for row in found.rows] == ["plaza-walk", "corridor", "all"]
    assert [row.difference.seeds for row in found.rows] == [2, 2, 2]
    stay = {(one.scenario, one.seed): one.number("mean_overlap") for one in stored.results if one.label == "stay"}
    for row in found.rows[:2]:
        expected = np.mean([stay[row.scenario, seed] for seed in (0, 1)])
        assert row.first == 1.0
        assert row.second == pytest.approx(expected)
        assert row.difference.mean == pytest.approx(expected - 1.0)
        assert math.isnan(row.difference.low), "two seeds have no interval"
    assert found.rows[2].difference.mean == pytest.approx(np.mean([row.difference.mean for row in found.rows[:2]]))
    assert [pair.difference for pair in found.episodes] == sorted(pair.difference for pair in found.episodes)
    assert found.different_frames == found.unpaired == 0
    swapped = compare_runs(stored, stored, ["stay", "oracle"])
    assert [row.difference.mean for row in swapped.rows] == pytest.approx([-row.difference.mean for row in found.rows])


def test_few_seeds_say_so_instead_of_a_verdict(stored: RunStore):
    found = compare_runs(stored, stored)
    assert {row.verdict for row in (*found.rows, *found.tags)} == {"needs 10 seeds"}
    needed = "2 seeds cannot show a difference between stay and oracle, 10 are needed"
    assert found.statement == f"{needed}: {found.rows[2].difference.mean:+.3f}"


@pytest.mark.slow
def test_two_runs_are_compared_where_they_have_the_same_episodes(stored: RunStore, tmp_path: Path):
    darker = make_run(tmp_path / "two", ["stay"], [1, 2], **{"lights.ev": -2.0})
    found = compare_runs(stored, darker)
    assert found.names == ("stay", "stay")
    assert {pair.first.seed for pair in found.episodes} == {1}
    assert found.unpaired == 4
    assert found.different_frames == 2
    assert all(row.difference.mean == 0.0 for row in found.rows)
    assert "nan" not in found.statement


@pytest.mark.parametrize(
    ("trackers", "measure", "error", "words"),
    [
        (["oracle", "sty"], "mean_overlap", UnknownNameError, "did you mean 'stay'"),
        (["stay"], "mean_overlap", ParameterError, "two trackers"),
        (["oracle", "stay", "oracle"], "mean_overlap", ParameterError, "two trackers"),
        ([], "mean_overlp", UnknownNameError, "did you mean 'mean_overlap'"),
    ],
)
def test_wrong_names_are_refused(
    stored: RunStore, trackers: list[str], measure: str, error: type[PftrackError], words: str
):
    with pytest.raises(error, match=words):
        compare_runs(stored, stored, trackers, measure=measure)


@pytest.mark.slow
def test_runs_without_a_common_episode_are_refused(stored: RunStore, tmp_path: Path):
    with pytest.raises(RunError, match="no scenario, condition and seed in common"):
        compare_runs(stored, make_run(tmp_path / "other", ["stay"], [7], SCENARIOS[1:]))


def test_seeds_needed_follow_the_normal_approximation():
    values = np.linspace(-1.0, 1.0, 20)
    row = Difference("all", "", 0.5, 0.5, score.mean_over_seeds(0.1 * values / values.std(ddof=1)))
    # (1.960 + 0.842)^2 = 7.849; times (0.1 / 0.02)^2
    assert row.seeds_for(0.02) == 197
    assert row.seeds_for(10.0) == 10
    assert row.verdict == "undecided"


def test_seeds_that_only_one_side_has_are_not_paired():
    difference = paired_by_seed({0: 0.9, 1: 0.5, 2: 0.6}, {3: 0.1, 2: 0.4, 1: 0.6})
    assert difference.values == pytest.approx((-0.1, 0.2))
