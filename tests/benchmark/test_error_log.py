"""A tracker's error can be looked at: picture, traceback, output; the run goes on or stops."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from pftrack_sim.benchmark import RunStore, run
from pftrack_sim.benchmark.reading.check import check
from pftrack_sim.benchmark.reading.merge import merge
from tests.benchmark.small import SMALL, settings, small_plan
from tests.cli.test_cli import pftrack_sim

RAISES = "tests.trackers.kept_trackers:raises"


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
