"""`make results` makes the tables of a page by the commands above them, once, and marks those that are stale."""

from pathlib import Path

import duckdb
import pytest
import results
from results import Part, about, confirm, make, parts, stale

SMALL = "--set camera.width_px=64 --set camera.height_px=48 --set lights.shadows=false --set duration_s=0.3 --workers 0"
PAGE = f"""# Page

    C="corridor"
    pftrack-sim bench $C --trackers stay --seeds 0:2 {SMALL} \\
      --videos none --out runs/tiny
    pftrack-sim query runs/tiny "FROM summary"

<!-- tables of tiny -->
<!-- end -->
<!-- tables of other -->
<!-- end -->
"""


@pytest.fixture
def part(tmp_path: Path) -> Part:
    page = tmp_path / "docs" / "page.md"
    page.parent.mkdir()
    page.write_text(PAGE)
    (found,) = parts([page])
    return found


def test_every_table_of_a_run_on_the_pages_has_its_command():
    names = [one.name for one in parts()]
    assert {"ko2012", "lee2012", "kwon2005", "courses", "stress"} <= set(names)
    assert len(set(names)) == len(names)
    blocks = {name for page in results.PAGES for name in results._BLOCK.findall(page.read_text())}
    assert set(names) == blocks


@pytest.mark.slow
def test_a_part_is_made_once_and_again_where_command_or_code_is_another(
    part: Part, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    assert part.script.splitlines()[0] == 'C="corridor"'
    assert part.script.endswith("--videos none --out runs/tiny")
    kept = tmp_path / "kept"
    assert stale(part, kept) == ["code that was not recorded"]
    assert not make(part, tmp_path, kept, more="--part 1/2"), "a part of it is not finished"
    assert about("tiny", kept) is None
    assert make(part, tmp_path, kept)
    assert "\n| `stay` | 0." in part.page.read_text()
    assert stale(part, kept) == []
    with duckdb.connect() as database:
        rows = database.execute(f"SELECT seed, mean_overlap, frames_digest FROM '{kept / 'tiny.parquet'}'").fetchall()
    assert [row[0] for row in rows] == [0, 1]
    assert len({row[2] for row in rows}) == 2
    assert (kept / "tiny.parquet").stat().st_size < 20_000
    told = about("tiny", kept)
    assert told is not None
    assert told["hours"] > 0.0
    assert stale(Part(part.name, part.page, part.script + " "), kept) == ["another command"]
    monkeypatch.setattr(results, "environment", lambda: {**told["environment"], "code of the scores": "0"})
    assert stale(part, kept) == ["other code of the scores"]
    monkeypatch.undo()
    monkeypatch.setattr(results, "code_of", lambda spec: {"stay": "0"})
    assert stale(part, kept) == ["other code of stay"]


@pytest.mark.slow
def test_a_part_that_other_code_made_stays_where_it_is_the_same_to_the_bit(
    part: Part, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    kept = tmp_path / "kept"
    assert make(part, tmp_path, kept)
    file, told = kept / "tiny.parquet", about("tiny", kept)
    assert told is not None
    old = {**told, "environment": {**told["environment"], "code of the simulator": "0"}}

    def of_other_code(query: str) -> None:
        with duckdb.connect() as database:
            results.keep(file, database, query, old)

    of_other_code(f"FROM '{file}'")
    assert stale(part, kept) == ["other code of the simulator"]
    assert confirm(part, tmp_path, kept)
    assert "the same to the bit in 2 results" in capsys.readouterr().out
    assert stale(part, kept) == []
    of_other_code(f"SELECT * REPLACE (if(seed = 1, 0.5, mean_overlap) AS mean_overlap) FROM '{file}'")
    assert not confirm(part, tmp_path, kept)
    assert "another result now: open corridor base 1 stay" in capsys.readouterr().out
    assert stale(part, kept) == ["other code of the simulator"]


@pytest.mark.slow
def test_a_part_is_not_confirmed_before_each_of_its_trackers_was_played_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    page = tmp_path / "docs" / "page.md"
    page.parent.mkdir()
    page.write_text(
        f"    pftrack-sim follow corridor --trackers oracle,stay --seeds 0:4 {SMALL} --videos none --out runs/tiny\n\n"
        "<!-- tables of tiny -->\n<!-- end -->\n"
    )
    (part,) = parts([page])
    kept = tmp_path / "kept"
    assert make(part, tmp_path, kept)
    file, told = kept / "tiny.parquet", about("tiny", kept)
    assert told is not None
    assert [one["name"] for one in told["trackers"]] == ["oracle", "stay"]
    with duckdb.connect() as database:
        changed = "SELECT * REPLACE (if(label LIKE 'stay%', 0.5, mean_overlap) AS mean_overlap)"
        results.keep(file, database, f"{changed} FROM '{file}'", told)
    monkeypatch.setattr(results, "LEAST", 1)  # one drive of eight, so one of the two trackers, at a time
    assert not confirm(part, tmp_path, kept)
    said = capsys.readouterr().out
    assert "another result now: " in said
    assert all(" stay" in line for line in said.splitlines() if "another result now" in line)


@pytest.mark.slow
def test_a_search_is_a_part_whose_first_episodes_on_an_axis_are_played_again(tmp_path: Path):
    page = tmp_path / "docs" / "page.md"
    page.parent.mkdir()
    page.write_text(
        "    pftrack-sim limit corridor --axis noise=1:64 --axis light=1:4 --trackers ncc --seeds 0:40 --budget 24 "
        f"{SMALL} --no-videos --out runs/tiny\n\n<!-- tables of tiny -->\n<!-- end -->\n"
    )
    (part,) = parts([page])
    kept = tmp_path / "kept"
    assert make(part, tmp_path, kept)
    assert "| What breaks in corridor | noise [x analogue gain] | light [EV] | first |" in page.read_text()
    assert confirm(part, tmp_path, kept)


@pytest.mark.slow
def test_a_profile_is_a_part_of_which_two_scenarios_are_measured_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    page = tmp_path / "docs" / "page.md"
    page.parent.mkdir()
    page.write_text(
        "    pftrack-sim profile corridor plaza-walk --seeds 1 --set camera.width_px=64 --set camera.height_px=48 "
        "--set duration_s=1 --out runs/tiny\n\n<!-- tables of tiny -->\n<!-- end -->\n"
    )
    (part,) = parts([page])
    kept = tmp_path / "kept"
    assert make(part, tmp_path, kept)
    assert "| `stay_overlap` | " in page.read_text()
    assert (page.parent / "pictures/tiny.webp").is_file()
    assert stale(part, kept) == []
    assert confirm(part, tmp_path, kept)
    assert "the same to the bit in 2 results" in capsys.readouterr().out
    told = about("tiny", kept)
    assert told is not None
    with duckdb.connect() as database:
        results.keep(
            kept / "tiny.parquet", database, f"SELECT * REPLACE (9.0 AS sharpness) FROM '{kept / 'tiny.parquet'}'", told
        )
    assert not confirm(part, tmp_path, kept)
    assert "another result now: None corridor None None None" in capsys.readouterr().out


def test_the_site_marks_tables_that_are_older_than_the_code(monkeypatch: pytest.MonkeyPatch):
    pytest.importorskip("mkdocs", reason="the extra docs is not installed")
    import hooks

    block = "<!-- tables of ko2012 -->\n\n| Mean overlap | mean |\n| --- | --- |\n| `a` | 1 |\n\n<!-- end -->"
    monkeypatch.setattr(results, "stale", lambda part: ["other code of the scores"])
    marked = hooks.TABLES.sub(hooks.folded, block)
    assert marked.startswith("Older than this version: made by other code of the scores.\n\n<details")
    monkeypatch.setattr(results, "stale", lambda part: [])
    assert hooks.TABLES.sub(hooks.folded, block).startswith("<details")
    assert hooks.TABLES.sub(hooks.folded, "<!-- tables of standard-1 -->\n<!-- end -->") == "", "not made yet"


def test_a_wrong_part_says_which_there_are(capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit, match=r"no such part: ko \(there are ko2012, "):
        results.main(["ko"])
    results.main(["--list", "ko2012"])
    said = capsys.readouterr().out
    assert said.startswith("ko2012: ")
