"""The kernels of people's meshes and textures against formulas on arrays: the same bits."""

from __future__ import annotations

import numpy as np
import pytest

from pftrack_sim.core.types import FloatArray
from pftrack_sim.scene.people import texture_kernels as textures
from pftrack_sim.scene.people.mesh import load_profile, lofted_mesh, superellipse_rings
from pftrack_sim.scene.people.mesh_kernels import arc_lengths, closed_rings, cloth_pixels


def rings_of(name: str, seed: int) -> FloatArray:
    """Rings of a part of the body, each point displaced a little but at its poles."""
    rings = superellipse_rings(load_profile(name), 9, power=2.2)
    wide = (np.ptp(rings, axis=1) > 1e-9).any(axis=1)
    rings[wide] += np.random.default_rng(seed).normal(0.0, 1e-3, rings[wide].shape)
    return rings


@pytest.mark.parametrize("mirror", [1.0, -1.0])
@pytest.mark.parametrize("name", ["torso", "forearm", "ear"])
def test_normals_are_means_of_the_faces_weighted_by_area(name: str, mirror: float):
    rings = rings_of(name, 1) * (1.0, mirror, 1.0)
    mesh = lofted_mesh(rings, np.zeros((rings.shape[0], rings.shape[1] + 1, 2)))
    # Coinciding points, at the seam and at poles, share one normal.
    welded = np.array([np.flatnonzero((mesh.vertices == vertex).all(axis=1))[0] for vertex in mesh.vertices])
    a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    areas = np.cross(b - a, c - a)
    assert float((a * areas).sum()) > 0.0, "the faces look outwards"
    sums = np.zeros_like(mesh.vertices)
    for corner in range(3):
        np.add.at(sums, welded[mesh.faces[:, corner]], areas)
    expected = sums[welded] / np.linalg.norm(sums[welded], axis=1, keepdims=True)
    assert np.abs(mesh.normals - expected).max() < 1e-12


def test_rings_are_closed_and_poles_found():
    rings = rings_of("torso", 2)
    rings[0] = rings[0, 0]
    vertices, poles = closed_rings(rings)
    np.testing.assert_array_equal(vertices.reshape(len(rings), -1, 3), np.concatenate([rings, rings[:, :1]], axis=1))
    np.testing.assert_array_equal(poles, np.ptp(rings, axis=1).max(axis=1) < 1e-9)


def test_cloth_pixels_are_those_of_formulas_on_arrays():
    rings = rings_of("torso", 3)
    closed = np.concatenate([rings, rings[:, :1]], axis=1)
    steps = np.sqrt((np.diff(closed, axis=1) ** 2).sum(axis=2))
    arcs = np.concatenate([np.zeros((len(rings), 1)), np.cumsum(steps, axis=1)], axis=1)
    lengths = arc_lengths(rings)
    np.testing.assert_array_equal(lengths, arcs)
    even = np.linspace(0.0, 1.0, arcs.shape[1])
    girths = arcs[:, -1:]
    shares = np.where(girths > 1e-9, arcs / np.maximum(girths, 1e-9), even)
    columns = np.clip(100.0 + (shares - shares[:, 4:5]) * 0.8 / 0.002, 1.0, 199.0)
    rows = np.clip(5.0 + (0.2 - closed[..., 2]) / 0.003, 1.0, 149.0)
    found = cloth_pixels(rings, lengths, even, (7, 11, 200, 150), 100.0, (0.8, 0.002), (5.0, 0.2, 0.003))
    np.testing.assert_array_equal(found, np.stack([7 + columns, 11 + rows], axis=-1))


@pytest.mark.parametrize("by_pixel", [False, True])
def test_cloth_is_dyed_as_by_formulas_on_arrays(by_pixel: bool):
    rng = np.random.default_rng(4)
    colours, folds = np.array([[200.0, 30.0, 90.0], [10.0, 250.0, 128.0]]), rng.normal(1.0, 0.2, (20, 33))
    rows, columns, shares = 0.5 * rng.random(20), 0.5 * rng.random(33), rng.random((20, 33))
    row_factors, column_factors = rng.random(20) + 0.5, rng.random(33) + 0.5
    spot_rows, spot_columns = rng.random(20) < 0.5, rng.random(33) < 0.5
    spot_colour = np.array([215.0, 212.0, 204.0])
    details = textures.Details(row_factors, column_factors, spot_rows, spot_columns, 0.6, spot_colour, 17)
    found = textures.dye(colours, rows, columns, shares if by_pixel else shares[:0], folds, details)
    share = (shares if by_pixel else rows[:, None] + columns)[..., None]
    image: FloatArray = (colours[0] * (1.0 - share) + colours[1] * share) * folds[..., None] * column_factors[:, None]
    image = np.where(np.outer(spot_rows, spot_columns)[..., None], (1.0 - 0.6) * image + 0.6 * spot_colour, image)
    image *= row_factors[:, None, None]
    image[17:] = colours[1]
    np.testing.assert_array_equal(found, np.clip(np.rint(image), 0, 255).astype(np.uint8))


def test_colours_are_mixed_into_an_image_as_by_formulas_on_arrays():
    rng = np.random.default_rng(5)
    image, share, colour = rng.uniform(-20.0, 280.0, (3, 12, 15)), rng.random((4, 6)), np.array([20.0, 300.0, 128.0])
    expected = image.copy()
    expected[:, 3:7, 5:11] += (colour[:, None, None] - expected[:, 3:7, 5:11]) * share
    textures.mix(image, 3, 5, share, colour)
    np.testing.assert_array_equal(image, expected)
    pixels = np.moveaxis(np.clip(expected, 0, 255).astype(np.uint8), 0, -1)
    np.testing.assert_array_equal(textures.interleaved(image), pixels)
