"""Joining what several machines did of one plan."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import duckdb

from pftrack_sim.benchmark.columns import read_metadata
from pftrack_sim.benchmark.folder import RunFolder, read_record, read_run_plan
from pftrack_sim.benchmark.plan import Episode, differences
from pftrack_sim.benchmark.tables import write_results
from pftrack_sim.core.errors import ParameterError, RunError


@dataclass(frozen=True)
class Merged:
    """What a merge did.

    Attributes:
        path: The folder.
        added: Episodes that came in.
        shared: Episodes that were there already, with the same content.
        done: Episodes that are there now.
        total: Episodes of the plan.
    """

    path: Path
    added: int
    shared: int
    done: int
    total: int

    def lines(self) -> Iterator[str]:
        """For people."""
        yield f"{self.added} episodes added, {self.shared} found more than once with the same content"
        rest = "" if self.done == self.total else "; bench with the same plan and this folder runs the rest"
        yield f"{self.path}: {self.done} of {self.total} episodes{rest}"


def merge(out: Path, folders: Sequence[Path]) -> Merged:
    """Copy the episodes of several run folders of one plan into one.

    Args:
        out: Folder to make, or one of the same plan to add to.
        folders: Where the episodes come from; they stay as they are.

    Raises:
        ParameterError: No folder.
        RunError: Not a run folder, another plan, or two that disagree on an episode.
    """
    if not folders:
        raise ParameterError("merge needs at least one run folder")
    plan = read_run_plan(folders[0])
    for other in folders[1:]:
        theirs = read_run_plan(other)
        if theirs.digest != plan.digest:
            lines = "\n".join(f"  {line}" for line in differences(plan, theirs))
            raise RunError(f"{other} holds another plan than {folders[0]}\n{lines}")
    sources = [one for one in folders if one.resolve() != out.resolve()]
    held = RunFolder(out, plan)
    added = shared = done = 0
    try:
        with duckdb.connect() as database:
            for episode in plan.episodes():
                here = held.has(episode)
                for source in sources:
                    file = source / "episodes" / f"{episode.path}.parquet"
                    if not file.is_file():
                        continue
                    if here:
                        _check_equal(database, episode, held.episode_file(episode), file)
                        shared += 1
                        continue
                    list(read_metadata(database, [file]))  # raises where it is no episode's file
                    video = source / "videos" / f"{episode.path}.mp4"
                    held.add(episode, file.read_bytes(), video.read_bytes() if video.is_file() else None)
                    here, added = True, added + 1
                done += here
        for source in sources:
            held.adopt(read_record(source)["sessions"])
        if done:
            write_results(out, plan)
        held.close(finished=done == plan.episode_count)
    except BaseException:
        held.release()
        raise
    return Merged(out, added, shared, done, plan.episode_count)


def _check_equal(database: duckdb.DuckDBPyConnection, episode: Episode, here: Path, there: Path) -> None:
    (_, mine), (_, theirs) = read_metadata(database, [here, there])
    if mine["content_sha256"] == theirs["content_sha256"]:
        return
    drawn = "; they drew different frames" if mine["frames_digest"] != theirs["frames_digest"] else ""
    raise RunError(
        f"{here} and {there} disagree on {episode.name}{drawn} "
        f"({mine['graphics']}, version {mine['version']}; {theirs['graphics']}, version {theirs['version']})"
    )
