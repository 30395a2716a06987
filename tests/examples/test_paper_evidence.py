"""The evidence for the papers' trackers."""

import importlib
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture
def evidence(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(EXAMPLES)
    return importlib.import_module("paper_evidence")


@pytest.mark.slow
def test_a_tracker_taught_by_the_truth_is_most_certain_there(monkeypatch: pytest.MonkeyPatch, evidence: Any):
    short = MappingProxyType({**evidence.LEARNING, "duration_s": 3.0, "camera.rate_hz": 20})
    monkeypatch.setattr(evidence, "LEARNING", short)
    for axis in evidence.learning(seed=0).axes:
        by_truth = axis.lines[1]
        best = np.asarray(by_truth.get_xdata())[np.argmax(by_truth.get_ydata())]
        assert abs(best) <= 0.15


def test_the_table_has_motion_beside_noise_and_effective_sample_size(evidence: Any):
    *_, row = evidence.noise(0, ["ko2012/video-2"], {"duration_s": 0.5})
    motion, paper, default = ([float(one) for one in cell.split(",")] for cell in row.strip("| ").split(" | ")[1:])
    assert 0.0 < motion[0] < motion[1] < 5.0
    assert paper[0] == 1.0 < default[0]
    assert 1.0 > paper[1] > default[1] > 0.0
