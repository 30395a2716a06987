"""Faults of a tracker are reported with frame, picture, traceback and output, and other trackers are not affected."""

import math
from pathlib import Path

import cv2
import numpy as np
import pytest

from pftrack_sim.benchmark import RunStore, make_plan, run
from pftrack_sim.benchmark.reading.check import check
from pftrack_sim.benchmark.reading.merge import merge
from pftrack_sim.benchmark.said.readings import misread_trackers
from pftrack_sim.core.errors import TrackerError
from pftrack_sim.report.tables import summaries
from pftrack_sim.trackers.isolation import Limits
from tests.benchmark.small import SMALL, settings, small_plan
from tests.cli.test_cli import pftrack_sim

MODULE = "tests.benchmark.faulty_trackers:"
RAISES = "tests.trackers.kept_trackers:raises"
LIMITS = Limits(frame_s=2.5, memory_mb=300)

EXPECTED = "update must return an Estimate, or four numbers x, y, w, h"
FAULTS = {
    "raises": "frame 2: ValueError: lost my way",
    "returns_nan": "frame 2: BoxError: estimated box must be finite",
    "returns_an_array": f"frame 2: TrackerError: {EXPECTED}, got ndarray of shape (3,)",
    "returns_none": f"frame 2: TrackerError: {EXPECTED}, got NoneType",
    "never_returns": "frame 2: no answer within 2.5 s",
    "segfaults": "frame 2: its process was ended by SIGSEGV",
    "calls_sys_exit": "frame 2: SystemExit: 0",
    "calls_os_exit": "frame 2: its process ended with exit code 3",
    "takes_too_much_memory": "frame 2: MemoryError",
    "writes_into_its_image": "frame 2: TrackerError: it wrote into the image it was given",
    "fails_for_seed_4": "frame 0: could not be made: TrackerError",
    "prints": None,
}
ROWS = "SELECT * EXCLUDE ms FROM frames WHERE tracker = 'ko2012' ORDER BY frame"


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> RunStore:
    plan = small_plan(range(4, 5), ["ko2012"])
    return run(plan, tmp_path_factory.mktemp("alone") / "run", videos="none")


@pytest.fixture(scope="module")
def together(tmp_path_factory: pytest.TempPathFactory) -> RunStore:
    names = [MODULE + name for name in FAULTS]
    plan = small_plan(range(4, 5), [*names[:6], "ko2012", *names[6:]])
    return run(plan, tmp_path_factory.mktemp("together") / "run", videos="none", limits=LIMITS)


@pytest.mark.slow
def test_other_trackers_give_the_same_bits(alone: RunStore, together: RunStore):
    with alone.database() as quiet, together.database() as noisy:
        assert str(quiet.sql(ROWS).fetchall()) == str(noisy.sql(ROWS).fetchall())
        digests = [one.sql("SELECT frames_digest FROM episodes").fetchall() for one in (quiet, noisy)]
        assert digests[0] == digests[1]


@pytest.mark.parametrize("name", FAULTS)
def test_the_error_is_reported_and_later_frames_are_misses(together: RunStore, name: str):
    expected = FAULTS[name]
    (result,) = [one for one in together.results if one.label == MODULE + name]
    with together.database() as database:
        frames = database.execute(
            "SELECT status, overlap FROM frames WHERE tracker = ? ORDER BY frame", [MODULE + name]
        ).fetchall()
    statuses = [status for status, _ in frames]
    if expected is None:
        assert result.error is None
        assert statuses == ["init", "ok", "ok", "ok"]
        return
    assert result.error is not None
    assert result.error.startswith(expected)
    bad_from = 0 if name == "fails_for_seed_4" else 2
    assert statuses == ["init", "ok"][:bad_from] + ["error"] * (4 - bad_from)
    assert all(overlap == 0.0 for _, overlap in frames[bad_from:])
    assert math.isnan(result.measures.ms_median) == (bad_from == 0)


@pytest.mark.parametrize("isolation", ["auto", "never"])
def test_four_numbers_are_a_box_and_corners_are_told(tmp_path: Path, isolation: str):
    names = [MODULE + name for name in ("returns_a_list", "Corners")]
    plan = make_plan(["easy/corridor"], [*names, "stay"], [4], overrides={**SMALL, "duration_s": 0.5})
    store = run(plan, tmp_path / "run", videos="none", workers=0, isolation=isolation)
    assert not any(one.error for one in store.results)
    boxes = store.query(f"SELECT DISTINCT estimate FROM frames WHERE label = '{names[0]}' AND status = 'ok'").rows
    assert boxes == [([1.0, 2.0, 30.0, 40.0],)]
    (told,) = misread_trackers(store)
    assert told.startswith(f"{names[1]}: its first boxes overlap the truth by ")
    assert "corners x1, y1, x2, y2" in told


def test_printed_output_is_recorded_and_not_shown(together: RunStore, capfd: pytest.CaptureFixture[str]):
    with together.database() as database:
        printed = dict(database.sql("SELECT tracker, printed FROM summary").fetchall())
    assert printed[MODULE + "prints"].startswith("rubbish rubbish")
    assert "bytes more" in printed[MODULE + "prints"]
    assert printed["ko2012"] is None
    assert "rubbish" not in "".join(capfd.readouterr())


@pytest.mark.slow
def test_an_isolated_tracker_gives_the_same_bits(alone: RunStore, tmp_path: Path):
    plan = small_plan(range(4, 5), ["ko2012"])
    apart = run(plan, tmp_path / "run", videos="none", isolation="always")
    with alone.database() as here, apart.database() as there:
        assert str(here.sql(ROWS).fetchall()) == str(there.sql(ROWS).fetchall())


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("tests.benchmark.faulty_trackers:ends_while_imported", "exit code 5"),
        ("tests.benchmark.faulty_trackers:absent", "has no 'absent'"),
        ("no.such.module:factory", "No module named"),
    ],
)
def test_a_tracker_that_cannot_be_made_is_reported_before_anything_is_written(tmp_path: Path, name: str, words: str):
    with pytest.raises(TrackerError, match=words):
        run(small_plan(range(1), [name]), tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_the_finalizer_of_an_answer_is_charged(tmp_path: Path):
    done = run(small_plan(range(1), [MODULE + "works_in_a_finalizer"]), tmp_path / "run", videos="none", workers=0)
    assert done.results[0].measures.ms_median > 30.0


def test_a_tracker_is_timed_from_outside_and_what_it_says_stands_beside(tmp_path: Path):
    plan = small_plan(range(1), [MODULE + "StopsItsClock"])
    done = run(plan, tmp_path / "run", videos="none", workers=0)
    (measures,) = [one.measures for one in done.results]
    assert measures.ms_reported == 0.0
    assert measures.ms_median > 30.0
    (row,) = summaries("frames", {("", "mine"): [measures]}, "seed", wide=False).rows
    assert row[-2] == f"{measures.ms_median:.2f} (said 0.00)"


@pytest.fixture(scope="module")
def stopped(tmp_path_factory: pytest.TempPathFactory) -> RunStore:
    plan = small_plan(range(2), ["stay", RAISES])
    return run(plan, tmp_path_factory.mktemp("errors") / "run", videos="none", stop_on_error=True)


def test_the_frame_of_an_error_and_its_text_are_kept(stopped: RunStore):
    failed, fine = sorted(stopped.results, key=lambda one: one.error is None)
    picture = stopped.error_picture(failed)
    assert picture is not None
    assert picture.name.startswith("seed-0000-tests.trackers.kept_trackers-raises-")
    image = cv2.imread(str(picture))
    assert image is not None
    assert image.shape == (SMALL["camera.height_px"], SMALL["camera.width_px"], 3)
    text = picture.with_suffix(".txt").read_text()
    assert "frame 1: ValueError: lost my way (kept_trackers.py, line" in text
    assert 'raise ValueError("lost my way")' in text
    assert text.endswith("It printed:\nwhere am I?\n")
    assert stopped.error_picture(fine) is None


@pytest.mark.slow
def test_a_run_that_stopped_at_an_error_goes_on_and_errors_are_part_of_it(stopped: RunStore, tmp_path: Path):
    assert {one.seed for one in stopped.results} == {0}
    assert not stopped.finished
    whole = run(stopped.plan, stopped.path, videos="none")
    assert check(whole.path).good
    merged = tmp_path / "merged"
    merge(merged, [whole.path])
    (failed,) = (one for one in whole.results if one.error and one.seed == 1)
    picture = whole.error_picture(failed)
    assert picture is not None
    name = picture.relative_to(whole.path)
    assert (merged / name).read_bytes() == picture.read_bytes()
    picture.unlink()
    assert check(whole.path).problems == (f"{name.as_posix()}: missing",)


@pytest.mark.slow
def test_the_command_line_prints_the_traceback_and_exits_with_1(tmp_path: Path):
    for words in (
        ["bench", "corridor", "--seeds", "0:1", "--videos", "none", "--workers", "0", "--out", str(tmp_path / "run")],
        ["render", "corridor", "--video", str(tmp_path / "look.mp4")],
    ):
        done = pftrack_sim(*words, "--trackers", RAISES, *settings(SMALL))
        assert done.returncode == 1
        assert "ValueError: lost my way (kept_trackers.py, line" in done.stdout
        assert 'raise ValueError("lost my way")' in done.stdout
        assert "where am I?" in done.stdout
    image = cv2.imread(str(tmp_path / "look-error-tests.trackers.kept_trackers-raises.png"))
    assert image is not None
    assert np.ptp(image) > 0
