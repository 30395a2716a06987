"""What a run folder says is verified wherever it is read."""

import json
import os
import shutil
import subprocess
from pathlib import Path

import duckdb
import numpy as np
import pytest

from pftrack_sim.benchmark import RunStore, run
from pftrack_sim.benchmark.kept.checksums import SUMS, Checksums
from pftrack_sim.benchmark.kept.files import csv_text
from pftrack_sim.benchmark.reading.check import check
from pftrack_sim.benchmark.reading.merge import merge
from pftrack_sim.core.errors import RunError
from pftrack_sim.simulation.simulation import Simulation
from tests.benchmark.small import small_plan, with_sums

PLAN = small_plan(range(2), ["oracle", "stay"], **{"distractors.count": 1})
FIRST, _, SECOND, _ = (one.table for one in PLAN.asked.values())
FRAMES = PLAN.episode(0).frames_table


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return run(PLAN, tmp_path_factory.mktemp("finished") / "run", videos="first").path


@pytest.fixture
def copied(finished: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(finished, tmp_path / "copied"))


def test_the_checksums_are_those_of_sha256sum(finished: Path):
    if shutil.which("sha256sum") is None:
        pytest.skip("no sha256sum here")
    subprocess.run(["sha256sum", "--check", "--strict", "--quiet", SUMS], cwd=finished, check=True)


def test_files_that_are_none_of_the_runs_are_named(copied: Path):
    own = "videos/" + PLAN.episode(0).path
    foreign = ["alien.txt", "Alien/deep/file", "tables/notes.csv", "episodes/a.parquet", own + ".avi", "logs/link"]
    for name in foreign:
        (copied / name).parent.mkdir(parents=True, exist_ok=True)
        (copied / name).touch()
    (copied / "logs/link").unlink()
    (copied / "logs/link").symlink_to("/")
    (copied / ".DS_Store").touch()
    expected = [f"unknown file: {name}" for name in foreign]
    assert (check(copied).problems, check(copied).beside) == (tuple(sorted(expected[2:])), tuple(sorted(expected[:2])))
    # The next session's checksums do not make them the run's.
    run(PLAN, copied, videos="first")
    assert (check(copied).problems, check(copied).beside) == (tuple(sorted(expected[2:])), tuple(sorted(expected[:2])))
    for name in foreign[2:]:
        (copied / name).unlink()
    (copied / "comparison.html").touch()
    Checksums(copied).end()
    assert check(copied).good


def test_an_edited_summary_is_found_whatever_its_checksum(copied: Path):
    summary, edited = copied / "summary.parquet", copied / "edited.parquet"
    duckdb.execute(f"COPY (SELECT * REPLACE (0.999 AS mean_overlap) FROM '{summary}') TO '{edited}' (FORMAT parquet)")
    edited.replace(summary)
    assert check(copied).problems == ("summary.parquet: changed since it was written",)
    # Readers make it anew of the episodes.
    overlaps = {result.label: result.measures.mean_overlap for result in RunStore(copied).results}
    assert overlaps["oracle"] == 1.0
    Checksums(copied).end()
    assert check(copied).problems == ("summary.parquet: is not what the episodes lead to",)


@pytest.mark.parametrize("name", ["tables/trackers.csv", "tables/trackers.tex", "summary.parquet"])
def test_what_was_derived_is_checked_whatever_its_checksum(copied: Path, name: str):
    content = (copied / name).read_bytes()
    (copied / name).write_bytes(content.replace(b"oracle", b"oracel"))
    with_sums(copied)
    (problem,) = check(copied).problems
    assert problem.startswith(f"{name}: is not what the ")
    (copied / name).unlink()
    assert len(check(copied).problems) == 1
    # The next session makes both anew.
    run(PLAN, copied, videos="none")
    assert check(copied).good


@pytest.mark.parametrize("finished_first", [True, False])
def test_the_file_of_another_episode_is_refused_wherever_it_is_read(copied: Path, tmp_path: Path, finished_first: bool):
    shutil.copy(copied / FIRST, copied / SECOND)
    if not finished_first:
        (copied / "summary.parquet").unlink()
        with_sums(copied, finished=False)
    assert not check(copied).good
    another = r"is of another episode \(corridor base seed 0, oracle\)"
    words = "changed since" if finished_first else another
    for read in (
        lambda: RunStore(copied).results,
        lambda: RunStore(copied).query("FROM summary"),
        lambda: merge(tmp_path / "merged", [copied]),
    ):
        with pytest.raises(RunError, match=words):
            read()
    with pytest.raises(RunError, match=words):
        run(PLAN, copied, videos="none")


@pytest.mark.slow
def test_the_same_episode_of_another_plan_is_refused(copied: Path, tmp_path: Path):
    other = run(small_plan(range(2), ["oracle", "stay"], duration_s=0.5), tmp_path / "other", videos="none")
    others = run(small_plan(range(2), ["ncc"]), tmp_path / "others", videos="none")
    for store in (other, others):
        shutil.copy(store.path / list(store.present.values())[-1].table, copied / SECOND)
        with_sums(copied)
        assert {one.partition(":")[0] for one in check(copied).problems} == {SECOND}
        with pytest.raises(RunError, match="is of another episode"):
            run(PLAN, copied, videos="none")


def test_no_table_is_read_without_its_checksum(copied: Path):
    """DuckDB can end the process with a damaged file."""
    before = {path: path.read_bytes() for path in (copied / "episodes").rglob("*.parquet")}
    (copied / SUMS).unlink()
    (copied / SECOND).write_bytes(bytes(1000))
    assert check(copied).problems == ("SHA256SUMS: missing", "missing: corridor seed 0", "missing: corridor seed 1")
    with pytest.raises(RunError, match="has no SHA256SUMS: a result without its checksum is not read"):
        _ = RunStore(copied).results
    with pytest.raises(RunError, match="has no SHA256SUMS"):
        merge(copied.parent / "merged", [copied])
    run(PLAN, copied, videos="none")
    assert check(copied).good
    assert before.keys() == {*(copied / "episodes").rglob("*.parquet")}


def test_a_damaged_result_is_an_error_before_anything_is_run(copied: Path):
    (copied / FIRST).unlink()
    (copied / SECOND).write_bytes((copied / SECOND).read_bytes()[::-1])
    before = {name: (copied / name).read_bytes() for name in ("run.json", SUMS)}
    with pytest.raises(RunError, match=f"{SECOND}: changed since it was written"):
        run(PLAN, copied, videos="none")
    assert not (copied / FIRST).exists()
    assert all((copied / name).read_bytes() == content for name, content in before.items())


def test_everybody_in_view_is_stored_once_for_all_trackers(finished: Path):
    store = RunStore(finished)
    episode = store.plan.episode(0)
    with Simulation(episode.scenario) as simulation:
        frame = simulation.reset(episode.seed)
    rows = store.query("SELECT person, state, amodal_box, x_m FROM people WHERE seed = 0 AND frame = 0").rows
    assert [row[:2] for row in rows] == [(one.name, one.state) for one in frame.people]
    assert len(rows) > 1
    for (_, _, box, x_m), one in zip(rows, frame.people, strict=True):
        assert np.array_equal(box, one.amodal_box.astype(np.float32))
        assert x_m == np.float32(one.T_world_target[0, 3])
    assert "people" not in store.query("FROM frames").columns
    assert len(list((finished / "frames").rglob("*.parquet"))) == 2
    assert len(list((finished / "episodes").rglob("*.parquet"))) == 4


def test_frames_that_are_lost_take_their_results_with_them(copied: Path):
    (copied / FRAMES).unlink()
    assert check(copied).problems == ("missing: corridor seed 0",)
    with pytest.raises(RunError, match="its frames are missing"):
        RunStore(copied).query("FROM summary")
    before = (copied / SECOND).read_bytes()
    run(PLAN, copied, videos="none")
    assert check(copied).good
    assert (copied / SECOND).read_bytes() == before


def test_an_unfinished_run_has_no_summary_of_fewer_episodes(tmp_path: Path):
    run(PLAN, tmp_path / "run", videos="none", part=(2, 2))
    assert check(tmp_path / "run").problems == ("missing: corridor seed 1",)
    with RunStore.begin(tmp_path / "run", PLAN) as store:
        assert not Checksums(tmp_path / "run").complete
        store.add({SECOND: b"half"})
    assert not (tmp_path / "run/summary.parquet").exists()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda record: record.pop("finished"), "finished: Field required"),
        (lambda record: record.update(sessions="none"), "sessions"),
        (lambda record: record["sessions"][0].update(command=[7]), "sessions.0.command.0"),
        (lambda record: record.update(plan=[]), "plan"),
        (lambda record: record.update(finished="\udcff"), "control characters or surrogates"),
        (lambda record: record["plan"].update(x=json.loads("[" * 500 + "]" * 500)), "levels deep"),
    ],
)
def test_a_damaged_record_is_one_error(copied: Path, change: object, words: str):
    record = json.loads((copied / "run.json").read_text())
    change(record)  # pyright: ignore[reportCallIssue]
    (copied / "run.json").write_text(json.dumps(record))
    for read in (check, lambda path: RunStore(path).results):
        with pytest.raises(RunError, match=words):
            read(copied)


def test_very_deep_json_is_one_error(copied: Path):
    (copied / "run.json").write_text("[" * 1_000_000)
    with pytest.raises(RunError, match="nested too deep"):
        check(copied)


def test_a_folder_in_the_place_of_the_summary_is_one_error_when_a_run_is_resumed(copied: Path):
    (copied / "summary.parquet").unlink()
    (copied / "summary.parquet").mkdir()
    (copied / FIRST).unlink()
    with pytest.raises(RunError, match=r"cannot replace .*summary\.parquet"):
        run(PLAN, copied, videos="none")


def test_a_pipe_is_no_file_and_not_waited_for(copied: Path, tmp_path: Path):
    with_sums(copied, finished=False)
    (copied / "summary.parquet").unlink()
    os.mkfifo(copied / "summary.parquet")
    assert "summary.parquet: is not a regular file" in check(copied).problems
    (copied / SECOND).unlink()
    os.mkfifo(copied / SECOND)
    assert "missing: corridor seed 1, oracle" in check(copied).problems
    assert [one.seed for one in RunStore(copied).results] == [0, 0, 1]
    assert merge(tmp_path / "merged", [copied]).added == 3
    (copied / "run.json").unlink()
    os.mkfifo(copied / "run.json")
    with pytest.raises(RunError, match="not a regular file"):
        RunStore(copied)


def test_a_link_to_itself_is_no_file(copied: Path):
    store = RunStore(copied)
    result = store.results[0]
    file = copied / result.file
    file.unlink()
    file.symlink_to(file.name)
    with pytest.raises(RunError, match="not in the run folder"):
        store.frame_columns(result, ("frame",))
    assert not check(copied).good


def test_text_that_is_a_formula_is_escaped_in_csv():
    rows = [["=1+1"], ["+1"], ["-1"], ["@x"], ["\t=1"], [-1.5], ["a=b"], [None]]
    lines = csv_text(["cell"], rows).splitlines()
    assert lines == ["cell", "'=1+1", "'+1", "'-1", "'@x", "'\t=1", "-1.5", "a=b", '""']
