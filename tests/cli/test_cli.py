"""The command line as a person types it: right and wrong."""

import contextlib
import io
import os
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from unittest.mock import patch

import cv2
import numpy as np
import pytest
from rich.console import Console

from pftrack_sim import score
from pftrack_sim.benchmark import RunStore
from pftrack_sim.benchmark.limits.success import parse_success
from pftrack_sim.benchmark.reading.failures import CAUSES
from pftrack_sim.cli import main, tables
from pftrack_sim.report.tables import Table
from tests.fresh_process import printed

SETTINGS = ("camera.width_px=96", "camera.height_px=72", "duration_s=0.5", "lights.shadows=false", "occluders=[]")
SMALL = [word for setting in SETTINGS for word in ("--set", setting)]
HERE = ("--workers", "0")
"""Workers are processes, which take seconds to start."""


@dataclass
class Done:
    returncode: int
    stdout: str
    stderr: str


def pftrack_sim(*arguments: str, cwd: Path | None = None) -> Done:
    """Run a command in this process: a new one would spend seconds on imports."""
    out, err, code = io.StringIO(), io.StringIO(), 0
    with (
        patch.object(sys, "argv", ["pftrack-sim", *arguments]),
        patch.object(sys, "path", list(sys.path)),
        patch.dict(os.environ),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        contextlib.chdir(cwd or Path.cwd()),
    ):
        try:
            main()
        except SystemExit as stop:
            code = stop.code if isinstance(stop.code, int) else int(stop.code is not None)
    return Done(code, out.getvalue(), err.getvalue())


def succeeds(*arguments: str, cwd: Path | None = None) -> Done:
    """Run a command that ends well."""
    done = pftrack_sim(*arguments, cwd=cwd)
    assert done.returncode == 0, done.stdout + done.stderr
    return done


def refused(*arguments: str, cwd: Path | None = None) -> str:
    """Run a command that is refused before it prints anything; return its message."""
    done = pftrack_sim(*arguments, cwd=cwd)
    assert (done.returncode, done.stdout) == (2, ""), done.stderr
    assert "Traceback" not in done.stderr
    return done.stderr


def test_the_installed_command_prints_one_line_and_exits_with_2():
    command = Path(sys.executable).with_name("pftrack-sim")
    done = subprocess.run([command, "bench", "plaza-wlk"], capture_output=True, text=True)
    assert done.returncode == 2
    assert "did you mean 'plaza-walk'" in done.stderr
    assert "Traceback" not in done.stderr


def sequence(folder: Path, count: int = 12) -> Path:
    """A textured square that drifts over noise, in OTB layout."""
    rng = np.random.default_rng(0)
    (folder / "img").mkdir(parents=True)
    background = rng.integers(0, 80, (120, 160, 3), dtype=np.uint8)
    patch = rng.integers(120, 255, (30, 24, 3), dtype=np.uint8)
    lines = []
    for index in range(count):
        image = background.copy()
        x, y = 40 + index, 50
        image[y : y + 30, x : x + 24] = patch
        cv2.imwrite(str(folder / f"img/{index + 1:04d}.png"), image)
        lines.append(f"{x + 1},{y + 1},24,30")
    (folder / "groundtruth_rect.txt").write_text("\n".join(lines) + "\n")
    return folder


def test_bench_prints_tables_and_leaves_a_folder(tmp_path: Path):
    out = tmp_path / "run"
    bench = ("bench", "plaza-walk", "--seeds", "0:2", "--out", str(out), *HERE, *SMALL, "--trackers")
    done = succeeds(*bench, "oracle,stay")
    assert "oracle" in done.stdout
    assert "1.000" in done.stdout
    assert (out / "run.json").is_file()
    checked = succeeds("check", str(out))
    assert "2 of 2 episodes are intact; the run is complete" in checked.stdout
    sql = "SELECT tracker, mean_overlap FROM summary WHERE tracker = 'oracle'"
    for layout, words in (("table", "oracle"), ("csv", "oracle,1.0"), ("json", '{"tracker": "oracle", ')):
        assert words in pftrack_sim("query", str(out), sql, "--format", layout).stdout
    filmed = succeeds("film", str(out), "--worst", "1", "--tracker", "stay")
    assert "seed-000" in filmed.stdout
    assert ".mp4" in filmed.stdout
    succeeds("check", str(out))
    assert "did you mean 'stay'" in refused("film", str(out), "--tracker", "sty")
    assert f"--failed asks for drives, and {out} was run in open loop" in refused("film", str(out), "--failed")
    again = refused(*bench, "oracle", "--set", "duration_s=1")
    assert "holds another plan" in again
    assert "scenarios.plaza-walk.duration_s: 0.5 there, 1.0 asked for" in again


@pytest.mark.slow
def test_failed_drives_are_filmed_and_have_causes(tmp_path: Path):
    out, size = tmp_path / "run", ["--set", "camera.width_px=80", "--set", "camera.height_px=60"]
    command = ["follow", "follow/corridor", "--trackers", "stay,oracle", "--seeds", "0", "--videos", "none", *HERE]
    command += [
        word for key in ("duration_s=8", "camera.rate_hz=10", "follow.lost_after_s=1") for word in ("--set", key)
    ]
    done = succeeds(*command, *size, "--out", str(out))
    assert "Drives that failed, by cause" in done.stdout
    filmed = succeeds("film", str(out), "--failed")
    found = re.search(r"^stay\+servo-avoid follow/corridor seed 0, ([a-z -]+)[^:]*: (.*\.mp4)$", filmed.stdout, re.M)
    assert found is not None, filmed.stdout
    assert found[1].removesuffix(" at ") in CAUSES
    assert Path(found[2]).is_file()
    assert "oracle" not in filmed.stdout
    asked = pftrack_sim("query", str(out), "SELECT label, cause FROM failures", "--format", "csv")
    assert asked.stdout.splitlines()[1].startswith("stay+servo-avoid,")
    whole = pftrack_sim("query", str(out), "FROM summary LIMIT 1").stdout
    assert "\nlabel: stay+servo-avoid\n" in whole, "too many columns for a table"
    outcomes = parse_success("overlap >= 0.0001 for 1 % of the episode", "follow").outcomes(RunStore(out))
    ended = {one.label: one.values["outcome"] for one in RunStore(out).results}
    assert ended["stay+servo-avoid"] != "finished", "or else nothing is shown here"
    assert {cell[3]: good for cell, good in outcomes.items()} == {
        "stay+servo-avoid": False,
        "oracle+servo-avoid": ended["oracle+servo-avoid"] == "finished",
    }


@pytest.mark.slow
def test_a_part_of_a_run_in_closed_loop_is_printed(tmp_path: Path):
    command = ["follow", "plaza-walk", "--trackers", "oracle,stay", "--seeds", "0:2", "--videos", "none", *HERE, *SMALL]
    for part in ("1/4", "2/4"):
        succeeds(*command, "--part", part, "--out", str(tmp_path / part[0]))


@pytest.mark.slow
def test_follow_prints_a_table_and_goes_on_with_the_latency_that_it_measured(tmp_path: Path):
    out = tmp_path / "run"
    command = ["follow", "plaza-walk", "--trackers", "oracle,stay", "--seeds", "0", "--latency", "measured"]
    command += ["--videos", "none", *HERE, "--out", str(out), *SMALL]
    done = succeeds(*command)
    assert "tracker+controller" in done.stdout
    assert "oracle+servo-avoid" in done.stdout
    told = {**score.DEFINITIONS, **score.FOLLOWING_DEFINITIONS}
    without_column = {"jerk", "nearest bystander"}
    assert {name for name, words in told.items() if f"\n{name}: {words}\n" not in done.stdout} == without_column
    files = {file: file.stat().st_mtime_ns for file in (out / "episodes").rglob("*.parquet")}
    assert len(files) == 2
    fewer = succeeds(*[word.removeprefix("oracle,") for word in command])
    assert (
        f"warning: {out} holds more than is asked for, and all of it is run and shown: trackers oracle" in fewer.stderr
    )
    assert {file: file.stat().st_mtime_ns for file in files} == files
    succeeds("check", str(out))
    assert "oracle" in refused("follow", "plaza-walk", "--latency", "oracel=5")
    assert "see follow" in refused("bench", "plaza-walk", "--axis", "latency=5", "--out", str(tmp_path / "no"))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("command", ["bench", "follow"])
def test_a_target_that_is_never_visible_is_said_and_reported(command: str, tmp_path: Path):
    hidden = ["--set", "robot.gaze=forward", "--set", "camera.mount=back", *SMALL]
    run = ("--seeds", "0", "--out", str(tmp_path / "a"), *HERE)
    done = succeeds(command, "corridor", "--trackers", "ncc", *run, *hidden)
    assert "the target is never visible, and nothing is scored, in corridor seed 0" in done.stdout
    assert "nan" not in done.stdout
    assert (tmp_path / "a/report.html").is_file()
    assert "warning: corridor lasts 0.5 s, so that these never happen: target.actions.0 (pace)" in done.stderr


def test_a_run_says_its_stages_and_its_first_video_and_what_it_cuts_where_that_is_asked_for(tmp_path: Path):
    changes = '{ duration_s = 0.5, "camera.width_px" = 64, "camera.height_px" = 48, "lights.shadows" = false }'
    text = f'title = "T"\nseeds = "7"\ntrackers = ["stay"]\n[[run]]\nscenarios = ["corridor"]\nchanges = {changes}\n'
    (tmp_path / "tiny.toml").write_text(text)
    command = ["bench", str(tmp_path / "tiny.toml"), *HERE, "--out"]
    quiet = succeeds(*command, str(tmp_path / "quiet"))
    assert "warning" not in quiet.stderr, "a suite knows how long it is"
    assert f"1 episode, 1 tracker, 0 workers: {tmp_path / 'quiet'}" in quiet.stderr
    found = re.search(r"^first video: (.*)$", quiet.stderr, re.MULTILINE)
    assert found is not None
    assert Path(found[1]).is_file()
    assert "1 of 1 episodes" in quiet.stderr
    told = pftrack_sim(*command, str(tmp_path / "told"), "--verbose", "--videos", "none")
    assert "corridor lasts 0.5 s, so that these never happen: target.actions.0 (pace)" in told.stderr
    assert "first video" not in told.stderr
    asked = pftrack_sim("query", str(tmp_path / "told"), "SELECT seed, tracker FROM summary", "--format", "csv")
    assert asked.stdout.split() == ["seed,tracker", "7,stay"], "the suite's own"


def test_evaluate_prints_a_mean_overlap(tmp_path: Path):
    done = succeeds("evaluate", "--tracker", "ko2012,stay", "--seeds", "0:2", str(sequence(tmp_path / "square")))
    assert "square" in done.stdout
    assert "ko2012" in done.stdout
    assert re.search(r"^slowest frame of ko2012: \d+\.\d ms, square seed [01], frame [1-9]", done.stdout, re.MULTILINE)
    assert "Below each overlap, a mean over seeds: its 95 % interval (Hall 1992), or its values" in done.stdout


def test_parameters_reach_one_tracker_or_all(tmp_path: Path):
    square = str(sequence(tmp_path / "square"))
    with_dots, without = tmp_path / "dots.mp4", tmp_path / "plain.mp4"
    common = ("evaluate", "--trackers", "ko2012,ko2012-hsv", "--seeds", "0", square, "--video")
    succeeds(*common, str(without), "--param", "ko2012.particle_count=50")
    succeeds(*common, str(with_dots), "--param", "particles=true", "--param", "ko2012.particle_count=50")
    assert with_dots.read_bytes() != without.read_bytes()
    brackets = pftrack_sim(
        "evaluate", square, "--trackers", "ko2012[particle_count=50],ko2012-hsv", "--seeds", "0", "--param", "alpha=0.3"
    )
    assert "ko2012[alpha=0.3,particle_count=50]" in brackets.stdout, brackets.stderr


@pytest.mark.slow
def test_tables_name_a_tracker_with_its_parameters(tmp_path: Path):
    trackers = "stay,ncc[preset=paper]"
    done = succeeds("bench", "corridor", "--trackers", trackers, "--seeds", "0:2", "--out", str(tmp_path / "a"), *SMALL)
    assert re.search(r"^ scenario .* ncc\[preset=paper\] *$", done.stdout, re.MULTILINE), "the head of a table"
    assert re.search(r"^ ncc\[preset=paper\] +0\.\d", done.stdout, re.MULTILINE), "a row of the other"
    opened, compared, _ = done.stdout.splitlines()[-3:]
    assert opened == f"next: open {tmp_path / 'a'}/report.html"
    assert compared.startswith("      pftrack-sim compare ")
    assert "ncc[preset=paper]" in compared


@pytest.mark.slow
def test_a_search_reports_the_best_on_other_seeds(tmp_path: Path):
    command = ["bench", "corridor", "--trackers", "ko2012[particle_count=10],stay", *SMALL, *HERE]
    command += ["--search", "ko2012.sigma_centre=0.001,4", "--out", str(tmp_path / "a")]
    assert "must be none of the seeds of the report, got 1 in both" in refused(
        *command, "--seeds", "0:2", "--search-seeds", "1:3"
    )
    assert "needs --trackers, --search and --search-seeds" in refused(*command)
    assert not (tmp_path / "a").exists()
    done = succeeds(*command, "--seeds", "0:2", "--search-seeds", "5,6")
    found = re.search(r"^(ko2012\[\S+\]): the best of 2 on seeds 5,6, ", done.stdout, re.MULTILINE)
    assert found is not None
    searched, told = RunStore(tmp_path / "a-search"), RunStore(tmp_path / "a")
    assert {one.seed for one in searched.results} == {5, 6}
    assert {one.seed for one in told.results} == {0, 1}
    assert told.plan.labels == (found[1], "stay")
    means = {
        label: np.mean([one.number("mean_overlap") for one in searched.results if one.label == label])
        for label in searched.plan.labels
    }
    assert max(means, key=means.__getitem__) == found[1]


@pytest.mark.slow
def test_a_search_in_closed_loop_keeps_what_follows_for_longest(tmp_path: Path):
    command = ["follow", "corridor", "--trackers", "ko2012[particle_count=10]", *SMALL, *HERE]
    command += ["--search", "alpha=0.2,0.9", "--seeds", "0", "--search-seeds", "5", "--out", str(tmp_path / "a")]
    done = succeeds(*command)
    found = re.search(r"^(ko2012\[\S+\]): the best of 2 on seeds 5, follow_tracking_rate \d", done.stdout, re.MULTILINE)
    assert found is not None
    assert RunStore(tmp_path / "a").plan.labels == (f"{found[1]}+servo-avoid",)


@pytest.mark.parametrize("width", [60, 80, 200])
def test_tables_fit_into_the_terminal(width: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    monkeypatch.setattr(tables, "console", Console(width=width, markup=False, highlight=False))
    names = [f"tracker-{k}" for k in range(8)]
    rows = [["corridor", str(seed), *(f"0.{k}{seed}" for k in range(8))] for seed in range(2)]
    notes = {"Over": "words " * 30, "jerk": "no"}
    tables.print_tables(Table("Overlap", ["scenario"], ["seed", *names], rows, notes, keys=1))
    lines = [line.rstrip() for line in capsys.readouterr().out.splitlines()]
    assert max(map(len, lines)) <= width
    heads = [line.split() for line in lines if "scenario" in line]
    assert all(head[:2] == ["scenario", "seed"] for head in heads)
    assert [name for head in heads for name in head[2:]] == names
    assert (len(heads) == 1) == (width == 200)
    assert "Over: words words" in "\n".join(lines), "the note on a word that is there"
    assert not any("jerk" in line for line in lines), "the note on a column that is not"


def test_a_tracker_that_needs_what_is_not_there_says_so(tmp_path: Path):
    square, absent = str(sequence(tmp_path / "square")), str(tmp_path / "absent.onnx")
    for given, words in (
        (["opencv-nano"], "needs model files"),
        (["opencv-vit", "--param", f"opencv-vit.model={absent}"], absent),
        (["ko2021"], "did you mean 'ko2012'"),
        (["ko2012,stay", "--param", "ko2012.aplha=0.1"], "did you mean 'alpha'"),
        (["ko2012,stay", "--param", "alpha=0.1"], "stay: alpha: unknown key (value 0.1) (allowed: none)"),
        (["stay", "--video", f"{square}/groundtruth_rect.txt"], "--video is a .mp4 file, got 'groundtruth_rect.txt'"),
    ):
        assert words in refused("evaluate", square, "--tracker", *given)
        assert [one.name for one in tmp_path.iterdir()] == ["square"]


def test_render_writes_a_video_and_a_frame(tmp_path: Path):
    succeeds("render", "corridor", "--seed", "3", "--video", str(tmp_path / "a.mp4"), "--truth", *SMALL)
    assert (tmp_path / "a.mp4").stat().st_size > 1000
    succeeds("render", "corridor", "--image", str(tmp_path / "a.png"), "--at-s", "0.2", *SMALL)
    assert cv2.imread(str(tmp_path / "a.png")).shape == (72, 96, 3)
    seen = ("render", "corridor", "--at-s", "0.2", "--trackers", "ko2012", *SMALL)
    for name, extra in (("b.png", ()), ("c.png", ("--param", "particles=true"))):
        succeeds(*seen, "--image", str(tmp_path / name), *extra)
    plain, boxes, dots = (cv2.imread(str(tmp_path / name)).astype(int) for name in ("a.png", "b.png", "c.png"))
    assert (plain != boxes).any()
    assert 5 < (dots != boxes).any(axis=2).sum() < 1000


def test_profiles_over_an_axis_stand_beside_each_other():
    done = succeeds("profile", "easy/corridor", "--seeds", "0", "--axis", "jitter=0,4", *SMALL)
    assert "jitter=0" in done.stdout
    assert "jitter=4" in done.stdout
    beside, range_of_both = [line.split()[1:] for line in done.stdout.splitlines() if "camera_step_p95_per_s" in line]
    *_, still, shaken, _ = [float(word) for word in beside if word[0] not in "<>"]
    assert shaken > 3.0 * still
    assert [float(word) for word in range_of_both[2:4]] == [still, shaken]


def test_lists_and_schema():
    listed = pftrack_sim("list", "scenarios").stdout
    assert re.search(r"^easy/corridor +easy  Down a corridor", listed, re.MULTILINE)
    assert "ko2012" in pftrack_sim("list", "trackers").stdout
    assert "servo" in pftrack_sim("list", "controllers").stdout
    assert "jitter" in pftrack_sim("list", "axes").stdout
    assert '"fovy_deg"' in pftrack_sim("schema").stdout
    succeeds("doctor", "--check")


def test_names_are_listed_and_stored_runs_read_without_the_simulator():
    code = (
        "import sys, pftrack_sim.benchmark.reading.check\n"
        "from pftrack_sim.benchmark import RunStore\n"
        "from pftrack_sim.cli.app import app\n"
        "for what in 'scenarios suites trackers controllers axes'.split(): app(['list', what], standalone_mode=False)\n"
        "assert not {'mujoco', 'numba'} & set(sys.modules)\n"
    )
    printed(code)


@pytest.mark.slow
def test_the_doctor_times_what_works():
    doctor = succeeds("doctor")
    assert re.search(r"a frame of 320x240 with its truth takes \d+ ms", doctor.stdout)


FAILING = """
import os
import re
from pftrack_sim.core.records import Estimate
class Tracker:
    def init(self, image, box): self.box, self.frame = box, 0
    def update(self, image):
        self.frame += 1
        print("frame", self.frame)
        if self.frame == 3: FAULT
        return Estimate(self.box)
def make(**_): return Tracker()
"""


@pytest.mark.parametrize(("fault", "words"), [("raise ValueError('no')", "ValueError: no"), ("os.abort()", "SIGABRT")])
def test_a_failing_tracker_is_named_and_the_exit_code_is_1(fault: str, words: str, tmp_path: Path):
    (tmp_path / "failing_tracker.py").write_text(FAILING.replace("FAULT", fault))
    done = pftrack_sim(
        "render", "plaza-walk", "--image", "a.png", "--at-s", "0.4", "--tracker", "failing_tracker:make", *SMALL,
        cwd=tmp_path,
    )  # fmt: skip
    assert done.returncode == 1
    assert "failing_tracker:make ended with an error, frame 3" in done.stdout
    assert words in done.stdout
    assert (tmp_path / "a.png").is_file()
    recorded = pftrack_sim(
        "evaluate", str(sequence(tmp_path / "seq")), "--tracker", "failing_tracker:make,stay", "--seeds", "0",
        cwd=tmp_path,
    )  # fmt: skip
    assert recorded.returncode == 1
    assert words in recorded.stdout
    assert "It printed:\nframe 1\nframe 2\nframe 3\n" in recorded.stdout
    assert "stay" in recorded.stdout


def test_a_second_value_for_an_option_that_takes_one_is_refused():
    said = refused("bench", "corridor", "--trackers", "stay", "--tracker", "ncc", "--seeds", "0")
    assert said == "pftrack-sim: --trackers is given 2 times (allowed: once)\n"


def test_the_version_help_and_the_module_as_a_command():
    assert pftrack_sim("--version").stdout.startswith("pftrack-sim 0.")
    assert pftrack_sim("-h").stdout == pftrack_sim("--help").stdout
    assert "..." not in pftrack_sim("-h").stdout.partition("Commands:")[2]
    module = subprocess.run([sys.executable, "-m", "pftrack_sim", "--version"], capture_output=True, text=True)
    assert module.stdout == pftrack_sim("--version").stdout


def test_broken_sequences_give_one_clear_line(tmp_path: Path):
    empty = tmp_path / "empty"
    empty.mkdir()
    broken = sequence(tmp_path / "broken")
    (broken / "img/0006.png").write_bytes(b"no image")
    words = sequence(tmp_path / "words")
    (words / "groundtruth_rect.txt").write_text("1,2,3,four\n")
    for folder in (empty, broken, words):
        said = refused("evaluate", "--tracker", "stay", str(folder))
        assert str(folder) in said
        assert len(said.strip().splitlines()) == 1
