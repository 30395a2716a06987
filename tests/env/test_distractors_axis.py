"""The distractors axis: number, times, distances and similarity of oncoming pedestrians."""

from typing import Any

import numpy as np
import pytest
from observing import ALONE, PLACES, SMALL, on_axis

from pftrack_sim import scenario
from pftrack_sim.core.records import Frame
from pftrack_sim.scenario.axes import DistractorsAxis
from pftrack_sim.simulation.simulation import Simulation
from pftrack_sim.simulation.world import World

BASE: dict[str, Any] = {"lights.shadows": False}


def walk(name: str, until_s: float, seed: int = 3, **axis: Any) -> tuple[tuple[str, ...], np.ndarray]:
    """Names, and `(T, P, 2)` positions of all pedestrians at 30 Hz."""
    world = World(scenario.load(name, BASE | on_axis("distractors", **axis)).resolve(seed), seed, draws=False)
    places = [world.root_poses()[:, :2, 3]]
    for _ in range(round(until_s * 30.0)):
        world.advance()
        places.append(world.root_poses()[:, :2, 3])
    return world.people, np.array(places)


@pytest.mark.parametrize("name", PLACES)
@pytest.mark.parametrize("distance_m", [0.6, 1.1])
def test_oncoming_pedestrians_pass_at_the_requested_time_and_distance(name: str, distance_m: float):
    axis = DistractorsAxis(severity=1.0, where="beside", count=2, at_s=2.5, every_s=2.5, distance_m=distance_m)
    names, places = walk(name, 6.0, **axis.model_dump())
    passers = [index for index, person in enumerate(names) if person.startswith("passer")]
    assert len(passers) == 2
    for person, at_s in zip(passers, axis.passings_s, strict=True):
        apart = np.hypot(*(places[:, person] - places[:, 0]).T)
        assert apart.min() == pytest.approx(distance_m, abs=0.15)
        assert apart.argmin() / 30.0 == pytest.approx(at_s, abs=0.25)


def test_oncoming_pedestrians_are_visible_as_they_pass():
    overrides = SMALL | ALONE | on_axis("distractors", count=1, where="beside", at_s=2.0)
    for name in PLACES:
        with Simulation(scenario.load(name, overrides), image=False) as simulation:
            simulation.reset(3)
            for _ in range(59):
                simulation.world.advance()
            people = {one.name: one for one in simulation.advance().people}
        assert people["passer-1"].visible_fraction > 0.3
        assert people["target"].visible_fraction > 0.7


@pytest.mark.parametrize("side", ["left", "right"])
def test_pedestrians_pass_on_the_far_side_of_a_target_seen_from_the_side(side: str):
    route = {"kind": "beside", "distance_m": 3.0, "side": side}
    axis = on_axis("distractors", where="beside", count=2, at_s=3.0)
    for seed in range(3):
        loaded = scenario.load("easy/plaza-walk", {**BASE, **axis, **ALONE, "robot.route": route})
        world = World(loaded.resolve(seed), seed, draws=False)
        passers = [index for index, person in enumerate(world.people) if person.startswith("passer")]
        for _ in range(90):
            world.advance()
        people, camera = world.root_poses()[:, :2, 3], world.camera_pose()[:2, 3]
        sight = people[0] - camera
        beyond = (people[passers[0]] - people[0]) @ sight / np.linalg.norm(sight)
        assert beyond > 0.4


def test_severity_scales_the_number_of_pedestrians():
    for severity, across, beside in ((0.0, 0, 0), (0.25, 1, 0), (0.5, 1, 0), (1.0, 1, 1), (4.0, 4, 4)):
        axis = DistractorsAxis(severity=severity)
        assert (len(axis.crossings_s), len(axis.passings_s)) == (across, beside)


@pytest.mark.parametrize("name", ["easy/plaza-walk", "easy/corridor"])
def test_look_alikes_cross_the_line_of_sight_and_walk_on(name: str):
    axis = on_axis("distractors", where="across", count=1, at_s=2.5)
    with Simulation(scenario.load(name, SMALL | ALONE | axis), image=False) as simulation:
        simulation.reset(3)
        for _ in range(60):
            simulation.world.advance()
        people = [{one.name: one for one in simulation.advance().people} for _ in range(90)]
        apart = np.ptp([one[:2] for one in simulation.world.root_poses()[:2, :3, 3]], axis=0)
    assert {one["target"].occluders[:1] for one in people if one["target"].visible_fraction < 0.3} == {("crosser-1",)}
    hidden = [one["target"].time_s for one in people if one["target"].visible_fraction < 0.5]
    assert np.median(hidden) == pytest.approx(2.5, abs=0.15)
    assert np.ptp(hidden) == pytest.approx(0.4, abs=0.2)
    assert np.hypot(*apart) > 1.5


def histogram(image: np.ndarray) -> np.ndarray:
    """Joint RGB histogram, of sum 1."""
    counts, _ = np.histogramdd(image.reshape(-1, 3), bins=(6, 6, 6), range=[(0, 256)] * 3)
    return counts.ravel() / counts.sum()


def clothes(frame: Frame, name: str) -> np.ndarray:
    """`(h, w, 3)` pixels of the middle of a person's visible box: trunk and legs, little background."""
    x, y, w, h = next(one.visible_box for one in frame.people if one.name == name)
    rows = slice(int(y + 0.2 * h), int(y + 0.75 * h))
    return frame.image[rows, round(x + 0.35 * w) : round(x + 0.65 * w)]


@pytest.mark.slow
def test_similarity_of_the_rendered_clothes_grows_with_the_parameter():
    means = []
    for similarity in (0.0, 0.35, 0.7, 1.0):
        found = []
        for seed in (1, 2, 3, 4):
            found.append(similarity_of_pixels(similarity, seed))
        means.append(float(np.mean(found)))
    assert (np.diff(means) > 0.03).all(), means
    assert means[0] < 0.55
    assert means[-1] > 0.8


def similarity_of_pixels(similarity: float, seed: int) -> float:
    """Bhattacharyya coefficient of the pixels of pedestrian and target when they are abreast."""
    axis = on_axis("distractors", count=1, where="beside", at_s=0.7, similarity=similarity)
    large = {"camera.width_px": 320, "camera.height_px": 240}
    with Simulation(scenario.load("easy/plaza-walk", {**BASE, **ALONE, **large, **axis})) as simulation:
        simulation.reset(seed)
        for _ in range(19):
            simulation.world.advance()
        frame = simulation.advance()
    drawn = [clothes(frame, name) for name in ("target", "passer-1")]
    assert min(one.size for one in drawn) > 900
    return float(np.sqrt(histogram(drawn[0]) * histogram(drawn[1])).sum())


def test_the_target_and_all_start_positions_do_not_depend_on_the_axis():
    names, without = walk("easy/plaza-walk", 2.0, severity=0.0)
    more, together = walk("easy/plaza-walk", 2.0, count=2, at_s=3.0)
    assert more[: len(names)] == names
    assert np.array_equal(without[:, 0], together[:, 0])
    assert np.array_equal(without[0], together[0, : len(names)])
    # Pedestrians influence each other slightly from afar: most walk on as before, but not to the bit.
    moved = np.hypot(*(together[:, : len(names)] - without).T).max(axis=1)
    assert np.median(moved) < 0.01
