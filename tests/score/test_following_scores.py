import math

import numpy as np
import pytest

from pftrack_sim.core.errors import ParameterError
from pftrack_sim.scenario.model import Follow
from pftrack_sim.score.following import DrivenPath, Following, jerk_rms, losses, summarise

RATE_HZ = 10.0
TASK = Follow(distance_m=2.0, distance_limit_m=1.0, bearing_limit_deg=30.0)


def course(frames: int = 100, outcome: str = "finished", **columns) -> DrivenPath:
    filled = {
        "distance_m": np.full(frames, 2.0),
        "bearing_rad": np.zeros(frames),
        "seen": np.ones(frames, dtype=bool),
        "robot_xy_m": np.zeros((frames, 2)),
        "bystander_m": np.full(frames, np.inf),
    }
    return DrivenPath(time_s=np.arange(frames) / RATE_HZ, outcome=outcome, **{**filled, **columns})


def scores(frames: int = 100, outcome: str = "finished", **columns) -> Following:
    return summarise(course(frames, outcome, **columns), TASK, frames=100)


def test_a_perfect_course():
    score = scores()
    assert (score.success, score.tracking_rate, score.collision, score.within) == (1.0, 1.0, 0.0, 1.0)
    assert (score.distance_rms_m, score.bearing_rms_deg, score.losses) == (0.0, 0.0, 0)
    assert math.isnan(score.time_to_loss_s)
    assert math.isnan(score.time_to_find_s)


def test_three_metres_is_followed_and_more_is_not():
    far = np.full(100, 2.0)
    far[:40] = 3.01
    assert scores(distance_m=far).tracking_rate == 0.6
    far[:40] = 3.0
    assert scores(distance_m=far).tracking_rate == 1.0


def test_success_asks_for_the_last_frame():
    seen = np.ones(100, dtype=bool)
    seen[-1] = False
    assert scores(seen=seen).success == 0.0
    assert scores(seen=seen).tracking_rate == 0.99


def test_an_episode_that_ends_early_counts_its_missing_frames():
    score = scores(25, outcome="lost")
    assert (score.success, score.tracking_rate, score.length, score.within) == (0.0, 0.25, 25, 1.0)


def test_collisions_by_contact_and_by_distance():
    assert scores(50, outcome="collision").collision == 1.0
    near = np.full(100, 2.0)
    near[30] = 0.49
    score = scores(distance_m=near)
    assert (score.collision, score.success) == (1.0, 0.0)


def test_errors_are_root_mean_squares():
    score = scores(distance_m=2.0 + np.tile([0.3, -0.3], 50), bearing_rad=np.tile([0.2, -0.2], 50))
    assert math.isclose(score.distance_rms_m, 0.3, rel_tol=1e-9)
    assert math.isclose(score.bearing_rms_deg, math.degrees(0.2), rel_tol=1e-9)


def test_a_loss_is_longer_than_a_blink_and_found_is_longer_than_a_glimpse():
    seen = np.ones(100, dtype=bool)
    seen[10:14] = False  # a pillar
    seen[30:50] = False  # lost at 3 s
    seen[50:52] = True  # a glimpse
    seen[52:60] = False
    assert losses(np.arange(100) / RATE_HZ, seen) == [(3.0, 6.0)]
    score = scores(seen=seen)
    assert (score.time_to_loss_s, score.time_to_find_s, score.losses) == (3.0, 3.0, 1)
    seen[60:] = False
    ((since, until),) = losses(np.arange(100) / RATE_HZ, seen)
    assert since == 3.0
    assert math.isnan(until)


@pytest.mark.parametrize(("frames", "lost"), [(5, 0), (6, 1)])
def test_the_last_frame_of_a_drive_lasts_as_long_as_the_others(frames: int, lost: int):
    seen = np.ones(100, dtype=bool)
    seen[-frames:] = False  # 0.5 s is a blink, 0.6 s a loss
    assert scores(seen=seen).losses == lost


@pytest.mark.parametrize("jerk", [0.0, 0.7])
def test_jerk_of_a_cubic_is_its_third_derivative(jerk: float):
    times = np.arange(100) / RATE_HZ
    way = np.stack([1.0 + times + 0.2 * times**2 + jerk / 6.0 * times**3, np.zeros(100)], axis=1)
    assert abs(jerk_rms(way, times) - jerk) < 1e-6
    turned = way @ np.array([[0.6, 0.8], [-0.8, 0.6]])
    assert abs(jerk_rms(turned, times) - jerk) < 1e-6


def test_nearest_bystander_of_a_drive():
    assert math.isnan(scores().bystander_m)
    assert scores(bystander_m=np.linspace(3.0, 0.6, 100)).bystander_m == pytest.approx(0.6)


def test_too_short_for_a_jerk():
    assert math.isnan(jerk_rms(np.zeros((3, 2)), np.arange(3) / RATE_HZ))


def test_lengths_must_agree():
    with pytest.raises(ParameterError, match="one number per frame"):
        course(bearing_rad=np.zeros(3))
