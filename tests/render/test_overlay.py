"""Overlays do not modify their inputs, draw where the boxes are, and accept any box and image size."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from observing import made_truth

from pftrack_sim.core.palette import GREY, styles_of
from pftrack_sim.core.records import Estimate, Frame, Truth
from pftrack_sim.render import overlay
from pftrack_sim.render.overlay import draw_boxes, draw_frame

KO2012 = styles_of(["ko2012"])["ko2012"].colour


def truth(box=(100.0, 60.0, 40.0, 90.0), **changes: Any) -> Truth:
    return made_truth(**{"box": box, **changes})


def picture(width: int = 320, height: int = 240) -> np.ndarray:
    return np.random.default_rng(0).integers(0, 120, (height, width, 3), dtype=np.uint8)


def test_the_input_image_is_not_modified_and_may_be_read_only():
    image = picture()
    kept = image.copy()
    image.setflags(write=False)
    drawn = draw_boxes(image, truth(), {"stay": Estimate(np.array([90.0, 50, 40, 90]))})
    assert np.array_equal(image, kept)
    assert drawn.shape == image.shape
    assert drawn.dtype == np.uint8
    assert drawn.flags.writeable
    assert not np.array_equal(drawn, image)


def test_every_tracker_has_its_colour_on_the_edges_of_its_box():
    image = np.zeros((240, 320, 3), np.uint8)
    estimates = {f"tracker-{i}": Estimate(np.array([150.0 + 12 * i, 100 + 9 * i, 30, 60])) for i in range(3)}
    drawn = draw_boxes(image, truth((20, 150, 10, 20)), estimates)
    for name, estimate in estimates.items():
        colour = styles_of(estimates)[name].colour
        x, y, w, h = (int(v) for v in estimate.box)
        assert tuple(drawn[y + h - 1, x]) == colour  # lower left corner: never under a later box
        assert (drawn[y : y + h, x : x + w] == colour).all(axis=2).sum() > w


def test_the_box_of_an_estimate_that_reports_occlusion_is_dashed():
    image = np.zeros((240, 320, 3), np.uint8)
    box = np.array([150.0, 100, 60, 100])
    open_edge, dashed = (
        (draw_boxes(image, truth((20, 150, 10, 20)), {"ko2012": Estimate(box, occluded=flag)}) == KO2012).all(axis=2)
        for flag in (False, True)
    )
    assert open_edge[100, 150:200].all()
    assert 0.3 < dashed[100, 150:200].mean() < 0.8


def test_drawing_is_deterministic():
    image, estimates = picture(), {"ko2012": Estimate(np.array([90.0, 50, 40, 90]), 0.5)}
    assert np.array_equal(draw_boxes(image, truth(), estimates), draw_boxes(image, truth(), estimates))


@pytest.mark.parametrize("size", [(16, 16), (40, 120), (160, 120), (320, 240), (640, 480)])
@pytest.mark.parametrize(
    "box",
    [
        (np.nan,) * 4,
        (-1e12, -1e12, 3e12, 3e12),
        (-50.0, -50.0, 10.0, 10.0),
        (5.0, 5.0, 0.0, 0.0),
        (0.2, 0.2, 0.1, 0.1),
        (1e15, 0.0, 1.0, 1.0),
    ],
)
def test_any_box_can_be_drawn_on_any_image(size: tuple[int, int], box: tuple[float, float, float, float]):
    image = picture(*size)
    scored = np.nan_to_num(box)
    estimates = {"a tracker with a long name": Estimate(scored, particles=np.tile(scored, (5, 1)))}
    out = truth(box=tuple(scored), amodal_box=box, visible_box=(np.nan,) * 4, state="out_of_view")
    assert draw_boxes(image, out, estimates, people=(out, truth(name="distractor-1", amodal_box=box))).shape == (
        size[1],
        size[0],
        3,
    )


def test_particles_are_drawn_inside_the_image_only():
    image = np.zeros((240, 320, 3), np.uint8)
    particles = np.array([[200.0, 200, 4, 4], [-100, 0, 2, 2], [1e9, 5, 2, 2], [np.nan, 0, 1, 1]])
    estimate = {"ko2012": Estimate(np.array([250.0, 50, 20, 20]), particles=particles)}
    with_dots = draw_boxes(image, truth((20, 150, 10, 20)), estimate)
    without = draw_boxes(image, truth((20, 150, 10, 20)), estimate, particles=False)
    assert tuple(with_dots[202, 202]) == KO2012
    assert (with_dots != without).any(axis=2).sum() == 1


def test_other_people_of_a_frame_are_marked():
    image = picture()
    target, other = truth(), truth((200.0, 80.0, 30.0, 80.0), name="distractor-1")
    frame = Frame(0, 0.0, image, target, (target, other))
    alone = Frame(0, 0.0, image, target, (target,))
    with_other, without = draw_frame(frame, {}), draw_frame(alone, {})
    changed = (with_other != without).any(axis=2)
    assert changed.any()
    assert not changed[:, :195].any()


def test_a_tracker_has_the_colour_of_its_run_whatever_others_are_drawn():
    image, box = np.zeros((240, 320, 3), np.uint8), np.array([150.0, 100, 60, 100])
    styles = styles_of(["a", "oracle+servo", "b"])
    assert styles["oracle+servo"].colour == GREY
    for label, style in styles.items():
        drawn = draw_boxes(image, truth((20, 150, 10, 20)), {label: Estimate(box)}, styles=styles)
        assert tuple(drawn[100, 180]) == style.colour


def test_stay_is_grey_and_dashed_and_trackers_of_one_colour_differ_in_their_marker():
    image, box = np.zeros((240, 320, 3), np.uint8), np.array([150.0, 100, 60, 100])
    stay, ko2012, chau2011 = (
        draw_boxes(image, truth((20, 150, 10, 20)), {name: Estimate(box)}) for name in ("stay", "ko2012", "chau2011")
    )
    assert 0.3 < (stay[120:180, 150] == GREY).all(axis=1).mean() < 0.8
    assert (ko2012[120:180, 150] == KO2012).all()
    assert (chau2011[120:180, 150] == KO2012).all()
    assert (ko2012 != chau2011)[92:109, 202:219].any()


@pytest.mark.parametrize("size", [(320, 240), (640, 480)])
def test_the_legend_covers_little_of_the_image(size: tuple[int, int]):
    image = np.full((size[1], size[0], 3), 255, np.uint8)
    estimates = {f"a-long-name-{i}[alpha=0.5]": Estimate(np.array([150.0, 60, 30, 60])) for i in range(5)}
    drawn = draw_boxes(image, truth((150, 60, 30, 60)), estimates)
    covered = (drawn[:50] < 255).all(axis=2).mean() * 50 / size[1]
    assert 0.0 < covered < 0.12


def test_of_many_trackers_the_first_are_named_and_the_others_counted(monkeypatch: pytest.MonkeyPatch):
    written: list[str] = []
    monkeypatch.setattr(overlay._Canvas, "_write", lambda self, text, *rest: written.append(text))
    box = np.array([100.0, 50, 20, 40])
    for width, height in ((320, 240), (640, 480)):
        image = np.full((height, width, 3), 255, np.uint8)
        for count in (20, 40):
            estimates = {f"tracker-{k}": Estimate(box + np.array([k % 20, 0, 0, 0])) for k in range(count)}
            written.clear()
            drawn = draw_boxes(image, truth((100, 50, 20, 40)), estimates)
            named = [text for text in written if text.startswith("tracker-")]
            assert named == list(estimates)[: len(named)]
            assert 2 <= len(named) < 10
            low, high = 1.0 / 39.0, (20 - len(named)) / (20 + len(named))
            high = high if count == 20 else 1.0
            assert f"and {count - len(named)} more: {low:.2f} to {high:.2f}" in written
            covered = (drawn[: height // 3] < 255).all(axis=2).sum() / (width * height)
            assert 0.02 < covered < 0.12
    written.clear()
    draw_boxes(image, truth((100, 50, 20, 40)), dict(list(estimates.items())[:10]))
    assert not [text for text in written if "more" in text or text.startswith("tracker-")]
    assert len(written) == 11, "ten overlaps and the target's state"
