"""The incremental subspace against the full decomposition of the same vectors."""

from typing import Any

import numpy as np
import pytest

from pftrack_sim.trackers.features.online_feature import Subspace, residuals


def stream(kind: str, dimension: int, count: int, seed: int = 0) -> np.ndarray:
    """`(count, dimension)` vectors like those of a tracker."""
    rng = np.random.default_rng(seed)
    if kind == "random":
        return rng.standard_normal((count, dimension))
    if kind == "histograms":  # alike, summing to 1, drifting: one direction holds nearly everything
        drift = np.cumsum(0.05 * rng.standard_normal((count, dimension)), axis=0)
        raw = np.exp(rng.standard_normal(dimension) + drift)
        return raw / raw.sum(axis=1, keepdims=True)
    low = rng.standard_normal((3, dimension))  # "flat": of rank three
    return rng.standard_normal((count, 3)) @ low


def grown(seen: np.ndarray, first: int, **memory: Any) -> Subspace:
    """The subspace of the `first` vectors, after the others."""
    subspace = Subspace(seen[:first].T, **memory)
    for vector in seen[first:]:
        subspace.append(vector)
    return subspace


def sine_of_largest_angle(first: np.ndarray, second: np.ndarray) -> float:
    """Sine of the largest principal angle between two orthonormal bases, accurate for small angles."""
    assert first.shape == second.shape
    return float(np.linalg.svd(first - second @ (second.T @ first), compute_uv=False)[0])


@pytest.mark.parametrize("kind", ["random", "histograms"])
@pytest.mark.parametrize("dimension", [192, 256, 60])
def test_it_equals_the_full_decomposition_of_the_window(kind: str, dimension: int):
    """While the window slides."""
    window, seen = 40, stream(kind, dimension, 160)
    subspace = Subspace(seen[:window].T, "sliding")
    for last in range(window, len(seen)):
        u, s, _ = np.linalg.svd(seen[last - window : last].T, full_matrices=False)
        for count in (1, 5, 10, 40):
            assert sine_of_largest_angle(subspace.basis(count), u[:, :count]) < 1e-6
        assert np.allclose(subspace._s, s, rtol=0, atol=1e-10 * s[0])
        subspace.append(seen[last])


def test_it_stays_exact_over_thousands_of_frames():
    window, seen = 40, stream("histograms", 192, 3000)
    basis = grown(seen, window, memory="sliding").basis(window)
    u = np.linalg.svd(seen[-window:].T, full_matrices=False)[0]
    assert np.allclose(basis.T @ basis, np.eye(window), rtol=0, atol=1e-11)
    assert sine_of_largest_angle(basis[:, :10], u[:, :10]) < 1e-6


def test_dropped_vectors_have_no_effect():
    seen = stream("random", 50, 9)
    subspace = grown(seen, 4, memory="sliding")
    assert np.allclose(residuals(seen[5:], subspace.basis(4)), 0, rtol=0, atol=1e-12)
    assert (residuals(seen[:5], subspace.basis(4)) > 1).all()


def test_dependent_vectors_do_not_increase_the_rank():
    """Vectors of rank three, then one constant vector, as of a still target."""
    seen = stream("flat", 80, 60)
    subspace = Subspace(seen[:20].T, "sliding")
    for vector in seen[20:]:
        subspace.append(vector)
        assert subspace.basis(99).shape == (80, 3)
    for _ in range(25):
        subspace.append(seen[0])
    assert subspace.basis(99).shape == (80, 1)
    assert residuals(seen[:1], subspace.basis(1))[0] < 1e-10


def test_a_window_of_zeros_has_rank_zero():
    subspace = Subspace(np.zeros((6, 4)), "sliding")
    subspace.append(np.zeros(6))
    assert subspace.basis(3).shape == (6, 0)
    subspace.append(np.array([0.0, 2, 0, 0, 0, 0]))
    assert np.allclose(np.abs(subspace.basis(3)[:, 0]), [0, 1, 0, 0, 0, 0], rtol=0, atol=1e-12)
    assert subspace._s.tolist() == pytest.approx([2.0])


@pytest.mark.parametrize("forgetting", [1.0, 0.9])
def test_a_growing_memory_equals_the_full_decomposition_of_all_faded_vectors(forgetting: float):
    """Every vector stays, times the factor for each vector after it (eq. 6 and 7, and Ross et al. 2008)."""
    seen = stream("flat", 80, 60)
    subspace = grown(seen, 5, forgetting=forgetting)
    ages = np.minimum(np.arange(60)[::-1], 55)
    u, s, _ = np.linalg.svd((seen * forgetting ** ages[:, None]).T, full_matrices=False)
    assert sine_of_largest_angle(subspace.basis(5), u[:, :3]) < 1e-9
    assert np.allclose(subspace._s, s[:3], rtol=1e-10, atol=0)


def test_the_rank_of_a_growing_memory_is_limited():
    seen = stream("random", 50, 30)
    basis = grown(seen, 4).basis(99)
    assert basis.shape == (50, 4)
    assert np.allclose(basis.T @ basis, np.eye(4), rtol=0, atol=1e-12)


def test_residuals_match_hand_computed_values():
    basis = np.eye(4)[:, :2]
    assert residuals(np.array([[5.0, 7, 3, 4], [1, 1, 0, 0]]), basis).tolist() == [5.0, 0.0]
