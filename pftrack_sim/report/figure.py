"""Static figures of a run for papers."""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import itertools
import math
from collections.abc import Callable, Generator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

import numpy as np

from pftrack_sim import score
from pftrack_sim.benchmark import RunStore
from pftrack_sim.benchmark.kept.files import atomic_write
from pftrack_sim.benchmark.said.degradation import STAY, Crossing, Degradation, degradation, mean_degradation
from pftrack_sim.core.arguments import checked
from pftrack_sim.core.errors import ParameterError, UnknownNameError
from pftrack_sim.core.palette import styles_of
from pftrack_sim.core.types import FloatArray
from pftrack_sim.report.contents import by_episode, read_frames
from pftrack_sim.report.strips import draw_strips
from pftrack_sim.report.tables import grouped, number_text, over_seeds

_MARKERS = {"circle": "o", "square": "s", "triangle-up": "^", "diamond": "D", "x": "X", "star": "*"}

WIDTHS_INCH = {1: 3.5, 2: 7.16}
"""Widths of one column and of two, those of IEEE."""

_HIGH_INCH = 2.6

_LETTERS_PER_INCH, _KEY_LETTERS = 18, 7  # At 7 pt; what a line and its gaps take beside a name

_CROSSING_PT = 60.0  # A name stands this much farther off before its line crosses another

_BINS = 10
"""Points of a reliability diagram, of as many frames each."""


@checked
def write_figure(path: Path, target: Path, columns: int = 1) -> Path:
    """Draw a figure of a run.

    Args:
        path: The run folder.
        target: `success.pdf`, `precision.pdf`, `reliability.pdf`, `axis.pdf`, `cost.pdf` or `strips.pdf`, in any
            folder; `.svg` and `.png` too. Fonts of a PDF are embedded as Type 42.
        columns: Its width, 1 or 2 columns of a paper, see `WIDTHS_INCH`.

    Raises:
        UnknownNameError: No such figure.
        ParameterError: Another kind of file or width, or matplotlib is not installed.
        RunError: No complete run folder, or the file cannot be written.
    """
    if target.stem not in FIGURES:
        raise UnknownNameError("figure", target.stem, FIGURES)
    if target.suffix not in (".pdf", ".svg", ".png"):
        raise ParameterError(f"a figure is a .pdf, .svg or .png, got {target.name!r}")
    if columns not in WIDTHS_INCH:
        raise ParameterError(f"a figure is 1 or 2 columns wide, got {columns}")
    store = RunStore(path)
    with drawn_figure(target, (WIDTHS_INCH[columns], _HIGH_INCH), dpi=200) as figure:
        FIGURES[target.stem](store, figure)
    return target


@contextlib.contextmanager
def drawn_figure(target: Path, size_inch: tuple[float, float], dpi: int) -> Generator[Any]:
    """A figure to draw in the block, which is then written; settings in the working folder or at the user's do nothing.

    Raises:
        ParameterError: matplotlib is not installed.
        RunError: The file cannot be written.
    """
    require_matplotlib()
    mpl: Any = importlib.import_module("matplotlib")
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update({"svg.hashsalt": "pftrack_sim", "pdf.fonttype": 42, "font.size": 8})
        figure: Any = importlib.import_module("matplotlib.figure").Figure(figsize=size_inch, layout="constrained")
        yield figure
        # Without a date the same drawing gives the same file.
        metadata = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}.get(target.suffix, {})
        with atomic_write(target) as part:
            figure.savefig(part, dpi=dpi, format=target.suffix[1:], metadata=metadata)


def require_matplotlib() -> None:
    """Raise a ParameterError if matplotlib, an optional dependency, is not installed."""
    if importlib.util.find_spec("matplotlib") is None:
        raise ParameterError("figures need matplotlib: pip install 'pftrack-sim[figures]'")


def _plot(figure: Any, *at: int) -> Any:
    axes = figure.add_subplot(*at)
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(alpha=0.25)
    return axes


def _legend_below(figure: Any) -> None:
    """Write the names of the curves below them all, as they may lie anywhere; no more abreast than have room."""
    names = figure.axes[0].get_legend_handles_labels()
    whole = figure.figure  # of a part of one, too
    room = int(_LETTERS_PER_INCH * whole.get_figwidth()) // (max(map(len, names[1]), default=0) + _KEY_LETTERS)
    abreast = max(1, min(5 if _is_wide(whole) else 2, room))
    whole.set_figheight(whole.get_figheight() + 0.16 * max(0, -(-len(names[1]) // abreast) - 3))
    legend = figure.legend(*names, loc="outside lower center", ncols=abreast, fontsize=7, frameon=False)
    for text in legend.get_texts():
        text.set_parse_math(False)  # a tracker's name is no formula


def _is_wide(figure: Any) -> bool:
    return figure.get_figwidth() > WIDTHS_INCH[1]


def _write_count(axes: Any, store: RunStore) -> None:
    seeds = len({result.seed for result in store.results})
    axes.set_title(f"{seeds} seed{'s' if seeds != 1 else ''}", loc="right", fontsize=7)


def _values(axes: Any, x: float, one: score.SeedMean, colour: str) -> None:
    """Draw the seeds of a mean without an interval as points."""
    if math.isnan(one.low):
        axes.plot([x] * one.seeds, one.values, "o", ms=2, color=colour, alpha=0.5, lw=0)


def _style(store: RunStore, label: str) -> dict[str, Any]:
    style = styles_of((*store.plan.labels, STAY))[label]
    return {
        "color": style.hexadecimal,
        "linestyle": (0.0, [0.5 * length for length in style.pattern]) if style.pattern else "-",
        "marker": _MARKERS[style.marker],
        "ms": 3,
        "lw": 1.2,
    }


def _pooled(store: RunStore, column: Literal["overlap", "centre_error_px"]) -> dict[str, FloatArray]:
    """The counted frames of every tracker, over all episodes."""
    pooled: dict[str, list[FloatArray]] = {result.label: [] for result in store.results}
    for results in by_episode(store.results).values():
        for label, frames in read_frames(store, results).items():
            pooled[label].append(getattr(frames, column)[frames.counted])
    return {label: np.concatenate(parts) for label, parts in pooled.items()}


def _success(store: RunStore, figure: Any) -> None:
    axes = _plot(figure)
    axes.set(xlabel="overlap threshold", ylabel="success rate (share of frames)", xlim=(0, 1), ylim=(0, 1))
    for tracker, overlap in _pooled(store, "overlap").items():
        label = f"{tracker} [{score.area_under_success(overlap):.3f}]"
        style = _style(store, tracker)
        axes.plot(score.SUCCESS_THRESHOLDS, score.success_curve(overlap), label=label, markevery=4, **style)
    _write_count(axes, store)
    _name_curves(figure)


def _precision(store: RunStore, figure: Any) -> None:
    axes = _plot(figure)
    axes.set(xlabel="centre error threshold [px]", ylabel="precision (share of frames)", xlim=(0, 50), ylim=(0, 1))
    for tracker, error in _pooled(store, "centre_error_px").items():
        curve = score.precision_curve(error)
        label = f"{tracker} [{curve[20]:.3f}]"
        axes.plot(score.PRECISION_THRESHOLDS_PX, curve, label=label, markevery=10, **_style(store, tracker))
    _write_count(axes, store)
    _name_curves(figure)


def _reliability(store: RunStore, figure: Any) -> None:
    """How often each tracker is right at each confidence: tenths of its frames with equal count, area under the ROC.

    A target that is reported as occluded has a confidence of 0.
    """
    axes = _plot(figure)
    right = f"overlap of at least {score.LOOSE_OVERLAP:g}"
    axes.set(xlabel="confidence", ylabel=f"share of frames with an\n{right}", xlim=(0, 1), ylim=(0, 1.02))
    axes.plot([0, 1], [0, 1], color="0.7", lw=0.8, ls=":")
    rows = store.query(
        f"SELECT label, if(estimate_occluded, 0, confidence), overlap >= {score.LOOSE_OVERLAP} "
        "FROM frames WHERE scored AND status = 'ok' "
        "QUALIFY row_number() OVER (PARTITION BY label, scenario, condition, seed ORDER BY frame) > 1 ORDER BY ALL"
    ).rows
    for tracker, own in itertools.groupby(rows, key=lambda row: row[0]):
        said, hit = (np.array(column, dtype=np.float64) for column in list(zip(*own, strict=True))[1:])
        tenths = zip(np.array_split(said, _BINS), np.array_split(hit, _BINS), strict=True)
        means = np.array([(one.mean(), other.mean()) for one, other in tenths if one.size])
        label = f"{tracker} [{score.roc_area(said, hit.astype(np.bool_)):.2f}]"
        axes.plot(*means.T, label=label, **_style(store, tracker))
    _write_count(axes, store)
    _name_curves(figure)


def _degradation(store: RunStore, figure: Any) -> None:
    """The curves, a panel for each axis; of axes swept together a map for each tracker, and below them the curves."""
    found = degradation(store)
    if not found.curves:
        raise ParameterError("this run has no axis with two levels: run bench with --axis NAME=0,1,2")
    if not found.maps:
        _panels(store, found.curves, figure)
        return
    pair = (found.maps[0].first.axis, found.maps[0].second.axis)
    maps = [one for one in found.maps if (one.first.axis, one.second.axis) == pair]
    trackers = list(dict.fromkeys(one.tracker for one in maps))
    columns = min(3 if _is_wide(figure) else 2, len(trackers))
    rows = -(-len(trackers) // columns)
    figure.set_figheight(0.8 * _HIGH_INCH * rows + _HIGH_INCH)
    upper, lower = figure.subfigures(2, 1, height_ratios=[0.8 * rows, 1.0])
    shown: Any = None
    for place, tracker in enumerate(trackers):
        own = [one for one in maps if one.tracker == tracker]
        axes = upper.add_subplot(rows, columns, place + 1)
        shown = _map(own, axes)
        axes.set_title(tracker, fontsize=8, parse_math=False)
    upper.colorbar(shown, ax=upper.axes, label="mean overlap")
    marginal = dict.fromkeys(one.at.label for one in found.curves if " over " in one.at.axis)
    labels = list(marginal)[:2]
    for place, label in enumerate(labels):
        axes = _plot(lower, 1, len(labels), place + 1)
        _curves(store, found.curves, label, axes)
    _name_curves(lower)


def _panels(store: RunStore, curves: Sequence[Degradation], figure: Any) -> None:
    labels = list(dict.fromkeys(one.at.label for one in curves))
    columns = min(4 if _is_wide(figure) else 2, len(labels))
    rows = -(-len(labels) // columns)
    if len(labels) > 1:
        figure.set_figheight(0.7 * _HIGH_INCH * rows + 0.5)
    for place, label in enumerate(labels):
        axes = _plot(figure, rows, columns, place + 1)
        _curves(store, curves, label, axes)
        if place % columns:
            axes.set(ylabel="", yticklabels=[])
    _name_curves(figure)


def _curves(store: RunStore, curves: Sequence[Degradation], label: str, axes: Any) -> None:
    axes.set(ylabel="mean overlap", ylim=(0, 1))
    axes.set_xlabel(label.replace(", ", ",\n"), fontsize=7)
    own = [one for one in curves if one.at.label == label]
    trackers = dict.fromkeys(one.tracker for one in own)
    shade = min(0.15, 0.6 / len(trackers))  # many intervals, one over the other, would hide the curves
    for tracker in trackers:
        levels = sorted({one.at.x for one in own})
        means = [
            mean_degradation([one for one in own if (one.tracker, one.at.x) == (tracker, x)], "overlap") for x in levels
        ]
        style = _style(store, tracker)
        axes.plot(levels, [one.mean for one in means], label=tracker, **style)
        axes.fill_between(
            levels, [one.low for one in means], [one.high for one in means], color=style["color"], alpha=shade, lw=0
        )
        for x, one in zip(levels, means, strict=True):
            _values(axes, x, one, style["color"])
    _write_count(axes, store)


def _map(own: Sequence[Crossing], axes: Any) -> Any:
    """Mean overlaps of one tracker as a heat map with numbers."""
    columns, rows = (list(dict.fromkeys(getattr(one, name) for one in own)) for name in ("first", "second"))
    cells = [[[one.overlap for one in own if (one.first, one.second) == (column, row) and not math.isnan(one.overlap)]
              for column in columns] for row in rows]  # fmt: skip
    means = np.array([[float(np.mean(values)) if values else math.nan for values in line] for line in cells])
    shown = axes.imshow(means, vmin=0.0, vmax=1.0, cmap="viridis", origin="lower", aspect="auto")
    for (row, column), value in np.ndenumerate(means):
        ink = "black" if value > 0.6 else "white"
        axes.text(column, row, number_text(value, 2), ha="center", va="center", fontsize=7, color=ink)
    axes.set_xticks(range(len(columns)), [f"{one.x:.3g}" for one in columns], fontsize=7)
    axes.set_yticks(range(len(rows)), [f"{one.x:.3g}" for one in rows], fontsize=7)
    axes.set_xlabel(columns[0].label, fontsize=7)
    axes.set_ylabel(rows[0].label, fontsize=7)
    return shown


def _cost(store: RunStore, figure: Any) -> None:
    """The mean overlap of each tracker, with its interval over seeds, against its time per frame."""
    from matplotlib.ticker import LogLocator, NullLocator

    axes = _plot(figure)
    axes.set(xscale="log", ylabel="mean overlap", ylim=(0, 1))
    axes.set_xlabel("time per frame, lower quartile [ms], logarithmic axis")
    axes.margins(x=0.2)
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_locator(NullLocator())
    # Other programs only ever lengthen a frame; the lower quartile is that of an idle machine as long as they leave a
    # quarter of the frames undisturbed.
    ms = dict(store.query("SELECT label, quantile_cont(ms, 0.25) FROM frames WHERE ms > 0 GROUP BY label").rows)
    spread = [value for value in ms.values() if value > 0.0]
    few = max(spread, default=1.0) > 30.0 * min(spread, default=1.0)
    axes.xaxis.set_major_locator(LogLocator(subs=(1,) if few else (1, 2, 5)))
    points: dict[str, tuple[float, float]] = {}
    for label, own in grouped(store.results, lambda one: one.label).items():
        found = over_seeds("mean_overlap", own)
        if label in ms and found.seeds:
            points[label] = (ms[label], found.mean)
            style = _style(store, label)
            colour = style["color"]
            axes.plot(*points[label], style["marker"], ms=4, color=colour, label=label)
            _values(axes, ms[label], found, colour)
            if not math.isnan(found.low):
                axes.plot([ms[label]] * 2, [found.low, found.high], "-", lw=1.0, color=colour)
    _write_count(axes, store)
    if not points:
        raise ParameterError("no tracker of this run has both an overlap and a time per frame")
    _name_curves(figure)


def _name_curves(figure: Any) -> None:
    """Write each curve's name beside it in the first panel, or all below where one finds no room."""
    axes = figure.axes[0]
    figure.figure.draw_without_rendering()  # positions in pixels are known only then
    handles, names = axes.get_legend_handles_labels()
    curves = {name: axes.transData.transform(line.get_xydata()) for name, line in zip(names, handles, strict=True)}
    points: dict[str, tuple[float, float]] = {}
    for name, line in zip(names, handles, strict=True):
        own = curves[name][:, None]
        others = [curves[other] for other in names if other != name]
        apart = np.min([np.linalg.norm(own - other, axis=2).min(axis=1) for other in others] or [[0.0]], axis=0)
        points[name] = tuple(line.get_xydata()[int(np.argmax(np.nan_to_num(apart)))])
    if not _write_names(points, {name: one.get_color() for name, one in zip(names, handles, strict=True)}, axes):
        _legend_below(figure)


def _write_names(points: Mapping[str, tuple[float, float]], colours: Mapping[str, str], axes: Any) -> bool:
    """Write names beside their points, each at the nearest place that covers no name or line, nor has one between.

    Returns:
        Whether all have found a place; if not, none is written.
    """
    from matplotlib.text import Text

    whole = axes.figure.figure
    whole.draw_without_rendering()
    unit = whole.dpi / 72.0
    notes: list[Any] = []
    drawn = np.concatenate([_along(axes.transData.transform(line.get_xydata())) for line in axes.lines])
    taken = np.hstack([drawn - 3.0 * unit, drawn + 3.0 * unit])
    offsets = [
        distance * np.array([math.cos(math.radians(turn)), math.sin(math.radians(turn))])
        for distance, turn in itertools.product(range(5, 150, 5), range(0, 360, 30))
    ]
    for label, point in points.items():
        note = axes.annotate(
            label,
            point,
            (0, 0),
            textcoords="offset points",
            ha="center",
            va="center",
            fontsize=7,
            color="0.15",
            parse_math=False,
            arrowprops={"arrowstyle": "-", "lw": 0.5, "color": colours[label], "shrinkA": 1, "shrinkB": 2},
        )
        note.set_in_layout(False)
        notes.append(note)
        half = 0.5 * np.array(Text.get_window_extent(note).size)
        anchor = axes.transData.transform(point)
        found: list[tuple[float, FloatArray, FloatArray, FloatArray]] = []
        for offset in offsets:
            far = float(np.linalg.norm(offset))
            moved = offset / far * half + offset * unit
            box = np.concatenate([anchor + moved - half, anchor + moved + half])
            inside = (box[:2] > axes.bbox.min).all() and (box[2:] < axes.bbox.max).all()
            if inside and not ((box[:2] < taken[:, 2:]) & (box[2:] > taken[:, :2])).all(axis=1).any():
                leader = _along(anchor + np.array([offset, 8.0 * offset / far]) * unit)
                crosses = bool((np.linalg.norm(leader[:, None] - drawn, axis=2) < 2.0 * unit).any())
                found.append((far + _CROSSING_PT * crosses, moved, box, leader))
                if not crosses:
                    break
        if not found:
            for one in notes:
                one.remove()
            return False
        _, moved, box, leader = min(found, key=lambda one: one[0])
        note.set_position(moved / unit)
        taken, drawn = np.vstack([taken, box]), np.vstack([drawn, leader])
    return True


def _along(line: FloatArray) -> FloatArray:
    """`(n, 2)`: points of a line of points [px], a few pixels apart."""
    pieces: list[FloatArray] = []
    for start, end in itertools.pairwise(line):
        if np.isfinite(start + end).all():
            share = np.linspace(0.0, 1.0, 2 + int(np.linalg.norm(end - start) / 4.0))[:, None]
            pieces.append(start + share * (end - start))
    return np.concatenate([line, *pieces])


FIGURES: Mapping[str, Callable[[RunStore, Any], None]] = MappingProxyType(
    {
        "axis": _degradation,
        "cost": _cost,
        "precision": _precision,
        "reliability": _reliability,
        "strips": draw_strips,
        "success": _success,
    }
)
"""What can be drawn, by the file's name."""
