"""The doctor reports which renderers work, why others do not, and what to install."""

from __future__ import annotations

import subprocess

import pytest

from pftrack_sim.render import doctor
from pftrack_sim.render.doctor import BackendCheck, Report, report
from pftrack_sim.render.gl.context import OpenGLInfo, candidates
from tests.fresh_process import printed

EGL = BackendCheck("egl", OpenGLInfo("egl", "Mesa", "llvmpipe", "4.5"))
BROKEN = BackendCheck("egl", None, "libEGL.so.1 is not installed")
NONE = BackendCheck("osmesa", None, "libOSMesa.so.8 is not installed")


def test_every_candidate_is_checked_and_one_works_here():
    found = report()
    assert [check.backend for check in found.checks] == list(candidates())
    assert found.usable
    assert found.chosen is not None
    assert found.chosen.info is not None
    assert found.lines()[-1] == f"Frames are drawn with {found.chosen.backend}."


def test_the_first_that_works_is_chosen():
    assert Report((EGL, NONE)).chosen == EGL
    other = BackendCheck("osmesa", OpenGLInfo("osmesa", "Mesa", "llvmpipe", "4.5"))
    assert Report((BROKEN, other)).chosen == other
    assert "libEGL.so.1 is not installed" in Report((BROKEN, other)).lines()[0]


def test_install_hints_are_listed_when_nothing_works():
    found = Report((BROKEN, NONE))
    assert not found.usable
    text = "\n".join(found.lines())
    for word in ("not installed", "libegl1", "libosmesa6", "pftrack-sim[warp]"):
        assert word in text


def test_without_opengl_the_ray_caster_draws_where_it_is_installed():
    found = Report((BROKEN, NONE), warp=True)
    assert found.usable
    assert "drawn with warp" in found.lines()[-1]
    assert "drawn with egl" in Report((EGL, NONE), warp=True).lines()[-1]


@pytest.mark.parametrize(
    ("happens", "said"),
    [
        (lambda *_, **__: subprocess.CompletedProcess([], -11, "", ""), "crashes"),
        (lambda *_, **__: subprocess.CompletedProcess([], 0, '"libEGL.so.1 is not installed"\n', ""), "not installed"),
        (lambda *_, **__: (_ for _ in ()).throw(subprocess.TimeoutExpired("x", 1)), "does not answer"),
        (lambda *_, **__: (_ for _ in ()).throw(OSError("no memory")), "no memory"),
    ],
)
def test_drivers_that_crash_or_hang_are_reported(happens, said: str, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(doctor.subprocess, "run", happens)
    found = report()
    assert found.chosen is None
    assert all(said in check.problem for check in found.checks)


def test_other_output_of_a_driver_is_ignored(monkeypatch: pytest.MonkeyPatch):
    answer = 'driver says hello\n{"backend": "egl", "vendor": "v", "renderer": "r", "version": "4"}\n'
    monkeypatch.setattr(doctor.subprocess, "run", lambda *_, **__: subprocess.CompletedProcess([], 0, answer, ""))
    assert report().chosen == BackendCheck("egl", OpenGLInfo("egl", "v", "r", "4"))


def test_a_missing_library_is_reported_by_the_check_process():
    program = "import sys; sys.argv[1:] = ['osmesa']\n"
    program += "from pftrack_sim.render import doctor; from pftrack_sim.render.gl import context\n"
    program += "context._loads = lambda name: False; doctor._main()"
    assert "not installed" in printed(program)
