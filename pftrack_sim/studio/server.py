"""A studio on a viser server with access control: number of pages, their origin, and a token for other machines."""

from __future__ import annotations

import hmac
import http
import importlib
import secrets
import socket
import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from http.cookies import CookieError, SimpleCookie
from typing import Any
from unittest import mock
from urllib.parse import parse_qs, urlsplit

from pftrack_sim.benchmark.asked.plan import TrackerSpec
from pftrack_sim.benchmark.running.tracker_runner import Isolation
from pftrack_sim.core.errors import StudioError
from pftrack_sim.studio.page import Page
from pftrack_sim.studio.player import Player
from pftrack_sim.studio.recording import RecordedSession, Source
from pftrack_sim.studio.session import Session
from pftrack_sim.studio.settings import Settings
from pftrack_sim.studio.tracked import TrackedSession

PORT = 8765
MOST_PAGES = 4
_OFFERED = ("oracle", "stay", "ko2012", "lee2012", "kwon2005", "pftrack", "ncc", "opencv-mil")

LOCAL = ("127.0.0.1", "localhost", "::1")
_COOKIE = "pftrack-sim-studio"
# The page reaches its own server only; viser unpacks its program in the page and evaluates text.
_POLICY = (
    "default-src 'self' data: blob: 'unsafe-inline' 'unsafe-eval'; frame-src 'none'; object-src 'none'; "
    "base-uri 'none'; form-action 'none'"
)


def import_viser() -> Any:
    """The module viser.

    Raises:
        StudioError: It is not installed.
    """
    try:
        return importlib.import_module("viser")
    except ImportError as error:
        raise StudioError(f"the studio needs viser: pip install 'pftrack-sim[studio]' ({error})") from None


class Gate:
    """Decides which requests reach the server.

    A browser that opens the address with its token, which is None where the server is bound to this machine, gets a
    cookie; the page's connection needs that cookie. Requests that a page of another site makes are refused: browsers
    let any page connect to this machine. At most so many pages are open at once.
    """

    def __init__(self, token: str | None, most: int) -> None:
        self.token, self.most, self.open = token, most, 0

    def refusal(self, path: str, headers: Mapping[str, str]) -> tuple[http.HTTPStatus, str] | None:
        """Status and text for a request that is refused, or None."""
        try:
            return self._refusal(path, headers)
        except (ValueError, LookupError, CookieError):  # unreadable, or given twice
            return http.HTTPStatus.FORBIDDEN, "this request has headers that cannot be read"

    def _refusal(self, path: str, headers: Mapping[str, str]) -> tuple[http.HTTPStatus, str] | None:
        connects = headers.get("Upgrade", "").lower() == "websocket"
        origin = headers.get("Origin")
        if origin is not None and urlsplit(origin).netloc != headers.get("Host"):
            return http.HTTPStatus.FORBIDDEN, "this studio answers its own page only"
        if self.token is None and urlsplit(f"//{headers.get('Host', '')}").hostname not in LOCAL:
            return http.HTTPStatus.FORBIDDEN, "open the address that the studio printed"
        if not self._knows_token(path, headers):
            return http.HTTPStatus.FORBIDDEN, "open the address that the studio printed, with its token"
        if connects and self.open >= self.most:
            return http.HTTPStatus.SERVICE_UNAVAILABLE, f"{self.most} pages are open, as many as the studio serves"
        return None

    def cookie(self, path: str) -> str | None:
        """Cookie to set for a request that holds the token in its address."""
        if not self._right(_query_token(path)):
            return None
        return f"{_COOKIE}={self.token}; HttpOnly; SameSite=Strict; Path=/"

    def _knows_token(self, path: str, headers: Mapping[str, str]) -> bool:
        if self.token is None or self._right(_query_token(path)):
            return True
        cookie = SimpleCookie(headers.get("Cookie", "")).get(_COOKIE)
        return cookie is not None and self._right(cookie.value)

    def _right(self, given: str) -> bool:
        return self.token is not None and hmac.compare_digest(given.encode(), self.token.encode())


def open_server(host: str, port: int, most: int) -> tuple[Any, Gate, str]:
    """Start a viser server behind a gate, see `Studio`; returns both, and the address to open.

    Raises:
        StudioError: viser is missing, or the address cannot be bound.
    """
    viser = import_viser()
    _check_host(host)
    gate = Gate(None if host in LOCAL else secrets.token_urlsafe(16), most)
    websockets_server: Any = importlib.import_module("websockets.asyncio.server")
    serve = websockets_server.serve

    def guarded(handler: Any, *arguments: Any, process_request: Any, **options: Any) -> Any:
        return serve(_counted(handler, gate), *arguments, process_request=_checked(process_request, gate), **options)

    # viser has no way to refuse a request.
    with mock.patch.object(websockets_server, "serve", guarded), without_its_prints():
        server = viser.ViserServer(host, port, label="pftrack_sim", verbose=False)
    name = socket.gethostname() if host in ("0.0.0.0", "::") else host
    address = f"http://{f'[{name}]' if ':' in name else name}:{server.get_port()}/"
    return server, gate, address if gate.token is None else f"{address}?token={gate.token}"


def without_its_prints() -> Any:
    """Context in which viser prints nothing: its table of addresses lacks the token, and fills a notebook's cell."""
    return mock.patch("rich.print")


def _check_host(host: str) -> None:
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, 0, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, kind, protocol) as probe:
            probe.bind(address)
    except (OSError, UnicodeError) as error:
        text = error.strerror if isinstance(error, OSError) else str(error)
        raise StudioError(f"cannot bind the address {host!r}: {text}") from None


def _counted(handler: Any, gate: Gate) -> Callable[[Any], Any]:
    async def handle(connection: Any) -> None:
        gate.open += 1
        try:
            await handler(connection)
        finally:
            gate.open -= 1

    return handle


def _checked(process_request: Any, gate: Gate) -> Callable[[Any, Any], Any]:
    async def process(connection: Any, request: Any) -> Any:
        refusal = gate.refusal(request.path, request.headers)
        if refusal is not None:
            return connection.respond(refusal[0], f"{refusal[1]}\n")
        response = process_request(connection, request)
        if response is not None:
            response.headers["Content-Security-Policy"] = _POLICY
            if (cookie := gate.cookie(request.path)) is not None:
                response.headers["Set-Cookie"] = cookie
        return response

    return process


def _query_token(path: str) -> str:
    return parse_qs(urlsplit(path).query).get("token", [""])[0]


class Studio(AbstractContextManager["Studio"]):
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

    def __exit__(self, *_: object) -> None:
        self.close()

    def _repr_html_(self) -> str:
        """An inline frame, in a notebook."""
        return f'<iframe src="{self.address}" width="100%" height="700" frameborder="0"></iframe>'
