"""Results of a run as files of public toolkits: scored again, they give the scores of the run."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pftrack_sim.benchmark import RunStore, TrackerSpec, make_plan, run
from pftrack_sim.benchmark.datasets.export import export
from pftrack_sim.benchmark.datasets.results import export_results, score_results
from pftrack_sim.core.errors import ParameterError, RunError, SequenceError
from pftrack_sim.formats.results import RESULT_FORMATS
from tests.benchmark.small import SMALL
from tests.cli.test_cli import refused, succeeds

TINY: dict[str, Any] = {**SMALL, "duration_s": 0.8}
TRACKERS = [TrackerSpec(name="ncc"), TrackerSpec(name="ko2012", params={"particle_count": 20})]


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> RunStore:
    plan = make_plan(["corridor"], TRACKERS, [0, 1], overrides=TINY)
    return run(plan, tmp_path_factory.mktemp("run") / "run", videos="none")


@pytest.mark.slow
@pytest.mark.parametrize("form", RESULT_FORMATS)
def test_scores_of_the_files_are_those_of_the_run(tmp_path: Path, finished: RunStore, form: str):
    dataset = export(finished.plan, tmp_path / "data", form)
    files = export_results(finished, tmp_path / "results", form)
    assert all(file.is_file() for file in files)
    found = score_results(tmp_path / "results", dataset)
    names = {"ncc": "ncc", "ko2012-particle_count-20": "ko2012[particle_count=20]"}
    scores = {(names[one.tracker.name], one.sequence[-4:]): one.summary for one in found.results}
    assert len(scores) == 4
    for one in finished.results:
        again = scores[one.label, f"{one.seed:04d}"]
        assert again.frames == one.measures.frames
        assert again.mean_overlap == pytest.approx(one.measures.mean_overlap, abs=2e-6)
        assert again.success == one.measures.success
        assert again.stay == pytest.approx(one.measures.stay, abs=2e-6)
    assert set(found.benchmark) == set(names)
    (pair,) = found.comparisons
    seeds = ("0000", "0001")
    means = {label: np.mean([scores[label, seed].mean_overlap for seed in seeds]) for label in names.values()}
    assert abs(pair.difference.mean) == pytest.approx(abs(means["ncc"] - means["ko2012[particle_count=20]"]))
    if form == "got10k":
        out = tmp_path / "scored"
        done = succeeds("score", str(tmp_path / "results"), "--dataset", str(dataset), "--out", str(out))
        assert {one.name for one in out.iterdir()} == {"report.html", "results.csv"}
        assert f"{found.benchmark['ncc']['ao']:.4f}" in done.stdout


@pytest.mark.slow
def test_only_finished_runs_in_open_loop_have_results(tmp_path: Path, finished: RunStore):
    (tmp_path / "file").write_text("mine")
    with pytest.raises(RunError, match="is not a folder"):
        export_results(finished, tmp_path / "file", "otb")
    driven = make_plan(["corridor"], ["stay"], [0], controllers=["still"])
    with RunStore.begin(tmp_path / "driven", driven) as store, pytest.raises(RunError, match="closed loop"):
        export_results(store, tmp_path / "out", "otb")
    with RunStore.begin(tmp_path / "begun", finished.plan) as store, pytest.raises(RunError, match="is not finished"):
        export_results(store, tmp_path / "out", "otb")
    late = make_plan(["corridor"], ["stay"], [0], axes={"start": [0.0, 0.5]})
    with pytest.raises(ParameterError, match="whole sequences, shown forward: leave out --starts"):
        export(late, tmp_path / "out", "otb")
    assert not (tmp_path / "out").exists()
    assert "did you mean 'got10k'" in refused(
        "export-results", str(finished.path), "--format", "got10", "--out", str(tmp_path / "out")
    )


@pytest.mark.slow
def test_results_of_other_sequences_are_refused(tmp_path: Path, finished: RunStore):
    export_results(finished, tmp_path / "results", "otb")
    dataset = export(make_plan(["corridor"], ["stay"], [5], overrides=TINY), tmp_path / "data", "otb")
    with pytest.raises(SequenceError, match="no results of corridor-0005"):
        score_results(tmp_path / "results", dataset)
