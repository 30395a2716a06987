"""The kernels of the gait take the steps of the formulas on arrays."""

from __future__ import annotations

import numpy as np
from numpy_gait import NumpyGait

from pftrack_sim.agents.gait.gait import Gait
from pftrack_sim.agents.gait.posture import PLAIN, Arm, Posture
from pftrack_sim.agents.mocap_kernels import write_parts
from pftrack_sim.scene.people.anatomy import sample_anatomy

COUNT, DT = 5, 1.0 / 30.0


def test_poses_are_those_of_arrays():
    rng = np.random.default_rng(0)
    anatomies = [sample_anatomy(np.random.default_rng(seed), None) for seed in range(COUNT)]
    made = [cls(anatomies, [np.random.default_rng(seed) for seed in range(COUNT)]) for cls in (Gait, NumpyGait)]
    places, headings = rng.normal(0.0, 5.0, (COUNT, 2)), rng.uniform(-3.0, 3.0, COUNT)
    speeds = np.array([0.0, 0.5, 1.2, 1.6, 2.4])
    for gait in made:
        gait.reset(places, headings, speeds)
    for tick in range(90):
        # Everybody stops after two seconds; a foot out of place is brought back.
        speeds = speeds + rng.normal(0.0, 0.02, COUNT) if tick < 60 else 0.8 * speeds
        headings = headings + rng.normal(0.0, 0.06, COUNT)
        places = places + DT * speeds[:, None] * np.stack([np.cos(headings), np.sin(headings)], axis=1)
        arms = (Arm(0.5, 0.4, 0.9, 0.1, 0.2), None)
        postures = [PLAIN, Posture(crouch=0.6), Posture(bend=tick / 90), Posture(look_rad=0.5, arms=arms)]
        postures.append(Posture(running=20 < tick < 50))
        (positions, quaternions), (expected, expected_quaternions) = (
            (gait.advance(DT, places, headings, postures), gait.poses())[1] for gait in made
        )
        np.testing.assert_allclose(positions, expected, rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(quaternions, expected_quaternions, rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(made[0].root_poses(), made[1].root_poses(), rtol=0.0, atol=1e-12)
        np.testing.assert_array_equal(made[0].feet.in_stance, made[1].feet.in_stance)
    assert made[0].feet.speed.max() < 0.06


def test_parts_are_written_to_their_mocap_bodies():
    rng = np.random.default_rng(1)
    ids = rng.permutation(40)[:26].reshape(2, 13).astype(np.intp)
    positions, quaternions = rng.normal(size=(2, 13, 3)), rng.normal(size=(2, 13, 4))
    places, turns = rng.normal(size=(40, 3)), rng.normal(size=(40, 4))
    expected_places, expected_turns = places.copy(), turns.copy()
    expected_places[ids], expected_turns[ids] = positions, quaternions
    write_parts(ids, positions, quaternions, places, turns)
    np.testing.assert_array_equal(places, expected_places)
    np.testing.assert_array_equal(turns, expected_turns)
