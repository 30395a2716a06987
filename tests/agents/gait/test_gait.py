"""Laws of gait: feet in stance do not slide, strides match the speed, bones keep their length, motion is continuous."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pftrack_sim.agents.gait.curves import leg_angles
from pftrack_sim.agents.gait.gait import Gait, quaternions
from pftrack_sim.agents.gait.posture import Arm, Posture
from pftrack_sim.agents.gait.walk import stride_length
from pftrack_sim.scene.people.anatomy import Anatomy, sample_anatomy
from pftrack_sim.scene.people.outfit import sample_outfit
from pftrack_sim.scene.people.person import PARTS, Person, part_meshes

DT = 1.0 / 60.0
COUNT = 3
FEET = [PARTS.index("left-foot"), PARTS.index("right-foot")]
OfTime = Callable[[float], float]


def constant(value: float) -> OfTime:
    return lambda time_s: value


zero = constant(0.0)


def smooth_step(share: float) -> float:
    share = min(max(share, 0.0), 1.0)
    return share * share * (3.0 - 2.0 * share)


def bodies() -> list[Anatomy]:
    return [sample_anatomy(np.random.default_rng(seed), (None, 1.55, 1.92)[seed]) for seed in range(COUNT)]


def gait_of(anatomies: list[Anatomy]) -> Gait:
    return Gait(anatomies, [np.random.default_rng(100 + index) for index in range(len(anatomies))])


@dataclass
class Recording:
    """What a gait returned over `T` ticks for `P` people."""

    anatomies: list[Anatomy]
    positions: np.ndarray  # (T, P, 13, 3)
    rotations: np.ndarray  # (T, P, 13, 3, 3)
    in_stance: np.ndarray  # (T, P, 2)
    phases: np.ndarray  # (T, P)
    roots: np.ndarray  # (T, P, 4, 4)
    paths: np.ndarray  # (T, P, 2)

    def sole_motion(self) -> tuple[float, float, float]:
        """Longest slide of a contact during one stance, lowest and highest sole of a foot in stance [m].

        The contact is the lowest vertex of the mesh; its motion over the ground is summed over the stance.
        """
        longest, lowest, highest = 0.0, 0.0, 0.0
        for person, anatomy in enumerate(self.anatomies):
            meshes = part_meshes(Person("x", anatomy, sample_outfit(np.random.default_rng(0))))
            for side, part in enumerate(FEET):
                rotation, position = self.rotations[:, person, part], self.positions[:, person, part]
                points = position[:, None] + np.einsum("tij,vj->tvi", rotation, meshes[PARTS[part]].vertices)
                contact, lowest_z = points[..., 2].argmin(axis=1), points[..., 2].min(axis=1)
                stance = self.in_stance[:, person, side]
                lowest, highest = min(lowest, lowest_z.min()), max(highest, lowest_z[stance].max())
                ticks = np.arange(len(points) - 1)
                steps = points[ticks + 1, contact[:-1], :2] - points[ticks, contact[:-1], :2]
                slid = 0.0
                for step, both in zip(np.linalg.norm(steps, axis=-1), stance[1:] & stance[:-1], strict=True):
                    slid = slid + step if both else 0.0
                    longest = max(longest, slid)
        return longest, lowest, highest


def record(
    speed: OfTime,
    turn: OfTime = zero,
    crouch: OfTime = zero,
    run: OfTime = zero,
    seconds: float = 5.0,
    anatomies: list[Anatomy] | None = None,
) -> Recording:
    """Walk `COUNT` people with a given speed [m/s] and turn rate [rad/s]."""
    anatomies = anatomies or bodies()
    gait = gait_of(anatomies)
    position, heading = np.zeros((COUNT, 2)), np.zeros(COUNT)
    gait.reset(position, heading, np.full(COUNT, speed(0.0)))
    ticks: list[tuple[np.ndarray, ...]] = []
    for tick in range(round(seconds / DT)):
        time_s = tick * DT
        heading = heading + turn(time_s) * DT
        position = position + speed(time_s) * DT * np.stack([np.cos(heading), np.sin(heading)], -1)
        gait.advance(DT, position, heading, [Posture(crouch=crouch(time_s), running=bool(run(time_s)))] * COUNT)
        stands, phases = gait._feet["in_stance"].copy(), gait._people["phase"].copy()
        ticks.append((gait.positions, gait.rotations, stands, phases, gait.root_poses, position))
    return Recording(anatomies, *(np.array(column) for column in zip(*ticks, strict=True)))


WALKS: dict[str, tuple[OfTime, OfTime]] = {
    **{f"{speed} m/s": (constant(speed), zero) for speed in (0.3, 0.6, 1.0, 1.4, 1.8, 2.2)},
    "slow turn": (constant(0.4), constant(np.radians(-60))),
    "turn": (constant(1.3), constant(np.radians(60))),
    "fast turn": (constant(2.2), constant(np.radians(60))),
    "slalom": (lambda t: 1.2 + 0.5 * np.sin(3 * t), lambda t: np.radians(60) * np.sin(2 * t)),
    "stop and go": (lambda t: float(np.clip(2.0 * np.cos(1.6 * t), 0.0, 1.4)), zero),
    "abrupt": (lambda t: 1.3 * (int(t / 1.3) % 2), zero),
    "turn on the spot": (zero, lambda t: np.radians(60) * (int(t / 2.0) % 2)),
}


@pytest.fixture(scope="module", params=list(WALKS))
def walk(request: pytest.FixtureRequest) -> Recording:
    return record(*WALKS[request.param])


def assert_feet_stand(walk: Recording):
    slid, lowest, highest = walk.sole_motion()
    assert slid < 0.002
    assert lowest > -0.01
    assert highest < 0.015


def test_feet_in_stance_do_not_slide(walk: Recording):
    assert_feet_stand(walk)


def test_a_walker_has_at_least_one_foot_in_stance(walk: Recording):
    assert walk.in_stance.any(axis=2).all()


def test_bones_keep_their_length_and_joints_stay_connected(walk: Recording):
    for person, body in enumerate(walk.anatomies):
        offsets = {("pelvis", "torso"): [0, 0, body.pelvis_m], ("torso", "head"): [0, 0, body.torso_m]}
        for side, sign in (("left", 1.0), ("right", -1.0)):
            offsets |= {
                ("pelvis", f"{side}-thigh"): [0, sign * body.hip_half_m, 0],
                (f"{side}-upper-arm", f"{side}-forearm"): [0, 0, -body.upper_arm_m],
                (f"{side}-thigh", f"{side}-shank"): [0, 0, -body.thigh_m],
                (f"{side}-shank", f"{side}-foot"): [0, 0, -body.shank_m],
            }
        for (parent, child), offset in offsets.items():
            up, down = PARTS.index(parent), PARTS.index(child)
            joint = walk.positions[:, person, up] + walk.rotations[:, person, up] @ np.array(offset)
            gap = np.abs(joint - walk.positions[:, person, down]).max()
            # A foot in swing may lie slightly beyond the reach of a leg that never locks.
            assert gap < (0.02 if child.endswith("foot") else 1e-9), (parent, child)


def test_positions_and_rotations_are_continuous(walk: Recording):
    speed = np.linalg.norm(np.diff(walk.positions, axis=0), axis=-1) / DT
    body = np.linalg.norm(np.diff(walk.paths, axis=0), axis=-1).max() / DT
    heading = np.unwrap(np.arctan2(walk.roots[..., 1, 0], walk.roots[..., 0, 0]), axis=0)
    turn = np.abs(np.diff(heading, axis=0)).max() / DT
    assert speed.max() < 4.0 * body + 1.0 + turn
    trace = np.einsum("tpbij,tpbij->tpb", walk.rotations[1:], walk.rotations[:-1])
    assert np.arccos(np.clip((trace - 1.0) / 2.0, -1.0, 1.0)).max() / DT < 20.0


def test_root_pose_is_on_the_ground_below_the_pelvis(walk: Recording):
    pelvis = walk.positions[:, :, 0]
    assert np.abs(walk.roots[..., :2, 3] - pelvis[..., :2]).max() < 1e-12
    assert np.abs(walk.roots[..., 2, 3]).max() == 0.0
    assert np.abs(pelvis[..., :2] - walk.paths).max() < 0.045


@pytest.mark.parametrize("speed", [0.3, 0.7, 1.3, 2.2])
def test_stride_length_matches_the_published_relation(speed: float):
    walk = record(constant(speed), seconds=8.0)
    for person, body in enumerate(walk.anatomies):
        phases = np.unwrap(walk.phases[:, person], period=1.0)
        length = speed * DT * (len(phases) - 1) / (phases[-1] - phases[0])
        expected = float(stride_length(speed, body.height_m))
        assert abs(length - expected) < 0.01 * expected
        # Consecutive footholds of one foot are one stride apart.
        heel_strikes = np.flatnonzero(np.diff(walk.in_stance[:, person, 0].astype(int)) == 1) + 1
        strides = np.diff(walk.positions[heel_strikes, person, FEET[0], 0])
        assert np.abs(strides - expected).max() < 0.04 + speed * DT


def test_stride_frequency_grows_with_the_published_power_of_speed():
    height = 1.75
    frequency_hz = [speed * height / float(stride_length(speed * height, height)) for speed in (1.0, 1.5)]
    assert abs(frequency_hz[0] - 64.8 / 60.0) < 1e-9
    assert abs(np.log(frequency_hz[1] / frequency_hz[0]) / np.log(1.5) - 0.57) < 1e-9


def test_the_right_side_repeats_the_left_half_a_stride_later():
    speed, ticks = 1.2, 64
    body = bodies()[0]
    gait = gait_of([body])
    gait.reset(np.zeros((1, 2)), np.zeros(1), np.array([speed]))
    dt = float(stride_length(speed, body.height_m)) / speed / 2.0 / ticks
    relative = []
    for tick in range(1, 3 * ticks + 1):
        x = speed * dt * tick
        gait.advance(dt, np.array([[x, 0.0]]), np.zeros(1), [Posture()])
        relative.append(gait.positions[0] - [x, 0.0, 0.0])
    first, second = np.array(relative[ticks : 2 * ticks]), np.array(relative[2 * ticks :])
    for index, name in enumerate(PARTS):
        if name == "head" or "arm" in name:
            continue
        mirrored = name.replace("left", "*").replace("right", "left").replace("*", "right")
        difference = first[:, index] * [1.0, -1.0, 1.0] - second[:, PARTS.index(mirrored)]
        assert np.abs(difference).max() < 0.01, name


def test_arms_swing_in_opposition_to_the_legs():
    walk = record(constant(1.3))
    ahead = walk.positions[..., 0] - walk.positions[:, :, :1, 0]
    for side in ("left", "right"):
        elbow, foot = ahead[..., PARTS.index(f"{side}-forearm")], ahead[..., PARTS.index(f"{side}-foot")]
        for person in range(COUNT):
            assert np.corrcoef(elbow[:, person], foot[:, person])[0, 1] < -0.5


def test_knee_flexion_follows_the_published_trajectory():
    walk = record(constant(1.3))
    shank = -walk.rotations[:, :, PARTS.index("left-shank"), :, 2]
    thigh = -walk.rotations[:, :, PARTS.index("left-thigh"), :, 2]
    knee = np.arccos(np.clip((shank * thigh).sum(-1), -1.0, 1.0))
    _, published, _ = leg_angles(walk.phases)
    assert np.sqrt(np.mean((knee - published) ** 2)) < np.radians(14.0)
    assert np.radians(50.0) < knee.max() < np.radians(72.0)


def test_vertical_travel_of_the_pelvis_is_in_the_published_range():
    for speed, least, most in ((0.7, 0.01, 0.04), (1.3, 0.03, 0.055), (1.8, 0.04, 0.08)):
        travel = np.ptp(record(constant(speed)).positions[:, :, 0, 2], axis=0)
        assert (travel > least).all()
        assert (travel < most).all()


def test_a_person_at_rest_stands_upright_with_both_feet_in_place():
    walk = record(lambda t: 1.2 if t < 1.0 else 0.0)
    at_rest = walk.positions[-60:]
    assert walk.in_stance[-60:].all()
    assert np.ptp(at_rest[:, :, FEET], axis=0).max() < 1e-9
    assert np.ptp(at_rest, axis=0).max() < 0.02
    for person, body in enumerate(walk.anatomies):
        assert abs(at_rest[-1, person, 0, 2] - body.thigh_m - body.shank_m - body.ankle_m) < 0.02
        between_feet = at_rest[-1, person, FEET[0]] - at_rest[-1, person, FEET[1]]
        assert 0.08 < np.hypot(between_feet[0], between_feet[1]) < 0.30


@pytest.fixture(scope="module")
def runs() -> Recording:
    """From a walk at 1.3 m/s to a run at 2.7 m/s from 1 s on, and back from 4 s on."""

    def speed(time_s: float) -> float:
        return float(np.clip(1.3 + 2.0 * (time_s - 1.0), 1.3, 2.7) - np.clip(2.0 * (time_s - 4.0), 0.0, 1.4))

    return record(speed, run=lambda time_s: float(1.0 <= time_s < 4.6), seconds=6.5)


def stopping(time_s: float) -> float:
    return float(np.clip(1.3 - 2.0 * (time_s - 1.0), 0.0, 1.3))


@pytest.fixture(scope="module")
def crouches() -> Recording:
    """A walker that stops and crouches from 2 s to 4.4 s."""

    def crouch(time_s: float) -> float:
        return smooth_step((time_s - 2.0) / 0.7) - smooth_step((time_s - 3.7) / 0.7)

    return record(stopping, crouch=crouch, seconds=6.5)


def test_feet_do_not_slide_in_other_gaits(runs: Recording, crouches: Recording):
    def turn(time_s: float) -> float:
        return np.pi / 1.1 if 1.8 <= time_s < 2.9 else 0.0

    for recording in (runs, crouches, record(stopping, turn, seconds=6.5), record(constant(-0.9))):
        assert recording.sole_motion()[0] < 0.005


def test_only_running_has_flight_phases(runs: Recording):
    on_ground = runs.in_stance.sum(axis=2)
    running = on_ground[round(2.2 / DT) : round(3.9 / DT)]
    assert (running < 2).all()
    assert 0.15 < (running == 0).mean() < 0.4
    assert (on_ground[: round(0.9 / DT)] > 0).all()
    assert (on_ground[round(5.8 / DT) :] > 0).all()


def test_parts_of_runners_move_continuously(runs: Recording):
    assert np.linalg.norm(np.diff(runs.positions, axis=0), axis=-1).max() / DT < 4.0 * 2.7 + 1.0


def test_crouching_lowers_the_pelvis_over_bent_knees(crouches: Recording):
    pelvis, knee, ankle = (crouches.positions[:, :, PARTS.index(p)] for p in ("pelvis", "left-shank", "left-foot"))
    down, up = round(3.2 / DT), round(6.4 / DT)
    thighs, shanks = np.array([(body.thigh_m, body.shank_m) for body in crouches.anatomies]).T
    assert (pelvis[up, :, 2] - pelvis[down, :, 2] > 0.35 * (thighs + shanks)).all()
    assert (knee[down, :, 0] - ankle[down, :, 0] > 0.1).all()
    assert np.allclose(np.linalg.norm(knee - ankle, axis=-1), shanks, atol=1e-9)


def test_reset_clears_the_state():
    gait = gait_of(bodies())
    start = np.zeros((COUNT, 2)), np.zeros(COUNT), np.full(COUNT, 1.2)
    gait.reset(*start)
    fresh = gait.positions, gait.rotations
    for tick in range(50):
        everything = Posture(1.0, 1.0, 1.0, True, 1.0, (None, Arm(1.0, 2.0, 1.0)))
        gait.advance(DT, np.full((COUNT, 2), 0.02 * tick), np.full(COUNT, 0.01 * tick), [everything] * COUNT)
    gait.reset(*start)
    for before, after in zip(fresh, (gait.positions, gait.rotations), strict=True):
        assert np.array_equal(before, after)


def test_poses_of_a_person_do_not_depend_on_the_others():
    alone, together = gait_of(bodies()[:1]), gait_of(bodies())
    for gait, count in ((alone, 1), (together, COUNT)):
        gait.reset(np.zeros((count, 2)), np.zeros(count), np.full(count, 1.1))
        for tick in range(1, 30):
            gait.advance(DT, np.full((count, 2), 0.015 * tick), np.zeros(count), [Posture()] * count)
    assert np.abs(alone.positions[0] - together.positions[0]).max() < 1e-12


def test_quaternions_and_rotations_agree():
    gait = gait_of(bodies() * 4)
    rng = np.random.default_rng(0)
    for _ in range(30):
        heading, sit = rng.uniform(-np.pi, np.pi, 4 * COUNT), Posture(bend=rng.random(), look_rad=rng.normal())
        gait.advance(DT, rng.normal(size=(len(heading), 2)), heading, [sit] * len(heading))
        converted = Rotation.from_quat(quaternions(gait.rotations).reshape(-1, 4), scalar_first=True).as_matrix()
        assert np.abs(converted.reshape(gait.rotations.shape) - gait.rotations).max() < 1e-12


def standing(posture: Posture) -> tuple[np.ndarray, np.ndarray]:
    """Positions and rotations of the parts of people who stand at the origin, facing +x, in a posture."""
    gait = gait_of(bodies())
    gait.reset(np.zeros((COUNT, 2)), np.zeros(COUNT), np.zeros(COUNT))
    for _ in range(120):
        gait.advance(DT, np.zeros((COUNT, 2)), np.zeros(COUNT), [posture] * COUNT)
    return gait.positions, gait.rotations


def test_bending_brings_head_and_hands_down_over_standing_feet():
    (plain, _), (bent, _) = standing(Posture()), standing(Posture(bend=1.0))
    head, elbow, pelvis = (PARTS.index(part) for part in ("head", "left-forearm", "pelvis"))
    assert (bent[:, head, 2] < 0.72 * plain[:, head, 2]).all()
    assert (bent[:, head, 0] > plain[:, head, 0] + 0.25).all()
    assert (bent[:, elbow, 2] < 0.75 * plain[:, elbow, 2]).all()
    assert (bent[:, pelvis, 0] < plain[:, pelvis, 0] - 0.1).all()
    assert np.abs(bent[:, FEET] - plain[:, FEET]).max() < 1e-9


def test_looking_aside_turns_the_head_more_than_the_trunk_and_no_feet():
    (_, plain), (_, looking) = standing(Posture()), standing(Posture(look_rad=1.0))
    turned = np.degrees(
        np.arctan2(looking[..., 1, 0], looking[..., 0, 0]) - np.arctan2(plain[..., 1, 0], plain[..., 0, 0])
    )
    assert turned[:, PARTS.index("head")] == pytest.approx(np.degrees(1.0), abs=3.0)
    assert turned[:, PARTS.index("torso")] == pytest.approx(np.degrees(0.35), abs=3.0)
    assert np.abs(turned[:, FEET]).max() < 1e-6


def test_a_raised_arm_leaves_everything_else_in_place():
    raised = Arm(1.0, shoulder=2.6, elbow=0.5, outward=-0.35)
    (plain, _), (waving, _) = standing(Posture()), standing(Posture(arms=(None, raised)))
    forearm, neck = PARTS.index("right-forearm"), PARTS.index("head")
    assert (waving[:, forearm, 2] > plain[:, neck, 2]).all()
    reaching, _ = standing(Posture(arms=(None, Arm(1.0, shoulder=1.2, elbow=0.5))))
    assert (reaching[:, forearm, 0] > plain[:, forearm, 0] + 0.15).all()
    others = [index for index in range(len(PARTS)) if index != forearm]
    assert np.abs(waving[:, others] - plain[:, others]).max() < 1e-9


@pytest.mark.parametrize("speed_m_s", [0.9, 1.6])
def test_feet_of_a_child_do_not_slide_and_stay_on_the_ground(speed_m_s: float):
    children = [sample_anatomy(np.random.default_rng(seed), 0.95 + 0.1 * seed) for seed in range(COUNT)]
    assert_feet_stand(record(constant(speed_m_s), anatomies=children))
