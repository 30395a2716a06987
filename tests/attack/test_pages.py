"""Texts from outside on every page, in Chromium: none runs, becomes markup, or calls a server of this machine."""

import http.server
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from pftrack_sim import scenario as scenarios
from pftrack_sim.benchmark import TrackerSpec, make_plan, run
from pftrack_sim.benchmark.limits.search import Wanted, find_limits, first_plan, make_searches
from pftrack_sim.benchmark.limits.success import parse_success
from pftrack_sim.benchmark.said.comparison import compare_runs
from pftrack_sim.core.data_files import envs_dir
from pftrack_sim.report import write_comparison, write_report
from pftrack_sim.report.limits import write_limits_page
from pftrack_sim.scenario import Scenario
from tests.benchmark.small import SMALL

pytestmark = pytest.mark.slow

DRAWS = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]
# Without full stops and brackets, which a tracker's name cannot have.
NAME = (
    "<img data-hostile src=x onerror=ran(1)><script data-hostile>ran(2)</script><svg data-hostile onload=ran(3)></svg>"
)
TRACKER = """
import numpy as np
from pftrack_sim.core.records import Estimate

class Tracker:
    def __init__(self, **_):
        print({text!r})

    def init(self, image, box):
        self.box, self.count = np.array(box), 0

    def update(self, image):
        self.count += 1
        if self.count > 1:
            raise ValueError({text!r})
        return Estimate(self.box)

globals()[{name!r}] = Tracker
"""


class _Called(http.server.BaseHTTPRequestHandler):
    """A server of this machine that must not be called."""

    def do_GET(self) -> None:
        self.server.calls.append(self.path)  # pyright: ignore[reportAttributeAccessIssue]
        self.send_response(200)
        self.send_header("Access-Control-Allow-Origin", "*")
        self.end_headers()
        self.wfile.write(b"<!doctype html><title>foreign</title>")

    def log_message(self, *arguments: Any) -> None:
        pass


@pytest.fixture
def neighbour() -> Iterator[Any]:
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), _Called)
    server.calls = []  # pyright: ignore[reportAttributeAccessIssue]
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield server
    server.shutdown()
    server.server_close()


@pytest.fixture
def hostile(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, neighbour: Any) -> tuple[TrackerSpec, str]:
    """A tracker whose name, parameter, output and error are markup, and its error."""
    monkeypatch.syspath_prepend(tmp_path)
    port = neighbour.server_address[1]
    text = (
        f"{NAME}<iframe data-hostile srcdoc=\"<script>parent.ran(4); fetch('http://127.0.0.1:{port}/frame')</script>\">"
        f"</iframe><img data-hostile src='http://127.0.0.1:{port}/img'> [link](javascript:ran(5)) "
        f"</script><script data-hostile>ran(6)</script>{{{{ran(7)}}}}"
    )
    (tmp_path / "hostile_page.py").write_text(TRACKER.format(name=NAME, text=text))
    return TrackerSpec(name=f"hostile_page:{NAME}", params={"note": "<b data-hostile>"}), text


def opened(browser: Any, address: str, ran: list[Any]) -> Any:
    """A page that reports every script of a text that ran."""
    page = browser.new_page()
    page.set_default_timeout(120_000)
    page.expose_function("ran", lambda *words: ran.append(words))
    page.goto(address)
    return page


def check_nothing_ran(page: Any, ran: list[Any], neighbour: Any) -> None:
    page.wait_for_timeout(1500)
    assert ran == []
    assert page.locator("[data-hostile]").count() == 0
    assert page.locator("a[href^='javascript']").count() == 0
    assert neighbour.calls == []


def test_reports_comparisons_and_limits(
    launch_chromium: Callable[..., Any], hostile: tuple[TrackerSpec, str], neighbour: Any, tmp_path: Path
):
    spec, text = hostile
    scenario = Scenario(NAME, scenarios.load("corridor").tree)
    plan = make_plan([scenario], ["oracle", spec], [0, 1], overrides=SMALL, variant=NAME)
    store = run(plan, tmp_path / NAME.partition("/")[0], videos="first", workers=0)
    assert any(text[:100] in (one.error or "") for one in store.results)
    found = compare_runs(store, store, ["oracle", plan.labels[1]])
    driven = make_plan([scenario], ["oracle", spec], [0], overrides=SMALL, controllers=["servo-avoid"])
    drives = run(driven, tmp_path / "drives", videos="none", workers=0)
    sought = make_plan([scenario], ["stay", spec], range(24), overrides=SMALL)
    success = parse_success("overlap >= 0.4 for 50 % of the episode", "open")
    searches = make_searches(sought, Wanted({"jitter": (2.0, 10.0)}, success, budget=24))
    limits = find_limits(first_plan(sought, searches), searches, tmp_path / "limits", workers=0)
    pages = [
        write_report(store.path),
        write_comparison(store, store, found, store.path / "comparison.html"),
        write_report(drives.path),
        write_limits_page(tmp_path / "limits", limits),
    ]
    browser = launch_chromium("--disable-gpu")
    for file in pages:
        ran: list[Any] = []
        page = opened(browser, file.as_uri(), ran)
        assert NAME in page.locator("body").inner_text(), f"{file.name} shows the name, word for word"
        check_nothing_ran(page, ran, neighbour)
        page.close()
    browser.close()


@pytest.fixture
def studio(hostile: tuple[TrackerSpec, str], tmp_path: Path) -> Iterator[Any]:
    pytest.importorskip("viser", reason="the extra studio is not installed")
    from pftrack_sim.studio import Settings, Studio

    file = tmp_path / f"{NAME.replace('/', '')}.toml"
    file.write_bytes((envs_dir() / "corridor.toml").read_bytes())
    settings = Settings(str(file), 0, {**SMALL, "duration_s": 2.0}, (hostile[0],))
    with Studio(settings, port=0, playing=False, isolation="always") as opened:
        yield opened


@pytest.mark.parametrize("in_notebook", [False, True])
def test_the_studio(
    launch_chromium: Callable[..., Any],
    hostile: tuple[TrackerSpec, str],
    studio: Any,
    neighbour: Any,
    in_notebook: bool,
    tmp_path: Path,
):
    browser, ran, address = launch_chromium(*DRAWS), [], studio.address
    if in_notebook:
        cell = tmp_path / "cell.html"
        cell.write_text(f"<!doctype html><meta charset=utf-8><title>cell</title>{studio._repr_html_()}")
        address = cell.as_uri()
    page = opened(browser, address, ran)
    shown = page.frame_locator("iframe").first if in_notebook else page
    for _ in range(4):
        studio.player.ask(lambda session: session.advance())
    shown.locator(".uplot").first.wait_for()
    shown.get_by_text("ValueError").first.wait_for()
    assert hostile[1][:150] in shown.locator("body").inner_text(), "the error, word for word"
    page.wait_for_timeout(1500)
    assert ran == []
    assert shown.locator("[data-hostile]").count() == 0
    assert shown.locator("a[href^='javascript']").count() == 0
    assert neighbour.calls == []
    browser.close()


FOREIGN = """async ([address, path]) => {
    const socket = await new Promise(resolve => {
        const one = new WebSocket(address.replace('http', 'ws'), path ? [path] : []);
        one.onopen = () => resolve('open');
        one.onerror = () => resolve('refused');
    });
    const read = await fetch(address).then(answer => answer.text()).then(text => 'read', error => 'refused');
    return [socket, read];
}"""


def test_pages_of_other_sites_cannot_reach_the_studio(
    launch_chromium: Callable[..., Any], studio: Any, neighbour: Any, tmp_path: Path
):
    """From another port, another name of this machine, a file, a frame without an origin, and data."""
    browser = launch_chromium("--host-resolver-rules=MAP evil.example 127.0.0.1")
    port, own = neighbour.server_address[1], studio.port
    (tmp_path / "page.html").write_text("<!doctype html><title>file</title>")
    places = [f"http://127.0.0.1:{port}/", f"http://localhost:{port}/", (tmp_path / "page.html").as_uri()]
    places += [f"http://evil.example:{port}/", "data:text/html,<title>data</title>"]
    addresses = [f"http://{name}:{own}/" for name in ("127.0.0.1", "localhost", "evil.example")]
    for place in places:
        page = browser.new_page()
        page.goto(place)
        for address in addresses:
            assert page.evaluate(FOREIGN, [address, "viser-v1.0.0"]) == ["refused", "refused"], (place, address)
        page.close()
    # A name of another site that was bound to this machine later: the page itself comes from the studio's port.
    page = browser.new_page()
    answer = page.goto(f"http://evil.example:{own}/")
    assert answer.status == 403
    assert page.evaluate(FOREIGN, [f"http://evil.example:{own}/", ""])[0] == "refused"
    assert studio.gate.open == 0
    browser.close()
