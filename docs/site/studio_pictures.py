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

from pftrack_sim.benchmark.plan import TrackerSpec
from pftrack_sim.core.records import Image
from pftrack_sim.studio import Settings, Studio

SIZE = {"width": 1280, "height": 800}
WEBGL = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")
FILM_SIZE, FILM_HZ = {"width": 1024, "height": 640}, 1.0
"""Of the film; the simulation moves on by as much between two pictures."""

DRAWN_ON_REQUEST = """const draw = window.requestAnimationFrame.bind(window), waiting = [];
window.requestAnimationFrame = action => waiting.push(action);
window.drawNow = () => new Promise(done => draw(time => {
    for (const action of waiting.splice(0)) action(time);
    done();
}));
setInterval(window.drawNow, 8000);"""
"""Lets a page draw its 3D view for pictures, and seldom otherwise: without a graphics card that takes all cores."""

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
    coded, before = page.screenshot(), b""
    for _ in range(60):
        if coded == before:
            break
        page.wait_for_timeout(1500)
        coded, before = page.screenshot(), coded
    return decoded(coded)


def decoded(coded: bytes) -> Image:
    """A screenshot as an RGB image."""
    return cv2.cvtColor(cv2.imdecode(np.frombuffer(coded, np.uint8), cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)


def shots() -> Iterator[tuple[str, Image]]:
    """The page in three states: it plays; the camera shakes and one tracker is lost; a box is drawn."""
    trackers = TrackerSpec(name="ko2012"), TrackerSpec(name="pftrack")
    with opened(Settings("corridor", 3, CAMERA, trackers)) as (studio, page):
        page.locator(".mantine-Notification-closeButton").first.click()  # Chromium draws without a GPU here
        advance(studio, 4.0)
        screenshot(page)
        studio.player.playing = True
        page.wait_for_timeout(2000)
        yield "running", decoded(page.screenshot())
        studio.player.playing = False
        handle = slider(page, "jitter [deg RMS]")
        handle.focus()
        for _ in range(40):
            handle.press("ArrowRight")
        until(lambda: studio.player.session.settings.physical("jitter") > 2.99, "the slider's value")
        handle.blur()
        turn_back(studio)
        advance(studio, 4.0)
        yield "lost", screenshot(page)
    with opened(Settings("plaza-walk", 7, CAMERA, trackers)) as (studio, page):
        page.locator(".mantine-Notification-closeButton").first.click()
        advance(studio, 4.0)
        screenshot(page)
        page.get_by_role("button", name="Draw a box").click()
        screenshot(page)
        x, y = middle_of_view(page)
        page.keyboard.down("Shift")
        page.mouse.move(x + 68, y - 55)
        page.mouse.down()
        page.mouse.move(x + 158, y + 90, steps=8)
        yield "drawing", screenshot(page)


def film() -> Iterator[Image]:
    """A minute of the page: one tracker is lost under shake, time goes back, the light changes, another is tracked.

    The simulation is moved on from picture to picture, so the film shows the pace of a machine that keeps up.
    """
    trackers = TrackerSpec(name="ko2012"), TrackerSpec(name="pftrack")
    with opened(Settings("corridor", 3, CAMERA, trackers), script=DRAWN_ON_REQUEST, size=FILM_SIZE) as (studio, page):
        page.locator(".mantine-Notification-closeButton").first.click()

        def play(seconds: float) -> Iterator[Image]:
            for _ in range(round(seconds * FILM_HZ)):
                advance(studio, 1.0 / FILM_HZ)
                yield held(page)

        def pull(axis: str, label: str, keys: str, count: int) -> Iterator[Image]:
            handle, before = slider(page, label), studio.player.session.settings.physical(axis)
            handle.scroll_into_view_if_needed()
            handle.focus()
            for _ in range(count):
                handle.press(keys)
            until(lambda: studio.player.session.settings.physical(axis) != before, f"the slider of {axis}")
            handle.blur()
            turn_back(studio)
            yield from [held(page), held(page)]

        yield from play(9.0)
        yield from pull("jitter", "jitter [deg RMS]", "ArrowRight", 40)
        yield from play(10.0)
        yield from pull("jitter", "jitter [deg RMS]", "Home", 1)
        yield from play(4.0)
        time = slider(page, "Time [s]")
        box = time.bounding_box()
        assert box is not None
        x, y = box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"]
        page.mouse.move(x, y)
        page.mouse.down()
        for step in range(6):
            page.mouse.move(x - 10.0 * step, y)
            yield held(page)
        page.mouse.up()
        page.get_by_role("button", name="Restart from here").click()
        yield from [held(page), held(page)]
        yield from play(4.0)
        x, y = middle_of_view(page)
        page.mouse.move(x, y)
        page.mouse.down()
        for step in range(6):
            page.mouse.move(x + 25.0 * step, y - 8.0 * step)
            yield held(page)
        page.mouse.up()
        yield from pull("light", "light [EV]", "End", 1)
        yield from play(7.0)
        page.get_by_label("Tracked").click()
        yield held(page)
        page.get_by_role("option").nth(1).click()
        yield from [held(page), held(page)]
        yield from play(5.0)
        page.get_by_role("button", name="Command line").click()
        page.mouse.move(FILM_SIZE["width"] - 100.0, 400.0)
        page.mouse.wheel(0.0, -5000.0)
        for _ in range(4):
            yield held(page)


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
