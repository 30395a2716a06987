"""OpenGL contexts: choice of the library, errors, forks, threads and leaks."""

from __future__ import annotations

import gc
import importlib
import os
import sys
import threading
import weakref
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import mujoco
import numpy as np
import pytest
from render_stage import HEIGHT, WIDTH, K, build, looking

from pftrack_sim.core.errors import RenderError
from pftrack_sim.render.gl import context
from pftrack_sim.render.gl.context import GLContext, open_context
from pftrack_sim.render.gl.rasteriser import Rasteriser
from pftrack_sim.render.renderer import open_renderer
from tests.fresh_process import printed

POSE = looking((0, 0, 1.2), (5, 0, 1))


def resident_mb() -> float:
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20


def assert_memory_stays(once: Callable[[int], None]):
    for index in range(60):
        once(index)
    before = resident_mb()
    for index in range(300):
        once(index)
    gc.collect()
    assert resident_mb() - before < 15.0


def test_a_context_reports_its_library_and_can_be_closed_twice():
    opened = open_context()
    assert open_context() is opened
    info = opened.info
    assert info.backend in ("egl", "osmesa", "cgl", "wgl")
    assert info.renderer
    assert info.version
    assert not opened.closed
    opened.close()
    opened.close()
    assert opened.closed
    with pytest.raises(RenderError, match="closed"), opened.current():
        pass
    assert open_context() is not opened


def open_in_a_thread() -> GLContext:
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(open_context).result()


def test_a_context_restores_the_one_that_was_current_before():
    first, second = open_in_a_thread(), open_in_a_thread()
    current = importlib.import_module("OpenGL.platform").PLATFORM.GetCurrentContext
    before = current()
    with first.current():
        outer = current()
        with second.current():
            assert current() != outer
            with first.current():  # also where a block of its own is open further out
                assert current() == outer
            assert current() != outer
        with first.current():
            pass
        assert current() == outer
    assert current() == before
    first.close()
    second.close()


@pytest.fixture
def opened():
    """A context of EGL."""
    context = open_in_a_thread()
    if context.info.backend != "egl":
        pytest.skip("EGL draws nothing here")
    return context


def test_a_context_of_another_owner_is_current_again_afterwards(opened: GLContext):
    theirs = importlib.import_module("mujoco.egl").GLContext(16, 16)
    current = importlib.import_module("OpenGL.platform").PLATFORM.GetCurrentContext
    with theirs.as_current():
        before = current()
        with opened.current():
            assert current() not in (None, before)
        assert current() == before
    theirs.free()


def test_a_context_in_use_lets_other_threads_wait_and_is_freed_of_what_they_left(opened: GLContext):
    done: list[str] = []

    def use() -> None:
        opened.free_soon(lambda: done.append("freed"))
        with opened.current():
            done.append("used by another thread")

    with opened.current():
        thread = threading.Thread(target=use)
        thread.start()
        with opened.current():
            thread.join(0.05)
        done.append("used")
    thread.join()
    assert done == ["used", "freed", "used by another thread"]
    opened.free_soon(lambda: done.append("freed at once"))
    assert done[-1] == "freed at once"


def test_the_context_of_a_thread_ends_with_it():
    kept = weakref.ref(open_in_a_thread())
    gc.collect()
    assert kept() is None


def test_a_process_uses_one_opengl_library():
    opened = open_context()
    other = "osmesa" if opened.info.backend == "egl" else "egl"
    with pytest.raises(RenderError, match="once per process"):
        open_context(other)


def forget(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the process have opened nothing."""
    monkeypatch.setattr(context, "_process", context._Process())
    monkeypatch.setattr(context, "_thread", threading.local())


def test_without_any_library_the_error_lists_what_to_install(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(context, "_loads", lambda name: False)
    forget(monkeypatch)
    monkeypatch.setattr(sys, "platform", "linux")
    with pytest.raises(RenderError) as caught:
        open_context()
    message = str(caught.value)
    for part in ("egl: libEGL.so.1 is not installed", "osmesa: libOSMesa.so.8", "libegl1", "libosmesa6", "Fedora"):
        assert part in message


def test_osmesa_is_tried_after_egl(monkeypatch: pytest.MonkeyPatch):
    tried: list[str] = []

    def failing(name: str) -> None:
        tried.append(name)
        raise RenderError("broken")

    monkeypatch.delenv("MUJOCO_GL", raising=False)
    monkeypatch.setattr(context, "_open", failing)
    forget(monkeypatch)
    monkeypatch.setattr(sys, "platform", "linux")
    with pytest.raises(RenderError):
        open_context()
    assert tried == ["egl", "osmesa"]


@pytest.mark.parametrize("torch", [True, False])
def test_triton_is_imported_before_mesa_where_pytorch_is(torch: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "triton.py").touch()
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "modules", {name: one for name, one in sys.modules.items() if name != "torch"})
    if torch:
        sys.modules["torch"] = sys
    seen: list[bool] = []
    forget(monkeypatch)
    monkeypatch.setattr(context, "_backend_module", lambda _: seen.append("triton" in sys.modules))
    with pytest.raises(RenderError):
        open_context("egl")
    sys.modules.pop("triton", None)
    assert seen == [torch]


def test_drawing_in_a_forked_child_raises_and_names_spawn(monkeypatch: pytest.MonkeyPatch):
    opened = open_context()
    monkeypatch.setattr(os, "getpid", lambda: -1)
    with pytest.raises(RenderError, match="spawn"), opened.current():
        pass
    with pytest.raises(RenderError, match="spawn"):
        open_context()
    with pytest.raises(RenderError, match="spawn"):
        # The ray caster, whose pixels differ, is not used instead.
        open_renderer(build().model, WIDTH, HEIGHT)
    monkeypatch.undo()


@pytest.mark.skipif(sys.platform != "linux", reason="forks")
def test_a_forked_child_of_a_process_that_draws_exits():
    program = (
        "import os, sys\n"
        "from pftrack_sim.render.gl.context import open_context\n"
        "opened = open_context()\n"
        "if opened.info.backend != 'egl' or os.fork() == 0:\n"
        "    sys.exit()\n"
        "sys.exit(os.waitstatus_to_exitcode(os.wait()[1]))\n"
    )
    printed(program)


@pytest.mark.skipif(sys.platform != "linux", reason="EGL and OSMesa are used on Linux")
def test_osmesa_draws_where_egl_finds_no_device(osmesa_present: None):
    program = (
        "import os; import gymnasium, cv2; before = dict(os.environ)\n"
        "from pftrack_sim.render.gl.context import open_context\n"
        "assert open_context().info.backend == 'osmesa'\n"
        "assert before == dict(os.environ)\n"
    )
    printed(program, __EGL_VENDOR_LIBRARY_FILENAMES=os.devnull)


def test_threads_that_open_contexts_at_once_leave_the_environment_unchanged():
    program = (
        "import os; import gymnasium, cv2; before = dict(os.environ)\n"
        "from concurrent.futures import ThreadPoolExecutor\n"
        "import sys; sys.setswitchinterval(1e-6)\n"
        "from pftrack_sim.render.gl.context import open_context\n"
        "with ThreadPoolExecutor(8) as pool:\n"
        "    opened = list(pool.map(lambda _: open_context(), range(64)))\n"
        "assert before == dict(os.environ)\n"
    )
    printed(program)


def test_several_rasterisers_in_one_thread_are_independent():
    stages = [build(seed) for seed in range(3)]
    alone = []
    for stage in stages:
        with Rasteriser(stage.model, WIDTH, HEIGHT) as renderer:
            alone.append(renderer.color(stage.data, POSE, K))
    together = [Rasteriser(stage.model, WIDTH, HEIGHT) for stage in stages]
    for _ in range(3):
        for stage, renderer, image in zip(stages, together, alone, strict=True):
            assert np.array_equal(renderer.color(stage.data, POSE, K), image)
    together[1].close()
    assert np.array_equal(together[2].color(stages[2].data, POSE, K), alone[2])
    for renderer in together:
        renderer.close()


def test_a_rasteriser_draws_in_any_thread():
    stage = build()
    with Rasteriser(stage.model, WIDTH, HEIGHT) as renderer:
        images = [renderer.color(stage.data, POSE, K)]
        for _ in range(3):
            thread = threading.Thread(target=lambda: images.append(renderer.color(stage.data, POSE, K)))
            thread.start()
            thread.join()
        images.append(renderer.color(stage.data, POSE, K))
    assert len(images) == 5
    assert all(np.array_equal(images[0], image) for image in images)


@pytest.mark.parametrize("apart", [True, False], ids=["own context", "shared context"])
def test_concurrent_rasterisers_are_independent(apart: bool):
    stages = [build(seed) for seed in range(3)]
    images = []
    for stage in stages:
        with Rasteriser(stage.model, WIDTH, HEIGHT) as renderer:
            images.append(renderer.color(stage.data, POSE, K))
    shared = [None if apart else Rasteriser(stage.model, WIDTH, HEIGHT) for stage in stages]

    def wrong(seed: int) -> int:
        with shared[seed] or Rasteriser(stages[seed].model, WIDTH, HEIGHT) as own:
            return sum(not np.array_equal(own.color(stages[seed].data, POSE, K), images[seed]) for _ in range(10))

    with ThreadPoolExecutor(3) as pool:
        assert list(pool.map(wrong, range(3))) == [0, 0, 0]


def test_a_garbage_collected_rasteriser_is_freed():
    renderer = Rasteriser(build().model, WIDTH, HEIGHT)
    resources = renderer._resources
    assert resources
    del renderer
    gc.collect()
    assert not resources


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
@pytest.mark.slow
def test_opening_and_closing_does_not_leak_memory():
    stage = build()

    def once(index: int) -> None:
        if index % 30 == 0:
            open_context().close()
        with Rasteriser(stage.model, 64, 48) as renderer:
            renderer.color(stage.data, POSE, K)

    assert_memory_stays(once)


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
@pytest.mark.slow
def test_changing_the_model_does_not_leak_memory():
    stages = [build(seed) for seed in range(3)]
    with Rasteriser(stages[0].model, WIDTH, HEIGHT) as renderer:

        def once(index: int) -> None:
            stage = stages[index % 3]
            renderer.rebind(stage.model)
            if index % 10 == 0:
                renderer.color(stage.data, POSE, K)

        assert_memory_stays(once)


def test_importing_makes_no_context_and_changes_no_environment():
    program = (
        "import os; import mujoco, gymnasium, cv2; before = dict(os.environ)\n"
        "import pftrack_sim.render.gl.rasteriser, pftrack_sim.truth.observer, pftrack_sim.render.overlay\n"
        "from pftrack_sim.render.gl import context\n"
        "import sys\n"
        "assert context._process.backend is None\n"
        "assert before == dict(os.environ)\n"
        "assert 'OpenGL' not in sys.modules, 'eager'\n"
    )
    printed(program)


def test_errors_of_mujoco_become_render_errors(monkeypatch: pytest.MonkeyPatch):
    def broken(*_: object) -> None:
        raise mujoco.FatalError("gladLoadGL error")

    forget(monkeypatch)
    monkeypatch.setattr(mujoco, "MjrContext", broken)
    with pytest.raises(RenderError, match="gladLoadGL"):
        open_context(context.candidates()[0])


def test_egl_draws_after_every_library_failed_once(osmesa_present: None):
    program = (
        "import sys; sys.path.insert(0, sys.argv[1])\n"
        "from unittest import mock; import mujoco; from render_stage import HEIGHT, WIDTH, build\n"
        "from pftrack_sim.core.errors import RenderError\n"
        "from pftrack_sim.render.gl.context import open_context\n"
        "from pftrack_sim.render.gl.rasteriser import Rasteriser\n"
        "try:\n"
        "    with mock.patch.object(mujoco, 'MjrContext', side_effect=mujoco.FatalError('no memory')): open_context()\n"
        "except RenderError as error:\n"
        "    assert str(error).count('no memory') == 2, error\n"
        "with Rasteriser(build().model, WIDTH, HEIGHT) as renderer: print(renderer.info)\n"
    )
    assert "egl" in printed(program, str(Path(__file__).parents[1]))
