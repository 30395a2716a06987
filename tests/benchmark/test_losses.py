"""Losses begin where the target was tracked last, and carry what the truth says of that moment."""

import math
from pathlib import Path
from typing import Any

import duckdb
import numpy as np
import pytest

from pftrack_sim.benchmark import make_plan, run
from pftrack_sim.benchmark.reading.losses import TAGS, LossShares, create_loss_views, loss_shares, overlaps_by_tag
from pftrack_sim.benchmark.running.sinks import nearest_look_alike
from pftrack_sim.core.errors import RunError


def losses(overlap: list[float], rate_hz: float = 10.0, **truth: Any) -> list[dict[str, Any]]:
    """Losses of an episode with these overlaps; the truth is calm but for what is given."""
    count = len(overlap)
    columns: dict[str, Any] = {
        "frame": np.arange(count),
        "time_s": np.arange(count) / rate_hz,
        "overlap": np.array(overlap),
    }
    calm = {
        "visible_fraction": 1.0,
        "truncation": 0.0,
        "image_motion_px": 1.0,
        "nearest_look_alike": np.inf,
        "luminance": 0.4,
    }
    columns |= {name: np.asarray(truth.get(name, [value] * count), dtype=float) for name, value in calm.items()}
    columns["scored"] = columns["visible_fraction"] > 0.0
    columns["status"] = np.array(truth.get("status", ["init"] + ["ok"] * (count - 1)), dtype=object)
    columns["height"] = np.asarray(truth.get("height", [100.0] * count), dtype=float)
    with duckdb.connect() as database:
        database.register("given", columns)
        database.execute(
            "CREATE VIEW frames AS SELECT 'open' AS kind, 's' AS scenario, 'base' AS condition, 0 AS seed, "
            "'t' AS label, * EXCLUDE height, [0.0, 0.0, height / 4, height] AS amodal_box FROM given"
        )
        create_loss_views(database)
        table = database.execute("FROM losses")
        names = [one[0] for one in table.description or ()]
        return [dict(zip(names, row, strict=True)) for row in table.fetchall()]


def during(loss: dict[str, Any]) -> set[str]:
    return {tag for tag in TAGS if loss[tag]}


def test_a_loss_begins_with_the_last_tracked_frame_and_ends_with_the_next():
    (loss,) = losses([1.0] * 10 + [0.2, 0.09, 0.0, 0.0, 0.09, 0.0] + [0.5] * 4)
    assert (loss["frame"], loss["time_s"], loss["lost_s"], loss["found_s"]) == (9, 0.9, 1.1, 1.6)
    assert during(loss) == set()


def test_half_a_second_below_a_tenth_is_a_loss_and_counts_once():
    assert losses([1.0] * 5 + [0.05] * 4 + [0.2] + [0.05] * 4 + [0.6] * 5) == []
    assert losses([1.0] * 5 + [0.1] * 20) == []
    found = losses([1.0] * 2 + [0.05] * 5 + [0.4] + [0.0] * 6 + [0.2] + [0.0] * 6)
    assert [(loss["frame"], loss["found_s"]) for loss in found] == [(1, 0.7), (7, None)]


def test_a_target_that_was_never_tracked_after_the_given_box_is_not_lost():
    assert losses([1.0] + [0.0] * 20) == []


def test_frames_after_an_error_are_no_loss():
    overlap = [1.0] * 5 + [0.0] * 12
    assert len(losses(overlap)) == 1
    assert losses(overlap, status=["init"] + ["ok"] * 8 + ["error"] * 8) == []


def test_frames_without_the_target_are_no_loss():
    visible = [1.0] * 5 + [0.0] * 5 + [1.0] * 5
    assert losses([1.0] * 5 + [0.0] * 5 + [0.8] * 5, visible_fraction=visible) == []
    (loss,) = losses([1.0] * 5 + [0.0] * 10, visible_fraction=visible)
    assert (loss["frame"], loss["lost_s"]) == (4, 1.0)
    assert during(loss) == {"occluded"}
    gap = [1.0] * 5 + [0.5] * 3 + [0.0] * 10 + [0.5] * 2
    (loss,) = losses([1.0] * 5 + [0.0] * 15, visible_fraction=gap)
    assert loss["lost_s"] == 0.5, "half a second in which it can be seen, before and after the cover"


@pytest.mark.parametrize(
    ("tag", "name", "before", "at"),
    [
        ("occluded", "visible_fraction", 1.0, 0.4),
        ("look_alike_near", "nearest_look_alike", np.inf, 0.5),
        ("light_change", "luminance", 0.4, 0.2),
        ("fast_motion", "image_motion_px", 1.0, 40.0),
        ("truncated", "truncation", 0.0, 0.3),
        ("scale_change", "height", 100.0, 150.0),
    ],
)
def test_each_tag_is_what_happens_around_the_loss(tag: str, name: str, before: float, at: float):
    for frame, tagged in ((24, True), (16, True), (8, False), (29, False)):
        values = np.full(40, before)
        values[frame] = at
        (loss,) = losses([1.0] * 21 + [0.0] * 19, **{name: values})
        assert (during(loss) == {tag}) is tagged, f"{tag} in frame {frame}, lost in frame 20"


def test_fast_is_meant_per_second():
    """A third of a size from frame to frame, at ten frames a second and at thirty."""
    truth = {"image_motion_px": [50.0 / 3.0] * 40}
    (slow,) = losses([1.0] * 21 + [0.0] * 19, **truth)
    (fast,) = losses([1.0] * 21 + [0.0] * 19, rate_hz=30.0, **truth)
    assert (slow["fast_motion"], fast["fast_motion"]) == (False, True)


def test_unknown_numbers_are_no_tags():
    unknown = np.full(10, np.nan)
    truth = dict.fromkeys(("image_motion_px", "nearest_look_alike", "luminance", "truncation"), unknown)
    (loss,) = losses([1.0] * 5 + [0.0] * 5, **truth)
    assert during(loss) == set()


def test_a_run_answers_for_its_losses(tmp_path):
    small = {"duration_s": 3.0, "camera.width_px": 64, "camera.height_px": 48, "camera.rate_hz": 10.0}
    far, raises = "tests.benchmark.faulty_trackers:far_away", "tests.benchmark.faulty_trackers:raises"
    plan = make_plan(["plaza-walk"], ["oracle", "stay", far, raises], [0], overrides={**small, "lights.shadows": False})
    store = run(plan, tmp_path / "run", videos="none", workers=0, isolation="never")
    shares = loss_shares(store)
    assert list(shares) == ["oracle", "stay", far, raises]
    assert (shares["oracle"].losses, shares["oracle"].lost, shares["oracle"].episodes) == (0, 0, 1)
    assert shares[far].statement.startswith("never tracks the target in 1 of 1 episode")
    assert shares[raises].statement.endswith("ends with an error in 1 of 1 episode")
    counted = store.query("SELECT count(*), avg(occluded::INTEGER) FROM losses WHERE label = 'stay'").rows
    assert counted == [(shares["stay"].losses, shares["stay"].shares["occluded"])]
    assert shares["stay"].losses > 0
    assert shares["stay"].frames == shares["oracle"].frames
    overlaps = overlaps_by_tag(store, "stay")
    sql = "SELECT avg(overlap) FROM moments WHERE label = 'stay' AND frame > 0 AND scored AND look_alike_near"
    assert list(overlaps["look_alike_near"].values()) == [
        value for (value,) in store.query(sql).rows if value is not None
    ]
    nearest = [row[0] for row in store.query("SELECT nearest_look_alike FROM frames WHERE label = 'stay'").rows]
    assert len(nearest) == 30
    assert all(value > 0.0 for value in nearest)
    with pytest.raises(RunError):
        store.query("SELECT nothing FROM losses")


def test_the_given_box_of_a_late_start_has_no_tag(tmp_path: Path):
    small = {"duration_s": 2.0, "camera.width_px": 64, "camera.height_px": 48, "lights.shadows": False}
    plan = make_plan(["plaza-walk"], ["ncc"], [0], axes={"start": [0.5], "jitter": [8.0]}, overrides=small)
    store = run(plan, tmp_path / "run", videos="none")
    sql = (
        "SELECT count(*) FILTER (status = 'init' AND fast_motion), avg(overlap) FILTER (status = 'ok' AND fast_motion) "
    )
    ((given, mean),) = store.query(f"{sql} FROM moments WHERE scored").rows
    assert given == 1, "or else nothing is shown here"
    assert list(overlaps_by_tag(store, "ncc")["fast_motion"].values()) == [mean]


def test_losses_are_stated_with_what_they_begin_with_if_it_is_more_than_usual():
    usual = dict.fromkeys(TAGS, 0.0) | {"fast_motion": 0.5}
    lost = LossShares(4, 5, 3, 0, 0, usual | {"occluded": 0.75}, 300, usual)
    causes = "75% of the losses begin with: occluded (0% of all 300 frames)"
    assert lost.statement == f"loses the target 4 times in 3 of 5 episodes; {causes}"
    assert LossShares(1, 1, 1, 0, 0, usual, 300, usual).statement == "loses the target 1 time in 1 of 1 episode"
    none = dict.fromkeys(TAGS, math.nan)
    assert LossShares(0, 3, 0, 0, 0, none, 300, usual).statement == "never loses the target"
    untracked = "never tracks the target in 2 of 3 episodes"
    assert (
        LossShares(0, 3, 0, 2, 0, none, 300, usual).statement
        == f"{untracked}; never loses the target once it is tracked"
    )
    ended = LossShares(0, 3, 0, 3, 1, none, 300, usual)
    assert ended.statement == "never tracks the target in 3 of 3 episodes; ends with an error in 1 of 3 episodes"


def test_the_nearest_look_alike_is_measured_in_sizes_of_the_target():
    from types import SimpleNamespace

    def person(name: str, box: tuple[float, ...], scored: bool = True) -> Any:
        return SimpleNamespace(name=name, amodal_box=np.array(box), scored=scored)

    target, other = person("target", (100.0, 50.0, 25.0, 100.0)), person("distractor-1", (150.0, 50.0, 25.0, 100.0))
    hidden = person("distractor-2", (100.0, 50.0, 25.0, 100.0), scored=False)
    assert nearest_look_alike(target, (target, other, hidden)) == pytest.approx(1.0)
    far = person("distractor-3", (100.0, 60.0, 12.0, 45.0))
    assert nearest_look_alike(target, (target, hidden, far)) == np.inf
    assert np.isnan(nearest_look_alike(person("target", (np.nan,) * 4), (other,)))
