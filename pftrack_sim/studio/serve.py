"""Open a studio, and keep it open until it is closed."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from types import TracebackType
from typing import Self

from pftrack_sim.benchmark.asked.plan import TrackerSpec
from pftrack_sim.benchmark.running.tracker_runner import Isolation
from pftrack_sim.studio.recording import RecordedSession, Source
from pftrack_sim.studio.server import import_viser, open_server, without_its_prints
from pftrack_sim.studio.session import Session
from pftrack_sim.studio.settings import Settings
from pftrack_sim.studio.tracked import TrackedSession

PORT = 8765
MOST_PAGES = 4
_OFFERED = ("oracle", "stay", "ko2012", "lee2012", "kwon2005", "pftrack", "ncc", "opencv-mil")


class Studio:
    """A studio that is open: `address` is where; use it in a `with` block, or call `close`.

    Args:
        settings: What to show first.
        host: Address to bind. Anything but this machine's own gets a token in the address.
        port: Port, or the next free one above; 0: any.
        most_pages: Number of pages that may be open at once.
        trackers: Trackers to offer besides the present ones.
        backend: Renderer, by name.
        isolation: Which trackers run in a process of their own.
        playing: Whether it plays from the start.
        open_source: Opens recorded frames to show in place of the scenario, which has their name in `settings`.

    Raises:
        StudioError: viser is missing, or the address cannot be bound.
        PftrackError: The settings are wrong.
    """

    def __init__(
        self,
        settings: Settings,
        *,
        host: str = "127.0.0.1",
        port: int = PORT,
        most_pages: int = MOST_PAGES,
        trackers: Sequence[TrackerSpec] = (),
        backend: str | None = None,
        isolation: Isolation = "auto",
        playing: bool = True,
        open_source: Callable[[], Source] | None = None,
    ) -> None:
        import_viser()
        from pftrack_sim.studio.page import Page
        from pftrack_sim.studio.player import Player

        self._closed = threading.Event()

        def make() -> TrackedSession:
            if open_source is not None:
                return RecordedSession(settings, open_source, isolation=isolation)
            return Session(settings, backend=backend, isolation=isolation)

        self.player = Player(make)
        try:
            self._server, self.gate, self.address = open_server(host, port, most_pages)
        except BaseException:
            self.player.close()
            raise
        offered = [*trackers, *(TrackerSpec(name=name) for name in _OFFERED)]
        self.page = Page(self._server, self.player, offered)
        self.player.playing = playing

    @property
    def port(self) -> int:
        """The port in use."""
        return self._server.get_port()

    def wait(self) -> None:
        """Return when the studio is closed, or on Ctrl-C."""
        try:
            while not self._closed.wait(0.5):
                pass
        except KeyboardInterrupt:
            return

    def close(self) -> None:
        """Close pages, server and session. Closing twice is fine."""
        if self._closed.is_set():
            return
        self._closed.set()
        self.player.playing = False
        self.page.close()
        with without_its_prints():
            self._server.stop()
        self.player.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _repr_html_(self) -> str:
        """An inline frame, in a notebook."""
        return f'<iframe src="{self.address}" width="100%" height="700" frameborder="0"></iframe>'


__all__ = ["MOST_PAGES", "PORT", "Studio"]
