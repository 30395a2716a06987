"""Write simulated episodes as a data set in the layout of a public one, with the whole truth beside every sequence."""

from __future__ import annotations

import importlib.metadata
import json
import multiprocessing
import shutil
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, ProcessPoolExecutor, wait
from itertools import islice
from pathlib import Path
from typing import Any, get_args

import pftrack_sim
from pftrack_sim.benchmark.executor import prepare_worker
from pftrack_sim.benchmark.files import atomic_write, distinct_slugs, write_bytes
from pftrack_sim.benchmark.plan import Episode, Plan
from pftrack_sim.benchmark.sequence_writer import JPEG_QUALITY, ExportJob, ImageFormat, export_sequence
from pftrack_sim.core.errors import ParameterError, RunError, ScenarioError, UnknownNameError
from pftrack_sim.formats import LAYOUTS
from pftrack_sim.formats.maps import check_maps
from pftrack_sim.render.capture.frame_capture import is_instantaneous
from pftrack_sim.simulation.simulation import Simulation

_RECORD = "dataset.json"


def export(
    plan: Plan,
    out: Path,
    layout: str,
    *,
    image: str = "png",
    quality: int = JPEG_QUALITY,
    maps: Sequence[str] = (),
    detections: bool = False,
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
        maps: Of `MAP_KINDS`: what is written beside each image.
        detections: Write what each scenario's detector finds, see the axis `detector`; layout `mot` only.
        workers: Processes; 0 works in this one.
        backend: Renderer, by name.
        on_sequence: Called for every sequence that is there, old or new.

    Returns:
        The folder.

    Raises:
        UnknownNameError: No such layout, image format or map.
        ParameterError: The quality or the number of workers is out of range, or the layout has no detections.
        RunError: The folder holds something else, or cannot be written.
        ScenarioError: A scenario contradicts itself at a seed, or has effects under which a map or a layout has no
            definition.
    """
    if layout not in LAYOUTS:
        raise UnknownNameError("layout", layout, LAYOUTS)
    kinds = check_maps(maps)
    if image not in get_args(ImageFormat):
        raise UnknownNameError("image format", image, get_args(ImageFormat))
    if not 1 <= quality <= 100 or workers < 0:
        raise ParameterError(f"quality must be 1 to 100 and workers >= 0, got {quality} and {workers}")
    if detections and layout != "mot":
        raise ParameterError(f"the layout mot holds detections, {layout} does not")
    Simulation(
        next(plan.episodes()).scenario, backend=backend
    )  # A wrong renderer is reported before anything is written.
    _check_effects(plan, [*kinds, *LAYOUTS[layout].needs])
    names = sequence_names(plan)
    folder = out / LAYOUTS[layout].sequences
    chosen: ImageFormat = "png" if image == "png" else "jpg"
    _begin(out, plan, layout, image, quality, [*kinds, *(["detections"] if detections else [])])
    _remove_parts(folder)

    def jobs() -> Iterator[ExportJob]:
        for number, (episode, name) in enumerate(zip(plan.episodes(), names, strict=True)):
            path = folder / name
            if path.exists():
                on_sequence()
            else:
                yield ExportJob(episode, path, layout, chosen, quality, kinds, backend, number, detections)

    for _ in _run_all(jobs(), workers):
        on_sequence()
    for name, pieces in LAYOUTS[layout].index(out, names):
        with atomic_write(out / name) as part, part.open("w", encoding="utf-8") as written:
            written.writelines(pieces)
    return out


def _check_effects(plan: Plan, needs: Sequence[str]) -> None:
    """Refuse what has no definition in a scenario, before anything is written: it is known from the settings."""
    exact = [one for one in needs if one != "masks"]
    for episode in plan.episodes() if exact else ():
        if episode.is_first_seed and not is_instantaneous(episode.scenario.resolve(episode.seed)):
            what = "3D boxes" if exact == ["solids"] else " and ".join(one for one in exact if one != "solids")
            words = f"no {what} under blur, rolling_shutter or distortion: set their severities to 0, or leave it out"
            raise ScenarioError(episode.scenario.name, [words])


def sequence_names(plan: Plan) -> list[str]:
    """Names of the sequences of a plan's episodes, in their order: `plaza-walk-0003`, `corridor-jitter-2-0000`."""

    def name(episode: Episode) -> str:
        condition = "" if episode.condition.name == "base" else f"-{episode.condition.name}"
        return f"{episode.scenario.name}{condition}-{episode.seed:04d}"

    return list(distinct_slugs(name(episode) for episode in plan.episodes()).values())


def _begin(out: Path, plan: Plan, layout: str, image: str, quality: int, maps: Sequence[str]) -> None:
    """Write what the data set is, or check that the folder holds the same."""
    record = {
        "format": layout,
        "image": image if image == "png" else f"jpg, quality {quality}",
        "maps": list(maps),
        "version": pftrack_sim.__version__,
        "versions": {name: importlib.metadata.version(name) for name in ("mujoco", "opencv-python-headless", "numpy")},
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
