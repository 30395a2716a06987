"""Levels of an axis are compared on the same frames."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pftrack_sim.benchmark import Condition, Plan, RunStore, make_plan, run
from pftrack_sim.benchmark.asked.from_names import join_plans
from pftrack_sim.benchmark.said.degradation import STAY, degradation, levels_of, table_rows
from pftrack_sim.core.errors import RunError
from pftrack_sim.report.tables import axes
from tests.benchmark import small

OCCLUSION = {"axes.occlusion.severity": 0.0, "axes.occlusion.end_s": 2.8}
SMALL: dict[str, Any] = {**small.SMALL, **OCCLUSION, "duration_s": 4.0}
SHORT: dict[str, Any] = {**SMALL, "duration_s": 0.3, "axes.occlusion.end_s": 6.0}


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> RunStore:
    """Axes that remove frames; only the first sweep has severity 0."""
    plans = [
        make_plan(["easy/corridor"], ["oracle", "ncc"], [3], axes={axis: levels}, overrides=SMALL)
        for axis, levels in {"occlusion": (0, 0.5, 2), "stream": (3,)}.items()
    ]
    return run(join_plans(plans), tmp_path_factory.mktemp("swept") / "run", videos="none", workers=0)


def of(store: RunStore, axis: str, tracker: str) -> list[float]:
    return [one.overlap for one in degradation(store).curves if (one.at.axis, one.tracker) == (axis, tracker)]


def test_the_oracle_and_the_box_that_stays_are_flat_over_occlusion(swept: RunStore):
    assert of(swept, "occlusion", "oracle") == [1.0, 1.0, 1.0]
    stay = of(swept, "occlusion", STAY)
    assert 0.0 < stay[0] < 1.0
    assert stay == [stay[0]] * 3
    by_episode = [one.number("stay") for one in swept.results if one.label == "ncc"][:3]
    assert len(set(by_episode)) == 3, "covered frames are left out of a single episode's score"


def test_the_table_of_an_axis_has_a_row_for_each_tracker_and_a_column_for_each_level(swept: RunStore):
    overlap, stream, recovered = axes(swept)
    assert [one.title.partition(":")[0] for one in (overlap, stream, recovered)] == [
        "occlusion [s]",
        "stream [share of frames]",
        "occlusion [s]",
    ]
    assert overlap.heads == ["tracker", "seeds", "0", "0.65 (level 0.5)", "2.6 (level 2)"]
    assert ["oracle", "1", "1.000", "1.000", "1.000"] in overlap.rows
    assert ["oracle", "1", "1.000", "1.000"] in recovered.rows
    assert STAY not in {row[0] for row in recovered.rows}, "the box that stays tracks nothing"


def test_every_axis_has_the_level_zero_of_the_same_scenario(swept: RunStore):
    levels = [(one.at.axis, one.at.level) for one in degradation(swept).curves if one.tracker == STAY]
    assert levels == [("occlusion", 0), ("occlusion", 0.5), ("occlusion", 2), ("stream", 0), ("stream", 3)]


def test_lost_frames_change_the_box_that_stays_by_no_more_than_their_gaps(swept: RunStore):
    assert np.ptp(of(swept, "stream", STAY)) < 0.05
    assert of(swept, "stream", "oracle") == [1.0, 1.0]


def test_recoveries_stand_beside_the_overlap(swept: RunStore):
    rows = [row for row in table_rows(degradation(swept).curves, "recovered") if row.at.axis == "occlusion"]
    assert [row.at.level for row in rows] == [0.5, 2.0]
    assert [row.means["oracle"].mean for row in rows] == [1.0, 1.0]
    assert {row.means[STAY].seeds for row in rows} == {0}


@pytest.mark.slow
def test_level_zero_is_shared_only_by_equal_scenarios(tmp_path: Path):
    base = make_plan(["easy/corridor"], ["stay"], [0], axes={"jitter": (0,)}, overrides=SHORT)
    narrow = {**SHORT, "camera.fovy_deg": 40.0}
    other = make_plan(["easy/corridor"], ["stay"], [0], axes={"noise": (1,)}, overrides=narrow)
    assert degradation(run(join_plans([base, other]), tmp_path / "run", videos="none", workers=0)).curves == ()


def test_a_folder_holds_one_scene_of_a_scenario(tmp_path: Path):
    def plan(axes: dict[str, list[float]], **more: float) -> Plan:
        return make_plan(["easy/corridor"], ["stay"], [0], axes=axes, overrides={**SHORT, **more})

    run(plan({}), tmp_path / "run", videos="none")
    with pytest.raises(RunError, match=r"axes\.noise\.severity: 0\.0 there, 8\.0 asked for"):
        run(plan({"jitter": [1.0, 2.0]}, **{"axes.noise.severity": 8.0}), tmp_path / "run", videos="none")
    grown = run(plan({"jitter": [1.0, 2.0]}), tmp_path / "run", videos="none")
    assert [one.at.level for one in degradation(grown).curves] == [0.0, 1.0, 2.0]
    noisy = plan({"jitter": [1.0, 2.0]}, **{"axes.noise.severity": 8.0})
    refreshed = run(noisy, tmp_path / "run", videos="none", refresh=True)
    assert [one.at.level for one in degradation(refreshed).curves] == [0.0, 1.0, 2.0]
    assert {one.spec.tree["axes"]["noise"]["severity"] for one in refreshed.plan.episodes()} == {8.0}


@pytest.mark.parametrize(
    ("settings", "base", "variant"), [("noise", {"noise": (0,)}, ""), ("jitter", {}, "variant"), ("jitter", {}, "")]
)
def test_level_zero_is_shared_only_where_the_axes_are_equal(
    tmp_path: Path, settings: str, base: dict[str, tuple[float, ...]], variant: str
):
    """Noise is set in the scenario and off in the base, or jitter is set in both."""
    changes = {**SHORT, f"axes.{settings}.severity": 2.0}
    plans = [
        make_plan(["easy/corridor"], ["stay"], [0], axes=axes, overrides=changes, variant=variant)
        for axes in (base, {"jitter": (1, 4)})
    ]
    found = degradation(run(join_plans(plans), tmp_path / "run", videos="none", workers=0))
    assert [one.at.level for one in found.curves] == [1.0, 4.0]


def test_the_level_zero_of_a_variant_is_the_scenario_without_its_axis(tmp_path: Path):
    base = make_plan(["easy/corridor"], ["stay"], [0], overrides=SHORT)
    changes, axes = {**SHORT, "axes.noise.gain": 10.0}, {"noise": (1, 2)}
    variant = make_plan(["easy/corridor"], ["stay"], [0], axes=axes, overrides=changes, variant="loud")
    found = degradation(run(join_plans([base, variant]), tmp_path / "run", videos="none", workers=0))
    assert [(one.at.axis, one.at.level) for one in found.curves] == [("loud noise", level) for level in (0, 1, 2)]


def test_axes_have_their_own_unit():
    (severe,) = levels_of(Condition(levels=(("blur", 2.0),)))
    assert severe.label == "blur [ms]"
    assert severe.x == 2.0 * levels_of(Condition(levels=(("blur", 1.0),)))[0].x
    (parameter,) = levels_of(Condition(levels=(("jitter.wind_rms_deg", 0.5),)))
    assert (parameter.axis, parameter.x, parameter.label) == ("jitter.wind_rms_deg", 0.5, "jitter.wind_rms_deg")
    assert levels_of(Condition()) == ()
    (named,) = levels_of(Condition(levels=(("occlusion", 9.0),), variant="stranger"))
    assert (named.axis, named.label) == ("stranger occlusion", "occlusion (stranger) [s]")


@pytest.mark.slow
def test_axes_swept_together_give_a_map_and_its_marginal_curves(tmp_path: Path):
    axes = {"noise": (0, 2), "stream": (0, 3)}
    plan = make_plan(["easy/corridor"], ["ncc"], [3], axes=axes, overrides={**SMALL, "duration_s": 1.0})
    found = degradation(run(plan, tmp_path / "run", videos="none", workers=0))
    cells = {(one.first.level, one.second.level): one.overlap for one in found.maps if one.tracker == "ncc"}
    assert list(cells) == [(0, 0), (0, 3), (2, 0), (2, 3)]
    curves = {(one.at.axis, one.at.level): one.overlap for one in found.curves if one.tracker == "ncc"}
    assert set(curves) == {(f"{axis} over {other}", level) for axis, other in (("noise", "stream"), ("stream", "noise"))
                           for level in axes[axis]}  # fmt: skip
    for level in (0, 2):
        assert curves["noise over stream", level] == pytest.approx((cells[level, 0] + cells[level, 3]) / 2, abs=1e-12)


@pytest.mark.slow
def test_an_axis_with_one_level_is_no_part_of_a_map(tmp_path: Path):
    axes = {"noise": (0, 2), "stream": (3,)}
    plan = make_plan(["easy/corridor"], ["stay"], [3], axes=axes, overrides={**SMALL, "duration_s": 0.5})
    found = degradation(run(plan, tmp_path / "run", videos="none", workers=0))
    assert {one.at.axis for one in found.curves} == {"noise"}
    assert found.maps == ()
