"""Laws of walking: feet that stand do not slide, strides match speed, bones keep their length, nothing jumps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from pftrack_sim.agents.gait.gait import Gait
from pftrack_sim.agents.gait.gait_parameters import stride_length
from pftrack_sim.agents.gait.joint_trajectories import leg_angles
from pftrack_sim.agents.gait.kinematics import quaternions, rotation_matrices
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.scene.people.anatomy import Anatomy, sample_anatomy
from pftrack_sim.scene.people.outfit import sample_outfit
from pftrack_sim.scene.people.person import PARTS, Person, part_meshes

DT = 1.0 / 60.0
FEET = [PARTS.index("left-foot"), PARTS.index("right-foot")]
Law = Callable[[float], float]


def people(count: int = 3) -> list[Anatomy]:
    return [sample_anatomy(np.random.default_rng(seed), (None, 1.55, 1.92)[seed % 3]) for seed in range(count)]


def gait_of(anatomies: list[Anatomy]) -> Gait:
    return Gait(anatomies, [np.random.default_rng(100 + index) for index in range(len(anatomies))])


def matrices(quats: np.ndarray) -> np.ndarray:
    w, x, y, z = np.moveaxis(quats, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, -1) for row in rows], -2)


@dataclass
class Walk:
    anatomies: list[Anatomy]
    positions: np.ndarray  # (T, P, 13, 3)
    rotations: np.ndarray  # (T, P, 13, 3, 3)
    standing: np.ndarray  # (T, P, 2)
    phases: np.ndarray  # (T, P)
    roots: np.ndarray  # (T, P, 4, 4)
    paths: np.ndarray  # (T, P, 2)


def walk(speed: Law, turn: Law = lambda t: 0.0, seconds: float = 5.0, start: float | None = None) -> Walk:
    anatomies = people()
    count = len(anatomies)
    gait = gait_of(anatomies)
    position, heading = np.zeros((count, 2)), np.zeros(count)
    gait.reset(position, heading, np.full(count, speed(0.0) if start is None else start))
    seen: list[tuple] = []
    for tick in range(round(seconds / DT)):
        heading = heading + turn(tick * DT) * DT
        position = position + speed(tick * DT) * DT * np.stack([np.cos(heading), np.sin(heading)], -1)
        gait.advance(DT, position, heading)
        seen.append((*gait.poses(), gait.in_stance, gait.phases, gait.root_poses(), position))
    places, quats, standing, phases, roots, paths = (np.array(column) for column in zip(*seen, strict=True))
    return Walk(anatomies, places, matrices(quats), standing, phases, roots, paths)


def soles_of(anatomies: list[Anatomy], walked: Walk) -> tuple[float, float, float]:
    """Longest slide of a contact during one stance, lowest and highest sole of a standing foot [m].

    The contact is the mesh vertex that is lowest; its way over the ground adds up from lift-off to lift-off.
    """
    longest, lowest, highest = 0.0, 0.0, 0.0
    for person, anatomy in enumerate(anatomies):
        left = part_meshes(Person("x", anatomy, sample_outfit(np.random.default_rng(0))))["left-foot"].vertices
        for side, vertices in enumerate((left, left * [1.0, -1.0, 1.0])):
            part = FEET[side]
            rotation, place = walked.rotations[:, person, part], walked.positions[:, person, part]
            points = place[:, None] + np.einsum("tij,vj->tvi", rotation, vertices)
            low = points[..., 2].argmin(axis=1)
            lowest = min(lowest, float(points[..., 2].min()))
            slid = 0.0
            for tick in range(1, len(points)):
                if not walked.standing[tick, person, side]:
                    slid = 0.0
                    continue
                highest = max(highest, float(points[tick, :, 2].min()))
                if walked.standing[tick - 1, person, side]:
                    contact = low[tick - 1]
                    slid += float(np.hypot(*(points[tick, contact, :2] - points[tick - 1, contact, :2])))
                    longest = max(longest, slid)
    return longest, lowest, highest


WALKS: dict[str, tuple[Law, Law]] = {
    **{f"{speed} m/s": ((lambda t, v=speed: v), (lambda t: 0.0)) for speed in (0.3, 0.6, 1.0, 1.4, 1.8, 2.2)},
    "slow turn": (lambda t: 0.4, lambda t: np.radians(-60)),
    "turn": (lambda t: 1.3, lambda t: np.radians(60)),
    "fast turn": (lambda t: 2.2, lambda t: np.radians(60)),
    "slalom": (lambda t: 1.2 + 0.5 * np.sin(3 * t), lambda t: np.radians(60) * np.sin(2 * t)),
    "stop and go": (lambda t: float(np.clip(2.0 * np.cos(1.6 * t), 0.0, 1.4)), lambda t: 0.0),
    "abrupt": (lambda t: 1.3 * (int(t / 1.3) % 2), lambda t: 0.0),
    "turn on the spot": (lambda t: 0.0, lambda t: np.radians(60) * (int(t / 2.0) % 2)),
}


@pytest.fixture(scope="module", params=list(WALKS))
def walked(request: pytest.FixtureRequest) -> Walk:
    return walk(*WALKS[request.param])


def test_standing_feet_stay_where_they_are(walked: Walk):
    slid, lowest, highest = soles_of(walked.anatomies, walked)
    assert slid < 0.02
    assert lowest > -0.01
    assert highest < 0.015


def test_someone_stands_on_at_least_one_foot(walked: Walk):
    assert walked.standing.any(axis=2).all()


def test_bones_keep_their_length_and_joints_hold(walked: Walk):
    place, turn = walked.positions, walked.rotations
    for person, body in enumerate(walked.anatomies):
        chain = {
            ("pelvis", "torso"): [0, 0, body.pelvis_m],
            ("torso", "head"): [0, 0, body.torso_m],
        }
        for side in ("left", "right"):
            sign = 1.0 if side == "left" else -1.0
            chain[("pelvis", f"{side}-thigh")] = [0, sign * body.hip_half_m, 0]
            chain[(f"{side}-upper-arm", f"{side}-forearm")] = [0, 0, -body.upper_arm_m]
            chain[(f"{side}-thigh", f"{side}-shank")] = [0, 0, -body.thigh_m]
            chain[(f"{side}-shank", f"{side}-foot")] = [0, 0, -body.shank_m]
        for (parent, child), offset in chain.items():
            up, down = PARTS.index(parent), PARTS.index(child)
            gap = place[:, person, up] + turn[:, person, up] @ np.array(offset) - place[:, person, down]
            # A swinging foot may lie a little beyond the reach of a leg that never locks.
            assert np.abs(gap).max() < (0.02 if child.endswith("foot") else 1e-9), (parent, child)


def test_nothing_jumps(walked: Walk):
    speed = np.sqrt((np.diff(walked.positions, axis=0) ** 2).sum(-1)) / DT
    body = np.sqrt((np.diff(walked.paths, axis=0) ** 2).sum(-1)).max() / DT
    heading = np.unwrap(np.arctan2(walked.roots[..., 1, 0], walked.roots[..., 0, 0]), axis=0)
    turning = np.abs(np.diff(heading, axis=0)).max() / DT
    assert speed.max() < 4.0 * body + 1.0 + turning


def test_orientations_change_smoothly(walked: Walk):
    change = np.einsum("tpbij,tpbij->tpb", walked.rotations[1:], walked.rotations[:-1])
    angle = np.arccos(np.clip((change - 1.0) / 2.0, -1.0, 1.0))
    assert angle.max() / DT < 20.0


def test_root_is_on_the_ground_below_the_pelvis(walked: Walk):
    pelvis = walked.positions[:, :, 0]
    assert np.abs(walked.roots[..., :2, 3] - pelvis[..., :2]).max() < 1e-12
    assert np.abs(walked.roots[..., 2, 3]).max() == 0.0
    assert np.abs(pelvis[..., :2] - walked.paths).max() < 0.045


@pytest.mark.parametrize("speed", [0.3, 0.7, 1.3, 2.2])
def test_stride_matches_speed(speed: float):
    walked = walk(lambda t: speed, seconds=8.0)
    for person, body in enumerate(walked.anatomies):
        turns = np.unwrap(walked.phases[:, person], period=1.0)
        strides = turns[-1] - turns[0]
        length = speed * DT * (len(turns) - 1) / strides
        wanted = float(stride_length(np.array(speed), np.array(body.height_m)))
        assert abs(length - wanted) < 0.01 * wanted
        # A foot comes down once a stride, one stride farther.
        landings = np.flatnonzero(np.diff(walked.standing[:, person, 0].astype(int)) == 1) + 1
        steps = np.diff(walked.positions[landings, person, FEET[0], 0])
        assert np.abs(steps - wanted).max() < 0.04 + speed * DT


def test_left_is_right_half_a_stride_later():
    speed = 1.2
    body = sample_anatomy(np.random.default_rng(4))
    gait = gait_of([body])
    gait.reset(np.zeros((1, 2)), np.zeros(1), np.array([speed]))
    half = float(stride_length(np.array(speed), np.array(body.height_m))) / speed / 2.0
    ticks = 64
    dt = half / ticks
    seen = []
    for tick in range(1, 3 * ticks + 1):
        position = np.array([[speed * dt * tick, 0.0]])
        gait.advance(dt, position, np.zeros(1))
        places, _ = gait.poses()
        seen.append(places[0] - [position[0, 0], 0.0, 0.0])
    relative = np.array(seen)[ticks:]
    mirror = {name: name.replace("left", "L").replace("right", "left").replace("L", "right") for name in PARTS}
    for name in (part for part in PARTS if part != "head" and "arm" not in part):
        first = relative[:ticks, PARTS.index(name)] * [1.0, -1.0, 1.0]
        later = relative[ticks : 2 * ticks, PARTS.index(mirror[name])]
        assert np.abs(first - later).max() < 0.01, name


def test_arms_swing_against_the_legs():
    walked = walk(lambda t: 1.3)
    ahead = walked.positions[..., 0] - walked.positions[:, :, :1, 0]
    for side in ("left", "right"):
        hand, foot = ahead[..., PARTS.index(f"{side}-forearm")], ahead[..., PARTS.index(f"{side}-foot")]
        for person in range(hand.shape[1]):
            assert np.corrcoef(hand[:, person], foot[:, person])[0, 1] < -0.5


def test_knees_follow_the_published_curve():
    walked = walk(lambda t: 1.3)
    shin = -walked.rotations[:, :, PARTS.index("left-shank"), :, 2]
    thigh = -walked.rotations[:, :, PARTS.index("left-thigh"), :, 2]
    knee = np.arccos(np.clip((shin * thigh).sum(-1), -1.0, 1.0))
    _, published, _ = leg_angles(walked.phases)
    assert np.sqrt(np.mean((knee - published) ** 2)) < np.radians(14.0)
    assert np.radians(50.0) < knee.max() < np.radians(72.0)


def test_pelvis_bobs_naturally():
    for speed, least, most in ((0.7, 0.01, 0.04), (1.3, 0.03, 0.055), (1.8, 0.04, 0.08)):
        height = walk(lambda t, v=speed: v).positions[:, :, 0, 2]
        travel = np.ptp(height, axis=0)
        assert (travel > least).all()
        assert (travel < most).all()


def test_standing_still_is_standing():
    walked = walk(lambda t: 1.2 if t < 1.0 else 0.0, seconds=5.0)
    still = walked.positions[-60:]
    assert walked.standing[-60:].all()
    assert np.ptp(still[:, :, FEET], axis=0).max() < 1e-9
    assert np.ptp(still, axis=0).max() < 0.02
    for person, body in enumerate(walked.anatomies):
        assert abs(still[-1, person, 0, 2] - body.hip_height_m) < 0.02
        apart = still[-1, person, FEET[0]] - still[-1, person, FEET[1]]
        assert 0.08 < np.hypot(apart[0], apart[1]) < 0.30


def test_the_same_seed_walks_the_same_way():
    first, second = walk(*WALKS["slalom"], seconds=2.0), walk(*WALKS["slalom"], seconds=2.0)
    assert np.array_equal(first.positions, second.positions)
    assert np.array_equal(first.rotations, second.rotations)


def test_reset_forgets_what_was_before():
    gait = gait_of(people())
    start = np.zeros((3, 2)), np.zeros(3), np.full(3, 1.2)
    gait.reset(*start)
    fresh = gait.poses()
    for tick in range(50):
        gait.advance(DT, np.full((3, 2), 0.02 * tick), np.full(3, 0.01 * tick))
    gait.reset(*start)
    again = gait.poses()
    assert np.array_equal(fresh[0], again[0])
    assert np.array_equal(fresh[1], again[1])


def test_company_changes_nobody():
    anatomies = people()
    alone, together = gait_of(anatomies[:1]), gait_of(anatomies)
    alone.reset(np.zeros((1, 2)), np.zeros(1), np.full(1, 1.1))
    together.reset(np.zeros((3, 2)), np.zeros(3), np.full(3, 1.1))
    for tick in range(1, 30):
        alone.advance(DT, np.full((1, 2), 0.015 * tick), np.zeros(1))
        together.advance(DT, np.full((3, 2), 0.015 * tick), np.zeros(3))
    assert np.abs(alone.poses()[0][0] - together.poses()[0][0]).max() < 1e-12


def test_one_generator_per_person():
    with pytest.raises(ParameterError, match="one generator per person"):
        Gait(people(2), [np.random.default_rng(0)])


def test_quaternions_turn_as_their_matrices():
    rng = np.random.default_rng(0)
    angles = rng.uniform(-np.pi, np.pi, (3, 200))
    rotations = rotation_matrices(*angles)
    assert np.abs(rotations @ rotations.swapaxes(-1, -2) - np.eye(3)).max() < 1e-12
    assert np.abs(matrices(quaternions(rotations)) - rotations).max() < 1e-12
