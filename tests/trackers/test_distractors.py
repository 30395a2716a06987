"""Whether distractors are told from the target by position and size, whatever they wear."""

from collections.abc import Iterator
from dataclasses import replace

import cv2
import numpy as np
import pytest

from pftrack_sim import trackers
from pftrack_sim.core import boxes
from pftrack_sim.core.records import Frame
from pftrack_sim.scenario import load
from pftrack_sim.simulation.simulation import Simulation
from pftrack_sim.trackers.pftrack.tracker import Match, Pftrack
from pftrack_sim.trackers.recognition.colour import ColourModel
from pftrack_sim.trackers.recognition.distractors import MET, MISSED, OCCLUDED, Association, Distractors
from pftrack_sim.trackers.recognition.person import PROBABLY, SURELY, UNLIKE, UNSURE, KnownPerson, PersonView, look
from pftrack_sim.trackers.recognition.pyramid import ImagePyramid
from pftrack_sim.trackers.recognition.search import Place, Reach, search
from tests.trackers.following import follow
from tests.trackers.test_person import known_in

Seen = tuple[Frame, np.ndarray, Distractors]
SIZE = {"camera.width_px": 320, "camera.height_px": 240, "camera.rate_hz": 2}
STILL = np.zeros(2)


def place(box: np.ndarray) -> Place:
    return Place(1.0, box[2:], boxes.centre(box))


def beside(frame: Frame) -> list[np.ndarray]:
    """Boxes of other people who stand apart beside the target."""
    target = frame.truth.amodal_box
    return [
        one.amodal_box
        for one in frame.people
        if one.name != frame.truth.name
        and one.visible_fraction > 0.9
        and one.truncation == 0.0
        and one.amodal_box[3] > 0.6 * target[3]
        and boxes.iou(one.amodal_box, target) < 0.05
        and abs(boxes.centre(one.amodal_box)[0] - boxes.centre(target)[0]) < 1.3 * target[3]
    ]


@pytest.fixture(scope="module")
def seen() -> Iterator[Seen]:
    """A frame, the box of a distractor in it, and those who are tracked."""
    simulation = Simulation(load("follow/plaza", SIZE))
    frame = simulation.reset(3)
    while not beside(frame):
        frame = simulation.advance()
    yield frame, beside(frame)[0], tracked(frame)
    simulation.close()


def seen_from(
    distractors: Distractors, pyramid: ImagePyramid, box: np.ndarray, predicted: np.ndarray | None = None
) -> Association:
    at, reach = place(box), place(box if predicted is None else predicted)
    view = look(pyramid, at.centre, at.size)
    return distractors.associate(pyramid, STILL, at, view, Reach(reach.centre, reach.size, 0))


def tracked(frame: Frame, *, sure: bool = True) -> Distractors:
    """Those who are tracked after the same frame has been seen four times."""
    pyramid, target = ImagePyramid(frame.image), frame.truth.amodal_box
    distractors = Distractors(known_in(frame))
    for _ in range(4):
        seen_from(distractors, pyramid, target)
        distractors.update(place(target), sure=sure)
    seen_from(distractors, pyramid, target)
    return distractors


def test_who_is_beside_the_target_is_tracked_and_the_target_is_not(seen: Seen):
    frame, other, distractors = seen
    assert distractors.are_at(place(other))
    assert not distractors.are_at(place(frame.truth.amodal_box))


def test_only_a_person_where_the_target_is_predicted_is_in_its_gate(seen: Seen):
    frame, other, _ = seen
    distractors, pyramid, target = tracked(frame), ImagePyramid(frame.image), place(frame.truth.amodal_box)
    assert seen_from(distractors, pyramid, target.box).in_gate
    assert not seen_from(distractors, pyramid, target.box, predicted=other).in_gate
    assert seen_from(distractors, pyramid, target.box, predicted=other).in_front
    assert not seen_from(distractors, pyramid, target.box).in_front
    # Who stands there is more like the distractor.
    assert not seen_from(distractors, pyramid, other).in_gate


def test_an_occluded_target_keeps_its_size_whatever_its_occluders(seen: Seen):
    """The robot that approaches both comes nearer to the occluder."""
    frame, other, _ = seen
    distractors, occluder, image = tracked(frame), place(other), frame.image.copy()
    x, y, width, height = frame.truth.amodal_box.round().astype(int)
    image[y : y + height, x : x + width] = image.mean(axis=(0, 1))
    pyramid = ImagePyramid(image)
    view = look(pyramid, occluder.centre, occluder.size)
    target = Reach(occluder.centre + 0.3 * occluder.size[1], 0.8 * occluder.size, 0)
    behind = distractors.associate(pyramid, STILL, occluder, view, target).place
    assert behind.likeness == 0.0
    assert np.array_equal(behind.size, target.size)
    assert behind.centre[1] == target.centre[1]


def test_who_is_hidden_behind_the_target_is_not_looked_for(seen: Seen, monkeypatch: pytest.MonkeyPatch):
    """A detection there would be the target, and the distractor's track would take it."""
    frame, other, _ = seen
    tracks, pyramid, target = tracked(frame), ImagePyramid(frame.image), place(frame.truth.amodal_box)
    assert other[3] < 0.8 * target.size[1]
    looked: list[Place] = []

    def look_for(known: KnownPerson, image: ImagePyramid, at: Place, looks: int = 2) -> None:
        looked.append(at)

    monkeypatch.setattr("pftrack_sim.trackers.recognition.distractors.person_at", look_for)
    view, reach = look(pyramid, target.centre, target.size), Reach(target.centre, target.size, 0)
    tracks.associate(pyramid, target.centre - boxes.centre(other), target, view, reach)
    assert not looked
    tracks.associate(pyramid, boxes.centre(other) - target.centre, target, view, reach)
    assert [boxes.iou(one.box, other) > 0.7 for one in looked] == [True], "beside the target again"


def with_target_at(frame: Frame, other: np.ndarray, *, exchanged: bool) -> ImagePyramid:
    """The image with the target where another person was, who is gone or, exchanged with it, where the target was."""
    image, places = frame.image.copy(), [one.round().astype(int) for one in (other, frame.truth.amodal_box)]
    patches = [frame.image[y : y + height, x : x + width] for x, y, width, height in places]
    for (x, y, width, height), patch in zip(places[: 1 + exchanged], reversed(patches), strict=False):
        image[y : y + height, x : x + width] = cv2.resize(patch, (width, height), interpolation=cv2.INTER_AREA)
    return ImagePyramid(image)


def test_a_track_that_goes_over_to_the_target_does_not_hide_it(seen: Seen):
    frame, other, _ = seen
    distractors, target, at = tracked(frame), frame.truth.amodal_box, place(other)
    assert distractors.are_at(at)
    image = with_target_at(frame, other, exchanged=False)
    for _ in range(30):
        distractors.update(place(target), sure=False)
        seen_from(distractors, image, target)
        assert not distractors.are_at(at)


def test_a_box_and_a_track_that_were_exchanged_are_told_by_their_looks(seen: Seen):
    frame, other, _ = seen
    distractors, target = tracked(frame), frame.truth.amodal_box
    image = with_target_at(frame, other, exchanged=True)
    first, second = (seen_from(distractors, image, target).place for _ in range(2))
    assert boxes.iou(first.box, target) > 0.5, "one frame is no evidence"
    assert boxes.iou(second.box, other) > 0.5
    assert second.likeness >= UNSURE


def test_who_was_beside_the_target_is_remembered_when_the_track_ends(seen: Seen):
    frame, other, _ = seen
    pyramid, target, at = ImagePyramid(frame.image), frame.truth.amodal_box, place(other)
    person = known_in(frame)
    distractors = Distractors(person)
    gone = frame.image.copy()
    x, y, width, height = other.round().astype(int)
    gone[y - 4 : y + height + 4, max(x - 4, 0) : x + width + 4] = gone.mean(axis=(0, 1))
    view = person.describe(pyramid, at.centre, at.size)
    own = person.describe(pyramid, boxes.centre(target), target[2:])
    for image, frames in ((pyramid, 4 + MET), (ImagePyramid(gone), MISSED + 2)):
        assert not person.is_other(view, SURELY)
        for _ in range(frames):
            seen_from(distractors, image, target)
            distractors.update(place(target), sure=True)
    assert person.is_other(view, SURELY)
    assert person.likeness(view) <= UNLIKE
    assert view.parts is not None
    assert person.likeness(view._replace(parts=np.zeros_like(view.parts))) < UNLIKE
    assert not person.is_other(own, PROBABLY)
    places = search(frame.image, pyramid, person, ColourModel(), Reach(at.centre, at.size, 0), 0)
    assert not any(boxes.iou(one.box, other) > 0.5 for one in places)


def test_nobody_is_tracked_while_the_target_is_not_sure(seen: Seen):
    frame, other, _ = seen
    assert not tracked(frame, sure=False).are_at(place(other))


def with_twin(image: np.ndarray, box: np.ndarray, zoom: float, right: float) -> tuple[np.ndarray, list[float]]:
    """An image with a copy of the target, `zoom` times as large, `right` of it in its heights; and the copy's box."""
    x, y, width, height = box.round().astype(int)
    target = image[y : y + height, x : x + width]
    twin = cv2.resize(target, None, fx=zoom, fy=zoom, interpolation=cv2.INTER_LINEAR)
    rows, columns = twin.shape[:2]
    top = y + round((0.78 + 0.25 * zoom) * height) - rows
    left = round(x + 0.5 * width + right * height - 0.5 * columns)
    inside = slice(max(left, 0), left + columns)
    drawn = image.copy()
    drawn[max(top, 0) : top + rows, inside] = twin[max(-top, 0) :, inside.start - left :][
        : image.shape[0] - max(top, 0), : image.shape[1] - inside.start
    ]
    return drawn, [left, top, columns, rows]


def twin_walks_by(frame: Frame, zoom: float = 1.35, frames: int = 70) -> tuple[list[np.ndarray], np.ndarray]:
    """Images in which a copy of the target, a third larger, walks by in front of it, and `(N, 4)` boxes of the copy."""
    box = frame.truth.amodal_box
    path = [1.35] * 12 + np.linspace(1.35, -1.35, frames).tolist()
    drawn = [with_twin(frame.image, box, zoom, right) for right in path]
    return [image for image, _ in drawn], np.array([place for _, place in drawn], dtype=np.float64)


def inside(box: np.ndarray, other: np.ndarray) -> float:
    """Share of a box that lies in another."""
    overlap = np.minimum(box[:2] + box[2:], other[:2] + other[2:]) - np.maximum(box[:2], other[:2])
    return float(np.prod(np.maximum(overlap, 0.0)) / np.prod(box[2:]))


def first_in_full_view(seed: int) -> Frame:
    simulation = Simulation(load("follow/plaza", SIZE))
    frame = simulation.reset(seed)
    while frame.truth.visible_fraction < 0.97 or not 90 < frame.truth.amodal_box[3] < 150:
        frame = simulation.advance()
    simulation.close()
    return frame


def test_a_person_in_view_is_not_left_for_what_the_filter_finds_elsewhere(monkeypatch: pytest.MonkeyPatch):
    """As it does in somebody who passes near the camera."""
    frame = first_in_full_view(3)
    box, image = frame.truth.amodal_box, frame.image
    tracker = trackers.make("pftrack", seed=0)
    tracker.init(image, box)
    for _ in range(4):
        tracker.update(image)
    found = Pftrack._search

    def elsewhere(self: Pftrack, *given: object) -> Match:
        return found(self, *given)._replace(centre=np.array([0.0, 120.0]))

    monkeypatch.setattr(Pftrack, "_search", elsewhere)
    for _ in range(10):
        estimate = tracker.update(image)
        assert boxes.iou(estimate.box, box) > 0.5
        assert estimate.confidence > 0.5


def test_whoever_walks_into_shade_is_followed_without_a_break_and_learnt():
    frame = first_in_full_view(3)
    shade = (frame.image * np.array([0.5, 0.4, 0.3])).astype(np.uint8)
    estimates = follow("pftrack", [frame.image] * 12 + [shade] * 60, frame.truth.amodal_box)
    assert min(one.confidence for one in estimates) > 0.6
    assert estimates[-1].confidence > 0.95
    assert boxes.iou(estimates[-1].box, frame.truth.amodal_box) > 0.8


def test_the_tallest_are_tracked_first():
    """The others are behind the target, or nobody."""
    frame = first_in_full_view(3)
    box = frame.truth.amodal_box
    image = frame.image
    for right in (0.5, 0.85, 1.2):
        image, _ = with_twin(image, box, 0.7, right)
    distractors = Distractors(known_in(replace(frame, image=image)))
    with_tall, tall = with_twin(image, box, 1.35, -1.1)
    for seen in [image] * 4 + [with_tall] * 5:
        seen_from(distractors, ImagePyramid(seen), box)
        distractors.update(place(box), sure=True)
        if seen is image:
            assert not distractors.are_at(place(np.array(tall)))
    seen_from(distractors, ImagePyramid(with_tall), box)
    assert distractors.are_at(place(np.array(tall)))


def test_a_twin_keeps_its_track_while_it_walks_by():
    frame = first_in_full_view(3)
    box = frame.truth.amodal_box
    images, twin = twin_walks_by(frame)
    distractors = Distractors(known_in(replace(frame, image=images[0])))
    for image, other in zip(images, twin, strict=True):
        seen_from(distractors, ImagePyramid(image), box)
        if boxes.iou(other, box) > 0.3:
            assert distractors.are_at(place(other))
        distractors.update(place(box), sure=True)


@pytest.mark.parametrize("right", [-0.9, 0.9])
def test_a_person_twice_as_tall_is_tracked(right: float):
    """They are much nearer to the camera, and may come to occlude the target."""
    frame = first_in_full_view(8)
    box = frame.truth.amodal_box
    image, twin = with_twin(frame.image, box, 1.9, right)
    assert tracked(replace(frame, image=image)).are_at(place(np.array(twin)))


@pytest.mark.parametrize(("height", "kept"), [(1.2, True), (1.0, False)])
def test_only_a_distractor_in_front_keeps_its_track_where_the_target_is_detected(
    height: float, kept: bool, monkeypatch: pytest.MonkeyPatch
):
    """One that is no taller than the target is occluded by it, and the detection is the target's."""
    frame = first_in_full_view(3)
    target = place(frame.truth.amodal_box)
    pyramid, side = ImagePyramid(frame.image), np.array([target.size[1], 0.0])
    view = look(pyramid, target.centre, target.size)
    distractor = Place(1.0, height * target.size, target.centre + side)

    def person_at(known: KnownPerson, image: ImagePyramid, at: Place, looks: int = 2) -> tuple[Place, PersonView]:
        return distractor, view

    monkeypatch.setattr("pftrack_sim.trackers.recognition.distractors.person_at", person_at)
    distractors = Distractors(known_in(frame))
    for _ in range(4):
        seen_from(distractors, pyramid, target.box)
        distractors.update(target, sure=True)
    # It is detected in the target's box, not quite where it was predicted: the box fits the target better.
    distractor = distractor._replace(centre=target.centre)
    reach = Reach(target.centre, target.size, 0)
    association = distractors.associate(pyramid, -0.7 * side, target, view, reach)
    assert association.place is target
    assert distractors.are_at(distractor) is kept


def test_a_person_who_is_occluded_in_the_shade_is_followed_on():
    frame = first_in_full_view(3)
    box = frame.truth.amodal_box
    images, _ = twin_walks_by(frame)
    shade = [(image * np.array([0.5, 0.4, 0.3])).astype(np.uint8) for image in images]
    estimates = follow("pftrack", [frame.image] * 12 + shade, box)
    assert min(boxes.iou(one.box, box) for one in estimates[-20:]) > 0.5
    assert min(one.confidence for one in estimates[-10:]) > 0.5


@pytest.mark.parametrize(("seed", "frames"), [(3, 24), (5, 24), (5, 40)])
def test_a_person_who_comes_into_shade_while_occluded_is_followed_on(seed: int, frames: int):
    """Unlike what was learnt, they are where they were predicted to be behind their occluder.

    Neither they nor the occluder are detected in every frame.
    """
    frame = first_in_full_view(seed)
    box = frame.truth.amodal_box
    images, twin = twin_walks_by(frame, frames=frames)
    since = [inside(box, one) > 0.5 for one in twin].index(True)
    shade = [(image * np.array([0.7, 0.6, 0.5])).astype(np.uint8) for image in [*images[since:], *[frame.image] * 25]]
    estimates = follow("pftrack", images[:since] + shade, box)
    assert min(boxes.iou(one.box, box) for one in estimates[-20:]) > 0.5
    assert min(one.confidence for one in estimates[-20:]) > 0.5


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "given"), [("pftrack", {}), ("ko2012", {"recognition": "search"}), ("ncc", {"recognition": "search"})]
)
@pytest.mark.parametrize(("seed", "zoom"), [(3, 1.35), (5, 1.35), (3, 1.9)])
def test_a_twin_who_walks_by_in_front_is_not_taken_for_the_target(
    name: str, given: dict[str, str], seed: int, zoom: float
):
    frame = first_in_full_view(seed)
    box = frame.truth.amodal_box
    images, twin = twin_walks_by(frame, zoom)
    estimates = follow(name, images, box, **given)
    behind = [inside(box, one) > 0.8 for one in twin[1:]]
    assert any(behind)
    assert max(one.confidence for one, hidden in zip(estimates, behind, strict=True) if hidden) <= OCCLUDED
    assert min(boxes.iou(one.box, box) for one in estimates[-20:]) > 0.5


@pytest.mark.parametrize("right", [0.8, -0.8])
def test_who_comes_beside_an_occluded_target_is_not_taken_for_it(right: float):
    """The target cannot have walked so far meanwhile."""
    frame = first_in_full_view(3)
    box = frame.truth.amodal_box
    images, twin = twin_walks_by(frame)
    hidden = [inside(box, one) > 0.5 for one in twin]
    crowded = replace(frame, image=with_twin(frame.image, box, 1.0, right)[0])
    since = hidden.index(True)
    estimates = follow("pftrack", images[:since] + twin_walks_by(crowded)[0][since:], box)
    assert min(boxes.iou(one.box, box) for one in estimates[-10:]) > 0.5
