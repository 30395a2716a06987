"""Fixtures shared by all tests."""
# ruff: noqa: E402 - OpenBLAS reads its variable while NumPy loads

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

# This process computes the bits of a worker process.
_CPU = Path("/proc/cpuinfo")
if _CPU.exists() and " avx2 " in _CPU.read_text(encoding="utf-8"):
    os.environ.setdefault("OPENBLAS_CORETYPE", "Haswell")

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


@pytest.fixture(scope="session")
def launch_chromium() -> Iterator[Callable[..., Any]]:
    """Starts Debian's Chromium with options; its caller closes it.

    Playwright's loop runs in the test's thread until it is stopped, and refuses a second one: a worker that gets
    tests of the report and of the studio needs one for both.
    """
    names = ("chromium", "chromium-browser", "google-chrome")
    found = next((path for name in names if (path := shutil.which(name))), None)
    if found is None:
        pytest.skip("no Chromium here: install Debian's package chromium")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:

        def launch(*options: str) -> Any:
            return playwright.chromium.launch(executable_path=found, args=["--no-sandbox", *options])

        yield launch


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
