"""Progress of a run: counts, remaining time, and the mean overlap of each tracker so far."""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pftrack_sim.benchmark.kept.tables import read_metadata
from pftrack_sim.benchmark.reading.store import RunStore
from pftrack_sim.benchmark.running.episode import EpisodeFiles


@dataclass(frozen=True)
class RunProgress:
    """Progress of a run.

    Attributes:
        done: Finished episodes, with those of earlier sessions.
        total: Episodes of the plan, or of this machine's part of it.
        left_s: Estimated time to the end; NaN while it is unknown.
        means: Mean overlap of each tracker so far, by label; NaN before its first episode.
    """

    done: int
    total: int
    frames: int
    share: float
    elapsed_s: float
    left_s: float
    means: Mapping[str, float]
    errors: Mapping[str, int]
    episode: str | None = None


class ProgressCounter:
    """Counts the episodes of this machine's part of a run, with those of earlier sessions, in constant memory."""

    def __init__(self, store: RunStore, part: tuple[int, int]) -> None:
        plan = store.plan
        mine = {episode.number for episode in plan.episodes(part=part)}
        self.total = len(mine)
        self.done = self._before = len(mine - {one.episode.number for one in store.missing})
        self._frames_per_episode = plan.frame_count / plan.episode_count
        self._sums = dict.fromkeys(plan.labels, 0.0)
        self._counts: Counter[str] = Counter()
        self._errors: Counter[str] = Counter()
        self._frames = 0
        self._last: str | None = None
        self._start_s = time.monotonic()
        present = (one for one in store.present.values() if one.episode.number in mine)
        for _, row in read_metadata(store.path, present):
            self._count(row)

    def add(self, files: EpisodeFiles) -> None:
        """Count a finished episode."""
        self._frames += files.frames
        self._last = files.name
        self.done += 1
        for row in files.rows:
            self._count(row)

    def _count(self, row: Mapping[str, Any]) -> None:
        if not math.isnan(row["mean_overlap"]):
            self._sums[row["label"]] += row["mean_overlap"]
            self._counts[row["label"]] += 1
        self._errors[row["label"]] += row["error"] is not None

    def progress(self, frames_done: int | None) -> RunProgress:
        """The progress at this moment; `frames_done` as the executor counts them, or None."""
        frames = max(frames_done or 0, self._frames)
        elapsed_s = time.monotonic() - self._start_s
        missing = self.total - self._before
        share = min(frames / max(missing * self._frames_per_episode, 1.0), 1.0) if self.done < self.total else 1.0
        last, self._last = self._last, None
        return RunProgress(
            done=self.done,
            total=self.total,
            frames=frames,
            share=(self._before + share * missing) / self.total if self.total else 1.0,
            elapsed_s=elapsed_s,
            left_s=elapsed_s / share - elapsed_s if share > 0 else math.nan,
            means={label: total / self._counts[label] if self._counts[label] else math.nan
                   for label, total in self._sums.items()},
            errors={label: count for label, count in self._errors.items() if count},
            episode=last,
        )  # fmt: skip

    def __str__(self) -> str:
        """`"3 of 40 episodes are finished"`."""
        return f"{self.done} of {self.total} episodes are finished"
