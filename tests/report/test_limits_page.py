"""Breaking points as tables, and as a page."""

import math
import re
from pathlib import Path

import pytest

from pftrack_sim.benchmark import RunStore, plan_all
from pftrack_sim.benchmark.limits.found import Difference, Limit, Limits, Tried
from pftrack_sim.benchmark.limits.scale import MIXES, Mixed
from pftrack_sim.benchmark.limits.search import Wanted, examples, find_limits, first_plan, make_searches
from pftrack_sim.benchmark.limits.success import parse_success
from pftrack_sim.benchmark.running.filming import film
from pftrack_sim.measuring.measured import Level
from pftrack_sim.report.limits import (
    breaking_tables,
    interval_text,
    limit_tables,
    margin_text,
    point_text,
    write_limits_page,
)
from tests.benchmark.small import SMALL

FOUND = Limit(
    scenario="corridor",
    axis="jitter",
    unit="deg RMS",
    range=(0.1, 12.0),
    typical=1.58,
    tracker="ncc",
    verdict="breaks",
    breaking_point=1.234,
    low=1.0,
    high=1.5,
    monotone_p=0.8,
    episodes=40,
    stopped="budget used up",
    tried=(Tried(level=1.0, successes=3, episodes=4),),
    curve=((0.0, 1.0), (12.0, 0.0)),
    held=None,
    failed=None,
)


@pytest.mark.parametrize(
    ("changes", "point", "interval"),
    [
        ({}, "1.23", "1 to 1.5"),
        ({"high": None}, "1.23", "above 1"),
        ({"low": None, "breaking_point": None}, "-", "below 1.5"),
        ({"verdict": "broken from the start", "low": None, "high": None}, "broken from the start", "-"),
        ({"verdict": "not monotone", "monotone_p": 0.002, "low": None, "high": None}, "not monotone (p = 0.002)", "-"),
    ],
)
def test_what_is_no_number_is_said_in_words(changes, point, interval):
    one = FOUND.model_copy(update=changes)
    assert (point_text(one), interval_text(one)) == (point, interval)


def test_what_breaks_first_is_the_least_in_typical_levels():
    nowhere, at_once = "never breaks within the range", "broken from the start"
    noise = {"axis": "noise", "unit": "x", "typical": 7.5, "breaking_point": 3.0, "low": 2.0, "high": 4.0}
    others = [
        FOUND.model_copy(update=noise),
        FOUND.model_copy(update={"tracker": "stay", "verdict": nowhere, "breaking_point": None}),
        FOUND.model_copy(update={**noise, "tracker": "stay", "verdict": at_once, "breaking_point": None}),
    ]
    found = Limits(success="overlap >= 0.5 for 90 % of the episode", at=0.5, limits=(FOUND, *others), differences=())
    (table,) = breaking_tables(found)
    assert table.title == "What breaks in corridor"
    assert table.numbers == ["jitter [deg RMS]", "noise [x]", "first"]
    assert table.rows == [
        ["ncc", "1.23 (1 to 1.5)", "3 (2 to 4)", "noise, at 0.4 x typical"],
        ["stay", "not by 12", "broken from the start", "-"],
    ]
    below = {"tracker": "stay", "breaking_point": None, "low": None, "high": 0.79}
    lowest = {**noise, "tracker": "stay", "verdict": "breaks below the lowest level", "breaking_point": None}
    for others, first in (
        ([FOUND.model_copy(update=below)], "jitter, below 0.5 x typical"),
        ([FOUND.model_copy(update=below), FOUND.model_copy(update=lowest)], "noise, below 0.013 x typical"),
    ):
        (table,) = breaking_tables(found.model_copy(update={"limits": tuple(others)}))
        assert table.rows[0][-1] == first


def test_differences_have_a_table_of_their_own():
    place = {"scenario": "corridor", "axis": "jitter", "unit": "deg RMS"}
    pair = Difference(**place, first="ncc", second="stay", difference=0.5, low=0.1, high=0.9, correlation=0.3)
    found = Limits(success="overlap >= 0.5 for 90 % of the episode", at=0.5, limits=(FOUND,), differences=(pair,))
    first, second = limit_tables(found)
    assert first.rows == [["corridor, jitter [deg RMS]", "ncc", "1.23", "1 to 1.5", "40", "budget used up"]]
    assert second.rows == [["corridor, jitter [deg RMS]", "ncc - stay", "+0.5", "+0.1 to +0.9"]]


LEVEL = Level(level=0.617, low=0.5, high=0.7, unit="deg RMS", source="look.mp4")


@pytest.mark.parametrize(
    ("changes", "margin"),
    [
        ({}, "2 (1.6 to 2.7)"),
        ({"high": None}, "2 (1.6 to any)"),
        ({"verdict": "never breaks within the range", "breaking_point": None}, "above 17"),
        ({"verdict": "breaks below the lowest level", "breaking_point": None, "high": 0.1}, "below 0.2"),
        ({"verdict": "not monotone", "breaking_point": None}, "-"),
    ],
)
def test_a_margin_is_the_breaking_point_over_what_was_measured(changes, margin):
    assert margin_text(FOUND.model_copy(update=changes), LEVEL) == margin


def test_an_exactly_known_level_leaves_the_interval_of_the_breaking_point():
    exact = LEVEL.model_copy(update={"level": 0.617, "low": 0.617, "high": 0.617})
    assert margin_text(FOUND, exact) == f"2 ({1.0 / 0.617:.2g} to {1.5 / 0.617:.2g})"
    assert margin_text(FOUND, LEVEL.model_copy(update={"level": 0.0, "low": 0.0})) == "nothing was measured"


def test_margins_have_a_table_where_the_axis_was_measured():
    found = Limits(success="overlap >= 0.5 for 90 % of the episode", at=0.5, limits=(FOUND,), differences=())
    table = limit_tables(found, {"jitter": LEVEL, "noise": LEVEL})[-1]
    cells = ["0.617 (0.5 to 0.7)", "1.23 (1 to 1.5)", "2 (1.6 to 2.7)"]
    assert "look.mp4" in table.title
    assert table.rows == [["corridor, jitter [deg RMS]", "ncc", *cells]]
    assert len(limit_tables(found, {"noise": LEVEL})) == 1


@pytest.mark.slow
def test_the_page_shows_curves_and_the_episodes_next_to_a_limit(tmp_path: Path):
    plan = plan_all(["corridor"], trackers=["ncc", "stay"], seeds=range(40), overrides=SMALL)
    wanted = Wanted(
        {"jitter": (2.0, 10.0), "light": None},
        parse_success("overlap >= 0.4 for 50 % of the episode", "open"),
        budget=24,
    )
    searches = make_searches(plan, wanted)
    found = find_limits(first_plan(plan, searches), searches, tmp_path / "run")
    with RunStore.begin(tmp_path / "run", RunStore(tmp_path / "run").plan) as store:
        shown = examples(store, found)
        film(store, shown)
        store.write_summary()
    page = write_limits_page(tmp_path / "run", found, {"jitter": LEVEL})
    text = page.read_text(encoding="utf-8")
    assert "Margins: breaking point over what was measured in look.mp4" in text
    assert text.count('<svg class="limit"') == 2
    before, folded = text.split("<details>")
    assert "What breaks in corridor" in before
    assert before.index("Margins:") > before.index("What breaks in corridor"), "not folded"
    assert "Breaking points: overlap" not in before
    assert "Breaking points: overlap" in folded.split("</details>")[0]
    assert "What breaks first" in text
    links = re.findall(r'<video src="([^"]+)"', text)
    assert len(links) == len(shown)
    assert all(link.endswith("#t=0.01") and (page.parent / link[:-7]).is_file() for link in links), "with a poster"
    assert not re.search(r"(?:src|href)=\"(?:https?:)?//", text)
    for limit in found.limits:
        assert f"<strong>{point_text(limit)}</strong><span>{limit.unit}, {limit.axis} in corridor" in text
    curves = text.split('<svg class="limit"')[1:]
    for curve in curves:
        names = dict(re.findall(r'<text x="602.0" y="([\d.]+)">(ncc|stay)</text>', curve))
        assert sorted(names.values()) == ["ncc", "stay"]
        one, other = map(float, names)
        assert abs(one - other) >= 14.0, "no name covers another"
    assert "Where one costs the other" not in text
    mixes = [
        tuple(
            Mixed(axis=axis, unit="", share=share, typical=1.0)
            for axis, share in zip(("jitter", "noise"), pair, strict=True)
        )
        for pair in MIXES
    ]
    alone = [FOUND, FOUND.model_copy(update={"axis": "noise", "breaking_point": 8.0, "low": 6.0, "high": None})]
    both = [FOUND.model_copy(update={"axis": f"mix {index}", "mix": mix}) for index, mix in enumerate(mixes)]
    text = write_limits_page(tmp_path / "run", found.model_copy(update={"limits": (*alone, *both)})).read_text()
    (plot,) = text.split("Where one costs the other")[1].split("Success over the level")[0].split("<svg")[1:]
    ((line,), bars) = re.findall(r'<polyline points="([^"]+)"', plot), re.findall(r'<line class="ends"', plot)
    points = [tuple(map(float, pair.split(","))) for pair in line.split()]
    assert len(points) == len(bars) == 5
    assert points[0][1] == 220.0, "the first axis alone"
    assert points[-1][0] == 0.0, "the second alone"
    angles = [math.atan2(220.0 - y, x) for x, y in points]
    assert angles == sorted(angles)
    open_ = [one.model_copy(update={"breaking_point": None, "low": None, "high": None}) for one in both]
    text = write_limits_page(tmp_path / "run", found.model_copy(update={"limits": (FOUND, *open_)})).read_text()
    assert "Where one costs the other" in text, "one axis alone has a place in it, too"
