"""The rasteriser without OpenGL against OpenGL itself: ids, depths, rectangles, near plane, all types of geoms."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from render_stage import FOVY, HEIGHT, WIDTH, K, build, random_view

from pftrack_sim.core.errors import ParameterError, RenderError
from pftrack_sim.render.backend import PixelRect
from pftrack_sim.render.gl.rasteriser import Rasteriser
from pftrack_sim.render.id_rasteriser import IdRasteriser


@pytest.mark.parametrize("seed", range(4))
def test_ids_and_depths_are_those_of_opengl_up_to_edges(seed: int):
    stage = build(seed)
    rng = np.random.default_rng(seed)
    pose = random_view(rng)
    with Rasteriser(stage.model, WIDTH, HEIGHT) as reference, IdRasteriser(stage.model, WIDTH, HEIGHT) as renderer:
        for geoms in (None, rng.random(stage.model.ngeom) < 0.5):
            theirs = reference.ids(stage.data, pose, K, geoms=geoms)
            ours = renderer.ids(stage.data, pose, K, geoms=geoms)
            same = theirs.ids == ours.ids
            assert same.mean() > 0.998
            assert len(np.unique(ours.ids)) > 5
            shown = same & (ours.ids >= 0)
            ratio = renderer.depth_m(ours)[shown] / reference.depth_m(theirs)[shown]
            # Round shapes have the same number of facets, but not the same facets.
            assert abs(np.log(np.quantile(ratio, [0.01, 0.99]))).max() < 5e-3


def test_a_rectangle_equals_the_same_pixels_of_the_image():
    stage = build(1)
    pose, rect = random_view(np.random.default_rng(1)), PixelRect(37, 20, 150, 190)
    with IdRasteriser(stage.model, WIDTH, HEIGHT) as renderer:
        whole, part = renderer.ids(stage.data, pose, K), renderer.ids(stage.data, pose, FOVY, rect=rect)
        np.testing.assert_array_equal(part.ids, whole.ids[rect.slices])
        np.testing.assert_allclose(part.inverse_depth, whole.inverse_depth[rect.slices], rtol=1e-5)
        with pytest.raises(ParameterError, match="must lie in the"):
            renderer.ids(stage.data, pose, K, rect=PixelRect(0, 0, WIDTH + 1, 5))


def test_geoms_are_cut_at_the_near_plane():
    stage = build(2, people=1, pillars=0)
    pose = np.eye(4)
    # Above the ground and looking along it: the nearest of its triangles reach behind the camera.
    pose[:3, :3] = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
    pose[:3, 3] = 0.0, 0.0, 0.3
    with Rasteriser(stage.model, WIDTH, HEIGHT) as reference, IdRasteriser(stage.model, WIDTH, HEIGHT) as renderer:
        ours, theirs = renderer.ids(stage.data, pose, K), reference.ids(stage.data, pose, K)
    assert (ours.ids == theirs.ids).mean() > 0.998
    assert ours.ids[-1, 0] == stage.model.body("ground").geomadr[0]


def test_there_are_no_colours_and_errors_after_closing():
    stage = build(0)
    with IdRasteriser(stage.model, WIDTH, HEIGHT) as renderer, pytest.raises(RenderError, match="no colours"):
        renderer.color(stage.data, np.eye(4), K)
    with pytest.raises(RenderError, match="rebind"):
        renderer.ids(stage.data, np.eye(4), K)
    renderer.rebind(stage.model)
    assert renderer.ids(stage.data, np.eye(4), K).ids.shape == (HEIGHT, WIDTH)


def test_an_unbounded_plane_is_the_ground():
    spec = mujoco.MjSpec()
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1])
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    pose = np.eye(4)
    pose[:3, :3] = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
    pose[:3, 3] = 0.0, 0.0, 1.0
    with IdRasteriser(model, 32, 24) as renderer:
        found = renderer.ids(data, pose, 1.0)
        depth = renderer.depth_m(found)
    assert (found.ids[:12] < 0).all()
    assert (found.ids[13:] == 0).all()
    rows = np.arange(13, 24) + 0.5 - 12
    np.testing.assert_allclose(depth[13:, 5], 12 / np.tan(0.5) / rows, rtol=1e-5)
