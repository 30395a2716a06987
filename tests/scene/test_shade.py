"""Patches of light: the share in shade is the one asked for, and what casts it is not seen."""

from __future__ import annotations

import cv2
import mujoco
import numpy as np
import pytest

from pftrack_sim import scenario
from pftrack_sim.core.random_streams import stream
from pftrack_sim.core.records import Frame
from pftrack_sim.scenario.model import Lights, Place
from pftrack_sim.scene.places.meshes import TexturedMesh
from pftrack_sim.scene.places.place import add_place
from pftrack_sim.scene.places.shade import foliage, roof_with_windows
from pftrack_sim.scene.scene_spec import SceneSpec
from pftrack_sim.simulation.simulation import Simulation

BOUNDS = (-10.0, -6.0, 30.0, 8.0)


def covered_share(mesh: TexturedMesh) -> float:
    """Share of `BOUNDS` below the mesh, on a grid of 5 cm."""
    left, low, right, high = BOUNDS
    grid = np.zeros((round(20 * (high - low)), round(20 * (right - left))), dtype=np.uint8)
    corners = np.round(20.0 * (mesh.vertices[mesh.faces][:, :, :2] - (left, low))).astype(np.int32)
    for triangle in corners:
        cv2.fillConvexPoly(grid, triangle, 1)
    return float(grid.mean())


@pytest.mark.parametrize("share", [0.2, 0.5, 0.8])
@pytest.mark.parametrize("build", [foliage, roof_with_windows])
def test_the_share_in_shade_is_the_one_asked_for(build, share: float) -> None:
    shares = [covered_share(build(BOUNDS, share, 2.0, 5.0, np.random.default_rng(seed))) for seed in range(3)]
    assert abs(np.mean(shares) - share) < 0.1


@pytest.mark.parametrize("build", [foliage, roof_with_windows])
def test_all_faces_look_upwards(build) -> None:
    mesh = build(BOUNDS, 0.6, 3.0, 5.0, np.random.default_rng(2))
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    assert (np.cross(b - a, c - a)[:, 2] > 0.0).all()
    assert (mesh.vertices[:, 2] == 5.0).all()


def place_model(kind: str, patches: float, seed: int = 0) -> mujoco.MjModel:
    spec = SceneSpec()
    add_place(spec, Place(kind=kind), Lights(patches=patches), stream(0, "place"), stream(seed, "lights", "patches"))
    return spec.compile()


@pytest.mark.parametrize(("kind", "casts"), [("plaza", 1), ("corridor", 1), ("street", 0)])
def test_patches_add_no_light_source_and_differ_by_seed(kind: str, casts: int) -> None:
    even, patchy, other = place_model(kind, 0.0), place_model(kind, 0.5), place_model(kind, 0.5, seed=1)
    assert even.nlight == patchy.nlight
    assert int(patchy.light_castshadow.sum()) == casts
    differ = patchy.mesh_vert.shape != other.mesh_vert.shape or (patchy.light_diffuse != other.light_diffuse).any()
    assert differ or (patchy.mesh_vert != other.mesh_vert).any()


def frame(patches: float, *, shadowless: bool = False) -> Frame:
    values = {"lights.patches": patches, "lights.shadows": True, "camera.width_px": 160, "camera.height_px": 120}
    values |= {"place.clutter": 0.0, "distractors.count": 0}
    with Simulation(scenario.load("easy/plaza-walk", values)) as simulation:
        simulation.reset(2)
        if shadowless:
            simulation.world.model.light_castshadow[:] = 0
        return simulation.advance()


def test_what_casts_the_patches_is_not_seen() -> None:
    even, patchy = frame(0.0, shadowless=True), frame(0.7, shadowless=True)
    np.testing.assert_array_equal(even.image, patchy.image)
    assert even.truth.visible_fraction == patchy.truth.visible_fraction


@pytest.mark.parametrize(("kind", "name"), [("plaza", "foliage"), ("hall", "windowed-roof")])
def test_what_casts_the_patches_is_there_with_shadows_only(kind: str, name: str) -> None:
    for shadows in (False, True):
        spec = SceneSpec()
        add_place(spec, Place(kind=kind), Lights(patches=0.5, shadows=shadows), stream(0, "place"))
        assert (spec.body(name) is not None) == shadows


@pytest.mark.slow
def test_patches_change_the_image_and_not_the_truth() -> None:
    even, patchy = frame(0.0), frame(0.7)
    assert np.abs(patchy.image.astype(float) - even.image).mean() > 3.0
    assert even.truth.visible_fraction == patchy.truth.visible_fraction
    np.testing.assert_array_equal(even.truth.visible_box, patchy.truth.visible_box)
