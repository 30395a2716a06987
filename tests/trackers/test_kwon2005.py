"""The method of Kwon et al.: motion models, learning, occlusions, adaptive noise and velocity."""

from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
import pytest

from pftrack_sim import trackers
from pftrack_sim.core import boxes
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.records import Estimate
from pftrack_sim.trackers.filters import adaptive_velocity, fit_slopes
from pftrack_sim.trackers.papers.kwon2005 import Kwon2005, Kwon2005Parameters
from tests.trackers.following import Scene, follow, followed_boxes

MOTIONS = ["similarity", "affine"]
WIDTH, HEIGHT = 160, 120
COVERED = range(12, 22)


def make(name: str = "kwon2005", **given: Any) -> Kwon2005:
    made = trackers.make(name, **given)
    assert isinstance(made, Kwon2005)
    return made


def run(images: list[np.ndarray], box: np.ndarray, **given: Any) -> np.ndarray:
    return followed_boxes(make(**given), images, box)


def random_texture(width: int, height: int, seed: int, low: int = 20, high: int = 235, cell: int = 6) -> np.ndarray:
    """A smooth random image."""
    rng = np.random.default_rng(seed)
    small = rng.integers(low, high, (height // cell + 1, width // cell + 1, 3), dtype=np.uint8)
    return cv2.resize(small, (width, height), interpolation=cv2.INTER_CUBIC)


def warped_scene(warps: list[np.ndarray]) -> list[np.ndarray]:
    """A target of 40x50 px about the origin, warped onto a background by `(2, 3)` matrices."""
    background, target = random_texture(WIDTH, HEIGHT, 1, 60, 140), random_texture(40, 50, 2)
    images: list[np.ndarray] = []
    for warp in warps:
        # From the target's pixels, whose centres lie at half pixels, to those of the image.
        to_centre = np.array([[1, 0, 0.5 - 20], [0, 1, 0.5 - 25], [0, 0, 1.0]])
        whole = np.vstack([warp, [0, 0, 1]]) @ to_centre
        whole[:2, 2] -= 0.5
        size = (WIDTH, HEIGHT)
        there = cv2.warpAffine(target, whole[:2], size, flags=cv2.INTER_LINEAR)
        mask = cv2.warpAffine(np.full((50, 40), 255, np.uint8), whole[:2], size) > 127
        images.append(np.where(mask[..., None], there, background))
    return images


FIRST_BOX = np.array([80.0 - 20, 60 - 25, 40, 50])


@pytest.fixture(scope="module")
def covered() -> Scene:
    """A slowly moving target that is occluded in the frames `COVERED`."""
    warps = [np.array([[1, 0, 60 + 0.5 * i], [0, 1, 60.0]]) for i in range(45)]
    images = warped_scene(warps)
    thing = random_texture(70, 80, 9, 0, 255, 9)
    for index in COVERED:
        images[index][20:100, 30:100] = thing
    return images, np.array([[40 + 0.5 * i, 35, 40, 50] for i in range(45)])


@dataclass
class Seen:
    """A run, frame by frame from the first update."""

    estimates: list[Estimate] = field(default_factory=list)
    counts: list[int] = field(default_factory=list)
    spreads: list[float] = field(default_factory=list)
    models: list[list[np.ndarray]] = field(default_factory=list)


def watch(images: list[np.ndarray], box: np.ndarray, **given: Any) -> Seen:
    tracker, seen = make(particles=True, **given), Seen()
    tracker.init(images[0], box)
    for image in images[1:]:
        estimate = tracker.update(image)
        assert estimate.particles is not None
        model = tracker._model
        seen.estimates.append(estimate)
        seen.counts.append(len(estimate.particles))
        seen.spreads.append(float(np.std(estimate.particles[:, 0] + estimate.particles[:, 2] / 2)))
        seen.models.append([one.copy() for one in (model.shares, model.means, model.sigmas)])
    return seen


@pytest.mark.parametrize(
    ("rule", "false_alarms"),
    [({}, 0.2), ({"preset": "paper"}, 0.0), ({"preset": "paper", "outliers": "all"}, 0.0)],
    ids=["default", "paper", "all"],
)
def test_an_occlusion_is_detected_and_the_target_recovered(covered: Scene, rule: dict[str, Any], false_alarms: float):
    images, truth = covered
    seen = watch(images, truth[0], **rule)
    flags = np.array([one.occluded for one in seen.estimates])
    frames = np.arange(1, len(images))
    hidden = np.isin(frames, COVERED)
    assert not flags[frames < COVERED.start].any()
    assert flags[hidden].all()
    assert not flags[(frames >= COVERED.stop) & (frames <= COVERED.stop + 5)].all()
    assert flags[frames > COVERED.stop + 5].mean() <= false_alarms
    back = np.array([one.box for one in seen.estimates])[frames > COVERED.stop + 5]
    assert boxes.pairwise_iou(back, truth[1:][frames > COVERED.stop + 5]).min() > 0.7


def test_during_occlusion_the_model_is_frozen_and_noise_and_particles_are_at_maximum(covered: Scene):
    """Section 2.2: no update, R_t = R_max and J_t = J_max until the target is visible again."""
    images, truth = covered
    seen = watch(images, truth[0])
    most = make().params.particle_count_max
    flags = [one.occluded for one in seen.estimates]
    for index in range(1, len(flags)):
        same = [np.array_equal(a, b) for a, b in zip(seen.models[index], seen.models[index - 1], strict=True)]
        # Flag 10 stops update 11; what the estimate of frame t says is what step 11 of frame t did.
        assert all(same) == flags[index]
        if flags[index - 1]:
            assert seen.counts[index] == most
    assert max(seen.counts[: COVERED.start - 1]) < most
    assert seen.counts[-1] < most
    assert min(seen.spreads[index] for index in COVERED if flags[index - 1]) > 1.5 * max(
        seen.spreads[: COVERED.start - 1]
    )


def test_the_state_is_held_while_the_correlation_is_low(covered: Scene):
    images, truth = covered
    limit = 0.65
    seen = watch(images, truth[0], hold_below=limit, camera_motion=False)
    low = [one.confidence < limit for one in seen.estimates]
    assert sum(low) >= 5
    for before, now, held in zip(seen.estimates, seen.estimates[1:], low[1:], strict=False):
        assert np.array_equal(before.box, now.box) == held
        assert now.occluded or not held


def test_a_target_that_comes_back_elsewhere_is_found_by_the_widened_search():
    """The same frames with `widen=1` lose it: the distance is beyond the noise of one frame."""
    here, there = (np.array([[1.0, 0, x], [0, 1.0, 60.0]]) for x in (40.0, 112.0))
    hidden = random_texture(WIDTH, HEIGHT, 1, 60, 140)
    images = [*warped_scene([here] * 12), *[hidden] * 30, *warped_scene([there] * 20)]
    first, last = (np.array([x - 20.0, 35, 40, 50]) for x in (40.0, 112.0))
    reached = [boxes.iou(run(images, first, widen=widen)[-1], last) for widen in (1.0, 4.0)]
    assert reached[0] < 0.2
    assert reached[1] > 0.6


def test_a_covered_target_is_carried_along_by_the_camera():
    """It rests in the world, and the camera turns by more than a frame's noise."""
    world, lefts = random_texture(4 * WIDTH, HEIGHT, 5, cell=9), [100, 100, 100, 160, 160, 160]
    images = [np.ascontiguousarray(world[:, left : left + 2 * WIDTH]) for left in lefts]
    truth = np.array([[320.0 - left, 40, 24, 36] for left in lefts])
    for image, box in zip(images[2:], truth[2:], strict=True):
        left, top, width, height = box.astype(int)
        image[top - 4 : top + height + 4, left - 4 : left + width + 4] = 128
    last = follow("kwon2005", images, truth[0])[-1]
    assert last.occluded
    assert np.abs(last.box - truth[-1]).max() < 6


def test_no_occlusion_variant_never_reports_occlusion(covered: Scene):
    images, truth = covered
    seen = watch(images, truth[0], name="kwon2005-no-occlusion")
    assert not any(one.occluded for one in seen.estimates)
    for before, after in zip(seen.models, seen.models[1:], strict=False):
        assert not np.array_equal(before[1], after[1])


def test_both_trackers_are_equal_before_the_first_occlusion(covered: Scene):
    images, truth = covered
    with_flag, without = (
        run(images[: COVERED.start], truth[0], name=name) for name in ("kwon2005", "kwon2005-no-occlusion")
    )
    assert np.array_equal(with_flag, without)


@pytest.mark.parametrize("motion", MOTIONS)
def test_a_target_that_grows_and_turns_is_followed(motion: str):
    scales, angles = np.linspace(1, 1.4, 30), np.linspace(0, 0.4, 30)
    turns = [
        s * np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0]])
        for s, a in zip(scales, angles, strict=True)
    ]
    images = warped_scene([turn + np.array([[0, 0, 80], [0, 0, 60]]) for turn in turns])
    tracker = make(preset="paper", motion=motion, outliers="all")
    last = follow(tracker, images, FIRST_BOX)[-1]
    assert np.allclose(last.box[2:], 1.4 * FIRST_BOX[2:], rtol=0.05, atol=0)
    state = tracker._state
    angle = state[3] if motion == "similarity" else np.arctan2(state[4], state[2])
    assert angle == pytest.approx(0.4, abs=0.05)


def test_only_affine_motion_follows_a_change_of_aspect():
    images = warped_scene([np.array([[s, 0, 80], [0, 1, 60.0]]) for s in np.linspace(1, 1.6, 30)])
    ratios = {}
    for motion in MOTIONS:
        last = run(images, FIRST_BOX, preset="paper", motion=motion, outliers="all")[-1]
        ratios[motion] = (last[2] / last[3]) / (FIRST_BOX[2] / FIRST_BOX[3])
    assert ratios["affine"] == pytest.approx(1.6, abs=0.2)
    assert ratios["similarity"] == pytest.approx(1.0, abs=1e-9)


def test_the_velocity_follows_motion_beyond_the_noise():
    """Steps of several standard deviations of the noise need nu_t (8)."""
    images = warped_scene([np.array([[1, 0, 40 + 2.0 * i], [0, 1, 60.0]]) for i in range(35)])
    truth = np.array([[20 + 2.0 * i, 35, 40, 50] for i in range(35)])
    overlap = {}
    for velocity in (True, False):
        given = {"sigma_centre": 0.01, "noise_max": 1.0, "velocity": velocity}
        found = run(images, truth[0], name="kwon2005-no-occlusion", preset="paper", **given)
        overlap[velocity] = boxes.pairwise_iou(found, truth[1:]).mean()
    assert overlap[True] > 0.8
    assert overlap[False] < 0.5


@pytest.mark.parametrize("colour", [0, 255])
def test_a_uniform_frame_is_an_occlusion(scene: Scene, colour: int):
    images, truth = scene
    tracker = make()
    tracker.init(images[0], truth[0])
    estimate = tracker.update(np.full_like(images[0], colour))
    assert estimate.occluded
    assert estimate.confidence == 0
    assert np.isfinite(tracker.update(images[1]).box).all()


SPREAD = Kwon2005Parameters(particle_count_max=450)


@pytest.mark.parametrize(
    ("error", "factor", "count"),
    [(1.0, 1.0, 200), (2.25, 1.5, 300), (0.36, 0.6, 120), (0.0, 0.5, 100), (100.0, 2.5, 450), (6.0, 6.0**0.5, 450)],
)
def test_noise_and_particle_number_match_hand_computed_values(error: float, factor: float, count: int):
    """Eq. 9 and 11 with their limits."""
    assert SPREAD.noise_factor(error) == pytest.approx(factor)
    assert SPREAD.particle_number(SPREAD.noise_factor(error)) == count


def test_the_particle_number_is_at_least_one():
    assert Kwon2005Parameters(noise=10, noise_min=0.01, noise_max=10, particle_count=1).particle_number(0.01) == 1


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"noise_min": 1.1}, "noise_min <= noise <= noise_max, got 1.1, 1, 2.5"),
        ({"noise_max": 0.9}, "noise_min <= noise <= noise_max"),
        ({"particle_count": 600}, "particle_count <= particle_count_max, got 600, 500"),
    ],
)
def test_unordered_limits_are_refused(given: dict[str, float], words: str):
    with pytest.raises(ParameterError, match=words):
        trackers.make("kwon2005", preset="paper", **given)


UNITS = np.array([300.0, 20.0, 0.01, 0.05])


def linear_model(kind: type[np.floating], particle_count: int = 60) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A linear observation model: its matrix, particles, and their observations."""
    rng = np.random.default_rng(3)
    matrix = (rng.standard_normal((4, 90)) / UNITS[:, None]).astype(kind)
    particles = rng.standard_normal((particle_count, 4)) * UNITS
    return matrix, particles, (particles @ matrix).astype(kind)


@pytest.mark.parametrize(("kind", "digits"), [(np.float64, 1e-9), (np.float32, 1e-4)])
def test_the_velocity_of_a_linear_model_is_exact(kind: type[np.floating], digits: float):
    """Eq. 8, for components with units as different as pixels and radians."""
    matrix, particles, seen = linear_model(kind)
    fitted = fit_slopes(particles, seen)
    assert fitted.dtype == kind
    assert np.allclose(fitted * UNITS[:, None], matrix * UNITS[:, None], rtol=0, atol=10 * digits)
    moved = UNITS * [0.3, -2.0, 0.5, 1.5]
    # The target has moved: what is seen at the old state is what was there before, less the shift's effect.
    found = adaptive_velocity(fitted, (-moved @ matrix).astype(kind))
    assert np.allclose(found / UNITS, moved / UNITS, rtol=0, atol=10 * digits)


def test_zero_innovation_and_one_particle_give_zero_velocity():
    _, particles, seen = linear_model(np.float64)
    assert np.array_equal(adaptive_velocity(fit_slopes(particles, seen), np.zeros(90)), np.zeros(4))
    assert np.array_equal(adaptive_velocity(fit_slopes(np.zeros((1, 4)), np.zeros((1, 9))), np.ones(9)), np.zeros(4))


def test_unobservable_components_get_zero_velocity():
    """Components without spread, or without effect on the observation, do not disturb the others."""
    matrix, particles, _ = linear_model(np.float64)
    still = particles.copy()
    still[:, 1] = 0.0
    moved = UNITS * [0.3, 0.0, 0.5, 1.5]
    found = adaptive_velocity(fit_slopes(still, still @ matrix), -moved @ matrix)
    assert np.allclose(found / UNITS, moved / UNITS, rtol=0, atol=1e-9)
    blind = matrix.copy()
    blind[1] = 0.0
    found = adaptive_velocity(fit_slopes(particles, particles @ blind), -moved @ blind)
    assert np.allclose(found / UNITS, moved / UNITS, rtol=0, atol=1e-9)


def test_one_particle_gives_zero_velocity():
    assert np.array_equal(adaptive_velocity(fit_slopes(np.zeros((1, 4)), np.zeros((1, 9))), np.ones(9)), np.zeros(4))


def test_observation_noise_averages_out():
    matrix, particles, seen = linear_model(np.float64, 400)
    noisy = seen + 0.3 * np.random.default_rng(0).standard_normal(seen.shape)
    moved = UNITS * [0.3, -0.2, 0.5, 1.0]
    assert np.abs(adaptive_velocity(fit_slopes(particles, noisy), -moved @ matrix) / UNITS - moved / UNITS).max() < 0.05
