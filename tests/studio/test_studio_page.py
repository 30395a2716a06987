"""The page in headless Chromium."""

import base64
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

from pftrack_sim import scenario as scenarios
from pftrack_sim.benchmark.asked.plan import TrackerSpec
from pftrack_sim.simulation.simulation import Simulation
from pftrack_sim.studio import Settings, Studio
from pftrack_sim.trackers import registry
from tests.contrast import faint_texts

pytest.importorskip("viser", reason="the extra studio is not installed")

STILL = {
    "camera.width_px": 160,
    "camera.height_px": 120,
    "lights.shadows": False,
    "robot.route.kind": "still",
    "robot.route.start_m": [-3.5, 0.0],
    "robot.gaze": "forward",
    "jitter.angular_rms_deg": 0.0,
    "jitter.translational_rms_mm": 0.0,
    "distractors.count": 1,
}
PLAIN = Settings("easy/corridor", 1, STILL, (TrackerSpec(name="stay"),))
PICTURE = """() => {
    const image = document.querySelector('img[src^="blob:"]');
    if (!image.complete || image.naturalWidth === 0) return null;
    const canvas = document.createElement('canvas');
    canvas.width = image.naturalWidth;
    canvas.height = image.naturalHeight;
    canvas.getContext('2d').drawImage(image, 0, 0);
    return canvas.toDataURL('image/png');
}"""
DRAWS = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]


def until(true: Callable[[], Any], what: str, period_s: float = 0.1) -> Any:
    """What it returns, as soon as that is true."""
    end_s = time.monotonic() + 120.0
    while time.monotonic() < end_s:
        if found := true():
            return found
        time.sleep(period_s)
    raise AssertionError(f"not within two minutes: {what}")


@pytest.fixture(scope="module")
def studio() -> Iterator[Studio]:
    with Studio(PLAIN, port=0, most_pages=1, playing=False) as opened:
        yield opened


@pytest.fixture(scope="module")
def page(studio: Studio, launch_chromium: Callable[..., Any]) -> Iterator[Any]:
    browser = launch_chromium(*DRAWS)
    page = browser.new_page(viewport={"width": 1100, "height": 500})
    page.set_default_timeout(120_000)
    complaints: list[str] = []
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto(studio.address)
    page.wait_for_selector('img[src^="blob:"]')
    until(lambda: studio.page._server.get_clients(), "the page is connected")
    yield page
    browser.close()
    assert complaints == []


def received(page: Any) -> np.ndarray:
    """The picture in the page, grey."""
    address = until(lambda: page.evaluate(PICTURE), "the picture is loaded", 0.02)
    coded = base64.b64decode(address.partition(",")[2])
    return cv2.imdecode(np.frombuffer(coded, np.uint8), cv2.IMREAD_GRAYSCALE)


def shake_px(page: Any, studio: Studio, count: int = 4) -> float:
    """Median shift of the background from one received picture to the next, by optical flow."""
    shifts: list[float] = []
    before = received(page)
    for _ in range(count):
        page.get_by_role("button", name="Step", exact=True).click()
        shown = before
        for _ in range(100):
            shown = received(page)
            if not np.array_equal(shown, before):
                break
            time.sleep(0.1)
        points = cv2.goodFeaturesToTrack(before[:60], 80, 0.02, 4)
        moved, found, _ = cv2.calcOpticalFlowPyrLK(before, shown, points, None)
        shifts.append(float(np.median(np.linalg.norm((moved - points)[found == 1], axis=-1))))
        before = shown
    return float(np.median(shifts))


@pytest.mark.slow
def test_a_slider_shakes_the_pictures_that_arrive(page: Any, studio: Studio):
    assert shake_px(page, studio) < 0.05, "robot and camera stand still"
    page.get_by_role("tab", name="Stress axes").click()
    label = page.locator("label", has_text="jitter [deg RMS]").get_attribute("for")
    slider = page.locator(f"[id='{label}'] [role=slider]")
    slider.focus()
    for _ in range(20):
        slider.press("ArrowRight")
    until(lambda: studio.player.session.settings.physical("jitter") > 1.0, "the session has the slider's value")
    assert shake_px(page, studio) > 0.5


@pytest.mark.slow
def test_the_saved_file_reproduces_the_frames(page: Any, studio: Studio, tmp_path: Path):
    page.get_by_role("button", name="Restart from the beginning").click()
    until(lambda: studio.player.moment.frame.index == 0, "the restart")
    studio.player.ask(lambda session: session.advance())
    assert studio.player.session.exact
    page.get_by_role("tab", name="Episode").click()
    with page.expect_download() as download:
        page.get_by_role("button", name="Scenario (TOML)").click()
    download.value.save_as(tmp_path / "saved.toml")
    loaded = scenarios.load(str(tmp_path / "saved.toml"))
    assert loaded.resolve(1).axes.jitter.physical > 1.0
    with Simulation(loaded) as simulation:
        frames = [simulation.reset(1), simulation.advance()]
    for moment, frame in zip(studio.player.session.history, frames, strict=True):
        assert np.array_equal(moment.frame.image, frame.image)


@pytest.mark.slow
def test_a_click_on_somebody_in_the_scene_tracks_that_person(page: Any, studio: Studio):
    person = studio.player.session.people[1]
    client = next(iter(studio.page._server.get_clients().values()))
    model = studio.player.ask(lambda session: session.simulation.world.model)
    torso = studio.player.moment.geom_m[[model.geom(i).name == f"{person}/torso" for i in range(model.ngeom)]][0]
    client.camera.position, client.camera.look_at = torso + np.array([1.2, 0.0, 0.1]), torso
    canvas = max(
        (box for one in page.locator("canvas").all() if (box := one.bounding_box())), key=lambda box: box["height"]
    )
    middle = canvas["x"] + 0.5 * canvas["width"], canvas["y"] + 0.5 * canvas["height"]

    def tracked() -> bool:
        page.mouse.move(*middle)
        page.mouse.click(*middle, delay=50)
        page.wait_for_timeout(1500)
        return studio.player.session.person == person

    until(tracked, "the click")
    assert studio.player.moment.truth.name == person


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_texts_can_be_read(page: Any, scheme: str):
    page.evaluate("scheme => document.documentElement.setAttribute('data-mantine-color-scheme', scheme)", scheme)
    page.add_style_tag(content=".mantine-Notifications-root { display: none }")  # a message may be fading away
    page.wait_for_timeout(500)  # colours fade into each other
    assert faint_texts(page, 20) == []


@pytest.mark.slow
def test_a_page_too_many_is_refused_and_those_that_are_open_go_on(page: Any, studio: Studio):
    from websockets.exceptions import InvalidStatus
    from websockets.sync.client import connect

    assert studio.gate.open == 1
    with pytest.raises(InvalidStatus, match="503"):
        connect(studio.address.replace("http", "ws"), open_timeout=60)
    studio.player.ask(lambda session: session.change(replace(PLAIN, seed=2)))
    until(lambda: f"at seed {2}" in page.content(), "the status on the page")


def test_the_scene_catches_up_with_frames_that_follow_quickly(studio: Studio, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("pftrack_sim.studio.page._SCENE_HZ", 1.0)
    until(lambda: studio.page._view._batches, "the scene")
    moments = [studio.player.ask(lambda session: session.advance()) for _ in range(8)]
    target = next(one for one in studio.page._view._batches if one.owner == studio.player.session.people[0])
    for moment in moments[::7]:
        studio.page.controls.past = moment
        time.sleep(0.2)
    turned = np.einsum("nij,nj->ni", moment.geom_rotation[target.geoms], target.centres_m)
    expected = moment.geom_m[target.geoms] + turned
    until(lambda: np.allclose(target.handle.batched_positions, expected, atol=1e-5), "the poses of the last frame")
    studio.page.controls.past = None


def test_a_slider_says_what_it_did_once(studio: Studio):
    controls, before = studio.page.controls, studio.player.session.settings
    time_s = studio.player.moment.frame.time_s
    said = []
    for value in (12.0, 12.0):
        controls._wanted = {"noise": value}
        said.append(studio.player.ask(controls._take_axes))
    assert said == [f"noise 12 x analogue gain: applied from {time_s:.2f} s on.", None]
    studio.player.ask(lambda session: session.change(before))


def test_the_frame_of_a_notebook_shows_the_address(studio: Studio):
    assert f'src="{studio.address}"' in studio._repr_html_()


@pytest.mark.slow
def test_the_last_frame_of_an_episode_can_be_looked_at():
    with Studio(replace(PLAIN, overrides={**STILL, "duration_s": 0.6}), port=0) as opened:
        until(lambda: opened.player.session.over and not opened.player.playing, "the end of the episode")
        last_s = opened.player.session.history[-1].frame.time_s
        until(lambda: abs(opened.page.controls._scrub.max - last_s) < 0.01, "the slider reaches the last frame")


def test_a_game_pad_drives_the_robot_that_is_driven_by_hand(studio: Studio, monkeypatch: pytest.MonkeyPatch):
    command = np.array([0.5, 0.0, -1.0, 0.0])
    monkeypatch.setattr(studio.page.controls, "_pad", SimpleNamespace(read=lambda: command))
    before = studio.player.session.settings
    studio.player.ask(lambda session: session.change(replace(before, driver="hand")))
    until(lambda: np.array_equal(studio.player.session.hand, command), "the command")
    assert "forward +0.50, turn +0.00, pan -1.00" in studio.player.status
    studio.player.ask(lambda session: session.change(before))


TAKE = "parent.document.title='taken'"
HOSTILE = f'<img src=x onerror="{TAKE}"><iframe srcdoc="<script>{TAKE}</script>"></iframe> **bold** `code`'


@pytest.mark.slow
def test_texts_from_outside_are_shown_as_they_are_and_run_nothing(
    launch_chromium: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setitem(registry._REGISTRY.builtin, HOSTILE, registry._REGISTRY.builtin["stay"])
    settings = replace(PLAIN, trackers=(TrackerSpec(name=HOSTILE),))
    with Studio(settings, port=0, playing=False, isolation="never") as opened:
        browser = launch_chromium(*DRAWS)
        page = browser.new_page()
        page.set_default_timeout(120_000)
        answer = page.goto(opened.address)
        opened.player.request(lambda session: HOSTILE)
        for _ in range(3):
            opened.player.ask(lambda session: session.advance())
        until(lambda: page.locator(".uplot").count() > 0, "the plots")
        page.wait_for_timeout(1000)
        assert page.title() != "taken"
        assert page.locator("iframe").count() == 0
        assert HOSTILE in page.locator("body").inner_text(), "the status, word for word"
        assert page.locator('img[src="x"]').count() == 0
        assert "frame-src 'none'" in answer.headers["content-security-policy"]
        browser.close()
