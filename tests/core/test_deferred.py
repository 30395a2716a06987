"""Records that are found when they are first read."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from pftrack_sim.core.records import DeferredPeople, Detections, Truth


def truth(name: str) -> Truth:
    box, pose = np.array([1.0, 2.0, 3.0, 4.0]), np.eye(4)
    return Truth(
        name=name, box=box, amodal_box=box, visible_box=box, swept_box=box, visible_fraction=1.0, truncation=0.0,
        state="visible", occluders=(), distance_m=3.0, T_world_camera=pose, T_world_target=pose, K=np.eye(3),
        distortion=np.zeros(5), time_s=0.0, image_motion_px=0.0, luminance=float("nan"),
    )  # fmt: skip


def test_others_are_found_once_and_only_when_asked_for():
    asked: list[int] = []
    everybody = tuple(truth(name) for name in ("target", "distractor-1", "distractor-2"))

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
        return truth("target")

    target = Truth.deferred(find_truth, name="target", state="visible")
    assert target.name == "target"
    assert target.scored
    assert not hasattr(target, "masks")
    assert asked == [1]
    assert np.isnan(target.luminance)
    assert asked == [1, 2]
    assert target == truth("target")
    assert asked == [1, 2]
