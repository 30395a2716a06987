"""The same plan gives the same bits: on one worker or two, in any order, in parts, fresh or resumed."""

import os
import shutil
import signal
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import cv2
import duckdb
import pytest

from pftrack_sim.benchmark import Plan, RunStore, join_plans, make_plan, run
from pftrack_sim.benchmark.kept import folder
from pftrack_sim.benchmark.reading.check import check
from pftrack_sim.benchmark.reading.merge import merge
from pftrack_sim.benchmark.running.episode import EpisodeJob
from pftrack_sim.benchmark.running.executor import LocalExecutor, WorkerContext
from pftrack_sim.benchmark.running.progress import RunProgress
from pftrack_sim.core.errors import ParameterError, RunError
from tests.benchmark.small import SMALL, contents, small_plan


@pytest.fixture(scope="module")
def plan() -> Plan:
    return small_plan(range(5), ["oracle", "ko2012"])


@pytest.fixture(scope="module")
def one(plan: Plan, tmp_path_factory: pytest.TempPathFactory) -> RunStore:
    return run(plan, tmp_path_factory.mktemp("one") / "run", videos="none")


def test_a_worker_begins_with_one_thread_and_the_same_kernels_for_linear_algebra(monkeypatch: pytest.MonkeyPatch):
    """OpenBLAS reads both while it loads; with a thread per core, two workers on two cores take twice as long."""
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    monkeypatch.delenv("OPENBLAS_CORETYPE", raising=False)
    monkeypatch.setenv("OMP_NUM_THREADS", "3")  # the user's own stays
    names = ("OPENBLAS_NUM_THREADS", "OPENBLAS_CORETYPE", "OMP_NUM_THREADS")
    with ProcessPoolExecutor(1, WorkerContext()) as pool:
        found = list(pool.map(os.getenv, names))
    avx2 = "AVX2" in cv2.getCPUFeaturesLine().replace("*", "").split()
    assert found == ["1", "Haswell" if avx2 else None, "3"]
    assert not {"OPENBLAS_NUM_THREADS", "OPENBLAS_CORETYPE"} & os.environ.keys()


@pytest.mark.slow
def test_two_workers_that_are_killed_give_the_same_bits(
    plan: Plan, one: RunStore, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Up to two workers are killed in the middle of an episode."""
    killed: set[int] = set()
    pools: list[LocalExecutor] = []
    begin = LocalExecutor.__init__

    def remembered(self: LocalExecutor, count: int) -> None:
        begin(self, count)
        pools.append(self)

    monkeypatch.setattr(LocalExecutor, "__init__", remembered)

    def kill(status: RunProgress) -> None:
        if pools and len(killed) < 2 and status.frames > status.done * 4:
            for pid in {one.pid or 0 for one in pools[0]._context.started[:2]} - killed - {0}:
                killed.add(pid)
                os.kill(pid, signal.SIGKILL)

    two = run(plan, tmp_path / "two", workers=2, videos="none", shuffle=1, on_progress=kill)
    assert killed
    assert contents(two.path) == contents(one.path)
    assert check(two.path).good


@pytest.mark.slow
def test_parts_are_merged(plan: Plan, one: RunStore, tmp_path: Path):
    for k in (1, 2):
        run(plan, tmp_path / f"part-{k}", videos="first", part=(k, 2))
    found = check(tmp_path / "part-1")
    assert not found.good
    assert found.episodes == 3
    assert "missing: corridor seed 1" in found.problems
    assert len(RunStore(tmp_path / "part-1").query("SELECT * FROM episodes").rows) == 3
    done = merge(tmp_path / "all", [tmp_path / "part-1", tmp_path / "part-2", one.path])
    assert (done.added, done.shared, done.done) == (10, 10, 10)
    assert contents(tmp_path / "all") == contents(one.path)
    assert (tmp_path / f"all/videos/{plan.episode(0).path}.mp4").is_file()
    assert check(tmp_path / "all").good


def middle_of(column: str, path: Path) -> int:
    """Where the middle of a column lies in a Parquet file: elsewhere a changed byte may be one of the clock's."""
    start, size = duckdb.execute(
        "SELECT data_page_offset, total_compressed_size FROM parquet_metadata(?) WHERE path_in_schema = ?",
        [str(path), column],
    ).fetchall()[0]
    return start + size // 2


def test_check_finds_what_is_wrong(one: RunStore, tmp_path: Path):
    def harmed(name: str) -> Path:
        shutil.copytree(one.path, tmp_path / name)
        return tmp_path / name

    first, _, second, *_ = (Path(result.table) for result in one.plan.asked.values())
    cut = harmed("cut")
    (cut / first).write_bytes((one.path / first).read_bytes()[:-100])
    swapped = harmed("swapped")
    shutil.copy(swapped / second, swapped / first)
    added = harmed("added")
    foreign = first.with_name("seed-0099-0123456789abcdef.parquet")
    shutil.copy(added / first, added / foreign)
    flipped = harmed("flipped")
    content = bytearray((flipped / first).read_bytes())
    content[middle_of("overlap", flipped / first)] ^= 1
    (flipped / first).write_bytes(content)
    edited = harmed("edited")
    record = (edited / "run.json").read_text()
    (edited / "run.json").write_text(record.replace('"duration_s": 0.4', '"duration_s": 0.5'))
    assert check(one.path).good
    for harmed_run in (cut, swapped, flipped):
        (problem,) = check(harmed_run).problems
        assert problem == f"{first.as_posix()}: changed since it was written"
        (harmed_run / "SHA256SUMS").unlink()
        assert "SHA256SUMS: missing" in check(harmed_run).problems
    assert check(added).problems == (f"unknown file: {foreign.as_posix()}",)
    with pytest.raises(RunError, match=r"run\.json: changed since"):
        check(edited)


def test_a_folder_has_one_writer_at_a_time(plan: Plan, tmp_path: Path):
    problems: list[RunError] = []

    def intrude(_: RunProgress) -> None:
        if not problems:
            with pytest.raises(RunError, match="another process is writing") as caught:
                run(plan, tmp_path / "run", videos="none")
            problems.append(caught.value)

    run(plan, tmp_path / "run", videos="none", part=(5, 5), on_progress=intrude)
    assert problems


@pytest.mark.slow
def test_ctrl_c_stops_and_keeps_what_is_finished(plan: Plan, one: RunStore, tmp_path: Path):
    from pftrack_sim.benchmark import Interrupted

    def press(status: RunProgress) -> None:
        if status.done == 2:
            raise KeyboardInterrupt

    with pytest.raises(Interrupted, match="stopped; 2 of 5 episodes are finished"):
        run(plan, tmp_path / "run", videos="none", workers=1, on_progress=press)
    assert len(RunStore(tmp_path / "run").kept) == 4
    run(plan, tmp_path / "run", videos="none")
    assert contents(tmp_path / "run") == contents(one.path)


def test_queries(one: RunStore):
    answer = one.query("SELECT tracker, count(*) AS n FROM frames GROUP BY tracker ORDER BY tracker")
    assert answer.columns == ("tracker", "n")
    assert answer.rows == [("ko2012", 20), ("oracle", 20)]
    assert one.query("SELECT count(*), sum(episode_frames) FROM episodes").rows == [(5, 20)]
    assert one.query("SELECT avg(mean_overlap) FROM summary WHERE tracker = 'oracle'").rows == [(1.0,)]
    with pytest.raises(RunError, match="the query failed"):
        one.query("SELECT nonsense FROM frames")


def test_a_query_writes_nothing_and_ends(one: RunStore):
    before = {path: path.read_bytes() for path in one.path.rglob("*") if path.is_file()}
    summary = one.path / "summary.parquet"
    for sql in (
        f"COPY (SELECT 1) TO '{summary}'",
        f"EXPLAIN ANALYZE COPY (SELECT 1) TO '{summary}'",
        f"/* */ EXPLAIN ANALYZE COPY (SELECT 1) TO '{summary}'",
        f"EXPLAIN (ANALYZE, FORMAT json) COPY (SELECT 1) TO '{summary}'",
        "EXPLAIN EXPLAIN SELECT 1",
        "SET memory_limit = '9GB'",
        "DROP VIEW summary",
        "SELECT 1; SELECT 2",
        f"FROM read_text('{Path(__file__)}')",
        "",
        "SELECT '\udcff'",
    ):
        with pytest.raises(RunError):
            one.query(sql)
    assert {path: path.read_bytes() for path in one.path.rglob("*") if path.is_file()} == before
    for sql in ("DESCRIBE frames", "SUMMARIZE summary", "explain SELECT 1", "EXPLAIN ANALYZE FROM summary"):
        assert one.query(sql).rows
    with pytest.raises(RunError, match="Out of Memory"):
        one.query("SELECT list(range) FROM range(1000000000)", limit_gb=1.0)
    with pytest.raises(RunError, match="Interrupted"):
        one.query("SELECT sum(a.range * b.range) FROM range(1000000) AS a, range(1000000) AS b", limit_s=0.2)


def test_options_that_are_not_allowed(plan: Plan, tmp_path: Path):
    for options in ({"part": (3, 2)}, {"part": (0, 2)}, {"isolation": "some"}, {"workers": -1}):
        with pytest.raises(ParameterError, match=next(iter(options))):
            run(plan, tmp_path / "run", **options)  # pyright: ignore[reportArgumentType]
    assert not (tmp_path / "run").exists()


def test_tables_are_written(one: RunStore):
    text = (one.path / "tables/trackers.csv").read_text().splitlines()
    assert text[0].startswith("tracker,episodes,seeds,mean_overlap,mean_overlap_low,mean_overlap_high,stay,skill")
    assert text[1].startswith("oracle,5,5,1.0,1.0,1.0")
    ko2012 = next(line for line in text if line.startswith("ko2012,")).split(",")
    mean, low, high = map(float, ko2012[3:6])
    assert 0.0 <= low < mean < high <= 1.0
    latex = (one.path / "tables/trackers.tex").read_text()
    assert f"ko2012 & 5 & 5 & {mean:.3f} ({low:.3f} to {high:.3f}) & " in latex
    assert r"tracker & episodes & seeds & mean overlap (95 \% interval over seeds) & " in latex


def test_the_mean_of_a_table_is_the_one_of_its_interval_where_places_have_other_seeds(tmp_path: Path):
    plans = [
        make_plan([name], ["ncc"], range(count), overrides=SMALL) for name, count in (("corridor", 6), ("hall", 2))
    ]
    store = run(join_plans(plans), tmp_path / "run", videos="none")
    by_seed = store.query("SELECT avg(mean_overlap) AS one FROM summary GROUP BY seed").rows
    expected = sum(row[0] for row in by_seed) / 6
    told = (store.path / "tables/trackers.csv").read_text().splitlines()[1].split(",")
    assert float(told[3]) == pytest.approx(expected)
    assert float(told[3]) != pytest.approx(sum(one.number("mean_overlap") for one in store.results) / 8)


@pytest.mark.parametrize("busy", [pytest.param(True, marks=pytest.mark.slow), False], ids=["busy", "starting"])
def test_closing_an_executor_ends_its_workers(plan: Plan, busy: bool):
    pool = LocalExecutor(1)
    working = pool.run_all(EpisodeJob(episode) for episode in plan.episodes())
    while next(working) is None and busy:
        pass
    started = list(pool._context.started)
    assert [one.is_alive() for one in started] == [True]
    pool.close()
    # The executor's own thread joins them too: whichever thread comes second learns the exit code a moment later.
    deadline = time.monotonic() + 20
    while any(one.is_alive() for one in started):
        assert time.monotonic() < deadline
        time.sleep(0.05)


@pytest.mark.slow
def test_a_tracker_that_ends_its_worker_is_named_and_the_others_go_on(tmp_path: Path):
    killer = "tests.benchmark.faulty_trackers:kills_its_process"
    together = run(
        small_plan(range(2), [killer, "stay"]), tmp_path / "together", videos="none", workers=1, isolation="never"
    )
    alone = run(small_plan(range(2), ["stay"]), tmp_path / "alone", videos="none")
    failures = {result.label: result.error for result in together.results}
    assert failures == {killer: "frame 2: its process was ended by SIGKILL", "stay": None}
    rows = "SELECT * EXCLUDE ms FROM frames WHERE tracker = 'stay' ORDER BY seed, frame"
    assert str(together.query(rows)) == str(alone.query(rows))


def test_temporary_files_lie_in_the_run_folder_and_are_swept(plan: Plan, tmp_path: Path):
    with RunStore.begin(tmp_path / "run", plan):
        left = tmp_path / "run/.scratch/pftrack-sim-killed"
        left.mkdir()
    assert not left.exists()
    left.mkdir(parents=True)
    RunStore.begin(tmp_path / "run", plan)  # never closed: its process was killed
    assert list((tmp_path / "run/.scratch").iterdir()) == []


def test_a_run_begun_by_another_process_meanwhile_is_not_overwritten(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The other process begins, and ends, just before this one gets the lock."""
    first, second = small_plan(range(1), ["stay"]), small_plan(range(2), ["stay"])
    lock = folder.lock_folder

    def late_lock(path: Path) -> int:
        monkeypatch.setattr(folder, "lock_folder", lock)
        RunStore.begin(path, first).close()
        return lock(path)

    monkeypatch.setattr(folder, "lock_folder", late_lock)
    RunStore.begin(tmp_path / "run", second).close()
    assert len(RunStore(tmp_path / "run").record.sessions) == 2
