"""Drawings of how the package is built: what `pictures.py drawings` runs."""

from __future__ import annotations

from pathlib import Path

from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.patches import FancyBboxPatch

ROOMS = (
    ("cli", "commands, tables, progress"),
    ("report · studio", "pages and figures of a run · an episode live in the browser"),
    ("benchmark", "plans, suites, rollout, run store, claims"),
    ("policies · wrappers", "trackers and controllers as policies · other observations"),
    ("env · trackers · controllers · score · formats · logs", "siblings that never import each other"),
    ("simulation", "the loop of an episode: dry run, plan, compile, advance, capture"),
    ("truth", "boxes, visibility, poses of a frame"),
    ("render", "OpenGL and ray casting, shutter and lens, overlays"),
    ("agents", "what moves: robot, pedestrians, carts, gait"),
    ("scene · camera", "MjSpec builders · pinhole, distortion, shake, shutter, sensor"),
    ("scenario", "TOML to validated, frozen values"),
    ("core", "boxes, records, errors, random streams, plug-ins"),
)
"""From above to below, with what they hold; the checked order is in `pyproject.toml`."""

EPISODE = (
    ("scenario + seed", "resolve"),
    ("stage", "build"),
    ("dry run", "move"),
    ("plan", "plan"),
    ("model", "compile"),
)
FRAME = ("robot and people\nadvance", "camera is\nshaken", "image is\ncaptured", "truth is\nobserved")
ANSWERS = ("tracker\nbox", "controller\ncommand")
_BLUE, _GREY, _GREEN = "#dbe7f3", "#eceff1", "#dff0df"


def draw(folder: Path) -> None:
    """Write `rooms.svg` and `episode.svg`."""
    folder.mkdir(parents=True, exist_ok=True)
    plt.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "pftrack_sim"})
    for name, (width, height), drawn in (("rooms", (9.0, 6.0), _rooms), ("episode", (9.0, 3.6), _episode)):
        figure, axes = plt.subplots(figsize=(width, height))
        axes.set(xlim=(0.0, 10.0), ylim=(0.0, 10.0))
        axes.axis("off")
        drawn(axes)
        figure.savefig(folder / f"{name}.svg", bbox_inches="tight", metadata={"Date": None})
        plt.close(figure)


def _rooms(axes: Axes) -> None:
    for row, (name, holds) in enumerate(ROOMS):
        y = 10.0 - (row + 1) * 10.0 / len(ROOMS)
        _box(axes, 0.0, y + 0.06, 10.0, 0.71, _BLUE if row < 5 else _GREY)
        axes.text(0.15, y + 0.52, name, va="center", weight="bold", size=10)
        axes.text(0.15, y + 0.23, holds, va="center", size=8.5)


def _episode(axes: Axes) -> None:
    for column, (what, how) in enumerate(EPISODE):
        _box(axes, 2.0 * column, 7.6, 1.6, 1.6, _GREY)
        axes.text(2.0 * column + 0.8, 8.4, what, ha="center", va="center", size=9)
        if column:
            _arrow(axes, (2.0 * column - 0.4, 8.4), (2.0 * column, 8.4))
            axes.text(2.0 * column - 0.2, 9.4, how, ha="center", size=8, style="italic")
    for column, what in enumerate(FRAME):
        _box(axes, 2.0 * column, 4.2, 1.6, 1.8, _BLUE)
        axes.text(2.0 * column + 0.8, 5.1, what, ha="center", va="center", size=9)
        if column:
            _arrow(axes, (2.0 * column - 0.4, 5.1), (2.0 * column, 5.1))
    _arrow(axes, (8.8, 7.6), (0.8, 6.0))
    axes.text(5.0, 6.9, "reset", ha="center", size=8, style="italic")
    for column, what in zip((5.0, 2.0), ANSWERS, strict=True):
        _box(axes, column, 0.8, 1.8, 1.7, _GREEN)
        axes.text(column + 0.9, 1.65, what, ha="center", va="center", size=9)
    _box(axes, 8.0, 0.8, 1.8, 1.7, _GREEN)
    axes.text(8.9, 1.65, "score: overlap\nwith the truth", ha="center", va="center", size=9)
    _arrow(axes, (4.8, 4.2), (5.7, 2.5))
    axes.text(5.1, 3.25, "image", ha="right", size=8, style="italic")
    _arrow(axes, (7.0, 4.2), (8.6, 2.5))
    axes.text(8.0, 3.4, "truth", ha="left", size=8, style="italic")
    _arrow(axes, (6.8, 1.65), (8.0, 1.65))
    _arrow(axes, (5.0, 1.65), (3.8, 1.65))
    _arrow(axes, (2.0, 1.65), (0.8, 4.2))
    axes.text(1.2, 2.3, "next step", ha="right", size=8, style="italic")


def _box(axes: Axes, x: float, y: float, width: float, height: float, colour: str) -> None:
    style = "round,pad=0,rounding_size=0.08"
    axes.add_patch(FancyBboxPatch((x, y), width, height, boxstyle=style, facecolor=colour, edgecolor="#78909c"))


def _arrow(axes: Axes, start: tuple[float, float], end: tuple[float, float]) -> None:
    axes.annotate("", end, start, arrowprops={"arrowstyle": "->", "color": "#455a64"})
