"""What happens over time, by hand."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pftrack_sim.core.errors import ParameterError
from pftrack_sim.score import events


def test_recovery_is_measured_from_the_end_of_each_occlusion():
    #            0    1    2    3    4    5    6    7    8    9
    visible = [1.0, 0.3, 0.0, 1.0, 1.0, 1.0, 0.1, 1.0, 1.0, 0.0]
    overlap = [0.9, 0.6, 0.0, 0.1, 0.2, 0.7, 0.0, 0.1, 0.4, 0.0]
    first, second = events.recoveries(overlap, visible, np.arange(10) / 10.0)
    assert (first.after_s, first.observed_s) == pytest.approx((0.2, 0.3))
    assert (second.after_s, second.observed_s) == pytest.approx((math.inf, 0.2))


def test_held_through_an_occlusion_is_recovery_at_once():
    (only,) = events.recoveries([0.8] * 5, [1, 0, 0, 1, 1], np.arange(5) / 25.0)
    assert only.after_s == 0.0


@given(st.lists(st.floats(0, 1), max_size=40))
def test_occlusions_cover_exactly_the_covered_frames(visible: list[float]):
    inside = {frame for first, last in events.occlusions(visible) for frame in range(first, last + 1)}
    assert inside == {index for index, value in enumerate(visible) if value < 0.5}


def test_drift_is_the_slope_until_the_first_failure():
    rate = 25.0
    frames = np.arange(50)
    error = 0.02 + 0.3 * frames / rate
    overlap = np.where(frames < 40, 0.7, 0.0)
    scored = frames % 3 > 0
    assert events.drift_per_second(error, overlap, scored, frames / rate) == pytest.approx(0.3)
    assert math.isnan(events.drift_per_second([0.1, 0.2], [1, 1], [True, True], [0.0, 0.1]))


@pytest.mark.parametrize(
    ("overlap", "share"), [([0.9, 0.9], 0.0), ([0.1, 0.1], 1.0), ([0.9, 0.1, 0.9, 0.2, 0.3], 0.4), ([], math.nan)]
)
def test_share_permanently_lost(overlap: list[float], share: float):
    assert events.share_permanently_lost(overlap, [True] * len(overlap)) == pytest.approx(share, nan_ok=True)


def test_lengths_must_agree():
    with pytest.raises(ParameterError, match="per frame"):
        events.share_permanently_lost([0.1, 0.2], [True])
    with pytest.raises(ParameterError, match="per frame"):
        events.recoveries([0.1, 0.2], [1.0], [0.0, 0.1])


def test_times_of_irregular_frames_decide_and_not_their_number():
    frames = np.arange(60)
    visible, overlap = np.where((frames >= 10) & (frames < 20), 0.0, 1.0), np.where(frames >= 35, 0.8, 0.1)
    error = 0.02 + 0.3 * frames / 20.0
    kept = np.isin(frames, [12, 13, 14, 23, 24, 25, 26, 40], invert=True)
    every, some = frames / 20.0, frames[kept] / 20.0
    (whole,) = events.recoveries(overlap, visible, every)
    (thinned,) = events.recoveries(overlap[kept], visible[kept], some)
    assert thinned.after_s == pytest.approx(whole.after_s)
    assert thinned.observed_s == pytest.approx(whole.observed_s)
    slopes = [
        events.drift_per_second(error[keep], np.ones(keep.sum()), np.ones(keep.sum()), frames[keep] / 20.0)
        for keep in (np.ones(60, dtype=bool), kept)
    ]
    assert slopes == pytest.approx([0.3, 0.3])


def test_a_target_that_was_not_watched_long_enough_is_neither_recovered_nor_lost():
    early, late = events.Recovery(0.5, 0.6), events.Recovery(2.5, 4.0)
    unknown, never = events.Recovery(np.inf, 1.9), events.Recovery(np.inf, 2.0)
    assert events.recovered_within([early, late, unknown, never], 2.0) == pytest.approx(1.0 / 3.0)
    assert np.isnan(events.recovered_within([unknown], 2.0))
