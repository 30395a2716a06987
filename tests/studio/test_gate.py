"""Who may open a studio."""

import http

import pytest

from pftrack_sim.core.errors import StudioError
from pftrack_sim.studio.server import Gate, _check_host, open_server, without_its_prints

HERE = {"Host": "127.0.0.1:8765"}
SOCKET = {**HERE, "Upgrade": "websocket", "Origin": "http://127.0.0.1:8765"}


def status(gate: Gate, path: str, headers: dict[str, str]) -> int:
    refusal = gate.refusal(path, headers)
    return 200 if refusal is None else int(refusal[0])


def test_this_machine_needs_no_token_and_other_sites_are_refused():
    gate = Gate(None, 2)
    assert status(gate, "/", HERE) == status(gate, "/", SOCKET) == 200
    assert status(gate, "/", {**SOCKET, "Host": "localhost:8765", "Origin": "http://localhost:8765"}) == 200
    assert status(gate, "/", {**SOCKET, "Origin": "http://example.org"}) == http.HTTPStatus.FORBIDDEN
    rebound = {"Host": "example.org:8765", "Origin": "http://example.org:8765"}
    assert status(gate, "/", rebound) == http.HTTPStatus.FORBIDDEN, "a name that was bound to this machine"


def test_elsewhere_a_token_opens_the_page_and_its_cookie_the_connection():
    gate = Gate("secret", 2)
    away = {"Host": "robot:8765", "Upgrade": "websocket", "Origin": "http://robot:8765"}
    assert status(gate, "/", away) == status(gate, "/?token=guess", away) == http.HTTPStatus.FORBIDDEN
    assert status(gate, "/?token=secret", away) == 200
    assert gate.cookie("/?token=guess") is None
    name, _, value = (gate.cookie("/?token=secret") or "").partition(";")[0].partition("=")
    assert status(gate, "/", {**away, "Cookie": f"other=1; {name}={value}"}) == 200
    assert status(gate, "/", {**away, "Cookie": f"{name}=guess"}) == http.HTTPStatus.FORBIDDEN


@pytest.mark.parametrize("wrong", [{"Origin": "http://["}, {"Host": "["}, {"Cookie": "pftrack-sim-studio=é\udcff"}])
def test_headers_that_cannot_be_read_are_refused(wrong: dict[str, str]):
    assert status(Gate("secret", 2), "/", HERE | wrong) == http.HTTPStatus.FORBIDDEN
    assert status(Gate(None, 2), "/", {"Host": "["} | wrong) == http.HTTPStatus.FORBIDDEN


def test_headers_given_twice_are_refused():
    headers = pytest.importorskip("websockets").Headers([*SOCKET.items(), ("Origin", "http://example.org")])
    assert status(Gate(None, 2), "/", headers) == http.HTTPStatus.FORBIDDEN


def test_only_so_many_pages_are_open_at_once():
    gate = Gate(None, 2)
    gate.open = 2
    assert status(gate, "/", SOCKET) == http.HTTPStatus.SERVICE_UNAVAILABLE
    assert status(gate, "/", HERE) == 200, "files of the page are served"


def test_an_address_that_cannot_be_bound_is_one_error():
    with pytest.raises(StudioError, match=r"cannot bind the address '203\.0\.113\.9'"):
        _check_host("203.0.113.9")


def test_viser_prints_nothing_of_its_own(monkeypatch: pytest.MonkeyPatch):
    pytest.importorskip("viser", reason="the extra studio is not installed")
    printed: list[tuple[object, ...]] = []
    monkeypatch.setattr("rich.print", lambda *words: printed.append(words))
    server, _, address = open_server("127.0.0.1", 0, 1)
    with without_its_prints():
        server.stop()
    assert printed == []
    assert address == f"http://127.0.0.1:{server.get_port()}/"
