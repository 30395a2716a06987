"""What the benchmark's machinery costs, as ratios.

    episodes per minute with 2 workers / with 1                         wanted >= 1.8 on 2 quiet cores
    eight trackers on one scenario / (one drawing + their own times)    wanted <= 1.1
    a process of its own for a tracker: ms per frame on top of its own time, and ms to begin
    frames per second of one worker, bytes per frame of a run folder    for docs/cluster.md

Rounds are interleaved, so that a noisy machine disturbs both sides alike. `--kills 20` instead kills a run, parent and
workers by turns, at that many random moments, and compares what it leaves with an undisturbed one.
"""

from __future__ import annotations

import importlib
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from pftrack_sim import trackers
from pftrack_sim.benchmark import TrackerSpec, make_plan, run
from pftrack_sim.benchmark.running.episode import EpisodeFiles, EpisodeJob, run_episode
from pftrack_sim.benchmark.running.progress import RunProgress
from pftrack_sim.simulation.simulation import Simulation
from pftrack_sim.trackers.isolation import IsolatedTracker, Limits, TrackerCode

SIZE: dict[str, Any] = {"camera.width_px": 320, "camera.height_px": 240, "lights.shadows": False}
EIGHT = [
    *(TrackerSpec(name="ko2012", params={"particle_count": count}) for count in (25, 50, 75, 100)),
    *(TrackerSpec(name=name) for name in ("ko2012", "stay", "oracle", "opencv-mil")),
]
LIMITS = Limits()


def workers(folder: Path, rounds: int = 2) -> float:
    """Episodes per minute with 2 workers over those with 1, both already started as far as the clock goes."""
    plan = make_plan(["corridor"], ["ko2012"], list(range(8)), overrides={**SIZE, "duration_s": 2})
    taken: dict[int, list[float]] = {1: [], 2: []}
    for number in range(rounds):
        for count in (1, 2):
            began: list[float] = []

            def first(status: Any, began: list[float] = began) -> None:
                # From the first finished episode on: starting Python is paid once, whatever the plan's length.
                if status.episode:
                    began.append(time.perf_counter())

            run(plan, folder / f"{number}-{count}", workers=count, videos="none", on_progress=first)
            taken[count].append((began[-1] - began[0]) / (len(began) - count))
    return median(taken[1]) / median(taken[2])


def eight() -> tuple[float, float]:
    """Cost of eight trackers over one drawing and the sum of their own times: in this process, and in their own.

    All three are clocked within the same episode, so that a noisy machine disturbs them alike.
    """
    plan = make_plan(["corridor"], EIGHT, [1], overrides={**SIZE, "duration_s": 3})
    episode = plan.episode(0)
    ratios: dict[str, list[float]] = {"never": [], "always": []}
    for _ in range(3):
        for isolation, found in ratios.items():
            with _clocked_drawing() as drawn_s:
                began = time.perf_counter()
                outcome = run_episode(EpisodeJob(episode, isolation=isolation))
                whole = time.perf_counter() - began
            found.append(whole / (sum(drawn_s) + _own_times(outcome.contents)))
    return median(ratios["never"]), median(ratios["always"])


@contextmanager
def _clocked_drawing() -> Iterator[list[float]]:
    """Seconds of every reset and advance of a simulation in the block."""
    taken: list[float] = []

    def clocked(method: Callable[..., Any]) -> Callable[..., Any]:
        def timed(*arguments: Any) -> Any:
            began = time.perf_counter()
            try:
                return method(*arguments)
            finally:
                taken.append(time.perf_counter() - began)

        return timed

    real = Simulation.reset, Simulation.advance
    Simulation.reset, Simulation.advance = clocked(real[0]), clocked(real[1])
    try:
        yield taken
    finally:
        Simulation.reset, Simulation.advance = real


def _own_times(contents: Mapping[str, bytes]) -> float:
    """Seconds that all trackers of an episode took themselves."""
    import duckdb

    with tempfile.TemporaryDirectory() as folder, duckdb.connect() as database:
        for place, (name, table) in enumerate(contents.items()):
            if name.startswith("episodes/"):
                Path(folder, f"{place}.parquet").write_bytes(table)
        (row,) = database.execute(f"SELECT sum(ms) FROM '{folder}/*.parquet'").fetchall()
        return float(row[0]) / 1e3


def isolation() -> tuple[float, float]:
    """Extra ms per 640x480 frame, and ms to begin, of a process of its own."""
    import numpy as np

    rng = np.random.default_rng(0)
    image = rng.integers(0, 255, (480, 640, 3), dtype=np.uint8)
    begun, extra = [], []
    for _ in range(8):
        start = time.perf_counter()
        tracker = IsolatedTracker(TrackerCode("stay", limits=LIMITS), seed=0)
        tracker.wait_until_made()
        begun.append(time.perf_counter() - start)
        tracker.init(image, np.array([10.0, 10, 50, 90]))
        for _ in range(20):
            start = time.perf_counter()
            tracker.update(image)
            extra.append((time.perf_counter() - start) * 1e3 - tracker.reported_ms)
        tracker.close()
    return median(extra), median(begun[1:]) * 1e3


class Canned:
    """A pool that plays one episode and gives its outcome for all: what is left is the parent's own work."""

    frames_done: None = None

    def run_all(self, jobs: Iterator[EpisodeJob]) -> Iterator[EpisodeFiles]:
        """See `Executor`."""
        outcome = None
        for job in jobs:
            outcome = outcome or run_episode(job)
            yield outcome

    def close(self) -> None:
        """See `Executor`."""


def parent(folder: Path, episodes: int = 1000) -> None:
    """Seconds until the first frame is drawn, memory that the parent takes on, and ms per episode in it."""
    overrides = {**SIZE, "camera.rate_hz": 10, "duration_s": 0.4}
    began = time.perf_counter()
    seen: list[tuple[float, int]] = []

    def remember(status: RunProgress) -> None:
        with open("/proc/self/statm", encoding="ascii") as statm:
            seen.append((time.perf_counter(), int(statm.read().split()[1]) * 4096))

    engine = importlib.import_module("pftrack_sim.benchmark.running.run")
    real, engine.make_executor = engine.make_executor, lambda *_: Canned()
    plan = make_plan(["corridor"], ["stay", "oracle"], list(range(episodes)), overrides=overrides)
    run(plan, folder / "parent", videos="none", on_progress=remember)
    engine.make_executor = real
    after, done = seen[1], seen[-1]
    grown_mb = (seen[-1][1] - seen[len(seen) // 10][1]) / 2**20
    print(
        f"{episodes} episodes: first one finished after {after[0] - began:.1f} s; the parent grew by {grown_mb:.1f} MB "
        f"over the last nine tenths, and takes {(done[0] - after[0]) / episodes * 1e3:.1f} ms for an episode"
    )


def throughput(folder: Path) -> None:
    """Frames per second of one worker and bytes per frame of its files, for sizes of image."""
    print(f"{'size':>9} {'frames/s':>9} {'reset s':>8} {'bytes/frame':>12} {'a tracker':>10} {'of video':>9}")
    for width, height in ((320, 240), (640, 480)):
        settings = {"camera.width_px": width, "camera.height_px": height, "duration_s": 8}
        plan = make_plan(["plaza-walk"], ["ko2012", "stay"], [0], overrides=settings)
        episode = plan.episode(0)
        with Simulation(episode.scenario) as simulation:
            began = time.perf_counter()
            simulation.reset(0)
            reset_s = time.perf_counter() - began
            began = time.perf_counter()
            for _ in range(60):
                simulation.advance()
            rate = 60 / (time.perf_counter() - began)
        done = run(plan, folder / f"{width}", videos="all")
        sizes = {name: sum(file.stat().st_size for file in (done.path / name).rglob("*.parquet"))
                 for name in ("frames", "episodes")}  # fmt: skip
        video = sum(file.stat().st_size for file in (done.path / "videos").rglob("*.mp4")) / plan.frame_count
        frame, result = sizes["frames"] / plan.frame_count, sizes["episodes"] / plan.frame_count / 2
        print(f"{width:>5}x{height:<3} {rate:>9.1f} {reset_s:>8.2f} {frame:>12.0f} {result:>10.0f} {video:>9.0f}")


def main() -> None:
    """Print the figures."""
    trackers.make("ko2012")  # numba compiles before anything is timed
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if "--kills" in sys.argv:
            from tests.benchmark.kills import survive

            kills = int(sys.argv[sys.argv.index("--kills") + 1])
            survive(folder, kills=kills, episodes=8, seed=0)
            print(f"{kills} kills at random moments: every episode once, the same bits as undisturbed")
            return
        here, apart = eight()
        print(f"eight trackers / (drawing + own times): {here:.2f} in one process, {apart:.2f} in their own")
        extra_ms, begin_ms = isolation()
        print(f"a process of its own: {extra_ms:.2f} ms per 640x480 frame, {begin_ms:.0f} ms to begin")
        parent(folder)
        throughput(folder)
        print(f"2 workers / 1 worker, episodes per minute: {workers(folder):.2f}")


if __name__ == "__main__":
    main()
