"""The first how-to is true: its code and its commands run as they stand, from an empty folder."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

DOCUMENT = Path(__file__).parent.parent / "docs/first-tracker.md"


def blocks(*languages: str) -> list[tuple[str, str]]:
    text = DOCUMENT.read_text(encoding="utf-8")
    return re.findall(rf"^```({'|'.join(languages)})\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


@pytest.mark.slow
def test_code_and_commands_run_in_order(tmp_path: Path):
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    source, said = tmp_path / "my_tracker.py", ""
    for language, block in blocks("python", "sh"):
        if language == "python":
            name = block.partition(" = ")[0]
            changed = (
                re.sub(rf"^{name} = .*\n", block, source.read_text(), flags=re.MULTILINE) if source.exists() else block
            )
            source.write_text(changed)
            continue
        for command in block.splitlines():
            done = subprocess.run(command, shell=True, cwd=tmp_path, env=environment, capture_output=True, text=True)
            assert done.returncode == 0, f"{command}\n{done.stderr}"
            said += done.stdout
    assert "SCALES = (0.98" in source.read_text()
    printed = re.search(r"my_tracker:make in v2 is better than .* by 0\.\d{3} \(.*\), 6 seeds", said)
    assert printed is not None, said
    assert (tmp_path / "runs/v2/comparison.html").is_file()
    assert (tmp_path / "look.mp4").is_file()


def test_the_document_is_code_and_commands():
    assert [language for language, _ in blocks("python", "sh")] == ["python", "sh", "sh", "python", "sh", "sh"]
    for language, block in blocks("python", "sh"):
        if language == "python":
            compile(block, str(DOCUMENT), "exec")
