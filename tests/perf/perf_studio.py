"""What the studio costs and how soon it reacts, with one page in headless Chromium: 320x240, two trackers.

    processor time of the studio per frame / that of its session alone

and, by the clock, frames per second and the time from a key that moves the slider of the noise to the first picture in
the page that is noisy, or clean again, both by the page's clock. The commands of WebGL are dropped unless `--draw` is
given: a page draws on the graphics card of its own machine, and without one Chromium takes all cores for it. Times by
the clock say something on an idle machine only; the load is printed beside them.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2] / "docs" / "site"))

from studio_pictures import CAMERA, opened, slider, until

from pftrack_sim.benchmark.asked.plan import TrackerSpec
from pftrack_sim.studio import Session, Settings, Studio

SETTINGS = Settings(
    "corridor",
    3,
    {**CAMERA, "camera.rate_hz": 30, "duration_s": 600},
    (TrackerSpec(name="ko2012"), TrackerSpec(name="pftrack")),
)
DROP_DRAWING = """for (const name of ['drawElements', 'drawArrays', 'drawElementsInstanced', 'drawArraysInstanced'])
    WebGL2RenderingContext.prototype[name] = () => {};"""
PROBE = """() => {
    window.probe = {pictures: [], keys: []};
    document.addEventListener('keydown', () => window.probe.keys.push(performance.now()), true);
    const canvas = document.createElement('canvas');
    const [width, height] = [80, 60];
    canvas.width = width;
    canvas.height = height;
    const context = canvas.getContext('2d', {willReadFrequently: true});
    let last = '';
    setInterval(() => {
        const image = document.querySelector('img[src^="blob:"]');
        if (!image || image.src === last || !image.complete || !image.naturalWidth) return;
        last = image.src;
        context.drawImage(image, 120, 160, width, height, 0, 0, width, height);
        const pixels = context.getImageData(0, 0, width, height).data;
        let rough = 0;
        for (let i = 4; i < pixels.length; i += 4) rough += Math.abs(pixels[i] - pixels[i - 4]);
        window.probe.pictures.push([performance.now(), rough]);
    }, 4);
}"""

write = sys.stdout.write


def main() -> None:
    """Measure, and print one line for each quantity."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=20.0, help="how long frames are counted")
    parser.add_argument("--pulls", type=int, default=20, help="how often the slider is moved")
    parser.add_argument("--draw", action="store_true", help="let the page draw the 3D view on this machine")
    given = parser.parse_args()
    alone_s = alone()
    with opened(SETTINGS, script="" if given.draw else DROP_DRAWING) as (studio, page):
        page.evaluate(PROBE)
        studio.player.playing = True
        until(lambda: studio.player.moment.frame.index > 20, "the first frames")
        before = counts(studio, page)
        page.wait_for_timeout(1000.0 * given.seconds)
        wall_s, processor_s, frames, shown = (b - a for a, b in zip(before, counts(studio, page), strict=True))
        write(f"frames/s {frames / wall_s:.1f} of 30, pictures/s in the page {shown / wall_s:.1f}\n")
        write(
            f"processor time per frame {1000.0 * processor_s / frames:.0f} ms, "
            f"{processor_s / frames / alone_s:.2f} times the session alone ({1000.0 * alone_s:.0f} ms)\n"
        )
        page.get_by_role("tab", name="Stress axes").click()
        handle = slider(page, "noise [x analogue gain]")
        handle.focus()
        for pull in range(given.pulls):
            enough = page.evaluate("window.probe.pictures.length") + 6
            handle.press("Home" if pull % 2 else "End")
            page.wait_for_function("count => window.probe.pictures.length > count", arg=enough)
        probe = page.evaluate("window.probe")
    pictures, keys = np.array(probe["pictures"]), np.array(probe["keys"])
    write(f"slider to picture: {summary(latencies_ms(pictures, keys))}\n")
    write(f"load of the machine (1, 5, 15 min): {', '.join(f'{load:.1f}' for load in os.getloadavg())}\n")


def alone(count: int = 100) -> float:
    """Processor time of a frame [s] in a session without player and page."""
    session = Session(SETTINGS)
    for _ in range(20):
        session.advance()
    start_s = time.process_time()
    for _ in range(count):
        session.advance()
    spent_s = time.process_time() - start_s
    session.close()
    return spent_s / count


def counts(studio: Studio, page: Any) -> tuple[float, float, int, int]:
    """Clock [s], processor time [s], frames so far, pictures in the page so far."""
    shown = page.evaluate("window.probe.pictures.length")
    return time.perf_counter(), time.process_time(), studio.player.moment.frame.index, shown


def latencies_ms(pictures: np.ndarray, keys: np.ndarray) -> np.ndarray:
    """Time from each key to the first picture beyond the middle between what was before it and what came in the end.

    Args:
        pictures: `(N, 2)` times [ms] and roughness.
        keys: `(M,)` times [ms].
    """
    found: list[float] = []
    for key, end in zip(keys, [*keys[1:], np.inf], strict=True):
        then = pictures[(pictures[:, 0] > key) & (pictures[:, 0] <= end)]
        earlier = pictures[pictures[:, 0] <= key]
        if len(then) < 3 or len(earlier) < 3:
            continue
        old, new = np.median(earlier[-3:, 1]), np.median(then[-3:, 1])
        beyond = (then[:, 1] - 0.5 * (old + new)) * (new - old) > 0.0
        found.append(float(then[beyond][0, 0] - key))
    return np.array(found)


def summary(times_ms: np.ndarray) -> str:
    """Median and 95th percentile."""
    if not len(times_ms):
        return "no pull changed the picture"
    return f"median {np.median(times_ms):.0f} ms, 95 % {np.percentile(times_ms, 95):.0f} ms, of {len(times_ms)} pulls"


if __name__ == "__main__":
    main()
