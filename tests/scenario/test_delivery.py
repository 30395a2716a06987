import itertools

import numpy as np
import pytest

from pftrack_sim import scenario
from pftrack_sim.scenario.axes import StreamAxis
from pftrack_sim.scenario.frame_delivery import arrivals

FRAMES = 60_000


def shown(seed: int = 3, **stream: float) -> np.ndarray:
    """Indices of the frames shown among the first `FRAMES`."""
    settings = {f"axes.stream.{key}": value for key, value in {"rate_hz": 1000.0, **stream}.items()}
    resolved = scenario.load("plaza-walk", {"camera.rate_hz": 30.0, **settings}).resolve(seed)
    return np.array(list(itertools.takewhile(lambda index: index < FRAMES, arrivals(resolved, seed))))


@pytest.mark.parametrize("severity", [0.5, 1.0, 2.0])
@pytest.mark.parametrize(("dropped", "burst"), [(0.1, 3.0), (0.3, 1.0), (0.2, 8.0), (0.05, 2.0)])
def test_share_and_bursts_are_those_asked_for(dropped: float, burst: float, severity: float):
    indices = shown(severity=severity, dropped_share=dropped, burst_frames=burst)
    lost = np.diff(indices) - 1
    bursts = lost[lost > 0]
    asked = severity * dropped
    assert 1.0 - len(indices) / FRAMES == pytest.approx(asked, rel=0.1)
    assert bursts.mean() == pytest.approx(max(burst, asked / (1.0 - asked)), rel=0.06)
    if burst > 1.0:  # the length of a burst is geometric: its variance follows from its mean
        assert bursts.std() == pytest.approx(np.sqrt(burst * (burst - 1.0)), rel=0.1)


@pytest.mark.parametrize(("severity", "rate_hz"), [(1.0, 20.0), (1.0, 7.0), (2.0, 20.0), (1.0, 30.0), (0.5, 10.0)])
def test_rate_is_the_one_asked_for_and_even(severity: float, rate_hz: float):
    indices = shown(severity=severity, rate_hz=rate_hz, dropped_share=0.0)
    sent_hz = min(30.0, rate_hz / severity)
    assert len(indices) / FRAMES == pytest.approx(sent_hz / 30.0, abs=1e-4)
    assert set(np.diff(indices)) <= {int(30.0 / sent_hz), int(np.ceil(30.0 / sent_hz))}


def test_the_first_frame_is_always_shown_and_no_severity_means_every_frame():
    assert all(shown(seed, severity=2.0, dropped_share=0.9)[0] == 0 for seed in range(20))
    assert (shown(severity=0.0, dropped_share=0.9, rate_hz=5.0) == np.arange(FRAMES)).all()


def test_the_schedule_depends_on_the_seed_alone():
    first, again, other = (shown(seed, severity=1.0, dropped_share=0.3) for seed in (1, 1, 2))
    assert (first == again).all()
    assert not np.array_equal(first, other)


def test_losing_everything_still_leaves_two_frames_to_show():
    settings = {"duration_s": 0.2, "axes.stream.severity": 9.0, "axes.stream.dropped_share": 0.9}
    counts = [scenario.load("plaza-walk", settings).frame_count(seed) for seed in range(20)]
    assert min(counts) == 2


def test_frames_are_counted_beforehand():
    settings = {"duration_s": 10.0, "camera.rate_hz": 30.0, "axes.stream.severity": 1.0}
    loaded = scenario.load("plaza-walk", settings)
    for seed in range(5):
        resolved = loaded.resolve(seed)
        taken = [index for index in itertools.islice(arrivals(resolved, seed), 400) if index < 300]
        assert loaded.frame_count(seed) == len(taken) < 200
    assert scenario.load(loaded, {"axes.stream.severity": 0}).frame_count(0) == 300


@pytest.mark.parametrize(("severity", "quality"), [(0.5, 80), (1.0, 60), (2.0, 20), (9.0, 3)])
def test_severity_takes_quality_away(severity: float, quality: int):
    assert StreamAxis(severity=severity, jpeg_quality=60).quality == quality
