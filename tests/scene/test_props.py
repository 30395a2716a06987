"""Meshes of the props."""

import re

import numpy as np
import pytest

from pftrack_sim.core.data_files import assets_dir
from pftrack_sim.scene.places.buildings import house
from pftrack_sim.scene.places.catalogue import load_prop
from pftrack_sim.scene.places.materials import texture
from pftrack_sim.scene.places.meshes import TexturedMesh, box, cylinder, loft, quad, rough_ellipsoid, tufts

CATALOGUE = (assets_dir() / "props.toml").read_text(encoding="utf-8")
NAMES = re.findall(r"(?m)^([\w-]+) = \[$", CATALOGUE)


def assert_valid(mesh: TexturedMesh) -> None:
    count = len(mesh.vertices)
    assert mesh.vertices.shape == mesh.normals.shape == (count, 3)
    assert mesh.uv.shape == (count, 2)
    assert np.isfinite(mesh.vertices).all()
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, rtol=0, atol=1e-9)
    assert mesh.faces.dtype == np.int32
    assert mesh.faces.min() >= 0
    assert mesh.faces.max() < count


@pytest.mark.parametrize("name", NAMES)
def test_every_prop_of_the_catalogue_is_valid(name: str) -> None:
    section = CATALOGUE.split(f"\n{name} = [")[1].split("\n]\n")[0]
    prop = load_prop(name, **dict.fromkeys(re.findall(r'"\$(\w+)"', section), "wood-dark"))
    assert prop
    for mesh in prop:
        assert_valid(mesh)
        assert mesh.uv.min() >= 0.0
        assert mesh.uv.max() <= 1.0, "a region of an atlas does not repeat"


@pytest.mark.parametrize(
    "mesh",
    [
        box(texture("steel"), (1.0, 2.0, 3.0), (0.5, 1.0, 2.0), ("+x", "-x", "+y", "-y", "+z", "-z")),
        cylinder(texture("steel"), (0.0, 0.0, 0.0), 0.5, 2.0, 8, 0.2),
        rough_ellipsoid(texture("hedge"), (0.0, 0.0, 1.0), (0.5, 0.6, 0.7), np.random.default_rng(0), 0.0),
        loft(texture("steel"), [(-1.0, 0.0, 1.0, 0.5, 0.4), (0.0, 0.0, 1.2, 0.6, 0.4), (1.0, 0.0, 1.0, 0.5, 0.3)]),
        quad(texture("brick"), (0.0, 1.0, 0.0), (2.0, 0.0, 0.0), (0.0, 0.0, 1.0), (3, 2)),
    ],
    ids=["box", "cylinder", "ellipsoid", "loft", "quad"],
)
def test_triangles_are_wound_the_way_their_normals_point(mesh: TexturedMesh) -> None:
    assert_valid(mesh)
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    wound = np.cross(b - a, c - a)
    normal = mesh.normals[mesh.faces].mean(axis=1)
    area = np.linalg.norm(wound, axis=1)
    assert (np.einsum("ij,ij->i", wound, normal)[area > 1e-9] > 0.0).all()


def test_tiling_textures_keep_their_size_and_regions_stretch() -> None:
    edges = ((0.0, 0.0, 0.0), (3.8, 0.0, 0.0), (0.0, 0.0, 1.9))
    np.testing.assert_allclose(quad(texture("brick"), *edges).uv.max(axis=0), [2.0, 1.0], rtol=0, atol=1e-12)
    column, row = 4, 0  # "steel" in an atlas of 8 x 8 cells
    inside = quad(texture("steel"), *edges).uv * 8.0 - [column, 7 - row]
    np.testing.assert_allclose([inside.min(axis=0), inside.max(axis=0)], [[0.03] * 2, [0.97] * 2], rtol=0, atol=1e-12)


def test_tufts_of_leaves_cover_an_ellipsoid_and_face_outwards():
    centre, radii = np.array([1.0, 2.0, 5.0]), np.array([2.0, 2.0, 1.5])
    mesh = tufts(texture("leaves-dark"), centre, radii, np.random.default_rng(0), 200, 0.5)
    corners = mesh.vertices[mesh.faces]
    outwards = corners.mean(axis=1) - centre
    assert abs(np.linalg.norm(outwards / radii, axis=1) - 0.95).max() < 0.35
    assert abs(outwards.mean(axis=0) / radii).max() < 0.15
    assert (abs(corners - corners.mean(axis=1, keepdims=True)) < 0.5).all()
    faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert np.mean(np.einsum("ij,ij->i", faces, outwards) > 0.0) > 0.9
    assert np.allclose(np.linalg.norm(mesh.normals, axis=1), 1.0)
    assert (mesh.normals * np.repeat(outwards, 3, axis=0)).sum(axis=1).mean() > 1.0


def test_balconies_stand_out_of_the_upper_floors():
    plain, front = (house(np.random.default_rng(0), "brick", 0, balconies=wanted) for wanted in (False, True))
    added = np.concatenate([mesh.vertices for mesh in front[len(plain) :]])
    assert added[:, 2].min() > 3.6
    assert added[:, 1].max() <= 0.05
