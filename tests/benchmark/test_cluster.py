"""A real scheduler with two worker processes on loopback: the same bits as on one worker here."""

import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from pftrack_sim.benchmark import run
from pftrack_sim.benchmark.running.executor import DaskExecutor
from pftrack_sim.core.errors import RunError
from tests.benchmark.small import contents, small_plan

pytest.importorskip("distributed")


def dask(*arguments: str, log: Path) -> subprocess.Popen[bytes]:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    with log.open("wb") as written:
        return subprocess.Popen(
            [sys.executable, "-m", *arguments], stdout=written, stderr=subprocess.STDOUT, env=environment
        )


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    folder = tmp_path_factory.mktemp("dask")
    log = folder / "scheduler.log"
    started = [dask("distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", log=log)]
    try:
        deadline = time.monotonic() + 60
        while not (found := re.search(r"Scheduler at:\s+(tcp://\S+)", log.read_text())):
            assert time.monotonic() < deadline, log.read_text()
            time.sleep(0.1)
        for number in range(2):
            # One under a nanny, as a daemon process.
            words = ["distributed.cli.dask_worker", found[1], "--nthreads", "1", "--no-dashboard"]
            words += ["--no-nanny"] if number else []
            started.append(dask(*words, "--local-directory", str(folder), log=folder / f"worker-{number}.log"))
        yield found[1]
    finally:
        for one in started:
            one.kill()
            one.wait()


@pytest.mark.slow
def test_a_cluster_gives_the_same_bits(scheduler: str, tmp_path: Path):
    plan = small_plan(range(4), ["ko2012", "tests.benchmark.faulty_trackers:raises"])
    here = run(plan, tmp_path / "here")
    there = run(plan, tmp_path / "there", scheduler=scheduler)
    assert contents(here.path) == contents(there.path)
    errors = [one.error or "" for one in there.results if one.label != "ko2012"]
    assert [error.partition(" (faulty_trackers.py")[0] for error in errors] == ["frame 2: ValueError: lost my way"] * 4
    assert len(list((there.path / "videos").rglob("*.mp4"))) == 1
    for one in list(there.present.values())[::3]:
        (there.path / one.table).unlink()
    run(plan, there.path, scheduler=scheduler)
    assert contents(here.path) == contents(there.path)


def test_an_unreachable_cluster_is_an_error(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("pftrack_sim.benchmark.running.executor._CONNECT_S", 1)
    with pytest.raises(RunError, match="no Dask scheduler at"):
        DaskExecutor("tcp://127.0.0.1:9")
