"""Width of a walking person's box over a stride, from a camera's point of view.

Seen from the side the width swings by a factor of 2: a box selected at an unlucky moment has a width that the person
seldom has again.
"""

from __future__ import annotations

import numpy as np

from pftrack_sim.agents.gait.gait import Gait
from pftrack_sim.camera.extents import Bodies
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scene.people.person import Person, part_meshes

_PHASES = np.arange(48) / 48
_NEAR_M = 0.05


def median_width_phase(
    person: Person, gait: Gait, position_m: FloatArray, heading_rad: float, speed_m_s: float, T_world_camera: FloatArray
) -> float:
    """Gait phase at which the box of a person in a steady walk has its median width over a stride.

    Of the phases with this width, it is the one nearest to the start phase of the gait; that phase itself where the
    width is constant, as at rest, or where the person is not in front of the camera.

    Args:
        person: The person.
        gait: That of this person alone; it is reset.
        position_m: `(2,)` x, y on the ground.
        heading_rad: Direction of the walk.
        speed_m_s: Walking speed.
        T_world_camera: `(4, 4)` camera pose.
    """
    bodies = Bodies([[mesh.vertices for mesh in part_meshes(person).values()]])
    drawn, widths = float(gait.feet.start_phase[0]), np.empty(len(_PHASES))
    for index, phase in enumerate(_PHASES):
        gait.feet.start_phase[:] = phase
        gait.reset(position_m[None], [heading_rad], [speed_m_s])
        positions, rotations = gait.part_poses()
        extents, _ = bodies.extents(positions[0], rotations[0], T_world_camera, _NEAR_M)
        widths[index] = extents[:, 2].max() - extents[:, 0].min()
    excess = widths - np.median(widths)
    following = np.roll(excess, -1)
    crossing = np.flatnonzero((excess < 0.0) != (following < 0.0))
    if not crossing.size:
        return drawn
    share = excess[crossing] / (excess[crossing] - following[crossing])
    found = (_PHASES[crossing] + share / len(_PHASES)) % 1.0
    return float(found[np.abs((found - drawn + 0.5) % 1.0 - 0.5).argmin()])
