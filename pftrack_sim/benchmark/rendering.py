"""A scenario to look at: its episode as a video, or one of its frames."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import cv2

from pftrack_sim.benchmark.tracker_runner import TrackerRun
from pftrack_sim.benchmark.video import VideoWriter
from pftrack_sim.core.errors import ParameterError, RunError
from pftrack_sim.core.records import Frame, Image
from pftrack_sim.render.overlay import draw_frame
from pftrack_sim.scenario import Scenario
from pftrack_sim.simulation.simulation import Simulation


def save_video(
    scenario: Scenario,
    seed: int,
    path: Path,
    *,
    truth: bool = False,
    entries: Sequence[TrackerRun] = (),
    backend: str | None = None,
    on_frame: Callable[[], None] = lambda: None,
) -> None:
    """Write an episode as H.264.

    Args:
        scenario: What to show.
        seed: Root seed.
        path: File ending in `.mp4`.
        truth: Draw the truth's boxes.
        entries: Fresh trackers that see every frame; what they say is drawn, with the truth.
        backend: Renderer, by name.
        on_frame: Called after every frame.
    """
    rate_hz = scenario.resolve(seed).camera.rate_hz
    with Simulation(scenario, backend=backend) as simulation, VideoWriter(path, rate_hz) as writer:
        frame = simulation.reset(seed)
        writer.add(_picture(frame, truth, entries))
        on_frame()
        for _ in range(simulation.frame_count - 1):
            frame = simulation.advance()
            writer.add(_picture(frame, truth, entries))
            on_frame()


def save_image(
    scenario: Scenario,
    seed: int,
    path: Path,
    *,
    at_s: float = 0.0,
    truth: bool = False,
    entries: Sequence[TrackerRun] = (),
    backend: str | None = None,
) -> None:
    """Write one frame as PNG or JPEG.

    Args:
        scenario: What to show.
        seed: Root seed.
        path: File ending in `.png` or `.jpg`.
        at_s: Time of the frame since the start of the episode; it must lie within the episode.
        truth: Draw the truth's boxes.
        entries: Fresh trackers that see every frame up to this one; what they say of it is drawn, with the truth.
        backend: Renderer, by name.
    """
    if path.suffix.lower() not in (".png", ".jpg", ".jpeg"):
        raise ParameterError(f"an image's name must end in .png or .jpg, got {str(path)!r}")
    settled = scenario.resolve(seed)
    if at_s > settled.duration_s:
        raise ParameterError(f"the episode lasts {settled.duration_s:g} s, so there is no frame at {at_s:g} s")
    with Simulation(scenario, backend=backend) as simulation:
        frame = simulation.reset(seed)
        picture = _picture(frame, truth, entries)
        while frame.time_s < at_s - 0.5 / settled.camera.rate_hz:
            frame = simulation.advance()
            picture = _picture(frame, truth, entries)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        written = cv2.imwrite(str(path), cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))
    except (OSError, cv2.error) as error:
        raise RunError(f"cannot write the image {path}: {error}") from None
    if not written:
        raise RunError(f"cannot write the image {path}")


def _picture(frame: Frame, truth: bool, entries: Sequence[TrackerRun]) -> Image:
    """Show a frame to the trackers, and draw what is wanted over it."""
    answers = [(one.name, one.see(frame.image, frame.truth.box, frame.truth.scored)) for one in entries]
    said = {name: estimate for name, estimate in answers if estimate is not None}
    return draw_frame(frame, said) if truth or entries else frame.image
