import cv2
import numpy as np
import pytest

from pftrack_sim.core import boxes
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.score.profile import NUMBERS, ProfileMeter, ends_reached, mean_profile, recorded_quantiles

HEIGHT, WIDTH, RATE_HZ = 120, 160, 10.0
RNG = np.random.default_rng(0)
CLOTH = np.stack([RNG.integers(100, 156, (48, 24), dtype=np.uint8)] * 3, axis=2)
SCENERY = np.stack([cv2.resize(RNG.integers(0, 60, (30, 40), dtype=np.uint8), (WIDTH, HEIGHT))] * 3, axis=2)


def profile(frames):
    meter = ProfileMeter()
    for index, (image, box, visible) in enumerate(frames):
        meter.add(index / RATE_HZ, image, box, visible)
    return meter.profile()


def painted(x, y, cloth=CLOTH, scenery=SCENERY):
    image = scenery.copy()
    image[y : y + cloth.shape[0], x : x + cloth.shape[1]] = cloth
    return image, np.array([x, y, cloth.shape[1], cloth.shape[0]], dtype=float)


def test_a_target_that_moves_across_still_scenery():
    frames = [(*painted(10 + 6 * i, 20), True) for i in range(9)]
    found, size = profile(frames), np.sqrt(24 * 48)
    first = frames[0][1]
    assert found.step_median_per_s == pytest.approx(RATE_HZ * 6 / size)
    assert found.step_p95_per_s == pytest.approx(RATE_HZ * 6 / size)
    assert found.excursion_sizes == pytest.approx(48 / size)
    assert found.stay_overlap == pytest.approx(np.mean([boxes.iou(first, box) for _, box, _ in frames]))
    assert found.size_share == pytest.approx(size / np.sqrt(WIDTH * HEIGHT))
    assert (found.scale_p95_per_s, found.size_ratio, found.aspect_swing) == pytest.approx((0.0, 1.0, 1.0))
    # The box holds the same pixels in every frame.
    assert (found.ncc_to_first, found.ncc_to_previous) == pytest.approx((1.0, 1.0))
    assert (found.colour_change, found.luma_swing) == pytest.approx((0.0, 0.0), abs=1e-6)
    # Values from 100 on in the box and below 60 around it: no bin in common.
    assert found.distinct_from_surround == pytest.approx(1.0)
    grey = CLOTH[..., 0]
    assert found.sharpness == pytest.approx(cv2.Laplacian(grey, cv2.CV_64F).var())


def test_a_target_that_grows_keeps_its_appearance():
    sizes = [(24, 48), (30, 60), (36, 72), (42, 84)]
    frames = [(SCENERY, np.array([60.0 - w / 2, 60.0 - h / 2, w, h]), True) for w, h in sizes]
    found = profile(frames)
    steps = RATE_HZ * np.log([30 / 24, 36 / 30, 42 / 36])
    assert found.scale_p95_per_s == pytest.approx(np.quantile(steps, 0.95))
    assert found.size_ratio == pytest.approx(42 / 24)
    assert (found.step_median_per_s, found.excursion_sizes, found.aspect_swing) == pytest.approx((0.0, 0.0, 1.0))


def test_the_aspect_swings_by_the_ratio_of_its_quantiles():
    widths = np.linspace(20, 40, 41)
    found = profile([(SCENERY, np.array([50.0, 30.0, w, 40.0]), True) for w in widths])
    assert found.aspect_swing == pytest.approx(39 / 21)


def test_a_camera_that_turns_shifts_the_whole_image():
    wide = np.stack([cv2.resize(RNG.integers(0, 255, (30, 80), dtype=np.uint8), (2 * WIDTH, HEIGHT))] * 3, axis=2)
    frames = [(wide[:, 4 * i : 4 * i + WIDTH], np.array([60.0, 40.0, 24.0, 48.0]), True) for i in range(6)]
    found = profile(frames)
    assert (found.camera_step_median_per_s, found.camera_step_p95_per_s) == pytest.approx(
        (RATE_HZ * 4 / WIDTH,) * 2, abs=0.02
    )


def test_light_scales_the_grey_and_not_the_pattern():
    gains = [1.0, 0.25] * 3
    frames = [(*painted(40, 40, np.rint(CLOTH * gain).astype(np.uint8)), True) for gain in gains]
    found = profile(frames)
    assert found.luma_swing == pytest.approx(0.375 / 0.625, abs=0.01)
    assert found.ncc_to_first > 0.99  # Rounding to whole grey levels remains.
    assert found.colour_change == pytest.approx(0.5, abs=0.01)  # Half of the frames share no bin with the first.


def test_a_cloth_is_compared_with_that_of_three_frames_before():
    cloths = [np.roll(CLOTH, 7 * index, axis=0) for index in range(3)]
    found = profile([(*painted(40, 40, cloths[index % 3]), True) for index in range(8)])
    assert found.ncc_to_previous == pytest.approx(1.0)
    assert found.ncc_to_first < 0.6


def test_frames_without_the_target_and_steps_to_them_are_left_out():
    near, far = painted(10, 20), painted(100, 60)
    still = [(*near, True)] * 4
    hidden = [(*far, False), (SCENERY, boxes.NO_BOX, False)]
    found = profile([*still, *hidden, (*far, True)])
    assert (found.step_median_per_s, found.step_p95_per_s) == (0.0, 0.0)
    assert found.stay_overlap == pytest.approx(4 / 5)
    assert found.excursion_sizes == pytest.approx(np.hypot(90, 40) / np.sqrt(24 * 48))


def test_two_frames_have_all_numbers_but_the_likeness_to_three_frames_before():
    found = profile([(*painted(10, 20), True), (*painted(16, 20), True)])
    unknown = [name for name in NUMBERS if np.isnan(getattr(found, name))]
    assert unknown == ["ncc_to_previous"]


@pytest.mark.parametrize(
    ("box", "visible"),
    [(boxes.NO_BOX, False), (np.array([WIDTH + 5.0, 5, 20, 40]), True)],
    ids=["hidden", "beside"],
)
def test_a_target_never_seen_has_no_profile(box, visible):
    with pytest.raises(ParameterError, match="video: the target is visible in none of 2 frames"):
        profile([(SCENERY, box, visible)] * 2)


def test_the_mean_of_profiles_leaves_unknown_numbers_out():
    one = profile([(*painted(10, 20), True)] * 2)
    other = profile([(*painted(10 + 5 * i, 20), True) for i in range(5)])
    mean = mean_profile([one, other])
    assert mean.ncc_to_previous == other.ncc_to_previous
    assert mean.step_median_per_s == pytest.approx((one.step_median_per_s + other.step_median_per_s) / 2)


def test_recorded_quantiles_rise():
    for name, quantiles in recorded_quantiles().items():
        assert len(quantiles) == 5, name
        assert list(quantiles) == sorted(quantiles), name


@pytest.mark.parametrize(
    ("values", "reached"),
    [([0.018, 0.373], "both"), ([0.01, 0.1], "low"), ([0.4], "high"), ([0.02, float("nan")], "neither")],
)
def test_ends_are_reached_at_the_quantile(values, reached):
    assert ends_reached("stay_overlap", values) == reached
