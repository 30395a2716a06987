"""Measurements and search of the people of one frame, made when their truth is first read."""

from __future__ import annotations

import mujoco

from pftrack_sim.core.types import FloatArray
from pftrack_sim.truth.silhouettes import GeomPoses, Measured, Silhouette, SilhouetteFinder


class FrameView:
    """What one frame's camera sees: its first person, and all bodies, measured when they are first asked for.

    Arguments are those of `SilhouetteFinder.measure`.
    """

    def __init__(
        self, finder: SilhouetteFinder, data: mujoco.MjData, T_world_camera: FloatArray, K: FloatArray
    ) -> None:
        self.finder, self.T_world_camera, self.K = finder, T_world_camera, K
        self.first = finder.measure_first(data, T_world_camera, K)
        """The first person, then the bodies of which only boxes are wanted."""
        self.poses = GeomPoses(data.geom_xpos.copy(), data.geom_xmat.copy())
        self._all: Measured | None = None

    @property
    def all(self) -> Measured:
        """All bodies."""
        if self._all is None:
            self._all = self.finder.measure(self.poses, self.T_world_camera, self.K)
        return self._all

    def release(self) -> None:
        """Release the poses, once everybody has been found."""
        _ = self.all
        del self.poses


class FrameSearch:
    """Silhouettes of the people in one frame; the poses of all geoms are kept until everybody is found.

    Args:
        data: In which the poses are restored for a search.
        view: Of the frame.
        before: Of the frame before, of which boxes are still wanted; None for the first frame.
    """

    def __init__(self, data: mujoco.MjData, view: FrameView, before: FrameView | None) -> None:
        self._finder, self._data, self._view, self._before = view.finder, data, view, before
        self._found: dict[int, Silhouette] = {}
        self._left = list(view.finder.batches)

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
        data, view, self._left = self._data, self._view, [people for people in self._left if people not in batches]
        positions, rotations = data.geom_xpos.copy(), data.geom_xmat.copy()
        data.geom_xpos[:], data.geom_xmat[:] = view.poses
        try:
            with self._finder.renderer.drawing():
                for people in batches:
                    measured = view.first if people == range(1) else view.all
                    self._found.update(self._finder.find(data, view.T_world_camera, view.K, measured, people))
        finally:
            data.geom_xpos[:], data.geom_xmat[:] = positions, rotations
        if not self._left:
            view.release()
            if self._before is not None:
                _ = self._before.all
            del self._data, self._before
