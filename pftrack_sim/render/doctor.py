"""Checks which renderers work on this machine, and what is missing for those that do not."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import asdict, dataclass

from pftrack_sim.core.errors import RenderError
from pftrack_sim.render.gl.context import INSTALL_HINTS, OpenGLInfo, candidates, probe
from pftrack_sim.render.renderer import WARP_INSTALL_HINT, warp_installed

_TIMEOUT_S = 60.0  # How long a library may take to open; a broken driver can hang


@dataclass(frozen=True)
class BackendCheck:
    """Result for one OpenGL library: its information, or None and the reason why it cannot draw."""

    backend: str
    info: OpenGLInfo | None
    problem: str = ""

    def __str__(self) -> str:
        """One line."""
        if self.info is None:
            return f"{self.backend}: {self.problem}"
        return f"{self.backend}: works ({self.info.renderer}; {self.info.vendor}; OpenGL {self.info.version})"


@dataclass(frozen=True)
class Report:
    """Results for all renderers.

    Attributes:
        checks: The OpenGL libraries of this system, in the order they are tried.
        warp: Whether the ray caster, which needs no OpenGL, is installed.
    """

    checks: tuple[BackendCheck, ...]
    warp: bool = False

    @property
    def chosen(self) -> BackendCheck | None:
        """The first OpenGL library that can draw; None if none can."""
        return next((check for check in self.checks if check.info is not None), None)

    @property
    def usable(self) -> bool:
        """Whether any renderer works."""
        return self.chosen is not None or self.warp

    def lines(self) -> list[str]:
        """The report as text."""
        lines = [str(check) for check in self.checks]
        lines.append("warp: installed" if self.warp else f"warp: not installed; it needs\n{WARP_INSTALL_HINT}")
        if self.chosen is not None:
            return [*lines, f"Frames are drawn with {self.chosen.backend}."]
        if self.warp:
            return [*lines, "Frames are drawn with warp, as no OpenGL library can draw."]
        return [*lines, "Nothing can draw. Install one of:", *f"{INSTALL_HINTS}\n{WARP_INSTALL_HINT}".splitlines()]


def report() -> Report:
    """Check every renderer, OpenGL libraries in a process each: a process can use only one, and drivers may crash."""
    return Report(tuple(_check(backend) for backend in candidates()), warp_installed())


def _check(backend: str) -> BackendCheck:
    command = [sys.executable, "-m", __name__, backend]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=_TIMEOUT_S, check=False)
    except subprocess.TimeoutExpired:
        return BackendCheck(backend, None, f"does not answer within {_TIMEOUT_S:.0f} s")
    except OSError as error:
        return BackendCheck(backend, None, f"could not be tried: {error}")
    if done.returncode:
        return BackendCheck(backend, None, f"crashes (exit code {done.returncode})")
    answer = json.loads(done.stdout.splitlines()[-1])
    if isinstance(answer, str):
        return BackendCheck(backend, None, answer)
    return BackendCheck(backend, OpenGLInfo(**answer))


def _main() -> None:
    """Print, as JSON, the information of the OpenGL library given as argument, or the reason why it cannot draw."""
    try:
        answer: object = asdict(probe(sys.argv[1]))
    except RenderError as error:
        answer = str(error)
    sys.stdout.write(json.dumps(answer) + "\n")


if __name__ == "__main__":
    _main()
