"""The method of Kwon, Kim & Lim: its parts do what the equations say."""

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import pytest

from pftrack_sim import boxes, trackers
from pftrack_sim.records import Estimate
from pftrack_sim.trackers.kwon2005 import PAPER, Kwon2005

Scene = tuple[list[np.ndarray], np.ndarray]
NAMES = ["kwon2005", "kwon2005-no-occlusion"]


def follow(tracker: Any, images: list[np.ndarray], box: np.ndarray) -> list[Estimate]:
    tracker.init(images[0], box)
    return [tracker.update(image) for image in images[1:]]


def covered_scene(make_scene: Callable[..., Scene], first: int = 12, last: int = 18) -> Scene:
    """The target stands still; something grey and rough covers it from `first` to `last`."""
    images, truth = make_scene(count=40, step_px=0.0)
    rough = np.random.default_rng(0).integers(0, 255, (40, 30, 1), dtype=np.uint8)
    x, y = (int(value) for value in truth[0, :2])
    changed = []
    for index, image in enumerate(images):
        own = image.copy()
        if first <= index <= last:
            own[y - 4 : y + 36, x - 5 : x + 25] = rough
        changed.append(own)
    return changed, truth


def test_paper_preset_holds_the_printed_values():
    assert (PAPER.outlier_c, PAPER.occlusion_share, PAPER.velocity) == (1.3, 0.2, True)


@pytest.mark.parametrize("motion", ["similarity", "affine"])
@pytest.mark.parametrize("name", NAMES)
def test_a_moving_target_is_followed(make_scene: Callable[..., Scene], name: str, motion: str):
    images, truth = make_scene(count=40, step_px=1.5, width=160)
    found = [one.box for one in follow(trackers.make(name, motion=motion), images, truth[0])]
    assert boxes.pairwise_iou(np.array(found), truth[1:]).mean() > 0.7


@pytest.mark.parametrize("preset", trackers.PRESETS)
@pytest.mark.parametrize("name", NAMES)
def test_same_seed_same_bits_and_init_forgets(make_scene: Callable[..., Scene], name: str, preset: str):
    images, truth = covered_scene(make_scene)
    tracker = trackers.make(name, seed=4, preset=preset)
    first = [(*one.box, one.confidence, one.occluded) for one in follow(tracker, images, truth[0])]
    assert [(*one.box, one.confidence, one.occluded) for one in follow(tracker, images, truth[0])] == first
    other = follow(trackers.make(name, seed=5, preset=preset), images, truth[0])
    assert [(*one.box, one.confidence, one.occluded) for one in other] != first


def test_the_flag_rises_while_the_target_is_covered_and_falls_when_it_is_back(make_scene: Callable[..., Scene]):
    images, truth = covered_scene(make_scene)
    said = follow(trackers.make("kwon2005"), images, truth[0])
    flags = [one.occluded for one in said]
    assert not any(flags[:11])
    assert all(flags[11:18])
    assert not any(flags[22:])
    assert boxes.pairwise_iou(np.array([one.box for one in said[22:]]), truth[23:]).mean() > 0.7


def test_without_the_flag_nothing_is_ever_held_to_be_covered(make_scene: Callable[..., Scene]):
    images, truth = covered_scene(make_scene)
    assert not any(one.occluded for one in follow(trackers.make("kwon2005-no-occlusion"), images, truth[0]))


def test_while_covered_the_model_is_frozen_and_the_filter_open(make_scene: Callable[..., Scene]):
    images, truth = covered_scene(make_scene)
    tracker = trackers.make("kwon2005", particles=True)
    assert isinstance(tracker, Kwon2005)
    tracker.init(images[0], truth[0])
    frozen: list[bytes] = []
    counts: list[int] = []
    spreads: list[float] = []
    for image in images[1:]:
        said = tracker.update(image)
        model = tracker._model
        assert said.particles is not None
        if said.occluded:
            frozen.append(b"".join(part.tobytes() for part in (model.means, model.sigmas, model.shares)))
        counts.append(len(said.particles))
        spreads.append(float(said.particles[:, 0].std()))
    assert len(set(frozen)) == 1
    assert max(counts) == tracker.params.particle_count_max
    # The frame after the flag rose is the first that is searched widely.
    assert np.mean(spreads[12:17]) > 1.5 * np.mean(spreads[3:10])


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("name", NAMES)
def test_twice_the_image_gives_twice_the_estimate(make_scene: Callable[..., Scene], name: str, seed: int):
    images, truth = make_scene(count=25)
    doubled = [cv2.resize(image, None, fx=2, fy=2, interpolation=cv2.INTER_NEAREST) for image in images]
    small, large = (
        np.array([one.box for one in follow(trackers.make(name, seed=seed), seen, start)])
        for seen, start in ((images, truth[0]), (doubled, 2 * truth[0]))
    )
    assert np.abs(large - 2 * small).max() <= 2


@pytest.mark.parametrize("box", [[10.0, 10.0, 2.0, 2.0], [-8.0, 20.0, 20.0, 32.0], [100.0, 70.0, 60.0, 60.0]])
def test_small_boxes_and_boxes_across_the_edge(scene: Scene, box: list[float]):
    images, _ = scene
    for said in follow(trackers.make("kwon2005"), images, np.array(box)):
        assert np.isfinite(said.box).all()
        assert 0.0 <= said.confidence <= 1.0


def test_confidence_is_the_likeness_to_what_is_expected(make_scene: Callable[..., Scene]):
    images, truth = covered_scene(make_scene)
    said = follow(trackers.make("kwon2005"), images, truth[0])
    assert min(one.confidence for one in said[2:11]) > 0.9
    assert max(one.confidence for one in said[12:17]) < 0.6
