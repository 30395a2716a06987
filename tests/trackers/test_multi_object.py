"""Multi-object trackers: identities that last, and one person of theirs as a tracker."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from pftrack_sim import trackers
from pftrack_sim.core.boxes import pairwise_iou
from pftrack_sim.core.errors import ParameterError, TrackerError
from pftrack_sim.core.records import Detections, Estimate, TrackedBoxes
from pftrack_sim.trackers import FollowedPerson, MultiObjectTracker, NeedsDetections
from pftrack_sim.trackers.relatives.chau2011 import Chau2011, Chau2011Parameters

LIBRARIES = {"bytetrack": "pyxtrackers", "ocsort": "pyxtrackers", "norfair": "norfair"}
NAMES = ["chau2011", *LIBRARIES]
IMAGE = np.zeros((120, 300, 3), np.uint8)
IMAGE[:, :150] = (200, 40, 40)
COUNT = 40


def boxes_at(index: int) -> np.ndarray:
    """Two people who walk past each other in two rows, the first to the right."""
    return np.array([[10.0 + 5 * index, 10, 20, 50], [250.0 - 5 * index, 62, 20, 50]])


def detections(boxes: Any, score: float = 0.9) -> Detections:
    rows = np.asarray(boxes, dtype=np.float64).reshape(-1, 4)
    return Detections(rows, np.full(len(rows), score))


def made(name: str) -> FollowedPerson:
    if name in LIBRARIES:
        pytest.importorskip(LIBRARIES[name])
    tracker = trackers.make(name)
    assert isinstance(tracker, FollowedPerson)
    assert isinstance(tracker, NeedsDetections)
    return tracker


def follow(tracker: FollowedPerson, shown: list[Detections], box: Any) -> tuple[list[Estimate], list[TrackedBoxes]]:
    estimates, tracks = [], []
    for index, one in enumerate(shown):
        tracker.receive_detections(one)
        if index == 0:
            tracker.init(IMAGE, box)
            estimates.append(Estimate(box))
        else:
            estimates.append(tracker.update(IMAGE))
        assert tracker.tracks is not None
        tracks.append(tracker.tracks)
    return estimates, tracks


@pytest.mark.parametrize("name", NAMES)
def test_two_people_who_pass_each_other_keep_their_identities(name: str):
    shown = [detections(boxes_at(index)[:: 1 if index % 2 else -1]) for index in range(COUNT)]
    truth = np.array([boxes_at(index)[1] for index in range(COUNT)])
    late = range(COUNT // 4, COUNT)
    runs: list[np.ndarray] = []
    for _ in range(2):
        estimates, tracks = follow(made(name), shown, truth[0])
        assert {tuple(sorted(tracks[index].identities.tolist())) for index in late} == {(1, 2)}
        appeared = list(dict.fromkeys(one for frame in tracks for one in frame.identities.tolist()))
        assert appeared == [1, 2], "numbered in the order of appearance"
        runs.append(np.array([one.box for one in estimates]))
    assert min(pairwise_iou(runs[0], truth)[list(late)]) > 0.6
    assert np.array_equal(*runs)


@pytest.mark.parametrize("name", NAMES)
def test_frames_without_detections_keep_the_last_box(name: str):
    shown = [detections(boxes_at(index)) for index in range(10)] + [detections([])] * 60
    estimates, tracks = follow(made(name), shown, boxes_at(0)[0])
    assert len(tracks[-1]) == 0
    assert (estimates[-1].confidence, estimates[-1].occluded) == (0.0, True)


class Scripted:
    """Gives the tracks of a list."""

    def __init__(self, frames: list[dict[int, list[float]]]) -> None:
        self._frames = iter(frames)

    def update(self, detections: Detections, image: np.ndarray) -> TrackedBoxes:
        frame = next(self._frames)
        return TrackedBoxes(np.array(list(frame.values())).reshape(-1, 4), np.array(list(frame), dtype=np.int64))


def test_a_track_that_begins_later_and_nearby_takes_over():
    here, beside, far = [50.0, 20, 20, 50], [60.0, 20, 20, 50], [200.0, 20, 20, 50]
    frames = [{7: here, 3: beside}, {3: beside}, {3: beside, 8: far}, {3: here, 9: beside}, {9: here, 3: far}, {7: far}]
    assert isinstance(Scripted(frames), MultiObjectTracker)
    tracker = FollowedPerson(lambda: Scripted(frames))
    estimates, _ = follow(tracker, [detections([])] * len(frames), np.array(here))
    found = [(one.box.tolist(), one.confidence) for one in estimates]
    assert found == [(here, 1.0), (here, 0.0), (here, 0.0), (beside, 1.0), (here, 1.0), (here, 0.0)]


def test_a_tracker_of_detections_needs_them():
    with pytest.raises(TrackerError, match="detections"):
        trackers.make("chau2011").init(IMAGE, np.array([10.0, 10, 20, 50]))


@pytest.mark.parametrize(
    ("name", "params", "message"),
    [("chau2011", {"reach": -1}, "reach"), ("bytetrack", {"speed": 3}, "speed"), ("norfair", {"speed": 3}, "speed")],
)
def test_wrong_parameters(name: str, params: dict[str, Any], message: str):
    if name in LIBRARIES:
        pytest.importorskip(LIBRARIES[name])
    with pytest.raises(ParameterError, match=message):
        trackers.make(name, **params)


def run_chau(frames: list[Any], image: Callable[[int], np.ndarray] = lambda _: IMAGE, **params: Any) -> list[list[int]]:
    tracker = Chau2011(Chau2011Parameters(**params))
    return [tracker.update(detections(boxes), image(index)).identities.tolist() for index, boxes in enumerate(frames)]


def test_short_trajectories_are_noise_and_interrupted_ones_are_joined():
    path = [[boxes_at(index)[0]] for index in range(COUNT)]
    alarm = [[*boxes, [200.0, 60, 20, 50]] if index in (5, 6, 9) else boxes for index, boxes in enumerate(path)]
    assert run_chau(alarm) == [[1]] * COUNT
    gap = [[] if 10 <= index < 25 else boxes for index, boxes in enumerate(path)]
    assert run_chau(gap) == [[] if 10 <= index < 25 else [1] for index in range(COUNT)]
    for missing in (1, 2, 3):
        early = [[] if index == missing else boxes for index, boxes in enumerate(path)]
        assert run_chau(early) == [[] if index == missing else [1] for index in range(COUNT)]
    ended = run_chau(gap, memory_frames=5)
    assert ended[-1] == [2]
    assert ended[25] == [], "three matches are asked for"


def test_a_detection_out_of_reach_is_another_person_however_little_similarity_is_asked_for():
    frames = [[boxes_at(0)[0]], [[box + 100.0 * (axis == 0) for axis, box in enumerate(boxes_at(0)[0])]]]
    assert run_chau(frames, least_similarity=0.0, confirm_frames=1) == [[1], [2]]


@pytest.mark.parametrize("other", [(30.0, 75.0), (36.0, 28.0)])
def test_area_and_shape_tell_who_is_who(other: tuple[float, float]):
    # They change places: the nearest is the wrong one.
    first, second = [40.0, 20, 20, 50], [70.0, 20, *other]
    frames = [[first, second]] * 5 + [[[66.0, 20, 20, 50], [44.0, 20, *other]]]
    tracker = Chau2011(Chau2011Parameters(distance_weight=0.2, reach=2.0))
    last = [tracker.update(detections(boxes), IMAGE) for boxes in frames][-1]
    assert [last.box(identity)[2] for identity in (1, 2)] == pytest.approx([20.0, other[0]], abs=1.0)


def test_colour_tells_who_is_who():
    left, right = [40.0, 20, 20, 50], [70.0, 20, 20, 50]

    def painted(swapped: bool) -> np.ndarray:
        image = np.zeros((120, 300, 3), np.uint8)
        image[:, 35:65], image[:, 65:95] = ((0, 0, 250), (250, 0, 0)) if swapped else ((250, 0, 0), (0, 0, 250))
        return image

    for weight, moved in ((0.0, False), (9.0, True)):
        tracker = Chau2011(Chau2011Parameters(colour_weight=weight, reach=2.0))
        last = [tracker.update(detections([left, right]), painted(index == 5)) for index in range(6)][-1]
        assert (last.box(1)[0] > 55.0) == moved


def test_tracks_are_checked():
    for boxes, identities in [(np.zeros((2, 4)), [1, 1]), (np.zeros((1, 4)), [1, 2]), ([[np.nan] * 4], [1])]:
        with pytest.raises(ParameterError, match="tracks"):
            TrackedBoxes(np.array(boxes), np.array(identities))


class FromTheLeft:
    """Numbers people from the left."""

    def __init__(self, first: int = 1) -> None:
        self.first = first

    def update(self, found: Detections, image: Any) -> Any:
        order = np.argsort(found.boxes[:, 0])
        return TrackedBoxes(found.boxes[order], self.first + np.arange(len(order))) if self.first else [found]


def test_a_multi_object_tracker_of_ones_own_runs_by_its_class():
    tracker = trackers.make(f"mot:{__name__}:FromTheLeft", first=5)
    shown = [detections(boxes_at(index)) for index in range(3)]
    estimates, tracks = follow(tracker, shown, boxes_at(0)[1])
    assert [one.identities.tolist() for one in tracks] == [[5, 6]] * 3
    assert [one.box.tolist() for one in estimates] == [boxes_at(index)[1].tolist() for index in range(3)]
    assert trackers.code_digest(f"mot:{__name__}:FromTheLeft")


@pytest.mark.parametrize(
    ("name", "params", "words"),
    [
        ("FromTheLef", {}, "has no 'FromTheLef'; did you mean 'FromTheLeft'"),
        ("FromTheLeft", {"last": 1}, r"has no parameter 'last' \(allowed: first\)"),
        ("COUNT", {}, "is no factory, it cannot be called"),
        ("LIBRARIES.keys", {}, "must make an object with update, got dict_keys"),
        ("FromTheLeft", {"first": 0}, "must return TrackedBoxes, got list"),
    ],
)
def test_a_wrong_multi_object_tracker_is_one_clear_error(name: str, params: dict[str, Any], words: str):
    with pytest.raises((ParameterError, TrackerError), match=words):
        follow(trackers.make(f"mot:{__name__}:{name}", **params), [detections([])], boxes_at(0)[0])
