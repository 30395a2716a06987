"""Fixtures shared by all tests."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import settings
from render_stage import HEIGHT, WIDTH, Stage, build

from pftrack_sim.render.gl import context
from pftrack_sim.render.gl.rasteriser import Rasteriser

# On a busy machine, the duration of an example says nothing about the code.
settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")

if "PYTEST_XDIST_WORKER" in os.environ:
    # Parallel tests keep every core busy: let Mesa's software rasteriser draw in the calling thread.
    os.environ.setdefault("LP_NUM_THREADS", "0")


@pytest.fixture(scope="session")
def shared_rasteriser() -> Iterator[Rasteriser]:
    renderer = Rasteriser(build().model, WIDTH, HEIGHT)
    yield renderer
    renderer.close()


@pytest.fixture
def drawing(shared_rasteriser: Rasteriser) -> Callable[[Stage], Rasteriser]:
    """Binds the shared rasteriser to a stage."""

    def bind(stage: Stage) -> Rasteriser:
        shared_rasteriser.rebind(stage.model)
        return shared_rasteriser

    return bind


@pytest.fixture
def digest_in_new_process() -> Callable[[str, int], dict]:
    """Computes the stage's digest in a new process with the library `"egl"`, `"osmesa"` or `"any"`."""

    def run(backend: str, samples: int = 0) -> dict:
        program = Path(__file__).with_name("render_stage.py")
        done = subprocess.run(
            [sys.executable, str(program), backend, str(samples)], capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout.splitlines()[-1])

    return run


@pytest.fixture
def osmesa_present() -> None:
    """Skips where OSMesa is not installed."""
    if not any(context._loads(name) for name in ("libOSMesa.so.8", "libOSMesa.so.6")):
        pytest.skip("OSMesa is not installed")
