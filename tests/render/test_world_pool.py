"""Many worlds drawn together: the pixels of each alone, tasks that wait for each other, and shared textures."""

from __future__ import annotations

import gc
from collections.abc import Sequence

import numpy as np
import pytest

from pftrack_sim.camera.pinhole import intrinsics
from pftrack_sim.core.errors import ParameterError, RenderError
from pftrack_sim.render.backend import PixelRect
from pftrack_sim.scenario import load
from pftrack_sim.simulation.world import World

pytest.importorskip("mujoco_warp")
pytest.importorskip("greenlet")

WIDTH, HEIGHT = 64, 48


def test_tasks_wait_for_each_other_and_go_on_with_their_own_answers():
    from pftrack_sim.render.warp.rendezvous import Rendezvous

    asked: list[list[int]] = []

    def double(requests: Sequence[int]) -> list[int]:
        asked.append(list(requests))
        return [2 * one for one in requests]

    meeting = Rendezvous(double)

    def task(first: int, count: int):
        return lambda: [meeting.ask(first + index) for index in range(count)]

    assert meeting.run([task(10, 2), task(20, 0), task(30, 3)]) == [[20, 22], [], [60, 62, 64]]
    assert asked == [[10, 30], [11, 31], [32]]
    assert meeting.ask(5) == 10
    assert meeting.run([]) == []


def test_an_error_of_a_task_ends_the_others_where_they_wait():
    from pftrack_sim.render.warp.rendezvous import Rendezvous

    meeting = Rendezvous[int, int](list)
    ended: list[int] = []

    def waits(number: int) -> None:
        try:
            while True:
                meeting.ask(number)
        finally:
            ended.append(number)

    def fails() -> None:
        meeting.ask(7)
        raise ParameterError("a wrong action")

    with pytest.raises(ParameterError, match="a wrong action"):
        meeting.run([lambda: waits(1), fails, lambda: waits(3)])
    assert ended == [1, 3]
    assert meeting.run([lambda: meeting.ask(4)]) == [4]


def test_a_pool_draws_each_world_as_it_is_drawn_alone():
    from pftrack_sim.render.warp.raycaster import Raycaster
    from pftrack_sim.render.warp.world_pool import WorldPool

    scenario = load("corridor", {"distractors.count": 1})
    worlds = [World(scenario.resolve(seed), seed) for seed in (20, 21)]
    K, pool = intrinsics(WIDTH, HEIGHT, 0.9), WorldPool()
    for index, world in enumerate(worlds):
        world.light()
        world.model.light_diffuse[:] *= 1.0 - 0.3 * index
    renderers = [pool.renderer(world.model, WIDTH, HEIGHT) for world in worlds]
    masks = [np.arange(world.model.ngeom) % 3 != 0 for world in worlds]
    rects = [PixelRect(5, 3, 40, 30), PixelRect(20, 0, 11, 48)]

    def drawn(index: int):
        world, renderer = worlds[index], renderers[index]
        view = world.data, world.camera_pose(), K
        nothing = renderer.ids(*view, geoms=np.zeros(world.model.ngeom, dtype=np.bool_)) if index else None
        return renderer.color(*view), renderer.ids(*view, geoms=masks[index], rect=rects[index]), nothing

    together = pool.run([lambda: drawn(0), lambda: drawn(1)])
    for index, (world, (image, found, nothing)) in enumerate(zip(worlds, together, strict=True)):
        view = world.data, world.camera_pose(), K
        with Raycaster(world.model, WIDTH, HEIGHT) as alone:
            np.testing.assert_array_equal(image, alone.color(*view))
            expected = alone.ids(*view, geoms=masks[index], rect=rects[index])
        np.testing.assert_array_equal(found.ids, expected.ids)
        np.testing.assert_array_equal(found.inverse_depth, expected.inverse_depth)
        assert (found.ids >= 0).any()
        assert found.rect == expected.rect
        if nothing is not None:
            assert (nothing.ids == -1).all()
            assert not nothing.inverse_depth.any()
    # A world alone, after another has left.
    view = worlds[1].data, worlds[1].camera_pose(), K
    renderers[0].close()
    np.testing.assert_array_equal(renderers[1].color(*view), together[1][0])
    with pytest.raises(RenderError, match="closed"):
        renderers[0].color(worlds[0].data, worlds[0].camera_pose(), K)


def test_the_same_texture_is_on_the_device_once_and_not_longer_than_it_is_used():
    from pftrack_sim.render.warp.assets import SharedAssets

    class Uploaded:
        pass

    shared, made = SharedAssets(), []

    def make() -> Uploaded:
        made.append(None)
        return Uploaded()

    texels = np.arange(12, dtype=np.uint8).reshape(2, 2, 3)
    first = shared.get((texels,), make)
    assert shared.get((texels.copy(),), make) is first
    assert shared.get((texels.reshape(2, 1, 6),), make) is not first
    assert len(made) == 2
    del first
    gc.collect()
    shared.get((texels,), make)
    assert len(made) == 3


def test_a_texture_takes_at_most_ten_bytes_a_texel():
    from pftrack_sim.render.warp.assets import Assets

    model = World(load("corridor").resolve(1), 1).model
    for texture, levels in enumerate(Assets(model).textures):
        sizes = [level.width * level.height * level.num_channels * np.dtype(level.dtype).itemsize for level in levels]
        texels = model.tex_width[texture] * model.tex_height[texture]
        assert 4 * texels <= sum(sizes) <= 10 * texels
