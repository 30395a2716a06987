"""Segmentations against MuJoCo's, and their laws: rectangles, parts, planes, projection."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from observing import box_of, mujocos_renderer
from render_stage import FAR, HEIGHT, NEAR, WIDTH, K, Stage, build, looking, new_spec, random_view

from pftrack_sim.camera.pinhole import intrinsics
from pftrack_sim.render.culling import PixelRect, View
from pftrack_sim.render.gl.rasteriser import Rasteriser
from pftrack_sim.render.segmentation import Segmentation, Segmenter, draw_triangles
from pftrack_sim.render.triangles import Detail
from pftrack_sim.scenario.clothes import Clothes
from pftrack_sim.scene.layout import HIDDEN_GROUP, PEOPLE_GROUP
from pftrack_sim.scene.people.person import add_person, sample_target
from pftrack_sim.scene.scene_spec import SceneSpec

IMAGE = PixelRect(0, 0, WIDTH, HEIGHT)
ALONG_X = looking((0.0, 0.0, 0.3), (1.0, 0.0, 0.3))


def view_of(data: mujoco.MjData, pose: np.ndarray, matrix: np.ndarray = K) -> View:
    return View(data.geom_xpos, data.geom_xmat, pose, matrix, NEAR)


def whole(stage: Stage, pose: np.ndarray) -> tuple[Segmenter, View, Segmentation]:
    segmenter, view = Segmenter(stage.model), view_of(stage.data, pose)
    return segmenter, view, segmenter.segment(view, IMAGE)


@pytest.mark.parametrize("seed", range(4))
def test_ids_and_depths_are_those_of_mujoco_up_to_edges(seed: int):
    stage, rng = build(seed), np.random.default_rng(seed)
    # With the first seed, the nearest triangles of the ground reach behind the near plane.
    pose = random_view(rng) if seed else ALONG_X
    segmenter, view, ours = whole(stage, pose)
    with mujocos_renderer(stage.model) as reference:
        theirs, depth_m = reference.ids(stage.data, pose), reference.depth_m(stage.data, pose)
        some = rng.random(stage.model.ngeom) < 0.5
        of_some = reference.ids(stage.data, pose, some)
    assert (theirs == ours.ids).mean() > 0.998
    assert len(np.unique(ours.ids)) > 5
    assert (segmenter.segment(view, IMAGE, np.flatnonzero(some & segmenter.drawn)).ids == of_some).mean() > 0.998
    shown = (theirs == ours.ids) & (ours.ids >= 0)
    ratio = ours.depth_m()[shown] / depth_m[shown]
    # Round shapes have the same number of facets, but not the same facets.
    assert abs(np.log(np.quantile(ratio, [0.01, 0.99]))).max() < 5e-3
    assert np.isinf(ours.depth_m()[ours.ids < 0]).all()


def test_any_rectangle_equals_the_crop_of_the_whole_image():
    rng = np.random.default_rng(3)
    for seed in range(3):
        segmenter, view, everything = whole(build(seed), random_view(rng))
        for _ in range(12):
            left, top = int(rng.integers(WIDTH)), int(rng.integers(HEIGHT))
            rect = PixelRect(left, top, int(rng.integers(1, WIDTH - left + 1)), int(rng.integers(1, HEIGHT - top + 1)))
            part = segmenter.segment(view, rect)
            np.testing.assert_array_equal(part.ids, everything.ids[rect.slices])
            np.testing.assert_allclose(part.inverse_depth, everything.inverse_depth[rect.slices], rtol=1e-5)


def test_geoms_added_in_any_order_give_the_same_segmentation():
    rng = np.random.default_rng(4)
    for seed in range(6):
        segmenter, view, everything = whole(build(seed), random_view(rng))
        found = segmenter.segment(view, IMAGE, np.empty(0, dtype=np.intp))
        assert (found.ids == -1).all()
        for some in np.array_split(rng.permutation(np.flatnonzero(segmenter.drawn)), 3):
            segmenter.add(found, view, some)
            assert np.isin(found.ids, [-1, *np.flatnonzero(segmenter.drawn)]).all()
        np.testing.assert_array_equal(found.ids, everything.ids)
        np.testing.assert_array_equal(found.inverse_depth, everything.inverse_depth)


def test_hidden_and_fully_transparent_geoms_are_not_drawn():
    stage, pose = build(), looking((0, 0, 1.2), (5, 0, 1))
    segmenter, _, before = whole(stage, pose)
    assert not segmenter.drawn[stage.model.geom_group == HIDDEN_GROUP].any()
    assert segmenter.drawn[before.ids[before.ids >= 0]].all()
    ghost = int(np.flatnonzero(stage.model.geom_group == PEOPLE_GROUP)[0])
    stage.model.geom_rgba[ghost, 3] = 0.0
    after = whole(stage, pose)[2]
    np.testing.assert_array_equal(after.ids[before.ids != ghost], before.ids[before.ids != ghost])
    assert not (after.ids == ghost).any()


def test_geoms_are_drawn_where_the_camera_matrix_projects_them():
    """A camera with unequal focal lengths and an off-centre principal point."""
    spec = new_spec()
    spec.visual.headlight.active = 1
    spots = np.random.default_rng(6).uniform([3, -0.9, 0.4], [6, 0.9, 2.0], size=(16, 3))
    for index, spot in enumerate(spots):
        spec.worldbody.add_body(name=f"ball-{index}", pos=spot).add_geom(size=[0.03, 0, 0])
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    pose, odd = looking((0, 0, 1.2), (5, 0, 1.0), roll=0.3), intrinsics(WIDTH, HEIGHT, 0.9)
    odd[0, 0], odd[0, 2], odd[1, 2] = 1.4 * odd[0, 0], 100.25, 140.5
    ids = Segmenter(model).segment(view_of(data, pose, odd), IMAGE).ids
    with Rasteriser(model, WIDTH, HEIGHT) as renderer:
        assert (renderer.color(data, pose, odd).any(axis=2) == (ids >= 0)).mean() > 0.998
    local = (np.array(spots) - pose[:3, 3]) @ pose[:3, :3]
    pixels = local[:, :2] / local[:, 2:] * odd[(0, 1), (0, 1)] + odd[:2, 2]
    found = 0
    for index, (x, y) in enumerate(pixels):
        rows, columns = np.nonzero(ids == index)
        if 3 < x < WIDTH - 3 and 3 < y < HEIGHT - 3 and len(rows) > 8:
            found += 1
            assert abs(columns.mean() + 0.5 - x) < 0.7
            assert abs(rows.mean() + 0.5 - y) < 0.7
    assert found > 5


def test_an_unbounded_plane_is_the_ground_up_to_the_far_plane():
    spec = new_spec()
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1])
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    view = view_of(data, looking((0.0, 0.0, 1.0), (1.0, 0.0, 1.0)), intrinsics(32, 600, 1.0))
    depth_m = Segmenter(model).segment(view, PixelRect(0, 0, 32, 600)).depth_m()[:, 5]
    expected = 300 / np.tan(0.5) / np.maximum(np.arange(600) + 0.5 - 300, 1e-9)
    np.testing.assert_allclose(depth_m, np.where(expected < FAR, expected, np.inf), rtol=1e-4)


def test_people_at_a_distance_are_drawn_and_segmented_by_the_same_coarser_meshes():
    spec = SceneSpec()
    spec.stat.extent, spec.visual.map.znear, spec.visual.map.zfar = 1.0, NEAR, FAR
    spec.visual.quality.offsamples = 0
    add_person(spec, sample_target(5, "target", 1.8, Clothes()))
    model = spec.compile()
    model.mat_emission[:] = 1.0  # Nothing that is drawn is black
    detail, segmenter, data = Detail(model), Segmenter(model), mujoco.MjData(model)
    fine = np.flatnonzero(segmenter.drawn)
    pose, counts = looking((0.0, 0.0, 1.0), (1.0, 0.0, 1.0)), []
    with Rasteriser(model, WIDTH, HEIGHT) as renderer:
        for distance_m in (2.0, 9.0, 15.0, 40.0):
            data.mocap_pos[:] = [(distance_m, 0.4 * (part % 3 - 1), 0.3 * (part // 3)) for part in range(13)]
            mujoco.mj_forward(model, data)
            view = view_of(data, pose)
            counts.append(np.bincount(detail.shapes(view, fine) // model.ngeom, minlength=3).tolist())
            shown = renderer.color(data, pose, K).any(axis=2)
            # Silhouettes within a hundredth of a pixel of its middle are OpenGL's to round.
            near = [
                segmenter.segment(view_of(data, pose, K + np.array([[0, 0, x], [0, 0, y], [0, 0, 0]])), IMAGE).ids >= 0
                for x in (-0.01, 0.01)
                for y in (-0.01, 0.01)
            ]
            assert ((shown == np.any(near, axis=0)) | (shown == np.all(near, axis=0))).all()
            ours = segmenter.segment(view, IMAGE).ids >= 0
            np.testing.assert_array_equal(model.geom_dataid, detail.meshes[0])
            whole = np.zeros((HEIGHT, WIDTH), dtype=np.int32) - 1, np.zeros((HEIGHT, WIDTH), dtype=np.float32)
            poses = data.geom_xpos, data.geom_xmat.reshape(-1, 3, 3), pose
            draw_triangles(fine, segmenter.triangles, *poses, view.intrinsics, NEAR, *whole)
            assert np.abs(box_of(whole[0] >= 0) - box_of(ours)).max() <= 1.0
    finest, coarse, coarsest = np.transpose(counts).tolist()
    assert finest[0] == 13 > finest[1] > finest[2] >= finest[3] == 0
    assert coarse[1] > 0
    assert coarsest[3] > 0
