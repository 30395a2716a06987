"""A batch of worlds equals each world drawn alone."""

from __future__ import annotations

import numpy as np
import pytest

from pftrack_sim.camera.pinhole import intrinsics
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.scenario import load
from pftrack_sim.simulation.world import World

pytest.importorskip("mujoco_warp")

WIDTH, HEIGHT, WORLDS = 80, 60, 4


def _people(world: World) -> np.ndarray:
    model = world.model
    names = [model.body(int(body)).name.split("/")[0] for body in model.geom_bodyid]
    return np.array([world.people.index(name) if name in world.people else -1 for name in names])


def test_a_batch_of_four_worlds_equals_each_world_drawn_alone():
    from pftrack_sim.render.warp.batch import ManyWorlds
    from pftrack_sim.render.warp.raycaster import Raycaster

    scenario = load("corridor")
    worlds = [World(scenario.resolve(seed), seed) for seed in range(20, 20 + WORLDS)]
    K = intrinsics(WIDTH, HEIGHT, 0.9)
    for index, world in enumerate(worlds):
        world.light()
        world.model.light_diffuse[:] *= 1.0 - 0.2 * index
    owners = [_people(world) for world in worlds]
    many = ManyWorlds([world.model for world in worlds], owners, WIDTH, HEIGHT)
    poses = np.array([world.camera_pose() for world in worlds])
    batch = many.draw([world.data for world in worlds], poses, [K] * WORLDS)
    for index, world in enumerate(worlds):
        with Raycaster(world.model, WIDTH, HEIGHT) as alone:
            np.testing.assert_array_equal(batch.images[index], alone.color(world.data, poses[index], K))
            ids = alone.ids(world.data, poses[index], K).ids
        np.testing.assert_array_equal(batch.ids[index], ids)
        for person in range(len(world.people)):
            rows, columns = np.nonzero((ids >= 0) & (owners[index][ids] == person))
            assert batch.visible_pixels[index, person] == rows.size
            if rows.size:
                box = [columns.min(), rows.min(), np.ptp(columns) + 1, np.ptp(rows) + 1]
                np.testing.assert_array_equal(batch.visible_boxes[index, person], box)
            else:
                assert np.isnan(batch.visible_boxes[index, person]).all()
    assert len({image.tobytes() for image in batch.images}) == WORLDS
    with pytest.raises(ParameterError, match="4 worlds"):
        many.draw([worlds[0].data], poses, [K] * WORLDS)
