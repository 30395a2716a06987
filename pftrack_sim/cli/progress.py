"""Progress on standard error, so that tables can be piped: a bar, lines, or JSON."""

from __future__ import annotations

import json
import math
import shlex
import signal
import sys
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager, nullcontext
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from pftrack_sim.core.errors import ParameterError

if TYPE_CHECKING:
    from pftrack_sim.benchmark.running.progress import RunProgress

MODES = ("bar", "lines", "json", "quiet")
"""A bar, which is usual on a terminal; a line every few seconds, elsewhere; a line of JSON per episode; nothing."""

_LINE_EVERY_S = 5.0


@contextmanager
def progress_bar(what: str, total: int, *, resumes: bool = False) -> Generator[Callable[[], None]]:
    """Show progress while the block runs: it gets a function to call once for each of `total` units.

    After Ctrl-C it is said how far it came, and, with `resumes`, that the same command goes on.
    """
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as shown:
        task = shown.add_task(what, total=total)
        try:
            yield lambda: shown.advance(task)
        except KeyboardInterrupt:
            done = f"pftrack-sim: stopped {what}, {shown.tasks[0].completed:g} of {total} are finished"
            shown.console.print(f"{done}; the same command goes on" if resumes else done, markup=False, soft_wrap=True)
            raise


@contextmanager
def show_run(mode: str, path: Path, what: str) -> Generator[Callable[[RunProgress], None]]:
    """Show a run's progress while the block runs: it gets a function to call with every status.

    `mode` is one of `MODES`, or empty. `what` is run in `path` is said when it begins, after names and parameters were
    found right. After Ctrl-C the command that resumes it is printed.
    """
    from pftrack_sim.benchmark import Interrupted

    chosen = mode or ("bar" if sys.stderr.isatty() else "lines")
    if chosen not in MODES:
        raise ParameterError(f"progress must be one of {', '.join(MODES)}, got {mode!r}")
    try:
        if chosen in ("json", "quiet"):
            yield _show_json if chosen == "json" else lambda _: None
            return
        say_first_video, begun = _first_video(path / "videos"), False
        with _bar() if chosen == "bar" else nullcontext(_lines()) as show:

            def show_all(status: RunProgress) -> None:
                nonlocal begun
                if not begun:
                    _say(f"{what}: {path}")
                begun = True
                show(status)
                say_first_video(status)

            yield show_all
    except Interrupted as stopped:
        # A second Ctrl-C during the exit would print a traceback.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        _say(f"pftrack-sim: {stopped}. Resume with: {_resume_command(path)}")
        sys.exit(130)


def _say(line: str) -> None:
    print(line, file=sys.stderr, flush=True)  # noqa: T201 - this is the command line


def _first_video(folder: Path) -> Callable[[RunProgress], None]:
    """Says where the first video of a run is, as soon as there is one."""
    unsaid = next(folder.rglob("*.mp4"), None) is None

    def show(status: RunProgress) -> None:
        nonlocal unsaid
        if unsaid and status.episode is not None and (video := next(folder.rglob("*.mp4"), None)) is not None:
            unsaid = False
            _say(f"first video: {video}")

    return show


@contextmanager
def _bar() -> Generator[Callable[[RunProgress], None]]:
    """Shows a bar; what is printed meanwhile goes above it."""
    columns = (BarColumn(), TextColumn("{task.description}", markup=False))
    with Progress(*columns, console=Console(stderr=True), transient=True) as shown:
        task = shown.add_task("starting workers and checking trackers", total=1.0)
        yield lambda status: shown.update(task, completed=status.share, description=_line(status))


def _lines() -> Callable[[RunProgress], None]:
    """Prints a line every few seconds, and one at the end."""
    last_s = time.monotonic()

    def show(status: RunProgress) -> None:
        nonlocal last_s
        now_s, finished = time.monotonic(), status.episode is not None and status.done == status.total
        if finished or now_s - last_s >= _LINE_EVERY_S:
            last_s = now_s
            _say(_line(status))

    return show


def _show_json(status: RunProgress) -> None:
    if status.episode is None:
        return
    record = {
        "episode": status.episode,
        "done": status.done,
        "total": status.total,
        "frames": status.frames,
        "elapsed_s": round(status.elapsed_s, 3),
        "left_s": None if math.isnan(status.left_s) else round(status.left_s, 1),
        "means": {name: None if math.isnan(mean) else mean for name, mean in status.means.items()},
        "errors": dict(status.errors),
    }
    _say(json.dumps(record))


def _line(status: RunProgress) -> str:
    means = ", ".join(
        f"{name} {mean:.3f}" + (f" ({status.errors[name]} with an error)" if status.errors.get(name) else "")
        for name, mean in status.means.items()
        if not math.isnan(mean)
    )
    left = "" if math.isnan(status.left_s) else f"  {timedelta(seconds=round(status.left_s))} left"
    return f"{status.done} of {status.total} episodes, {status.frames} frames{left}  {means}".rstrip()


def _resume_command(path: Path) -> str:
    words = ["pftrack-sim", *sys.argv[1:]]
    if not any(word == "--out" or word.startswith("--out=") for word in words):
        words += ["--out", str(path)]
    return shlex.join(words)
