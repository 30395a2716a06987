"""The thread that runs a session: it plays at a speed, and does in between what the page asks for."""

from __future__ import annotations

import contextlib
import queue
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from pftrack_sim.core.errors import PftrackError
from pftrack_sim.core.text import describe_error
from pftrack_sim.studio.tracked import Moment, TrackedSession

_IDLE_S = 0.05
_RATE_OVER = 20  # Frames over which the frame rate is averaged


class Player:
    """Runs a session in a thread of its own, which makes it, calls it and closes it.

    Nothing that a page does waits for a frame: requests are queued, and results are read from `moment` and `status`.
    An error of `make` is raised here.
    """

    def __init__(self, make: Callable[[], TrackedSession]) -> None:
        self.playing = False
        self.speed = 1.0
        """Simulated seconds per second; frames are shown later than that where they take longer."""
        self.status = ""
        """What happened last."""
        self.frames_per_s = 0.0
        """Of the last frames played; 0 while paused."""
        self._requests: queue.SimpleQueue[tuple[Callable[[Any], Any], Future[Any]]] = queue.SimpleQueue()
        self._stop = threading.Event()
        self._times: list[float] = []
        made = Future[None]()
        self._thread = threading.Thread(target=self._run, args=(make, made), name="pftrack-sim studio", daemon=True)
        self._thread.start()
        made.result()

    @property
    def moment(self) -> Moment:
        """The frame shown last."""
        return self.session.moment

    def request(self, action: Callable[[Any], Any]) -> Future[Any]:
        """Let the session do something before the next frame; a sentence that results becomes the status."""
        result = Future[Any]()
        self._requests.put((action, result))
        return result

    def ask(self, action: Callable[[Any], Any], timeout_s: float = 60.0) -> Any:
        """As `request`, but wait for the result.

        Raises:
            Exception: The action's own error.
            TimeoutError: Nothing came back in time.
        """
        return self.request(action).result(timeout_s)

    def close(self) -> None:
        """Stop the thread and close the session. Closing twice is fine."""
        self._stop.set()
        self._thread.join()

    def _run(self, make: Callable[[], TrackedSession], made: Future[None]) -> None:
        try:
            self.session = make()
        except BaseException as error:  # noqa: BLE001 - raised again in the thread that made the player
            made.set_exception(error)
            return
        made.set_result(None)
        try:
            while not self._stop.is_set():
                self._handle(_IDLE_S if not self.playing else 0.0)
                if self.playing:
                    self._play()
        finally:
            self.session.close()

    def _handle(self, wait_s: float) -> None:
        """Do everything that was asked for; wait so long for the first request."""
        with contextlib.suppress(queue.Empty):
            while True:
                self._do(*self._requests.get(timeout=wait_s))
                wait_s = 0.0

    def _do(self, action: Callable[[Any], Any], result: Future[Any]) -> bool:
        """Whether the session did something; the status is what it said, or why not."""
        try:
            said = action(self.session)
        except Exception as error:  # noqa: BLE001 - a third-party tracker may raise anything; the page says so
            self.status = str(error) if isinstance(error, PftrackError) else describe_error(error)
            result.set_exception(error)
            return False
        if isinstance(said, str):
            self.status = said
        result.set_result(said)
        return True

    def _play(self) -> None:
        session = self.session
        if session.over:
            self.playing, self.frames_per_s, self.status = False, 0.0, "The episode is over."
            return
        start_s, before_s = time.perf_counter(), session.moment.frame.time_s
        if not self._do(lambda session: session.advance(), Future()):
            self.playing = False
            return
        self._times = [*self._times[1 - _RATE_OVER :], time.perf_counter()]
        if len(self._times) > 1:
            self.frames_per_s = (len(self._times) - 1) / (self._times[-1] - self._times[0])
        due_s = start_s + (session.moment.frame.time_s - before_s) / max(self.speed, 1e-3)
        while (left_s := due_s - time.perf_counter()) > 0.0 and not self._stop.is_set():
            self._handle(left_s)
            if not self.playing:
                break
