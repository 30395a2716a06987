"""The detector model: perfect at severity 0, seeded, and with the misses, noise and alarms that its axis states."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from observing import made_truth

from pftrack_sim import scenario
from pftrack_sim.core.boxes import pairwise_iou
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.records import Detections, Truth
from pftrack_sim.truth.detector import DetectionModel, contrast

RATE_HZ = 30.0


def person(name: str = "target", *, box: tuple[float, ...] = (200.0, 100.0, 61.0, 150.0), **more: Any) -> Truth:
    return made_truth(name=name, box=np.array(box), **{"visible_fraction": 0.9, **more})


def model(severity: float, seed: int = 3, **parameters: float) -> DetectionModel:
    given = {f"axes.detector.{key}": value for key, value in parameters.items()}
    return DetectionModel(scenario.load("corridor", {**given, "axes.detector.severity": severity}).resolve(seed), seed)


def shown(detector: DetectionModel, *people: Truth, frames: int, image: Any = None) -> list[Detections]:
    return [detector.detect([replace(one, time_s=index / RATE_HZ) for one in people], image) for index in range(frames)]


def test_severity_zero_detects_everybody_of_whom_something_shows():
    right, left = person(), person("distractor-1", box=(20.0, 90.0, 30.0, 60.0), visible_fraction=0.01)
    hidden = person("distractor-2", state="occluded")
    for found in shown(model(0.0, latency_ms=500.0), right, left, hidden, frames=3):
        assert np.array_equal(found.boxes, [left.box, right.box])
        assert np.array_equal(found.scores, [1.0, 1.0])
        assert found.age_s == 0.0


def test_a_seed_gives_the_same_detections_whatever_was_asked_before():
    people = person(), person("distractor-1", box=(20.0, 90.0, 30.0, 70.0))
    all_frames = shown(model(1.0, latency_ms=0.0), *people, frames=80)
    late = model(1.0, latency_ms=0.0)
    for index in (75, 79):
        found = late.detect([replace(one, time_s=index / RATE_HZ) for one in people])
        assert np.array_equal(found.boxes, all_frames[index].boxes)
        assert np.array_equal(found.scores, all_frames[index].scores)
    other = shown(model(1.0, seed=4, latency_ms=0.0), *people, frames=80)
    assert not np.array_equal(other[79].boxes, all_frames[79].boxes)


@pytest.mark.parametrize(
    ("height", "visible", "missed"), [(150.0, 0.9, 0.13), (62.0, 0.9, 0.372), (150.0, 0.45, 0.505), (150.0, 0.0, 1.0)]
)
def test_misses_are_those_of_the_published_classes(height: float, visible: float, missed: float):
    # Errors that are gone after a frame, so that fewer frames are needed.
    detector = model(1.0, false_alarms=0.0, latency_ms=0.0, correlation_s=0.001)
    one = person(box=(200.0, 100.0, 0.41 * height, height), visible_fraction=visible)
    counts = [len(found) for found in shown(detector, one, frames=700)]
    assert 1.0 - np.mean(counts) == pytest.approx(missed, abs=0.05)


def test_higher_severities_miss_those_who_are_missed_at_lower_ones_and_are_less_sure():
    found = {
        severity: shown(model(severity, false_alarms=0.0, latency_ms=0.0), person(), frames=300)
        for severity in (0.0, 0.5, 1.0, 3.0)
    }
    for low, high in ((0.0, 0.5), (0.5, 1.0), (1.0, 3.0)):
        assert all(len(more) >= len(fewer) for more, fewer in zip(found[low], found[high], strict=True))
        scores = [np.mean([one.scores[0] for one in found[severity] if len(one)]) for severity in (low, high)]
        assert scores[0] > scores[1]
    assert sum(map(len, found[1.0])) > sum(map(len, found[3.0]))


def test_low_contrast_and_latency():
    flat, textured = np.full((480, 640, 3), 90, np.uint8), np.zeros((480, 640, 3), np.uint8)
    textured[:, ::2] = 255
    assert contrast(flat, person().box) == 0.0
    assert contrast(textured, np.array([0.0, 0.0, 16.0, 20.0])) == pytest.approx(0.5)
    quick = {"false_alarms": 0.0, "latency_ms": 0.0}
    assert not any(map(len, shown(model(1.0, **quick), person(), frames=50, image=flat)))
    with_image, without = (shown(model(1.0, **quick), person(), frames=50, image=one) for one in (textured, None))
    assert all(np.array_equal(one.boxes, other.boxes) for one, other in zip(with_image, without, strict=True))
    late = shown(model(1.0, **{**quick, "latency_ms": 100.0}), person(), frames=50)
    assert [len(one) for one in late[:3]] == [0, 0, 0]
    for now, before in zip(late[3:], without, strict=False):
        assert np.array_equal(now.boxes, before.boxes)
        assert now.age_s == pytest.approx(0.1), "also where nobody was found"


def test_box_noise_and_false_alarms_are_as_large_as_asked():
    detector = model(1.0, latency_ms=0.0, correlation_s=0.001, false_alarms=0.5)
    everything = shown(detector, person(), frames=700)
    # False alarms are seldom in the place of the person, and never sure.
    overlaps = [pairwise_iou(one.boxes, np.tile(person().box, (len(one), 1))) for one in everything]
    hits = np.concatenate([overlap[overlap > 0.4] for overlap in overlaps])
    assert np.mean(hits) == pytest.approx(0.79, abs=0.03)
    assert sum(int((overlap <= 0.4).sum()) for overlap in overlaps) / 700 == pytest.approx(0.5, abs=0.1)
    inside = np.concatenate([one.boxes for one in everything])
    assert (inside[:, :2] >= 0.0).all()
    assert (inside[:, :2] + inside[:, 2:] <= (640.0, 480.0)).all()


def test_errors_last_for_their_time_constant():
    def changes(correlation_s: float) -> int:
        found = shown(model(1.0, false_alarms=0.0, correlation_s=correlation_s), person(), frames=300)
        return int(np.abs(np.diff([len(one) for one in found])).sum())

    assert changes(0.01) > 3 * changes(0.5)


def test_detections_are_checked():
    for boxes, scores in [(np.zeros((2, 4)), np.ones(1)), ([[0, 0, -1, 1]], [1.0]), ([[0, 0, 1, 1]], [1.5])]:
        with pytest.raises(ParameterError, match="detections"):
            Detections(np.array(boxes), np.array(scores))
