"""Submissions are whole, checked and played again; runs are placed among reference results."""

import math
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pftrack_sim.benchmark import RunStore, plan_all, run
from pftrack_sim.benchmark.reading.losses import overlaps_by_tag
from pftrack_sim.benchmark.reference.standing import board, place_of, standings
from pftrack_sim.benchmark.reference.submission import (
    Row,
    Submission,
    frames_of,
    make_submission,
    problems,
    read_submission,
    reference_folder,
    references,
    rows_of,
    write_submission,
)
from pftrack_sim.benchmark.reference.submission import _digest as digest_of
from pftrack_sim.benchmark.reference.verification import verify
from pftrack_sim.cli import results
from pftrack_sim.core.errors import ParameterError, PftrackError, RunError, UnknownNameError
from pftrack_sim.report.build import write_report
from pftrack_sim.report.markdown import update_document
from pftrack_sim.report.standing import standing_remarks, standing_tables
from tests.benchmark.small import SMALL, frozen_suite
from tests.cli.test_cli import pftrack_sim, refused, succeeds

TRACKERS = ("ncc", "stay")


@pytest.fixture(scope="module")
def suite(tmp_path_factory: pytest.TempPathFactory) -> str:
    return frozen_suite(tmp_path_factory.mktemp("suites") / "tiny-1.toml", {**SMALL, "duration_s": 0.8})


@pytest.fixture(scope="module")
def stores(suite: str, tmp_path_factory: pytest.TempPathFactory) -> list[RunStore]:
    """The suite in open and in closed loop, by both trackers."""
    folder, latency = tmp_path_factory.mktemp("runs"), dict.fromkeys(TRACKERS, 20.0)
    plans = [plan_all([suite]), plan_all([suite], closed_loop=True, latency_ms=latency)]
    return [run(plan, folder / plan.kind, videos="none") for plan in plans]


@pytest.fixture(scope="module")
def made(stores: list[RunStore]) -> dict[str, Submission]:
    return {name: make_submission(stores, name) for name in TRACKERS}


def changed(one: Submission, change: Callable[[dict[str, Any]], None]) -> Submission:
    """A submission whose rows were changed by somebody who knows how they are digested."""
    rows: list[Row] = []
    for row in one.rows:
        values = dict(row)
        change(values)
        rows.append(values)
    return replace(one, rows=tuple(rows), about=one.about.model_copy(update={"rows": digest_of(rows)}))


def better(row: dict[str, Any]) -> None:
    """Every overlap that counts is a fifth nearer to 1, and so are the scores."""
    _, counted, _ = frames_of(row)
    stored = np.frombuffer(row["overlap"], np.uint8).copy()
    stored[counted] += ((250 - stored[counted]) // 5).astype(np.uint8)
    row["overlap"] = stored.tobytes()
    row["mean_overlap"] = float((stored[counted] / 250).mean())
    row["success"] = float((stored[counted] >= 125).mean())


def test_a_submission_holds_every_episode_of_both_loops_and_reads_back(made: dict[str, Submission], tmp_path: Path):
    one = made["ncc"]
    assert [(row["kind"], row["seed"]) for row in one.rows] == [
        (kind, seed) for kind in ("open", "follow") for seed in range(5)
    ]
    assert [spec.label for spec in one.about.trackers] == ["ncc", "ncc@20ms+servo"]
    assert one.label == "ncc"
    assert one.about.sessions
    assert not any(session.command for session in one.about.sessions), "they hold paths of the machine"
    assert one.about.environment["code of the simulator"]
    write_submission(tmp_path / "ncc.parquet", one)
    again = read_submission(tmp_path / "ncc.parquet")
    assert again.about == one.about
    assert [{name: value for name, value in row.items() if value is not None} for row in again.rows] == [
        {name: value for name, value in row.items() if value is not None} for row in one.rows
    ]
    assert problems(again) == []


def test_its_frames_are_those_of_the_run(made: dict[str, Submission], stores: list[RunStore]):
    row = made["ncc"].rows[2]
    (result,) = [one for one in stores[0].results if one.label == "ncc" and one.seed == 2]
    kept = stores[0].frame_columns(result, ["overlap", "scored", "luminance"])
    overlaps, counted, tags = frames_of(row)
    np.testing.assert_allclose(overlaps, kept["overlap"], atol=0.5 / 250)
    assert overlaps[counted].mean() == pytest.approx(result.number("mean_overlap"), abs=0.5 / 250)
    assert counted.tolist() == [False, *kept["scored"][1:].tolist()]
    np.testing.assert_allclose(np.frombuffer(row["luminance"], np.uint8) / 255, kept["luminance"], atol=0.5 / 255)
    for name, by_episode in overlaps_by_tag(stores[0], "ncc").items():
        if (found := by_episode.get(("corridor", "base", 2))) is not None:
            assert overlaps[counted & tags[name]].mean() == pytest.approx(found, abs=0.5 / 250)


def test_damage_is_refused_on_reading(made: dict[str, Submission], tmp_path: Path):
    path = tmp_path / "one.parquet"
    one = made["stay"]
    rows = [{**row, "mean_overlap": 0.9} if row["seed"] == 3 else row for row in one.rows]
    write_submission(path, replace(one, rows=tuple(rows)))
    with pytest.raises(RunError, match="was changed since it was written"):
        read_submission(path)
    path.write_bytes(b"PAR1")
    with pytest.raises(RunError, match="is not a submission"):
        read_submission(path)
    with pytest.raises(RunError, match="is not a submission"):
        read_submission(tmp_path)
    for change, words in (
        ({"overlap": "text"}, "it lacks overlap"),
        ({"moment": b"1"}, "it lacks bytes of some frames"),
    ):
        write_submission(path, changed(one, lambda row, change=change: row.update(change)))
        with pytest.raises(RunError, match=words):
            read_submission(path)


def test_scores_that_its_frames_do_not_have_are_refused(made: dict[str, Submission], tmp_path: Path):
    def lie(row: dict[str, Any]) -> None:
        row["mean_overlap"] += 0.02 * (row["seed"] == 3 and row["kind"] == "open")

    path = tmp_path / "one.parquet"
    write_submission(path, changed(made["ncc"], lie))
    assert problems(read_submission(path)) == ["the scores of open corridor base 3 are not those of its frames"]
    done = pftrack_sim("submit", str(path))
    assert (done.returncode, done.stdout.splitlines()[-1]) == (1, "refused")
    one = made["ncc"]
    (said,) = problems(replace(one, rows=one.rows[1:]))
    assert said.startswith("1 episodes are missing")
    tracked = changed(one, lambda row: row.update(success=1.0 - row["success"]))
    assert len(problems(tracked)) == 5


def test_a_submission_is_of_one_tracker_and_one_code(
    stores: list[RunStore], made: dict[str, Submission], monkeypatch: pytest.MonkeyPatch
):
    opened, driven = made["ncc"].about.trackers
    other_code = driven.model_copy(update={"code": {**driven.code, "ncc": "0"}})
    for spec in (made["stay"].about.trackers[1], other_code):
        about = made["ncc"].about.model_copy(update={"trackers": (opened, spec)})
        assert any("its parts are of two trackers, or of other code: ncc and" in line
                   for line in problems(replace(made["ncc"], about=about)))  # fmt: skip
    alone = [row for row in made["ncc"].rows if row["kind"] == "open"]
    half = replace(made["ncc"], about=made["ncc"].about.model_copy(update={"trackers": (opened,)}), rows=tuple(alone))
    assert [line.split(" needs ")[1] for line in problems(half)] == ["one part each of follow and open, got open"]
    monkeypatch.setitem(stores[1].plan.environment, "numba", "0.1")
    with pytest.raises(RunError, match=r"was run with other code or versions than the other part:\n  numba: "):
        make_submission(stores, "ncc")


@pytest.mark.slow
def test_no_score_may_be_another_on_the_same_frames(made: dict[str, Submission]):
    for change in ({"follow_success": 2.0}, {"stay": 0.9}, {"follow_collision": 2.0}):
        kind = "open" if "stay" in change else "follow"
        lied = changed(made["stay"], lambda row, kind=kind, change=change: row["kind"] == kind and row.update(change))
        assert problems(lied) == []
        found = verify(lied, 1, share=5)
        assert {one.outcome for one in found.replayed} == {"different", "the same to the bit"}
        assert not found.good


@pytest.mark.slow
def test_the_last_digits_of_another_processor_are_close(made: dict[str, Submission]):
    """Without AVX-512 NumPy rounds otherwise: the mean overlap of the first box differs by 1e-16."""

    def round_otherwise(row: dict[str, Any]) -> None:
        row.update(stay=row["stay"] + 1e-15, mean_overlap=row["mean_overlap"] - 1e-15)

    found = verify(changed(made["ncc"], round_otherwise), 1, share=5)
    assert {one.outcome for one in found.replayed} == {"close"}
    assert found.good


@pytest.mark.slow
def test_a_submission_is_verified_and_a_tampered_one_refused(made: dict[str, Submission], tmp_path: Path):
    path = tmp_path / "one.parquet"
    write_submission(path, made["ncc"])
    done = succeeds("submit", str(path), "--verify", "--workers", "0")
    assert done.stdout.splitlines()[-2:] == ["2 of 10 episodes were played again: 2 the same to the bit", "verified"]
    tampered = changed(made["ncc"], better)
    write_submission(path, tampered)
    assert problems(read_submission(path)) == [], "its scores are those of its frames"
    done = pftrack_sim("submit", str(path), "--verify", "--workers", "0")
    assert done.returncode == 1
    assert done.stdout.splitlines()[-1] == "refused: not the submitted scores"
    assert "different: overlap" in done.stdout


@pytest.mark.slow
def test_episodes_are_chosen_by_the_seed_and_other_frames_prove_nothing(made: dict[str, Submission]):
    def redraw(row: dict[str, Any]) -> None:
        row.update(frames_digest="0" * 32, graphics="another")

    redrawn = changed(made["stay"], redraw)
    found = verify(redrawn, 1, share=2)
    assert found.total == 10
    assert len(found.replayed) == 6, "3 of 5 episodes of each part"
    assert {one.outcome for one in found.replayed} == {"of other frames"}
    assert not found.good
    assert any("drawn by another; here" in line for line in found.lines())
    elsewhere = verify(changed(made["ncc"], lambda row: row.update(frames_digest="0" * 32)), 1)
    assert ["as here)" in line for line in elsewhere.lines() if ": of other frames" in line] == [True, True]
    names = {tuple(one.name for one in verify(made["stay"], seed).replayed) for seed in range(6)}
    assert len(names) > 1


def test_what_cannot_be_submitted_says_why(
    suite: str, stores: list[RunStore], made: dict[str, Submission], tmp_path: Path
):
    with pytest.raises(ParameterError, match="say which tracker with --tracker"):
        make_submission(stores)
    with pytest.raises(UnknownNameError, match="tracker of the run"):
        make_submission(stores, "nc")
    with pytest.raises(ParameterError, match="needs one run of follow and bench each, got open"):
        make_submission(stores[:1], "ncc")
    few = run(plan_all([suite], trackers=["stay"], seeds=[0, 1]), tmp_path / "few", videos="none")
    with pytest.raises(RunError, match=r"lacks 3 results of stay on .*: corridor seed 2, corridor seed 3"):
        make_submission([few, stores[1]], "stay")
    dark = plan_all([suite], trackers=["stay"], overrides={"lights.ev": -1.0})
    other = run(dark, tmp_path / "dark", videos="none")
    with pytest.raises(RunError, match=r"lacks 5 results of stay on .*, or has them with other settings"):
        make_submission([other, stores[1]], "stay")
    assert standings(other) == []
    alone = plan_all(["corridor"], trackers=["stay"], seeds=[0], overrides=SMALL)
    plain = run(alone, tmp_path / "plain", videos="none")
    with pytest.raises(ParameterError, match="is of one frozen suite, such as standard-1"):
        make_submission([plain], "stay")
    submitted = tmp_path / "stay.parquet"
    write_submission(submitted, made["stay"])
    for words, said in (
        ([tmp_path / "few", "--verify"], "--verify takes a submission"),
        ([tmp_path / "few", tmp_path], f"{tmp_path} is no run folder"),
        ([tmp_path / "none.parquet"], "none.parquet is not a submission"),
        ([submitted, "--tracker", "sty"], "unknown tracker of the submission 'sty'"),
    ):
        assert said in refused("submit", *map(str, words))


def test_a_tracker_is_charged_what_it_takes(made: dict[str, Submission]):
    def slow(row: dict[str, Any]) -> None:
        row["ms_median"] = 90.0

    assert problems(changed(made["ncc"], slow)) == [
        "in closed loop it is charged 20 ms per frame, and takes 90.0 ms: follow with --latency measured"
    ]


@pytest.fixture
def shipped(suite: str, made: dict[str, Submission]):
    folder = reference_folder(suite)
    folder.mkdir()
    yield folder
    shutil.rmtree(folder)


def test_a_run_is_placed_among_the_references_on_the_same_frames(
    suite: str, stores: list[RunStore], made: dict[str, Submission], shipped: Path, tmp_path: Path
):
    write_submission(shipped / "ncc.parquet", replace(changed(made["ncc"], better), path=shipped))
    (found,) = standings(stores[0])
    assert [(one.label, one.here) for one in found.places] == [("ncc", False), ("ncc", True), ("stay", True)]
    assert (found.episodes, found.missing, found.references) == (10, 0, 1)
    first, *_ = (one for one in found.pairs if one.label == "stay")
    theirs = np.mean([row["mean_overlap"] for row in read_submission(shipped / "ncc.parquet").rows[:5]])
    ours = np.mean([row["mean_overlap"] for row in made["stay"].rows[:5]])
    assert first.difference.mean == pytest.approx(ours - theirs)
    assert (first.difference.seeds, first.episodes, first.other_frames, first.other_scenes) == (5, 5, 0, 0)
    assert found.places[2].skill.mean == 0.0, "stay is what chance is"
    titles = [table.title for table in standing_tables(found)]
    of_suite, of_pairs = f"{suite} beside its reference results", "Mean overlap minus that of each reference"
    assert titles == [of_suite, f"{of_pairs}, on the same frames"]
    run_page = write_report(Path(shutil.copytree(stores[0].path, tmp_path / "run"))).read_text()
    assert of_suite in run_page
    assert of_pairs in run_page
    assert '<th scope="row">ncc (here)</th><td>5</td>' in run_page
    (driven,) = standings(stores[1])
    assert {one.success.seeds for one in driven.places} == {5}
    assert driven.pairs == ()
    page = tmp_path / "page.md"
    page.write_text(f"<!-- tables of {suite} -->\n<!-- end -->\n")
    assert update_document(page, tmp_path) == ([suite], [])
    assert "| `ncc` | 5 | " in page.read_text()


def test_other_images_are_said_with_their_difference_and_other_scenes_left_out(
    suite: str, stores: list[RunStore], made: dict[str, Submission], shipped: Path
):
    def redraw(row: dict[str, Any]) -> None:
        if row["seed"] < 2:
            row["frames_digest"] = "0" * 32
            row["luminance"] = bytes(value + 2 for value in row["luminance"])
        if row["seed"] == 4:
            row["stay"] += 0.1

    write_submission(shipped / "ncc.parquet", changed(made["ncc"], redraw))
    (found,) = standings(stores[0])
    one = next(pair for pair in found.pairs if pair.label == "ncc")
    assert (one.episodes, one.other_frames, one.other_scenes) == (4, 2, 1)
    assert one.luminance == pytest.approx(2 / 255)
    assert one.difference.values == (0.0,) * 4
    remarks = list(standing_remarks(found, "runs/x"))
    assert any(
        "2 of 4 episodes of ncc have other images" in line
        and "differs by 0.78% in the mean" in line
        and line.endswith("--trackers ncc --out runs/x")
        for line in remarks
    )
    assert any(line.startswith("ncc: 1 episodes are left out") for line in remarks)


def test_without_references_the_numbers_stand_alone(
    suite: str, stores: list[RunStore], capsys: pytest.CaptureFixture[str]
):
    assert board(suite) is None
    (found,) = standings(stores[0])
    assert f"{suite}: no reference results to compare with" in list(standing_remarks(found, "runs/x"))
    results.print_standing(stores[0])
    assert "(here)" not in capsys.readouterr().out


def test_the_shipped_references_are_whole_and_their_board_is_on_the_page(tmp_path: Path):
    found = references("standard-1")
    assert {one.label for one in found} >= {"oracle-visible", "pftrack", "stay"}
    assert [problem for one in found for problem in problems(one)] == []
    page = Path(shutil.copy(Path(__file__).parents[2] / "docs/standard.md", tmp_path))
    written = page.read_text(encoding="utf-8")
    update_document(page, tmp_path)
    assert page.read_text(encoding="utf-8") == written, "pftrack-sim tables docs/standard.md"


def test_on_other_seeds_the_numbers_stand_alone(suite: str, made: dict[str, Submission], shipped: Path, tmp_path: Path):
    write_submission(shipped / "ncc.parquet", made["ncc"])
    store = run(plan_all([suite], trackers=["stay"], seeds=[7, 8]), tmp_path / "tuned", videos="none")
    (found,) = standings(store)
    assert found.suite == f"{suite} on seeds 7:9, which are not its own"
    assert [one.label for one in found.places] == ["stay"]
    assert (found.references, found.pairs, found.missing) == (0, (), 0)


def test_a_seed_that_lacks_an_episode_does_not_count():
    frames = bytes([250] * 4)

    def row(scenario: str, seed: int, overlap: float) -> Row:
        return {"kind": "open", "scenario": scenario, "condition": "base", "seed": seed, "mean_overlap": overlap,
                "stay": 0.0, "ms_median": 1.0, "overlap": frames, "moment": bytes([1] * 4)}  # fmt: skip

    rows = [row("easy", 0, 0.9), row("hard", 0, 0.1), row("easy", 1, 0.9), row("hard", 1, 0.3), row("easy", 2, 0.9)]
    found = place_of("mine", True, rows)
    assert found.skill.values == pytest.approx((0.5, 0.6))
    assert math.isnan(found.success.mean)
    assert math.isnan(found.explained["occluded"])


@pytest.mark.slow
def test_a_third_party_s_tracker_is_named_before_its_code_runs(suite: str, made: dict[str, Submission], tmp_path: Path):
    (tmp_path / "my_tracker.py").write_text(
        "from pftrack_sim.trackers import make as builtin\n\n"
        "def make(seed, preset):\n    return builtin('stay', seed=seed)\n"
    )
    runs = []
    for command, *more in (["bench"], ["follow", "--latency", "my_tracker:make=20"]):
        runs.append(f"runs/{command}")
        done = succeeds(command, suite, "--trackers", "my_tracker:make", "--isolation", "never", "--videos", "none",
                           "--workers", "0", "--out", runs[-1], *more, cwd=tmp_path)  # fmt: skip
    assert "no reference results to compare with" in done.stdout
    done = pftrack_sim("submit", *runs, "--out", "mine.parquet", cwd=tmp_path)
    assert done.stdout.endswith("next: pftrack-sim submit mine.parquet --verify --tracker my_tracker:make\n")
    verifying = ("submit", "mine.parquet", "--verify", "--workers", "0", "--isolation", "never")
    done = pftrack_sim(*verifying, cwd=tmp_path)
    assert done.returncode == 2
    assert "name it with --tracker my_tracker:make" in done.stderr
    named = (*verifying, "--tracker", "my_tracker:make")
    assert pftrack_sim(*named, cwd=tmp_path).stdout.endswith("verified\n")
    (tmp_path / "my_tracker.py").write_text((tmp_path / "my_tracker.py").read_text() + "\nBETTER = True\n")
    done = pftrack_sim(*named, cwd=tmp_path)
    assert done.returncode == 2
    assert "the code of my_tracker:make is another here" in done.stderr


def test_rows_of_a_run_know_nothing_of_its_folder(stores: list[RunStore]):
    assert not {"file", "printed", "number", "place"} & rows_of(stores[0])[0].keys()
    with pytest.raises(PftrackError):
        read_submission(stores[0].path / "summary.parquet")
