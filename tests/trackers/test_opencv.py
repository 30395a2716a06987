"""OpenCV's trackers: identical output for the same seed, independent of other random draws in the process."""

import ctypes
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

from pftrack_sim import trackers
from pftrack_sim.core.errors import TrackerError
from pftrack_sim.trackers.opencv import CLASSES
from tests.trackers.following import Scene


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


def test_other_random_draws_do_not_change_the_output(scene: Scene):
    images, truth = scene
    assert run(images, truth[0], 4) == run(images, truth[0], 4, disturb=True)


def test_the_number_of_threads_does_not_change_the_output(scene: Scene):
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


def test_a_too_small_image_is_refused():
    with pytest.raises(TrackerError, match="at least 32x32 pixels"):
        trackers.make("opencv-mil").init(np.zeros((20, 60, 3), np.uint8), np.array([2.0, 2, 5, 5]))


class Fake:
    """Mock of the contrib wheel's trackers: the target moves right and grows."""

    def __init__(self, *, lost: bool = False) -> None:
        self.lost = lost

    def init(self, image: np.ndarray, box: tuple[int, int, int, int]) -> None:
        assert all(type(one) is int for one in box)
        self.drawn = [int(cv2.randu(np.zeros((1, 1), np.int32), 0, 1 << 30)[0, 0])]
        self.box = box

    def update(self, image: np.ndarray) -> tuple[bool, tuple[int, int, int, int]]:
        self.drawn.append(int(cv2.randu(np.zeros((1, 1), np.int32), 0, 1 << 30)[0, 0]))
        x, y, w, h = self.box
        self.box = (x + 2, y, w + 1, h)
        return (False, (0, 0, 0, 0)) if self.lost else (True, self.box)


CONTRIB = sorted(set(CLASSES) - {"opencv-mil"})


def pretend_contrib(monkeypatch: pytest.MonkeyPatch, made: list[Fake], *, lost: bool = False) -> None:
    def create() -> Fake:
        made.append(Fake(lost=lost))
        return made[-1]

    monkeypatch.setattr(cv2, "legacy", SimpleNamespace(), raising=False)
    for kind in CLASSES.values():
        home: Any = cv2.legacy if kind.legacy else cv2  # pyright: ignore[reportAttributeAccessIssue]
        monkeypatch.setattr(home, kind.name, SimpleNamespace(create=create), raising=False)


@pytest.mark.parametrize("name", CONTRIB)
def test_a_missing_contrib_wheel_is_named(name: str, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.delattr(cv2, "legacy", raising=False)
    monkeypatch.delattr(cv2, CLASSES[name].name, raising=False)
    with pytest.raises(
        TrackerError, match=r"opencv-contrib-python-headless.* excludes opencv-python-headless"
    ) as caught:
        trackers.make(name)
    assert str(caught.value).startswith(name)
    assert "opencv-contrib-python-headless" in trackers.describe(name)


@pytest.mark.parametrize("name", CONTRIB)
def test_contrib_trackers_return_the_output_of_opencv(name: str, scene: Scene, monkeypatch: pytest.MonkeyPatch):
    images, truth = scene
    pretend_contrib(monkeypatch, [])
    tracker = trackers.make(name)
    tracker.init(images[0], truth[0] + [0.25, 0, 0.5, 0])
    wider = float(CLASSES[name].adapts_size)
    for step in (1.0, 2.0):
        estimate = tracker.update(images[1])
        assert estimate.box.tolist() == (truth[0] + [0.25 + 2 * step, 0, 0.5 + wider * step, 0]).tolist()
        assert estimate.confidence == 1.0


def test_other_random_draws_do_not_change_contrib_trackers(scene: Scene, monkeypatch: pytest.MonkeyPatch):
    images, truth = scene
    made: list[Fake] = []
    pretend_contrib(monkeypatch, made)
    for disturb in (False, True):
        tracker = trackers.make("opencv-tld", seed=3)
        for index, image in enumerate(images[:4]):
            if disturb:
                cv2.setRNGSeed(index)
            if index == 0:
                tracker.init(image, truth[0])
            else:
                tracker.update(image)
    quiet, disturbed = made
    assert quiet.drawn == disturbed.drawn
    assert len(set(quiet.drawn)) == len(quiet.drawn), "every frame must draw anew"


def test_a_lost_target_repeats_the_last_box(scene: Scene, monkeypatch: pytest.MonkeyPatch):
    images, truth = scene
    pretend_contrib(monkeypatch, [], lost=True)
    tracker = trackers.make("opencv-kcf")
    tracker.init(images[0], truth[0])
    estimate = tracker.update(images[1])
    assert estimate.box.tolist() == truth[0].tolist()
    assert estimate.confidence == 0.0
