"""Run a plan: every episode that is missing in the run folder, on local processes or a cluster."""

from __future__ import annotations

import contextlib
import re
import signal
import threading
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

from pftrack_sim import trackers
from pftrack_sim.benchmark.asked.plan import AskedResult, Episode, Plan, TrackerSpec
from pftrack_sim.benchmark.kept.folder import SCRATCH
from pftrack_sim.benchmark.keys import slug
from pftrack_sim.benchmark.reading.store import RunStore
from pftrack_sim.benchmark.running.episode import WITHOUT_IMAGES, EpisodeFiles, EpisodeJob
from pftrack_sim.benchmark.running.executor import DaskExecutor, Executor, LocalExecutor, SerialExecutor
from pftrack_sim.benchmark.running.filming import film, worst
from pftrack_sim.benchmark.running.frame_cache import FrameCache
from pftrack_sim.benchmark.running.progress import ProgressCounter, RunProgress
from pftrack_sim.benchmark.running.tracker_runner import check_trackers, checked_isolation
from pftrack_sim.core.arguments import checked
from pftrack_sim.core.errors import ParameterError, RunError
from pftrack_sim.logs import FORMATS, check_formats
from pftrack_sim.simulation.simulation import Simulation
from pftrack_sim.trackers.isolation import Limits, TrackerProcesses

VIDEOS = ("first", "all", "none")
MAX_ERROR_FILES = 200  # Pictures and texts of errors that a session keeps


class Interrupted(RunError):
    """The run was interrupted; finished episodes stay."""


def new_run_path(plan: Plan) -> Path:
    """An unused name of a run folder: `runs/<time>-<first scenario>`."""
    stem = f"{datetime.now(UTC):%Y%m%dT%H%M%S}-{slug(plan.sweeps[0].scenarios[0].name)}"
    taken = 0
    while (path := Path("runs") / (stem if not taken else f"{stem}-{taken}")).exists():
        taken += 1
    return path


@checked
def run(
    plan: Plan,
    path: Path,
    *,
    workers: int = 0,
    scheduler: str | None = None,
    videos: str = "first",
    logs: Sequence[str] = (),
    backend: str | None = None,
    isolation: str = "auto",
    limits: Limits | None = None,
    part: tuple[int, int] = (1, 1),
    shuffle: int | None = None,
    refresh: bool = False,
    stop_on_error: bool = False,
    cache: FrameCache | None = None,
    more: Callable[[RunStore], Plan | None] = lambda _: None,
    on_progress: Callable[[RunProgress], None] = lambda _: None,
) -> RunStore:
    """Run a plan, or what is missing of it.

    Args:
        plan: What to run.
        path: Absent, empty, or a run folder. What this plan adds to it is run: seeds, conditions, scenarios, and
            trackers, which run alone in the episodes that are there.
        workers: Local processes; 0 runs everything in this one.
        scheduler: Address of a Dask scheduler to use instead.
        videos: `"first"`: of the first seed of each scenario and condition; `"all"`; `"none"`; or `"worst:5"`: of the
            five worst episodes of each tracker.
        logs: Formats of logs to write of the first seed of each scenario and condition, with `videos="all"` of all.
        backend: Renderer, by name; `"none"` drives without images or videos, for trackers that read none.
        isolation: Which trackers run in a process of their own: `"auto"` (third-party), `"always"`, `"never"`,
            or `"container"` (third-party, in a sandbox).
        limits: Limits of those.
        part: Part k of n: only a random sample, one n-th of the episodes; other machines run the others.
        shuffle: A seed to shuffle the order of the episodes with.
        refresh: Run results again that are in the folder under the same name with another key: with other code, other
            versions of packages, or another scenario.
        stop_on_error: End the run, unfinished, after the first episode in which a tracker ends with an error.
        cache: Where rendered frames of open loops are kept and taken from; None: nowhere.
        more: Called when all that is asked for is there: what to run besides, or None.
        on_progress: Called after every episode and a few times a second.

    Returns:
        The run folder, to read.

    Raises:
        UnknownNameError: An unknown tracker.
        ParameterError: An option that is not allowed.
        RunError: The folder holds something else, an episode that was run without its logs, or cannot be written; an
            episode could not be run.
        Interrupted: Ctrl-C.
        RenderError: No renderer works.
    """
    worst_count = _worst_count(videos)
    if workers < 0:
        raise ParameterError(f"workers must be >= 0, got {workers}")
    if not 1 <= part[0] <= part[1]:
        raise ParameterError(f"part must be K/N with 1 <= K <= N, got {part[0]}/{part[1]}")
    check_formats(logs)

    def logged(episode: Episode) -> bool:
        return bool(logs) and (episode.is_first_seed or videos == "all")

    _check_logs(path, (one for one in plan.asked.values() if logged(one.episode)), logs)
    isolated, limits = checked_isolation(isolation), limits or Limits()
    # Wrong names and presets are reported before anything is written.
    processes = TrackerProcesses()
    with contextlib.ExitStack() as ended:
        ended.callback(processes.close)
        check_trackers(plan.trackers, isolated, limits, processes)
        if backend == WITHOUT_IMAGES:
            _check_without_images(plan, videos, logs)
            videos = "none"
        else:
            Simulation(plan.episode(0).scenario, backend=backend)
        if not workers and scheduler is None:
            ended.pop_all()  # this process runs the episodes too, with what is loaded here

    def filmed(episode: Episode) -> bool:
        return videos == "all" or (videos == "first" and episode.is_first_seed)

    def jobs() -> Iterator[EpisodeJob]:
        lacking: dict[int, list[TrackerSpec]] = {}
        for one in store.missing:
            lacking.setdefault(one.episode.number, []).append(one.tracker)
        for episode in plan.episodes(part=part, shuffle=shuffle):
            specs = tuple(lacking.get(episode.number, ()))
            # Trackers that are added to an episode are filmed with the others, afterwards.
            whole = specs == episode.trackers
            if specs:
                yield EpisodeJob(
                    replace(episode, trackers=specs),
                    whole and filmed(episode),
                    backend,
                    isolated,
                    limits,
                    logs=tuple(logs) if whole and logged(episode) else (),
                    scratch=path.resolve() / SCRATCH,
                    labels=plan.labels,
                    cache=cache,
                )

    def finished() -> Iterator[EpisodeFiles | None]:
        nonlocal plan
        yield from executor.run_all(jobs())
        while not problems and (added := more(store)) is not None:
            store.ask(added)
            plan = store.plan
            counter.total = len(plan.episodes(part=part))
            yield from executor.run_all(jobs())

    with (
        contextlib.closing(make_executor(plan, workers, scheduler, processes)) as executor,
        RunStore.begin(path, plan, refresh=refresh, running=True) as store,
    ):
        plan = store.plan
        counter = ProgressCounter(store, part)
        on_progress(counter.progress(0))
        problems: list[str] = []
        errors = 0
        try:
            with _deferred_interrupt(not isinstance(executor, SerialExecutor)) as interrupted:
                for files in finished():
                    if files is not None and files.problem is not None:
                        problems.append(f"  {files.problem}")
                    elif files is not None:
                        errors += sum(row["error"] is not None for row in files.rows)
                        shown = errors <= MAX_ERROR_FILES
                        contents = files.contents.items()
                        store.add({name: one for name, one in contents if shown or not name.startswith("errors/")})
                        counter.add(files)
                        if stop_on_error and errors:
                            break
                    on_progress(counter.progress(executor.frames_done))
                    if interrupted():
                        raise KeyboardInterrupt
        except KeyboardInterrupt:
            raise Interrupted(f"stopped; {counter}") from None
        except RunError as error:
            raise RunError(f"{error}\n{counter}; the same command resumes it") from None
        if problems:
            raise RunError(
                "\n".join([f"{len(problems)} of the episodes could not be run; {counter}", *dict.fromkeys(problems)])
            )
        store.write_summary()
        if videos != "none":
            every = [one for one in store.results if worst_count or filmed(store.episode_of(one))]
            chosen = worst(every, worst_count) if worst_count else every
            if any(store.video_of(one) is None for one in chosen):
                film(store, chosen, backend=backend)
                store.write_summary()
    return RunStore(path)


def _check_logs(path: Path, asked: Iterable[AskedResult], logs: Sequence[str]) -> None:
    """Raise `RunError` for episodes that have been run without their logs, which are written while one runs."""
    for one in asked:
        names = [f"logs/{one.episode.path}{FORMATS[name].suffix}" for name in logs]
        lacking = [name for name in names if not (path / name).exists()]
        if lacking and (path / one.table).exists():
            raise RunError(f"{path} was run without {lacking[0]}: choose another folder with --out")


def _check_without_images(plan: Plan, videos: str, logs: Sequence[str]) -> None:
    """Raise `ParameterError` for what needs images."""
    if plan.kind != "follow":
        raise ParameterError(
            f"only closed-loop runs (follow) can do without images, got the renderer {WITHOUT_IMAGES!r}"
        )
    if videos not in ("first", "none") or logs:
        raise ParameterError(f"videos and logs need images: leave them out with the renderer {WITHOUT_IMAGES!r}")
    for tracker in plan.trackers:
        made = trackers.is_builtin(tracker.name) and trackers.make(
            tracker.name, preset=tracker.preset, **tracker.params
        )
        if not isinstance(made, (trackers.NeedsTruth, trackers.NeedsDetections)):
            raise ParameterError(
                f"tracker {tracker.label!r} needs images: without them (renderer {WITHOUT_IMAGES!r}) oracle and the "
                "built-in trackers of detections can drive"
            )


def _worst_count(videos: str) -> int:
    """N of `worst:N`; 0 for the other choices."""
    match = re.fullmatch(r"worst:([1-9]\d{0,5})", videos)
    if match is None and videos not in VIDEOS:
        raise ParameterError(f"videos must be one of {', '.join(VIDEOS)} or worst:N, got {videos!r}")
    return int(match[1]) if match else 0


@contextlib.contextmanager
def _deferred_interrupt(wanted: bool) -> Generator[Callable[[], bool]]:
    """Record the first Ctrl-C instead of raising it: within a callback of the executor the exception would be lost."""
    received: list[int] = []

    def record(number: int, _: object) -> None:
        received.append(number)
        if len(received) > 1:
            raise KeyboardInterrupt

    if not wanted or threading.current_thread() is not threading.main_thread():
        yield lambda: False
        return
    previous = signal.signal(signal.SIGINT, record)
    try:
        yield lambda: bool(received)
    finally:
        signal.signal(signal.SIGINT, previous)


def make_executor(plan: Plan, workers: int, scheduler: str | None, processes: TrackerProcesses) -> Executor:
    """The executor that the options ask for; `processes` are those of trackers, for episodes in this process."""
    if scheduler is not None:
        return DaskExecutor(scheduler)
    return LocalExecutor(min(workers, plan.episode_count)) if workers else SerialExecutor(processes)
