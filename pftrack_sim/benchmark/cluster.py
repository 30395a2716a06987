"""Episodes on a Dask cluster: `distributed` behind the same interface as the local workers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pftrack_sim.benchmark.episode import EpisodeJob, run_episode
from pftrack_sim.benchmark.executor import Done
from pftrack_sim.core.errors import RunError, ScenarioError

_CONNECT_S = 30
_AHEAD = 2
"""Episodes given to the cluster for each of its threads: one is played, the others wait beside it."""


class DaskWorkers:
    """Plays on the workers of a scheduler. They need this package, in the same version, and no common disk.

    Args:
        address: Of the scheduler, for example `tcp://10.0.0.1:8786`.

    Raises:
        RunError: `distributed` is not installed, or nobody answers.
    """

    frames_drawn: None = None

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client
        except ImportError:
            raise RunError("a Dask cluster needs the extra: pip install 'pftrack-sim[dask]'") from None
        try:
            self._client: Any = Client(address, timeout=_CONNECT_S)
        except (OSError, ValueError) as error:
            raise RunError(f"no Dask scheduler at {address!r}: {error}") from None

    def play_all(self, jobs: Iterator[EpisodeJob]) -> Iterator[Done | None]:
        """See `Pool`. The scheduler plays an episode again whose worker dies."""
        from distributed import KilledWorker, as_completed

        running: dict[str, EpisodeJob] = {}
        finished: Any = as_completed()
        self._fill(jobs, running, finished)
        while running:
            future = next(finished)
            job = running.pop(future.key)
            try:
                yield Done(job, future.result())
            except ScenarioError as error:
                yield Done(job, None, str(error))
            except KilledWorker:
                yield Done(job, None, f"{job.episode.name}: its worker died again and again")
            future.release()
            self._fill(jobs, running, finished)

    def _fill(self, jobs: Iterator[EpisodeJob], running: dict[str, EpisodeJob], finished: Any) -> None:
        threads = sum(one["nthreads"] for one in self._client.scheduler_info(n_workers=-1)["workers"].values())
        while len(running) < _AHEAD * max(threads, 1):
            job = next(jobs, None)
            if job is None:
                return
            future = self._client.submit(run_episode, job, pure=False)
            running[future.key] = job
            finished.add(future)

    def close(self) -> None:
        """See `Pool`."""
        self._client.close()
