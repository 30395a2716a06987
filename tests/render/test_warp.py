"""The ray caster agrees with OpenGL: nearly the same colours."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from pftrack_sim.core.errors import ParameterError, RenderError, UnknownNameError
from pftrack_sim.render import renderer as renderers
from pftrack_sim.render.renderer import sky_material
from pftrack_sim.scenario import load, names
from pftrack_sim.simulation.simulation import Simulation
from tests.fresh_process import ROOT, WITHOUT_OPENGL, printed

pytest.importorskip("mujoco_warp")

# Finer and farther shadows of OpenGL, as the ray caster has them.
SIZE = {"camera.width_px": 160, "camera.height_px": 120, "lights.shadow_reach_m": 20.0, "lights.shadow_pixels": 2048}


# One scenario for each place: those of the suites, `plaza-dock` and `hall-wait` are the same places again, and
# `street-day` is the street in the light of the plaza.
SAME_PLACES = ("plaza-dock", "hall-wait")


@pytest.fixture(scope="module", params=[name for name in names() if "/" not in name and name not in SAME_PLACES])
def pair(request: pytest.FixtureRequest):
    """A running episode drawn with OpenGL, but for what is transparent, and a ray caster of the same model."""
    from pftrack_sim.render.gl.contact import ContactShadows
    from pftrack_sim.render.warp.raycaster import Raycaster

    with pytest.MonkeyPatch.context() as patch, Simulation(load(request.param, SIZE), backend="gl") as simulation:
        patch.setattr(ContactShadows, "place", lambda *_: 0)
        simulation.reset(11)
        world = simulation.world
        with Raycaster(world.model, 160, 120) as caster:
            yield simulation, caster


def _views(simulation: Simulation, count: int, every: int = 8):
    for _ in range(count):
        for _ in range(every):
            simulation.advance()
        yield simulation.world.data, simulation.world.camera_pose()


def test_colours_are_close_to_opengl(pair):
    simulation, caster = pair
    gl, K = simulation._camera.renderer, simulation._camera.K
    for data, pose in _views(simulation, 2):
        ours, theirs = (one.color(data, pose, K).astype(float) for one in (caster, gl))
        assert np.abs(ours - theirs).mean() < 2.5
        assert np.abs(ours.mean(axis=(0, 1)) - theirs.mean(axis=(0, 1))).max() < 1.5


def test_bright_lights_and_skies_saturate_as_in_opengl(pair):
    simulation, caster = pair
    world, K = simulation.world, simulation._camera.K
    kept, kept_emission = world.model.light_diffuse.copy(), world.model.mat_emission.copy()
    world.model.light_diffuse[:] *= 2.5
    if (sky := sky_material(world.model)) >= 0:
        world.model.mat_emission[sky] = 1.6
    ours, theirs = (
        one.color(world.data, world.camera_pose(), K).astype(float) for one in (caster, simulation._camera.renderer)
    )
    world.model.light_diffuse[:], world.model.mat_emission[:] = kept, kept_emission
    assert np.abs(ours.mean(axis=(0, 1)) - theirs.mean(axis=(0, 1))).max() < 2.5


def test_texture_gradients_interpolate_the_coordinates_of_the_corners(pair):
    from pftrack_sim.render.warp.scene import texture_gradients

    model = pair[0].world.model
    slopes = texture_gradients(model)
    mesh = int(np.flatnonzero(model.mesh_texcoordadr >= 0)[-1])
    start, count = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
    for face in range(start, start + count, max(count // 50, 1)):
        corners = model.mesh_vert[model.mesh_vertadr[mesh] + model.mesh_face[face]]
        spots = model.mesh_texcoord[model.mesh_texcoordadr[mesh] + model.mesh_facetexcoord[face]]
        edges, grown = corners[1:] - corners[:1], spots[1:] - spots[:1]
        if np.linalg.norm(np.cross(*edges)) > 1e-8:
            np.testing.assert_allclose(edges @ slopes[face].T, grown, atol=2e-4)


def test_each_mip_level_halves_the_size_and_keeps_the_mean():
    from pftrack_sim.render.warp.scene import mip_levels

    picture = np.random.default_rng(4).random((64, 16, 4), dtype=np.float32)
    levels = mip_levels(picture)
    assert [level.shape[:2] for level in levels] == [(64, 16), (32, 8), (16, 4), (8, 2), (4, 1), (2, 1), (1, 1)]
    blocks = picture.reshape(32, 2, 8, 2, 4).mean(axis=(1, 3))
    np.testing.assert_allclose(levels[1], blocks, atol=1e-6)
    np.testing.assert_allclose(levels[-1][0, 0], picture.mean(axis=(0, 1)), atol=1e-5)


def test_dimmed_lights_darken_the_image(pair):
    simulation, caster = pair
    world, K = simulation.world, simulation._camera.K
    before = caster.color(world.data, world.camera_pose(), K).mean()
    kept = world.model.light_diffuse.copy(), np.array(world.model.vis.headlight.ambient)
    world.model.light_diffuse[:] *= 0.5
    world.model.vis.headlight.ambient[:] *= 0.5
    dark = caster.color(world.data, world.camera_pose(), K).mean()
    world.model.light_diffuse[:], world.model.vis.headlight.ambient[:] = kept
    assert dark < before
    assert caster.color(world.data, world.camera_pose(), K).mean() == before


@pytest.mark.slow
def test_a_schedule_of_lights_dims_both_renderers_equally():
    from pftrack_sim.render.warp.raycaster import Raycaster

    schedule = [
        {"kind": "step", "at_s": 0.2, "ev": -2.0, "lights": "all"},
        {"kind": "ramp", "from_s": 0.3, "to_s": 0.6, "ev": -1.5, "lights": "lamps"},
    ]
    with Simulation(load("street-night", {**SIZE, "lights.schedule": schedule}), backend="gl") as simulation:
        simulation.reset(2)
        world, K, pairs = simulation.world, simulation._camera.K, []
        with Raycaster(world.model, 160, 120) as caster:
            while world.time_s < 0.7:
                simulation.advance()
                pose = world.camera_pose()
                pairs.append([one.color(world.data, pose, K).mean() for one in (caster, simulation._camera.renderer)])
    ours, theirs = np.array(pairs).T
    assert theirs[-1] < 0.6 * theirs[0]
    np.testing.assert_allclose(ours / ours[0], theirs / theirs[0], atol=0.02)


def test_invalid_poses_and_names_raise(pair):
    simulation, caster = pair
    data, pose, K = simulation.world.data, simulation.world.camera_pose(), simulation._camera.K
    with pytest.raises(ParameterError, match="T_world_camera"):
        caster.color(data, pose * np.nan, K)
    with pytest.raises(UnknownNameError, match="warp"):
        Simulation(simulation.scenario, backend="wrap")


_PROGRAM = """
import hashlib
from pftrack_sim.simulation.simulation import Simulation
from pftrack_sim.scenario import load
with Simulation(load("corridor", {size}), backend={backend}) as simulation:
    digest = hashlib.sha256()
    simulation.reset(5)
    for _ in range(3):
        frame = simulation.advance()
        digest.update(frame.image.tobytes() + frame.truth.visible_box.tobytes())
    print(simulation.graphics.split(":")[0], digest.hexdigest())
"""


def _digest(backend: str | None, **environment: str) -> list[str]:
    """Backend that draws, and the digest of its frames."""
    program = _PROGRAM.format(size=SIZE, backend=repr(backend))
    return printed(program, **{"PYTHONPATH": str(ROOT), **environment}).split()[-2:]


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="hides what is looked up on Linux")
def test_without_opengl_the_ray_caster_draws_equal_bits_in_any_process():
    hidden = _digest(None, **WITHOUT_OPENGL)
    assert hidden[0] == "warp"
    assert hidden == _digest("warp")


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="hides what is looked up on Linux")
def test_doctor_bench_and_render_work_without_opengl(tmp_path: Path):
    def run(*arguments: str) -> str:
        program = [sys.executable, "-c", "from pftrack_sim.cli import main; main()", *arguments]
        hidden = {**os.environ, **WITHOUT_OPENGL}
        done = subprocess.run(program, capture_output=True, text=True, check=False, env=hidden, cwd=tmp_path)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    assert "Frames are drawn with warp, as no OpenGL library can draw" in " ".join(run("doctor").split())
    few = ["--set", "duration_s=0.2", "--set", "camera.width_px=64", "--set", "camera.height_px=48"]
    run("bench", "corridor", "--seeds", "3", "--trackers", "stay", *few, "--out", "run")
    assert (tmp_path / "run" / "report.html").is_file()
    run("render", "corridor", "--seed", "3", *few, "--video", "seen.mp4")
    assert (tmp_path / "seen.mp4").stat().st_size > 0


def test_the_error_where_nothing_can_draw_lists_all_install_hints(monkeypatch: pytest.MonkeyPatch):
    def nothing(*_: object) -> None:
        raise RenderError("no OpenGL library could draw. Install one of:\n" + renderers.INSTALL_HINTS)

    monkeypatch.setattr(renderers, "open_context", nothing)
    monkeypatch.setattr(renderers, "warp_installed", lambda: False)
    with pytest.raises(RenderError) as caught:
        renderers.open_renderer(None, 16, 16)
    for word in ("libegl1", "mesa-libEGL", "macOS", "Windows", "pftrack-sim[warp]"):
        assert word in str(caught.value)


def test_warp_is_imported_only_when_chosen():
    program = (
        "import sys, pftrack_sim.simulation.simulation, pftrack_sim.render.doctor; "
        "assert not {'warp', 'mujoco_warp'} & set(sys.modules)"
    )
    printed(program)


@pytest.mark.slow
def test_only_the_ray_caster_of_mujoco_warp_is_imported():
    program = (
        "import sys\n"
        "import pftrack_sim.render.warp.raycaster as ours\n"
        "assert not {'mujoco_warp', 'mujoco_warp._src.forward'} & set(sys.modules)\n"
        "import mujoco_warp\n"
        "from mujoco_warp._src import render\n"
        "from pftrack_sim.render.warp.rays import caster\n"
        "assert callable(mujoco_warp.step) and render is caster\n"
    )
    printed(program)
