"""One episode to look at: it advances frame by frame, keeps the last frames, and takes new settings on the way.

A session has no thread and no page; `player.Player` runs it, and `page.Page` shows it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pftrack_sim import controllers, policies
from pftrack_sim.benchmark.running.tracker_runner import Isolation, check_trackers
from pftrack_sim.controllers import Controller
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.records import Frame, Truth
from pftrack_sim.core.types import FloatArray
from pftrack_sim.simulation.simulation import LIVE_AXES, Simulation
from pftrack_sim.studio.settings import HAND, SCRIPT, Settings
from pftrack_sim.studio.tracked import MEMORY_MB, UNSEEN, Moment, TrackedSession
from pftrack_sim.trackers.isolation import Limits


class Session(TrackedSession):
    """A simulated episode with trackers in it, from the first frame on.

    The simulation belongs to the thread that made the session, as its graphics context does. Arguments are those of
    `TrackedSession`, and the renderer's name.

    Raises:
        ScenarioError: The scenario is wrong or impossible.
        UnknownNameError: An unknown scenario, tracker or driver.
    """

    def __init__(
        self,
        settings: Settings,
        *,
        backend: str | None = None,
        isolation: Isolation = "auto",
        memory_mb: float = MEMORY_MB,
    ) -> None:
        super().__init__(settings, isolation=isolation, memory_mb=memory_mb)
        self._backend = backend
        self.simulation: Simulation
        self.hand: FloatArray
        """`(4,)` command of a person who drives: forward, turn, pan, tilt in [-1, 1]."""
        self._controller: Controller | None
        self._world = 0
        self._restart(settings, ())

    @property
    def rate_hz(self) -> float:
        """Camera frames per second."""
        return self.simulation.settings.camera.rate_hz

    @property
    def over(self) -> bool:
        """Whether the last frame of the episode has been shown."""
        # Not of the moment: with another delivery of frames the one shown has another index.
        return self.simulation.frame.index + 1 >= self.simulation.frame_count

    @property
    def people(self) -> tuple[str, ...]:
        """Everyone in the episode, the scenario's target first."""
        return self.simulation.world.people

    def advance(self) -> Moment:
        """Move on to the next frame, and show it to the trackers.

        Raises:
            ParameterError: The episode is over.
        """
        if self.over:
            raise ParameterError("the episode is over: restart it")
        command = self._command()
        before = self.simulation.periods
        frame = self.simulation.advance(command)
        self._commands += [command] * (self.simulation.periods - before)
        self._show(frame)
        return self.moment

    def change(self, settings: Settings) -> str:
        """See `TrackedSession`.

        Axes of the camera and of the link act from the next frame on. Whatever else differs starts the episode
        again with the new settings and, unless the scenario itself or the seed is another, lets the world move on to
        the present time under the same commands.

        Raises:
            ScenarioError: They are impossible.
            UnknownNameError: An unknown scenario, tracker or driver.
        """
        old = self.settings
        if (old.name, old.seed) != (settings.name, settings.seed):
            self._restart(settings, ())
            return f"Started {settings.name} at seed {settings.seed}."
        if settings.trackers != old.trackers:
            check_trackers(settings.trackers, self._isolation, Limits())
        said = f"Applied from {self.moment.frame.time_s:.2f} s on."
        if settings.overrides != old.overrides:
            said = self._change_scenario(settings)
        if settings.trackers != old.trackers:
            self._set_runners(settings.trackers)
            self._show_again()
        if settings.driver != old.driver:
            self._start_driver(settings)
        self.settings = settings
        return said

    def restart(self, moment: Moment | None = None) -> str:
        """See `TrackedSession`; from there on the frames are those of the present settings to the bit."""
        self._restart(self.settings, () if moment is None else self._commands[: moment.periods])
        return self._restarted

    def drive(self, command: FloatArray) -> str:
        """Take a `(4,)` command of a person who drives, see `hand`, and say it in a sentence."""
        self.hand = command
        forward, turn, pan, tilt = command
        return f"By hand: forward {forward:+.2f}, turn {turn:+.2f}, pan {pan:+.2f}, tilt {tilt:+.2f}."

    def close(self) -> None:
        """Free the renderer and end the trackers' processes."""
        super().close()
        self.simulation.close()

    def _change_scenario(self, settings: Settings) -> str:
        loaded, seed = settings.scenario(), settings.seed
        new, present = loaded.resolve(seed), self.simulation.settings
        kept = {name: getattr(present.axes, name) for name in LIVE_AXES}
        if new.model_copy(update={"axes": new.axes.model_copy(update=kept)}) == present:
            if new != present:
                self.simulation.retune(loaded, seed)
                self.exact = False
            return f"Applied from {self.moment.frame.time_s:.2f} s on."
        frame = self._resumed(settings, self._commands)
        self._show(frame)
        return f"Restarted with these settings at {frame.time_s:.2f} s."

    def _restart(self, settings: Settings, commands: Sequence[FloatArray | None]) -> None:
        frame = self._resumed(settings, commands)
        while self.history and (not commands or self.history[-1].periods >= len(commands)):
            self.history.pop()
        if settings.name != self.settings.name or self.person not in self.people:
            self._person = ""
        self.settings = settings
        self._set_runners(settings.trackers)
        self._show(frame)

    def _resumed(self, settings: Settings, commands: Sequence[FloatArray | None]) -> Frame:
        """The first frame of a world with these settings, after these commands; the old world stays if it raises."""
        simulation = Simulation(settings.scenario(), backend=self._backend)
        try:
            frame = simulation.resume(settings.seed, commands)
        except BaseException:
            simulation.close()
            raise
        if self._world:
            self.simulation.close()
        self.simulation = simulation
        held = [commands[-1]] * (simulation.periods - len(commands)) if commands else []
        self._commands = [*commands, *held]
        self._world += 1
        self.exact = all(command is None for command in self._commands)
        self._start_driver(settings)
        return frame

    def _start_driver(self, settings: Settings) -> None:
        self._controller = None
        self.hand = np.zeros(4)
        if settings.driver not in (SCRIPT, HAND):
            self._controller = controllers.make(settings.driver)
            self._controller.reset(policies.robot_parameters(self.simulation.settings))

    def _command(self) -> FloatArray | None:
        if self.settings.driver == SCRIPT:
            return None
        self.exact = False
        if self._controller is None:
            return self.hand.copy()
        if not self.moment.estimates:
            return np.zeros(4)
        estimate = next(iter(self.moment.estimates.values()))
        act = self._controller.act(estimate, self.simulation.world.proprio())
        return np.clip(act, -1.0, 1.0)

    def _show(self, frame: Frame, drawn: FloatArray | None = None) -> None:
        len(frame.people)  # Finds everybody here: pages read a moment in threads of their own.
        data, truth = self.simulation.world.data, self._truth(frame)
        self._step_runners(frame, truth, drawn)
        self._remember(
            Moment(
                frame,
                truth,
                *self._latest(),
                self.simulation.periods,
                self._world,
                data.geom_xpos.astype(np.float32),
                data.geom_xmat.reshape(-1, 3, 3).astype(np.float32),
            )
        )

    def _truth(self, frame: Frame) -> Truth:
        for one in frame.people:
            if one.name == self.person:
                return one
        return replace(frame.truth, name=self.person, visible_fraction=0.0, **UNSEEN)
