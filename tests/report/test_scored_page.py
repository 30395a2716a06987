"""The page of scored result files: numbers of the scores, with sequences as what is repeated."""

import csv
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from pftrack_sim.benchmark.datasets.results import Scored, score_results, score_text
from pftrack_sim.core.errors import RunError
from pftrack_sim.report import write_scored

COUNT, NAMES = 12, ("alpha", "beta", "gamma")


@pytest.fixture(scope="module")
def scored(tmp_path_factory: pytest.TempPathFactory) -> Scored:
    """Two trackers on three sequences of random boxes; the target is absent in one frame."""
    root = tmp_path_factory.mktemp("scored")
    for place, name in enumerate(NAMES):
        rng = np.random.default_rng(place)
        boxes = np.column_stack([rng.uniform(1, 30, (COUNT, 2)), rng.uniform(10, 20, (COUNT, 2))])
        (root / "data" / name / "img").mkdir(parents=True)
        for number in range(COUNT):
            cv2.imwrite(str(root / "data" / name / f"img/{number + 1:04d}.png"), np.zeros((48, 64, 3), np.uint8))
        truth = boxes.copy()
        truth[5] = 0.0
        np.savetxt(root / "data" / name / "groundtruth_rect.txt", truth, delimiter=",")
        for tracker, noise in (("close", 1.0), ("far", 6.0)):
            (root / "results" / tracker).mkdir(parents=True, exist_ok=True)
            said = np.column_stack([boxes[:, :2] + rng.normal(0, noise, (COUNT, 2)), boxes[:, 2:]])
            np.savetxt(root / "results" / tracker / f"{name}.txt", said, delimiter=",")
    return score_results(root / "results", root / "data")


def test_the_page_and_the_table_have_the_scores(scored: Scored, tmp_path: Path):
    page = write_scored(scored, tmp_path / "out", {"results": "mine"}).read_text()
    data: dict[str, Any] = json.loads(re.search(r'id="data">(.*?)</script>', page)[1])
    assert (data["unit"], data["scenarios"], data["trackers"]) == ("sequence", list(NAMES), ["close", "far"])
    at = [name for name, *_ in data["measures"]].index("mean_overlap") + 2
    shown = {(data["trackers"][row[0]], data["episodes"][row[1]]["scenario"]): row[at] for row in data["rows"]}
    rows = list(csv.DictReader((tmp_path / "out/results.csv").open()))
    assert len(shown) == len(rows) == len(scored.results) == 6
    for one, row in zip(scored.results, rows, strict=True):
        assert shown[one.tracker.label, NAMES.index(one.sequence)] == pytest.approx(one.summary.mean_overlap, abs=1e-6)
        assert (row["tracker"], row["sequence"]) == (one.tracker.label, one.sequence)
        assert float(row["auc"]) == one.summary.auc
    assert [one["occluded"] for one in data["episodes"]] == [[[5, 6]]] * 3
    (pair,) = data["matrix"]
    assert (pair["seeds"], pair["difference"]) == (3, pytest.approx(scored.comparisons[0].difference.mean, abs=1e-6))
    for value in scored.benchmark["far"].values():
        assert f"<td>{score_text(value)}</td>" in page
    assert "ms_median" not in [name for name, *_ in data["measures"]]


@pytest.mark.slow
def test_it_opens_and_ranks_by_sequences(scored: Scored, tmp_path: Path, show: Callable[..., Any]):
    page = show(write_scored(scored, tmp_path / "out", {}))
    assert page.locator("#board thead th").all_inner_texts()[:3] == ["tracker", "sequences", "mean overlap"]
    mean = np.mean([one.summary.mean_overlap for one in scored.results if one.tracker.label == "close"])
    cells = page.locator("#board tbody tr").first.locator("td").all_inner_texts()
    assert (cells[0], cells[1].split()[0]) == ("3", f"{mean:.2f}")
    assert page.locator("#extent").inner_text() == "out: 2 trackers, 3 sequences, 6 results"
    page.locator("#filter-scenario").select_option("1")
    assert page.locator("#board tbody tr").first.locator("td").first.inner_text() == "1"
    assert not page.locator("#h-losses").is_visible()


def test_a_file_is_no_folder_for_the_report(scored: Scored, tmp_path: Path):
    (tmp_path / "out").write_text("precious")
    with pytest.raises(RunError, match="is not a folder"):
        write_scored(scored, tmp_path / "out", {})
    assert (tmp_path / "out").read_text() == "precious"


def test_results_in_another_convention_are_told_by_page_and_command(tmp_path: Path):
    boxes = np.column_stack([np.arange(COUNT) + 10.0, np.full(COUNT, 8.0), np.full((COUNT, 2), 15.0)])
    (tmp_path / "data/a/img").mkdir(parents=True)
    (tmp_path / "results/mine").mkdir(parents=True)
    for number in range(COUNT):
        cv2.imwrite(str(tmp_path / f"data/a/img/{number + 1:04d}.png"), np.zeros((48, 64, 3), np.uint8))
    np.savetxt(tmp_path / "data/a/groundtruth_rect.txt", boxes, delimiter=",")
    corners = np.hstack([boxes[:, :2], boxes[:, :2] + boxes[:, 2:]])
    np.savetxt(tmp_path / "results/mine/a.txt", corners, delimiter=",")
    found = score_results(tmp_path / "results", tmp_path / "data")
    (told,) = found.misread
    assert told.startswith("mine: its first boxes overlap the truth by 0.88 if they are corners x1, y1, x2, y2")
    assert told in write_scored(found, tmp_path / "out", {}).read_text()
