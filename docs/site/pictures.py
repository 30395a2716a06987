"""Draw the pictures of the documentation: `make pictures`; its parts are named in `main`."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import cv2
import gymnasium as gym
import numpy as np
from blocks import run_page

from pftrack_sim import controllers, policies, scenario, trackers
from pftrack_sim.benchmark.asked.plan import TrackerSpec
from pftrack_sim.benchmark.running.rollout import rollout, simulated
from pftrack_sim.benchmark.running.sinks import picture, video_writer
from pftrack_sim.benchmark.running.tracker_runner import make_runners
from pftrack_sim.core.records import Frame, Image
from pftrack_sim.render.overlay import draw_frame
from pftrack_sim.simulation.simulation import Simulation

DOCS = Path(__file__).parents[1]
PICTURES = DOCS / "pictures"

TUTORIALS = {
    "first-benchmark": "axis.png",
    "first-tracker": "look.jpg",
    "own-scenario": "my-square.jpg",
    "following": "distance.png",
    "reading-results": "overlap.png",
}
"""Picture that the commands of a tutorial write."""

LEVELS = (0.0, 1.0, 2.0, 4.0)
STILL_QUALITY, MOVING_QUALITY = 65, 32

# Of each axis: scenario, seed, first and last second, pictures a second, and what else is set.
AXES: dict[str, tuple[str, int, float, float, float, dict[str, Any]]] = {
    "jitter": ("plaza-walk", 7, 2.0, 3.6, 10.0, {}),
    "occlusion": ("corridor", 9, 1.5, 6.5, 3.0, {}),
    "distractors": ("plaza-walk", 7, 2.0, 7.0, 3.0, {}),
    "target": ("easy/plaza-walk", 7, 2.0, 7.0, 3.0, {}),
    "light": ("warehouse", 8, 1.0, 6.0, 3.0, {}),
    "stream": ("plaza-walk", 7, 2.0, 3.6, 10.0, {}),
    # Stills. Exposure and readout act through motion in the image.
    "noise": ("warehouse", 8, 3.0, 3.0, 10.0, {}),
    "blur": ("plaza-walk", 7, 3.0, 3.0, 10.0, {"axes.jitter.severity": 1.0}),
    "rolling_shutter": ("plaza-walk", 7, 3.0, 3.0, 10.0, {"axes.jitter.severity": 1.0}),
    "distortion": ("corridor", 9, 3.0, 3.0, 10.0, {}),
}


def main(parts: Sequence[str]) -> None:
    """Draw some of the pictures, or all."""
    known = {
        "scenarios": draw_scenarios,
        "axes": draw_axes,
        "moving": draw_moving,
        "tutorials": draw_tutorials,
        "studio": draw_studio,
        "film": draw_film,
        "drawings": draw_drawings,
    }
    if unknown := set(parts) - set(known):
        sys.exit(f"unknown pictures {sorted(unknown)}; there are {', '.join(known)}")
    for name in parts or known:
        known[name]()


def draw_scenarios() -> None:
    """A frame of every scenario, with the true box of a target that can be seen well."""
    for name in scenario.names():
        overrides = {"camera.width_px": 280, "camera.height_px": 210, "camera.rate_hz": 10}
        with Simulation(scenario.load(name, overrides)) as simulation:
            frame = simulation.resume(7, [None] * 40)
            while frame.truth.visible_fraction < 0.9 and frame.time_s < 10.0:
                frame = simulation.advance()
        write_still(f"scenarios/{name.replace('/', '-')}.webp", draw_frame(frame, {}))


def draw_axes() -> None:
    """Every axis at its levels, beside each other."""
    for axis, (name, seed, from_s, to_s, rate_hz, more) in AXES.items():
        panels = [axis_frames(axis, level, name, seed, from_s, to_s, more) for level in LEVELS]
        times = np.arange(from_s, to_s + 1e-9, 1.0 / rate_hz)
        sheets = [np.hstack([panel_at(frames, time_s) for frames in panels]) for time_s in times]
        if len(sheets) == 1:
            write_still(f"axes/{axis}.webp", sheets[0])
        else:
            write_moving(f"axes/{axis}.webp", sheets, rate_hz)


def axis_frames(
    axis: str, level: float, name: str, seed: int, from_s: float, to_s: float, more: dict[str, Any]
) -> list[Frame]:
    """Frames of a scenario with an axis at a level, from the last one before a time to another time."""
    size = {"camera.width_px": 200, "camera.height_px": 150, "camera.rate_hz": 10}
    loaded = scenario.load(name, {**size, **more, f"axes.{axis}.severity": level})
    with Simulation(loaded) as simulation:
        found = [simulation.resume(seed, [None] * max(1, round(from_s * 10) - 4))]
        while found[-1].time_s < to_s - 1e-6:
            found.append(simulation.advance())
    return found


def panel_at(frames: Sequence[Frame], time_s: float) -> Image:
    """What a viewer sees at a time: the last frame delivered, with the true box."""
    frame = next((one for one in reversed(frames) if one.time_s <= time_s + 1e-6), frames[0])
    return cv2.copyMakeBorder(draw_frame(frame, {}), 0, 0, 1, 1, cv2.BORDER_CONSTANT, value=(255, 255, 255))


def draw_moving() -> None:
    """The walk of the front page, and an episode of each environment."""
    write_moving("walk.webp", tracked_walk(), 7.5)
    for short, env_id, scene, policy in ENVIRONMENTS:
        write_moving(f"{short}.webp", environment_pictures(env_id, scene, policy), 5.0)


def tracked_walk() -> list[Image]:
    """Two trackers on the same frames, while a pedestrian crosses and the camera shakes."""
    overrides = {"camera.width_px": 384, "camera.height_px": 288, "camera.rate_hz": 30, "axes.jitter.severity": 0.5}
    pictures: list[Image] = []
    runners = make_runners([TrackerSpec(name="ko2012"), TrackerSpec(name="opencv-mil")], seed=0)
    with Simulation(scenario.load("plaza-walk", overrides)) as simulation:
        rollout(
            simulated(simulation, 7, until_s=7.0),
            runners,
            [lambda step: pictures.append(picture(step.sample, runners))],
        )
    return pictures[3 * 30 :: 4]


ENVIRONMENTS: tuple[tuple[str, str, str, Callable[[], Any]], ...] = (
    ("track", "pftrack_sim/Track-v0", "corridor", lambda: policies.TrackingPolicy(trackers.make("ko2012", seed=0))),
    (
        "follow",
        "pftrack_sim/Follow-v0",
        "follow/warehouse",
        lambda: policies.FollowPolicy(trackers.make("oracle"), controllers.make("servo")),
    ),
    (
        "track-and-follow",
        "pftrack_sim/TrackAndFollow-v0",
        "follow/street",
        lambda: policies.TrackAndFollowPolicy(trackers.make("ko2012", seed=0), controllers.make("servo")),
    ),
)


def environment_pictures(env_id: str, scene: str, make_policy: Callable[[], Any]) -> list[Image]:
    """What `render` returns over some seconds, five pictures a second."""
    overrides = {"camera.width_px": 256, "camera.height_px": 192, "camera.rate_hz": 20}
    with gym.make(env_id, scenario=scene, overrides=overrides, render_mode="rgb_array") as env:
        policy, pictures = make_policy(), list[Image]()
        observation, info = env.reset(seed=5)
        for _ in range(96):
            action = policy(observation) if env_id.endswith("Track-v0") else policy(observation, info)
            observation, _, terminated, truncated, info = env.step(action)
            pictures.append(env.render())  # type: ignore[arg-type]
            if terminated or truncated:
                break
    return pictures[::4]


def draw_tutorials() -> None:
    """Run the tutorials, and keep the picture that each ends with."""
    for page, name in TUTORIALS.items():
        with tempfile.TemporaryDirectory() as folder:
            run_page(DOCS / f"{page}.md", Path(folder))
            drawn = cv2.imread(str(Path(folder) / name))
        if drawn is None:
            sys.exit(f"{page}.md has drawn no {name}")
        scale = min(1.0, 840.0 / drawn.shape[1])
        drawn = cv2.resize(drawn, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        write_still(f"tutorials/{page}.webp", drawn[..., ::-1])


def draw_studio() -> None:
    """The studio's page in its states, in Chromium."""
    from studio_pictures import shots

    for name, image in shots():
        height = image.shape[0] * 960 // image.shape[1]
        write_still(f"studio/{name}.webp", cv2.resize(image, (960, height), interpolation=cv2.INTER_AREA))


def draw_drawings() -> None:
    """How the package is built."""
    from drawings import draw

    draw(PICTURES / "design")


def draw_film() -> None:
    """A minute of the studio's page, in Chromium."""
    from studio_pictures import FILM_HZ, film

    path = PICTURES / "studio" / "minute.mp4"
    with video_writer(path, FILM_HZ, quality=30) as add:
        for index, image in enumerate(film()):
            height = image.shape[0] * 960 // image.shape[1]
            add(cv2.resize(image, (960, height), interpolation=cv2.INTER_AREA), index / FILM_HZ)
    print(f"{path.stat().st_size / 1000:6.0f} kB studio/minute.mp4, {index + 1} pictures", flush=True)


def write_still(name: str, image: Image) -> None:
    """Write a picture below `docs/pictures`."""
    path = PICTURES / name
    path.parent.mkdir(parents=True, exist_ok=True)
    if not cv2.imwrite(str(path), image[..., ::-1], [cv2.IMWRITE_WEBP_QUALITY, STILL_QUALITY]):
        sys.exit(f"cannot write {path}")
    print(f"{path.stat().st_size / 1000:6.0f} kB {name}", flush=True)


def write_moving(name: str, images: Sequence[Image], rate_hz: float) -> None:
    """Write an animated picture below `docs/pictures`, in an endless loop."""
    path = PICTURES / name
    path.parent.mkdir(parents=True, exist_ok=True)
    animation = cv2.Animation()
    animation.frames = [np.ascontiguousarray(image[..., ::-1]) for image in images]
    animation.durations = np.full(len(images), round(1000.0 / rate_hz), dtype=np.int32)
    if not cv2.imwriteanimation(str(path), animation, [cv2.IMWRITE_WEBP_QUALITY, MOVING_QUALITY]):
        sys.exit(f"cannot write {path}")
    print(f"{path.stat().st_size / 1000:6.0f} kB {name}, {len(images)} pictures", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
