"""Running and squatting: feet that stand do not slide, runners fly, those who squat bend their knees."""

from collections.abc import Callable

import numpy as np
import pytest

from pftrack_sim.agents.gait.gait import Gait
from pftrack_sim.scene.people.anatomy import Anatomy, sample_anatomy
from pftrack_sim.scene.people.outfit import sample_outfit
from pftrack_sim.scene.people.person import PARTS, Person, part_meshes

DT = 1.0 / 60.0
COUNT = 3
Law = Callable[[float], float]


def ease(share: float) -> float:
    share = min(max(share, 0.0), 1.0)
    return share * share * (3.0 - 2.0 * share)


def run_speed(time_s: float) -> float:
    """From a walk at 1.3 m/s up to 2.7 m/s at 1 s, and back from 4 s on."""
    return float(np.clip(1.3 + 2.0 * (time_s - 1.0), 1.3, 2.7) - np.clip(2.0 * (time_s - 4.0), 0.0, 1.4))


def stopping(time_s: float) -> float:
    return float(np.clip(1.3 - 2.0 * (time_s - 1.0), 0.0, 1.3))


def squat(time_s: float) -> float:
    return ease((time_s - 2.0) / 0.7) - ease((time_s - 3.7) / 0.7)


def about_face(time_s: float) -> float:
    return np.pi * ease((time_s - 1.8) / 1.1)


def nothing(time_s: float) -> float:
    return 0.0


class Moves:
    """Places `(T, P, 13, 3)`, rotations and standing feet of some people who do as told."""

    def __init__(self, speed: Law, heading: Law = nothing, crouch: Law = nothing, run: Law = nothing) -> None:
        self.bodies: list[Anatomy] = [sample_anatomy(np.random.default_rng(seed)) for seed in range(COUNT)]
        gait = Gait(self.bodies, [np.random.default_rng(50 + seed) for seed in range(COUNT)])
        place = np.zeros((COUNT, 2))
        gait.reset(place, np.zeros(COUNT), np.full(COUNT, speed(0.0)))
        places, turns, standing = [], [], []
        for tick in range(round(6.5 / DT)):
            time_s = tick * DT
            place = place + speed(time_s) * DT * np.array([np.cos(heading(time_s)), np.sin(heading(time_s))])
            told = [np.full(COUNT, law(time_s)) for law in (heading, crouch, run)]
            gait.advance(DT, place, *told)
            at, turned = gait.poses()
            places.append(at)
            turns.append(turned)
            standing.append(gait.in_stance)
        self.places, self.turns, self.standing = np.array(places), np.array(turns), np.array(standing)

    def slide_m(self) -> float:
        """The farthest that the lowest point of a sole has moved over the ground in one stance."""
        longest = 0.0
        for person, body in enumerate(self.bodies):
            shells = part_meshes(Person("x", body, sample_outfit(np.random.default_rng(0))))
            for side, name in enumerate(("left-foot", "right-foot")):
                part = PARTS.index(name)
                points = self.places[:, person, part, None] + turned(self.turns[:, person, part], shells[name].vertices)
                low = points[..., 2].argmin(axis=1)
                slid = 0.0
                for tick in range(1, len(points)):
                    both = self.standing[tick - 1 : tick + 1, person, side].all()
                    step = points[tick, low[tick - 1], :2] - points[tick - 1, low[tick - 1], :2]
                    slid = slid + float(np.hypot(*step)) if both else 0.0
                    longest = max(longest, slid)
        return longest


def turned(quats: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """`(T, V, 3)` vectors turned by `(T, 4)` unit quaternions."""
    w, u = quats[:, None, :1], quats[:, None, 1:]
    vectors = np.broadcast_to(vectors, (len(quats), *vectors.shape))
    across = 2.0 * np.cross(np.broadcast_to(u, vectors.shape), vectors)
    return vectors + w * across + np.cross(np.broadcast_to(u, vectors.shape), across)


@pytest.fixture(scope="module")
def runs() -> Moves:
    return Moves(run_speed, run=lambda time_s: float(1.0 <= time_s < 4.6))


@pytest.fixture(scope="module")
def squats() -> Moves:
    return Moves(stopping, crouch=squat)


def test_feet_that_stand_stay_where_they_are(runs: Moves, squats: Moves):
    for moves in (runs, squats, Moves(stopping, heading=about_face)):
        assert moves.slide_m() < 0.005


def test_runners_fly_and_walkers_do_not(runs: Moves):
    on_ground = runs.standing.sum(axis=2)
    running = slice(round(2.2 / DT), round(3.9 / DT))
    assert (on_ground[running] < 2).all()
    assert 0.15 < (on_ground[running] == 0).mean() < 0.4
    assert (on_ground[: round(0.9 / DT)] > 0).all()
    assert (on_ground[round(5.8 / DT) :] > 0).all()


def test_runners_feet_do_not_jump(runs: Moves):
    speed = np.linalg.norm(np.diff(runs.places, axis=0), axis=-1) / DT
    assert speed.max() < 4.0 * 2.7 + 1.0


def test_squatting_lowers_the_pelvis_over_bent_knees(squats: Moves):
    pelvis, knee, ankle = (squats.places[:, :, PARTS.index(name)] for name in ("pelvis", "left-shank", "left-foot"))
    down, up = round(3.2 / DT), round(6.4 / DT)
    legs = np.array([body.thigh_m + body.shank_m for body in squats.bodies])
    assert (pelvis[up, :, 2] - pelvis[down, :, 2] > 0.35 * legs).all()
    assert (knee[down, :, 0] - ankle[down, :, 0] > 0.1).all()
    shanks = np.array([body.shank_m for body in squats.bodies])
    assert np.allclose(np.linalg.norm(knee - ankle, axis=-1), shanks, atol=1e-9)
