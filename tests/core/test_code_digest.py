"""The digest of code: it changes with the code that runs, and with nothing else."""

from pathlib import Path

import pytest

from pftrack_sim import controllers, trackers
from pftrack_sim.core.code_digest import code_digest


@pytest.fixture
def modules(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    files = {
        "tracker_of_mine.py": "import numpy\nimport helper_of_mine\nfrom parts_of_mine import colour\nraise OSError",
        "helper_of_mine.py": "X = 1",
        "parts_of_mine/__init__.py": "",
        "parts_of_mine/colour.py": "from . import shape\nfrom .deep.edge import Y",
        "parts_of_mine/shape.py": "Z = 3",
        "parts_of_mine/deep/__init__.py": "",
        "parts_of_mine/deep/edge.py": "import tracker_of_mine\nfrom .. import shape\nY = 2",
        "unrelated_of_mine.py": "W = 1",
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path))
    return tmp_path


@pytest.mark.parametrize(
    "changed",
    [
        "tracker_of_mine.py",
        "helper_of_mine.py",
        "parts_of_mine/__init__.py",
        "parts_of_mine/colour.py",
        "parts_of_mine/shape.py",
        "parts_of_mine/deep/edge.py",
    ],
)
def test_a_change_of_what_is_imported_changes_the_digest(modules: Path, changed: str):
    before = code_digest("tracker_of_mine")
    (modules / changed).write_text((modules / changed).read_text() + "\n# changed")
    assert code_digest("tracker_of_mine") != before


def test_other_files_and_the_place_on_disk_change_nothing(modules: Path, tmp_path_factory: pytest.TempPathFactory):
    before = code_digest("tracker_of_mine")
    (modules / "unrelated_of_mine.py").write_text("W = 2")
    assert code_digest("tracker_of_mine") == before
    with pytest.MonkeyPatch.context() as patched:
        copied = tmp_path_factory.mktemp("copy")
        for path in modules.rglob("*.py"):
            (copied / path.relative_to(modules)).parent.mkdir(parents=True, exist_ok=True)
            (copied / path.relative_to(modules)).write_bytes(path.read_bytes())
        patched.syspath_prepend(str(copied))
        assert code_digest("tracker_of_mine") == before


def test_a_module_within_a_package_is_found_without_running_anything(modules: Path):
    (modules / "parts_of_mine/__init__.py").write_text("raise RuntimeError('imported')")
    before = code_digest("parts_of_mine.deep.edge")
    (modules / "parts_of_mine/shape.py").write_text("Z = 4")
    assert before
    assert code_digest("parts_of_mine.deep.edge") != before


@pytest.mark.parametrize("name", ["absent_of_mine", "sys", "parts_of_mine.absent", "helper_of_mine.absent", ""])
def test_what_has_no_source_has_no_digest(modules: Path, name: str):
    assert not code_digest(name)


def test_namespace_packages_are_looked_into(modules: Path):
    (modules / "space_of_mine/inner").mkdir(parents=True)
    (modules / "space_of_mine/inner/tracker.py").write_text("A = 1")
    before = code_digest("space_of_mine.inner.tracker")
    (modules / "space_of_mine/inner/tracker.py").write_text("A = 2")
    assert before
    assert code_digest("space_of_mine.inner.tracker") != before
    assert not code_digest("space_of_mine.inner")


def test_installed_modules_have_one_and_broken_ones_too(modules: Path):
    assert code_digest("pytest")
    (modules / "helper_of_mine.py").write_text("def (")
    assert code_digest("helper_of_mine")


def test_modules_of_a_package_of_one_s_own_count_and_no_others(modules: Path):
    before = code_digest("parts_of_mine.colour", own="parts_of_mine")
    for changed, counts in (("helper_of_mine.py", False), ("parts_of_mine/shape.py", True)):
        (modules / changed).write_text((modules / changed).read_text() + "\n# changed")
        assert (code_digest("parts_of_mine.colour", own="parts_of_mine") != before) == counts


def test_built_in_trackers_and_controllers_have_the_digest_of_what_they_import():
    digests = {name: trackers.code_digest(name) for name in ("pftrack", "ko2012", "ko2012-rgb", "stay")}
    assert all(digests.values())
    assert controllers.code_digest("servo")
    assert digests["ko2012"] == digests["ko2012-rgb"]
    assert len(set(digests.values())) == 3
