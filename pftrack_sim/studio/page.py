"""The page of a studio: picture, curves, scene and controls, on a viser server."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from pftrack_sim.benchmark.asked.plan import TrackerSpec
from pftrack_sim.studio.controls import Controls
from pftrack_sim.studio.curves import Curves
from pftrack_sim.studio.player import Player
from pftrack_sim.studio.scene_view import SceneView
from pftrack_sim.studio.session import Session
from pftrack_sim.studio.tracked import Moment

_PICTURES_HZ, _SCENE_HZ, _STATE_HZ = 30.0, 12.0, 4.0


class Page:
    """Shows a player's session to every client, and passes on what they do.

    What is drawn is the newest frame: a slow client, or drawing slower than the simulation, loses frames.

    Args:
        server: The viser server.
        player: The player.
        offered: Trackers that can be switched on.
    """

    def __init__(self, server: Any, player: Player, offered: Sequence[TrackerSpec]) -> None:
        self.player, self._server = player, server
        self._stop = threading.Event()
        gui = server.gui
        gui.configure_theme(show_logo=False, show_share_button=False)
        gui.main_panel.dock_right()
        gui.main_panel.set_width(340)
        controls = self.controls = Controls(gui, player, offered, lambda client: self._view.look_through(client))
        self._view = SceneView(server, controls.track, controls.click, controls.select_box)
        panel = gui.add_panel()
        tab = panel.add_tab("Camera")
        panel.dock_left()
        panel.set_width(min(700, max(360, controls.shown.frame.image.shape[1] + 40)))
        with tab:
            self._picture = gui.add_image(controls.shown.picture(), format="jpeg", jpeg_quality=85)
            self._state = gui.add_markdown("")
        self._curves = Curves(gui, tab)
        self._thread = threading.Thread(target=self._publish, name="pftrack-sim studio page", daemon=True)
        self._thread.start()

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
            if shown is not placed and shown.world == world and now_s - scene_s > 1.0 / _SCENE_HZ:
                with self._server.atomic():
                    self._view.show(shown, picture)
                placed, scene_s = shown, now_s
            if now_s - state_s > 1.0 / _STATE_HZ:
                self._show_state()
                state_s = now_s

    def _show_world(self) -> int:
        """Show the compiled world of the present."""
        if not self.player.session.simulated:
            self._view.build_recording(self.player.moment)
            self._look_at_overview()
            return self.player.moment.world

        def describe(session: Session) -> tuple[Any, ...]:
            path_m = session.simulation.settings.target.path_m
            return session.simulation.world.model, session.moment, session.people, np.array(path_m)

        model, moment, people, path_m = self.player.ask(describe)
        self._view.build(model, moment, people, path_m)
        self.controls.set_people(people)
        self._look_at_overview()
        return moment.world

    def _look_at_overview(self) -> None:
        place, towards = (tuple(point.tolist()) for point in self._view.overview())
        self._server.initial_camera.position, self._server.initial_camera.look_at = place, towards

    def _show_state(self) -> None:
        player, session, moment = self.player, self.player.session, self.controls.shown
        history = list(session.history) or [moment]  # it is empty while the session restarts
        speed = f"{player.frames_per_s:.1f} frames/s" if player.playing else "paused"
        same = " · as saved" if session.exact else " · changed on the way; restart to see what is saved"
        self._state.content = f"**{moment.frame.time_s:.2f} s** · {speed}{same if session.simulated else ''}"
        self.controls.show(history)
        self._curves.show(history)
        self._view.show_trail(np.array([one.truth.T_world_camera[:2, 3] for one in history[::8]]))
