"""An episode from above: place, ways, people, and when and where something is planned."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.palette import COLOURS
from pftrack_sim.report.figure import drawn_figure
from pftrack_sim.scene.layout import Footprint
from pftrack_sim.simulation.overview import Overview

_TARGET, _ROBOT, _PEOPLE, _EVENT = (tuple(one / 255.0 for one in COLOURS[index]) for index in (2, 1, 4, 0))
_INCH_PER_M, _LEAST_INCH, _MOST_INCH = 0.28, 4.0, 14.0


def draw_from_above(found: Overview, title: str, target: Path) -> Path:
    """Write an SVG or PNG file.

    Raises:
        ParameterError: Another kind of file, or matplotlib is not installed.
        RunError: It cannot be written.
    """
    if target.suffix not in (".svg", ".png"):
        raise ParameterError(f"a map is an .svg or .png, got {target.name!r}")
    x_min, y_min, x_max, y_max = found.layout.bounds_m
    width, height = (min(max(_INCH_PER_M * side, _LEAST_INCH), _MOST_INCH) for side in (x_max - x_min, y_max - y_min))
    with drawn_figure(target, (width, height + 1.0), dpi=110) as figure:
        from matplotlib import patches

        axes = figure.add_subplot()
        axes.add_patch(patches.Rectangle((x_min, y_min), x_max - x_min, y_max - y_min, color="0.96", zorder=0))
        for footprint in found.layout.footprints:
            placed = footprint.name.startswith(("occluder", "seat-"))
            colour = _EVENT if placed else "0.7"
            axes.add_patch(patches.Polygon(_corners(footprint), color=colour, lw=0.4, ec="0.35", zorder=1))
        for event in found.events:
            line = np.array([event.camera_m, event.target_m])
            axes.plot(*line.T, ":", color=_EVENT, lw=1.0, zorder=3)
            axes.annotate(event.title, event.target_m, (4, 6), textcoords="offset points", fontsize=7, color=_EVENT)
        _way(axes, found.path_m, _TARGET, "target")
        if found.run is not None:
            _way(axes, found.run.robot_m, _ROBOT, "robot")
        if found.people_m:
            axes.plot(*np.array(found.people_m).T, "o", color=_PEOPLE, ms=5, label="others, at first", zorder=4)
        axes.set_aspect("equal")
        axes.set(xlabel="x [m]", ylabel="y [m]", title=title)
        axes.margins(0.02)
        figure.legend(loc="outside lower center", ncols=3, frameon=False)
    return target


def _way(axes: Any, points_m: Any, colour: tuple[float, ...], label: str) -> None:
    """A way with a dot at its begin and an arrow at its end."""
    if len(points_m) < 2:
        return
    axes.plot(*points_m.T, color=colour, lw=1.8, label=label, zorder=5)
    axes.plot(*points_m[0], "o", color=colour, ms=6, zorder=6)
    step = {"arrowstyle": "-|>", "color": colour, "lw": 1.8}
    away = np.flatnonzero(np.hypot(*(points_m - points_m[-1]).T) > 0.3)
    if len(away):
        axes.annotate("", points_m[-1], points_m[away[-1]], arrowprops=step, zorder=6)


def _corners(footprint: Footprint) -> Any:
    cosine, sine = np.cos(footprint.yaw_rad), np.sin(footprint.yaw_rad)
    unit = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * footprint.half_m
    return unit @ np.array([[cosine, sine], [-sine, cosine]]) + footprint.centre_m
