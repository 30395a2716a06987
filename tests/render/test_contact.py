"""Darkness on the ground under feet and around things, and nowhere else."""

from __future__ import annotations

import numpy as np
import pytest

from pftrack_sim import scenario
from pftrack_sim.render.gl import contact
from pftrack_sim.render.gl.rasteriser import Rasteriser
from pftrack_sim.scene.layout import CONTACT_OF_THINGS
from pftrack_sim.simulation.simulation import Simulation

SIZE = {"camera.width_px": 320, "camera.height_px": 240, "lights.shadows": False, "distractors.count": 0}


def test_the_ground_is_darker_under_feet_and_nowhere_else(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(contact, "_OPACITY_OF_THINGS", 0.0)
    with Simulation(scenario.load("corridor", SIZE)) as simulation:
        truth = simulation.reset(3).truth
        world = simulation.world
        silhouettes = simulation.silhouettes
        view = world.data, truth.T_world_camera, truth.K
        with Rasteriser(world.model, 320, 240) as renderer:
            dark = renderer.color(*view).astype(int)
            monkeypatch.setattr(contact.ContactShadows, "place", lambda *_: 0)
            plain = renderer.color(*view).astype(int)
    change = (dark - plain).sum(axis=2)
    assert change.max() == 0
    assert change.min() < -100
    x, y, width, height = truth.box
    rows, columns = np.nonzero(change < 0)
    own = (columns > x - 0.5 * width) & (columns < x + 1.5 * width)
    assert (rows[own] > y + 0.85 * height).all()
    assert (rows[own] < y + 1.15 * height).all()
    target = silhouettes["target"]
    on_target = change[target.rect.slices][target.visible] < 0
    assert on_target.mean() < 0.01


@pytest.mark.parametrize("place", ["corridor", "plaza-walk", "warehouse"])
def test_the_ground_is_darker_around_things_which_no_geom_shows(place: str, monkeypatch: pytest.MonkeyPatch):
    with Simulation(scenario.load(place, SIZE)) as simulation:
        truth = simulation.reset(3).truth
        depth, world = simulation.depth(), simulation.world
        view = world.data, truth.T_world_camera, truth.K
        with Rasteriser(world.model, 320, 240) as renderer:
            dark = renderer.color(*view).astype(int)
            monkeypatch.setattr(contact, "_OPACITY_OF_THINGS", 0.0)
            renderer.rebind(world.model)
            plain = renderer.color(*view).astype(int)
        assert world.model.mesh(CONTACT_OF_THINGS).id not in world.model.geom_dataid
    change = (dark - plain).sum(axis=2)
    assert change.max() == 0
    assert change.min() < -60
    rows, columns = np.nonzero(change < 0)
    x, y = (columns + 0.5 - truth.K[0, 2]) / truth.K[0, 0], (rows + 0.5 - truth.K[1, 2]) / truth.K[1, 1]
    points = depth[rows, columns, None] * np.stack([x, y, np.ones(len(x))], axis=1)
    heights = (points @ truth.T_world_camera[:3, :3].T + truth.T_world_camera[:3, 3])[:, 2]
    assert np.mean(heights > 0.05) < 0.02


def test_a_picture_does_not_depend_on_the_one_before():
    with Simulation(scenario.load("hall", {"camera.width_px": 160, "camera.height_px": 120})) as simulation:
        truth = simulation.reset(3).truth
        world = simulation.world
        away = truth.T_world_camera @ np.diag([-1.0, 1.0, -1.0, 1.0])
        with Rasteriser(world.model, 160, 120) as fresh:
            first = fresh.color(world.data, truth.T_world_camera, truth.K)
        with Rasteriser(world.model, 160, 120) as used:
            used.color(world.data, away, truth.K)
            np.testing.assert_array_equal(used.color(world.data, truth.T_world_camera, truth.K), first)
