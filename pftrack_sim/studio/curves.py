"""Live curves of the last seconds, one plot per quantity."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pftrack_sim.core.palette import colours_of
from pftrack_sim.studio.tracked import Moment

SPAN_S = 12.0
_TRUTH = "truth"
_HEIGHT_PX = 110
_SHARE = (-0.05, 1.2)
"""Limits of what lies in [0, 1], with room for a line at either end and for the label above."""


@dataclass(frozen=True)
class _Quantity:
    title: str
    read: Callable[[Moment], dict[str, float]]
    limits: tuple[float, float] | None = None
    log: bool = False


_QUANTITIES = (
    _Quantity("overlap", lambda moment: moment.overlaps, _SHARE),
    _Quantity("confidence", lambda moment: {name: one.confidence for name, one in moment.estimates.items()}, _SHARE),
    _Quantity("visible fraction", lambda moment: {_TRUTH: moment.truth.visible_fraction}, _SHARE),
    _Quantity(
        "time per frame [ms]",
        lambda moment: {name: ms or math.nan for name, ms in moment.ms.items()},
        (0.1, 1000.0),
        log=True,
    ),
    _Quantity("distance [m]", lambda moment: {_TRUTH: moment.truth.distance_m}),
)


class Curves:
    """Plots of overlap, confidence, visible fraction, time per frame and distance.

    Args:
        gui: The viser server's GUI.
        tab: Tab of it that holds the plots.
    """

    def __init__(self, gui: Any, tab: Any) -> None:
        self._gui, self._tab = gui, tab
        self._plots: list[Any] = []
        self._names: list[tuple[str, ...]] = []

    def show(self, history: Sequence[Moment]) -> None:
        """Plot the last seconds of a history."""
        recent = [one for one in history if one.frame.time_s >= history[-1].frame.time_s - SPAN_S]
        if len(recent) < 2:
            return
        values = [[quantity.read(one) for one in recent] for quantity in _QUANTITIES]
        names = [tuple(dict.fromkeys(name for one in read for name in one)) or (_TRUTH,) for read in values]
        times = np.array([one.frame.time_s for one in recent])
        data = [
            (times, *(np.array([one.get(name, math.nan) for one in read]) for name in found))
            for read, found in zip(values, names, strict=True)
        ]
        if names == self._names:
            for plot, arrays in zip(self._plots, data, strict=True):
                plot.data = arrays
            return
        for plot in self._plots:
            plot.remove()
        colours = colours_of(recent[-1].ms)
        with self._tab:
            self._plots = [
                self._gui.add_uplot(
                    arrays,
                    ({"label": "s"}, *(_line(name, colours.get(name, (90, 90, 90))) for name in found)),
                    title=quantity.title,
                    scales={"x": {"time": False}, "y": _scale(quantity)},
                    legend={"show": quantity is _QUANTITIES[0]},
                    height=_HEIGHT_PX,
                )
                for quantity, found, arrays in zip(_QUANTITIES, names, data, strict=True)
            ]
        self._names = names


def _scale(quantity: _Quantity) -> dict[str, Any]:
    """UPlot's options: 3 is its logarithmic scale."""
    return {
        **({"distr": 3} if quantity.log else {}),
        **({"range": quantity.limits} if quantity.limits else {}),
    }


def _line(name: str, colour: tuple[int, int, int]) -> dict[str, Any]:
    return {"label": name, "stroke": f"rgb{colour}", "width": 2, "points": {"show": False}}
