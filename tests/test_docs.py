"""The site: its blocks run as they stand, its pictures are there, and its navigation knows every page."""

import re
import shlex
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import typer
from blocks import blocks, run_page
from pictures import PICTURES, TUTORIALS
from plots import PLOTS, draw
from robots import SIZE, views

from pftrack_sim import scenario
from pftrack_sim.cli.app import app
from pftrack_sim.scenario.axes import axes_by_name
from tests.contrast import faint_texts

DOCS = Path(__file__).parent.parent / "docs"
WITHOUT_PICTURE = ("detector",)
"""Axes that do not change frames."""

WITH_CODE = [page for page in sorted(DOCS.rglob("*.md")) if blocks(page) and page.stem != "first-tracker"]


@pytest.mark.slow
@pytest.mark.parametrize("page", WITH_CODE, ids=lambda page: page.stem)
def test_blocks_run(page: Path, tmp_path: Path):
    run_page(page, tmp_path)
    if page.stem in TUTORIALS:
        assert (tmp_path / TUTORIALS[page.stem]).is_file()


def test_every_scenario_axis_and_tutorial_has_its_picture():
    names = [
        *(f"scenarios/{name.replace('/', '-')}" for name in scenario.names()),
        *(f"axes/{name}" for name in axes_by_name() if name not in WITHOUT_PICTURE),
        *(f"tutorials/{page}" for page in TUTORIALS),
        *(f"studio/{state}" for state in ("running", "lost", "drawing")),
    ]
    for name in ("studio/minute.mp4", "design/rooms.svg", "design/episode.svg"):
        assert (PICTURES / name).is_file(), "make pictures"
    assert [name for name in names if not (PICTURES / f"{name}.webp").is_file()] == [], "make pictures"
    assert sum(path.stat().st_size for path in PICTURES.rglob("*") if path.is_file()) < 5e6
    for page in TUTORIALS:
        assert f"pictures/tutorials/{page}.webp" in (DOCS / f"{page}.md").read_text(encoding="utf-8")


def test_plots_of_results_are_those_of_their_tables(tmp_path: Path):
    drawn = draw(DOCS / "results.md", tmp_path)
    assert [path.stem for path in drawn] == list(PLOTS)
    for path in drawn:
        committed = PICTURES / "results" / path.name
        assert committed.read_text(encoding="utf-8") == path.read_text(encoding="utf-8"), "make pictures PARTS=results"
    page = tmp_path / "page.md"
    page.write_text(
        "<!-- tables of ko2012 -->\n\n| Table 2: as printed | video-1 | mean |\n| --- | --- | --- |\n"
        "| `other` | 9 / 8 | 70.0 / 20.0 (10.0 to 30.0) |\n| `stay` | - | - / 15.0 |\n"
        "| `best[of=all]` | 9 / 8 | 80.0 / 40.0 (35.0 to 45.0) |\n\n<!-- end -->\n",
        encoding="utf-8",
    )
    text = draw(page, tmp_path)[0].read_text(encoding="utf-8")
    assert "best[of=all] 40.0, printed 80.0; other 20.0, printed 70.0</title>" in text
    assert ">stay 15.0<" in text
    assert re.findall(r'cx="([\d.]+)"', text) == ["299.2", "241.6"]  # 288 px from 0 to 100, from 184
    assert 'd="M284.8 ' in text
    page.write_text(page.read_text(encoding="utf-8").replace("of=all", "long=" + 20 * "x"), encoding="utf-8")
    wide = draw(page, tmp_path)[0].read_text(encoding="utf-8")
    starts = [int(re.findall(r'viewBox="(-?\d+) ', one)[0]) for one in (text, wide)]
    assert starts[0] == 0
    assert starts[1] < 184 - 12 - 7 * len("best[long=]" + 20 * "x"), "a long name has room"


def test_a_robot_is_drawn_from_outside_and_what_it_sees_below(tmp_path: Path):
    file = tmp_path / "plaza.toml"
    file.write_text('extends = "follow/plaza"\n', encoding="utf-8")
    sheet = views(file)
    assert sheet.shape == (2 * SIZE[1], SIZE[0], 3)
    assert sheet[: SIZE[1]].std() > 20 < sheet[SIZE[1] :].std()


def test_code_blocks_are_of_languages_that_are_run():
    other = {
        f"{page.name}: {language}"
        for page in DOCS.rglob("*.md")
        for language in re.findall(r"^```(\w+)", page.read_text(encoding="utf-8"), re.MULTILINE)
        if language not in ("sh", "python", "toml", "text")
    }
    assert other == set()


INDENTED = [
    (page.name, found[0])
    for page in [*sorted(DOCS.rglob("*.md")), DOCS.parent / "README.md"]
    for found in re.finditer(
        r"^    pftrack-sim (?:[^\n\"']|\"[^\"]*\"|'[^']*'|(?<=\\)\n)+", page.read_text(encoding="utf-8"), re.MULTILINE
    )
]
"""Commands that are shown without being run: they take long, or need files or another machine."""


def test_commands_that_are_not_run_are_known_to_the_command_line():
    group: Any = typer.main.get_command(app)
    wrong: list[str] = []
    for page, text in INDENTED:
        words = shlex.split(text.partition("  #")[0])[1:]
        words = words[: next((at for at, word in enumerate(words) if word in ("|", "&&", ">")), len(words))]
        try:
            group.commands[words[0]].make_context(words[0], words[1:])
        except Exception as error:  # noqa: BLE001 - whatever is wrong with it
            wrong.append(f"{page}: {' '.join(words)}: {error!r}")
    assert len(INDENTED) > 40
    assert wrong == []


def test_files_and_functions_that_pages_name_exist():
    root = DOCS.parent
    source = "\n".join(path.read_text(encoding="utf-8") for path in (root / "pftrack_sim").rglob("*.py"))
    defined = set(re.findall(r"^ *(?:def|class) (\w+)|^ *(\w+)(?:: [^=\n]+)? = ", source, re.MULTILINE))
    names = {one or other for one, other in defined}
    wrong: list[str] = []
    named = 0
    for page in [*sorted(DOCS.rglob("*.md")), root / "README.md", root / "CONTRIBUTING.md"]:
        text = page.read_text(encoding="utf-8")
        # From the root, from the package, or, on pages of papers, from the trackers.
        for file in re.findall(r"`([\w/]+/\w+\.py)`", text):
            if not any((base / file).is_file() for base in (root, root / "pftrack_sim", root / "pftrack_sim/trackers")):
                wrong.append(f"{page.name}: {file}")
        for table in re.findall(
            r"^\|[^\n]*\| Implementation \|[^\n]*\n\|[^\n]*\n((?:\|[^\n]*\n)+)", text, re.MULTILINE
        ):
            for row in table.splitlines():
                for name in re.findall(r"`(?:\w+\.)*(\w+)`", row.split(" | ")[2]):
                    named += 1
                    wrong += [] if name in names else [f"{page.name}: {name}"]
    assert wrong == []
    assert named > 30


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder above `site`, which is built without a warning."""
    pytest.importorskip("mkdocs", reason="the extra docs is not installed")
    folder = tmp_path_factory.mktemp("built")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder / "site")]
    done = subprocess.run(command, cwd=DOCS.parent, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_texts_of_the_site_can_be_read(site: Path, launch_chromium: Callable[..., Any], scheme: str):
    browser = launch_chromium()
    for name in ("", "results/", "cli/", "environments/track/"):
        page = browser.new_page(color_scheme=scheme)
        page.goto((site / f"site/{name}index.html").as_uri())
        page.wait_for_timeout(500)  # the palette is chosen by a script
        assert faint_texts(page, 30) == [], name
    browser.close()


@pytest.mark.slow
def test_the_site_builds_with_every_page_and_link(site: Path):
    text = (site / "site" / "cli" / "index.html").read_text(encoding="utf-8")
    assert "pftrack-sim studio" in text
    assert "Root seed of the episode" in text
    track = (site / "site" / "environments" / "track" / "index.html").read_text(encoding="utf-8")
    assert "BoundingBox(640, 480)" in track
    assert "rgb_array_list" in track
    for page in ("results", "gallery", "index"):
        text = (site / "site" / page.removeprefix("index") / "index.html").read_text(encoding="utf-8")
        drawn = re.findall(r"<img[^>]+pictures/[^>]+(?:webp|png|jpg|results/\w+\.svg)[^>]*>", text)
        sizes = ['width="' in image for image in drawn]
        assert sizes, page
        assert all(sizes), f"{page}: nothing moves while pictures load"
    first = (site / "site" / "first-benchmark" / "index.html").read_text(encoding="utf-8")
    assert '<span class="whole">--seed</span>' in first, "no name of an option is broken"
    assert (site / "site" / "results" / "index.html").read_text(encoding="utf-8").count("<details>") == 8
