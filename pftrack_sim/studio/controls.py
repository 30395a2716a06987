"""The controls of a studio's page: what a client changes is passed on to the player, and what is set is shown."""

from __future__ import annotations

import tempfile
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from pftrack_sim import scenario as scenarios
from pftrack_sim.benchmark.asked.plan import TrackerSpec
from pftrack_sim.core.image_files import encode
from pftrack_sim.core.text import one_line
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scenario.axes import axes_by_name
from pftrack_sim.simulation.simulation import LIVE_AXES
from pftrack_sim.studio.game_pad import GamePad
from pftrack_sim.studio.player import Player
from pftrack_sim.studio.session import Session
from pftrack_sim.studio.settings import HAND, Settings, drivers
from pftrack_sim.studio.tracked import Moment, TrackedSession

THEME = {"show_logo": False, "show_share_button": False}
_SPEEDS = {"0.1": 0.1, "0.25": 0.25, "0.5": 0.5, "1": 1.0, "2": 2.0, "as fast as possible": 1e6}
_STEP = 0.25
# Which part of the command (forward, turn, pan, tilt) a key raises or lowers by a step.
_KEYS = {"W": (0, 1), "S": (0, -1), "A": (1, 1), "D": (1, -1), "Q": (2, 1), "E": (2, -1), "R": (3, 1), "F": (3, -1)}
_KEYS_HELP = "W/S forward, A/D turn, Q/E pan, R/F tilt, X stop; or a game pad."


class Controls:
    """Widgets of the main panel of viser's `gui`, and of a `panel` for settings beside it, and what they do.

    `offered` trackers can be switched on; `look_through` lets a client look through the robot's camera.
    """

    def __init__(
        self,
        gui: Any,
        panel: Any,
        player: Player,
        offered: Sequence[TrackerSpec],
        look_through: Callable[[Any], None],
    ) -> None:
        self._gui, self._player, self._look_through = gui, player, look_through
        self._offered = {one.label: one for one in (*player.session.settings.trackers, *offered)}
        self.past: Moment | None = None
        """A moment of the past that is looked at while paused."""
        self._pad = GamePad()
        self._wanted: dict[str, float] = {}  # Values of sliders that the session has not taken yet
        self._lock = threading.Lock()
        self._first_s = 0.0
        self._synchronised: Settings | None = player.session.settings  # What the controls show
        self._add_controls(panel)

    @property
    def shown(self) -> Moment:
        """The moment on the page: the present, or one of the past while paused."""
        return self.past or self._player.moment

    def set_people(self, people: Sequence[str]) -> None:
        """Offer these people as the one who is tracked."""
        self._person.options = people

    def show(self, history: Sequence[Moment]) -> None:
        """Show the state of the player, the span of its history, and the settings if they changed."""
        player, session, settings = self._player, self._player.session, self._player.session.settings
        lines = [one_line(line) for line in (player.status, *session.errors) if line]
        lines = lines or ["Drag to orbit; click a person to track that person."]
        self._status.content = "\n\n".join(map(_plain, lines))
        self._play.label = "Pause" if player.playing else "Play"
        if session.simulated:
            self._person.value = session.person
        if player.playing:
            self.past = None
        self._first_s = history[0].frame.time_s
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

    def show_time(self, moment: Moment) -> None:
        """Let the slider of the time end at the moment whose picture is shown, unless that is one of the past."""
        first_s, last_s = round(self._first_s, 2), round(moment.frame.time_s, 2)
        if self.past is None and last_s > first_s and self._scrub.max != last_s:
            self._scrub.min, self._scrub.max, self._scrub.value = first_s, last_s, last_s

    def track(self, person: str) -> None:
        """Track this person from now on."""
        self.past = None
        self._player.request(lambda session: session.select(person))

    def click(self, x: float, y: float) -> None:
        """Track the person, if any, at these shares of the picture's width and height."""
        moment = self.shown
        height, width = moment.frame.image.shape[:2]
        person = self._player.session.person_at(moment, x * width, y * height)
        if person is not None:
            self.track(person)

    def select_box(self, shares: FloatArray) -> None:
        """Start all trackers with a `(4,)` box x, y, w, h in shares of the picture's width and height."""

        def select(session: TrackedSession) -> str:
            height, width = session.moment.frame.image.shape[:2]
            return session.select_box(shares * (width, height, width, height))

        self.past = None
        self._player.request(select)

    def read_pad(self) -> None:
        """Take the command of the game pad, if there is one and the robot is driven by hand."""
        if self._player.session.settings.driver != HAND:
            return
        command = self._pad.read()
        if command is not None:
            self._player.request(lambda session: session.drive(command))

    def _add_controls(self, panel: Any) -> None:
        gui, settings, simulated = self._gui, self._player.session.settings, self._player.session.simulated
        self._play = gui.add_button("Play")
        _when(self._play.on_click, self._toggle)
        self._scrub = gui.add_slider("Time [s]", 0.0, 1.0, 0.01, 0.0, hint="Look back while paused.")
        _when(self._scrub.on_update, self._look_back)
        here = "Restart from here: from the time above on, with these settings, trackers anew."
        draw = "Draw a box: pause, look through the camera, and start all trackers with a box."
        self._add_group(
            "Episode",
            {
                "Step": lambda _: self._step(),
                "Restart from here": lambda _: self._restart(self.shown),
                "Restart from the beginning": lambda _: self._restart(None),
                "Draw a box": self._draw,
            },
            f"{here} {draw}",
        )
        self._status = gui.add_markdown("")
        self._choices: tuple[Any, ...] = ()
        self._sliders: dict[str, Any] = {}
        with panel.add_tab("Episode"):
            if simulated:
                self._add_scenario(settings)
            speed = gui.add_dropdown("Speed", tuple(_SPEEDS), initial_value="1")
            _when(speed.on_update, lambda: setattr(self._player, "speed", _SPEEDS[speed.value]))
            dark = gui.add_checkbox("Dark", False)
            _when(dark.on_update, lambda: gui.configure_theme(**THEME, dark_mode=dark.value))
            with gui.add_folder("Trackers"):
                on = [one.label for one in settings.trackers]
                self._boxes = {label: self._add_tracker(label, label in on) for label in self._offered}
            saved = {"Picture": self._save_picture, "Last ten seconds": self._save_clip}
            if simulated:
                saved |= {"Scenario (TOML)": self._save_toml, "Command line": self._show_command}
            self._add_group("Save", saved)
        if simulated:
            with panel.add_tab("Stress axes"):
                self._sliders = {axis: self._add_axis(axis, settings) for axis in axes_by_name()}
        _when(gui.add_command("Play or pause", hotkey="P").on_trigger, self._toggle)
        if simulated:
            self._add_keys()

    def _add_group(self, label: str, actions: Mapping[str, Callable[[Any], object]], hint: str | None = None) -> None:
        def clicked(event: Any) -> None:
            actions[event.target.value](event)

        self._gui.add_button_group(label, tuple(actions), hint=hint).on_click(clicked)

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
        self._person = gui.add_dropdown("Tracked", self._player.session.people)

        def other(old: Settings) -> Settings:
            kept = old.overrides if name.value == old.name else _shared(old)
            return replace(old, name=name.value, seed=int(seed.value), overrides=kept, driver=driver.value)

        self._choices = (name, seed, driver)
        for handle in self._choices:
            _when(handle.on_update, lambda: self._change(other))
        _when(self._person.on_update, lambda: self.track(self._person.value))

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
                self._player.request(self._take_axes)

        _when(slider.on_update, moved)
        return slider

    def _take_axes(self, session: Session) -> str | None:
        """Apply the newest values of all sliders that were moved, and say so; None if the session has them already."""
        with self._lock:
            wanted, settings = dict(self._wanted), session.settings
        for name, value in wanted.items():
            settings = settings.with_axis(name, value)
        try:
            said = None if settings == session.settings else session.change(settings)
            self._synchronised = settings
        except BaseException:
            self._synchronised = None
            raise
        finally:
            # Only now, so that no slider jumps back to what the session had before.
            with self._lock:
                self._wanted = {name: value for name, value in self._wanted.items() if wanted.get(name) != value}
            if self._wanted:
                self._player.request(self._take_axes)
        moved = ", ".join(f"{name} {value:.3g} {axes_by_name()[name].unit}" for name, value in wanted.items())
        return said and f"{moved}: {said[0].lower()}{said[1:]}"

    def _change(self, changed: Callable[[Settings], Settings]) -> None:
        def change(session: Session) -> str:
            try:
                return session.change(changed(session.settings))
            finally:
                self._synchronised = None  # the page shows what was taken, which may be nothing

        self._player.request(change)

    def _toggle(self) -> None:
        self.past = None
        self._player.playing = not self._player.playing

    def _step(self) -> None:
        self.past, self._player.playing = None, False
        self._player.request(lambda session: session.advance() and None)

    def _restart(self, moment: Moment | None) -> None:
        self.past = None
        self._player.request(lambda session: session.restart(moment))

    def _look_back(self) -> None:
        if self._player.playing:
            return
        time_s = float(self._scrub.value)
        history = list(self._player.session.history) or [self._player.moment]
        self.past = min(history, key=lambda one: abs(one.frame.time_s - time_s))

    def _draw(self, event: Any) -> None:
        self.past, self._player.playing = None, False
        self._look_through(event.client)
        self._player.status = "Hold Shift and drag a box over the picture in the 3D view."

    def _key(self, part: int | None, sign: int) -> None:
        def press(session: Session) -> str:
            if session.settings.driver != HAND:
                return "Keys drive the robot while it is driven by hand."
            command = np.zeros(4) if part is None else session.hand.copy()
            if part is not None:
                command[part] = np.clip(command[part] + sign * _STEP, -1.0, 1.0)
            return session.drive(command)

        self._player.request(press)

    def _save_picture(self, event: Any) -> None:
        event.client.send_file_download("studio.png", encode(self.shown.picture(), ".png"), save_immediately=True)

    def _save_clip(self, event: Any) -> None:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "studio.mp4"
            self._player.ask(lambda session: session.save_clip(path))
            event.client.send_file_download("studio.mp4", path.read_bytes(), save_immediately=True)

    def _save_toml(self, event: Any) -> None:
        text = self._player.session.settings.toml()
        event.client.send_file_download("studio.toml", text.encode(), save_immediately=True)

    def _show_command(self, _: Any) -> None:
        self._player.status = self._player.session.settings.command_line()


def _when(register: Any, action: Callable[[], object]) -> None:
    """Call an action when a client does something, and not when this side sets a value."""

    def happened(event: Any) -> None:
        if event.client_id is not None:
            action()

    register(happened)


def _plain(text: str) -> str:
    """Text as Markdown that shows it word for word: a reference to a character is never markup.

    Errors and names are those of third-party code, and the page would render their HTML, scripts included.
    """
    return "".join(one if one.isalnum() or one == " " else f"&#{ord(one)};" for one in text)


def _shared(settings: Settings) -> dict[str, Any]:
    """Overrides that go on in another scenario: the camera's size and the stress axes."""
    return {key: value for key, value in settings.overrides.items() if key.split(".")[0] in ("camera", "axes")}
