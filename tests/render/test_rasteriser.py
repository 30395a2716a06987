"""Images and ids compared with MuJoCo's renderer, and properties of segmentations."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import mujoco
import numpy as np
import pytest
from mujoco.rendering.classic import renderer as mujoco_renderer
from render_stage import HEIGHT, WIDTH, K, Stage, build, looking, new_spec, random_view

from pftrack_sim.camera.pinhole import intrinsics, normalized_coordinates
from pftrack_sim.core.errors import ParameterError, RenderError
from pftrack_sim.render.backend import PixelRect, Segmentation
from pftrack_sim.render.culling import Bounds
from pftrack_sim.render.gl.context import open_context
from pftrack_sim.render.gl.rasteriser import Rasteriser
from pftrack_sim.scene.layout import HIDDEN_GROUP, PEOPLE_GROUP

Drawing = Callable[[Stage], Rasteriser]


class _Borrowed:
    """A context for `mujoco.Renderer`, which would choose one by an environment variable."""

    def __init__(self, width: int, height: int) -> None:
        self._context = open_context(size=(width, height))

    def make_current(self) -> None:
        self._context._context.make_current()

    def as_current(self) -> object:
        return self._context.current()

    def free(self) -> None:
        self._context.close()


@pytest.fixture
def reference(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[Stage], mujoco.Renderer]]:
    """`mujoco.Renderer` of a stage."""
    monkeypatch.setattr(mujoco_renderer.gl_context, "GLContext", _Borrowed)
    made: list[mujoco.Renderer] = []

    def make(stage: Stage) -> mujoco.Renderer:
        made.append(mujoco_renderer.Renderer(stage.model, HEIGHT, WIDTH))
        return made[-1]

    yield make
    for renderer in made:
        renderer.close()


def through_model_camera(stage: Stage, pose: np.ndarray) -> None:
    """Give the model's camera a pose."""
    stage.data.cam_xpos[0] = pose[:3, 3]
    stage.data.cam_xmat[0] = (pose[:3, :3] @ np.diag([1.0, -1.0, -1.0])).ravel()


@pytest.mark.parametrize("seed", range(3))
def test_images_and_ids_agree_with_the_renderer_of_mujoco(
    seed: int, drawing: Drawing, reference: Callable[[Stage], mujoco.Renderer]
):
    stage = build(seed)
    ours, theirs = drawing(stage), reference(stage)
    rng = np.random.default_rng(seed)
    for _ in range(3):
        pose = random_view(rng)
        through_model_camera(stage, pose)
        theirs.disable_segmentation_rendering()
        theirs.update_scene(stage.data, "eye")
        expected = theirs.render().copy()
        # The camera's axes and frustum are computed in another order: single precision changes a pixel here and there.
        differ = (ours.color(stage.data, pose, K) != expected).any(axis=2)
        assert differ.mean() < 1e-3
        theirs.enable_segmentation_rendering()
        geoms = theirs.render()
        expected_ids = np.where(geoms[..., 1] == int(mujoco.mjtObj.mjOBJ_GEOM), geoms[..., 0], -1)
        assert (ours.ids(stage.data, pose, K).ids != expected_ids).mean() < 1e-3


def test_a_field_of_view_gives_the_same_image_as_its_camera_matrix(drawing: Drawing):
    stage = build()
    renderer, pose = drawing(stage), looking((0, 0, 1.2), (5, 0, 1))
    assert np.array_equal(renderer.color(stage.data, pose, K), renderer.color(stage.data, pose, 0.9))


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


def segmented(
    drawing: Drawing, rng: np.random.Generator, count: int
) -> Iterator[tuple[Stage, Rasteriser, np.ndarray, Segmentation]]:
    """Some stages, each with its renderer, a view of it, and its segmentation."""
    for seed in range(count):
        stage = build(seed)
        renderer, pose = drawing(stage), random_view(rng)
        yield stage, renderer, pose, renderer.ids(stage.data, pose, K)


def test_any_rectangle_equals_the_crop_of_the_whole_image(drawing: Drawing):
    rng = np.random.default_rng(3)
    for stage, renderer, pose, whole in segmented(drawing, rng, 6):
        for _ in range(12):
            left, top = int(rng.integers(WIDTH)), int(rng.integers(HEIGHT))
            rect = PixelRect(left, top, int(rng.integers(1, WIDTH - left + 1)), int(rng.integers(1, HEIGHT - top + 1)))
            part = renderer.ids(stage.data, pose, K, rect=rect)
            assert part.rect == rect
            assert np.array_equal(part.ids, whole.ids[rect.slices])
            assert np.array_equal(part.inverse_depth, whole.inverse_depth[rect.slices])


def test_segmentations_of_parts_merge_into_that_of_the_whole(drawing: Drawing):
    rng = np.random.default_rng(4)
    for stage, renderer, pose, whole in segmented(drawing, rng, 12):
        share = rng.integers(3, size=stage.model.ngeom)
        ids, nearness = np.full_like(whole.ids, -1), np.zeros_like(whole.inverse_depth)
        for index in range(3):
            layer = renderer.ids(stage.data, pose, K, geoms=share == index)
            over = (layer.inverse_depth > nearness) | ((layer.inverse_depth == nearness) & (layer.ids > ids))
            ids[over], nearness[over] = layer.ids[over], layer.inverse_depth[over]
        assert np.array_equal(ids, whole.ids)
        assert np.array_equal(nearness, whole.inverse_depth)


def test_every_id_is_a_visible_geom(drawing: Drawing):
    rng = np.random.default_rng(5)
    for seed in range(10):
        stage = build(seed)
        renderer = drawing(stage)
        assert not renderer.visible_geoms[stage.model.geom_group == HIDDEN_GROUP].any()
        for _ in range(3):
            layer = renderer.ids(stage.data, random_view(rng), K)
            seen = np.unique(layer.ids)
            assert seen.min() >= -1
            assert seen.max() < stage.model.ngeom
            assert renderer.visible_geoms[seen[seen >= 0]].all()
            assert ((layer.inverse_depth > 0) == (layer.ids >= 0)).all()


def test_only_the_given_geoms_are_drawn(drawing: Drawing):
    stage = build()
    renderer, pose = drawing(stage), looking((0, 0, 1.2), (5, 0, 1))
    groups = stage.model.geom_group.copy()
    shown = stage.model.geom_group == PEOPLE_GROUP
    seen = np.unique(renderer.ids(stage.data, pose, K, geoms=shown).ids)
    assert set(seen) - {-1} <= set(np.flatnonzero(shown))
    assert len(seen) > 5
    nothing = renderer.ids(stage.data, pose, K, geoms=np.zeros(stage.model.ngeom, bool))
    assert (nothing.ids == -1).all()
    everything = renderer.ids(stage.data, pose, K, geoms=np.ones(stage.model.ngeom, bool))
    assert np.array_equal(everything.ids, renderer.ids(stage.data, pose, K).ids)
    assert np.array_equal(groups, stage.model.geom_group)  # the caller's model is unchanged


def test_fully_transparent_geoms_do_not_shift_the_ids_of_others(drawing: Drawing):
    stage = build()
    pose = looking((0, 0, 1.2), (5, 0, 1))
    before = drawing(stage).ids(stage.data, pose, K)
    ghost = int(np.flatnonzero(stage.model.geom_group == PEOPLE_GROUP)[0])
    stage.model.geom_rgba[ghost, 3] = 0.0
    after = drawing(stage).ids(stage.data, pose, K)
    unchanged = before.ids != ghost
    assert np.array_equal(before.ids[unchanged], after.ids[unchanged])
    assert not (after.ids == ghost).any()


def test_ids_do_not_depend_on_light_shadows_or_multisampling():
    pose = looking((0, 0, 1.2), (5, 0, 1))
    layers, pictures = [], []
    for samples in (0, 4):
        stage = build(1, samples=samples)
        with Rasteriser(stage.model, WIDTH, HEIGHT) as renderer:
            layers.append(renderer.ids(stage.data, pose, K))
            pictures.append(renderer.color(stage.data, pose, K))
    assert np.array_equal(layers[0].ids, layers[1].ids)
    assert np.array_equal(layers[0].inverse_depth, layers[1].inverse_depth)
    assert not np.array_equal(*pictures)


def test_geoms_are_drawn_where_the_camera_matrix_projects_them(drawing: Drawing):
    """A camera with unequal focal lengths and an off-centre principal point draws what it projects."""
    spec = new_spec()
    spots = np.random.default_rng(6).uniform([3, -0.9, 0.4], [6, 0.9, 2.0], size=(16, 3))
    for index, spot in enumerate(spots):
        spec.worldbody.add_body(name=f"ball-{index}", pos=spot).add_geom(size=[0.03, 0, 0])
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    stage = Stage(model, data, (), {})
    renderer, pose = drawing(stage), looking((0, 0, 1.2), (5, 0, 1.0), roll=0.3)
    odd = intrinsics(WIDTH, HEIGHT, 0.9)
    odd[0, 0], odd[0, 2], odd[1, 2] = 1.4 * odd[0, 0], 100.25, 140.5
    ids = renderer.ids(data, pose, odd).ids
    pixels = normalized_coordinates(np.array(spots), pose, 0.0) * odd[(0, 1), (0, 1)] + odd[:2, 2]
    found = 0
    for index, (x, y) in enumerate(pixels):
        rows, columns = np.nonzero(ids == index)
        if 3 < x < WIDTH - 3 and 3 < y < HEIGHT - 3 and len(rows) > 8:
            found += 1
            assert abs(columns.mean() + 0.5 - x) < 0.7
            assert abs(rows.mean() + 0.5 - y) < 0.7
    assert found > 5


def test_each_image_is_a_new_equal_array(drawing: Drawing):
    stage = build()
    renderer, pose = drawing(stage), looking((0, 0, 1.2), (5, 0, 1))
    first = renderer.color(stage.data, pose, K)
    kept = first.copy()
    renderer.color(stage.data, looking((0, 0, 1.2), (-5, 0, 1)), K)
    renderer.ids(stage.data, pose, K)
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
            assert renderer.color(stage.data, pose, 0.9).shape == (size[1], size[0], 3)
            assert renderer.ids(stage.data, pose, 0.9).ids.shape == (size[1], size[0])


def test_invalid_arguments_raise(drawing: Drawing):
    stage = build()
    renderer, pose = drawing(stage), looking((0, 0, 1.2), (5, 0, 1))
    for rect in (PixelRect(0, 0, 0, 5), PixelRect(-1, 0, 5, 5), PixelRect(0, 0, WIDTH + 1, 5)):
        with pytest.raises(ParameterError, match="rectangle"):
            renderer.ids(stage.data, pose, K, rect=rect)
    for wrong in (np.eye(3), np.full((4, 4), np.nan)):
        with pytest.raises(ParameterError, match="T_world_camera"):
            renderer.color(stage.data, wrong, K)
    with pytest.raises(ParameterError, match="width"):
        Rasteriser(stage.model, 0, 5)


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
def test_ids_and_truth_do_not_depend_on_the_opengl_library(
    digest_in_new_process: Callable[[str, int], dict], osmesa_present: None
):
    egl, osmesa = digest_in_new_process("egl", 0), digest_in_new_process("osmesa", 0)
    assert (egl["backend"], osmesa["backend"]) == ("egl", "osmesa")
    assert egl["ids"] == osmesa["ids"]
    assert osmesa["environment_unchanged"]
    for one, other in zip(egl["truths"], osmesa["truths"], strict=True):
        assert [truth[:4] for truth in one] == [truth[:4] for truth in other]


@pytest.mark.slow
def test_multisampling_does_not_change_the_boxes(digest_in_new_process: Callable[[str, int], dict]):
    plain, smooth = digest_in_new_process("any", 0), digest_in_new_process("any", 4)
    assert plain["ids"] == smooth["ids"]
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
        scene, group = renderer._scene._color, stage.model.geom_group.copy()
        for _ in range(3):
            pose = looking(tuple(rng.normal((2.0, 0.0, 1.5))), tuple(rng.normal(size=3) * 3), rng.normal())
            picture, culled = renderer.color(stage.data, pose, K), scene.ngeom
            np.testing.assert_array_equal(stage.model.geom_group, group)
            with monkeypatch.context() as patch:
                patch.setattr(Bounds, "in_view", lambda *arguments: np.ones(len(arguments[-1]), dtype=bool))
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
            shown.append(renderer._scene._color.ngeom)
    assert shown == [2, 1]


def test_some_geoms_are_drawn_and_the_model_is_left_as_it_was():
    stage = build(3)
    group = stage.model.geom_group.copy()
    shown = np.isin(stage.model.geom_group, [PEOPLE_GROUP])
    with Rasteriser(stage.model, WIDTH, HEIGHT) as renderer:
        some = renderer.ids(stage.data, looking((0.0, 0.0, 1.2), (4.0, 0.0, 1.0)), K, geoms=shown).ids
    np.testing.assert_array_equal(stage.model.geom_group, group)
    assert np.isin(some, [-1, *np.flatnonzero(shown)]).all()
    assert (some >= 0).any()
