"""An executor of episodes on a Dask cluster."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pftrack_sim.benchmark.episode import EpisodeJob, run_episode
from pftrack_sim.benchmark.executor import FinishedJob
from pftrack_sim.core.errors import RunError, ScenarioError

_CONNECT_S = 30
_JOBS_PER_THREAD = 2
"""Episodes given to the cluster for each of its threads: one runs, the other waits beside it."""


class DaskExecutor:
    """Runs episodes on the workers of a scheduler. They need this package in the same version, and no common disk.

    Args:
        address: Of the scheduler, for example `tcp://10.0.0.1:8786`.

    Raises:
        RunError: `distributed` is not installed, or the scheduler does not answer.
    """

    frames_done: None = None

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client
        except ImportError:
            raise RunError("a Dask cluster needs the extra: pip install 'pftrack-sim[dask]'") from None
        try:
            self._client: Any = Client(address, timeout=_CONNECT_S)
        except (OSError, ValueError) as error:
            raise RunError(f"no Dask scheduler at {address!r}: {error}") from None

    def run_all(self, jobs: Iterator[EpisodeJob]) -> Iterator[FinishedJob | None]:
        """See `Executor`. The scheduler repeats an episode whose worker dies."""
        from distributed import KilledWorker, as_completed

        running: dict[str, EpisodeJob] = {}
        finished: Any = as_completed()
        self._submit(jobs, running, finished)
        while running:
            future = next(finished)
            job = running.pop(future.key)
            try:
                yield FinishedJob(job, future.result())
            except ScenarioError as error:
                yield FinishedJob(job, None, str(error))
            except KilledWorker:
                yield FinishedJob(job, None, f"{job.episode.name}: its workers died repeatedly")
            future.release()
            self._submit(jobs, running, finished)

    def _submit(self, jobs: Iterator[EpisodeJob], running: dict[str, EpisodeJob], finished: Any) -> None:
        threads = sum(one["nthreads"] for one in self._client.scheduler_info(n_workers=-1)["workers"].values())
        while len(running) < _JOBS_PER_THREAD * max(threads, 1) and (job := next(jobs, None)) is not None:
            future = self._client.submit(run_episode, job, pure=False)
            running[future.key] = job
            finished.add(future)

    def close(self) -> None:
        """See `Executor`."""
        self._client.close()
