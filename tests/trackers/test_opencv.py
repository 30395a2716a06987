"""OpenCV's tracker: the same bits for the same seed, whatever else draws random numbers in the process."""

import ctypes

import cv2
import numpy as np
import pytest

from pftrack_sim import trackers
from pftrack_sim.errors import TrackerError

Scene = tuple[list[np.ndarray], np.ndarray]


def run(images: list[np.ndarray], box: np.ndarray, seed: int, *, disturb: bool = False) -> list[list[float]]:
    tracker = trackers.make("opencv-mil", seed=seed)
    if disturb:
        cv2.setRNGSeed(99)
        ctypes.CDLL(None).srand(98)
    tracker.init(images[0], box)
    found: list[list[float]] = []
    for image in images[1:]:
        if disturb:
            cv2.randu(np.zeros((9, 9), np.uint8), 0, 255)
            ctypes.CDLL(None).rand()
            cv2.TrackerMIL.create().init(image, (5, 5, 20, 20))
        found.append(tracker.update(image).box.tolist())
    return found


def test_nobody_elses_draws_change_the_bits(scene: Scene):
    images, truth = scene
    assert run(images, truth[0], 4) == run(images, truth[0], 4, disturb=True)


def test_the_number_of_threads_does_not_change_the_bits(scene: Scene):
    images, truth = scene
    before = cv2.getNumThreads()
    try:
        found = []
        for count in (1, 2):
            cv2.setNumThreads(count)
            found.append(run(images, truth[0], 4))
    finally:
        cv2.setNumThreads(before)
    assert found[0] == found[1]


def test_seeds_differ(scene: Scene):
    rng = np.random.default_rng(0)
    images = [rng.integers(0, 255, scene[0][0].shape, dtype=np.uint8) for _ in range(6)]
    runs = [run(images, scene[1][0], seed) for seed in range(4)]
    assert any(one != runs[0] for one in runs[1:])


def test_the_size_and_the_fraction_of_a_pixel_are_kept(scene: Scene):
    images, truth = scene
    box = truth[0] + [0.3, 0.4, 0.2, 0.1]
    for found in run(images, box, 0):
        assert found[2:] == box[2:].tolist()
        assert np.allclose(np.mod(found[:2], 1), [0.3, 0.4], rtol=0, atol=1e-9) or found[:2] != box[:2].tolist()


def test_an_image_too_small_for_it_is_refused():
    with pytest.raises(TrackerError, match="at least 32x32 pixels"):
        trackers.make("opencv-mil").init(np.zeros((20, 60, 3), np.uint8), np.array([2.0, 2, 5, 5]))
