"""Merge the run folders of several machines that ran parts of one plan."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import duckdb

from pftrack_sim.benchmark.asked.plan import Episode
from pftrack_sim.benchmark.asked.stored_plan import differences
from pftrack_sim.benchmark.kept.episode_file import MAX_BYTES, read_metadata
from pftrack_sim.benchmark.kept.error_files import errors_folder
from pftrack_sim.benchmark.kept.store import RunStore
from pftrack_sim.core.errors import ParameterError, RunError
from pftrack_sim.core.inputs import read_bytes
from pftrack_sim.logs import FORMATS


@dataclass(frozen=True)
class MergeReport:
    """Numbers of episodes: added, found more than once with equal content, there now, and in the plan."""

    path: Path
    added: int
    shared: int
    done: int
    total: int

    def lines(self) -> Iterator[str]:
        """The report as text."""
        yield f"{self.added} episodes added, {self.shared} found more than once with the same content"
        rest = "" if self.done == self.total else "; bench with the same plan and this folder runs the rest"
        yield f"{self.path}: {self.done} of {self.total} episodes{rest}"


def merge(out: Path, folders: Sequence[Path]) -> MergeReport:
    """Copy the episodes of several run folders of one plan into one.

    Args:
        out: Folder to make, or one of the same plan to add to.
        folders: Run folders to copy from; they are not changed.

    Raises:
        ParameterError: No folder.
        RunError: Not a run folder, another plan, or two different files of one episode.
    """
    if not folders:
        raise ParameterError("merge needs at least one run folder")
    stores = [RunStore(folder) for folder in folders]
    plan = stores[0].plan
    for store in stores[1:]:
        if store.plan.digest != plan.digest:
            lines = "\n".join(f"  {line}" for line in differences(plan, store.plan))
            raise RunError(f"{store.path} holds another plan than {folders[0]}\n{lines}")
    sources = [store for store in stores if store.path.resolve() != out.resolve()]
    added = shared = 0
    with RunStore.begin(out, plan) as merged, duckdb.connect() as database:
        for source in sources:
            for _, episode in source.episodes():
                file = source.episode_file(episode)
                if merged.has(episode):
                    _check_equal(database, episode, merged.episode_file(episode), file)
                    shared += 1
                    continue
                list(read_metadata(database, {file: episode}))  # raises unless it is this episode's file
                video = source.video_file(episode)
                found = {name: one for name in FORMATS if os.path.lexists(one := source.log_file(episode, name))}
                logs = {name: _content(one) for name, one in found.items()}
                below = errors_folder(source.path, episode)
                errors = {one.name: _content(one) for one in (below.iterdir() if below.is_dir() else ())}
                merged.add(episode, _content(file), _content(video) if os.path.lexists(video) else None, logs, errors)
                added += 1
        done = sum(1 for _ in merged.episodes())
        for source in sources:
            merged.add_sessions(source.record["sessions"])
        merged.write_summary()
    return MergeReport(out, added, shared, done, plan.episode_count)


def _content(file: Path) -> bytes:
    try:
        return read_bytes(file, MAX_BYTES)
    except OSError as error:
        raise RunError(f"{file} cannot be read: {error.strerror}") from None


def _check_equal(database: duckdb.DuckDBPyConnection, episode: Episode, merged: Path, other: Path) -> None:
    (_, one), (_, two) = read_metadata(database, {merged: episode, other: episode})
    if one["content_sha256"] != two["content_sha256"]:
        frames = "; their frames differ" if one["frames_digest"] != two["frames_digest"] else ""
        raise RunError(
            f"{merged} and {other} have different content for {episode.name}{frames} "
            f"({one['graphics']}, version {one['version']}; {two['graphics']}, version {two['version']})"
        )
