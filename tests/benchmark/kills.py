"""Kill a run at random moments, resume it, and compare it with an undisturbed one."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

from pftrack_sim.benchmark.reading.check import check
from tests.benchmark.small import SMALL, contents, settings


def command(out: Path, episodes: int) -> list[str]:
    code = "import sys; from pftrack_sim.cli import main; sys.argv[0] = 'pftrack-sim'; main()"
    words = f"bench corridor --trackers oracle,ko2012 --seeds 0:{episodes} --videos none --isolation always --workers 2"
    return [sys.executable, "-c", code, *words.split(), "--progress", "quiet", "--out", str(out), *settings(SMALL)]


def survive(folder: Path, *, kills: int, episodes: int, seed: int) -> None:
    """Assert that a run that is killed repeatedly ends like an undisturbed one, and leaves no temporary file.

    Args:
        folder: Empty folder to work in.
        kills: How often; by turns the parent and one of its workers.
        episodes: Length of the run.
        seed: Of the moments.
    """
    rng = random.Random(seed)
    temporary = folder / "temporary"
    temporary.mkdir()
    environment = {**os.environ, "TMPDIR": str(temporary)}
    began = time.monotonic()
    subprocess.run(command(folder / "undisturbed", episodes), check=True, capture_output=True, env=environment)
    whole_s = time.monotonic() - began
    done = 0
    round_ = 0
    while done < kills:
        out = folder / f"killed-{round_}"
        round_ += 1
        finished = False
        while done < kills and not finished:
            after_s, whole = rng.uniform(0.1, 0.9) * whole_s, done % 2 == 0
            finished, killed = _disturb(command(out, episodes), environment, after_s, whole, rng)
            done += killed
        subprocess.run(command(out, episodes), check=True, capture_output=True, env=environment)
        assert contents(out) == contents(folder / "undisturbed")
        assert check(out).good
        assert not [*out.rglob(".*.part"), *out.glob(".scratch/*"), *temporary.iterdir()]


def _disturb(
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
