"""Images compared with MuJoCo's renderer, and what they do not depend on."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np
import pytest
from observing import Drawing, mujocos_renderer
from render_stage import HEIGHT, WIDTH, K, Stage, build, looking, new_spec, random_view

from pftrack_sim.core.errors import ParameterError, RenderError
from pftrack_sim.render.culling import Bounds
from pftrack_sim.render.gl import rasteriser
from pftrack_sim.render.gl.rasteriser import Rasteriser, shadow_map


@pytest.mark.parametrize("seed", range(3))
def test_images_without_shadows_agree_with_the_renderer_of_mujoco(seed: int, drawing: Drawing):
    stage = build(seed)
    stage.model.light_castshadow[:] = False
    ours, rng = drawing(stage), np.random.default_rng(seed)
    with mujocos_renderer(stage.model) as theirs:
        for _ in range(3):
            pose = random_view(rng)
            # The camera's axes and frustum are computed in another order: single precision changes a pixel in places.
            differ = (ours.color(stage.data, pose, K) != theirs.image(stage.data, pose)).any(axis=2)
            assert differ.mean() < 1e-3


def test_rows_agree_with_the_same_rows_of_the_whole_image(drawing: Drawing):
    rng = np.random.default_rng(5)
    for seed in range(3):
        stage, pose = build(seed), random_view(rng)
        renderer = drawing(stage)
        whole = renderer.color(stage.data, pose, K)
        for start, stop in ((0, 7), (11, 60), (len(whole) // 2, len(whole)), (0, len(whole))):
            some = renderer.color(stage.data, pose, K, rows=slice(start, stop))
            # Clipped to a smaller view, triangles are rounded to other subpixels.
            assert (np.abs(some.astype(int) - whole[start:stop]).max(axis=2) > 8).mean() < 5e-3


def test_each_image_is_a_new_equal_array(drawing: Drawing):
    stage = build()
    renderer, pose = drawing(stage), looking((0, 0, 1.2), (5, 0, 1))
    first = renderer.color(stage.data, pose, K)
    kept = first.copy()
    renderer.color(stage.data, looking((0, 0, 1.2), (-5, 0, 1)), K)
    assert np.array_equal(first, kept)
    assert np.array_equal(renderer.color(stage.data, pose, K), first)
    assert first.shape == (HEIGHT, WIDTH, 3)
    assert first.dtype == np.uint8
    assert first.flags.writeable


def test_the_image_size_is_independent_of_the_offscreen_size_of_the_model():
    stage = build()
    for size in ((33, 17), (700, 500)):
        with Rasteriser(stage.model, *size) as renderer:
            pose = looking((0, 0, 1.2), (5, 0, 1))
            assert renderer.color(stage.data, pose, K).shape == (size[1], size[0], 3)


def test_invalid_arguments_raise(drawing: Drawing):
    stage = build()
    renderer = drawing(stage)
    for wrong in (np.eye(3), np.full((4, 4), np.nan)):
        with pytest.raises(ParameterError, match="T_world_camera"):
            renderer.color(stage.data, wrong, K)
    with pytest.raises(ParameterError, match="K must"):
        renderer.color(stage.data, np.eye(4), np.eye(4))


def test_a_closed_rasteriser_raises():
    stage = build()
    renderer = Rasteriser(stage.model, WIDTH, HEIGHT)
    renderer.close()
    renderer.close()
    with pytest.raises(RenderError, match="closed"):
        renderer.color(stage.data, np.eye(4), K)
    assert renderer.description


@pytest.mark.slow
def test_two_processes_draw_equal_bits(digest_in_new_process: Callable[[str, int], dict]):
    first, second = digest_in_new_process("any", 0), digest_in_new_process("any", 0)
    assert first == second
    assert first["environment_unchanged"]


@pytest.mark.slow
def test_the_truth_does_not_depend_on_the_opengl_library(
    digest_in_new_process: Callable[[str, int], dict], osmesa_present: None
):
    egl, osmesa = digest_in_new_process("egl", 0), digest_in_new_process("osmesa", 0)
    assert (egl["backend"], osmesa["backend"]) == ("egl", "osmesa")
    assert osmesa["environment_unchanged"]
    for one, other in zip(egl["truths"], osmesa["truths"], strict=True):
        assert [truth[:4] for truth in one] == [truth[:4] for truth in other]


@pytest.mark.slow
def test_multisampling_does_not_change_the_boxes(digest_in_new_process: Callable[[str, int], dict]):
    plain, smooth = digest_in_new_process("any", 0), digest_in_new_process("any", 4)
    assert plain["pictures"] != smooth["pictures"]
    for one, other in zip(plain["truths"], smooth["truths"], strict=True):
        assert [truth[:4] for truth in one] == [truth[:4] for truth in other]


@pytest.mark.parametrize("shadows", [False, True])
def test_culling_geoms_out_of_view_changes_no_pixel(shadows: bool, drawing: Drawing, monkeypatch: pytest.MonkeyPatch):
    rng = np.random.default_rng(7)
    left_out = 0
    for seed in range(8):
        stage = build(seed, people=4, pillars=8)
        stage.model.light_castshadow[:] = shadows
        stage.model.geom_castshadow[::3] = False
        renderer = drawing(stage)
        scene, group = renderer._scene._scene, stage.model.geom_group.copy()
        for _ in range(3):
            pose = looking(tuple(rng.normal((2.0, 0.0, 1.5))), tuple(rng.normal(size=3) * 3), rng.normal())
            picture, culled = renderer.color(stage.data, pose, K), scene.ngeom
            np.testing.assert_array_equal(stage.model.geom_group, group)
            with monkeypatch.context() as patch:
                patch.setattr(Bounds, "in_view", lambda *arguments: np.ones(len(arguments[-1]), dtype=bool))
                patch.setattr(Bounds, "may_shade", lambda *arguments: np.ones(len(arguments[-2]), dtype=bool))
                assert np.array_equal(picture, renderer.color(stage.data, pose, K))
            left_out += scene.ngeom - culled
    assert left_out > 20


def test_nothing_is_culled_where_a_material_reflects():
    spec = new_spec()
    spec.add_material(name="mirror", reflectance=0.5)
    for place in (3.0, -3.0):
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.3, 0, 0], pos=[place, 0.0, 1.0])
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with Rasteriser(model, WIDTH, HEIGHT) as renderer:
        shown = []
        for reflectance in (0.5, 0.0):
            model.mat_reflectance[:] = reflectance
            renderer.color(data, looking((0.0, 0.0, 1.0), (1.0, 0.0, 1.0)), K)
            shown.append(renderer._scene._scene.ngeom)
    assert shown == [2, 1]


def shadows_only(monkeypatch: pytest.MonkeyPatch, stage: Stage, pose: np.ndarray, fitted_to: np.ndarray) -> np.ndarray:
    """`(H, W)` light that the shadows take, where the map of shadows is that of another camera pose."""
    with monkeypatch.context() as patch:
        patch.setattr(rasteriser, "shadow_map", lambda model, direction, _: shadow_map(model, direction, fitted_to))
        images = []
        for casts in (True, False):
            stage.model.light_castshadow[:] = casts
            with Rasteriser(stage.model, WIDTH, HEIGHT) as renderer:
                images.append(renderer.color(stage.data, pose, K).astype(int).sum(axis=2))
    return images[1] - images[0]


def test_shadows_have_soft_edges_and_do_not_swim_with_the_camera(monkeypatch: pytest.MonkeyPatch):
    stage, pose = build(2, people=1, pillars=4), looking((0.0, 0.0, 1.6), (5.0, 0.0, 0.0))
    stage.model.geom_castshadow[stage.model.body("ground").geomadr[0]] = False
    still = shadows_only(monkeypatch, stage, pose, pose)
    deepest = np.quantile(still[still > 0], 0.9)
    assert (still > 0.8 * deepest).sum() > 300
    assert ((still > 0.2 * deepest) & (still < 0.8 * deepest)).sum() > 20
    for step in ((0.013, 0.0, 0.0), (0.4, 0.25, 0.0), (0.77, -0.5, 0.1)):
        moved = pose.copy()
        moved[:3, 3] += step
        differ = np.abs(shadows_only(monkeypatch, stage, pose, moved) - still) > 0.2 * deepest
        assert differ.mean() < 2e-3
