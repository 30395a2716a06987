"""Write an episode of a scenario as a video, or one of its frames as an image."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path

from pftrack_sim.benchmark.kept.files import write_bytes
from pftrack_sim.benchmark.keys import slug
from pftrack_sim.benchmark.running.rollout import Sample, Sink, Step, rollout, simulated
from pftrack_sim.benchmark.running.sinks import ErrorLog, episode_log, picture, video_writer
from pftrack_sim.benchmark.running.tracker_runner import TrackerRunner
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.image_files import encode
from pftrack_sim.core.records import Image
from pftrack_sim.scenario import Scenario
from pftrack_sim.simulation.simulation import Simulation


def save_video(
    scenario: Scenario,
    seed: int,
    path: Path | None,
    *,
    log: Path | None = None,
    truth: bool = False,
    runners: Sequence[TrackerRunner] = (),
    backend: str | None = None,
    on_frame: Callable[[], None] = lambda: None,
) -> None:
    """Write an episode as H.264, as a log, or as both; beside it the picture and text of every tracker's error.

    Args:
        scenario: The scenario.
        seed: Root seed.
        path: File ending in `.mp4`, or None.
        log: File ending in `.rrd` or `.mcap`, or None.
        truth: Draw the true boxes.
        runners: Fresh trackers; their estimates are drawn, with the true boxes.
        backend: Renderer, by name.
        on_frame: Called after every frame.
    """
    settings = scenario.resolve(seed)
    with Simulation(scenario, backend=backend) as simulation, ExitStack() as opened:
        sinks: list[Sink] = [lambda step: on_frame()]
        if path is not None:
            add = opened.enter_context(video_writer(path, settings.camera.rate_hz))
            sinks.append(lambda step: add(_drawn(step.sample, truth, runners), step.sample.time_s))
        if log is not None:
            sinks.append(opened.enter_context(episode_log(log, f"{scenario.name} seed {seed}", settings, runners)))
        errors = ErrorLog(runners)
        rollout(simulated(simulation, seed, sensors=log is not None), runners, [*sinks, errors])
    beside = path or log or Path()
    stems = [f"{beside.stem}-error-{slug(runner.spec.label)}" for runner in runners]
    for name, content in errors.files(stems).items():
        write_bytes(beside.with_name(name), content)


def save_image(
    scenario: Scenario,
    seed: int,
    path: Path,
    *,
    at_s: float = 0.0,
    truth: bool = False,
    runners: Sequence[TrackerRunner] = (),
    backend: str | None = None,
) -> None:
    """Write one frame as PNG or JPEG.

    Args:
        scenario: The scenario.
        seed: Root seed.
        path: File ending in `.png` or `.jpg`.
        at_s: Time of the frame since the start of the episode, within its duration.
        truth: Draw the true boxes.
        runners: Fresh trackers, run up to this frame; their estimates are drawn, with the true boxes.
        backend: Renderer, by name.
    """
    if path.suffix.lower() not in (".png", ".jpg", ".jpeg"):
        raise ParameterError(f"an image's name must end in .png or .jpg, got {str(path)!r}")
    duration_s = scenario.resolve(seed).duration_s
    if at_s > duration_s:
        raise ParameterError(f"the episode lasts {duration_s:g} s, so there is no frame at {at_s:g} s")
    last: deque[Step] = deque(maxlen=1)
    with Simulation(scenario, backend=backend) as simulation:
        rollout(simulated(simulation, seed, until_s=at_s), runners, [last.append])
    write_bytes(path, encode(_drawn(last[0].sample, truth, runners), path.suffix))


def _drawn(sample: Sample, truth: bool, runners: Sequence[TrackerRunner]) -> Image:
    return picture(sample, runners) if truth or runners else sample.image
