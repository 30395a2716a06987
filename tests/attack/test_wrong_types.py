"""Arguments of another type: public functions take them or say one error, and none fails deep inside."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pftrack_sim import controllers, formats, policies, scenario, trackers
from pftrack_sim.benchmark import RunStore, join_plans, make_plan, parse_seeds, plan_all, run
from pftrack_sim.benchmark.datasets.export import export
from pftrack_sim.benchmark.datasets.recorded import evaluate
from pftrack_sim.core.errors import ParameterError, PftrackError
from pftrack_sim.env import FollowEnv, Simulation, TrackAndFollowEnv, TrackEnv
from pftrack_sim.report import write_figure, write_report
from tests.attack.test_fuzz import one_error
from tests.benchmark.small import small_plan

WRONG = (
    *(5, -1.5, None, True, "x", b"x", object(), np.float64(3.0), (1, 2, 3), [5], ["x"], [None]),
    *({5: 5}, {"x": 5}, {"jitter": 5}, {"jitter": ["x"]}),
)
ABSENT, PLAN = Path("absent"), small_plan(range(1))
TRACKER, CONTROLLER, SCENARIO = trackers.make("stay"), controllers.make("still"), scenario.load("corridor")
PLAN_OF: dict[str, Any] = {"names": ["corridor"], "trackers": ["stay"], "seeds": [0], "preset": "default"}
PLAN_OF |= {"axes": {}, "overrides": {}, "latency_ms": {}, "controllers": []}
ENV: dict[str, Any] = {"scenario": "corridor", "overrides": None, "render_mode": None, "backend": None, "image": True}
CALLS: Mapping[Callable[..., Any], dict[str, Any]] = {
    make_plan: PLAN_OF,
    plan_all: PLAN_OF,
    join_plans: {"plans": [PLAN], "suites": (), "truth": "box"},
    parse_seeds: {"text": "0:3"},
    run: {"plan": PLAN, "path": ABSENT, "isolation": "auto", "limits": None, "part": (1, 1), "shuffle": None}
    | {"workers": -1, "scheduler": None, "videos": "none", "logs": (), "backend": None, "cache": None},
    evaluate: {"sequences": (), "trackers": ["stay"], "seeds": (0,), "box_noise": 0.0, "starts": (0.0,)}
    | {"video": None, "isolation": "never", "limits": None},
    export: {"plan": PLAN, "out": ABSENT, "layout": "x", "image": None, "quality": None, "maps": (), "workers": 0},
    scenario.load: {"scenario": "corridor", "overrides": None},
    trackers.make: {"name": "stay", "seed": 0, "preset": "default"},
    controllers.make: {"name": "still"},
    TrackEnv: ENV,
    FollowEnv: ENV,
    TrackAndFollowEnv: ENV,
    Simulation: {"scenario": SCENARIO, "backend": None, "image": True},
    policies.TrackingPolicy: {"tracker": TRACKER},
    policies.FollowPolicy: {"tracker": TRACKER, "controller": CONTROLLER, "robot": None},
    policies.robot_parameters: {"settings": SCENARIO.resolve(0), "latency_ms": 0.0},
    formats.read_sequence: {"path": ABSENT, "layout": None, "topics": (), "boxes": None},
    formats.find_sequences: {"root": ABSENT, "layout": None},
    RunStore: {"path": ABSENT},
    write_report: {"path": ABSENT},
    write_figure: {"path": ABSENT, "target": ABSENT, "columns": 1},
}


@pytest.mark.parametrize("call", CALLS, ids=lambda call: call.__qualname__)
def test_arguments_of_another_type_are_taken_or_one_error(
    call: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    for name in CALLS[call]:
        for wrong in WRONG:
            try:
                call(**{**CALLS[call], name: wrong})
            except PftrackError as error:
                one_error(error)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"names": [5]}, "names must be Sequence[str | Path | Mapping[str, Any] | Scenario], got [5]"),
        ({"trackers": [{"name": "stay"}]}, "trackers must be Sequence[str | TrackerSpec], got [{'name': 'stay'}]"),
        ({"axes": 5}, "axes must be Mapping[str, Sequence[float]] | None, got 5"),
        ({"axes": {"jitter": 5}}, "axes must be Mapping[str, Sequence[float]] | None, got {'jitter': 5}"),
        ({"latency_ms": 5}, "latency_ms must be Mapping[str, float] | None, got 5"),
        ({"overrides": 5}, "overrides must be Mapping[str, Any] | None, got 5"),
        ({"controllers": [5]}, "controllers must be Sequence[str], got [5]"),
        ({"controllers": "still"}, "controllers must be Sequence[str], got 'still'"),
        ({"seeds": [True]}, "seeds must be Iterable[int], got [True]"),
    ],
)
def test_the_error_says_what_was_given_and_what_is_allowed(wrong: dict[str, Any], said: str):
    with pytest.raises(ParameterError) as caught:
        make_plan(**{"names": ["corridor"], "trackers": ["stay"], "seeds": [0], **wrong})
    assert str(caught.value) == said


def test_numbers_of_numpy_and_iterators_are_taken():
    plan = make_plan(
        ("corridor",),
        ("stay",),
        (seed for seed in range(2)),
        axes={"jitter": np.array([0.0, 1.0])},
        controllers=["still"],
        latency_ms={"stay": np.float32(1.0)},
    )
    assert plan.episode_count == 4
    assert parse_seeds("0:2") == list(make_plan(["corridor"], ["stay"], np.arange(2)).sweeps[0].seeds)
