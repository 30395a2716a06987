"""Who plays the episodes: this process, local processes, or a cluster, all behind one interface."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, ProcessPoolExecutor, wait
from dataclasses import dataclass
from multiprocessing.connection import wait as wait_for
from typing import Any, Protocol

from pftrack_sim.benchmark.episode import EpisodeFiles, EpisodeJob, run_episode
from pftrack_sim.core.errors import ScenarioError

MAX_DEATHS = 3
"""An episode that ends its worker this often is set aside."""

_TICK_S = 0.2


@dataclass(frozen=True)
class Done:
    """An episode that is over.

    Attributes:
        job: What was asked for.
        outcome: What came of it; None when it could not be run.
        problem: Why it could not be run.
    """

    job: EpisodeJob
    outcome: EpisodeFiles | None
    problem: str | None = None


class Pool(Protocol):
    """Plays episodes, in any order."""

    def play_all(self, jobs: Iterator[EpisodeJob]) -> Iterator[Done | None]:
        """Play every job, taking only as many from the iterator as can be worked on.

        Yields:
            Each job that is over, and None now and then so that progress can be shown.
        """
        ...

    @property
    def frames_drawn(self) -> int | None:
        """Frames drawn so far, or None when that is known only after an episode."""
        ...

    def close(self) -> None:
        """Stop at once; episodes in the middle are dropped."""
        ...


class ThisProcess:
    """Plays one episode after the other where it is."""

    def __init__(self) -> None:
        self._frames = 0

    def play_all(self, jobs: Iterator[EpisodeJob]) -> Iterator[Done | None]:
        """See `Pool`."""
        for job in jobs:
            try:
                yield Done(job, run_episode(job, self._count))
            except ScenarioError as error:
                yield Done(job, None, str(error))

    @property
    def frames_drawn(self) -> int:
        """See `Pool`."""
        return self._frames

    def close(self) -> None:
        """See `Pool`."""

    def _count(self) -> None:
        self._frames += 1


class LocalWorkers:
    """Plays on processes of this machine, each an executor of one: when one dies, the others do not notice.

    Args:
        count: Number of processes.
    """

    def __init__(self, count: int) -> None:
        self._context = multiprocessing.get_context("spawn")
        # For each worker: frames drawn, and its process id. Only the worker writes.
        self._seen: Any = self._context.RawArray("q", 2 * count)
        self._executors = [self._start(place) for place in range(count)]

    def _start(self, place: int) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(1, self._context, initializer=_begin, initargs=(self._seen, place))

    def play_all(self, jobs: Iterator[EpisodeJob]) -> Iterator[Done | None]:
        """See `Pool`. An episode whose worker dies is played again by a new one."""
        again: deque[EpisodeJob] = deque()
        deaths: Counter[str] = Counter()
        running: dict[Future[EpisodeFiles], tuple[int, EpisodeJob]] = {}
        idle = list(range(len(self._executors)))
        while True:
            while idle:
                job = again.popleft() if again else next(jobs, None)
                if job is None:
                    break
                place = idle.pop(0)
                running[self._submit(place, job)] = (place, job)
            if not running:
                return
            over, _ = wait(running, timeout=_TICK_S, return_when=FIRST_COMPLETED)
            for future in over:
                place, job = running.pop(future)
                idle.append(place)
                try:
                    yield Done(job, future.result())
                except ScenarioError as error:
                    yield Done(job, None, str(error))
                except BrokenExecutor:
                    self._executors[place].shutdown(wait=False)
                    self._executors[place] = self._start(place)
                    deaths[job.episode.path] += 1
                    if deaths[job.episode.path] < MAX_DEATHS:
                        again.append(job)
                    else:
                        yield Done(job, None, f"{job.episode.name}: its worker died {MAX_DEATHS} times")
            yield None

    def _submit(self, place: int, job: EpisodeJob) -> Future[EpisodeFiles]:
        try:
            return self._executors[place].submit(_play, job)
        except BrokenExecutor:
            # It died while it had nothing to do.
            self._executors[place] = self._start(place)
            return self._executors[place].submit(_play, job)

    @property
    def frames_drawn(self) -> int:
        """See `Pool`."""
        return sum(self._seen[::2])

    @property
    def process_ids(self) -> list[int]:
        """Of the workers that have begun."""
        return [pid for pid in self._seen[1::2] if pid]

    def close(self) -> None:
        """See `Pool`."""
        for executor in self._executors:
            executor.shutdown(wait=False, cancel_futures=True)
        for pid in self.process_ids:
            with contextlib.suppress(OSError):
                os.kill(pid, getattr(signal, "SIGKILL", signal.SIGTERM))


_on_frame: Callable[[], None] = lambda: None  # noqa: E731 - set once in each worker


def _play(job: EpisodeJob) -> EpisodeFiles:
    return run_episode(job, _on_frame)


def _begin(seen: Any, place: int) -> None:
    """What a worker does first."""
    global _on_frame
    # The whole process group hears Ctrl-C; only the parent acts on it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_leave_with_parent, daemon=True).start()
    # One core each: threads within a frame gain less than frames side by side, and steal from them.
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    # Mesa's software rasteriser then draws in the thread that asks; with 1 it would start another.
    os.environ.setdefault("LP_NUM_THREADS", "0")
    import cv2

    cv2.setNumThreads(1)

    def count() -> None:
        seen[2 * place] += 1

    _on_frame = count
    seen[2 * place + 1] = os.getpid()


def _leave_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait_for([parent.sentinel])
        time.sleep(0.1)
        os._exit(1)
