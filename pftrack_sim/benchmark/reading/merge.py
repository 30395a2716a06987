"""Merge run folders: the union of what was asked for and of the results that are there."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pftrack_sim.benchmark.asked.plan import AskedResult
from pftrack_sim.benchmark.asked.union import contradictions, listed, united
from pftrack_sim.benchmark.kept.folder import names_of_episode, names_of_result
from pftrack_sim.benchmark.kept.tables import MAX_BYTES, read_metadata
from pftrack_sim.benchmark.reading.store import RunStore
from pftrack_sim.core.errors import ParameterError, RunError
from pftrack_sim.core.inputs import is_file, read_bytes


@dataclass(frozen=True)
class MergeReport:
    """Numbers of results: added, found more than once with equal content, there now, and asked for."""

    path: Path
    added: int
    shared: int
    done: int
    total: int

    def lines(self) -> Iterator[str]:
        """The report as text."""
        yield f"{self.added} results added, {self.shared} found more than once with the same content"
        rest = "" if self.done == self.total else "; bench with the same plan and this folder runs the rest"
        yield f"{self.path}: {self.done} of {self.total} results{rest}"


def merge(out: Path, folders: Sequence[Path]) -> MergeReport:
    """Copy the results of several run folders into one, which then asks for what any of them asks for.

    Args:
        out: Folder to make, or a run folder to add to.
        folders: Run folders to copy from; they are not changed.

    Raises:
        ParameterError: No folder.
        RunError: Not a run folder, results of the same name with other keys, or two different files of one result.
    """
    if not folders:
        raise ParameterError("merge needs at least one run folder")
    stores = [RunStore(folder) for folder in folders]
    for store in stores:
        store.require_checksums()
    plan = stores[0].plan
    for store in stores[1:]:
        try:
            plan, before = united(plan, store.plan), plan
        except ParameterError as error:
            raise RunError(f"{store.path} holds another plan than {folders[0]}\n  {error}") from None
        if (before.asked.keys() | store.plan.asked.keys()) - plan.asked.keys():
            lines = listed(contradictions(store.plan, before))
            raise RunError(f"{store.path} holds another plan than {folders[0]}\n{lines}")
    added = shared = 0
    with RunStore.begin(out, plan) as merged:
        for source in (store for store in stores if store.path.resolve() != out.resolve()):
            there, found = merged.present, source.present
            source.verify(name for one in found.values() for name in one.tables)
            ours = read_metadata(merged.path, (one for key, one in found.items() if key in there))
            for key, (one, theirs) in zip(found, read_metadata(source.path, found.values()), strict=True):
                if key in there:
                    _check_equal(one, (merged.path, next(ours)[1]), (source.path, theirs))
                    shared += 1
                else:
                    merged.add(_contents(source.path, [*names_of_result(one), *one.tables]))
                    added += 1
            for episode in {one.episode.number: one.episode for one in found.values()}.values():
                merged.add(_contents(source.path, names_of_episode(episode)))
            known = merged.record.sessions
            merged.note(sessions=(*known, *(one for one in source.record.sessions if one not in known)))
        done = len(merged.present)
        merged.write_summary()
    return MergeReport(out, added, shared, done, len(merged.plan.asked))


def _contents(folder: Path, names: Sequence[str]) -> dict[str, bytes]:
    """Contents of the files that are there."""
    try:
        return {name: read_bytes(folder / name, MAX_BYTES) for name in names if is_file(folder / name)}
    except OSError as error:
        raise RunError(f"{folder} cannot be read: {error.strerror}") from None


def _check_equal(asked: AskedResult, merged: tuple[Path, dict[str, Any]], other: tuple[Path, dict[str, Any]]) -> None:
    (folder, one), (other_folder, two) = merged, other
    if (one["content_sha256"], one["frames_digest"]) != (two["content_sha256"], two["frames_digest"]):
        frames = "; their frames differ" if one["frames_digest"] != two["frames_digest"] else ""
        raise RunError(
            f"{folder / asked.table} and {other_folder / asked.table} have different content for "
            f"{asked.episode.name}, {asked.tracker.label}{frames} "
            f"({one['graphics']}, version {one['version']}; {two['graphics']}, version {two['version']})"
        )
