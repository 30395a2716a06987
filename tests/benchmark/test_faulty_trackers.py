"""A bad tracker hurts only itself: it is told what happened and where, and everyone else does not notice."""

from pathlib import Path

import pytest

from pftrack_sim.benchmark import RunStore, run
from pftrack_sim.core.errors import TrackerError
from pftrack_sim.trackers.isolation import Limits
from tests.benchmark.small import small_plan

STRANGERS = "tests.benchmark.faulty_trackers:"
LIMITS = Limits(frame_s=2.5, memory_mb=300)

MISDEEDS = {
    "raises": "frame 2: ValueError: lost my way",
    "says_nan": "frame 2: BoxError: estimated box must be finite",
    "wrong_shape": "frame 2: TrackerError: update must return an Estimate, got ndarray",
    "says_nothing": "frame 2: TrackerError: update must return an Estimate, got NoneType",
    "endless": "frame 2: no answer within 2.5 s",
    "segfault": "frame 2: its process was ended by SIGSEGV",
    "sys_exit": "frame 2: SystemExit: 0",
    "os_exit": "frame 2: its process ended with exit code 3",
    "greedy": "frame 2: MemoryError",
    "scribbles": "frame 2: TrackerError: it wrote into the image it was given",
    "cannot_be_made_later": "frame 0: could not be made: TrackerError",
    "prints": None,
}
ROWS = "SELECT * EXCLUDE ms FROM frames WHERE tracker = 'ko2012' ORDER BY frame"


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> RunStore:
    plan = small_plan(range(4, 5), ["ko2012"])
    return run(plan, tmp_path_factory.mktemp("alone") / "run", videos="none")


@pytest.fixture(scope="module")
def together(tmp_path_factory: pytest.TempPathFactory) -> RunStore:
    names = [STRANGERS + name for name in MISDEEDS]
    plan = small_plan(range(4, 5), [*names[:6], "ko2012", *names[6:]])
    return run(plan, tmp_path_factory.mktemp("together") / "run", videos="none", limits=LIMITS)


def test_everyone_else_is_untouched_to_the_bit(alone: RunStore, together: RunStore):
    with alone.database() as quiet, together.database() as noisy:
        assert str(quiet.sql(ROWS).fetchall()) == str(noisy.sql(ROWS).fetchall())
        digests = [one.sql("SELECT frames_digest FROM episodes").fetchall() for one in (quiet, noisy)]
        assert digests[0] == digests[1]


@pytest.mark.parametrize("name", MISDEEDS)
def test_what_happened_is_told_and_scored_as_a_miss_from_there_on(together: RunStore, name: str):
    expected = MISDEEDS[name]
    (result,) = [one for one in together.results if one.label == STRANGERS + name]
    with together.database() as database:
        frames = database.execute(
            "SELECT status, overlap FROM frames WHERE tracker = ? ORDER BY frame", [STRANGERS + name]
        ).fetchall()
    statuses = [status for status, _ in frames]
    if expected is None:
        assert result.failure is None
        assert statuses == ["init", "ok", "ok", "ok"]
        return
    assert result.failure is not None
    assert result.failure.startswith(expected)
    bad_from = 0 if name == "cannot_be_made_later" else 2
    assert statuses == ["init", "ok"][:bad_from] + ["failed"] * (4 - bad_from)
    assert all(overlap == 0.0 for _, overlap in frames[bad_from:])


def test_what_is_printed_is_kept_and_reaches_nobody(together: RunStore, capfd: pytest.CaptureFixture[str]):
    with together.database() as database:
        printed = dict(database.sql("SELECT tracker, printed FROM summary").fetchall())
    assert printed[STRANGERS + "prints"].startswith("rubbish rubbish")
    assert "bytes more" in printed[STRANGERS + "prints"]
    assert printed["ko2012"] is None
    assert "rubbish" not in "".join(capfd.readouterr())


def test_a_tracker_says_the_same_in_a_process_of_its_own(alone: RunStore, tmp_path: Path):
    plan = small_plan(range(4, 5), ["ko2012"])
    apart = run(plan, tmp_path / "run", videos="none", isolation="always")
    with alone.database() as here, apart.database() as there:
        assert str(here.sql(ROWS).fetchall()) == str(there.sql(ROWS).fetchall())


def test_the_oracle_is_told_the_truth_in_a_process_of_its_own(tmp_path: Path):
    done = run(small_plan(range(1), ["oracle"]), tmp_path / "run", videos="none", isolation="always")
    assert done.results[0].measures.mean_overlap == 1.0


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("tests.benchmark.faulty_trackers:dies_while_imported", "exit code 5"),
        ("tests.benchmark.faulty_trackers:absent", "has no 'absent'"),
        ("no.such.module:factory", "No module named"),
    ],
)
def test_a_tracker_that_can_never_be_made_is_told_before_anything_is_written(tmp_path: Path, name: str, words: str):
    with pytest.raises(TrackerError, match=words):
        run(small_plan(range(1), [name]), tmp_path / "run")
    assert not (tmp_path / "run").exists()
