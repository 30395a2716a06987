"""How far a run is: counts, time left, and every tracker's mean so far."""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import duckdb

from pftrack_sim.benchmark.columns import read_metadata
from pftrack_sim.benchmark.episode import EpisodeFiles
from pftrack_sim.benchmark.folder import episode_files
from pftrack_sim.benchmark.plan import Episode, Plan

_CHUNK = 500


@dataclass(frozen=True)
class Status:
    """Where a run stands.

    Attributes:
        done: Episodes that are finished, those of earlier sessions too.
        total: Episodes of the plan, or of this machine's part of it.
        frames: Frames drawn in this session.
        share: Of all the work, in [0, 1].
        elapsed_s: Since this session began.
        left_s: Until the end at this pace; NaN while nothing is known.
        means: Mean overlap of each tracker so far; NaN before its first episode.
        failures: How often each tracker failed, where it did.
        episode: The episode that has just been finished, or None.
    """

    done: int
    total: int
    frames: int
    share: float
    elapsed_s: float
    left_s: float
    means: Mapping[str, float]
    failures: Mapping[str, int]
    episode: str | None = None


class Standing:
    """Keeps count while a run goes on; its size does not grow with the run.

    Args:
        plan: What is run.
        path: The run folder, with what earlier sessions finished.
        part: This machine's part of the plan.
    """

    def __init__(self, plan: Plan, path: Path, part: tuple[int, int]) -> None:
        self.total = len(range(part[0] - 1, plan.episode_count, part[1]))
        self.done = 0
        self._frames_per_episode = plan.frame_count / plan.episode_count
        self._sums = dict.fromkeys(plan.labels, 0.0)
        self._counts: Counter[str] = Counter()
        self._failures: Counter[str] = Counter()
        self._frames = 0
        self._last: str | None = None
        self._began = time.monotonic()
        chunk: list[Path] = []
        with duckdb.connect() as database:
            for file in episode_files(path):
                chunk.append(file)
                if len(chunk) == _CHUNK:
                    self._remember(database, chunk)
                    chunk = []
            if chunk:
                self._remember(database, chunk)
        self._before = self.done

    def _remember(self, database: duckdb.DuckDBPyConnection, files: list[Path]) -> None:
        for _, sums in read_metadata(database, files):
            self.done += 1
            for row in sums["trackers"]:
                self._count(row["tracker"], row["mean_overlap"], row["failure"])

    def _count(self, tracker: str, overlap: float, failure: str | None) -> None:
        if not math.isnan(overlap):
            self._sums[tracker] += overlap
            self._counts[tracker] += 1
        if failure:
            self._failures[tracker] += 1

    def add(self, episode: Episode, outcome: EpisodeFiles) -> None:
        """Count a finished episode."""
        self.done += 1
        self._frames += outcome.frames
        self._last = episode.name
        for row in outcome.rows:
            self._count(row["tracker"], row["mean_overlap"], row["failure"])

    def status(self, frames_drawn: int | None) -> Status:
        """Where it stands.

        Args:
            frames_drawn: As the pool knows it, or None.
        """
        frames = self._frames if frames_drawn is None else max(frames_drawn, self._frames)
        elapsed_s = time.monotonic() - self._began
        wanted = max((self.total - self._before) * self._frames_per_episode, 1.0)
        finished = self.done >= self.total
        share_now = 1.0 if finished else min(frames / wanted, 1.0)
        left_s = 0.0 if finished else elapsed_s / share_now - elapsed_s if share_now > 0 else math.nan
        last, self._last = self._last, None
        return Status(
            done=self.done,
            total=self.total,
            frames=frames,
            share=(self._before + share_now * (self.total - self._before)) / self.total if self.total else 1.0,
            elapsed_s=elapsed_s,
            left_s=left_s,
            means={
                name: total / self._counts[name] if self._counts[name] else math.nan
                for name, total in self._sums.items()
            },
            failures=dict(self._failures),
            episode=last,
        )

    def told(self) -> str:
        """In words: `"3 of 40 episodes are finished"`."""
        return f"{self.done} of {self.total} episodes are finished"
