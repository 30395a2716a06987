"""Truth of people who are occluded, truncated, near or far, and side effects of observing."""

from __future__ import annotations

import dataclasses
import weakref
from collections.abc import Sequence

import mujoco
import numpy as np
import pytest
from observing import mujocos_renderer, observed
from render_stage import FAR, HEIGHT, WIDTH, K, Stage, build, looking, new_spec, plain_values

from pftrack_sim.core import boxes
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.photometry import LUMINANCE
from pftrack_sim.core.records import Truth
from pftrack_sim.scene.layout import PEOPLE_GROUP, SCENERY_GROUP
from pftrack_sim.truth.observer import TruthObserver
from pftrack_sim.truth.silhouettes import PeopleInView, Silhouette

SIZE = WIDTH, HEIGHT
LEVEL = looking((0, 0, 1.0), (5, 0, 1.0))


def without_mast(people: int, *, pillars: int = 0, ground: bool = False) -> Stage:
    """A stage whose robot is not in the way."""
    stage = build(people=people, pillars=pillars, ground=ground)
    stage.model.body_pos[stage.model.body("robot/mast").id] = (-9.0, 0.0, 0.0)
    return stage


def alone(at: tuple[float, float, float] = (4.0, 0.0, 0.0), *, ground: bool = False) -> Stage:
    stage = without_mast(1, ground=ground)
    stage.place("target", at)
    return stage


def test_a_target_behind_the_camera_is_out_of_view_and_still_listed():
    truth = observed(alone((-4.0, 0.0, 0.0)), LEVEL)["target"]
    assert truth.state == "out_of_view"
    assert np.isnan(truth.amodal_box).all()
    assert np.isnan(truth.visible_box).all()
    assert boxes.area(truth.box) == 0.0
    assert (truth.visible_fraction, truth.truncation, truth.occluders) == (0.0, 1.0, ())
    assert np.isnan(truth.luminance)
    assert truth.distance_m == pytest.approx(4.0, abs=0.1)


def test_a_target_beside_the_view_has_an_amodal_box_and_no_pixels():
    truth = observed(alone((2.0, 6.0, 0.0)), LEVEL)["target"]
    assert truth.state == "out_of_view"
    assert np.isfinite(truth.amodal_box).all()
    assert truth.amodal_box[0] + truth.amodal_box[2] < 0
    assert truth.truncation == 1.0
    assert boxes.area(truth.box) == 0.0


def test_a_target_that_fills_the_frame():
    truth = observed(alone((0.25, 0.0, -0.2)), LEVEL)["target"]
    assert truth.state == "visible"
    assert truth.box.tolist() == [0, 0, WIDTH, HEIGHT]
    assert truth.truncation > 0.5
    assert truth.visible_fraction == 1.0


def test_a_camera_inside_the_target():
    for height in (-0.6, -0.2, 0.05):
        stage = alone((0.0, 0.0, height))
        truth = observed(stage, LEVEL)["target"]
        assert np.isfinite(truth.amodal_box).all()
        # Surfaces seen from within are not drawn: the truth is of the picture.
        with mujocos_renderer(stage.model) as renderer:
            drawn = (renderer.ids(stage.data, LEVEL) >= 0).any()
        assert truth.state == ("visible" if drawn else "out_of_view")


def test_a_target_at_sixty_metres_is_a_few_pixels():
    truth = observed(alone((60.0, 0.0, 0.0)), LEVEL)["target"]
    assert truth.state == "visible"
    assert 4 < truth.amodal_box[3] < 10
    assert truth.visible_fraction == 1.0
    assert np.abs(truth.visible_box[3] - truth.amodal_box[3]) < 2


def test_a_target_beyond_the_far_plane_is_out_of_view():
    truth = observed(alone((FAR + 5.0, 0.0, 0.0)), LEVEL)["target"]
    assert truth.state == "out_of_view"
    assert boxes.area(truth.box) == 0.0


@pytest.mark.parametrize(
    ("edge", "offset"),
    [("left", (0.0, 1.75, 0.0)), ("right", (0.0, -1.75, 0.0)), ("top", (0.0, 0.0, 1.4)), ("bottom", (0.0, 0.0, -1.9))],
)
def test_a_target_cut_by_an_edge(edge: str, offset: tuple[float, float, float]):
    truth = observed(alone((3.0 + offset[0], offset[1], offset[2])), LEVEL)["target"]
    x, y, w, h = truth.amodal_box
    outside = {"left": x < 0, "right": x + w > WIDTH, "top": y < 0, "bottom": y + h > HEIGHT}
    assert [name for name, out in outside.items() if out] == [edge]
    assert 0.05 < truth.truncation < 0.95
    assert truth.truncation == pytest.approx(1 - boxes.area(truth.box) / boxes.area(truth.amodal_box))
    assert truth.visible_fraction == 1.0
    touched = {"left": truth.visible_box[0] == 0, "top": truth.visible_box[1] == 0}
    touched |= {"right": truth.visible_box[0] + truth.visible_box[2] == WIDTH}
    touched |= {"bottom": truth.visible_box[1] + truth.visible_box[3] == HEIGHT}
    assert [name for name, touch in touched.items() if touch] == [edge]


def test_a_fully_occluded_target_names_its_occluders():
    stage = without_mast(2, pillars=2)
    for name, at in (("target", (5.0, 0.0, 0.0)), ("distractor-1", (1.2, 0.35, -0.2))):
        stage.place(name, at)
    model = stage.model
    wall, other = model.body("pillar-2").id, model.body("pillar-1").id
    model.body_pos[other] = (-9, 0, 0)
    model.body_pos[wall] = (3.0, 0.0, 1.0)
    model.geom_size[model.body_geomadr[wall]] = (0.1, 3.0, 3.0)
    model.geom_aabb[model.body_geomadr[wall], 3:] = (0.1, 3.0, 3.0)
    mujoco.mj_forward(model, stage.data)
    truths = observed(stage, LEVEL)
    target = truths["target"]
    assert target.state == "occluded"
    assert target.visible_fraction == 0.0
    assert np.isnan(target.visible_box).all()
    assert boxes.area(target.box) > 0
    assert set(target.occluders) == {"pillar-2", "distractor-1"}
    assert truths["distractor-1"].visible_fraction == 1.0


def test_people_and_the_robot_are_named_as_occluders():
    stage = build(people=3, pillars=0, ground=False)
    stage.place("target", (4.0, 0.1, 0.0))
    stage.place("distractor-1", (2.5, 0.0, 0.0))
    stage.place("distractor-2", (6.0, 0.35, 0.0))
    model = stage.model
    model.body_pos[model.body("robot/mast").id] = (0.7, 0.0, 0.9)
    mujoco.mj_forward(model, stage.data)
    truths = observed(stage, LEVEL)
    assert truths["target"].occluders == ("distractor-1", "robot")
    assert truths["distractor-1"].occluders == ("robot",)
    assert set(truths["distractor-2"].occluders) == {"distractor-1", "target", "robot"}


def test_of_two_at_equal_depth_the_larger_geom_is_in_front_as_in_one_drawing():
    stage = without_mast(2)
    for name in stage.people:
        stage.place(name, (4.0, 0.0, 0.0))
    truths = observed(stage, LEVEL)
    with mujocos_renderer(stage.model) as renderer:
        shown = renderer.ids(stage.data, LEVEL)
    owners = {stage.owner(geom) for geom in np.unique(shown[shown >= 0])}
    assert owners == {"distractor-1"}
    assert (truths["target"].visible_fraction, truths["distractor-1"].visible_fraction) == (0.0, 1.0)
    assert truths["target"].occluders == ("distractor-1",)


def test_image_motion_is_counted_from_the_previous_frame():
    stage = alone()
    observer = TruthObserver(stage.model, stage.people, K, SIZE)

    def next_frame(at: tuple[float, float, float]) -> Truth:
        stage.place("target", at)
        return observer.observe(stage.data, LEVEL, None, 0.0, stage.roots())[0]

    first, second = next_frame((4.0, 0.0, 0.0)), next_frame((4.0, 0.3, 0.0))
    assert first.image_motion_px == 0.0
    moved = boxes.centre(second.amodal_box) - boxes.centre(first.amodal_box)
    assert second.image_motion_px == pytest.approx(np.hypot(*moved))
    assert second.image_motion_px > 5
    assert np.isnan(next_frame((-4.0, 0.0, 0.0)).image_motion_px)
    assert np.isnan(next_frame((4.0, 0.0, 0.0)).image_motion_px)


def test_the_luminance_is_that_of_the_given_image():
    stage = alone()
    observer = TruthObserver(stage.model, stage.people, K, SIZE)
    red, green, blue = LUMINANCE
    for colour, weight in (((255, 255, 255), 1.0), ((255, 0, 0), red), ((0, 255, 0), green), ((0, 0, 255), blue)):
        image = np.full((HEIGHT, WIDTH, 3), colour, np.uint8)
        (truth,) = observer.observe(stage.data, LEVEL, image, 0.0, stage.roots())
        assert truth.luminance == pytest.approx(weight, abs=1e-9)


def test_observing_changes_no_argument():
    stage = build(1)
    kept = {name: getattr(stage.model, name).copy() for name in ("geom_group", "geom_rgba", "geom_pos")}
    state = stage.data.geom_xpos.copy(), stage.data.mocap_pos.copy()
    image = np.random.default_rng(0).integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8)
    pixels, poses = image.copy(), stage.roots()
    observer = TruthObserver(stage.model, stage.people, K, SIZE)
    first = observer.observe(stage.data, LEVEL, image, 0.0, poses)
    assert np.array_equal(image, pixels)
    assert np.array_equal(poses, stage.roots())
    assert all(np.array_equal(getattr(stage.model, name), value) for name, value in kept.items())
    assert np.array_equal(stage.data.geom_xpos, state[0])
    assert np.array_equal(stage.data.mocap_pos, state[1])
    again = TruthObserver(stage.model, stage.people, K, SIZE).observe(stage.data, LEVEL, image, 0.0, poses)
    assert [plain_values(one) for one in first] == [plain_values(one) for one in again]
    with pytest.raises(dataclasses.FrozenInstanceError):
        first[0].state = "occluded"  # type: ignore[misc]


def test_the_ground_covers_feet_that_are_in_it():
    for height in (0.01, -0.02):
        truth = observed(alone((4.0, 0.0, height), ground=True), LEVEL)["target"]
        assert truth.occluders == (() if height > 0 else ("ground",))
        assert (truth.visible_fraction == 1.0) == (height > 0)


def test_what_is_read_late_is_what_was_read_at_once():
    stage = build()
    image = np.random.default_rng(0).integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8)
    places = [(4.0 + 0.1 * step, 0.3 * step - 0.6, 0.0) for step in range(5)]
    at_once, late = (TruthObserver(stage.model, stage.people, K, SIZE) for _ in range(2))
    expected, kept = list[tuple[Truth, ...]](), list[Sequence[Truth]]()
    for place in places:
        stage.place("target", place)
        expected.append(tuple(at_once.observe(stage.data, LEVEL, image, 0.0, stage.roots())))
        repr(expected[-1])
        before = stage.data.geom_xpos.copy()
        kept.append(late.observe(stage.data, LEVEL, image, 0.0, stage.roots()))
    assert {one.name for one in kept[-1]} == set(late.silhouettes)
    late.finish()
    assert kept == expected
    np.testing.assert_array_equal(stage.data.geom_xpos, before)


def test_frames_that_are_not_referenced_are_forgotten_without_a_search(monkeypatch: pytest.MonkeyPatch):
    searched: list[int] = []
    find = PeopleInView.silhouette

    def counted(self: PeopleInView, person: int) -> Silhouette | None:
        searched.append(person)
        return find(self, person)

    monkeypatch.setattr(PeopleInView, "silhouette", counted)
    stage = build(people=3)
    observer = TruthObserver(stage.model, stage.people, K, SIZE)
    held, lost = (observer.observe(stage.data, LEVEL, None, when, stage.roots()) for when in (0.0, 0.1))
    reference = weakref.ref(lost)
    del lost
    assert reference() is None
    assert searched == [0, 0]
    observer.finish()
    assert searched == [0, 0, 1, 2]
    assert len(held) > 1
    assert searched == [0, 0, 1, 2]


def test_infinite_planes_occlude():
    spec = new_spec()
    spec.worldbody.add_body(name="ground").add_geom(
        type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1], group=SCENERY_GROUP
    )
    body = spec.worldbody.add_body(name="target/pelvis", mocap=True, pos=[4, 0, 0])
    body.add_geom(size=[0.5, 0, 0], group=PEOPLE_GROUP)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    stage = Stage(model, data, ("target",), {})
    truth = observed(stage, LEVEL)["target"]
    assert truth.occluders == ("ground",)
    assert 0.4 < truth.visible_fraction < 0.8


def test_invalid_arguments_raise():
    stage = build()
    with pytest.raises(ParameterError, match="at least one"):
        TruthObserver(stage.model, (), K, SIZE)
    with pytest.raises(ParameterError, match="nobody/pelvis"):
        TruthObserver(stage.model, ("nobody",), K, SIZE)
    observer = TruthObserver(stage.model, stage.people, K, SIZE)
    image = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    with pytest.raises(ParameterError, match="T_world_people"):
        observer.observe(stage.data, LEVEL, image, 0.0, stage.roots()[:1])
    with pytest.raises(ParameterError, match="image"):
        observer.observe(stage.data, LEVEL, image[:5], 0.0, stage.roots())
