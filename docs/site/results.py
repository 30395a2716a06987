"""Makes the tables of the pages by the commands above them: `make results`; PARTS="ko2012 courses" makes some.

A part is a block of tables with its command, of `bench`, `follow`, `limit` or `profile`, on the same page. A finished
one is kept in `docs/site/results/NAME.parquet`, to be committed: scores and digests of every episode, the command, the
code that made it, and how long its last command took. It is made again where the command is another now. Where only the
code is, a random twentieth of its episodes is played again first, some of each tracker (of `limit` the first of a
random axis, of `profile` two scenarios): if all are the same to the bit, it stays as it is, with the code of now beside
that which made it. Frames and videos stay in `runs/NAME`, from which an interrupted part goes on.
"""

from __future__ import annotations

import contextlib
import json
import os
import random
import re
import shlex
import subprocess
import sys
import tempfile
import time
from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import duckdb
import PIL.Image
from plots import draw

from pftrack_sim.benchmark import RunStore
from pftrack_sim.benchmark.asked.from_names import code_of
from pftrack_sim.benchmark.asked.plan import TrackerSpec
from pftrack_sim.benchmark.kept.files import atomic_write, sql_text
from pftrack_sim.benchmark.kept.folder import is_run
from pftrack_sim.benchmark.keys import SCORING, SIMULATOR, environment
from pftrack_sim.benchmark.limits.search import LEAST_EPISODES
from pftrack_sim.core.errors import PftrackError
from pftrack_sim.report.markdown import update_document

SHARE = 20
"""One of so many episodes is played again, but at least about `LEAST`."""

LEAST = 4

ANOTHER_COMMAND = "another command"

ROOT = Path(__file__).parents[2]
PAGES = tuple(ROOT / "docs" / name for name in ("results.md", "axes.md", "profile.md"))
KEPT = ROOT / "docs/site/results"

_BLOCK = re.compile(r"^<!-- tables of (\S+) -->$", re.MULTILINE)
_COMMANDS = re.compile(r"(?:^    .*\n)+", re.MULTILINE)
_ASSIGNMENT = re.compile(r"[A-Z]+=")
_LIMIT = "pftrack-sim limit "
_PROFILE = "pftrack-sim profile "
_RUNS = ("pftrack-sim bench ", "pftrack-sim follow ", _LIMIT, _PROFILE)
_PROFILED = re.compile(rf"(?<={_PROFILE})(?:(?!--)\S+ )+")
_AXIS, _BUDGET = re.compile(r"--axis [\w.=:]+"), re.compile(r"--budget \d+")
_EPISODE = ("kind", "scenario", "condition", "seed", "label")
_OF_A_RUN = ("number", "place", "file", "printed", "levels", "key", "frames_key", "content_sha256")
"""Columns that are another in each run, or with other code: a result's rows, whose digest is the last, hold keys."""


@dataclass(frozen=True)
class Part:
    """A block of tables, and the shell's lines that make its run folder `runs/NAME`."""

    name: str
    page: Path
    script: str


def parts(pages: Sequence[Path] = PAGES) -> Iterator[Part]:
    """Every block of tables that a command on its page makes."""
    for page in pages:
        text = page.read_text(encoding="utf-8")
        for name in _BLOCK.findall(text):
            for commands in _COMMANDS.findall(text):
                lines = [line.strip() for line in commands.replace("\\\n", " ").splitlines()]
                asked = [line for line in lines if line.startswith(_RUNS) and line.split()[-1] == f"runs/{name}"]
                if asked:
                    yield Part(name, page, "\n".join([*filter(_ASSIGNMENT.match, lines), *map(_spaced, asked)]))


def _spaced(line: str) -> str:
    return " ".join(line.split())


def stale(part: Part, kept: Path = KEPT) -> list[str]:
    """What made a part that is another now, in words; empty where it is up to date."""
    known = about(part.name, kept)
    if known is None:
        return ["code that was not recorded"]
    now = environment()
    found = [ANOTHER_COMMAND] if known["script"] != part.script else []
    found += [f"other {name}" for name in (SIMULATOR, SCORING) if known["environment"].get(name) != now[name]]
    specs = [TrackerSpec.model_validate(one) for one in known["trackers"]]
    return found + [f"other code of {one.label}" for one in specs if code_of(one) != one.code]


def about(name: str, kept: Path = KEPT) -> dict[str, Any] | None:
    """What is recorded of a finished part; None where there is none."""
    file = kept / f"{name}.parquet"
    if not file.is_file():
        return None
    with duckdb.connect() as database:
        query = f"SELECT value FROM parquet_kv_metadata({sql_text(file)}) WHERE key = 'part'::BLOB"
        return json.loads(database.execute(query).fetchall()[0][0])


def make(part: Part, root: Path = ROOT, kept: Path = KEPT, more: str = "") -> bool:
    """Run a part and write its tables into its page; False where it is not finished, as with `--part` in `more`."""
    folder, began = root / "runs" / part.name, time.monotonic()
    profile = _PROFILE in part.script
    play(part, "" if profile else more + (" --refresh" if is_run(folder) else ""), folder, root)
    with contextlib.ExitStack() as opened:
        if profile:
            database, told = opened.enter_context(_numbers(folder)), made_by(None)
            query, picture = "FROM summary", part.page.parent / f"pictures/{part.name}.webp"
            picture.parent.mkdir(parents=True, exist_ok=True)
            with PIL.Image.open(folder / "profile.png") as drawn:
                drawn.convert("RGB").quantize(64, dither=PIL.Image.Dither.NONE).save(picture, lossless=True, method=6)
        else:
            store = RunStore(folder)
            if not store.finished:
                return False
            told = made_by(store)
            told |= {"commit": store.record.sessions[-1].commit, "finished": store.record.finished}
            database = opened.enter_context(store.database())
            query = "SELECT * EXCLUDE (printed, file) FROM summary ORDER BY number, place"
        told |= {"script": part.script, "hours": (time.monotonic() - began) / 3600}
        keep(kept / f"{part.name}.parquet", database, query, told)
    update_document(part.page, root / "runs", part.name)
    draw(part.page, part.page.parent / "pictures/results")
    return True


@contextlib.contextmanager
def _numbers(folder: Path) -> Generator[duckdb.DuckDBPyConnection]:
    """A database whose table `summary` has a row per scenario of a profile, named as results are."""
    with duckdb.connect() as database:
        (folder / "numbers.json").write_text(
            "\n".join(
                json.dumps(dict.fromkeys(_EPISODE) | {"scenario": name, **numbers})
                for name, numbers in json.loads((folder / "profile.json").read_text(encoding="utf-8")).items()
            )
        )
        database.execute(f"CREATE TABLE summary AS FROM read_json({sql_text(folder / 'numbers.json')})")
        yield database


def play(part: Part, more: str, folder: Path, root: Path) -> None:
    """Run the commands of a part into a folder; the program ends where they cannot be run."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    script = f"{part.script.replace(f'--out runs/{part.name}', f'--out {shlex.quote(str(folder))}')} {more}"
    done = subprocess.run(["sh", "-c", script], cwd=root, env={**os.environ, "PATH": path})
    if done.returncode > 1:  # 1: a tracker ended with an error, which is a result
        sys.exit(f"{part.name}: ended with {done.returncode}; make results goes on from there")


def made_by(store: RunStore | None) -> dict[str, Any]:
    """The code that made a run: the environment, and trackers with their own; without a run, the code of now."""
    trackers = [one.model_dump(mode="json") for one in (store.plan.trackers if store else ())]
    return {"environment": store.plan.environment if store else environment(), "trackers": trackers}


def keep(file: Path, database: duckdb.DuckDBPyConnection, query: str, told: dict[str, Any]) -> None:
    """Write the rows of a query as the file of a part."""
    options = f"FORMAT parquet, COMPRESSION zstd, KV_METADATA {{part: {sql_text(json.dumps(told))}}}"
    with atomic_write(file) as written:
        database.execute(f"COPY ({query}) TO {sql_text(written)} ({options})")


def confirm(part: Part, root: Path = ROOT, kept: Path = KEPT) -> bool:
    """Play a random twentieth of a part again; where all is the same to the bit, record the code of now for it."""
    file, told = kept / f"{part.name}.parquet", about(part.name, kept)
    assert told is not None
    with tempfile.TemporaryDirectory() as folder, duckdb.connect() as database:
        database.execute(f"CREATE VIEW kept AS FROM {sql_text(file)}")
        before = _scores(database, "kept")
        share = max(1, min(SHARE, len({name[:-1] for name in before}) // LEAST))
        for number in random.SystemRandom().sample(range(share), share):
            play(*_some(part, f"{1 + number}/{share}"), Path(folder) / part.name, root)
            store = None if _PROFILE in part.script else RunStore(Path(folder) / part.name)
            with store.database() if store else _numbers(Path(folder) / part.name) as again:
                now = _scores(again, "summary")
            if {name[-1] for name in now} == {name[-1] for name in before}:
                break  # of each tracker something was played again
        other = [name for name, scores in now.items() if before.get(name) != scores]
        for name in other:
            print(f"{part.name}: another result now: {' '.join(map(str, name))}", flush=True)
        if not other:
            print(f"{part.name}: the same to the bit in {len(now)} results played again", flush=True)
            keep(file, database, "FROM kept", {**told, **made_by(store)})
    return not other


def _some(part: Part, share: str) -> tuple[Part, str]:
    """A part with the script that plays a few of its episodes, K/N of them, and options that are added."""
    if profiled := _PROFILED.search(part.script):
        chosen = random.SystemRandom().sample(profiled[0].split(), 2)
        return replace(part, script=_PROFILED.sub(" ".join([*chosen, ""]), part.script)), ""
    if _LIMIT not in part.script:
        return part, f"--part {share}"
    axes = _AXIS.findall(part.script)
    axes.remove(random.SystemRandom().choice(axes))
    script = _AXIS.sub(lambda one: "" if one[0] in axes else one[0], part.script)
    return replace(part, script=_BUDGET.sub(f"--budget {LEAST_EPISODES}", script)), ""


def _scores(database: duckdb.DuckDBPyConnection, table: str) -> dict[tuple[Any, ...], str]:
    """Digest of the frames and every score of a result, but times, by what names it."""
    found = database.execute(f"SELECT * FROM {table}").fetchall()
    columns = [column[0] for column in database.description or []]
    rows = [dict(zip(columns, row, strict=True)) for row in found]
    return {
        tuple(row[name] for name in _EPISODE): repr(
            {name: row[name] for name in sorted(row) if name not in _OF_A_RUN and not name.startswith("ms_")}
        )
        for row in rows
    }


def main(names: Sequence[str]) -> None:
    """Make what is stale of these parts, or of all, and cannot be confirmed; `--list` says which, and their hours."""
    known = {one.name: one for one in parts()}
    wanted = [one for one in names if one != "--list"]
    if unknown := [one for one in wanted if one not in known]:
        sys.exit(f"no such part: {', '.join(unknown)} (there are {', '.join(known)})")
    for name in wanted or known:
        reasons, told = stale(known[name]), about(name)
        hours = f"{told['hours']:.1f} h" if told else "hours unknown"
        print(f"{name}: {'up to date' if not reasons else 'made by ' + ', '.join(reasons)}; {hours}", flush=True)
        if not reasons or "--list" in names or (told and ANOTHER_COMMAND not in reasons and confirm(known[name])):
            continue
        if not make(known[name], more=os.environ.get("MORE", "")):
            print(f"{name}: not finished", flush=True)


if __name__ == "__main__":
    try:
        main(sys.argv[1:])
    except PftrackError as error:
        sys.exit(f"results: {error}")
