"""Random commands in a small room: the robot collides with everything, and stays upright and bounded."""

from collections.abc import Callable

import mujoco
import numpy as np
import pytest

ROOM_M = 2.5
TICK_S = 1.0 / 60.0


def room(spec: mujoco.MjSpec) -> None:
    """Four thin walls and a post."""
    for name, at, half in (
        ("north", (0.0, ROOM_M), (ROOM_M, 0.05)),
        ("south", (0.0, -ROOM_M), (ROOM_M, 0.05)),
        ("east", (ROOM_M, 0.0), (0.05, ROOM_M)),
        ("west", (-ROOM_M, 0.0), (0.05, ROOM_M)),
        ("post", (1.2, 1.0), (0.1, 0.1)),
    ):
        body = spec.worldbody.add_body(name=name, pos=[*at, 0.75])
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[*half, 0.75], contype=1, conaffinity=2)


@pytest.mark.parametrize(("seconds", "seed"), [(30.0, 0), pytest.param(600.0, 1, marks=pytest.mark.slow)])
def test_random_commands_held_for_random_times(lab: Callable, seconds: float, seed: int):
    world, rng = lab(furnish=room), np.random.default_rng(seed)
    model, data, drive = world.model, world.data, world.drive
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    mass = float(model.body_subtreemass[0])
    fastest = drive.limits[0] + 0.25 * drive.limits[1]
    touched = 0
    command, left = np.zeros(4), 0.0
    for _ in range(round(seconds / TICK_S)):
        if left <= 0.0:
            command, left = rng.choice([-1.0, -0.4, 0.3, 1.0], 4) * drive.limits, rng.uniform(0.1, 2.5)
        left -= TICK_S
        world.tick(*command.tolist())
        mujoco.mj_energyVel(model, data)
        mujoco.mj_subtreeVel(model, data)
        touched += drive.collision(data) is not None
        assert np.isfinite(data.qpos).all()
        assert np.isfinite(data.qvel).all()
        x, y, _ = drive.pose(data)
        assert max(abs(x), abs(y)) < ROOM_M - 0.2  # the hull is 0.245 m wide: it does not pass through
        # Twice the kinetic energy at highest speed bounds it: wheels and head add their own.
        assert data.energy[1] < mass * fastest**2
        momentum = mass * np.linalg.norm(data.subtree_linvel[drive._base])
        assert momentum < 1.5 * mass * fastest
        up = data.xmat[drive._base].reshape(3, 3)[2, 2]
        assert up > 0.85  # 32 degrees: it does not fall over
        assert -0.06 < data.xpos[drive._base, 2] < 0.12
    assert touched > seconds / 10.0
    # At zero command it comes to rest.
    world.run(4.0)
    assert np.abs(data.qvel).max() < 0.05
