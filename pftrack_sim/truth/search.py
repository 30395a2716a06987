"""Search for the people of one frame, run when their truth is first read."""

from __future__ import annotations

import mujoco

from pftrack_sim.core.types import FloatArray
from pftrack_sim.truth.silhouettes import Measured, Silhouette, SilhouetteFinder


class FrameSearch:
    """Silhouettes of the people in one frame; the poses of all geoms are kept until everybody is found.

    Arguments are those of `SilhouetteFinder.find`.
    """

    def __init__(
        self,
        finder: SilhouetteFinder,
        data: mujoco.MjData,
        T_world_camera: FloatArray,
        K: FloatArray,
        measured: Measured,
    ) -> None:
        self._finder, self._data, self._view = finder, data, (T_world_camera, K, measured)
        self._positions, self._rotations = data.geom_xpos.copy(), data.geom_xmat.copy()
        self._found: dict[int, Silhouette] = {}
        self._left = list(finder.batches)

    def silhouette(self, person: int) -> Silhouette | None:
        """Silhouette of a person; None for one without pixels in the image."""
        self._find([people for people in self._left if person in people])
        return self._found.get(person)

    def everybody(self) -> dict[int, Silhouette]:
        """Silhouettes by person."""
        self._find(self._left)
        return self._found

    def _find(self, batches: list[range]) -> None:
        if not batches:
            return
        data, self._left = self._data, [people for people in self._left if people not in batches]
        positions, rotations = data.geom_xpos.copy(), data.geom_xmat.copy()
        data.geom_xpos[:], data.geom_xmat[:] = self._positions, self._rotations
        try:
            with self._finder.renderer.drawing():
                for people in batches:
                    self._found.update(self._finder.find(data, *self._view, people))
        finally:
            data.geom_xpos[:], data.geom_xmat[:] = positions, rotations
        if not self._left:
            del self._data, self._positions, self._rotations
