"""An episode as a story: what the camera sees, beside it the place from above, and how it goes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import cv2
import mujoco
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon, Wedge

from pftrack_sim.core.palette import styles_of
from pftrack_sim.core.records import Estimate, Frame, Image
from pftrack_sim.render.overlay import draw_boxes

CAMERA_PX, SIDE_PX, HEIGHT_PX = 720, 240, 540
_DPI = 120
_WINDOW_M = 5.5  # From the middle of the map to its sides
_INK, _PAPER, _WALL, _PERSON, _TARGET = "#e8e6e1", "#17191d", "#4a5058", "#9aa0a6", "#ffffff"
_TRUNK_M = 0.28  # Radius of people on the map, larger than life


class Story:
    """Sheets of one episode, 960 x 540.

    Args:
        model: That of the scene, whose solid things are on the map.
        labels: Names of curves; those of trackers have their colours.
        span_s: Begin and end of the time axis.
        limits: Of the curves' axis.
        title: What the curves are.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        labels: Sequence[str],
        span_s: tuple[float, float],
        limits: tuple[float, float],
        title: str,
    ) -> None:
        styles = styles_of(labels)
        self._colours = {label: tuple(channel / 255 for channel in styles[label].colour) for label in labels}
        self._figure = Figure(figsize=(SIDE_PX / _DPI, HEIGHT_PX / _DPI), dpi=_DPI, facecolor=_PAPER)
        self._canvas = FigureCanvasAgg(self._figure)
        self._map = self._figure.add_axes((0.04, 0.45, 0.92, 0.53), facecolor="#24282e", aspect="equal")
        self._curves = self._figure.add_axes((0.16, 0.09, 0.78, 0.27), facecolor=_PAPER)
        self._trail: list[tuple[float, float]] = []
        self._times: list[float] = []
        self._values: dict[str, list[float]] = {label: [] for label in labels}
        self._moving: list[Any] = []
        self._draw_place(model)
        self._lines = {
            label: self._curves.plot([], [], color=self._colours[label], linewidth=1.6, solid_capstyle="round")[0]
            for label in labels
        }
        self._curves.set(xlim=span_s, ylim=limits)
        self._curves.set_title(title, color=_INK, fontsize=8, loc="left", pad=4)
        self._curves.set_xlabel("seconds", color=_INK, fontsize=7, labelpad=1)
        self._curves.tick_params(colors=_INK, labelsize=7, length=2)
        for side in ("top", "right"):
            self._curves.spines[side].set_visible(False)
        for side in ("left", "bottom"):
            self._curves.spines[side].set_color(_WALL)

    def sheet(self, frame: Frame, estimates: Mapping[str, Estimate], values: Mapping[str, float]) -> Image:
        """`(540, 960, 3)` picture of a frame with boxes, the map, and the curves so far."""
        seen = draw_boxes(frame.image, frame.truth, estimates, particles=False)
        if seen.shape[:2] != (HEIGHT_PX, CAMERA_PX):
            seen = cv2.resize(seen, (CAMERA_PX, HEIGHT_PX), interpolation=cv2.INTER_CUBIC)
        self._move(frame)
        self._times.append(frame.time_s)
        for label, value in values.items():
            self._values[label].append(value)
            self._lines[label].set_data(self._times, self._values[label])
        if frame.truth.visible_fraction < 0.5 and len(self._times) > 1:
            self._curves.axvspan(self._times[-2], self._times[-1], color=_WALL, linewidth=0, zorder=0)
        self._canvas.draw()
        return np.hstack([seen, np.asarray(self._canvas.buffer_rgba())[..., :3]])

    def _draw_place(self, model: mujoco.MjModel) -> None:
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        solid = (model.geom_contype != 0) & (model.geom_type != mujoco.mjtGeom.mjGEOM_PLANE)
        fixed = model.body_weldid[model.geom_bodyid] == 0
        for geom in np.flatnonzero(solid & fixed).tolist():
            middle, half = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
            rotation = data.geom_xmat[geom].reshape(3, 3)
            corners = [middle + half * (x, y, 0.0) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
            outline = [(data.geom_xpos[geom] + rotation @ corner)[:2] for corner in corners]
            self._map.add_patch(Polygon(outline, facecolor=_WALL, edgecolor="none"))
        self._map.set_axis_off()
        self._map.add_patch(
            Polygon([(0, 0), (1, 0), (1, 1), (0, 1)], transform=self._map.transAxes, fill=False, edgecolor=_WALL)
        )
        (self._path,) = self._map.plot([], [], color=_TARGET, linewidth=1.2, alpha=0.6, zorder=2)

    def _move(self, frame: Frame) -> None:
        for artist in self._moving:
            artist.remove()
        camera, truth = frame.truth.T_world_camera, frame.truth
        eye, ahead = camera[:2, 3], math.degrees(math.atan2(camera[1, 2], camera[0, 2]))
        half = math.degrees(math.atan2(truth.K[0, 2], truth.K[0, 0]))
        place = truth.T_world_target[:2, 3]
        self._trail.append((float(place[0]), float(place[1])))
        self._path.set_data(*zip(*self._trail, strict=True))
        self._moving = [
            Wedge(tuple(eye), 30.0, ahead - half, ahead + half, facecolor=_INK, alpha=0.12, edgecolor="none", zorder=1),
            Circle(tuple(eye), 0.25, facecolor="#f0c040", edgecolor="none", zorder=4),
            *(
                Circle(tuple(one.T_world_target[:2, 3]), _TRUNK_M, facecolor=_PERSON, edgecolor="none", zorder=3)
                for one in frame.people
                if one.name != truth.name
            ),
            Circle(tuple(place), _TRUNK_M, facecolor=_TARGET, edgecolor="none", zorder=4),
        ]
        for artist in self._moving:
            self._map.add_patch(artist)
        middle = 0.5 * (eye + place)
        self._map.set(xlim=(middle[0] - _WINDOW_M, middle[0] + _WINDOW_M), ylim=(middle[1] - 6.9, middle[1] + 6.9))
