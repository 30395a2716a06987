"""The gait phase at which the box of a walking person has its median width."""

import numpy as np
import pytest
from render_stage import facing

from pftrack_sim.agents.gait.gait import Gait
from pftrack_sim.agents.traffic import PHASES, median_width_phase
from pftrack_sim.scenario.clothes import Clothes
from pftrack_sim.scene.people.person import Person, part_meshes, sample_target

PERSON = sample_target(3, "target", 1.75, Clothes())
START, EYE_M = np.array([4.0, 0.0]), (0.0, 0.0, 1.2)


def gait(seed: int, people: int = 1) -> Gait:
    return Gait([PERSON.anatomy] * people, [np.random.default_rng(seed) for _ in range(people)])


def widths(person: Person, one: Gait, heading_rad: float, count: int) -> np.ndarray:
    """Angular widths of the person in `count` steps of a steady walk at 1.3 m/s on the spot."""
    meshes = [mesh.vertices for mesh in part_meshes(person).values()]
    found = []
    for phase in np.arange(count) / count:
        one.start_phase[:] = phase
        one.reset(START[None], [heading_rad], [1.3])
        positions, rotations = one.positions, one.rotations
        points = np.concatenate([v @ r.T + p for v, p, r in zip(meshes, positions[0], rotations[0], strict=True)])
        found.append(np.ptp(points[:, 1] / points[:, 0]))
    return np.array(found)


@pytest.mark.parametrize("heading_rad", [np.pi / 2, 0.7], ids=["from the side", "aslant"])
@pytest.mark.parametrize("seed", [0, 1])
def test_the_width_at_the_phase_is_the_median_over_a_stride(heading_rad: float, seed: int):
    one = gait(seed)
    drawn = float(one.start_phase[0])
    phase = median_width_phase(PERSON, gait(seed, len(PHASES)), START, heading_rad, 1.3, facing(0.0, EYE_M))
    over_stride = widths(PERSON, one, heading_rad, 100)
    assert np.interp(phase, np.arange(100) / 100, over_stride) == pytest.approx(np.median(over_stride), rel=0.02)
    # Four such phases in a stride are at most some quarter of it away.
    assert abs((phase - drawn + 0.5) % 1.0 - 0.5) < 0.2


def test_a_person_at_rest_keeps_the_drawn_phase():
    drawn = float(gait(2).start_phase[0])
    people = len(PHASES)
    assert median_width_phase(PERSON, gait(2, people), START, 0.0, 0.0, facing(0.0, EYE_M)) == drawn
    assert median_width_phase(PERSON, gait(2, people), START, 0.0, 1.3, facing(np.pi, EYE_M)) == drawn
