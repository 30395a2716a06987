"""Draw the pictures of the studio's page in headless Chromium: what `pictures.py studio` and `film` run."""

from __future__ import annotations

import shutil
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import cv2
import numpy as np
from playwright.sync_api import Locator, Page, sync_playwright

from pftrack_sim.benchmark.asked.plan import TrackerSpec
from pftrack_sim.core.records import Image
from pftrack_sim.studio import Settings, Studio

SIZE = {"width": 1280, "height": 800}
WEBGL = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")
FILM_SIZE, FILM_HZ, FILM_SPEED = {"width": 1024, "height": 640}, 1.0, 0.5
"""Of the film: size, pictures per second, and simulated seconds per second."""

DRAWN_ON_REQUEST = """const draw = window.requestAnimationFrame.bind(window), waiting = [];
window.requestAnimationFrame = action => waiting.push(action);
window.drawNow = () => new Promise(done => draw(time => {
    for (const action of waiting.splice(0)) action(time);
    done();
}));
setInterval(window.drawNow, 8000);"""
"""Lets a page draw its 3D view for pictures, and seldom otherwise: without a graphics card that takes all cores."""

TO_THE_TOP = "for (const one of document.querySelectorAll('*')) one.scrollTop = 0"

CAMERA = {"camera.width_px": 320, "camera.height_px": 240, "camera.rate_hz": 15}


@contextmanager
def opened(
    settings: Settings, *, script: str = "", size: dict[str, int] = SIZE, **options: Any
) -> Iterator[tuple[Studio, Page]]:
    """A studio that is paused, and its page in Chromium, which runs a script before those of the page."""
    chromium = shutil.which("chromium") or shutil.which("google-chrome") or sys.exit("there is no Chromium here")
    with Studio(settings, port=0, playing=False, **options) as studio, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox", *WEBGL])
        page = browser.new_page(viewport=size)  # type: ignore[arg-type]
        page.set_default_timeout(120_000)
        page.add_init_script(script)
        page.goto(studio.address)
        page.wait_for_selector('img[src^="blob:"]')
        yield studio, page
        browser.close()


def slider(page: Page, label: str) -> Locator:
    """The handle of a slider, which takes keys."""
    name = page.locator("label", has_text=label).get_attribute("for")
    return page.locator(f"[id='{name}'] [role=slider]")


def until(true: Callable[[], Any], what: str) -> None:
    """Wait at most two minutes."""
    for _ in range(1200):
        if true():
            return
        time.sleep(0.1)
    sys.exit(f"not within two minutes: {what}")


def advance(studio: Studio, seconds: float) -> None:
    """Move on by simulated time."""

    def move(session: Any) -> None:
        end_s = session.moment.frame.time_s + seconds
        while session.moment.frame.time_s < end_s and not session.over:
            session.advance()

    studio.player.ask(move, timeout_s=300.0)


def screenshot(page: Page) -> Image:
    """`(H, W, 3)` uint8 RGB: the page, once it does not change any more."""
    shown, before = held(page), None
    for _ in range(60):
        if before is not None and np.array_equal(shown, before):
            break
        page.wait_for_timeout(1000)
        shown, before = held(page), shown
    return shown


def decoded(coded: bytes) -> Image:
    """A screenshot as an RGB image."""
    return cv2.cvtColor(cv2.imdecode(np.frombuffer(coded, np.uint8), cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)


def shots() -> Iterator[tuple[str, Image]]:
    """The page in three states: it plays; the camera shakes and one tracker is lost; a box is drawn."""
    trackers = TrackerSpec(name="ko2012"), TrackerSpec(name="pftrack")
    with opened(Settings("corridor", 3, CAMERA, trackers), script=DRAWN_ON_REQUEST) as (studio, page):
        page.locator(".mantine-Notification-closeButton").first.click()  # Chromium draws without a GPU here
        advance(studio, 4.0)
        screenshot(page)
        studio.player.playing = True
        page.wait_for_timeout(2000)
        yield "running", held(page)
        studio.player.playing = False
        page.get_by_role("tab", name="Stress axes").click()
        handle = slider(page, "jitter [deg RMS]")
        handle.focus()
        handle.press("End")
        until(lambda: studio.player.session.settings.physical("jitter") > 6.0, "the slider's value")
        handle.blur()
        turn_back(studio)
        advance(studio, 4.0)
        yield "lost", screenshot(page)
    with opened(Settings("plaza-walk", 7, CAMERA, trackers), script=DRAWN_ON_REQUEST) as (studio, page):
        page.locator(".mantine-Notification-closeButton").first.click()
        advance(studio, 4.0)
        screenshot(page)
        page.get_by_role("button", name="Draw a box").click()
        screenshot(page)
        x, y = middle_of_view(page)
        page.keyboard.down("Shift")
        page.mouse.move(x + 42, y - 42)
        page.mouse.down()
        page.mouse.move(x + 112, y + 66, steps=8)
        yield "drawing", screenshot(page)


def film() -> Iterator[Image]:
    """A minute of the page: a tracker is lost under shake, time goes back, the light changes, another is tracked.

    The simulation is moved on from picture to picture, so the film shows the pace of a machine that keeps up.
    """
    trackers = TrackerSpec(name="ko2012"), TrackerSpec(name="pftrack")
    with opened(Settings("corridor", 3, CAMERA, trackers), script=DRAWN_ON_REQUEST, size=FILM_SIZE) as (studio, page):
        page.locator(".mantine-Notification-closeButton").first.click()
        page.get_by_role("tab", name="Stress axes").click()
        x, y = middle_of_view(page)

        def play(count: int) -> Iterator[Image]:
            for _ in range(count):
                advance(studio, FILM_SPEED / FILM_HZ)
                yield held(page)

        def pull(axis: str, key: str, count: int) -> Iterator[Image]:
            handle, before = slider(page, f"{axis} ["), studio.player.session.settings.physical(axis)
            handle.scroll_into_view_if_needed()
            handle.focus()
            for _ in range(count):
                handle.press(key)
            until(lambda: studio.player.session.settings.physical(axis) != before, f"the slider of {axis}")
            handle.blur()
            turn_back(studio)
            yield held(page)
            page.evaluate(TO_THE_TOP)
            yield held(page)

        def drag(x: float, y: float, dx: float, dy: float) -> Iterator[Image]:
            page.mouse.move(x, y)
            page.mouse.down()
            for step in range(1, 7):
                page.mouse.move(x + step * dx, y + step * dy)
                yield held(page)
            page.mouse.up()

        yield from play(10)
        yield from pull("jitter", "End", 1)
        yield from play(12)
        yield from pull("jitter", "Home", 1)
        time = slider(page, "Time [s]").bounding_box()
        assert time is not None
        yield from drag(time["x"] + 0.5 * time["width"], time["y"] + 0.5 * time["height"], -9.0, 0.0)
        page.get_by_role("button", name="Restart from here").click()
        yield held(page)
        yield from play(8)
        yield from drag(x, y, 25.0, -8.0)
        yield from pull("light", "End", 1)
        yield from play(6)
        people = [one for one in studio.player.moment.frame.people if one.scored and one.name != "target"]
        page.get_by_role("tab", name="Episode").click()
        page.get_by_label("Tracked").click()
        yield held(page)
        page.get_by_role("option", name=people[0].name if people else "distractor-1").click()
        yield from play(4)
        page.get_by_role("button", name="Command line").click()
        page.evaluate(TO_THE_TOP)
        yield from [held(page), held(page), held(page)]


def held(page: Page) -> Image:
    """`(H, W, 3)` uint8 RGB: the page after the time in which curves and status are written again."""
    page.wait_for_timeout(300)
    for _ in range(2):  # messages are read in one, and drawn in the next
        page.evaluate("window.drawNow()")
    return decoded(page.screenshot())


def turn_back(studio: Studio) -> None:
    """Look from behind the robot again: keys that move a slider turn the view, too."""
    for client in studio.page._server.get_clients().values():
        studio.page._view._look_over(client)


def middle_of_view(page: Page) -> tuple[float, float]:
    """Middle of the 3D view [px]."""
    boxes = [box for one in page.locator("canvas").all() if (box := one.bounding_box())]
    largest = max(boxes, key=lambda box: box["width"] * box["height"])
    return largest["x"] + 0.5 * largest["width"], largest["y"] + 0.5 * largest["height"]
