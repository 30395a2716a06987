"""Laws of the avoidance: barriers limit how fast a distance shrinks, and what is too near is shifted apart."""

from __future__ import annotations

import numpy as np
import pytest

from pftrack_sim.agents.pedestrians.avoidance import (
    BARRIER_RATE_S,
    MOVER,
    PERSON_DISTANCE_M,
    RECTANGLE,
    WALL_DISTANCE_M,
    avoid,
)

TICK_S = 1.0 / 60.0
NO_WALLS = np.zeros(0, RECTANGLE)


def movers(*places: tuple[float, float], extra_m: float = 0.0, others_react: bool = True) -> np.ndarray:
    """People at x, y who face and walk towards the first one, which walks to the second one, all at 1.5 m/s."""
    made = np.zeros(len(places), MOVER)
    made["x"], made["y"] = np.array(places).T
    made["speed"], made["pace"], made["reaction"] = 1.5, 1.0, 1.0
    if not others_react:
        made["reaction"][1:] = 0.0
    made["extra_m"][1:] = extra_m
    goals = np.array([places[1], *[places[0]] * (len(places) - 1)])
    made["waypoint_x"], made["waypoint_y"] = goals.T
    made["heading"] = np.arctan2(goals[:, 1] - made["y"], goals[:, 0] - made["x"])
    made["vx"], made["vy"] = 1.5 * np.cos(made["heading"]), 1.5 * np.sin(made["heading"])
    return made


def wall(x: float, y: float) -> np.ndarray:
    """A square of 2 m."""
    made = np.zeros(1, RECTANGLE)
    made["x"], made["y"], made["half_u"], made["half_v"] = x, y, 1.0, 1.0
    made["cos"], made["reach_m"] = 1.0, np.sqrt(2.0)
    return made


def apart_m(people: np.ndarray) -> float:
    return float(np.hypot(people["x"][1] - people["x"][0], people["y"][1] - people["y"][0]))


@pytest.mark.parametrize("extra_m", [0.0, 0.28])
@pytest.mark.parametrize("others_react", [True, False])
def test_a_distance_shrinks_at_most_at_a_rate_in_proportion_to_the_room_left(extra_m: float, others_react: bool):
    people = movers((0.0, 0.0), (2.5, 0.02), extra_m=extra_m, others_react=others_react)
    if not others_react:
        people["vx"][1] = people["vy"][1] = 0.0
    least_m = PERSON_DISTANCE_M + extra_m
    for _ in range(180):
        before_m = apart_m(people)
        avoid(people, NO_WALLS, TICK_S)
        assert apart_m(people) >= before_m - BARRIER_RATE_S * (before_m - least_m) * TICK_S - 1e-3
    assert least_m - 0.01 < apart_m(people)


def test_a_person_who_walks_at_a_wall_stays_off_it():
    people, house = movers((0.0, 0.3), (9.0, 0.3)), wall(3.0, 0.0)
    for _ in range(180):
        avoid(people, house, TICK_S)
        over = np.maximum(np.abs([people["x"][0] - 3.0, people["y"][0]]) - 1.0, 0.0)
        assert np.hypot(*over) > WALL_DISTANCE_M - 0.01


def test_people_who_stand_in_each_other_or_in_a_wall_are_shifted_apart():
    people, house = movers((0.0, 0.0), (0.2, 0.0), (-1.9, 0.3)), wall(-3.0, 0.0)
    people["vx"] = people["vy"] = 0.0
    before = people.copy()
    avoid(people, house, TICK_S)
    assert apart_m(people) > 0.46
    assert people["x"][2] > -2.0 + 0.26
    for place, velocity in (("x", "vx"), ("y", "vy")):
        np.testing.assert_allclose(people[velocity], (people[place] - before[place]) / TICK_S, atol=1e-9)


def test_what_does_not_react_is_not_moved():
    people = movers((0.0, 0.0), (0.4, 0.0), others_react=False)
    avoid(people, NO_WALLS, TICK_S)
    assert (people["x"][1], people["y"][1]) == (0.4, 0.0)
    assert people["x"][0] < 0.0


def test_a_distance_is_kept_from_all_of_what_is_ahead_of_a_person():
    people = movers((0.0, 0.0), (2.5, 0.02), others_react=False)
    people["vx"][1] = people["vy"][1] = 0.0
    people["front_m"][1] = 1.2  # It faces the first one
    for _ in range(240):
        avoid(people, NO_WALLS, TICK_S)
        ahead = np.clip(2.5 - people["x"][0], 0.0, 1.2)
        assert np.hypot(people["x"][0] - (2.5 - ahead), people["y"][0] - 0.02) > PERSON_DISTANCE_M - 0.02
    assert people["x"][0] > 2.0, "it walked around"
