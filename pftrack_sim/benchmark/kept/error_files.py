"""Where a run folder keeps the pictures and texts of trackers' errors: errors/<episode>/<tracker>.png and .txt."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from pftrack_sim.benchmark.asked.plan import Episode
from pftrack_sim.benchmark.kept.files import distinct_slugs
from pftrack_sim.benchmark.reading.summary import Result
from pftrack_sim.core.inputs import is_file

_FOLDER = "errors"


def errors_folder(run: Path, episode: Episode) -> Path:
    """Folder of an episode's files in a run folder."""
    return run / _FOLDER / episode.path


def error_names(labels: Sequence[str]) -> dict[str, tuple[str, str]]:
    """Names of the picture and the text of each of a run's trackers, by label."""
    return {label: (f"{slug}.png", f"{slug}.txt") for label, slug in distinct_slugs(labels).items()}


def remove_errors(folder: Path, labels: Iterable[str], all_labels: Sequence[str]) -> None:
    """Remove the files of some trackers from the folder of an episode's errors."""
    names = error_names(all_labels)
    for name in (name for label in labels for name in names[label]):
        (folder / name).unlink(missing_ok=True)


def error_picture(run: Path, result: Result, all_labels: Sequence[str]) -> Path | None:
    """The picture of a result's error, if it was kept; its text, of the same name, is beside it."""
    below = Path(result.file).relative_to("episodes").with_suffix("")
    picture, text = (run / _FOLDER / below / name for name in error_names(all_labels)[result.label])
    return picture if ".." not in below.parts and is_file(picture) and is_file(text) else None
