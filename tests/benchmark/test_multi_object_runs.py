"""Multi-object trackers in runs, drives and on recorded sequences, and the scores of everybody in view."""

import importlib.util
from pathlib import Path
from typing import Any

import pytest

from pftrack_sim.benchmark import RunStore, TrackerSpec, make_plan, run
from pftrack_sim.benchmark.datasets.export import export
from pftrack_sim.benchmark.datasets.recorded import evaluate
from pftrack_sim.benchmark.datasets.results import export_results, score_results
from pftrack_sim.benchmark.reading.check import check
from pftrack_sim.benchmark.reading.summary import SCORES
from pftrack_sim.core.errors import ParameterError, SequenceError, TrackerError
from pftrack_sim.formats import read_sequence
from tests.benchmark.small import SMALL
from tests.benchmark.test_toolkits import assert_equal, mot_challenge, trackeval_scores

CROWD: dict[str, Any] = {
    **SMALL, "distractors.count": 3, "duration_s": 1.5, "axes.detector.severity": 1.0, "axes.detector.height_px": 6.0,
}  # fmt: skip
SPECS = [TrackerSpec(name="stay"), TrackerSpec(name="chau2011")]
SEED = 5


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> RunStore:
    plan = make_plan(["corridor"], [SPECS[0]], [SEED], overrides=CROWD)
    path = tmp_path_factory.mktemp("multi") / "run"
    run(plan, path, videos="none")
    # A tracker of several people joins one of one person.
    wider = make_plan(["corridor"], SPECS, [SEED], overrides=CROWD)
    return run(wider, path, videos="none")


@pytest.fixture(scope="module")
def dataset(finished: RunStore, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return export(finished.plan, tmp_path_factory.mktemp("data") / "data", "mot", detections=True)


@pytest.mark.slow
def test_everybody_in_view_is_scored_as_the_result_files_are(finished: RunStore, dataset: Path, tmp_path: Path):
    stay, chau = finished.results
    assert [stay.number(name) for name in SCORES] == pytest.approx([float("nan")] * len(SCORES), nan_ok=True)
    assert not check(finished.path).problems
    export_results(finished, tmp_path / "results", "mot")
    found = score_results(tmp_path / "results", dataset)
    assert 0.0 < chau.number("hota") < 1.0
    assert [found.benchmark["chau2011-detections"][name] for name in SCORES] == pytest.approx(
        [chau.number(name) for name in SCORES], abs=1e-5
    )
    overlaps = {one.tracker.name: one.summary.mean_overlap for one in found.results}
    assert overlaps["stay"] == pytest.approx(stay.number("mean_overlap"), abs=1e-5)


def test_recorded_detections_give_what_the_simulation_gives(finished: RunStore, dataset: Path):
    (folder,) = (dataset / "pftrack-train").iterdir()
    sequence = read_sequence(folder)
    assert sequence.detections is not None
    assert len(sequence.detections) == len(sequence)
    assert (folder / "det/det.txt").read_text().splitlines()[0].split(",")[1] == "-1"
    (found,) = evaluate([sequence], ["chau2011"], [SEED])
    assert found.error is None
    assert found.summary.mean_overlap == pytest.approx(finished.results[1].number("mean_overlap"), abs=1e-3)


def test_sequences_without_detections_are_refused(dataset: Path, tmp_path: Path):
    (folder,) = (dataset / "pftrack-train").iterdir()
    copy = tmp_path / "copy"
    copy.mkdir()
    for name in ("img1", "gt", "seqinfo.ini"):
        (copy / name).symlink_to(folder / name)
    with pytest.raises(TrackerError, match=r"chau2011 follows detections, and copy has none.*det/det\.txt"):
        evaluate([read_sequence(copy)], ["stay", "chau2011"], [0])
    (copy / "det").mkdir()
    for text, scores in [("1,-1,5,5,10,20,80\n1,-1,9,5,10,20,20\n", [1.0, 0.0]), ("", [])]:
        (copy / "det/det.txt").write_text(text)
        detections = read_sequence(copy).detections
        assert detections is not None
        assert detections[0].scores.tolist() == scores
        assert not len(detections[1])
    for line in ("99,-1,5,5,10,20,0.5", "1,-1,5,5,-10,20,0.5", "1,-1,5,5,nan,20,0.5", "1.5,-1,5,5,1,20,0.5", "1,2"):
        (copy / "det/det.txt").write_text(line + "\n")
        with pytest.raises(SequenceError, match=r"det\.txt, line 1"):
            read_sequence(copy)


def test_only_the_mot_layout_holds_detections(finished: RunStore, tmp_path: Path):
    with pytest.raises(ParameterError, match="mot holds detections, otb does not"):
        export(finished.plan, tmp_path / "data", "otb", detections=True)


@pytest.mark.slow
def test_trackeval_computes_the_same_of_multi_object_trackers(tmp_path: Path):
    pytest.importorskip("trackeval")
    names = ["chau2011", "stay"]
    if importlib.util.find_spec("pyxtrackers") and importlib.util.find_spec("norfair"):
        names += ["bytetrack", "norfair"]
    crowd = {**CROWD, "distractors.count": 5, "duration_s": 2.5, "camera.width_px": 160, "camera.height_px": 120}
    plan = make_plan(["plaza-walk", "corridor"], names, [1000, 1001], overrides=crowd)
    export(plan, tmp_path / "data", "mot", image="jpg", detections=True)
    export_results(run(plan, tmp_path / "run", videos="none"), tmp_path / "results", "mot")
    found = score_results(tmp_path / "results", tmp_path / "data").benchmark
    asked = mot_challenge(tmp_path / "data")
    theirs = trackeval_scores("MotChallenge2DBox", tmp_path / "results", tmp_path / "out", asked)
    assert [one.split("-")[0] for one in sorted(theirs)] == sorted(names)
    assert_equal(found, theirs)


@pytest.mark.slow
def test_a_process_of_its_own_changes_nothing(finished: RunStore, tmp_path: Path):
    alone = run(finished.plan, tmp_path / "run", videos="none", isolation="always")
    for mine, theirs in zip(alone.results, finished.results, strict=True):
        assert mine.number("mean_overlap") == theirs.number("mean_overlap")
        assert [mine.number(name) for name in SCORES] == pytest.approx(
            [theirs.number(name) for name in SCORES], nan_ok=True
        )


def test_a_multi_object_tracker_drives_the_robot(tmp_path: Path):
    plan = make_plan(["corridor"], ["chau2011"], [SEED], controllers=["servo"], overrides={**CROWD, "duration_s": 0.5})
    (driven,) = run(plan, tmp_path / "run", videos="none").results
    assert driven.error is None
    assert driven.number("hota") > 0.0
