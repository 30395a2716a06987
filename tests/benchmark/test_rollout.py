"""Frames of an episode reach every tracker and every sink, at their own times."""

import weakref
from pathlib import Path

import av
import pytest

from pftrack_sim import scenario
from pftrack_sim.benchmark.running.filming import save_episode
from pftrack_sim.benchmark.running.rollout import Sample, rollout, simulated
from pftrack_sim.benchmark.running.sinks import TruthLog
from pftrack_sim.benchmark.running.tracker_runner import make_runners
from pftrack_sim.simulation.simulation import Simulation
from tests.benchmark.small import SMALL

LOSSY = {**SMALL, "camera.rate_hz": 30, "duration_s": 1.5, "axes.stream.severity": 2.0}


def test_every_frame_reaches_trackers_and_sinks_until_the_end():
    samples: list[Sample] = []
    with Simulation(scenario.load("corridor", SMALL)) as simulation:
        runners = make_runners(["oracle", "stay"], seed=0)
        rollout(simulated(simulation, 0), runners, [samples.append])
        assert len(samples) == simulation.frame_count == 4
        assert [runner.statuses for runner in runners] == [["init", "ok", "ok", "ok"]] * 2
        early: list[Sample] = []
        rollout(simulated(simulation, 0, until_s=0.1), [], [early.append])
    assert [sample.time_s for sample in early] == pytest.approx([0.0, 0.1])


def test_an_episode_does_not_fill_the_memory_with_its_images():
    images: list[weakref.ref[object]] = []
    log = TruthLog()
    with Simulation(scenario.load("corridor", {**SMALL, "distractors.count": 2})) as simulation:
        rollout(simulated(simulation, 0), [], [log, lambda sample: images.append(weakref.ref(sample.image))])
        assert sum(image() is not None for image in images) <= 1, "all but that of the last frame are gone"
    assert len(images) == len(log.people) == 4


def test_a_video_shows_frames_at_their_own_times(tmp_path: Path):
    """Frames lost on the way leave gaps: the frame before stays."""
    loaded = scenario.load("corridor", LOSSY)
    samples: list[Sample] = []
    with Simulation(loaded) as simulation:
        rollout(simulated(simulation, 1), [], [samples.append])
    times = [sample.time_s for sample in samples]
    assert len(times) < 45
    save_episode(loaded, 1, video=tmp_path / "lossy.mp4")
    with av.open(str(tmp_path / "lossy.mp4")) as opened:
        shown = [frame.time for frame in opened.decode(video=0)]
    assert shown == pytest.approx(times, abs=1e-3)
