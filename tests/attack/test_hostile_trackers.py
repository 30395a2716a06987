"""Hostile trackers harm nobody but themselves."""

import sys
from pathlib import Path

import pytest

from pftrack_sim.benchmark import RunStore, run
from pftrack_sim.benchmark.reading.check import check
from pftrack_sim.report import write_report
from pftrack_sim.trackers.isolation import Limits
from tests.attack.hostile import MARK
from tests.attack.hostile_trackers import ATTACKS
from tests.benchmark.small import small_plan

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="other systems do not contain processes"),
]

MODULE = "tests.attack.hostile_trackers:"
GOOD = ("ko2012", "lee2012")
LIMITS = Limits(frame_s=5.0, memory_mb=300)

ANSWERS = {
    "half_a_reply": "no answer within",
    "half_a_length": "no answer within",
    "half_a_reply_of_multiprocessing": "its answer cannot be read",
    "endless_reply": "its answer cannot be read",
    "reply_drip": "no answer within",
    "deep_reply": "its answer cannot be read",
    "surrogate_in_exception": r"ValueError: \udcff",
    "endless_exception": "ValueError: xxx",
    "exception_without_text": "Unspeakable: its message cannot be made",
    "occluded_is_text": "its answer cannot be read",
    "time_is_nan": "its answer cannot be read",
    "takes_memory": "MemoryError",
    "takes_shared_memory": "memory limit of 300 MB",
    "takes_memory_in_children": "memory limit of 300 MB",
    "fills_the_disk": "OSError: [Errno 27]",
    "child_that_holds_everything": "its process ended with exit code 7",
    "segfault": "its process was ended by SIGSEGV",
    "os_exit": "its process ended with exit code 0",
}
"""What must be said of some of them; the others must have failed, or done no harm."""


@pytest.fixture(scope="module")
def quiet(tmp_path_factory: pytest.TempPathFactory) -> RunStore:
    return run(small_plan(range(4, 5), list(GOOD)), tmp_path_factory.mktemp("quiet") / "run", videos="none")


@pytest.fixture(scope="module")
def attacked(tmp_path_factory: pytest.TempPathFactory) -> RunStore:
    hostile = [MODULE + name for name in ATTACKS]
    half = len(hostile) // 2
    plan = small_plan(range(4, 5), [*hostile[:half], GOOD[0], *hostile[half:], GOOD[1]])
    return run(plan, tmp_path_factory.mktemp("attacked") / "run", videos="none", workers=1, limits=LIMITS)


def _good(store: RunStore) -> str:
    rows = "SELECT * EXCLUDE ms FROM frames WHERE tracker IN ('ko2012', 'lee2012') ORDER BY tracker, frame"
    with store.database() as database:
        digests = database.sql("SELECT frames_digest FROM episodes").fetchall()
        return str((database.sql(rows).fetchall(), digests))


def test_the_good_ones_score_the_same_to_the_bit(quiet: RunStore, attacked: RunStore):
    assert _good(quiet) == _good(attacked)


def test_the_run_is_whole(attacked: RunStore):
    assert check(attacked.path).good
    assert write_report(attacked.path).is_file()
    for file in [*(attacked.path / "tables").iterdir(), attacked.path / "report.html"]:
        file.read_text(encoding="utf-8")


@pytest.mark.parametrize("name", ATTACKS)
def test_what_an_attacker_is_told(attacked: RunStore, name: str):
    (result,) = [one for one in attacked.results if one.label == MODULE + name]
    if name in ANSWERS:
        assert result.error is not None
        assert ANSWERS[name] in result.error
    if result.error is not None:
        assert len(result.error) < 700
        assert result.error.isprintable()


def test_nothing_that_they_started_is_left(attacked: RunStore):
    assert not [pid for pid in Path("/proc").glob("[0-9]*") if _name(pid) == MARK]


def _name(process: Path) -> bytes:
    try:
        return (process / "comm").read_bytes().strip()
    except OSError:
        return b""
