"""Figures for papers."""

import itertools
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Annotation, Text
from small_report import SMALL

from pftrack_sim import report
from pftrack_sim.benchmark import make_plan, run
from pftrack_sim.benchmark.asked.from_names import join_plans
from pftrack_sim.benchmark.asked.plan import TrackerSpec
from pftrack_sim.core import boxes
from pftrack_sim.core.errors import ParameterError, UnknownNameError
from pftrack_sim.core.plugins import BuiltIn
from pftrack_sim.core.records import Estimate, Image
from pftrack_sim.report.figure import _name_curves, _write_names
from pftrack_sim.trackers import registry
from pftrack_sim.trackers.reference import Stay


@pytest.mark.parametrize("spread", [0.0, 0.05, 0.9])
def test_no_name_covers_another_however_near_the_points_are(spread: float):
    axes = Figure(figsize=(4.6, 3.2), layout="constrained").add_subplot()
    axes.set(xscale="log", xlim=(0.3, 30.0), ylim=(0.0, 1.0))
    places = 0.5 + spread * (np.random.default_rng(0).random((16, 2)) - 0.5)
    points = {f"tracker-{k}": (3.0 * 10 ** (x - 0.5), y) for k, (x, y) in enumerate(places.tolist())}
    for x, y in points.values():
        axes.plot(x, y, "o")
    _write_names(points, dict.fromkeys(points, "black"), axes)
    axes.figure.draw_without_rendering()
    boxes = [Text.get_window_extent(one) for one in axes.texts if isinstance(one, Annotation)]
    assert len(boxes) == 16
    assert not any(one.overlaps(other) for one, other in itertools.combinations(boxes, 2))
    inside = axes.get_window_extent().padded(1.0)
    assert all(inside.contains(*corner) for box in boxes for corner in box.corners())


@pytest.mark.parametrize(
    "name", ["success.pdf", "precision.svg", "axis.png", "cost.png", "reliability.png", "strips.png"]
)
def test_figures_for_papers(finished: Path, tmp_path: Path, name: str):
    target = report.write_figure(finished, tmp_path / "figures" / name)
    head = target.read_bytes()[:8]
    assert head.startswith({"pdf": b"%PDF", "svg": b"<?xml", "png": b"\x89PNG"}[name[-3:]])
    assert [path.name for path in target.parent.iterdir()] == [name]


class Honest(Stay):
    """Is always sure, and says that the target is occluded where its box is off."""

    def receive_truth(self, box: boxes.Box, visible_fraction: float) -> None:
        self._true = box

    def _follow(self, image: Image) -> Estimate:
        return Estimate(self._box, occluded=bool(boxes.iou(self._box, self._true) < 0.3))


def test_reliability_takes_an_occluded_target_for_no_confidence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    honest = BuiltIn(lambda **_: Honest(), "says where its box is off", Honest.__module__)
    monkeypatch.setitem(registry._REGISTRY.builtin, "honest", honest)
    overrides = {**SMALL, "duration_s": 3.0, "camera.rate_hz": 10.0}
    plan = make_plan(["plaza-walk"], [TrackerSpec(name="honest", allow_truth=True), "stay"], [0], overrides=overrides)
    store = run(plan, tmp_path / "run", videos="none", workers=0, isolation="never")
    drawn = report.write_figure(store.path, tmp_path / "reliability.svg").read_text()
    assert "honest (truth) [1.00]" in drawn
    assert "stay [0.50]" in drawn


@pytest.mark.slow
def test_axes_swept_together_are_drawn_as_maps_and_curves(tmp_path: Path):
    axes = {"noise": (0, 2), "stream": (0, 3)}
    small = {**SMALL, "camera.rate_hz": 10.0}
    store = run(make_plan(["easy/corridor"], ["ncc"], [0], axes=axes, overrides=small), tmp_path / "run", videos="none")
    drawn = report.write_figure(store.path, tmp_path / "axis.svg").read_text()
    for words in ("noise [", "stream [", "mean over stream", "mean over noise", "ncc", "stay"):
        assert words in drawn  # as comments beside the outlines of their letters
    assert drawn.count("<image") == 3  # a map for each tracker, and the colour bar


@pytest.mark.slow
def test_each_axis_has_a_panel_and_all_share_their_names(tmp_path: Path):
    small = {**SMALL, "camera.rate_hz": 10.0}
    plans = [
        make_plan(["easy/corridor"], ["ncc"], [0], axes={axis: levels}, overrides=small)
        for axis, levels in {"noise": (0, 2), "stream": (3,)}.items()
    ]
    store = run(join_plans(plans), tmp_path / "run", videos="none")
    drawn = report.write_figure(store.path, tmp_path / "axis.svg").read_text()
    assert drawn.count('<g id="axes_') == 2
    assert drawn.count("<!-- stay -->") == 1  # the names stand once, in the first panel
    for words in ("noise [", "stream [", "ncc", "stay"):
        assert words in drawn


def test_unknown_figures_are_errors(finished: Path, tmp_path: Path):
    with pytest.raises(UnknownNameError, match="did you mean 'success'"):
        report.write_figure(finished, tmp_path / "succes.pdf")
    with pytest.raises(ParameterError, match=r"\.pdf, \.svg or \.png"):
        report.write_figure(finished, tmp_path / "success.gif")


def test_curves_are_named_beside_them_where_there_is_room():
    figure = Figure(figsize=(4.6, 3.2), layout="constrained")
    axes = figure.add_subplot()
    x = np.linspace(0.0, 1.0, 30)
    for name, y in {"one": 0.9 - 0.2 * x, "two": 0.3 + 0.1 * x}.items():
        axes.plot(x, y, label=name)
    axes.set(xlim=(0, 1), ylim=(0, 1))
    _name_curves(figure)
    named = {one.get_text(): one for one in axes.texts if isinstance(one, Annotation)}
    assert list(named) == ["one", "two"]
    assert not figure.legends
    for name, y in {"one": 0.9 - 0.2 * x, "two": 0.3 + 0.1 * x}.items():
        assert abs(named[name].xy[1] - np.interp(named[name].xy[0], x, y)) < 1e-9
        inside = Text.get_window_extent(named[name])
        for other in (0.9 - 0.2 * x, 0.3 + 0.1 * x):
            points = axes.transData.transform(np.column_stack([x, other]))
            assert not any(inside.contains(*point) for point in points)


@pytest.mark.parametrize("part", [False, True])
def test_many_curves_are_named_below(part: bool):
    whole = Figure(figsize=(3.5, 2.6), layout="constrained")
    figure = whole.subfigures(2, 1)[1] if part else whole
    axes = figure.add_subplot()
    for k in range(25):
        axes.plot([0.0, 1.0], [0.04 * k, 1.0 - 0.04 * k], label=f"a-long-name-{k}")
    axes.set(xlim=(0, 1), ylim=(0, 1))
    _name_curves(figure)
    assert not axes.texts
    assert len(figure.legends[0].get_texts()) == 25
