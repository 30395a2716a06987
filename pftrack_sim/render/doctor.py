"""What can draw on this machine, and what is missing where something cannot."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import asdict, dataclass

from pftrack_sim.core.errors import RenderError
from pftrack_sim.render.gl.context import REMEDIES, GLInfo, candidates, probe
from pftrack_sim.render.selection import WARP_REMEDY, warp_installed

_PATIENCE_S = 60.0
"""How long a library may take to open; a broken driver can hang."""


@dataclass(frozen=True)
class Attempt:
    """One OpenGL library.

    Attributes:
        backend: Its name.
        info: What it says of itself, or None if it cannot draw.
        problem: Why not; empty if it can.
    """

    backend: str
    info: GLInfo | None
    problem: str = ""


@dataclass(frozen=True)
class Report:
    """What was found.

    Attributes:
        attempts: Every OpenGL library that this system may have, in the order they are tried.
        warp: Whether the ray caster is installed, which needs no OpenGL.
    """

    attempts: tuple[Attempt, ...]
    warp: bool = False

    @property
    def chosen(self) -> Attempt | None:
        """The first OpenGL library that can draw; None if none can."""
        return next((attempt for attempt in self.attempts if attempt.info is not None), None)

    @property
    def usable(self) -> bool:
        """Whether anything can draw."""
        return self.chosen is not None or self.warp

    def lines(self) -> list[str]:
        """The report as text, a line each."""
        lines = [f"{attempt.backend}: {_sentence(attempt)}" for attempt in self.attempts]
        lines.append("warp: installed" if self.warp else f"warp: not installed; it needs\n{WARP_REMEDY}")
        if self.chosen is not None:
            return [*lines, f"Frames are drawn with {self.chosen.backend}."]
        if self.warp:
            return [*lines, "Frames are drawn with warp, as no OpenGL library can draw."]
        return [*lines, "Nothing can draw. Install one of:", *REMEDIES.splitlines(), *WARP_REMEDY.splitlines()]


def report() -> Report:
    """Try every OpenGL library, each in a process of its own: one process can use only one, and drivers crash."""
    return Report(tuple(_attempt(backend) for backend in candidates()), warp_installed())


def _sentence(attempt: Attempt) -> str:
    info = attempt.info
    if info is None:
        return attempt.problem
    return f"works ({info.renderer}; {info.vendor}; OpenGL {info.version})"


def _attempt(backend: str) -> Attempt:
    command = [sys.executable, "-m", __name__, backend]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=_PATIENCE_S, check=False)
    except subprocess.TimeoutExpired:
        return Attempt(backend, None, f"does not answer within {_PATIENCE_S:.0f} s")
    except OSError as error:
        return Attempt(backend, None, f"could not be tried: {error}")
    if done.returncode:
        return Attempt(backend, None, f"crashes (exit code {done.returncode})")
    answer = json.loads(done.stdout.splitlines()[-1])
    return Attempt(backend, GLInfo(**answer)) if isinstance(answer, dict) else Attempt(backend, None, answer)


def _main() -> None:
    """In a process of its own: print what a library says of itself, or why it cannot draw, as JSON."""
    try:
        answer: object = asdict(probe(sys.argv[1]))
    except RenderError as error:
        answer = str(error)
    sys.stdout.write(json.dumps(answer) + "\n")


if __name__ == "__main__":
    _main()
