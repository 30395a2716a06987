import math
from collections.abc import Callable

import mujoco
import numpy as np
import pytest

from pftrack_sim.core.proprioception import PROPRIO_NAMES, RANGE_ANGLES_RAD, RANGE_M, RANGES
from pftrack_sim.scene.layout import HIDDEN_GROUP, SCENERY_GROUP


def box(x: float, y: float, half: tuple[float, float], group: int = HIDDEN_GROUP) -> Callable[[mujoco.MjSpec], None]:
    def furnish(spec: mujoco.MjSpec) -> None:
        body = spec.worldbody.add_body(name="crate", pos=[x, y, 0.5])
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[*half, 0.5], group=group, contype=1, conaffinity=2)

    return furnish


def ranges(world) -> np.ndarray:
    return world.drive.proprio(world.data)[RANGES]


def test_names_are_in_the_order_of_the_beams():
    assert PROPRIO_NAMES[RANGES][0] == "range_00_m"
    assert len(PROPRIO_NAMES[RANGES]) == len(RANGE_ANGLES_RAD)
    assert RANGE_ANGLES_RAD[0] == -math.pi / 2
    assert RANGE_ANGLES_RAD[-1] == math.pi / 2


@pytest.mark.parametrize("height_m", [0.3, 1.25, 2.5])
def test_in_the_open_it_sees_nothing_and_never_itself(lab: Callable, height_m: float):
    world = lab(height_m=height_m)
    for command in ({}, {"forward": 1.6}, {"forward": -1.0, "turn": 1.5}, {"pan": 2.0}):
        world.run(0.4, **command)
        assert (ranges(world) > 4.0).all()


def test_a_wall_ahead_is_as_far_as_the_plane_s_equation_says(lab: Callable):
    ahead = ranges(lab(furnish=box(2.5, 0.0, (0.5, 4.0))))
    seen = np.abs(RANGE_ANGLES_RAD) < math.radians(60.0)
    np.testing.assert_allclose(ahead[seen], 2.0 / np.cos(RANGE_ANGLES_RAD[seen]), atol=0.01)


def test_left_is_left_and_far_is_unseen(lab: Callable):
    to_the_left = ranges(lab(furnish=box(0.0, 2.0, (0.3, 0.3))))
    assert abs(to_the_left[-1] - 1.7) < 0.01
    assert to_the_left[0] == RANGE_M
    assert (ranges(lab(furnish=box(RANGE_M + 1.0, 0.0, (0.5, 0.5)))) == RANGE_M).all()


def test_what_is_only_drawn_is_not_met(lab: Callable):
    assert (ranges(lab(furnish=box(2.0, 0.0, (0.3, 0.3), SCENERY_GROUP))) == RANGE_M).all()
