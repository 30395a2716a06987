"""The evidence for the papers' trackers."""

import importlib
from collections.abc import Iterator
from pathlib import Path
from types import MappingProxyType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pftrack_sim.render.culling import PixelRect
from pftrack_sim.truth.silhouettes import Silhouette

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture
def evidence(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(EXAMPLES)
    return importlib.import_module("paper_evidence")


@pytest.mark.slow
def test_a_tracker_taught_by_the_truth_is_most_certain_there(monkeypatch: pytest.MonkeyPatch, evidence: Any):
    short = MappingProxyType({**evidence.LEARNING, "duration_s": 3.0, "camera.rate_hz": 20})
    monkeypatch.setattr(evidence, "LEARNING", short)
    for axis in evidence.learning(seed=0).axes:
        by_truth = axis.lines[1]
        best = np.asarray(by_truth.get_xdata())[np.argmax(by_truth.get_ydata())]
        assert abs(best) <= 0.15


def test_the_table_has_motion_beside_noise_and_effective_sample_size(evidence: Any):
    *_, row = evidence.noise(0, ["ko2012/video-2"], {"duration_s": 0.5})
    motion, paper, default = ([float(one) for one in cell.split(",")] for cell in row.strip("| ").split(" | ")[1:])
    assert 0.0 < motion[0] < motion[1] < 5.0
    assert paper[0] == 1.0 < default[0]
    assert 1.0 > paper[1] > default[1] > 0.0


def test_a_faded_image_keeps_the_target_and_loses_the_contrast_of_all_else(evidence: Any):
    image = np.random.default_rng(0).integers(0, 256, (20, 30, 3)).astype(np.uint8)
    shows = np.zeros((6, 4), dtype=np.bool_)
    shows[1:5, 1:3] = True
    target = Silhouette(PixelRect(10, 5, 4, 6), shows, shows, np.zeros((6, 4), np.int32))
    inside = np.zeros((20, 30), dtype=np.bool_)
    inside[6:10, 11:13] = True
    for contrast in (0.5, 0.0):
        found = evidence.faded(image, target, contrast)
        assert (found[inside] == image[inside]).all()
        assert np.abs(found[~inside].std(0) - contrast * image[~inside].std(0)).max() < 0.5
    assert evidence.faded(image, None, 0.0).std((0, 1)).max() == 0.0


@pytest.mark.slow
def test_the_table_has_a_line_for_each_change(evidence: Any):
    few = {"duration_s": 0.2, "camera.width_px": 160, "camera.height_px": 120}
    _, _, *rows = evidence.background({"lee2012/01": (0,)}, few)
    names = [row.strip("| ").split(" | ")[0] for row in rows]
    assert len(set(names)) == len(names) == len(evidence.CHANGES) + len(evidence.METHOD_CHANGES) + 2
    assert all(0 <= int(cell) <= 100 for row in rows for cell in row.strip("| ").split(" | ")[1:])


@pytest.mark.slow
def test_only_methods_that_learn_are_taught_and_a_smaller_sigma_keeps_particles_together(evidence: Any):
    few = {"duration_s": 2.0, "camera.width_px": 160, "camera.height_px": 120}
    _, _, *rows = evidence.taught({"lee2012/01": (0,)}, few)
    cells = {row.split("`")[1]: row.strip("| ").split(" | ")[1:] for row in rows}
    assert len(cells) == len(evidence.LESSONS)
    assert all((true == "-") == (not name.startswith("lee2012[")) for name, (*_, true) in cells.items())
    assert any(own != true != "-" for _, own, true in cells.values())
    color, sharp = "lee2012-color[preset=paper]", "lee2012-color[preset=paper,sigma_colour=0.22,sigma_hog=0.22]"
    assert float(cells[sharp][0]) < float(cells[color][0])


@pytest.mark.slow
def test_causes_has_two_presets_by_four_changes_and_a_box_of_fixed_size(evidence: Any, monkeypatch: pytest.MonkeyPatch):
    real = evidence.frames
    short = {"duration_s": 0.3, "camera.width_px": 160, "camera.height_px": 120}
    monkeypatch.setattr(evidence, "frames", lambda name, seed, given, *how: real(name, seed, {**given, **short}, *how))
    head, _, row = evidence.causes({"ko2012/video-2": (0,)})
    values = [float(cell) for cell in row.strip("| ").split(" | ")[1:]]
    assert len(values) == len(head.strip("| ").split(" | ")) == 9
    assert all(0.0 < value <= 1.0 for value in values)


def test_pale_colours_are_less_alike_in_hue_than_in_rgb(monkeypatch: pytest.MonkeyPatch, evidence: Any):
    rng = np.random.default_rng(0)
    truth = SimpleNamespace(visible_fraction=1.0, amodal_box=np.array([40.0, 10.0, 20.0, 40.0]))

    def frames(*_: object) -> Iterator[tuple[Any, Any]]:
        for _ in range(25):
            image = np.full((60, 100, 3), 60)
            image[10:50, 40:60] = (122, 120, 121)
            yield (image + rng.integers(-4, 5, image.shape)).astype(np.uint8), truth

    monkeypatch.setattr(evidence, "frames", frames)
    cells = list(evidence.hue({"any": [0]}))[-1].strip("| ").split(" | ")
    rgb, beside, hsv = ([float(one) for one in cells[column].split(",")] for column in (1, 2, 4))
    assert min(rgb) > 0.97
    assert max(beside) < 0.6, "beside it is another grey"
    assert hsv[0] < min(rgb) - 0.02
