"""One episode as a unit of work: run it, score its trackers, and return its files as bytes.

It runs in any process on any machine; workers and the parent need no common disk.
"""

from __future__ import annotations

import contextlib
import tempfile
import threading
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pftrack_sim
from pftrack_sim import controllers, policies
from pftrack_sim.benchmark.asked.plan import Episode
from pftrack_sim.benchmark.keys import differences, environment
from pftrack_sim.benchmark.running.frame_cache import DamagedEntry, EntryWriter, FrameCache
from pftrack_sim.benchmark.running.results import write_results
from pftrack_sim.benchmark.running.rollout import Backwards, Driver, Sample, Sink, detected, drive, rollout, simulated
from pftrack_sim.benchmark.running.sinks import ErrorLog, FollowLog, TruthLog, episode_log, picture, video_writer
from pftrack_sim.benchmark.running.tracker_runner import Isolation, TrackerRunner, make_runners
from pftrack_sim.core.errors import RunError
from pftrack_sim.env import TrackAndFollowEnv
from pftrack_sim.logs import FORMATS
from pftrack_sim.scenario import ResolvedScenario
from pftrack_sim.scene.robot import fitted_settings
from pftrack_sim.simulation.simulation import Simulation
from pftrack_sim.trackers.isolation import Limits, TrackerProcesses

WITHOUT_IMAGES = "none"
"""The renderer of runs without images."""

# OpenGL contexts belong to threads: a process renders one episode at a time, however many threads a cluster gives it.
_render_lock = threading.Lock()


@dataclass(frozen=True)
class EpisodeJob:
    """An episode and how to run it.

    Attributes:
        labels: All trackers of the run: they give each its colour in the video.
        logs: Formats of logs to write.
        backend: Renderer, by name; `WITHOUT_IMAGES` for an episode without images.
        cache: Where frames of open loops are kept, on the worker's machine; None: nowhere.
        scratch: Folder for temporary files, if the worker has it.
        apart: Whether each tracker runs in a process of its own: one of them may have ended the process of a worker.
    """

    episode: Episode
    video: bool = False
    backend: str | None = None
    isolation: Isolation = "auto"
    limits: Limits = field(default_factory=Limits)
    logs: tuple[str, ...] = ()
    scratch: Path | None = None
    apart: bool = False
    labels: tuple[str, ...] = ()
    cache: FrameCache | None = None


@dataclass(frozen=True)
class EpisodeFiles:
    """What an episode leaves: contents of files by their paths within the run folder, and each tracker's scores."""

    contents: dict[str, bytes]
    frames: int
    rows: tuple[dict[str, Any], ...]


def run_episode(
    job: EpisodeJob,
    on_frame: Callable[[], None] = lambda: None,
    processes: TrackerProcesses | None = None,
) -> EpisodeFiles:
    """Run an episode; processes of isolated trackers stay in `processes`, or else end with it.

    Raises:
        RenderError: No renderer works.
        ScenarioError: The scenario contradicts itself at this seed.
        RunError: No space for its files, or other code or versions than the run has.
    """
    lines = "\n".join(f"  {line}" for line in differences(job.episode.environment, environment()))
    if lines:
        raise RunError(f"this worker has other code or versions than the run, so its results would differ\n{lines}")
    try:
        return _run(job, on_frame, processes)
    except DamagedEntry:  # it is gone: the frames are drawn
        return _run(job, on_frame, processes)


def _run(job: EpisodeJob, on_frame: Callable[[], None], processes: TrackerProcesses | None) -> EpisodeFiles:
    episode = job.episode
    with _render_lock, ExitStack() as stack:
        try:
            own = job.scratch if job.scratch is not None and job.scratch.is_dir() else None
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="pftrack-sim-", dir=own)))
        except OSError as error:
            raise RunError(f"cannot make a temporary folder: {error.strerror}") from None
        runners = make_runners(
            episode.trackers,
            seed=episode.seed,
            isolation=job.isolation,
            limits=job.limits,
            apart=job.apart,
            processes=processes,
            box_noise=episode.box_noise,
            first_frame=episode.first_frame,
        )
        for runner in runners:
            stack.callback(runner.close)
        settings = fitted_settings(episode.scenario.resolve(episode.seed))
        log, course = TruthLog(), FollowLog()
        following: dict[str, Any] = {}
        errors = ErrorLog(runners, job.labels)
        sinks: list[Sink] = [log, errors]
        video = folder / "episode.mp4"
        with ExitStack() as open_files:
            if job.video:
                add = open_files.enter_context(video_writer(video, settings.camera.rate_hz))
                sinks.append(lambda step: add(picture(step.sample, runners, job.labels), step.sample.time_s))
            logs = {name: folder / f"episode{FORMATS[name].suffix}" for name in job.logs}
            sinks += [
                open_files.enter_context(episode_log(one, episode.name, settings, runners)) for one in logs.values()
            ]
            sinks.append(lambda step: on_frame())
            if episode.kind == "follow":
                images = job.backend != WITHOUT_IMAGES
                made = TrackAndFollowEnv(episode.scenario, backend=job.backend if images else None, image=images)
                env = stack.enter_context(contextlib.closing(made))
                drive(env, episode.seed, _driver(runners[0], settings, episode.latency_ms), [*sinks, course])
                following = course.scores(settings, env.simulation.frame_count)
                graphics = env.simulation.graphics
            else:
                graphics = _show(job, runners, sinks, log, folder)
        metadata = {
            **following,
            "frames_digest": log.frames_digest,
            "episode_frames": len(log.truths),
            "rate_hz": settings.camera.rate_hz,
            "levels": dict(episode.condition.levels),
            "graphics": graphics,
            "version": pftrack_sim.__version__,
        }
        contents, rows = write_results(folder, episode, log, runners, course.columns(), metadata)
        files = [one.path for one in episode.results]
        contents |= {f"errors/{name}": content for name, content in errors.files(files).items()}
        contents |= {f"logs/{episode.path}{path.suffix}": path.read_bytes() for path in logs.values()}
        contents |= {episode.video: video.read_bytes()} if job.video else {}
        return EpisodeFiles(contents, len(log.truths), tuple(rows))


def _show(job: EpisodeJob, runners: list[TrackerRunner], sinks: list[Sink], log: TruthLog, folder: Path) -> str:
    """Show the frames of an episode in open loop to trackers; returns what drew them."""

    def shown(samples: Iterable[Sample]) -> Iterable[Sample]:
        episode, wanted = job.episode, any(runner.needs_detections for runner in runners)
        return detected(samples, episode.scenario.resolve(episode.seed), episode.seed) if wanted else samples

    if not job.episode.backward:
        return _draw(job, lambda samples, more: rollout(shown(samples), runners, [*sinks, *more]), log)
    with Backwards(folder) as kept:
        drawn = TruthLog()
        graphics = _draw(job, lambda samples, more: rollout(samples, (), [drawn, kept, *more]), drawn)
        rollout(shown(kept.samples()), runners, sinks)
        return graphics


def _draw(job: EpisodeJob, show: Callable[[Iterable[Sample], list[Sink]], None], log: TruthLog) -> str:
    """Give `show` the frames of an episode, drawn or from the cache, and more sinks; returns what drew them.

    Raises:
        DamagedEntry: The frames came from the cache, and are not those that were drawn.
    """
    # Logs hold what the robot sensed, which is not in the cache.
    episode, frames = job.episode, job.cache if not job.logs else None
    entry = frames.entry(episode.drawn_key, job.backend) if frames is not None else None
    if frames is not None and entry is not None and (cached := frames.open(entry)) is not None:
        show(cached.samples(), [])
        if log.frames_digest != cached.frames_digest:
            frames.remove(entry)
            raise DamagedEntry
        return cached.graphics
    with ExitStack() as opened:
        simulation = opened.enter_context(Simulation(episode.scenario, backend=job.backend))
        writer = None
        if frames is not None and entry is not None:
            with contextlib.suppress(OSError):  # a cache that cannot be written costs time, not the run
                writer = opened.enter_context(EntryWriter(frames, entry))
        show(simulated(simulation, episode.seed, sensors=bool(job.logs)), [writer] if writer else [])
        if writer is not None:
            writer.finish(log, simulation.graphics)
        return simulation.graphics


def _driver(runner: TrackerRunner, settings: ResolvedScenario, latency_ms: float) -> Driver:
    assert runner.spec.controller is not None
    controller = controllers.make(runner.spec.controller)
    robot = policies.robot_parameters(settings, latency_ms)
    return Driver(runner, controller, robot, latency_ms, settings.camera.rate_hz)
