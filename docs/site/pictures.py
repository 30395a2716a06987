"""Draw the pictures of the documentation: `make pictures`; its parts are named in `main`."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import cv2
import gymnasium as gym
import numpy as np
import PIL.Image
from blocks import run_page
from story import CAMERA_PX, HEIGHT_PX, Story

from pftrack_sim import controllers, policies, scenario, trackers
from pftrack_sim.benchmark.asked.plan import TrackerSpec
from pftrack_sim.benchmark.running.rollout import Sample, rollout, simulated
from pftrack_sim.benchmark.running.sinks import video_writer
from pftrack_sim.benchmark.running.tracker_runner import make_runners
from pftrack_sim.core.boxes import iou
from pftrack_sim.core.records import Estimate, Frame, Image
from pftrack_sim.render.overlay import draw_frame
from pftrack_sim.simulation.simulation import Simulation

DOCS = Path(__file__).parents[1]
PICTURES = DOCS / "pictures"

TUTORIALS = {
    "first-benchmark": "axis.png",
    "first-tracker": "look.jpg",
    "own-scenario": "my-square.jpg",
    "your-room": "office.jpg",
    "following": "distance.png",
    "reading-results": "overlap.png",
}
"""Picture that the commands of a tutorial write."""

LEVELS = (0.0, 1.0, 2.0, 4.0)
STILL_QUALITY, MOVING_QUALITY = 65, 32

# Of each axis: scenario, seed, first and last second, pictures a second, and what else is set.
AXES: dict[str, tuple[str, int, float, float, float, dict[str, Any]]] = {
    "jitter": ("plaza-walk", 7, 2.0, 3.2, 10.0, {}),
    "occlusion": ("corridor", 9, 2.0, 6.0, 3.0, {}),
    "distractors": ("plaza-walk", 7, 2.0, 6.0, 3.0, {}),
    "target": ("easy/plaza-walk", 7, 2.0, 6.0, 3.0, {}),
    "light": ("warehouse", 8, 1.0, 5.0, 3.0, {}),
    "stream": ("plaza-walk", 7, 2.0, 3.2, 10.0, {}),
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
        "cards": draw_cards,
        "tutorials": draw_tutorials,
        "studio": draw_studio,
        "film": draw_film,
        "drawings": draw_drawings,
        "results": draw_results,
    }
    if unknown := set(parts) - set(known):
        sys.exit(f"unknown pictures {sorted(unknown)}; there are {', '.join(known)}")
    for name in parts or known:
        known[name]()


def draw_scenarios() -> None:
    """A frame of every scenario, with the true box of a target that can be seen well."""
    for name in scenario.names():
        overrides = {"camera.width_px": 480, "camera.height_px": 360, "camera.rate_hz": 10}
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


SIZE = {"camera.width_px": CAMERA_PX, "camera.height_px": HEIGHT_PX}
STORY = ("pftrack", "ko2012")
Value: TypeAlias = Callable[[Frame, Estimate], float]


def draw_moving() -> None:
    """The story of the front page, and an episode of each environment."""
    write_moving("story.webp", tracking_story("ko2012/video-1", seed=2, until_s=9.0)[44:200:4], 6.25)
    for short, shown in ENVIRONMENTS.items():
        write_moving(f"{short}.webp", environment_story(shown), 5.0)


def tracking_story(name: str, seed: int, until_s: float) -> list[Image]:
    """Two trackers on the same frames: something covers the person, one loses them, one holds."""
    sheets: list[Image] = []
    runners = make_runners([TrackerSpec(name=name) for name in STORY], seed=0)
    with Simulation(scenario.load(name, SIZE)) as simulation:
        simulation.reset(seed)
        story = Story(simulation.world.model, STORY, (0.0, until_s), (0.0, 1.0), "overlap with the truth")

        def add(sample: Sample) -> None:
            frame, found = sample.frame, {runner.spec.label: runner.estimates[-1] for runner in runners}
            assert frame is not None
            boxes = {label: estimate for label, estimate in found.items() if estimate is not None}
            sheets.append(story.sheet(frame, boxes, {label: overlap(frame, one) for label, one in boxes.items()}))

        rollout(simulated(simulation, seed, until_s=until_s), runners, [add])
    return sheets


def overlap(frame: Frame, estimate: Estimate) -> float:
    """Of an estimate with the truth."""
    return iou(estimate.box, frame.truth.box)


def distance_m(frame: Frame, _: Estimate) -> float:
    """Of the person from the camera."""
    return frame.truth.distance_m


class Shown(NamedTuple):
    """An episode of an environment: who drives or tracks, the value of the curve and its axis, seed and seconds."""

    env_id: str
    scene: str
    label: str
    make_policy: Callable[[Any], Any]
    value: Value
    title: str
    limits: tuple[float, float]
    seed: int = 5
    span_s: tuple[float, float] = (0.0, 4.8)


ENVIRONMENTS = {
    "track": Shown(
        "pftrack_sim/Track-v0",
        "corridor",
        "ko2012",
        lambda _: policies.TrackingPolicy(trackers.make("ko2012", seed=0)),
        overlap,
        "overlap with the truth",
        (0.0, 1.0),
    ),
    "follow": Shown(
        "pftrack_sim/Follow-v0",
        "follow/warehouse",
        "ko2012",
        lambda robot: policies.FollowPolicy(
            trackers.make("ko2012", seed=40, recognition="search"), controllers.make("servo-avoid"), robot
        ),
        distance_m,
        "distance [m]",
        (0.0, 6.0),
        40,
        (31.8, 37.4),
    ),
    "track-and-follow": Shown(
        "pftrack_sim/TrackAndFollow-v0",
        "follow/street",
        "pftrack",
        lambda robot: policies.TrackAndFollowPolicy(trackers.make("pftrack", seed=0), controllers.make("servo"), robot),
        overlap,
        "overlap with the truth",
        (0.0, 1.0),
    ),
}


def environment_story(shown: Shown) -> list[Image]:
    """Some seconds of an environment, five sheets a second."""
    sheets: list[Image] = []
    chosen = {**SIZE, "camera.rate_hz": 15}
    with gym.make(shown.env_id, scenario=shown.scene, overrides=chosen) as env:
        robot = policies.robot_parameters(scenario.load(shown.scene, chosen).resolve(shown.seed))
        policy = shown.make_policy(robot)
        observation, info = env.reset(seed=shown.seed)
        simulation = env.unwrapped.simulation  # type: ignore[attr-defined]
        story = Story(simulation.world.model, [shown.label], shown.span_s, shown.limits, shown.title)
        while simulation.frame.time_s <= shown.span_s[1]:
            action = policy(observation) if shown.env_id.endswith("Track-v0") else policy(observation, info)
            frame = simulation.frame
            if frame.time_s >= shown.span_s[0] and frame.index % 3 == 0:
                value = shown.value(frame, policy.estimate)
                sheets.append(story.sheet(frame, {shown.label: policy.estimate}, {shown.label: value}))
            observation, _, terminated, truncated, info = env.step(action)
            if terminated or truncated:
                break
    return sheets


CARD_SCENARIOS = ("hall", "street-night", "park", "warehouse", "real-market", "corridor")
# Of each tile: scenario, seed, second and axis at severity 2.
CARD_AXES = (
    ("warehouse", 8, 3.0, "noise"),
    ("corridor", 9, 4.5, "occlusion"),
    ("station", 7, 3.0, "blur"),
    ("hall", 7, 3.0, "light"),
)


def draw_cards() -> None:
    """The three cards of the front page: many scenarios, axes, and the robot that follows."""
    stills = [cv2.imread(str(PICTURES / "scenarios" / f"{name}.webp"))[..., ::-1] for name in CARD_SCENARIOS]
    write_still("cards/benchmark.webp", tiled(stills, columns=3))
    shaken = {"axes.jitter.severity": 2.0}
    frames = [axis_frames(axis, 2.0, name, seed, at_s, at_s, shaken)[-1] for name, seed, at_s, axis in CARD_AXES]
    write_still("cards/stress.webp", tiled([frame.image for frame in frames], columns=2))
    with PIL.Image.open(PICTURES / "follow.webp") as moving:
        moving.seek(moving.n_frames // 2)
        write_still("cards/follow.webp", tiled([np.asarray(moving.convert("RGB"))], columns=1))


def tiled(images: Sequence[Image], columns: int) -> Image:
    """Images of any size beside and below each other, 480 x 270 in all; what does not fit is cut off at the top."""
    rows = len(images) // columns
    width, height = 480 // columns, 270 // rows
    tiles: list[Image] = []
    for image in images:
        scale = max(width / image.shape[1], height / image.shape[0])
        scaled = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        left = (scaled.shape[1] - width) // 2
        tiles.append(scaled[-height:, left : left + width])
    return np.vstack([np.hstack(tiles[row * columns : (row + 1) * columns]) for row in range(rows)])


def draw_tutorials() -> None:
    """Run the tutorials, and keep the picture that each ends with."""
    for page, name in TUTORIALS.items():
        with tempfile.TemporaryDirectory() as folder:
            run_page(DOCS / f"{page}.md", Path(folder))
            stills = [cv2.imread(str(path)) for path in sorted(Path(folder).glob(f"{Path(name).stem}.[jp][pn]g"))]
        if not stills or any(one is None for one in stills):
            sys.exit(f"{page}.md has drawn no {name}")
        # Pictures of one name stand beside each other.
        height = max(one.shape[0] for one in stills)
        drawn = np.hstack([cv2.resize(one, (one.shape[1] * height // one.shape[0], height)) for one in stills])
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


def draw_results() -> None:
    """The numbers of the page of results."""
    from plots import draw

    for path in draw(DOCS / "results.md", PICTURES / "results"):
        print(f"{path.stat().st_size / 1000:6.0f} kB results/{path.name}", flush=True)


def draw_film() -> None:
    """A minute of the studio's page, in Chromium."""
    from studio_pictures import FILM_HZ, film

    path = PICTURES / "studio" / "minute.mp4"
    with video_writer(path, FILM_HZ, quality=33) as add:
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
    first, *others = (PIL.Image.fromarray(image) for image in images)
    ms = round(1000.0 / rate_hz)
    first.save(path, save_all=True, append_images=others, duration=ms, loop=0, quality=MOVING_QUALITY, method=6)
    print(f"{path.stat().st_size / 1000:6.0f} kB {name}, {len(images)} pictures", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
