"""Run a plan: every episode that is not there yet, on whatever workers there are, into a run folder."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from itertools import islice
from pathlib import Path

from pftrack_sim.benchmark.cluster import DaskWorkers
from pftrack_sim.benchmark.episode import EpisodeJob
from pftrack_sim.benchmark.executor import Done, LocalWorkers, Pool, ThisProcess
from pftrack_sim.benchmark.folder import RunFolder
from pftrack_sim.benchmark.naming import slug
from pftrack_sim.benchmark.plan import Episode, Plan
from pftrack_sim.benchmark.progress import Standing, Status
from pftrack_sim.benchmark.reading import Run
from pftrack_sim.benchmark.tables import write_results
from pftrack_sim.benchmark.tracker_runner import check_trackers, checked_isolation
from pftrack_sim.core.errors import ParameterError, RunError
from pftrack_sim.simulation.simulation import Simulation
from pftrack_sim.trackers.isolation import Limits

VIDEOS = ("first", "all", "none")


class Interrupted(RunError):
    """The run was stopped by hand; what is finished stays."""


def new_run_path(plan: Plan) -> Path:
    """A run folder's name that is not taken: `runs/<time>-<first scenario>`."""
    stem = f"{datetime.now(UTC):%Y%m%dT%H%M%S}-{slug(plan.batches[0].scenarios[0].name)}"
    taken = 0
    while (path := Path("runs") / (stem if not taken else f"{stem}-{taken}")).exists():
        taken += 1
    return path


def run(
    plan: Plan,
    path: Path,
    *,
    workers: int = 0,
    scheduler: str | None = None,
    videos: str = "first",
    backend: str | None = None,
    isolation: str = "auto",
    limits: Limits | None = None,
    part: tuple[int, int] = (1, 1),
    shuffle: int | None = None,
    on_status: Callable[[Status], None] = lambda _: None,
) -> Run:
    """Run a plan, or what is left of it.

    Args:
        plan: What to run.
        path: Run folder: absent, empty, or begun with the same plan. Finished episodes in it are not run again.
        workers: Local processes; 0 runs everything in this one.
        scheduler: Address of a Dask scheduler to use instead.
        videos: `"first"`: of the first seed of each scenario and condition; `"all"`; or `"none"`.
        backend: Renderer, by name.
        isolation: Which trackers get a process of their own: `"auto"` (those of strangers), `"always"` or `"never"`.
        limits: What those may take.
        part: Part k of n: only every n-th episode, from the k-th (1 is the first); other machines do the others.
        shuffle: A seed to shuffle the order of the episodes with.
        on_status: Called after every episode and a few times a second.

    Returns:
        The run folder, to read.

    Raises:
        UnknownNameError: An unknown tracker.
        ParameterError: An option that is not allowed.
        RunError: The folder holds something else or cannot be written; an episode could not be run.
        Interrupted: Ctrl-C.
        RenderError: Nothing can draw.
    """
    _check(videos, workers, part)
    isolated = checked_isolation(isolation)
    limits = limits or Limits()
    # Mistakes in names or presets are told before anything is written.
    check_trackers(plan.trackers, isolated, limits)
    Simulation(next(plan.episodes()).scenario, backend=backend)
    pool = _pool(plan, workers, scheduler)
    problems: list[str] = []
    with contextlib.closing(pool), contextlib.closing(_Held(path, plan)) as held:
        standing = Standing(plan, path, part)
        on_status(standing.status(0))

        def job(episode: Episode) -> EpisodeJob:
            film = videos == "all" or (videos == "first" and episode.leads)
            return EpisodeJob(episode, episode.trackers, film, backend, isolated, limits)

        missing = (one for one in _share(plan, part, shuffle) if not held.folder.has(one))
        try:
            for done in pool.play_all(map(job, missing)):
                if done is not None:
                    _take(held.folder, standing, problems, done)
                on_status(standing.status(pool.frames_drawn))
        except KeyboardInterrupt:
            raise Interrupted(f"stopped; {standing.told()}") from None
        except RunError as error:
            raise RunError(f"{error}\n{standing.told()}; the same command goes on from there") from None
        if problems:
            told = "\n".join(f"  {line}" for line in problems)
            raise RunError(f"{len(problems)} of the episodes could not be run; {standing.told()}\n{told}")
        held.finished = standing.done == plan.episode_count
        write_results(path, plan)
    return Run(path)


class _Held:
    """The folder, given back when the block ends, however it ends."""

    def __init__(self, path: Path, plan: Plan) -> None:
        self.folder = RunFolder(path, plan)
        self.finished = False

    def close(self) -> None:
        if self.finished:
            self.folder.close(finished=True)
        else:
            self.folder.release()


def _take(folder: RunFolder, standing: Standing, problems: list[str], done: Done) -> None:
    if done.outcome is None:
        problems.append(str(done.problem))
        return
    folder.add(done.job.episode, done.outcome.table, done.outcome.video)
    standing.add(done.job.episode, done.outcome)


def _share(plan: Plan, part: tuple[int, int], shuffle: int | None) -> Iterator[Episode]:
    return islice(plan.episodes(shuffle=shuffle), part[0] - 1, None, part[1])


def _pool(plan: Plan, workers: int, scheduler: str | None) -> Pool:
    if scheduler is not None:
        return DaskWorkers(scheduler)
    return LocalWorkers(min(workers, plan.episode_count)) if workers else ThisProcess()


def _check(videos: str, workers: int, part: tuple[int, int]) -> None:
    if videos not in VIDEOS:
        raise ParameterError(f"videos must be one of {', '.join(VIDEOS)}, got {videos!r}")
    if workers < 0:
        raise ParameterError(f"workers must be >= 0, got {workers}")
    if not 1 <= part[0] <= part[1]:
        raise ParameterError(f"part must be K/N with 1 <= K <= N, got {part[0]}/{part[1]}")
