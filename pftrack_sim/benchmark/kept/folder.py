"""The run folder: written result by result, read at any time, also unfinished.

run.json                                    what is asked for, and every session that worked on it
frames/<scenario>/<condition>/seed-N-<key>.parquet                  truth of an episode, for all trackers that saw it
episodes/<scenario>/<condition>/seed-N-<tracker>-<key>.parquet      a tracker's result in an episode
errors/<scenario>/<condition>/seed-N-<tracker>-<key>.png and .txt   of trackers that ended with an error
videos/<scenario>/<condition>/seed-N-<key>.mp4                      of all trackers that share the frames
logs/<scenario>/<condition>/seed-N-<key>.rrd and .mcap
summary.parquet  tables/*.csv  tables/*.tex     made from the results at the end of a session
SHA256SUMS                                      of all of these
.scratch                                        what workers are writing; swept when a session begins

What is missing, stale or foreign is set arithmetic on the keys that file names end in.
"""

from __future__ import annotations

import contextlib
import os
import shutil
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Self

from pftrack_sim.benchmark.asked.plan import AskedResult, Episode, Plan
from pftrack_sim.benchmark.asked.union import contradictions, listed, united
from pftrack_sim.benchmark.kept.checksums import DERIVED, RECORD, SUMS, TABLES_OF_RESULTS, Checksums
from pftrack_sim.benchmark.kept.files import LOCK, lock_folder, remove_parts, write_bytes
from pftrack_sim.benchmark.kept.record import Record, read_record, session, write_record
from pftrack_sim.benchmark.kept.tables import OPENED, read_metadata
from pftrack_sim.benchmark.keys import key_of
from pftrack_sim.core.arguments import checked
from pftrack_sim.core.code_digest import opened_digest, opened_file
from pftrack_sim.core.errors import ParameterError, RunError
from pftrack_sim.core.inputs import is_file
from pftrack_sim.core.text import one_line
from pftrack_sim.logs import FORMATS
from pftrack_sim.trackers import is_builtin

SCRATCH = ".scratch"
"""Folder of a run for the temporary files of its workers."""

SUMMARY = "summary.parquet"
TABLES = ("tables/trackers.csv", "tables/trackers.tex", "tables/conditions.csv", "tables/conditions.tex",
          "tables/episodes.csv")  # fmt: skip


class RunFolder:
    """A run folder to read; `begin` opens one to write.

    Attributes:
        record: What is asked for, and its sessions.

    Raises:
        RunError: It is no run folder, one of another format, or its record was edited.
    """

    @checked
    def __init__(self, path: Path) -> None:
        self.path = path
        self.record = read_record(path)
        self.checksums = Checksums(path)
        self._opened = contextlib.ExitStack()
        self._verified: set[str] = set()
        if self.checksums.complete:
            self.verify([RECORD])

    @classmethod
    def begin(cls, path: Path, plan: Plan, *, refresh: bool = False, running: bool = False) -> Self:
        """Open a run folder to write. It is locked until `close`, or until this process ends in any way.

        Args:
            path: Absent, empty, or a run folder.
            plan: What is asked for; `store.plan` then has what is there already, too.
            refresh: Remove results that have the same name and another key, instead of an error.
            running: Whether results will be run: all trackers of the folder count with the code of today.

        Raises:
            RunError: It holds something else, results of the same name with another key, or has another writer, or
                cannot be written.
        """
        try:
            with contextlib.ExitStack() as opened:
                _check_usable(path)
                path.mkdir(parents=True, exist_ok=True)
                opened.callback(os.close, lock_folder(path))
                # Only under the lock is it certain what the folder holds: another process may have begun it just now.
                _check_usable(path)
                known = cls(path) if is_run(path) else None
                record = Record(finished=None, sessions=(), plan=plan) if known is None else known.record
                if known is not None:
                    wanted, stale = _wanted(known, plan, refresh, running)
                    for name in stale:
                        (path / name).unlink(missing_ok=True)
                    if stale or wanted is not record.plan:
                        record = record.model_copy(update={"finished": None, "plan": wanted})
                    known.record = record
                    known.verify(name for one in known.present.values() for name in one.tables)
                # The record comes last: interrupted before it, the folder still asks to be refreshed.
                Checksums(path).begin()
                remove_parts(path)
                shutil.rmtree(path / SCRATCH, ignore_errors=True)
                opened.callback(shutil.rmtree, path / SCRATCH, ignore_errors=True)
                (path / SCRATCH).mkdir(exist_ok=True)
                write_record(path, record.model_copy(update={"sessions": (*record.sessions, session())}))
                folder = cls(path)
                folder._opened, folder._verified = opened.pop_all(), known._verified if known else set()
                return folder
        except OSError as error:
            raise RunError(f"cannot make the run folder {path}: {error.strerror}") from None

    @property
    def plan(self) -> Plan:
        """What is asked for."""
        return self.record.plan

    @property
    def finished(self) -> bool:
        """Whether every episode is there."""
        return self.record.finished is not None

    def verify(self, names: Iterable[str]) -> None:
        """Read these files, by their paths within the folder, once; RunError where one is not what was written."""
        new = [name for name in dict.fromkeys(names) if name not in self._verified]
        for name, problem in self.checksums.changes(new).items():
            raise RunError(f"{self.path}/{name}: {problem}; pftrack-sim check lists all problems")
        self._verified.update(new)

    def require_checksums(self) -> None:
        """Raise RunError where the list of checksums is lost, so that no result is read."""
        if not os.path.lexists(self.path / SUMS):
            raise RunError(
                f"{self.path} has no {SUMS}: a result without its checksum is not read; restore the file, or the same "
                "command runs the episodes again"
            )

    @property
    def kept(self) -> set[str]:
        """Short keys of the results that are there, asked for or not."""
        return {key_of(name) for name in self._tables() if name.startswith("episodes/")}

    @property
    def present(self) -> dict[str, AskedResult]:
        """The results that are asked for and there with their frames, by their short keys, in the plan's order."""
        there = set(self._tables())
        return {key: one for key, one in self.plan.asked.items() if there.issuperset(one.tables)}

    def opened(self) -> list[tuple[AskedResult, dict[str, str]]]:
        """Results of third-party trackers, with digests of the files that these have loaded and opened, by name.

        Raises:
            RunError: A result cannot be read.
        """
        theirs = [one for one in self.present.values() if not is_builtin(one.tracker.name)]
        self.verify(one.table for one in theirs)
        known = ((one, metadata.get(OPENED, {})) for one, metadata in read_metadata(self.path, theirs))
        return [(one, {str(name): str(was) for name, was in files.items()}) for one, files in known]

    @property
    def missing(self) -> list[AskedResult]:
        """The results that are asked for and not there, in the plan's order."""
        present = self.present
        return [one for key, one in self.plan.asked.items() if key not in present]

    @property
    def foreign(self) -> list[str]:
        """Paths within the folder of what is none of this run's, hidden names aside."""
        there = {
            Path(place, name).relative_to(self.path).as_posix()
            for place, folders, names in os.walk(self.path)
            for name in (*names, *(one for one in folders if os.path.islink(os.path.join(place, one))))
            if not name.startswith(".")
        }
        there.difference_update((*DERIVED, *TABLES, SUMS), _names(self.plan))
        return sorted(there)

    def _tables(self) -> list[str]:
        """Paths within the folder of the tables of results and of frames that are there and have a checksum."""
        names = (name for name in self.checksums.known if name.startswith(TABLES_OF_RESULTS))
        return [name for name in names if is_file(self.path / name)]

    def add(self, files: Mapping[str, bytes]) -> None:
        """Write files, by their paths within the folder; a table of frames that is there already stays.

        Raises:
            RunError: They cannot be written.
        """
        try:
            for name in (SUMMARY, *TABLES):  # they would speak of fewer episodes
                (self.path / name).unlink(missing_ok=True)
        except OSError as error:
            raise RunError(f"cannot replace {error.filename}: {error.strerror}") from None
        known = self.checksums.known
        new = {
            name: content
            for name, content in files.items()
            if not (name.startswith("frames/") and name in known and is_file(self.path / name))
        }
        self.checksums.add(new)
        self._verified -= new.keys()
        # The results come last: one that is there is complete.
        for name in sorted(new, key=lambda name: name.startswith("episodes/")):
            write_bytes(self.path / name, new[name])

    def ask(self, plan: Plan) -> None:
        """Ask for all that a plan has, too; ParameterError where it cannot be."""
        wanted = united(self.plan, plan, running=True)
        if wanted is not self.plan:
            self.note(finished=None, plan=wanted)

    def note(self, **changes: Any) -> None:
        """Change fields of the record."""
        self.record = self.record.model_copy(update=changes)
        write_record(self.path, self.record)

    def close(self) -> None:
        """Unlock the folder. Closing twice is fine."""
        self._opened.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def is_run(path: Path) -> bool:
    """Whether a folder holds a run."""
    return is_file(path / RECORD)


def _check_usable(path: Path) -> None:
    """Raise RunError where a folder holds anything but a run or what is left of one killed before it had begun."""
    if not path.exists() or is_run(path):
        return
    left = {LOCK, SCRATCH}
    if is_file(path / SUMS) and not (path / SUMS).stat().st_size:
        left.add(SUMS)
    if not path.is_dir() or any(
        one.name not in left and not one.name.startswith(".run.json.") for one in path.iterdir()
    ):
        raise RunError(f"{path} exists and is not an empty folder: choose another with --out")


def _wanted(folder: RunFolder, plan: Plan, refresh: bool, running: bool) -> tuple[Plan, set[str]]:
    """The plan of a folder when this one is asked for, and the files that are stale then; see `RunFolder.begin`."""
    path, stored = folder.path, folder.plan
    try:
        wanted = united(stored, plan, running=running)
    except ParameterError as error:
        raise RunError(f"{path} holds another plan: choose another folder with --out\n  {error}") from None
    edited = _edited(folder) if running else []
    if (edited or folder.kept & (stored.asked.keys() - wanted.asked.keys())) and not refresh:
        lines = [*contradictions(wanted, stored), *dict.fromkeys(line for _, changed in edited for line in changed)]
        coded = any(line.startswith(("trackers.", "run with.")) for line in lines)
        found = "was begun with other code" if coded else "holds another plan"
        raise RunError(
            f"{path} {found}: its results have the same names and other keys; run them again with --refresh, or choose "
            f"another folder with --out\n{listed(lines)}"
        )
    stale = set[str]() if wanted is stored else {*_names(stored)}.difference(_names(wanted))
    for one, _ in edited:
        stale.update(names_of_result(one), names_of_episode(one.episode)[one.episode.kind == "open" :])
    return wanted, stale


def _edited(folder: RunFolder) -> list[tuple[AskedResult, list[str]]]:
    """Results whose trackers have opened files that are others now, with a line for each of these."""
    results = folder.opened()
    now = {name: opened_digest(opened_file(name)) for _, opened in results for name in opened}
    found: list[tuple[AskedResult, list[str]]] = []
    for one, opened in results:
        changed = [
            f"trackers.{one.tracker.label}.opened.{one_line(name)}: {one_line(was)[:12]} there, "
            f"{now[name][:12] or 'nothing'} asked for"
            for name, was in opened.items()
            if now[name] != was
        ]
        found += [(one, changed)] if changed else []
    return found


def _names(plan: Plan) -> Iterator[str]:
    """Paths within a run folder of all files that results and episodes of a plan may have."""
    for one in plan.asked.values():
        yield from names_of_result(one)
    for episode in plan.episodes():
        yield from names_of_episode(episode)


def names_of_result(asked: AskedResult) -> list[str]:
    """Paths within a run folder of all files that a result may have."""
    return [asked.table, f"errors/{asked.path}.png", f"errors/{asked.path}.txt"]


def names_of_episode(episode: Episode) -> list[str]:
    """Paths within a run folder of all files that an episode may have besides its results; first that of its frames."""
    logs = [f"logs/{episode.path}{form.suffix}" for form in FORMATS.values()]
    return [episode.frames_table, episode.video, *logs]
