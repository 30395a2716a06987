"""Programs in a Python process of their own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
WITHOUT_OPENGL = {"PYTHONPATH": os.pathsep.join([str(ROOT / "tests" / "without_opengl"), str(ROOT)])}
"""Environment variables with which no OpenGL library can be loaded."""
LIMIT_S = 300.0
"""It is generous, because it finds hangs and judges no speed."""


def printed(program: str, *words: str, ends_with: int = 0, **environment: str) -> str:
    """What a program prints to standard output.

    Args:
        program: Python code.
        words: Its `sys.argv[1:]`.
        ends_with: Exit code that is expected; negative, the signal's.
        environment: Variables that this process does not have, or has otherwise.
    """
    done = subprocess.run(
        [sys.executable, "-c", program, *words],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, **environment},
        timeout=LIMIT_S,
    )
    assert done.returncode == ends_with, done.stderr
    return done.stdout
