"""The evidence for the papers' trackers: taught by the truth, the likelihood has its maximum near the truth."""

import importlib
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.mark.slow
def test_a_tracker_taught_by_the_truth_is_most_certain_there(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.syspath_prepend(EXAMPLES)
    evidence = importlib.import_module("paper_evidence")
    short = MappingProxyType({**evidence.LEARNING, "duration_s": 3.0, "camera.rate_hz": 20})
    monkeypatch.setattr(evidence, "LEARNING", short)
    for axis in evidence.learning(seed=0).axes:
        by_truth = axis.lines[1]
        best = np.asarray(by_truth.get_xdata())[np.argmax(by_truth.get_ydata())]
        assert abs(best) <= 0.15
