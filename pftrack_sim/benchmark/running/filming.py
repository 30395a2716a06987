"""Videos, images and logs of an episode that is drawn for them, and videos of episodes that have been run.

Of the latter the frames are drawn again; the estimates are those that were stored.
"""

from __future__ import annotations

import contextlib
import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pftrack_sim.benchmark.asked.plan import Episode
from pftrack_sim.benchmark.kept.files import write_bytes
from pftrack_sim.benchmark.keys import slug
from pftrack_sim.benchmark.reading.store import RunStore
from pftrack_sim.benchmark.reading.summary import Result
from pftrack_sim.benchmark.running.rollout import Action, Sample, Sink, backwards, drive, rollout, simulated
from pftrack_sim.benchmark.running.sinks import ErrorLog, TruthLog, episode_log, latest, picture, video_writer
from pftrack_sim.benchmark.running.tracker_runner import TrackerRunner
from pftrack_sim.core.errors import ParameterError, RunError, UnknownNameError
from pftrack_sim.core.image_files import encode
from pftrack_sim.core.records import Estimate, Image
from pftrack_sim.env import TrackAndFollowEnv
from pftrack_sim.scenario import Scenario
from pftrack_sim.simulation.simulation import Simulation

_COLUMNS = ("estimate", "confidence", "estimate_occluded", "answered")
_COMMAND = ("command_forward", "command_turn", "command_pan", "command_tilt", "late_s")


def save_episode(
    scenario: Scenario,
    seed: int,
    *,
    video: Path | None = None,
    log: Path | None = None,
    image: Path | None = None,
    at_s: float = 0.0,
    truth: bool = False,
    runners: Sequence[TrackerRunner] = (),
    backend: str | None = None,
    on_frame: Callable[[], None] = lambda: None,
) -> None:
    """Write an episode as H.264, as a log, or as both, or else one frame of it as an image.

    Beside a video or log lie the picture and text of every tracker's error.

    Args:
        scenario: The scenario.
        seed: Root seed.
        video: File ending in `.mp4`.
        log: File ending in `.rrd` or `.mcap`.
        image: File ending in `.png` or `.jpg`; the episode ends at its frame.
        at_s: Time of that frame since the start of the episode, within its duration.
        truth: Draw the true boxes.
        runners: Fresh trackers; their estimates are drawn, with the true boxes.
        backend: Renderer, by name.
        on_frame: Called after every frame.
    """
    settings, until_s = scenario.resolve(seed), math.inf
    last: deque[Sample] = deque(maxlen=1)
    if image is not None:
        if image.suffix.lower() not in (".png", ".jpg", ".jpeg"):
            raise ParameterError(f"an image's name must end in .png or .jpg, got {str(image)!r}")
        if at_s > settings.duration_s:
            raise ParameterError(f"the episode lasts {settings.duration_s:g} s, so there is no frame at {at_s:g} s")
        until_s = at_s
    with Simulation(scenario, backend=backend) as simulation, contextlib.ExitStack() as opened:
        sinks: list[Sink] = [lambda _: on_frame(), last.append]
        if video is not None:
            add = opened.enter_context(video_writer(video, settings.camera.rate_hz))
            sinks.append(lambda sample: add(_drawn(sample, truth, runners), sample.time_s))
        if log is not None:
            sinks.append(opened.enter_context(episode_log(log, f"{scenario.name} seed {seed}", settings, runners)))
        errors = ErrorLog(runners)
        rollout(simulated(simulation, seed, until_s=until_s, sensors=log is not None), runners, [*sinks, errors])
    if image is not None:
        write_bytes(image, encode(_drawn(last[0], truth, runners), image.suffix))
        return
    beside = video or log or Path()
    stems = [f"{beside.stem}-error-{slug(runner.spec.label)}" for runner in runners]
    for name, content in errors.files(stems).items():
        write_bytes(beside.with_name(name), content)


def _drawn(sample: Sample, truth: bool, runners: Sequence[TrackerRunner]) -> Image:
    return picture(sample, latest(runners)) if truth or runners else sample.image


def worst(results: Sequence[Result], count: int, *, tracker: str | None = None, lost: bool = False) -> list[Result]:
    """The results with the lowest mean overlap, the lowest first; those in which nothing is scored are left out.

    Args:
        results: Of a run.
        count: How many of each tracker.
        tracker: Label or name of the only tracker that counts.
        lost: Only episodes that the tracker ends without having the target.

    Raises:
        UnknownNameError: No such tracker in the run.
        ParameterError: `count` is not positive.
    """
    if count < 1:
        raise ParameterError(f"the number of worst episodes must be >= 1, got {count}")
    known = {name: None for one in results for name in (one.label, one.tracker.name)}
    if tracker is not None and tracker not in known:
        raise UnknownNameError("tracker of this run", tracker, known)
    found: dict[str, list[Result]] = {}
    for one in results:
        counts = tracker in (None, one.label, one.tracker.name) and not one.never_seen
        if counts and (not lost or one.number("lost_for_good") > 0.0):
            found.setdefault(one.label, []).append(one)
    ordered = [sorted(group, key=lambda one: one.number("mean_overlap"))[:count] for group in found.values()]
    return [one for group in ordered for one in group]


def film(
    store: RunStore,
    results: Iterable[Result],
    *,
    backend: str | None = None,
    on_episode: Callable[[], None] = lambda: None,
) -> list[Path]:
    """Film the episodes of these results that have no video yet.

    Args:
        store: Run folder, open to write.
        results: Their episodes are filmed, each once, with all its trackers.
        backend: Renderer, by name.
        on_episode: Called after each episode.

    Returns:
        The videos of all these episodes.

    Raises:
        RunError: The frames that are drawn now are not those that the trackers saw, or a video cannot be written.
        RenderError: No renderer works.
    """
    videos: list[Path] = []
    for episode in {one.number: one for one in map(store.episode_of, results)}.values():
        videos.append(store.path / episode.video)
        if not videos[-1].is_file():
            _film(store, episode, videos[-1], backend)
        on_episode()
    return videos


def draw_again(episode: Episode, sinks: Sequence[Sink], backend: str | None = None) -> None:
    """Draw the frames of an open-loop episode again for sinks, in the order in which they were shown."""
    with Simulation(episode.scenario, backend=backend) as simulation:
        samples = simulated(simulation, episode.seed)
        rollout(backwards(samples) if episode.backward else samples, (), sinks)


def _film(store: RunStore, episode: Episode, video: Path, backend: str | None) -> None:
    shown = [one for one in store.results if one.values["number"] == episode.number]
    tables = [store.frame_columns(one, (*_COLUMNS, *(_COMMAND if episode.kind == "follow" else ()))) for one in shown]
    stored = {one.label: _estimates(episode, columns) for one, columns in zip(shown, tables, strict=True)}
    log = TruthLog()
    rate_hz = episode.scenario.resolve(episode.seed).camera.rate_hz
    with contextlib.ExitStack() as opened:
        add = opened.enter_context(video_writer(video, rate_hz))

        def draw(sample: Sample) -> None:
            estimates = {label: next(own) for label, own in stored.items()}
            add(picture(sample, estimates, store.plan.labels), sample.time_s)

        if episode.kind == "follow":
            env = opened.enter_context(contextlib.closing(TrackAndFollowEnv(episode.scenario, backend=backend)))
            commands = _commands(episode, tables[0])
            drive(env, episode.seed, lambda sample: next(commands), [log, draw])
        else:
            draw_again(episode, [log, draw], backend)
        if log.frames_digest != shown[0].values["frames_digest"]:
            raise _other_frames(episode)


def _other_frames(episode: Episode) -> RunError:
    """The error of an episode whose frames, or their number, are not those of the run."""
    return RunError(
        f"{episode.name}: the frames drawn now are not those that the trackers saw, so there is no video of it"
    )


def _estimates(episode: Episode, columns: Mapping[str, Any]) -> Iterator[Estimate | None]:
    """Estimates of a tracker, one for each frame; None where it did not answer."""
    for box, confidence, occluded, answered in zip(*(columns[name] for name in _COLUMNS), strict=True):
        yield Estimate(box, confidence=float(confidence), occluded=bool(occluded)) if answered else None
    raise _other_frames(episode)


def _commands(episode: Episode, columns: Mapping[str, Any]) -> Iterator[Action]:
    """The commands that were in force."""
    commands = np.stack([columns[name] for name in _COMMAND[:4]], axis=1)
    for command, late_s in zip(commands, columns["late_s"], strict=True):
        yield {"box": np.zeros(4), "command": command, "late_s": float(late_s)}
    raise _other_frames(episode)
