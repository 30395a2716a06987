"""The page of a studio on a viser server: picture, scene, controls, and curves of the last seconds."""

from __future__ import annotations

import contextlib
import math
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pftrack_sim.benchmark.asked.plan import TrackerSpec
from pftrack_sim.core.palette import GREY, Style, styles_of
from pftrack_sim.studio.controls import THEME, Controls
from pftrack_sim.studio.player import Player
from pftrack_sim.studio.scene_view import SceneView
from pftrack_sim.studio.session import Session
from pftrack_sim.studio.tracked import Moment

_PICTURES_HZ, _SCENE_HZ, _STATE_HZ = 30.0, 12.0, 4.0
_SIDE_PX = 300  # Width of the panel of settings
_LEAST_PX, _SHARE_OF_WINDOW = 420, 0.46  # Least width of the panel of the picture, and its share of the window

# Lets the picture fill its panel, as viser shows none larger than its pixels, and raises the contrast of texts.
_STYLE = """<style>
img[src^='blob:'] { width: 100% }
:root { --mantine-color-dimmed: #59616a !important; --mantine-color-blue-6: #1668b8 !important; }
:root[data-mantine-color-scheme='dark'] { --mantine-color-dimmed: #adadad !important; }
:root[data-mantine-color-scheme='dark'] [role='tab'][aria-selected='true'] span { color: #74c0fc; }
.mantine-Slider-markLabel, .mantine-Notification-description { color: var(--mantine-color-dimmed) !important; }
p.mantine-Text-root { opacity: 1 !important; }
</style>"""

_SPAN_S = 12.0
_TRUTH = "truth"
_HEIGHT_PX = 110
_SHARE = {"range": (-0.05, 1.2)}  # Of what lies in [0, 1], with room for a line at either end and for the label above


@dataclass(frozen=True)
class _Quantity:
    title: str
    read: Callable[[Moment], dict[str, float]]
    scale: Mapping[str, Any] = field(default_factory=dict[str, Any])


_QUANTITIES = (
    _Quantity("overlap", lambda moment: moment.overlaps, _SHARE),
    _Quantity("confidence", lambda moment: {name: one.confidence for name, one in moment.estimates.items()}, _SHARE),
    _Quantity("visible fraction", lambda moment: {_TRUTH: moment.truth.visible_fraction}, _SHARE),
    _Quantity(
        "time per frame [ms]",
        lambda moment: {name: ms or math.nan for name, ms in moment.ms.items()},
        {"distr": 3, "range": (0.1, 1000.0)},  # uPlot's logarithmic scale
    ),
    _Quantity("distance [m]", lambda moment: {_TRUTH: moment.truth.distance_m}),
)


class _Curves:
    """Plots of overlap, confidence, visible fraction, time per frame and distance, below the controls of `gui`."""

    def __init__(self, gui: Any) -> None:
        self._gui = gui
        self._plots: list[Any] = []
        self._names: list[tuple[str, ...]] = []

    def show(self, history: Sequence[Moment]) -> None:
        """Plot the last seconds of a history."""
        recent = [one for one in history if one.frame.time_s >= history[-1].frame.time_s - _SPAN_S]
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
        styles = styles_of(recent[-1].ms)
        self._plots = [
            self._gui.add_uplot(
                arrays,
                ({}, *(_line(name, styles.get(name, Style(GREY))) for name in found)),
                title=quantity.title,
                scales={"x": {"time": False}, "y": quantity.scale},
                legend={"show": quantity is _QUANTITIES[0], "live": False},
                height=_HEIGHT_PX,
            )
            for quantity, found, arrays in zip(_QUANTITIES, names, data, strict=True)
        ]
        self._names = names


def _line(name: str, style: Style) -> dict[str, Any]:
    look = {"stroke": style.hexadecimal, "dash": style.pattern, "width": 2, "points": {"show": False}}
    return {"label": name, **look}


class Page:
    """Shows a player's session to every client, and passes on what they do.

    What is drawn is the newest frame: a slow client, or drawing slower than the simulation, loses frames.
    `offered` trackers can be switched on.
    """

    def __init__(self, server: Any, player: Player, offered: Sequence[TrackerSpec]) -> None:
        self.player, self._server = player, server
        self._stop = threading.Event()
        gui = server.gui
        gui.configure_theme(**THEME)
        gui.add_html(_STYLE)
        self._picture = gui.add_image(player.moment.picture(), format="jpeg", jpeg_quality=85)
        self._state = gui.add_markdown("")
        panel = gui.add_panel()
        controls = self.controls = Controls(gui, panel, player, offered, lambda client: self._view.look_through(client))
        self._view = SceneView(server, controls.track, controls.click, controls.select_box)
        gui.main_panel.dock_left()
        panel.dock_right()
        panel.set_width(_SIDE_PX)
        server.on_client_connect(self._fit)
        self._curves = _Curves(gui)
        self._thread = threading.Thread(target=self._publish, name="pftrack-sim studio page", daemon=True)
        self._thread.start()

    def _fit(self, client: Any) -> None:
        """Give the picture about half of a client's window."""
        window_px = client.camera.image_width
        client.gui.main_panel.set_width(max(_LEAST_PX, _SHARE_OF_WINDOW * window_px))

    def close(self) -> None:
        """Stop publishing. Closing twice is fine."""
        self._stop.set()
        self._thread.join()

    def _publish(self) -> None:
        shown = self.controls.shown
        picture = shown.picture()
        placed: Moment | None = None  # shown in the scene, which is updated less often
        world, scene_s, state_s = -1, 0.0, 0.0
        while not self._stop.wait(1.0 / _PICTURES_HZ):
            self.controls.read_pad()
            moment, now_s = self.controls.shown, time.monotonic()
            if self.player.moment.world != world:
                with contextlib.suppress(TimeoutError):  # the session is busy: next time
                    world, placed = self._show_world(), None
                moment = self.controls.shown
            if moment is not shown:
                shown, picture = moment, moment.picture()
                self._picture.image = picture
                self.controls.show_time(shown)
            if shown is not placed and shown.world == world and now_s - scene_s > 1.0 / _SCENE_HZ:
                with self._server.atomic():
                    self._view.show(shown, picture)
                placed, scene_s = shown, now_s
            if now_s - state_s > 1.0 / _STATE_HZ:
                self._show_state()
                state_s = now_s

    def _show_world(self) -> int:
        """Show the compiled world of the present from above; the number of that world."""

        def describe(session: Session) -> tuple[Any, ...]:
            world = session.simulation.world
            return world.model, session.moment, session.people, world.path.points_m

        moment = self.player.moment
        if self.player.session.simulated:
            model, moment, people, path_m = self.player.ask(describe)
            self._view.build(model, moment, people, path_m)
            self.controls.set_people(people)
        else:
            self._view.build_recording(moment)
        place, towards = (tuple(point.tolist()) for point in self._view.overview())
        self._server.initial_camera.position, self._server.initial_camera.look_at = place, towards
        return moment.world

    def _show_state(self) -> None:
        player, session, moment = self.player, self.player.session, self.controls.shown
        history = list(session.history) or [moment]  # it is empty while the session restarts
        speed = f"{player.frames_per_s:.1f} frames/s" if player.playing else "paused"
        same = " · as saved" if session.exact else " · changed on the way; restart to see what is saved"
        self._state.content = f"{speed}{same if session.simulated else ''}"
        self.controls.show(history)
        self._curves.show(history)
        self._view.show_trail(np.array([one.truth.T_world_camera[:2, 3] for one in history[::8]]))
