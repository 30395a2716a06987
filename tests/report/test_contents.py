"""The data of the page agree with the run folder."""

import base64
import json
import shutil
from pathlib import Path

import duckdb
import numpy as np
import pytest
from small_report import HOSTILE, SMALL

from pftrack_sim import report, score
from pftrack_sim.benchmark import Result, RunStore, make_plan, run
from pftrack_sim.benchmark.asked.plan import Condition, TrackerSpec
from pftrack_sim.benchmark.kept.checksums import Checksums
from pftrack_sim.core.errors import RunError
from pftrack_sim.report.contents import MEASURES, _matrix, contents


def test_rows_and_curves_are_those_of_the_folder(finished: Path):
    told = contents(RunStore(finished))
    assert told["trackers"] == ["oracle", "stay"]
    assert told["scenarios"] == ["corridor", "plaza-walk"]
    assert told["conditions"] == ["jitter=0", "jitter=2"]
    assert len(told["rows"]) == 16
    assert len(told["episodes"]) == 8
    summary = duckdb.sql(f"SELECT tracker, mean_overlap FROM '{finished}/summary.parquet'").fetchall()
    column = 2 + [name for name, *_ in told["measures"]].index("mean_overlap")
    assert [row[column] for row in told["rows"]] == pytest.approx([value for _, value in summary], abs=1e-6)
    for tracker, _, _, frames, success, precision in told["curves"]:
        assert len(success) == score.SUCCESS_THRESHOLDS.size
        assert len(precision) == score.PRECISION_THRESHOLDS_PX.size
        if tracker == 0:
            assert success == [frames] * 20 + [0]
            assert precision == [frames] * 51
    packed = np.frombuffer(base64.b64decode(told["episodes"][0]["overlap"][0]), np.uint8)
    assert (packed[1:] == 250).all()
    json.dumps(told, allow_nan=False)


def test_heads_of_columns_tell_what_their_own_measure_is(finished: Path):
    assert {name: words for name, _, words in contents(RunStore(finished))["measures"]}["stay"] == score.DEFINITIONS[
        "stay"
    ]
    assert "follow_bearing_rms_deg" not in score.MEASURE_DEFINITIONS
    assert set(score.MEASURE_DEFINITIONS) <= set(MEASURES)
    told = [*score.DEFINITIONS.values(), *score.FOLLOWING_DEFINITIONS.values(), *score.PEOPLE_DEFINITIONS.values()]
    # Of a table and no column: skill, and tracked in open loop.
    assert len(set(told) - set(score.MEASURE_DEFINITIONS.values())) == 2


def test_the_slowest_frame_is_said_with_its_place(finished: Path):
    store = RunStore(finished)
    told = contents(store)
    expected = store.query("SELECT label, max(ms) FROM frames WHERE status = 'ok' GROUP BY label ORDER BY label").rows
    assert [(told["trackers"][row[0]], row[1]) for row in told["slowest"]] == expected
    tracker, ms, episode, frame, time_s = told["slowest"][0]
    seed = told["episodes"][episode]["seed"]
    sql = f"SELECT time_s FROM frames WHERE label = '{told['trackers'][tracker]}' AND seed = {seed} AND ms = {ms!r}"
    assert [round(row[0], 3) for row in store.query(f"{sql} AND frame = {frame}").rows] == [time_s]


def test_frames_of_a_lossy_stream_have_their_own_times(tmp_path: Path, finished: Path):
    overrides = {**SMALL, "duration_s": 1.5, "axes.stream.severity": 2.0}
    store = run(make_plan(["corridor"], ["stay"], [1], overrides=overrides), tmp_path / "run", videos="none")
    (episode,) = contents(store)["episodes"]
    assert len(episode["time"]) < 45
    assert episode["time"] == pytest.approx([row[0] for row in store.query("SELECT time_s FROM frames").rows], abs=1e-3)
    assert {episode["time"] for episode in contents(RunStore(finished))["episodes"]} == {None}


def test_the_matrix_is_paired_by_seed(finished: Path):
    matrix = contents(RunStore(finished))["matrix"]
    (pair,) = matrix
    assert (pair["one"], pair["other"], pair["seeds"]) == (0, 1, 2)
    assert pair["difference"] > 0
    assert not any(pair["shown"] for pair in matrix), "two seeds prove nothing"


def test_the_matrix_pairs_episodes_that_both_trackers_have():
    scores = {("easy", 0): 0.8, ("hard", 0): 0.2, ("easy", 1): 0.7, ("hard", 1): 0.3, ("easy", 2): 0.9}
    results = [
        Result(TrackerSpec(name=name), place, Condition(), seed, {"mean_overlap": value})
        for name in ("old", "new")
        for (place, seed), value in scores.items()
        if name == "old" or place == "easy"  # the hard ones of the other have not run yet
    ]
    (pair,) = _matrix(results, ["old", "new"])
    assert (pair["difference"], pair["seeds"]) == (0.0, 3)


def test_no_name_ends_the_script_or_becomes_markup(hostile: Path):
    page = report.write_report(hostile).read_text()
    assert HOSTILE not in page
    data = page.split('id="data">')[1].split("</script>")[0]
    assert json.loads(data)["trackers"] == ["oracle", HOSTILE]


def test_an_unfinished_run_is_reported_as_far_as_it_goes(finished: Path, tmp_path: Path):
    path = tmp_path / "run"
    shutil.copytree(finished, path)
    (path / "summary.parquet").unlink()
    for file in (path / "episodes").rglob("corridor/jitter-0/seed-0001-*.parquet"):
        file.unlink()
    assert len(contents(RunStore(path))["episodes"]) == 7
    report.write_report(path)


def test_a_folder_without_a_run_is_an_error(tmp_path: Path):
    for path in (tmp_path, tmp_path / "nowhere"):
        with pytest.raises(RunError, match="is not a run folder"):
            report.write_report(path)


def test_a_summary_cannot_name_files_elsewhere(finished: Path, tmp_path: Path):
    path = tmp_path / "run"
    shutil.copytree(finished, path)
    duckdb.execute(
        f"COPY (SELECT * REPLACE ('../../etc/passwd' AS file) FROM '{finished}/summary.parquet') "
        f"TO '{path}/summary.parquet' (FORMAT parquet)"
    )
    assert report.write_report(path).is_file()  # made anew from the episodes
    Checksums(path).end()
    with pytest.raises(RunError, match="not in the run folder"):
        report.write_report(path)
