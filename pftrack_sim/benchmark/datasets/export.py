"""Write simulated episodes as a data set in the layout of a public one, with the whole truth beside every sequence."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, ProcessPoolExecutor
from pathlib import Path
from typing import Any, cast

import pftrack_sim
from pftrack_sim.benchmark import keys
from pftrack_sim.benchmark.asked.plan import START, Episode, Plan
from pftrack_sim.benchmark.datasets.sequence_writer import QUALITIES, ExportJob, ImageFormat, export_sequence
from pftrack_sim.benchmark.kept.files import atomic_write, write_bytes
from pftrack_sim.benchmark.running.executor import WorkerContext, prepare_worker
from pftrack_sim.core.arguments import checked
from pftrack_sim.core.errors import ParameterError, RunError, ScenarioError, UnknownNameError
from pftrack_sim.formats import LAYOUTS
from pftrack_sim.formats.maps import check_maps
from pftrack_sim.render.capture.frame_capture import is_instantaneous
from pftrack_sim.simulation.simulation import Simulation

_RECORD = "dataset.json"
_IMAGES: dict[ImageFormat, str] = {
    "png": "png",
    "jpg": "jpg, quality {}",
    "mp4": "mp4, H.264, constant rate factor {}",
}


@checked
def export(
    plan: Plan,
    out: Path,
    layout: str,
    *,
    image: str | None = None,
    quality: int | None = None,
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
        image: `"png"`, lossless, `"jpg"`, or `"mp4"`, one video in the place of the images. None: `"jpg"` for layouts
            whose readers look for that, else `"png"`.
        quality: Of JPEG, 1 to 100 (95); of a video H.264's constant rate factor, 0 to 51 (18). PNG has none.
        maps: Of `MAP_KINDS`: what is written beside each image.
        detections: Write what each scenario's detector finds, see the axis `detector`; layout `mot` only.
        workers: Processes; 0 works in this one.
        backend: Renderer, by name.
        on_sequence: Called for every sequence that is there, old or new.

    Returns:
        The folder.

    Raises:
        UnknownNameError: No such layout, image format or map.
        ParameterError: The quality or the number of workers is out of range, or the layout has no detections or no
            video.
        RunError: The folder holds something else, or cannot be written.
        ScenarioError: A scenario contradicts itself at a seed, has effects under which a map or a layout has no
            definition, or an odd image size, which a video cannot have.
    """
    if layout not in LAYOUTS:
        raise UnknownNameError("layout", layout, LAYOUTS)
    kinds = check_maps(maps)
    form = cast("ImageFormat", image or ("jpg" if LAYOUTS[layout].jpeg else "png"))
    if form not in _IMAGES:
        raise UnknownNameError("image format", form, _IMAGES)
    usual, allowed = QUALITIES.get(form, (0, range(1)))
    chosen = usual if quality is None else quality
    if chosen not in allowed:
        words = f"must be {allowed[0]} to {allowed[-1]}, got {quality}" if usual else "has no meaning: it is lossless"
        raise ParameterError(f"the quality of {form} {words}")
    if workers < 0:
        raise ParameterError(f"workers must be >= 0, got {workers}")
    if form == "mp4" and not LAYOUTS[layout].video:
        able = " and ".join(name for name, known in LAYOUTS.items() if known.video)
        raise ParameterError(f"tools that read {layout} need single images, png or jpg; mp4 is written for {able}")
    if detections and layout != "mot":
        raise ParameterError(f"the layout mot holds detections, {layout} does not")
    Simulation(plan.episode(0).scenario, backend=backend)  # A wrong renderer is reported before anything is written.
    _check_effects(plan, [*kinds, *LAYOUTS[layout].needs])
    if form == "mp4":
        _check_sizes(plan)
    names = sequence_names(plan)
    folder = out / LAYOUTS[layout].sequences
    _begin(out, plan, layout, _IMAGES[form].format(chosen), [*kinds, *(["detections"] if detections else [])])

    def jobs() -> Iterator[ExportJob]:
        for number, (episode, name) in enumerate(zip(plan.episodes(), names, strict=True)):
            path = folder / name
            if path.exists():
                on_sequence()
            else:
                yield ExportJob(episode, path, layout, form, chosen, kinds, backend, number, detections)

    for _ in _run_all(jobs(), workers):
        on_sequence()
    for name, pieces in LAYOUTS[layout].index(out, names):
        with atomic_write(out / name) as part, part.open("w", encoding="utf-8") as written:
            written.writelines(pieces)
    return out


def _check_effects(plan: Plan, needs: Sequence[str]) -> None:
    """Refuse what has no definition in a scenario, before anything is written: it is known from the settings."""
    exact = [one for one in needs if one != "masks"]
    for episode in plan.first_episodes if exact else ():
        if not is_instantaneous(episode.scenario.resolve(episode.seed).viewing):
            what = "3D boxes" if exact == ["solids"] else " and ".join(one for one in exact if one != "solids")
            words = f"no {what} under blur, rolling_shutter or distortion: set their severities to 0, or leave it out"
            raise ScenarioError(episode.scenario.name, [words])


def _check_sizes(plan: Plan) -> None:
    """Refuse images of which H.264 with its usual pixel format would lose a row or column."""
    for episode in plan.first_episodes:
        camera = episode.scenario.resolve(episode.seed).viewing.camera
        if camera.width_px % 2 or camera.height_px % 2:
            size = f"{camera.width_px} x {camera.height_px}"
            raise ScenarioError(episode.scenario.name, [f"mp4 needs images of even width and height, got {size} px"])


def sequence_names(plan: Plan) -> list[str]:
    """Names of the sequences of a plan's episodes, in their order: `plaza-walk-0003`, `corridor-jitter-2-0000`.

    Raises:
        ParameterError: Its trackers start elsewhere than in the first frame.
    """

    def name(episode: Episode) -> str:
        condition = "" if episode.condition.name == "base" else f"-{episode.condition.name}"
        return f"{episode.spec.name}{condition}-{episode.seed:04d}"

    if any(START in condition.of_run for condition in plan.conditions.values()):
        raise ParameterError(
            "a data set has whole sequences, shown forward: leave out --starts, --anchors and the axis start"
        )
    return list(keys.distinct_slugs(name(episode) for episode in plan.episodes()).values())


def _begin(out: Path, plan: Plan, layout: str, image: str, maps: Sequence[str]) -> None:
    """Write what the data set is, or check that the folder holds the same."""
    record = {
        "format": layout,
        "image": image,
        "maps": list(maps),
        "version": pftrack_sim.__version__,
        "versions": {name: keys.package_version(name) for name in ("mujoco", "opencv-python-headless", "numpy")},
        "licence": "MIT, as pftrack-sim: everything in it was made by the simulator",
        "frames_sha256": keys.digest([episode.frames_key for episode in plan.episodes()]),
        "sweeps": [sweep.model_dump(mode="json") for sweep in plan.sweeps],
    }
    path = out / _RECORD
    if path.is_file():
        try:
            there: Any = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise RunError(f"{path} cannot be read: {getattr(error, 'strerror', error)}") from None
        different = [key for key in record if not isinstance(there, dict) or there.get(key) != record[key]]  # pyright: ignore[reportUnknownMemberType]
        if different:
            raise RunError(f"{out} holds another data set (it differs in {', '.join(different)}): choose another --out")
        return
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise RunError(f"{out} is not an empty folder, nor a data set that was begun here")
    write_bytes(path, (json.dumps(record, indent=1) + "\n").encode())


def _run_all(jobs: Iterator[ExportJob], workers: int) -> Iterator[None]:
    """Write all sequences; yields when one more is there."""
    if workers == 0:
        yield from map(export_sequence, jobs)
        return
    try:
        with ProcessPoolExecutor(workers, WorkerContext(), initializer=prepare_worker) as pool:
            yield from pool.map(export_sequence, jobs)
    except BrokenExecutor:
        raise RunError("a process ended while it wrote a sequence; the same command goes on") from None
