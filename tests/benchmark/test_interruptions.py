"""An interrupted run loses no finished episode and counts no unfinished one."""

import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from pftrack_sim.benchmark import run
from pftrack_sim.benchmark.datasets.export import export
from pftrack_sim.benchmark.datasets.results import export_results
from pftrack_sim.benchmark.reading.check import check
from pftrack_sim.benchmark.running.progress import RunProgress
from pftrack_sim.core.errors import RunError
from pftrack_sim.formats.results import RESULT_FORMATS
from tests.benchmark.small import SMALL, contents, settings, small_plan

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="kills processes and fills disks the Linux way")


KILLS = int(os.environ.get("PFTRACK_SIM_KILLS", "2"))


def command(out: Path, episodes: int) -> list[str]:
    code = "import sys; from pftrack_sim.cli import main; sys.argv[0] = 'pftrack-sim'; main()"
    words = f"bench corridor --trackers oracle,ko2012 --seeds 0:{episodes} --videos none --isolation always --workers 2"
    return [sys.executable, "-c", code, *words.split(), "--progress", "quiet", "--out", str(out), *settings(SMALL)]


def disturb(
    words: list[str], environment: dict[str, str], after_s: float, whole: bool, rng: random.Random
) -> tuple[bool, bool]:
    """Start a run and kill it, or one of its workers, later; return whether it finished and whether it was killed."""
    run = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, env=environment)
    time.sleep(after_s)
    hit = False
    if run.poll() is None:
        victims = [run.pid] if whole else children(run.pid)
        if victims:
            os.kill(rng.choice(victims), signal.SIGKILL)
            hit = True
    _, said = run.communicate(timeout=300)
    assert run.returncode in (0, -signal.SIGKILL), said.decode()
    return run.returncode == 0, hit


def children(pid: int) -> list[int]:
    """Worker processes of a run, from `/proc`, without the resource tracker."""
    found: list[int] = []
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        try:
            parent = int((entry / "stat").read_text().rsplit(")", 1)[1].split()[1])
            words = (entry / "cmdline").read_bytes()
        except OSError:
            continue
        if parent == pid and b"spawn_main" in words:
            found.append(int(entry.name))
    return found


@pytest.mark.slow
def test_killed_at_random_moments(tmp_path: Path):
    """By turns the parent and a worker: the run ends like an undisturbed one, and leaves no temporary file."""
    rng, episodes = random.Random(1), 4
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    environment = {**os.environ, "TMPDIR": str(temporary)}
    began = time.monotonic()
    subprocess.run(command(tmp_path / "undisturbed", episodes), check=True, capture_output=True, env=environment)
    whole_s = time.monotonic() - began
    done = 0
    round_ = 0
    while done < KILLS:
        out = tmp_path / f"killed-{round_}"
        round_ += 1
        finished = False
        while done < KILLS and not finished:
            after_s, whole = rng.uniform(0.1, 0.9) * whole_s, done % 2 == 0
            began = time.monotonic()
            finished, killed = disturb(command(out, episodes), environment, after_s, whole, rng)
            done += killed
            if not killed:  # it ended before: the first run took longer than those that find its compiled code
                whole_s = min(whole_s, time.monotonic() - began)
        subprocess.run(command(out, episodes), check=True, capture_output=True, env=environment)
        assert contents(out) == contents(tmp_path / "undisturbed")
        assert check(out).good
        assert not [*out.rglob(".*.part"), *out.glob(".scratch/*"), *temporary.iterdir()]


@pytest.mark.slow
@pytest.mark.parametrize("imported_s", [0.0, 0.2, 0.6])
def test_ctrl_c_while_workers_start_ends_at_once(tmp_path: Path, imported_s: float):
    begun = subprocess.Popen(command(tmp_path / "run", 4), stderr=subprocess.PIPE, start_new_session=True)
    while not (started := children(begun.pid)) and begun.poll() is None:
        time.sleep(0.01)
    time.sleep(imported_s)
    # A terminal sends it to the whole group.
    os.killpg(begun.pid, signal.SIGINT)
    _, said = begun.communicate(timeout=60)
    assert begun.returncode == 130, said.decode()
    assert "Traceback" not in said.decode()
    assert not [pid for pid in started if b"spawn_main" in _command_line(pid)]


def _command_line(pid: int) -> bytes:
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return b""


@pytest.mark.slow
def test_ctrl_c_prints_the_command_to_resume(tmp_path: Path):
    words = command(tmp_path / "run", 40)
    words[words.index("quiet")] = "json"
    begun = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True)
    assert begun.stderr is not None
    first = begun.stderr.readline().decode()
    while first.startswith("pftrack-sim: warning:"):  # what the short episode leaves out
        first = begun.stderr.readline().decode()
    assert '"done": 1, "total": 40' in first, first
    os.killpg(begun.pid, signal.SIGINT)
    _, said = begun.communicate(timeout=60)
    last = said.decode().strip().splitlines()[-1]
    assert begun.returncode == 130
    assert "of 40 episodes are finished. Resume with: pftrack-sim bench corridor" in last
    assert "Traceback" not in said.decode()
    assert not check(tmp_path / "run").good
    assert not [one for one in check(tmp_path / "run").problems if not one.startswith("missing")]


@pytest.fixture
def little_disk(tmp_path: Path) -> Iterator[Path]:
    place = tmp_path / "disk"
    place.mkdir()
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "none", str(place)], capture_output=True)
    if mounted.returncode:
        pytest.skip("only root can make a small disk")
    yield place
    subprocess.run(["umount", "-l", str(place)], check=True)


@pytest.mark.slow
def test_a_full_disk_loses_no_finished_episode(little_disk: Path, tmp_path: Path):
    plan = small_plan(range(8), ["oracle", "stay"])
    with pytest.raises(RunError, match="No space left on device") as caught:
        run(plan, little_disk / "run", videos="none")
    assert "of 8 episodes are finished; the same command resumes it" in str(caught.value)
    missing = check(little_disk / "run").problems
    assert 0 < len(missing) < 8
    assert all(one.startswith("missing") for one in missing)
    assert not list(little_disk.rglob(".*.part"))
    subprocess.run(["mount", "-o", "remount,size=4m", str(little_disk)], check=True)
    run(plan, little_disk / "run", videos="none")
    assert check(little_disk / "run").good
    assert contents(little_disk / "run") == contents(run(plan, tmp_path / "whole", videos="none").path)


@pytest.mark.slow
@pytest.mark.parametrize("size", ["120k", "400k"])
def test_a_disk_that_fills_while_filming_is_one_error_and_free_afterwards(little_disk: Path, size: str):
    subprocess.run(["mount", "-o", f"remount,size={size}", str(little_disk)], check=True)
    big = {"camera.width_px": 320, "camera.height_px": 240, "duration_s": 2.0}
    plan = small_plan(range(8), ["oracle", "stay"], **big)
    with pytest.raises(RunError, match=r"No space left|cannot write|cannot make"):
        run(plan, little_disk / "run", videos="all")
    assert not list(little_disk.rglob("*.part"))
    assert not list(little_disk.rglob("pftrack-sim-*"))
    assert all(one.startswith("missing") for one in check(little_disk / "run").problems)


@pytest.mark.slow
def test_a_report_for_which_there_is_no_space_is_one_error(little_disk: Path):
    from pftrack_sim.report import write_report

    subprocess.run(["mount", "-o", "remount,size=1m", str(little_disk)], check=True)
    run(small_plan(range(1), ["stay"]), little_disk / "run", videos="none")
    with pytest.raises(RunError, match="No space left on device"):
        write_report(little_disk / "run")
    assert not list(little_disk.rglob("*.part"))
    assert check(little_disk / "run").good


@pytest.mark.slow
def test_results_for_which_there_is_no_space_are_one_error_and_no_half_file(little_disk: Path, tmp_path: Path):
    finished = run(small_plan(range(10), ["oracle", "stay"]), tmp_path / "run", videos="none")
    for form in RESULT_FORMATS:
        with pytest.raises(RunError, match=r"cannot write .*: No space left on device"):
            export_results(finished, little_disk / form, form)
        assert not list(little_disk.rglob("*.part"))
        whole = export_results(finished, tmp_path / form, form)
        written = [path.relative_to(little_disk) for path in little_disk.rglob("*") if path.is_file()]
        assert 0 < len(written) < len(whole)
        for path in written:
            assert (little_disk / path).read_bytes() == (tmp_path / path).read_bytes()
        shutil.rmtree(little_disk / form)


@pytest.mark.slow
@pytest.mark.parametrize(("layout", "image"), [("mot", "png"), ("mot", "mp4"), ("webdataset", "png")])
def test_a_sequence_for_which_there_is_no_space_is_not_there(
    little_disk: Path, tmp_path: Path, layout: str, image: str
):
    size = {"camera.width_px": 320, "camera.height_px": 240, "duration_s": 1.0}
    plan, out = small_plan(range(2), ["stay"], **size), little_disk / "out"
    with pytest.raises(RunError, match=r"cannot write .*: No space left on device"):
        export(plan, out, layout, image=image, quality=0 if image == "mp4" else None)
    assert [path.name for path in little_disk.rglob("*") if path.is_file()] == ["dataset.json"]
    subprocess.run(["mount", "-o", "remount,size=64m", str(little_disk)], check=True)
    export(plan, out, layout, image=image, quality=0 if image == "mp4" else None)
    assert len(list(little_disk.rglob("truth.parquet"))) == 2


def test_a_file_size_limit_loses_no_finished_episode(tmp_path: Path):
    plan = small_plan(range(3), ["oracle"])
    before = resource.getrlimit(resource.RLIMIT_FSIZE)

    def limit(status: RunProgress) -> None:
        if status.done == 1:
            resource.setrlimit(resource.RLIMIT_FSIZE, (1000, before[1]))

    try:
        with pytest.raises(RunError, match="cannot write"):
            run(plan, tmp_path / "run", videos="none", on_progress=limit)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert check(tmp_path / "run").problems == ("missing: corridor seed 1", "missing: corridor seed 2")
    run(plan, tmp_path / "run", videos="none")
    assert check(tmp_path / "run").good


def test_the_work_before_the_first_frame_does_not_grow_with_the_plan(tmp_path: Path):
    """No work is done for every episode before the first frame: counted in calls, not in seconds."""
    plan = small_plan(range(1000), ["oracle"])
    resolved: list[int] = []
    scenario = plan.episode(0).scenario
    original = type(scenario).resolve

    def counted(self: object, seed: int) -> object:
        resolved.append(seed)
        return original(self, seed)  # pyright: ignore[reportArgumentType]

    class Enough(Exception):
        pass

    def stop(status: RunProgress) -> None:
        if status.frames:
            raise Enough

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(type(scenario), "resolve", counted)
        with pytest.raises(Enough):
            run(plan, tmp_path / "run", videos="none", on_progress=stop)
    assert len(resolved) < 10
