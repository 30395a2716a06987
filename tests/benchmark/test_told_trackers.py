"""Trackers that are told the truth or detections: only where it is allowed, and marked wherever they are named."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pftrack_sim.benchmark import TrackerSpec, run
from pftrack_sim.benchmark.running.tracker_runner import Isolation
from pftrack_sim.core.errors import TrackerError
from pftrack_sim.core.records import Estimate
from pftrack_sim.report.markdown import tables
from tests.benchmark.small import small_plan

NAME = f"{__name__}:Told"


class Told:
    """Returns the true box."""

    def __init__(self, **_: Any) -> None:
        self._box = np.zeros(4)

    def init(self, image: np.ndarray, box: np.ndarray) -> None: ...

    def update(self, image: np.ndarray) -> Estimate:
        return Estimate(self._box)

    def receive_truth(self, box: np.ndarray, visible_fraction: float) -> None:
        self._box = box


class Honest(Told):
    """Asks for nothing."""

    receive_truth = None  # pyright: ignore[reportAssignmentType]


KINDS: list[type[Told]] = []


def told_later(**_: Any) -> Told:
    return KINDS.pop()()


@pytest.mark.parametrize("isolation", ["never", "always"])
def test_a_tracker_of_ones_own_is_told_the_truth_where_it_is_allowed(tmp_path: Path, isolation: Isolation):
    with pytest.raises(TrackerError, match=f"asks for the true box of every frame .*--allow-truth {NAME}"):
        run(small_plan(range(1), [NAME]), tmp_path / "run", isolation=isolation, videos="none")
    plan = small_plan(range(1), [TrackerSpec(name=NAME, allow_truth=True), "oracle"])
    finished = run(plan, tmp_path / "run", isolation=isolation, videos="none", workers=0)
    told, oracle = finished.results
    assert (told.label, oracle.label) == (f"{NAME} (truth)", "oracle")
    assert told.number("mean_overlap") == oracle.number("mean_overlap") == 1.0
    assert f"`{NAME} (truth)`" in tables(finished)
    with finished.database() as database:
        assert database.sql("SELECT DISTINCT label FROM summary ORDER BY 1").fetchall() == [
            ("oracle",),
            (f"{NAME} (truth)",),
        ]


def test_a_tracker_that_asks_only_in_the_episode_is_not_told(tmp_path: Path):
    KINDS[:] = [Told, Honest]
    plan = small_plan(range(1), [f"{__name__}:told_later"])
    (result,) = run(plan, tmp_path / "run", isolation="never", videos="none", workers=0).results
    assert not KINDS
    assert "asks for the true box" in (result.error or "")
