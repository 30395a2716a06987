"""Executors of episodes: this process, local worker processes, or the workers of a Dask cluster.

Each local worker is a `concurrent.futures.ProcessPoolExecutor` of one process. A pool of several, and loky's, fails all
of its running jobs when one process dies, so that the episode that killed it would not be known.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, ProcessPoolExecutor, wait
from contextlib import ExitStack
from dataclasses import replace
from functools import cache
from multiprocessing import resource_tracker
from multiprocessing.connection import wait as wait_for
from multiprocessing.context import SpawnContext, SpawnProcess
from multiprocessing.process import BaseProcess
from typing import Any

from pftrack_sim.benchmark.running.episode import MAX_DEATHS, EpisodeFiles, EpisodeJob, run_episode
from pftrack_sim.core.compiled import compile_in_silence
from pftrack_sim.core.errors import RunError
from pftrack_sim.trackers.isolation import TrackerProcesses

_PROGRESS_PERIOD_S = 0.2
_CONNECT_S = 30
# One core per worker: several episodes side by side gain more than several threads within a frame. With 0, Mesa's
# software rasteriser draws in the calling thread; with 1 it would start another one.
_ONE_CORE = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", "LP_NUM_THREADS": "0"}

# OpenBLAS selects its kernels by processor, and each sums in its own order: one different bit, and a robot that a
# tracker drives takes another path. The kernels of Haswell run on every processor with AVX2.
_SAME_BITS = {"OPENBLAS_CORETYPE": "Haswell"}
_CV_CPU_AVX2 = 11

_JOBS_PER_THREAD = 2
"""Episodes given to a cluster for each of its threads: one runs, the other waits beside it."""


class Executor(ABC):
    """Runs episodes in any order."""

    @property
    def frames_done(self) -> int | None:
        """Frames rendered so far, or None when they are known only after each episode."""
        return None

    @abstractmethod
    def run_all(self, jobs: Iterator[EpisodeJob]) -> Iterator[EpisodeFiles | None]:
        """Run every job, taking only as many from the iterator as can be worked on.

        Yields:
            What each episode leaves, and None a few times a second so that progress can be shown.
        """

    @abstractmethod
    def close(self) -> None:
        """Stop at once and drop unfinished episodes."""


class SerialExecutor(Executor):
    """Runs one episode after the other in this process; closes the processes of isolated trackers with itself."""

    def __init__(self, processes: TrackerProcesses) -> None:
        self._processes = processes

    def run_all(self, jobs: Iterator[EpisodeJob]) -> Iterator[EpisodeFiles | None]:
        """See `Executor`."""
        for job in jobs:
            yield run_episode(job, processes=self._processes)

    def close(self) -> None:
        """See `Executor`."""
        self._processes.close()


class LocalExecutor(Executor):
    """Runs episodes in local worker processes, which end with this process."""

    def __init__(self, count: int) -> None:
        self._context = WorkerContext()
        self._frames: Any = self._context.RawArray("q", count)  # rendered by each worker, which alone writes its number
        self._pools = [self._start(index) for index in range(count)]

    def _start(self, index: int) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(1, self._context, initializer=_initialise, initargs=(self._frames, index))

    def run_all(self, jobs: Iterator[EpisodeJob]) -> Iterator[EpisodeFiles | None]:
        """See `Executor`. An episode whose worker dies is run again by a new one."""
        repeated: deque[EpisodeJob] = deque()
        running: dict[Future[EpisodeFiles], tuple[int, EpisodeJob]] = {}
        idle = list(range(len(self._pools)))
        while True:
            while idle and (job := repeated.popleft() if repeated else next(jobs, None)) is not None:
                index = idle.pop(0)
                running[self._submit(index, job)] = index, job
            if not running:
                return
            finished, _ = wait(running, timeout=_PROGRESS_PERIOD_S, return_when=FIRST_COMPLETED)
            for future in finished:
                index, job = running.pop(future)
                idle.append(index)
                try:
                    yield future.result()
                except BrokenExecutor:
                    self._restart(index)
                    again = replace(job, deaths=job.deaths + 1)
                    if again.deaths < MAX_DEATHS:
                        repeated.append(again)
                    else:
                        yield _given_up(job, f"its worker died {MAX_DEATHS} times")
            yield None

    def _submit(self, index: int, job: EpisodeJob) -> Future[EpisodeFiles]:
        try:
            return self._pools[index].submit(_run, job)
        except BrokenExecutor:  # the worker died while it was idle
            self._restart(index)
            return self._pools[index].submit(_run, job)

    def _restart(self, index: int) -> None:
        self._pools[index].shutdown(wait=False)
        self._pools[index] = self._start(index)

    @property
    def frames_done(self) -> int:
        """See `Executor`."""
        return sum(self._frames)

    def close(self) -> None:
        """See `Executor`."""
        # Those too that are still starting and have not reported themselves.
        for process in self._context.started:
            if process.pid is not None and process.is_alive():
                process.kill()
        # The thread of a pool closes a pipe that the end of the interpreter writes into: it must have ended before.
        for pool in self._pools:
            pool.shutdown(wait=True, cancel_futures=True)


class WorkerProcess(SpawnProcess):
    """A process with one core and `_SAME_BITS`, in which Ctrl-C waits until `prepare_worker` ignores it.

    A new interpreter imports for seconds before `prepare_worker` runs. Libraries of linear algebra count their threads
    and choose their kernels while they load, and a Ctrl-C in that time would print its traceback: environment and mask
    of blocked signals are inherited.
    """

    def start(self) -> None:
        """See `multiprocessing.Process`."""
        with ExitStack() as undone:
            for name, value in _settings().items():
                if name not in os.environ:
                    os.environ[name] = value
                    undone.callback(os.environ.pop, name)
            if hasattr(signal, "pthread_sigmask"):
                # Started within `start`, it would set the mask of blocked signals back.
                resource_tracker.ensure_running()
                previous = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
                undone.callback(signal.pthread_sigmask, signal.SIG_SETMASK, previous)
            super().start()


class WorkerContext(SpawnContext):
    """Starts processes as `spawn` does, and knows them from the moment they are made."""

    def __init__(self) -> None:
        super().__init__()
        self.started: list[BaseProcess] = []

    # There it is a class.
    def Process(self, *args: Any, **kwargs: Any) -> BaseProcess:  # pyright: ignore[reportIncompatibleVariableOverride]
        """A process that is not started yet."""
        process = WorkerProcess(*args, **kwargs)
        self.started = [one for one in self.started if one.pid is None or one.is_alive()] + [process]
        return process


def _settings() -> dict[str, str]:
    """Environment variables of a worker, where they are not set already."""
    import cv2

    return _ONE_CORE | (_SAME_BITS if cv2.checkHardwareSupport(_CV_CPU_AVX2) else {})


class DaskExecutor(Executor):
    """Runs episodes on the workers of a scheduler. They need this package in the same version, and no common disk.

    Raises:
        RunError: `distributed` is not installed, or the scheduler does not answer.
    """

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client
        except ImportError:
            raise RunError("a Dask cluster needs the extra: pip install 'pftrack-sim[dask]'") from None
        try:
            self._client: Any = Client(address, timeout=_CONNECT_S)
        except (OSError, ValueError) as error:
            raise RunError(f"no Dask scheduler at {address!r}: {error}") from None

    def run_all(self, jobs: Iterator[EpisodeJob]) -> Iterator[EpisodeFiles | None]:
        """See `Executor`. The scheduler repeats an episode whose worker dies."""
        from distributed import KilledWorker, as_completed

        running: dict[str, EpisodeJob] = {}
        finished: Any = as_completed()
        self._submit(jobs, running, finished)
        while running:
            future = next(finished)
            job = running.pop(future.key)
            try:
                yield future.result()
            except KilledWorker:
                yield _given_up(job, "its workers died repeatedly")
            future.release()
            self._submit(jobs, running, finished)

    def _submit(self, jobs: Iterator[EpisodeJob], running: dict[str, EpisodeJob], finished: Any) -> None:
        threads = sum(one["nthreads"] for one in self._client.scheduler_info(n_workers=-1)["workers"].values())
        while len(running) < _JOBS_PER_THREAD * max(threads, 1) and (job := next(jobs, None)) is not None:
            future = self._client.submit(_run, job, pure=False)
            running[future.key] = job
            finished.add(future)

    def close(self) -> None:
        """See `Executor`."""
        self._client.close()


def _given_up(job: EpisodeJob, why: str) -> EpisodeFiles:
    return EpisodeFiles(job.episode.name, problem=f"{job.episode.name}: {why}")


_count_frame: Callable[[], None] = lambda: None  # noqa: E731 - set once in each worker


@cache
def _processes() -> TrackerProcesses:
    """Processes of the trackers of this worker; they end with it."""
    return TrackerProcesses()


def _run(job: EpisodeJob) -> EpisodeFiles:
    return run_episode(job, _count_frame, _processes())


def prepare_worker() -> None:
    """Prepare a worker process: it ignores Ctrl-C, ends with its parent, and OpenCV computes with one core."""
    # Ctrl-C reaches the whole process group; only the parent handles it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    threading.Thread(target=_exit_with_parent, daemon=True).start()
    import cv2

    cv2.setNumThreads(1)


def _initialise(frames: Any, index: int) -> None:
    """Prepare a worker process that counts its frames."""
    global _count_frame
    prepare_worker()
    if index:  # one of several says that it compiles
        compile_in_silence()

    def count() -> None:
        frames[index] += 1

    _count_frame = count


def _exit_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait_for([parent.sentinel])
        time.sleep(0.1)
        os._exit(1)
