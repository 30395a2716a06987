"""Runs the code blocks of a page in a folder, in order: `sh`, `python`, and files, whose blocks have a title.

A block of one line with the title of a file that is there replaces the assignment to the same name in it.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

_BLOCK = re.compile(r'^```(sh|python|toml)(?: title="([\w.-]+)")?\n(.*?)^```', re.MULTILINE | re.DOTALL)


def blocks(page: Path) -> list[tuple[str, str, str]]:
    """Language, title ("" without) and content of every block that runs or is a file."""
    return _BLOCK.findall(page.read_text(encoding="utf-8"))


def run_page(page: Path, folder: Path) -> str:
    """Run a page in a folder.

    Returns:
        What the commands printed.

    Raises:
        RuntimeError: A command or a program failed; the message holds it and its output.
    """
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    environment |= {"MPLBACKEND": "agg"}
    printed = ""
    for language, title, block in blocks(page):
        content = block
        if title:
            file, name = folder / title, content.partition(" = ")[0]
            if file.exists() and content.count("\n") == 1:
                content = re.sub(rf"^{name} = .*\n", content, file.read_text(encoding="utf-8"), flags=re.MULTILINE)
            file.write_text(content, encoding="utf-8")
            continue
        if language == "toml":
            continue
        for command in [content] if language == "python" else content.splitlines():
            words = [sys.executable, "-c", command] if language == "python" else ["sh", "-c", command]
            done = subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True, check=False)
            if done.returncode:
                raise RuntimeError(f"{page.name}: {command}\n{done.stdout}{done.stderr}")
            printed += done.stdout
    return printed
