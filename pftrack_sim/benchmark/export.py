"""Write simulated episodes as a data set in the layout of a public one, with the whole truth beside every sequence."""

from __future__ import annotations

import json
import multiprocessing
import shutil
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, ProcessPoolExecutor, wait
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any, Literal, TypeAlias, get_args

import cv2
import duckdb
import numpy as np

import pftrack_sim
from pftrack_sim.benchmark.episode_file import truth_columns
from pftrack_sim.benchmark.executor import prepare_worker
from pftrack_sim.benchmark.files import distinct_slugs, sql_text, write_bytes
from pftrack_sim.benchmark.plan import Episode, Plan
from pftrack_sim.benchmark.rollout import Step, rollout, simulated
from pftrack_sim.core.errors import ParameterError, RunError, UnknownNameError
from pftrack_sim.core.records import Frame
from pftrack_sim.formats import LAYOUTS, Annotations, PersonBox
from pftrack_sim.simulation.simulation import Simulation

ImageFormat: TypeAlias = Literal["png", "jpg"]
JPEG_QUALITY = 95
TRUTH = "truth.parquet"
"""Truth of everybody in view, a row per person and frame, beside the images of a sequence."""
_RECORD = "dataset.json"


@dataclass(frozen=True)
class ExportJob:
    """One sequence to write.

    Attributes:
        episode: What is simulated; the robot follows its script.
        folder: Folder of the sequence.
        layout: One of `LAYOUTS`.
        image: `"png"`, lossless, or `"jpg"`.
        quality: Of JPEG, 1 to 100.
        backend: Renderer, by name.
    """

    episode: Episode
    folder: Path
    layout: str
    image: ImageFormat = "png"
    quality: int = JPEG_QUALITY
    backend: str | None = None


def export(
    plan: Plan,
    out: Path,
    layout: str,
    *,
    image: str = "png",
    quality: int = JPEG_QUALITY,
    workers: int = 0,
    backend: str | None = None,
    on_sequence: Callable[[], None] = lambda: None,
) -> Path:
    """Write every episode of a plan as a sequence; those that are there already are not written again.

    Args:
        plan: Scenarios, conditions and seeds; its trackers do not matter.
        out: Folder of the data set: absent, empty, or begun with the same plan and options.
        layout: One of `LAYOUTS`.
        image: `"png"`, lossless, or `"jpg"`.
        quality: Of JPEG, 1 to 100.
        workers: Processes; 0 works in this one.
        backend: Renderer, by name.
        on_sequence: Called for every sequence that is there, old or new.

    Returns:
        The folder.

    Raises:
        UnknownNameError: No such layout or image format.
        ParameterError: The quality or the number of workers is out of range.
        RunError: The folder holds something else, or cannot be written.
        ScenarioError: A scenario contradicts itself at a seed.
    """
    if layout not in LAYOUTS:
        raise UnknownNameError("layout", layout, LAYOUTS)
    if image not in get_args(ImageFormat):
        raise UnknownNameError("image format", image, get_args(ImageFormat))
    if not 1 <= quality <= 100 or workers < 0:
        raise ParameterError(f"quality must be 1 to 100 and workers >= 0, got {quality} and {workers}")
    Simulation(
        next(plan.episodes()).scenario, backend=backend
    )  # A wrong renderer is reported before anything is written.
    names = sequence_names(plan)
    folder = out / LAYOUTS[layout].sequences
    _begin(out, plan, layout, image, quality)
    _remove_parts(folder)

    def jobs() -> Iterator[ExportJob]:
        for episode, name in zip(plan.episodes(), names, strict=True):
            path = folder / name
            if path.exists():
                on_sequence()
            else:
                yield ExportJob(episode, path, layout, "png" if image == "png" else "jpg", quality, backend)

    for _ in _run_all(jobs(), workers):
        on_sequence()
    for name, text in LAYOUTS[layout].index(names).items():
        write_bytes(out / name, text.encode())
    return out


def export_sequence(job: ExportJob) -> None:
    """Write one sequence; its folder appears under its name when it is complete.

    Raises:
        RunError: It cannot be written.
        ScenarioError: The scenario contradicts itself at this seed.
    """
    part = job.folder.with_name(f".{job.folder.name}.part")
    try:
        shutil.rmtree(part, ignore_errors=True)
        part.mkdir(parents=True)
        writer = _SequenceWriter(job, part)
        with Simulation(job.episode.scenario, backend=job.backend) as simulation:
            rollout(simulated(simulation, job.episode.seed), (), [writer.add])
        writer.finish()
        part.rename(job.folder)
    except OSError as error:
        raise RunError(f"cannot write {job.folder}: {error.strerror or error}") from None
    finally:
        shutil.rmtree(part, ignore_errors=True)


@dataclass
class _SequenceWriter:
    """Writes images as they come, and keeps the truth for the end: a few hundred bytes per person and frame."""

    job: ExportJob
    folder: Path
    frames: list[Frame] = field(default_factory=list[Frame])
    identities: dict[str, int] = field(default_factory=dict[str, int])

    def add(self, step: Step) -> None:
        """Write a frame's image."""
        frame = step.sample.frame
        assert frame is not None
        layout = LAYOUTS[self.job.layout]
        path = self.folder / f"{layout.image.format(frame.index + 1)}.{self.job.image}"
        path.parent.mkdir(parents=True, exist_ok=True)
        options = [cv2.IMWRITE_JPEG_QUALITY, self.job.quality] if self.job.image == "jpg" else []
        _, encoded = cv2.imencode(path.suffix, cv2.cvtColor(frame.image, cv2.COLOR_RGB2BGR), options)
        path.write_bytes(encoded.tobytes())
        # Without its image: only one is ever held.
        no_image = np.empty((0, 0, 3), dtype=np.uint8)
        self.frames.append(Frame(frame.index, frame.time_s, no_image, frame.truth, frame.people))

    def finish(self) -> None:
        """Write the annotations and the truth."""
        LAYOUTS[self.job.layout].write(self.folder, self._annotations())
        people = [(frame, person) for frame in self.frames for person in frame.people]
        columns: dict[str, Any] = truth_columns([person for _, person in people])
        columns["frame"] = np.array([frame.index for frame, _ in people])
        columns["identity"] = np.array([self._identity(person.name) for _, person in people])
        columns["person"] = np.array([person.name for _, person in people], dtype=object)
        with duckdb.connect(config={"threads": 1}) as database:
            database.register("people", columns)
            path = sql_text(self.folder / TRUTH)
            try:
                database.execute(
                    "COPY (SELECT frame, identity, person, * EXCLUDE (frame, identity, person) FROM people "
                    f"ORDER BY frame, identity) TO {path} (FORMAT parquet, COMPRESSION zstd)"
                )
            except duckdb.Error as error:
                raise RunError(f"cannot write {self.folder / TRUTH}: {error}") from None

    def _annotations(self) -> Annotations:
        settings = self.job.episode.scenario.resolve(self.job.episode.seed)
        truths = [frame.truth for frame in self.frames]
        boxes = np.array([truth.box if truth.scored else np.full(4, np.nan) for truth in truths])
        people = tuple(
            tuple(
                PersonBox(self._identity(one.name), tuple(one.box.tolist()), one.visible_fraction)
                for one in frame.people
                if one.state != "out_of_view"
            )
            for frame in self.frames
        )
        return Annotations(
            self.job.folder.name,
            settings.camera.rate_hz,
            (settings.camera.width_px, settings.camera.height_px),
            boxes,
            np.array([truth.visible_fraction for truth in truths]),
            np.array([truth.truncation for truth in truths]),
            np.array([truth.state == "out_of_view" for truth in truths]),
            people,
        )

    def _identity(self, name: str) -> int:
        """1 for the target, then a number for each person in the order of appearance."""
        self.identities.setdefault(self.frames[0].truth.name, 1)
        return self.identities.setdefault(name, len(self.identities) + 1)


def sequence_names(plan: Plan) -> list[str]:
    """Names of the sequences of a plan's episodes, in their order: `plaza-walk-0003`, `corridor-jitter-2-0000`."""

    def name(episode: Episode) -> str:
        condition = "" if episode.condition.name == "base" else f"-{episode.condition.name}"
        return f"{episode.scenario.name}{condition}-{episode.seed:04d}"

    return list(distinct_slugs(name(episode) for episode in plan.episodes()).values())


def _begin(out: Path, plan: Plan, layout: str, image: str, quality: int) -> None:
    """Write what the data set is, or check that the folder holds the same."""
    record = {
        "format": layout,
        "image": image if image == "png" else f"jpg, quality {quality}",
        "version": pftrack_sim.__version__,
        "licence": "MIT, as pftrack-sim: everything in it was made by the simulator",
        "plan_sha256": plan.without_code().digest,
        "sweeps": [sweep.model_dump(mode="json") for sweep in plan.sweeps],
    }
    path = out / _RECORD
    if path.is_file():
        try:
            there: Any = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise RunError(f"{path} cannot be read: {error}") from None
        different = [key for key in record if not isinstance(there, dict) or there.get(key) != record[key]]  # pyright: ignore[reportUnknownMemberType]
        if different:
            raise RunError(f"{out} holds another data set (it differs in {', '.join(different)}): choose another --out")
        return
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise RunError(f"{out} is not an empty folder, nor a data set that was begun here")
    write_bytes(path, (json.dumps(record, indent=1) + "\n").encode())


def _remove_parts(folder: Path) -> None:
    """Remove unfinished sequences of exports that were killed."""
    if folder.is_dir():
        for part in folder.glob(".*.part"):
            shutil.rmtree(part, ignore_errors=True)


def _run_all(jobs: Iterator[ExportJob], workers: int) -> Iterator[ExportJob]:
    """Write all sequences; yields each when it is there."""
    if workers == 0:
        for job in jobs:
            export_sequence(job)
            yield job
        return
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(workers, context, initializer=prepare_worker)
    running: dict[Future[None], ExportJob] = {}
    try:
        while True:
            for job in islice(jobs, workers + 1 - len(running)):
                running[pool.submit(export_sequence, job)] = job
            if not running:
                return
            finished, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in finished:
                future.result()
                yield running.pop(future)
    except BrokenExecutor:
        raise RunError("a process ended while it wrote a sequence; the same command goes on") from None
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def sequence_count(plan: Plan) -> int:
    """Number of sequences of a plan."""
    return sum(sweep.episode_count for sweep in plan.sweeps)
