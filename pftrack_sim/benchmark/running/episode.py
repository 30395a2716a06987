"""One episode as a unit of work: run it, score its trackers, and return its files as bytes.

It runs in any process on any machine; workers and the parent need no common disk.
"""

from __future__ import annotations

import contextlib
import shutil
import tempfile
import threading
from collections.abc import Callable, Generator, Iterable
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pftrack_sim
from pftrack_sim import controllers, policies
from pftrack_sim.benchmark.asked.plan import Episode
from pftrack_sim.benchmark.keys import differences, environment
from pftrack_sim.benchmark.running.frame_cache import DamagedEntry, FrameCache
from pftrack_sim.benchmark.running.results import write_results
from pftrack_sim.benchmark.running.rollout import (
    Driver,
    Sample,
    Sink,
    backwards,
    detected,
    drive,
    rollout,
    shown_to,
    simulated,
)
from pftrack_sim.benchmark.running.sinks import (
    ErrorLog,
    FollowLog,
    TruthLog,
    episode_log,
    latest,
    picture,
    video_writer,
)
from pftrack_sim.benchmark.running.tracker_runner import Isolation, make_runners
from pftrack_sim.core.errors import RunError, ScenarioError
from pftrack_sim.env import TrackAndFollowEnv
from pftrack_sim.logs import FORMATS
from pftrack_sim.scene.robot import fitted_settings
from pftrack_sim.simulation.simulation import Simulation
from pftrack_sim.trackers.isolation import Limits, TrackerProcesses

WITHOUT_IMAGES = "none"
"""The renderer of runs without images."""

MAX_DEATHS = 3
"""An episode whose worker dies this often is given up. The last time, each of its trackers has a process of its own, so
that one that ends its process is named and the others go on."""

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
        deaths: How often a worker has died of it.
    """

    episode: Episode
    video: bool = False
    backend: str | None = None
    isolation: Isolation = "auto"
    limits: Limits = field(default_factory=Limits)
    logs: tuple[str, ...] = ()
    scratch: Path | None = None
    deaths: int = 0
    labels: tuple[str, ...] = ()
    cache: FrameCache | None = None


@dataclass(frozen=True)
class EpisodeFiles:
    """What an episode leaves.

    Attributes:
        name: Of the episode.
        contents: Files by their paths within the run folder.
        rows: Each tracker's scores.
        problem: Why it could not be run; None where it was.
    """

    name: str
    contents: dict[str, bytes] = field(default_factory=dict[str, bytes])
    frames: int = 0
    rows: tuple[dict[str, Any], ...] = ()
    problem: str | None = None


def run_episode(
    job: EpisodeJob,
    on_frame: Callable[[], None] = lambda: None,
    processes: TrackerProcesses | None = None,
) -> EpisodeFiles:
    """Run an episode; processes of isolated trackers stay in `processes`, or else end with it.

    A scenario that contradicts itself at the episode's seed is a problem of this episode.

    Raises:
        RenderError: No renderer works.
        RunError: No space for its files, or other code or versions than the run has.
    """
    lines = "\n".join(f"  {line}" for line in differences(job.episode.environment, environment()))
    if lines:
        raise RunError(f"this worker has other code or versions than the run, so its results would differ\n{lines}")
    try:
        with contextlib.suppress(DamagedEntry):  # it is gone then, and the frames are drawn
            return _run(job, on_frame, processes)
        return _run(job, on_frame, processes)
    except ScenarioError as error:
        return EpisodeFiles(job.episode.name, problem=str(error))


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
            apart=job.deaths == MAX_DEATHS - 1,
            processes=processes,
            box_noise=episode.box_noise,
            first_frame=episode.first_frame,
        )
        for runner in runners:
            stack.callback(runner.close)
        settings = fitted_settings(episode.scenario.resolve(episode.seed))
        log, course = TruthLog(), FollowLog()
        drawn = TruthLog() if episode.backward else log
        following: dict[str, Any] = {}
        errors = ErrorLog(runners, job.labels)
        sinks: list[Sink] = [log, errors]
        video = folder / "episode.mp4"
        with ExitStack() as open_files:
            if job.video:
                add = open_files.enter_context(video_writer(video, settings.camera.rate_hz))
                sinks.append(lambda sample: add(picture(sample, latest(runners), job.labels), sample.time_s))
            logs = {name: folder / f"episode{FORMATS[name].suffix}" for name in job.logs}
            sinks += [
                open_files.enter_context(episode_log(one, episode.name, settings, runners)) for one in logs.values()
            ]
            sinks.append(lambda _: on_frame())
            if episode.kind == "follow":
                images = job.backend != WITHOUT_IMAGES
                made = TrackAndFollowEnv(episode.scenario, backend=job.backend if images else None, image=images)
                env = stack.enter_context(contextlib.closing(made))
                (runner,) = runners
                assert runner.spec.controller is not None
                controller = controllers.make(runner.spec.controller)
                robot = policies.robot_parameters(settings, episode.latency_ms)
                driver = Driver(runner, controller, robot, episode.latency_ms, settings.camera.rate_hz)
                drive(env, episode.seed, driver, [*sinks, course])
                following = course.scores(settings, env.simulation.frame_count)
                drawn.graphics = env.simulation.graphics
            else:
                with _drawn(job, drawn) as samples:
                    if episode.backward:
                        samples = backwards(shown_to(samples, drawn), folder)
                    if any(runner.needs_detections for runner in runners):
                        samples = detected(samples, episode.scenario.resolve(episode.seed), episode.seed)
                    rollout(samples, runners, sinks)
        metadata = {
            **following,
            "frames_digest": log.frames_digest,
            "episode_frames": len(log.truths),
            "rate_hz": settings.camera.rate_hz,
            "levels": dict(episode.condition.levels),
            "graphics": drawn.graphics,
            "version": pftrack_sim.__version__,
        }
        contents, rows = write_results(folder, episode, log, runners, course.columns(), metadata)
        files = [one.path for one in episode.results]
        contents |= {f"errors/{name}": content for name, content in errors.files(files).items()}
        contents |= {f"logs/{episode.path}{path.suffix}": path.read_bytes() for path in logs.values()}
        contents |= {episode.video: video.read_bytes()} if job.video else {}
        return EpisodeFiles(episode.name, contents, len(log.truths), tuple(rows))


@contextlib.contextmanager
def _drawn(job: EpisodeJob, log: TruthLog) -> Generator[Iterable[Sample]]:
    """Frames of an episode in open loop, from the cache, or drawn and kept there; in the block `log` receives them.

    Raises DamagedEntry where those from the cache are not those that were drawn.
    """
    # Logs hold what the robot sensed, which is not in the cache.
    episode, cache = job.episode, job.cache if not job.logs else None
    entry = cache.entry(episode.drawn_key, job.backend) if cache is not None else None
    if cache is not None and entry is not None and (cached := cache.open(entry)) is not None:
        yield cached.samples()
        log.graphics = cached.graphics
        if log.frames_digest != cached.frames_digest:
            shutil.rmtree(entry, ignore_errors=True)
            raise DamagedEntry
        return
    with ExitStack() as opened:
        simulation = opened.enter_context(Simulation(episode.scenario, backend=job.backend))
        samples = simulated(simulation, episode.seed, sensors=bool(job.logs))
        if cache is not None and entry is not None:
            samples = shown_to(samples, opened.enter_context(cache.writer(entry, log)))
        yield samples
        log.graphics = simulation.graphics
