"""Bodies, clothes and meshes: natural proportions, graded likeness, a budget, and a model that compiles."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from pftrack_sim.agents.gait.gait import Gait
from pftrack_sim.agents.gait.mocap_writer import MocapWriter
from pftrack_sim.core.errors import ParameterError, UnknownNameError
from pftrack_sim.scene.layout import HIDDEN_GROUP, PEOPLE_GROUP
from pftrack_sim.scene.people.anatomy import sample_anatomy
from pftrack_sim.scene.people.body import PARTS, Person, add_person, part_shells
from pftrack_sim.scene.people.clothes import GARMENTS, sample_outfit, similar_outfit, texture
from pftrack_sim.scene.people.sampling import sample_cast


def rng(seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)


def someone(seed: int, name: str = "target") -> Person:
    return Person(name, sample_anatomy(rng(seed)), sample_outfit(rng(seed + 1000)))


@pytest.mark.parametrize("seed", range(40))
def test_proportions_are_human(seed: int):
    body = sample_anatomy(rng(seed))
    h = body.height_m
    assert 1.45 <= h <= 2.05
    assert abs(body.hip_height_m + body.pelvis_m + body.torso_m + body.head_m - h) < 1e-9
    # Drillis and Contini: hip 0.530, knee 0.285, foot 0.152, arm 0.186 + 0.146 + 0.108, all of stature.
    assert abs(body.hip_height_m / h - 0.530) < 0.025
    assert abs((body.shank_m + body.ankle_m) / h - 0.285) < 0.02
    assert abs(body.foot_m / h - 0.152) < 0.015
    assert abs((body.upper_arm_m + body.forearm_m + body.hand_m) / h - 0.430) < 0.035
    assert 0.085 < body.shoulder_half_m / h < 0.125
    assert 0.042 < body.hip_half_m / h < 0.060


@pytest.mark.parametrize("seed", range(6))
def test_a_standing_body_is_as_tall_as_its_stature(seed: int):
    person = someone(seed)
    body = person.anatomy
    gait = Gait([body], [rng(seed)])
    places, _ = gait.poses()
    shells = part_shells(person)
    top = places[0, PARTS.index("head"), 2] + shells["head"].vertices[:, 2].max()
    bottom = places[0, PARTS.index("left-foot"), 2] + shells["left-foot"].vertices[:, 2].min()
    assert abs(bottom) < 1e-6
    assert abs(top - body.height_m) < 0.03
    chin_to_top = 0.132 / 0.160 * body.head_m
    assert 6.5 < body.height_m / chin_to_top < 8.2


def test_height_asked_for_changes_nothing_else():
    free, asked = sample_anatomy(rng(3)), sample_anatomy(rng(3), 1.9)
    assert asked.height_m == 1.9
    assert (asked.girth, asked.figure, asked.skin, asked.hair, asked.hair_style) == (
        free.girth,
        free.figure,
        free.skin,
        free.hair,
        free.hair_style,
    )


def test_an_impossible_height_is_refused():
    with pytest.raises(ParameterError, match=r"between 1\.2 and 2\.3"):
        sample_anatomy(rng(0), 3.0)


def likeness(first, second) -> float:
    """Mean Bhattacharyya coefficient of the garments' colour histograms."""

    def histogram(outfit, which: str) -> np.ndarray:
        counts, _ = np.histogramdd(
            texture(outfit, which).reshape(-1, 3).astype(float), bins=(8, 8, 8), range=[(0, 256)] * 3
        )
        return counts / counts.sum()

    return float(np.mean([np.sqrt(histogram(first, w) * histogram(second, w)).sum() for w in ("top", "bottom")]))


def test_likeness_grows_with_similarity():
    levels = (0.0, 0.25, 0.5, 0.75, 1.0)
    table = np.array(
        [
            [likeness(similar_outfit(rng(500 + seed), to, level), to) for level in levels]
            for seed in range(14)
            for to in [sample_outfit(rng(seed))]
        ]
    )
    mean = table.mean(axis=0)
    assert (np.diff(mean) > 0.08).all(), mean
    assert mean[0] < 0.15
    assert np.abs(table[:, -1] - 1.0).max() < 1e-9


def test_similarity_has_two_ends():
    to = sample_outfit(rng(1))
    assert similar_outfit(rng(2), to, 1.0) == to
    far = similar_outfit(rng(2), to, 0.0)
    assert np.linalg.norm(np.subtract(far.top.colour, to.top.colour)) > 80
    with pytest.raises(ParameterError, match=r"\[0, 1\]"):
        similar_outfit(rng(2), to, 1.2)


def test_textures_are_pictures():
    outfit = sample_outfit(rng(4))
    for which in GARMENTS:
        picture = texture(outfit, which)
        assert picture.ndim == 3
        assert picture.shape[2] == 3
        assert picture.dtype == np.uint8
        assert np.array_equal(picture, texture(outfit, which))
    with pytest.raises(UnknownNameError, match="garment"):
        texture(outfit, "hat")


@pytest.mark.parametrize("seed", range(12))
def test_triangles_stay_in_budget(seed: int):
    shells = part_shells(someone(seed))
    assert tuple(shells) == PARTS
    assert sum(len(shell.faces) for shell in shells.values()) < 3400
    for name, shell in shells.items():
        assert np.abs(np.linalg.norm(shell.normals, axis=1) - 1.0).max() < 1e-6, name
        assert shell.pixels.min() >= 0.0, name
        assert shell.pixels.max() <= 512.0, name


@pytest.mark.parametrize("seed", range(6))
def test_normals_point_outward(seed: int):
    for name, shell in part_shells(someone(seed)).items():
        corners = shell.vertices[shell.faces]
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert (corners[:, 0] * cross).sum() > 0.0, name
        agree = (cross * shell.normals[shell.faces].sum(axis=1)).sum(axis=1)
        assert (agree > -1e-9).mean() > 0.97, name


def test_six_people_in_a_model():
    people = sample_cast(7, 1.74, 3, 0.4, (0.0, 0.9))
    spec = mujoco.MjSpec()
    for person in people:
        add_person(spec, person)
    model = spec.compile()
    data = mujoco.MjData(model)
    assert model.nq == 0
    assert model.nmocap == 6 * 13
    assert model.nmesh == 6 * 13
    drawn = model.geom_group == PEOPLE_GROUP
    assert drawn.sum() == 6 * 13
    assert not model.geom_contype[drawn].any()
    assert not model.geom_conaffinity[drawn].any()
    hidden = model.geom_group == HIDDEN_GROUP
    assert (model.geom_contype[hidden] == 4).all()
    assert (model.geom_conaffinity[hidden] == 2).all()
    assert (drawn | hidden).all()
    assert (model.mesh_graphadr == -1).all()

    gait = Gait([person.anatomy for person in people], [rng(index) for index in range(6)])
    where = np.array([[1.5 * index, 0.3] for index in range(6)])
    gait.reset(where, np.zeros(6), np.full(6, 1.2))
    MocapWriter(model, [person.name for person in people]).write(data, *gait.poses())
    mujoco.mj_forward(model, data)
    places, _ = gait.poses()
    for index, person in enumerate(people):
        for part, name in enumerate(PARTS):
            assert np.abs(data.body(f"{person.name}/{name}").xpos - places[index, part]).max() < 1e-12


def test_nobody_poses_a_stranger():
    spec = mujoco.MjSpec()
    add_person(spec, someone(0))
    with pytest.raises(UnknownNameError, match="did you mean 'target'"):
        MocapWriter(spec.compile(), ["targett"])


def test_cast_has_streams_of_its_own():
    small, large = sample_cast(3, 1.7, 1, 0.3, (0.5,)), sample_cast(3, 1.7, 4, 0.3, (0.5, 0.1))
    assert [person.name for person in large] == [
        "target",
        "distractor-1",
        "distractor-2",
        "distractor-3",
        "distractor-4",
        "crosser-1",
        "crosser-2",
    ]
    named = {person.name: person for person in large}
    for person in small:
        assert named[person.name] == person


def test_cast_grows_alike():
    apart, alike = sample_cast(5, 1.9, 6, 0.0, ()), sample_cast(5, 1.9, 6, 1.0, ())
    assert np.mean([abs(p.anatomy.height_m - 1.9) for p in apart[1:]]) > 0.05
    for person in alike[1:]:
        assert abs(person.anatomy.height_m - 1.9) < 1e-9
        assert person.outfit == alike[0].outfit
