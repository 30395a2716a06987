"""The working folder of a stranger is not executed."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from pftrack_sim.benchmark import run
from pftrack_sim.cli import names_factory
from tests.benchmark.small import small_plan

OPTIONAL = ("winreg", "_winreg", "nt", "msvcrt", "_scproxy", "yaml", "tornado", "PyQt6", "IPython", "gi", "wx")
"""Modules that installed ones try to import."""

STANDARD = ("ctypes", "json", "multiprocessing", "pickle", "selectors", "signal", "socket", "struct")
"""Modules that `python -c` would take from the working folder, in processes that a command starts."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run folder with files that Python or a library would take from the working folder."""
    path = run(small_plan(range(1)), tmp_path_factory.mktemp("stranger") / "run", videos="first").path
    for name in (*OPTIONAL, *STANDARD, "sitecustomize", "usercustomize", "mine"):
        (path / f"{name}.py").write_text(f"open({str(path / 'executed')!r}, 'a').write({name!r})\n")
    (path / "matplotlibrc").write_text("text.usetex: True\nbackend: module://mine\nfont.size: 90\n")
    (path / "mine.toml").write_text('trackers = ["stay"]\nseeds = "0:5"\n')
    return path


def commands(*words: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [str(Path(sys.executable).with_name("pftrack-sim")), *words]
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    return subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, timeout=300)


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [
        ["report", ".", "--figure", "success.png"],
        ["report", "."],
        ["check", "."],
        ["query", ".", "SELECT tracker FROM summary"],
        ["merge", "all", "."],
        ["list", "trackers"],
        [
            *("bench", "corridor", "--trackers", "stay", "--isolation", "always", "--workers", "1", "--videos", "none"),
            *("--seeds", "0:1", "--set", "duration_s=0.3", "--out", "../of-a-stranger"),
        ],
    ],
)
def test_commands_execute_nothing_of_the_folder(folder: Path, words: list[str]):
    done = commands(*words, cwd=folder)
    assert done.returncode == 0, done.stderr
    assert not (folder / "executed").exists(), (folder / "executed").read_text()


def test_a_figure_is_drawn_with_the_settings_of_this_package(folder: Path, monkeypatch: pytest.MonkeyPatch):
    matplotlib = pytest.importorskip("matplotlib")
    from pftrack_sim.report import write_figure

    with matplotlib.rc_context():
        plain = write_figure(folder, folder / "plain/success.svg").read_bytes()
        matplotlib.rc_file(folder / "matplotlibrc")
        assert write_figure(folder, folder / "set/success.svg").read_bytes() == plain


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        (["bench", "corridor", "--trackers=mine:make"], True),
        (["follow", "corridor", "--trackers", "stay,pkg.mine:Factory[a=1]"], True),
        (["render", "corridor", "--trackers", "stay", "--seed", "3"], False),
        (["bench", "corridor", "--scheduler", "tcp://10.0.0.1:8786", "--seeds", "0:20"], False),
        (["report", "run", "--figure", "a:b"], False),
        (["query", "run", "SELECT a::b"], False),
        ([], False),
    ],
)
def test_the_working_folder_is_searched_for_a_factory_only(words: list[str], wanted: bool):
    assert names_factory(words) == wanted


def test_a_suite_that_names_a_factory_is_searched_for_it(tmp_path: Path):
    for text, wanted in (('trackers = ["mine:make"]\n', True), ('seeds = "0:5"\ntrackers = ["stay"]\n', False)):
        (tmp_path / "suite.toml").write_text(text)
        assert names_factory(["bench", str(tmp_path / "suite.toml")]) == wanted
