"""The page of a studio: pictures, curves, the scene, and what can be changed, on a viser server."""

from __future__ import annotations

import contextlib
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from pftrack_sim import scenario as scenarios
from pftrack_sim.benchmark.plan import TrackerSpec
from pftrack_sim.core.text import one_line
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scenario.axes import axes_by_name
from pftrack_sim.simulation.simulation import LIVE_AXES
from pftrack_sim.studio.curves import Curves
from pftrack_sim.studio.game_pad import GamePad
from pftrack_sim.studio.player import Player
from pftrack_sim.studio.scene_view import SceneView
from pftrack_sim.studio.session import Session
from pftrack_sim.studio.settings import HAND, Settings, drivers
from pftrack_sim.studio.tracked import Moment, TrackedSession

_PICTURES_HZ, _SCENE_HZ, _STATE_HZ = 30.0, 12.0, 4.0
_SPEEDS = {"0.1": 0.1, "0.25": 0.25, "0.5": 0.5, "1": 1.0, "2": 2.0, "as fast as possible": 1e6}
_STEP = 0.25
_KEYS = {"W": (0, 1), "S": (0, -1), "A": (1, 1), "D": (1, -1), "Q": (2, 1), "E": (2, -1), "R": (3, 1), "F": (3, -1)}
"""Which part of the command (forward, turn, pan, tilt) a key raises or lowers by `_STEP`."""

_KEYS_HELP = "W/S forward, A/D turn, Q/E pan, R/F tilt, X stop; or a game pad."


class Page:
    """Shows a player's session to every client, and passes on what they do.

    What is drawn is the newest frame: a slow client, or drawing slower than the simulation, loses frames.

    Args:
        server: The viser server.
        player: The player.
        offered: Trackers that can be switched on.
    """

    def __init__(self, server: Any, player: Player, offered: Sequence[TrackerSpec]) -> None:
        self.player, self._server, self._gui = player, server, server.gui
        self._offered = {one.label: one for one in (*player.session.settings.trackers, *offered)}
        self._past: Moment | None = None
        self._pad = GamePad()
        self._wanted: dict[str, float] = {}
        """Values of sliders that the session has not taken yet."""
        self._lock = threading.Lock()
        self._synchronised: Settings | None = player.session.settings
        """Settings that the controls show."""
        self._stop = threading.Event()
        self._view = SceneView(server, self._track, self._click, self._select_box)
        gui = self._gui
        gui.configure_theme(show_logo=False, show_share_button=False)
        gui.main_panel.dock_right()
        gui.main_panel.set_width(340)
        panel = gui.add_panel()
        tab = panel.add_tab("Camera")
        panel.dock_left()
        panel.set_width(min(700, max(360, self.shown.frame.image.shape[1] + 40)))
        with tab:
            self._picture = gui.add_image(self.shown.picture(), format="jpeg", jpeg_quality=85)
            self._state = gui.add_markdown("")
        self._curves = Curves(gui, tab)
        self._add_controls()
        self._thread = threading.Thread(target=self._publish, name="pftrack-sim studio page", daemon=True)
        self._thread.start()

    @property
    def shown(self) -> Moment:
        """The moment on the page: the present, or one of the past while paused."""
        return self._past or self.player.moment

    def close(self) -> None:
        """Stop publishing. Closing twice is fine."""
        self._stop.set()
        self._thread.join()

    def _publish(self) -> None:
        shown = self.shown
        picture = shown.picture()
        placed: Moment | None = None  # shown in the scene, which is updated less often
        world, scene_s, state_s = -1, 0.0, 0.0
        while not self._stop.wait(1.0 / _PICTURES_HZ):
            self._read_pad()
            moment, now_s = self.shown, time.monotonic()
            if self.player.moment.world != world:
                with contextlib.suppress(TimeoutError):  # the session is busy: next time
                    world, placed = self._show_world(), None
                moment = self.shown
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
        self._person.options = people
        self._look_at_overview()
        return moment.world

    def _look_at_overview(self) -> None:
        place, towards = (tuple(point.tolist()) for point in self._view.overview())
        self._server.initial_camera.position, self._server.initial_camera.look_at = place, towards

    def _show_state(self) -> None:
        player, session = self.player, self.player.session
        moment, settings = self.shown, session.settings
        history = list(session.history) or [moment]  # it is empty while the session restarts
        speed = f"{player.frames_per_s:.1f} frames/s" if player.playing else "paused"
        same = " · as saved" if session.exact else " · changed on the way; restart to see what is saved"
        self._state.content = f"**{moment.frame.time_s:.2f} s** · {speed}{same if session.simulated else ''}"
        lines = [one_line(line) for line in (player.status, *session.errors) if line]
        self._status.content = "\n\n".join(lines) or "Drag to orbit; click a person to track that person."
        self._play.label = "Pause" if player.playing else "Play"
        if session.simulated:
            self._person.value = session.person
        if player.playing:
            self._past = None
        first_s, last_s = (round(one.frame.time_s, 3) for one in (history[0], history[-1]))
        # Also after the last frame, which ends the playing.
        if self._past is None and last_s > first_s and self._scrub.max != last_s:
            self._scrub.min, self._scrub.max, self._scrub.value = first_s, last_s, last_s
        if settings is not self._synchronised and not self._wanted:
            # Not after a slider was moved: it may have moved on since.
            self._synchronised = settings
            for axis, slider in self._sliders.items():
                slider.value = min(slider.max, settings.physical(axis))
            for handle, value in zip(self._choices, (settings.name, settings.seed, settings.driver), strict=False):
                handle.value = value
            on = [one.label for one in settings.trackers]
            for label, box in self._boxes.items():
                box.value = label in on
        self._curves.show(history)
        self._view.show_trail(np.array([one.truth.T_world_camera[:2, 3] for one in history[::8]]))

    def _add_controls(self) -> None:
        gui, settings = self._gui, self.player.session.settings
        self._status = gui.add_markdown("")
        self._play = gui.add_button("Play")
        _when(self._play.on_click, self._toggle)
        _when(gui.add_button("Step").on_click, self._step)
        self._scrub = gui.add_slider("Time [s]", 0.0, 1.0, 0.001, 0.0, hint="Look back while paused.")
        _when(self._scrub.on_update, self._look_back)
        here = gui.add_button("Restart from here", hint="From the time above on, with these settings.")
        _when(here.on_click, lambda: self._restart(self.shown))
        _when(gui.add_button("Restart from the beginning").on_click, lambda: self._restart(None))
        draw = gui.add_button("Draw a box", hint="Pause, look through the camera, and start all trackers with a box.")
        draw.on_click(self._look_through)
        speed = gui.add_dropdown("Speed", tuple(_SPEEDS), initial_value="1")
        _when(speed.on_update, lambda: setattr(self.player, "speed", _SPEEDS[speed.value]))
        simulated = self.player.session.simulated
        self._choices: tuple[Any, ...] = ()
        self._sliders: dict[str, Any] = {}
        if simulated:
            with gui.add_folder("Scenario"):
                self._add_scenario(settings)
        with gui.add_folder("Trackers"):
            on = [one.label for one in settings.trackers]
            self._boxes = {label: self._add_tracker(label, label in on) for label in self._offered}
        if simulated:
            with gui.add_folder("Stress axes"):
                self._sliders = {axis: self._add_axis(axis, settings) for axis in axes_by_name()}
        with gui.add_folder("Save as"):
            gui.add_button("Picture").on_click(self._save_picture)
            gui.add_button("Last ten seconds").on_click(self._save_clip)
            if simulated:
                gui.add_button("Scenario (TOML)").on_click(self._save_toml)
                _when(gui.add_button("Command line").on_click, self._show_command)
        _when(gui.add_command("Play or pause", hotkey="P").on_trigger, self._toggle)
        if simulated:
            self._add_keys()

    def _add_keys(self) -> None:
        gui = self._gui
        for key, (part, sign) in _KEYS.items():
            command = gui.add_command(f"Drive: {key}", description=_KEYS_HELP, hotkey=key)
            _when(command.on_trigger, partial(self._key, part, sign))
        _when(gui.add_command("Drive: stop", hotkey="X").on_trigger, partial(self._key, None, 0))

    def _add_scenario(self, settings: Settings) -> None:
        gui, shipped = self._gui, scenarios.names()
        names = shipped if settings.name in shipped else [settings.name, *shipped]
        name = gui.add_dropdown("Scenario", names, initial_value=settings.name)
        seed = gui.add_number("Seed", settings.seed, min=0, max=2**31 - 1, step=1)
        driver = gui.add_dropdown("Robot", drivers(), initial_value=settings.driver, hint=f"hand: {_KEYS_HELP}")
        self._person = gui.add_dropdown("Tracked", self.player.session.people)

        def other(old: Settings) -> Settings:
            kept = old.overrides if name.value == old.name else _shared(old)
            return replace(old, name=name.value, seed=int(seed.value), overrides=kept, driver=driver.value)

        self._choices = (name, seed, driver)
        for handle in self._choices:
            _when(handle.on_update, lambda: self._change(other))
        _when(self._person.on_update, lambda: self._track(self._person.value))

    def _add_tracker(self, label: str, on: bool) -> Any:
        box = self._gui.add_checkbox(label, on)

        def switched(old: Settings) -> Settings:
            others = tuple(one for one in old.trackers if one.label != label)
            return replace(old, trackers=(*others, self._offered[label]) if box.value else others)

        _when(box.on_update, lambda: self._change(switched))
        return box

    def _add_axis(self, name: str, settings: Settings) -> Any:
        axis, top = axes_by_name()[name], float(f"{settings.strongest(name):.3g}")
        acts = "Acts from the next frame on." if name in LIVE_AXES else "Restarts the episode at the same time."
        slider = self._gui.add_slider(
            f"{name} [{axis.unit}]", 0.0, top, top / 80, min(top, settings.physical(name)), hint=f"{acts} {axis.law}."
        )

        def moved() -> None:
            with self._lock:
                first = not self._wanted
                self._wanted[name] = float(slider.value)
            if first:
                self.player.request(self._take_axes)

        _when(slider.on_update, moved)
        return slider

    def _take_axes(self, session: Session) -> str:
        """Apply the newest values of all sliders that were moved: those in between are skipped."""
        with self._lock:
            wanted, settings = dict(self._wanted), session.settings
        for name, value in wanted.items():
            settings = settings.with_axis(name, value)
        try:
            said = session.change(settings)
            self._synchronised = settings
        except BaseException:
            self._synchronised = None
            raise
        finally:
            # Only now, so that no slider jumps back to what the session had before.
            with self._lock:
                self._wanted = {name: value for name, value in self._wanted.items() if wanted.get(name) != value}
            if self._wanted:
                self.player.request(self._take_axes)
        return said

    def _change(self, changed: Callable[[Settings], Settings]) -> None:
        def change(session: Session) -> str:
            try:
                return session.change(changed(session.settings))
            finally:
                self._synchronised = None  # the page shows what was taken, which may be nothing

        self.player.request(change)

    def _toggle(self) -> None:
        self._past = None
        self.player.playing = not self.player.playing

    def _step(self) -> None:
        self._past, self.player.playing = None, False
        self.player.request(lambda session: session.advance() and None)

    def _restart(self, moment: Moment | None) -> None:
        self._past = None

        def restart(session: TrackedSession) -> str:
            session.restart(moment)
            return f"Restarted at {session.moment.frame.time_s:.2f} s; trackers start anew."

        self.player.request(restart)

    def _look_back(self) -> None:
        if self.player.playing:
            return
        time_s = float(self._scrub.value)
        history = list(self.player.session.history) or [self.player.moment]
        self._past = min(history, key=lambda one: abs(one.frame.time_s - time_s))

    def _track(self, person: str) -> None:
        def select(session: Session) -> str:
            session.select(person)
            return f"Tracking {person}."

        self._past = None
        self.player.request(select)

    def _click(self, x: float, y: float) -> None:
        moment, session = self.shown, self.player.session
        if not isinstance(session, Session):
            return
        height, width = moment.frame.image.shape[:2]
        person = session.person_at(moment, x * width, y * height)
        if person is not None:
            self._track(person)

    def _look_through(self, event: Any) -> None:
        self._past, self.player.playing = None, False
        self._view.look_through(event.client)
        self.player.status = "Hold Shift and drag a box over the picture in the 3D view."

    def _select_box(self, shares: FloatArray) -> None:
        def select(session: TrackedSession) -> str:
            height, width = session.moment.frame.image.shape[:2]
            return session.select_box(shares * (width, height, width, height))

        self._past = None
        self.player.request(select)

    def _key(self, part: int | None, sign: int) -> None:
        def press(session: Session) -> str:
            if session.settings.driver != HAND:
                return "Keys drive the robot while it is driven by hand."
            session.hand = np.zeros(4) if part is None else session.hand.copy()
            if part is not None:
                session.hand[part] = min(1.0, max(-1.0, session.hand[part] + sign * _STEP))
            return _by_hand(session)

        self.player.request(press)

    def _read_pad(self) -> None:
        if self.player.session.settings.driver != HAND:
            return
        command = self._pad.read()
        if command is None:
            return

        def drive(session: Session) -> str:
            session.hand = command
            return _by_hand(session)

        self.player.request(drive)

    def _save_picture(self, event: Any) -> None:
        coded = cv2.imencode(".png", cv2.cvtColor(self.shown.picture(), cv2.COLOR_RGB2BGR))[1]
        event.client.send_file_download("studio.png", coded.tobytes(), save_immediately=True)

    def _save_clip(self, event: Any) -> None:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "studio.mp4"
            self.player.ask(lambda session: session.save_clip(path))
            event.client.send_file_download("studio.mp4", path.read_bytes(), save_immediately=True)

    def _save_toml(self, event: Any) -> None:
        text = self.player.session.settings.toml()
        event.client.send_file_download("studio.toml", text.encode(), save_immediately=True)

    def _show_command(self) -> None:
        self.player.status = f"`{self.player.session.settings.command_line()}`"


def _when(register: Any, action: Callable[[], object]) -> None:
    """Call an action when a client does something, and not when this side sets a value."""

    def happened(event: Any) -> None:
        if event.client_id is not None:
            action()

    register(happened)


def _by_hand(session: Session) -> str:
    forward, turn, pan, tilt = session.hand
    return f"By hand: forward {forward:+.2f}, turn {turn:+.2f}, pan {pan:+.2f}, tilt {tilt:+.2f}."


def _shared(settings: Settings) -> dict[str, Any]:
    """Overrides that go on in another scenario: the camera's size and the stress axes."""
    return {key: value for key, value in settings.overrides.items() if key.split(".")[0] in ("camera", "axes")}
