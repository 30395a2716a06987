"""The limits of the command `query`."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from pftrack_sim.benchmark import run
from tests.benchmark.small import small_plan


def test_a_query_ends_in_time_within_a_value_too(tmp_path: Path):
    """DuckDB heeds an interrupt after a value only: this one takes it a quarter of a minute and gigabytes."""
    run(small_plan(range(1), ["stay"]), tmp_path / "run", videos="none")
    limits = "from pftrack_sim.cli import main, reading; reading._QUERY_S = reading._PRINT_S = 0.2; main()"
    done = _query_in_a_process(tmp_path, limits, "SELECT map(range(20000000), range(20000000))")
    assert done.stderr == "pftrack-sim: the query failed: it and its answer took longer than 0.4 s\n"


def _query_in_a_process(folder: Path, program: str, sql: str) -> subprocess.CompletedProcess[str]:
    words = [sys.executable, "-c", program, "query", "run", sql]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (2, "")
    return done


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not limit the memory of a process")
@pytest.mark.parametrize(
    "sql",
    [
        "SELECT repeat('x', 3000000000)",
        "SELECT repeat('x', 1000000) FROM range(2000)",
        "FROM range(30000000)",
    ],
)
def test_a_query_ends_where_a_value_or_its_rows_take_more_memory(tmp_path: Path, sql: str):
    """DuckDB counts neither: the first took 12 GB, each of the others more than 2."""
    run(small_plan(range(1), ["stay"]), tmp_path / "run", videos="none")
    program = "from pftrack_sim.cli import main, reading; reading._QUERY_GB = 0.5; main()"
    done = _query_in_a_process(tmp_path, program, sql)
    assert re.search("Out of Memory|its answer takes more than 0.5 GB", done.stderr)
    assert "Traceback" not in done.stderr
