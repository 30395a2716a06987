"""Draw every episode of a plan once, show it to all trackers, score them, and leave a run folder."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from pftrack_sim import score
from pftrack_sim.bench.contest import Entry, enter
from pftrack_sim.bench.plan import Episode, Plan, slug
from pftrack_sim.bench.store import RunFolder
from pftrack_sim.bench.video import VideoWriter
from pftrack_sim.env.simulation import Simulation
from pftrack_sim.errors import ParameterError
from pftrack_sim.records import Estimate, Truth
from pftrack_sim.render.overlay import draw_frame
from pftrack_sim.score import Summary

VIDEOS = ("first", "all", "none")


@dataclass(frozen=True)
class Result:
    """What one tracker scored in one episode.

    Attributes:
        scenario: Name of the scenario.
        condition: Name of the axis levels, `"base"` when there are none.
        seed: Root seed.
        tracker: Name of the tracker.
        summary: Its scores.
        failure: What went wrong and at which frame, or None.
    """

    scenario: str
    condition: str
    seed: int
    tracker: str
    summary: Summary
    failure: str | None


def new_run_path(plan: Plan) -> Path:
    """A run folder's name that is not taken: `runs/<time>-<first scenario>`."""
    stem = f"{datetime.now(UTC):%Y%m%dT%H%M%S}-{slug(plan.episodes[0].scenario.name)}"
    taken = 0
    while (path := Path("runs") / (stem if not taken else f"{stem}-{taken}")).exists():
        taken += 1
    return path


def run(
    plan: Plan,
    path: Path,
    *,
    videos: str = "first",
    backend: str | None = None,
    on_frame: Callable[[], None] = lambda: None,
) -> list[Result]:
    """Run a plan.

    Args:
        plan: What to run.
        path: Run folder to make; absent or empty.
        videos: `"first"`: of the first seed of each scenario and condition; `"all"`; or `"none"`.
        backend: Renderer, by name.
        on_frame: Called after every frame.

    Returns:
        One result for each episode and tracker, in the plan's order.

    Raises:
        UnknownNameError: An unknown tracker.
        RunError: The folder cannot be made or written.
        RenderError: Nothing can draw.
        ScenarioError: A scenario contradicts itself at one of its seeds.
    """
    if videos not in VIDEOS:
        raise ParameterError(f"videos must be one of {', '.join(VIDEOS)}, got {videos!r}")
    # Mistakes in names or presets are told before anything is written.
    enter(plan.trackers, seed=0, preset=plan.preset)
    Simulation(plan.episodes[0].scenario, backend=backend)
    folder = RunFolder(path)
    first_seed = plan.episodes[0].seed
    results: list[Result] = []
    digests: dict[str, str] = {}
    graphics = ""
    for episode in plan.episodes:
        wanted = videos == "all" or (videos == "first" and episode.seed == first_seed)
        entries = enter(plan.trackers, seed=episode.seed, preset=plan.preset)
        with Simulation(episode.scenario, backend=backend) as simulation:
            video = path / "videos" / f"{episode.name}.mp4" if wanted else None
            truths, digests[episode.name] = _play(simulation, episode, entries, video, on_frame)
            graphics = simulation.graphics
        results += [_settle(folder, episode, truths, entry, plan.preset) for entry in entries]
    folder.finish(plan, graphics, digests)
    return results


def _play(
    simulation: Simulation, episode: Episode, entries: list[Entry], video: Path | None, on_frame: Callable[[], None]
) -> tuple[list[Truth], str]:
    """Show every frame to every tracker; the target's truths and a digest of all pixels."""
    truths: list[Truth] = []
    pixels = hashlib.blake2b(digest_size=16)
    frame = simulation.reset(episode.seed)
    with ExitStack() as open_files:
        writer = None
        if video is not None:
            writer = open_files.enter_context(VideoWriter(video, simulation.settings.camera.rate_hz))
        while True:
            pixels.update(np.ascontiguousarray(frame.image).data)
            said: dict[str, Estimate] = {}
            for entry in entries:
                estimate = entry.see(frame.image, frame.truth.box, frame.truth.scored)
                if estimate is not None:
                    said[entry.name] = estimate
            truths.append(frame.truth)
            if writer is not None:
                writer.add(draw_frame(frame, said))
            on_frame()
            if len(truths) == simulation.frame_count:
                return truths, pixels.hexdigest()
            frame = simulation.advance()


def _settle(folder: RunFolder, episode: Episode, truths: list[Truth], entry: Entry, preset: str) -> Result:
    """Score one tracker's episode and write it down."""
    truth = np.array([one.box for one in truths])
    overlap = score.overlaps(entry.boxes, truth)
    error = score.centre_errors(entry.boxes, truth)
    summary = score.summarise(overlap, error, np.array([one.scored for one in truths]), np.array(entry.ms))
    key = {
        "scenario": episode.scenario.name,
        "condition": episode.condition.name,
        "seed": episode.seed,
        "tracker": entry.name,
        "preset": preset,
    }
    folder.add_episode(key, episode.name, truths, entry, overlap, error, summary.as_dict())
    return Result(key["scenario"], key["condition"], episode.seed, entry.name, summary, entry.failure)
