"""Darkness on the ground under feet and around things, and nowhere else."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

from pftrack_sim import scenario
from pftrack_sim.core.records import Truth
from pftrack_sim.render.gl import contact
from pftrack_sim.render.gl.rasteriser import Rasteriser
from pftrack_sim.scene.layout import CONTACT_OF_THINGS
from pftrack_sim.simulation.simulation import Simulation
from pftrack_sim.simulation.world import World

SIZE = {"camera.width_px": 320, "camera.height_px": 240, "lights.shadows": False, "distractors.count": 0}


def change(world: World, truth: Truth, without: Callable[[], None]) -> np.ndarray:
    """`(H, W)` how much darker a picture is than one without some of the contact shadows, negative."""
    view = world.data, truth.T_world_camera, truth.K
    with Rasteriser(world.model, 320, 240) as renderer:
        dark = renderer.color(*view).astype(int)
        without()
        renderer.rebind(world.model)
        changed = (dark - renderer.color(*view)).sum(axis=2)
    assert changed.max() == 0
    return changed


def test_the_ground_is_darker_under_feet_and_nowhere_else(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(contact, "_OPACITY_OF_THINGS", 0.0)
    with Simulation(scenario.load("corridor", SIZE)) as simulation:
        truth = simulation.reset(3).truth
        target = simulation.silhouettes["target"]
        no_feet = partial(monkeypatch.setattr, contact.ContactShadows, "place", lambda *_: 0)
        changed = change(simulation.world, truth, no_feet)
    assert changed.min() < -100
    x, y, width, height = truth.box
    rows, columns = np.nonzero(changed < 0)
    own = (columns > x - 0.5 * width) & (columns < x + 1.5 * width)
    assert (rows[own] > y + 0.85 * height).all()
    assert (rows[own] < y + 1.15 * height).all()
    assert (changed[target.rect.slices][target.visible] < 0).mean() < 0.01


@pytest.mark.parametrize("place", ["corridor", "plaza-walk", "warehouse"])
def test_the_ground_is_darker_around_things_which_no_geom_shows(place: str, monkeypatch: pytest.MonkeyPatch):
    with Simulation(scenario.load(place, SIZE)) as simulation:
        truth = simulation.reset(3).truth
        depth, model = simulation.depth(), simulation.world.model
        changed = change(simulation.world, truth, partial(monkeypatch.setattr, contact, "_OPACITY_OF_THINGS", 0.0))
        assert model.mesh(CONTACT_OF_THINGS).id not in model.geom_dataid
    assert changed.min() < -60
    rows, columns = np.nonzero(changed < 0)
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
