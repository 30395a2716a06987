"""Records are frozen, all the way into their arrays, and across processes."""

import dataclasses
import pickle
from typing import Any

import numpy as np
import pytest
from observing import made_truth

from pftrack_sim.core.errors import BoxError, ParameterError
from pftrack_sim.core.records import (
    DeferredPeople,
    Detections,
    Estimate,
    State,
    TrackedBoxes,
    Tracker,
    Truth,
)
from pftrack_sim.core.text import locate_error


def truth(state: State = "visible", **changed: Any) -> Truth:
    given = {"box": [0, 0, 5, 6], "amodal_box": [-1, 0, 6, 6], "visible_box": [np.nan] * 4, "swept_box": [np.nan] * 4}
    return made_truth(state=state, **{**given, **changed})


def arrays(record: Any) -> dict[str, np.ndarray]:
    values = {one.name: getattr(record, one.name) for one in dataclasses.fields(record)}
    return {name: value for name, value in values.items() if isinstance(value, np.ndarray)}


def test_truth_is_frozen():
    box = np.array([0.0, 0, 5, 6])
    one = truth(box=box)
    box[0] = 9
    assert one.box[0] == 0
    with pytest.raises(dataclasses.FrozenInstanceError):
        one.name = "other"  # pyright: ignore[reportAttributeAccessIssue]
    assert len(arrays(one)) == 8
    for array in arrays(one).values():
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0


def test_truth_stays_frozen_in_another_process():
    one = truth()
    other = pickle.loads(pickle.dumps(one))
    assert all(not array.flags.writeable for array in arrays(other).values())
    assert all(np.array_equal(a, arrays(one)[name], equal_nan=True) for name, a in arrays(other).items())


@pytest.mark.parametrize(("state", "scored"), [("visible", True), ("occluded", False), ("out_of_view", False)])
def test_only_what_can_be_seen_is_scored(state: State, scored: bool):
    assert truth(state).scored is scored


def test_truth_checks_its_shapes():
    with pytest.raises(ParameterError, match=r"\(4, 4\), got \(3, 3\)"):
        truth(T_world_camera=np.eye(3))


def test_estimate_is_checked_and_frozen():
    one = Estimate([1, 2, 3, 4], 0.5, particles=[[0, 0, 1, 1]])  # pyright: ignore[reportArgumentType]
    for array in arrays(one).values():
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0
    with pytest.raises(BoxError, match="estimated box must be finite"):
        Estimate([1, 2, np.nan, 4])  # pyright: ignore[reportArgumentType]
    for confidence in (-0.01, 1.01, np.nan):
        with pytest.raises(ParameterError, match="confidence"):
            Estimate(np.ones(4), confidence)
    with pytest.raises(ParameterError, match=r"\(N, 4\)"):
        Estimate(np.ones(4), particles=np.ones((3, 2)))


@pytest.mark.parametrize("values", [[["1", "2", "3", "4"]], [[1, 2, 3, 4j]], np.ma.masked_less([[1.0, 2, 3, 4]], 2)])
def test_only_real_numbers_are_boxes(values: Any):
    with pytest.raises(ParameterError, match="particles must be numbers"):
        Estimate(np.ones(4), particles=values)
    with pytest.raises(ParameterError, match="boxes and scores of detections must be numbers"):
        Detections(values, np.ones(1))
    with pytest.raises(ParameterError, match="boxes of tracks must be numbers"):
        TrackedBoxes(values, np.ones(1, np.int64))


@pytest.mark.parametrize("identity", [1.5, np.nan, "1"])
def test_identities_are_whole_numbers(identity: Any):
    with pytest.raises(ParameterError, match="whole numbers"):
        TrackedBoxes(np.ones((1, 4)), np.array([identity]))


def test_anything_with_init_and_update_is_a_tracker():
    class Mine:
        def init(self, image: np.ndarray, box: np.ndarray) -> None: ...

        def update(self, image: np.ndarray) -> Estimate:
            return Estimate(np.ones(4))

    assert isinstance(Mine(), Tracker)
    assert not isinstance(object(), Tracker)


def test_others_are_found_once_and_only_when_asked_for():
    asked: list[int] = []
    everybody = tuple(truth(name=name) for name in ("target", "distractor-1", "distractor-2"))

    def others() -> tuple[Truth, ...]:
        asked.append(1)
        return everybody[1:]

    people = DeferredPeople(everybody[0], others)
    assert people[0].name == "target"
    assert not asked
    assert people[-1].name == "distractor-2"
    assert [one.name for one in people] == [one.name for one in everybody]
    assert people[1:] == everybody[1:]
    assert len(people) == 3
    assert asked == [1]
    assert people == everybody
    assert everybody == people
    assert people == DeferredPeople(everybody[0], lambda: everybody[1:])
    assert people != everybody[:2]
    copied = pickle.loads(pickle.dumps(people))
    assert isinstance(copied, tuple)
    assert copied == everybody


def test_a_deferred_record_is_found_once_and_only_when_more_than_is_known_is_read():
    asked: list[int] = []
    expected = Detections(np.array([[1.0, 2.0, 3.0, 4.0]]), np.array([0.5]))

    def find() -> Detections:
        asked.append(1)
        return expected

    found = Detections.deferred(find)
    assert found.age_s == 0.0
    assert not asked
    assert len(found) == 1
    np.testing.assert_array_equal(found.boxes, expected.boxes)
    assert found == expected
    assert expected == found
    assert asked == [1]
    assert type(pickle.loads(pickle.dumps(found))) is Detections
    with pytest.raises(AttributeError, match="no attribute 'masks'"):
        found.masks  # noqa: B018

    def find_truth() -> Truth:
        asked.append(2)
        return truth()

    target = Truth.deferred(find_truth, name="target", state="visible")
    assert target.name == "target"
    assert target.scored
    assert not hasattr(target, "masks")
    assert asked == [1]
    assert target.luminance == 0.4
    assert asked == [1, 2]
    assert target == truth()
    assert asked == [1, 2]


def test_an_error_of_a_record_is_located_in_the_line_that_made_it():
    made = "from pftrack_sim.core.records import Estimate\nEstimate([float('nan')] * 4)"
    with pytest.raises(BoxError, match="must be finite") as caught:
        exec(compile(made, "/home/me/mine.py", "exec"), {})
    assert locate_error(caught.value) == " (mine.py, line 2)"
