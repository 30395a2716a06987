"""Static figures of a run for papers."""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
from collections.abc import Callable, Generator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

import numpy as np

from pftrack_sim import score
from pftrack_sim.benchmark import RunStore
from pftrack_sim.benchmark.degradation import degradation, seed_means
from pftrack_sim.benchmark.files import atomic_write
from pftrack_sim.core import random_streams
from pftrack_sim.core.errors import ParameterError, UnknownNameError
from pftrack_sim.core.types import FloatArray
from pftrack_sim.report.contents import by_episode, read_frames

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
    store = RunStore(path)
    with own_style():
        from matplotlib.figure import Figure

        figure: Any = Figure(figsize=(4.6, 3.2), layout="constrained")
        axes: Any = figure.add_subplot()
        FIGURES[target.stem](store, axes)
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(alpha=0.25)
        for text in axes.legend(fontsize=7, frameon=False).get_texts():
            text.set_parse_math(False)  # a tracker's name is no formula
        with atomic_write(target) as part:
            # Without a date the same run gives the same file.
            metadata = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}.get(target.suffix, {})
            figure.savefig(part, dpi=200, format=target.suffix[1:], metadata=metadata)
    return target


@contextlib.contextmanager
def own_style() -> Generator[None]:
    """Matplotlib's defaults in the block, whatever settings lie in the working folder or at the user's.

    Raises:
        ParameterError: matplotlib is not installed.
    """
    require_matplotlib()
    mpl: Any = importlib.import_module("matplotlib")
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams["svg.hashsalt"] = "pftrack_sim"
        yield


def require_matplotlib() -> None:
    """Raise a ParameterError if matplotlib, an optional dependency, is not installed."""
    if importlib.util.find_spec("matplotlib") is None:
        raise ParameterError("figures need matplotlib: pip install 'pftrack-sim[figures]'")


def _style(index: int) -> dict[str, Any]:
    return {"color": COLOURS[index % len(COLOURS)], "linestyle": LINES[index // len(COLOURS) % len(LINES)], "lw": 1.4}


def _pooled(store: RunStore, column: Literal["overlap", "centre_error_px"]) -> dict[str, FloatArray]:
    """The counted frames of every tracker, over all episodes."""
    pooled: dict[str, list[FloatArray]] = {result.label: [] for result in store.results}
    for results in by_episode(store.results).values():
        for label, frames in read_frames(store, results).items():
            pooled[label].append(getattr(frames, column)[frames.counted])
    return {label: np.concatenate(parts) for label, parts in pooled.items()}


def _success(store: RunStore, axes: Any) -> None:
    axes.set(xlabel="overlap threshold", ylabel="success rate", xlim=(0, 1), ylim=(0, 1))
    for index, (tracker, overlap) in enumerate(_pooled(store, "overlap").items()):
        label = f"{tracker} [{score.area_under_success(overlap):.3f}]"
        axes.plot(score.SUCCESS_THRESHOLDS, score.success_curve(overlap), label=label, **_style(index))


def _precision(store: RunStore, axes: Any) -> None:
    axes.set(xlabel="centre error threshold [px]", ylabel="precision", xlim=(0, 50), ylim=(0, 1))
    for index, (tracker, error) in enumerate(_pooled(store, "centre_error_px").items()):
        curve = score.precision_curve(error)
        axes.plot(score.PRECISION_THRESHOLDS_PX, curve, label=f"{tracker} [{curve[20]:.3f}]", **_style(index))


def _degradation(store: RunStore, axes: Any) -> None:
    found = degradation(store)
    if not found:
        raise ParameterError("this run has no axis with two levels: run bench with --axis NAME=0,1,2")
    label = found[0].at.label
    axes.set(xlabel=label, ylabel="mean overlap", ylim=(0, 1))
    own = [one for one in found if one.at.label == label]
    for index, tracker in enumerate(dict.fromkeys(one.tracker for one in own)):
        points: list[tuple[float, float, float, float]] = []
        for x in dict.fromkeys(one.at.x for one in own):
            means = seed_means([one for one in own if (one.tracker, one.at.x) == (tracker, x)], "overlap")
            low, high = score.bootstrap_interval(means, random_streams.stream(0, "bootstrap", tracker, str(x)))
            points.append((x, float(np.nanmean(means)), low, high))
        x, mean, low, high = np.array(sorted(points)).T
        axes.plot(x, mean, marker="o", ms=3, label=tracker, **_style(index))
        axes.fill_between(x, low, high, color=COLOURS[index % len(COLOURS)], alpha=0.15, lw=0)


FIGURES: Mapping[str, Callable[[RunStore, Any], None]] = MappingProxyType(
    {"axis": _degradation, "precision": _precision, "success": _success}
)
"""What can be drawn, by the file's name: success and precision plots, and the degradation over the first axis."""
