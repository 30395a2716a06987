"""A static figure for a paper."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from pftrack_sim import score
from pftrack_sim.core import random_streams
from pftrack_sim.core.errors import ParameterError, RunError, UnknownNameError
from pftrack_sim.report.contents import axis_of
from pftrack_sim.report.data import Run, read_run

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#8C6D31")
"""Colours that the colour-blind can tell apart (Okabe & Ito 2008), the yellow darkened for thin lines on white."""

LINES = ("-", "--", ":", "-.")


def write_figure(path: Path, target: Path) -> Path:
    """Draw a figure of a run.

    Args:
        path: The run folder.
        target: `success.pdf`, `precision.pdf` or `axis.pdf`, in any folder; `.svg` and `.png` too.

    Raises:
        UnknownNameError: No such figure.
        ParameterError: Another kind of file, or matplotlib is not installed.
        RunError: No complete run folder, or the file cannot be written.
    """
    if target.stem not in FIGURES:
        raise UnknownNameError("figure", target.stem, FIGURES)
    if target.suffix not in (".pdf", ".svg", ".png"):
        raise ParameterError(f"a figure is a .pdf, .svg or .png, got {target.name!r}")
    if importlib.util.find_spec("matplotlib") is None:
        raise ParameterError("figures need matplotlib: pip install 'pftrack-sim[figures]'")
    from matplotlib.figure import Figure

    run = read_run(path)
    figure = Figure(figsize=(4.6, 3.2), layout="constrained")
    axes = figure.add_subplot()
    FIGURES[target.stem](run, axes)
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(alpha=0.25)
    axes.legend(fontsize=7, frameon=False)
    part = target.with_name(f".{target.stem}.part{target.suffix}")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        # No date in it: the same run gives the same file.
        figure.savefig(part, dpi=200, metadata={"CreationDate": None} if target.suffix == ".pdf" else {})
        os.replace(part, target)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise RunError(f"cannot write {target}: {error.strerror or error}") from None
    return target


def _style(index: int) -> dict[str, Any]:
    return {"color": COLOURS[index % len(COLOURS)], "linestyle": LINES[index // len(COLOURS) % len(LINES)], "lw": 1.4}


def _pooled(run: Run, column: Literal["overlap", "centre_error_px"]) -> dict[str, NDArray[np.float64]]:
    """The counted frames of every tracker, over all episodes."""
    found: dict[str, list[NDArray[np.float64]]] = {name: [] for name in run.trackers}
    for rows in run.by_episode().values():
        for tracker, frames in run.frames(rows).items():
            found[tracker].append(getattr(frames, column)[frames.counted])
    return {tracker: np.concatenate(parts) for tracker, parts in found.items()}


def _success(run: Run, axes: Axes) -> None:
    axes.set(xlabel="overlap threshold", ylabel="success rate", xlim=(0, 1), ylim=(0, 1))
    for index, (tracker, overlap) in enumerate(_pooled(run, "overlap").items()):
        label = f"{tracker} [{score.area_under_success(overlap):.3f}]"
        axes.plot(score.SUCCESS_THRESHOLDS, score.success_curve(overlap), label=label, **_style(index))


def _precision(run: Run, axes: Axes) -> None:
    axes.set(xlabel="centre error threshold [px]", ylabel="precision", xlim=(0, 50), ylim=(0, 1))
    for index, (tracker, error) in enumerate(_pooled(run, "centre_error_px").items()):
        curve = score.precision_curve(error)
        axes.plot(score.PRECISION_THRESHOLDS_PX, curve, label=f"{tracker} [{curve[20]:.3f}]", **_style(index))


def _degradation(run: Run, axes: Axes) -> None:
    moved = {condition: axis_of(condition) for condition in dict.fromkeys(row.key.condition for row in run.rows)}
    labels = list(dict.fromkeys(one["label"] for one in moved.values() if one is not None))
    if not labels:
        raise ParameterError("this run sweeps no axis: run bench with --axis NAME=0,1,2")
    axes.set(xlabel=labels[0], ylabel="mean overlap", ylim=(0, 1))
    for index, tracker in enumerate(run.trackers):
        points: list[tuple[float, float, float, float]] = []
        for condition, one in moved.items():
            if one is None or one["label"] != labels[0]:
                continue
            by_seed: dict[int, list[float]] = {}
            for row in run.rows:
                if row.tracker == tracker and row.key.condition == condition:
                    by_seed.setdefault(row.key.seed, []).append(row.number("mean_overlap"))
            means = np.array([np.mean(values) for values in by_seed.values()])
            low, high = score.bootstrap_interval(means, random_streams.stream(0, "bootstrap", tracker, condition))
            points.append((float(one["x"]), float(means.mean()), low, high))
        x, mean, low, high = np.array(sorted(points)).T
        axes.plot(x, mean, marker="o", ms=3, label=tracker, **_style(index))
        axes.fill_between(x, low, high, color=COLOURS[index % len(COLOURS)], alpha=0.15, lw=0)


FIGURES: Mapping[str, Callable[[Run, Any], None]] = MappingProxyType(
    {"axis": _degradation, "precision": _precision, "success": _success}
)
"""What can be drawn, by the file's name: success and precision plots, and the degradation over the first axis."""
