"""At most one compiled model exists at a time."""

from __future__ import annotations

import gc
import weakref
from collections.abc import Iterator
from typing import Any

import pytest

from pftrack_sim.render.renderer import warp_installed
from pftrack_sim.scenario import load
from pftrack_sim.simulation import simulation as module
from pftrack_sim.simulation.simulation import Simulation

SMALL = {"camera.width_px": 64, "camera.height_px": 48, "duration_s": 0.3}


@pytest.fixture
def without_collector() -> Iterator[None]:
    gc.disable()
    yield
    gc.enable()


@pytest.mark.parametrize(
    "axis",
    [pytest.param({}, id="plain"), pytest.param({"axes.blur.severity": 1.0}, id="blur", marks=pytest.mark.slow)],
)
@pytest.mark.parametrize(
    "backend", ["gl", pytest.param("warp", marks=pytest.mark.skipif(not warp_installed(), reason="needs warp"))]
)
@pytest.mark.usefixtures("without_collector")
def test_the_old_model_is_freed_before_the_next_is_compiled(
    backend: str, axis: dict[str, float], monkeypatch: pytest.MonkeyPatch
):
    """Nothing holds itself: the collector, which would come many resets later, is not needed."""
    models: list[weakref.ref[Any]] = []
    alive: list[bool] = []
    build = module.World

    def recording_build(*arguments: Any, **options: Any) -> Any:
        alive.append(any(model() is not None for model in models))
        world = build(*arguments, **options)
        models.append(weakref.ref(world.model))
        return world

    monkeypatch.setattr(module, "World", recording_build)
    with Simulation(load("corridor", {**SMALL, **axis}), backend=backend) as simulation:
        for seed in range(3):
            simulation.reset(seed)
            simulation.advance()
    assert alive == [False] * 3
