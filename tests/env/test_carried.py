"""Things that the target carries, picks up and puts down: in the picture, and no part of the person."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import observing
import pytest

from pftrack_sim import scenario
from pftrack_sim.core.errors import ScenarioError
from pftrack_sim.scenario.people import Carried, Target, held_share
from pftrack_sim.simulation.simulation import Simulation
from pftrack_sim.simulation.world import World

RATE_HZ = 12.5
SMALL = {**observing.SMALL, **observing.ALONE, "camera.rate_hz": RATE_HZ}

ON_CRUTCHES: dict[str, Any] = {"target.uses": "crutches", "target.speed_m_s": 0.8}
PACE: dict[str, Any] = {"kind": "pace", "at_s": 1.0}


def world(**keys: Any) -> World:
    return World(scenario.load("easy/plaza-walk", {**SMALL, **keys}).resolve(3), 3, draws=False)


def place(one: World, body: str) -> np.ndarray:
    mujoco.mj_kinematics(one.model, one.data)
    return one.data.xpos[one.model.body(body).id].copy()


def tracked(one: World, item: str, seconds: float) -> tuple[np.ndarray, list[float]]:
    """`(N, 3)` positions of a thing, and its distances from the target's waist on the ground [m], frame by frame."""
    places, distances = [], []
    for _ in range(round(seconds * RATE_HZ)):
        one.advance()
        places.append(place(one, item))
        distances.append(float(np.hypot(*(places[-1] - place(one, "target/torso"))[:2])))
    return np.array(places), distances


def test_a_backpack_hides_the_back_and_changes_no_box():
    plain, packed = (
        Simulation(scenario.load("easy/plaza-walk", {**SMALL, "target.carries": carries}))
        for carries in ([], [{"item": "backpack", "colour": [200, 30, 30]}])
    )
    with plain, packed:
        before, after = plain.reset(3), packed.reset(3)
        assert (before.truth.amodal_box == after.truth.amodal_box).all()
        assert "backpack" in after.truth.occluders
        assert after.truth.visible_fraction < before.truth.visible_fraction - 0.08
        assert (before.image != after.image).any()
        assert before.truth.occluders == ()


@pytest.mark.parametrize("item", ["bag", "box"])
def test_a_thing_lies_within_reach_until_it_is_picked_up(item: str):
    one = world(
        **{
            "target.carries": [{"item": item, "from_start": False}],
            "target.actions": [{"kind": "bend", "at_s": 0.5, "picks_up": item}],
        }
    )
    places, distances = tracked(one, item, 6.0)
    gripped = round(2.5 * RATE_HZ)
    assert np.ptp(places[:gripped], axis=0).max() < 1e-9
    assert distances[gripped - 1] < 0.8
    assert max(distances[round(4.5 * RATE_HZ) :]) < 0.6
    assert places[-1][2] > (0.9 if item == "box" else 0.6)
    # Not faster than a hand.
    assert np.linalg.norm(np.diff(places, axis=0), axis=1).max() * RATE_HZ < 4.0


def test_a_bag_stays_where_it_is_put_down():
    actions = [{"kind": "crouch", "at_s": 0.5, "puts_down": "bag"}]
    places, distances = tracked(world(**{"target.carries": [{"item": "bag"}], "target.actions": actions}), "bag", 7.5)
    after = places[round(3.4 * RATE_HZ) :]
    assert np.ptp(after, axis=0).max() < 1e-9
    assert after[0, 2] == pytest.approx(0.48, abs=0.01)
    assert distances[-1] > 2.0
    # Beside its way: the target does not walk through it.
    assert min(distances) > 0.2


def test_the_hand_closes_while_the_target_is_down():
    box = Carried(item="box", from_start=False)
    actions = [{"kind": "bend", "at_s": 0.5, "picks_up": "box"}]
    target = Target.model_validate({"path_m": [[0, 0], [30, 0]], "carries": [box], "actions": actions})
    shares = [held_share(box, target.actions, time_s) for time_s in (0.0, 2.6, 2.875, 3.1, 7.5)]
    assert shares == [0.0, 0.0, pytest.approx(0.5, abs=0.15), 1.0, 1.0]


def test_everything_that_is_carried_stays_with_the_target():
    items = ["bag", "backpack", "umbrella"]
    one = world(**{"target.carries": [{"item": item} for item in items]})
    offsets = []
    for _ in range(12):
        one.advance()
        offsets.append([np.linalg.norm(place(one, item) - place(one, "target/torso")) for item in items])
    assert np.max(offsets) < 0.9
    assert np.ptp(offsets, axis=0).max() < 0.25


@pytest.mark.parametrize(
    ("carries", "actions", "message"),
    [
        ([{"item": "box"}, {"item": "bag"}], [], "more than two hands: box, bag"),
        ([{"item": "bag"}, {"item": "bag"}], [], "different items, got bag, bag"),
        ([{"item": "bag", "from_start": False}], [], "'bag' is not carried from the start"),
        ([], [{"kind": "bend", "at_s": 2.0, "picks_up": "box"}], "bend at 2 s picks up 'box': it must be in carries"),
        ([{"item": "box"}], [{"kind": "crouch", "at_s": 2.0, "picks_up": "box"}], "not carried by then"),
        ([{"item": "hat"}], [], r"target.carries.0.item: got 'hat'.*allowed: bag"),
    ],
)
def test_what_cannot_be_carried_is_an_error(carries: list[Any], actions: list[Any], message: str):
    with pytest.raises(ScenarioError, match=message):
        scenario.load("easy/plaza-walk", {"target.carries": carries, "target.actions": actions})


@pytest.mark.parametrize("seed", [1, 2])
def test_a_pedestrian_covers_an_approaching_target_when_planned(seed: int):
    keys = {
        "target.actions": [{"kind": "approach", "at_s": 3.0, "distance_m": 1.2}],
        "occluders": [{"kind": "walker", "at_s": 5.0, "duration_s": 0.6}],
    }
    observed = observing.truths("easy/plaza-walk", {**SMALL, **keys}, seed, 0.0, 7.0)
    covered = [one.time_s for one in observed if one.visible_fraction < 0.3]
    assert 4.7 < min(covered) < 5.3
    assert 5.2 < max(covered) < 6.2


@pytest.mark.parametrize("kind", ["wheelchair", "bicycle", "scooter", "pram", "crutches"])
def test_what_a_target_uses_is_drawn_and_is_no_part_of_it(kind: str):
    one = world(**{"target.uses": kind, "target.actions": [], "target.speed_m_s": 1.1})
    bodies = [one.model.body(index).name for index in range(one.model.nbody)]
    drawn = np.array([name.startswith(f"target-{kind}/") for name in bodies])[one.model.geom_bodyid]
    before = place(one, f"target-{kind}/frame")
    for _ in range(12):
        one.advance()
    assert np.hypot(*(place(one, f"target-{kind}/frame") - before)[:2]) > 0.8
    assert one.people == ("target",)
    assert drawn.sum() > 10


def test_a_wheelchair_hides_a_part_of_who_sits_in_it():
    with Simulation(scenario.load("easy/plaza-walk", {**SMALL, "target.uses": "wheelchair"})) as simulation:
        seen = simulation.reset(3)
        assert seen.truth.occluders == ("target-wheelchair",)
        assert 0.2 < seen.truth.visible_fraction < 0.9


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"target.actions": [{"kind": "bend", "at_s": 1.0}]}, "not possible with a bicycle"),
        ({"target.carries": [{"item": "umbrella"}]}, "both hands"),
        ({"target.carries": [{"item": "backpack"}, {"item": "umbrella"}]}, "both hands: carries 'umbrella'"),
        ({"target.uses": "wheelchair", "target.carries": [{"item": "backpack"}]}, "has a back where .* 'backpack'"),
        ({"target.thing": {"prop": "ball", "height_m": 0.3}}, "needs a person"),
        ({**ON_CRUTCHES, "target.speed_m_s": 1.25}, r"at most 1.1 \(0.8 is usual\), got 1.25"),
        ({**ON_CRUTCHES, "target.actions": [{**PACE, "speed_m_s": 1.6}]}, "actions.0 .pace.*got 1.6"),
        ({**ON_CRUTCHES, "target.actions": [{"kind": "bend", "at_s": 1.0}]}, "not possible with crutches"),
        ({**ON_CRUTCHES, "target.carries": [{"item": "bag"}]}, "both hands: carries 'bag'"),
        ({"target.height_m": 1.1, "target.uses": None, "target.carries": [{"item": "bag"}]}, "height_m of 1.25"),
    ],
)
def test_what_a_rider_or_a_child_cannot_do_is_an_error(keys: dict[str, Any], message: str):
    with pytest.raises(ScenarioError, match=message):
        scenario.load("easy/plaza-walk", {**SMALL, "target.uses": "bicycle", "target.actions": [], **keys}).resolve(3)
