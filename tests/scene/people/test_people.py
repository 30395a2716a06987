"""People: body proportions, appearance similarity, meshes, and the compiled model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from pftrack_sim import scenario
from pftrack_sim.agents.gait.gait import Gait, quaternions
from pftrack_sim.core.data_files import asset_table
from pftrack_sim.scenario.clothes import Clothes
from pftrack_sim.scene.build import add_agents
from pftrack_sim.scene.layout import HIDDEN_GROUP, PEOPLE_CONAFFINITY, PEOPLE_CONTYPE, PEOPLE_GROUP
from pftrack_sim.scene.people.anatomy import sample_anatomy
from pftrack_sim.scene.people.cloth_texture import PIXEL_M, GarmentName, cloth_texture
from pftrack_sim.scene.people.head_texture import paint_head
from pftrack_sim.scene.people.mesh import load_profile, lofted_mesh, profile, superellipse_rings
from pftrack_sim.scene.people.outfit import Garment, Outfit, sample_outfit, similar_outfit
from pftrack_sim.scene.people.person import (
    PARTS,
    Person,
    add_person,
    part_meshes,
    part_mocap_ids,
    sample_others,
    sample_target,
)
from pftrack_sim.scene.people.texture_atlas import ATLAS_SIZE, TOP, cloth_mesh, paint_atlas
from pftrack_sim.scene.scene_spec import SceneSpec


def rng(seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)


def person(seed: int) -> Person:
    return Person("target", sample_anatomy(rng(seed)), sample_outfit(rng(seed + 1000)))


def sample_people(
    seed: int, height_m: float, clothes: Clothes | None = None, **similarities: Sequence[float]
) -> tuple[Person, ...]:
    """The target, and others by their roles."""
    target = sample_target(seed, "target", height_m, clothes or Clothes())
    return target, *sample_others(seed, target, similarities)


@pytest.mark.parametrize("seed", range(40))
def test_body_proportions_are_within_published_ranges(seed: int):
    body = sample_anatomy(rng(seed))
    h, hip = body.height_m, body.thigh_m + body.shank_m + body.ankle_m
    assert 1.45 <= h <= 2.05
    assert abs(hip + body.pelvis_m + body.torso_m + body.head_m - h) < 1e-9
    # Drillis and Contini: hip 0.530, knee 0.285, foot 0.152, arm 0.186 + 0.146 + 0.108, in statures.
    assert abs(hip / h - 0.530) < 0.025
    assert abs((body.shank_m + body.ankle_m) / h - 0.285) < 0.02
    assert abs(body.foot_m / h - 0.152) < 0.015
    assert abs((body.upper_arm_m + body.forearm_m + body.hand_m) / h - 0.430) < 0.035
    assert 0.085 < body.shoulder_half_m / h < 0.125
    assert 0.042 < body.hip_half_m / h < 0.060


@pytest.mark.parametrize("seed", range(6))
def test_standing_meshes_reach_from_the_ground_to_the_stature(seed: int):
    sampled = person(seed)
    body = sampled.anatomy
    positions = Gait([body], [rng(seed)]).positions
    meshes = part_meshes(sampled)
    top = positions[0, PARTS.index("head"), 2] + meshes["head"].vertices[:, 2].max()
    bottom = positions[0, PARTS.index("left-foot"), 2] + meshes["left-foot"].vertices[:, 2].min()
    assert abs(bottom) < 1e-6
    assert abs(top - body.height_m) < 0.03
    chin_to_top = 0.132 / 0.160 * body.head_m
    assert 6.5 < body.height_m / chin_to_top < 8.2


def test_a_given_height_changes_no_other_attribute():
    free, given = sample_anatomy(rng(3)), sample_anatomy(rng(3), 1.9)
    assert given.height_m == 1.9
    for name in ("girth", "figure", "skin", "hair", "hair_style", "beard"):
        assert getattr(given, name) == getattr(free, name)


def colour_similarity(first: Outfit, second: Outfit) -> float:
    """Mean Bhattacharyya coefficient of the garments' colour histograms."""

    def histogram(outfit: Outfit, garment: GarmentName) -> np.ndarray:
        pixels = cloth_texture(outfit, garment).reshape(-1, 3).astype(float)
        counts, _ = np.histogramdd(pixels, bins=(8, 8, 8), range=[(0, 256)] * 3)
        return counts / counts.sum()

    return float(np.mean([np.sqrt(histogram(first, w) * histogram(second, w)).sum() for w in ("top", "bottom")]))


def test_measured_colour_similarity_grows_with_the_similarity_parameter():
    levels = (0.0, 0.25, 0.5, 0.75, 1.0)
    references = [sample_outfit(rng(seed)) for seed in range(14)]
    measured = np.array(
        [
            [colour_similarity(similar_outfit(rng(500 + seed), reference, level), reference) for level in levels]
            for seed, reference in enumerate(references)
        ]
    )
    mean = measured.mean(axis=0)
    assert (np.diff(mean) > 0.08).all(), mean
    assert mean[0] < 0.15
    assert np.abs(measured[:, -1] - 1.0).max() < 1e-9


def test_similarity_limits():
    reference = sample_outfit(rng(1))
    assert similar_outfit(rng(2), reference, 1.0) == reference
    dissimilar = similar_outfit(rng(2), reference, 0.0)
    assert np.linalg.norm(np.subtract(dissimilar.top.colour, reference.top.colour)) > 80
    alike = similar_outfit(rng(2), reference, 0.999)
    assert replace(alike, top=reference.top, bottom=reference.bottom, shoes=reference.shoes) == reference, (
        "cut, lengths"
    )


def test_atlas_is_an_image_and_repeatable():
    sampled = person(4)
    atlas = paint_atlas(sampled.anatomy, sampled.outfit)
    assert atlas.shape == (ATLAS_SIZE, ATLAS_SIZE, 3)
    assert atlas.dtype == np.uint8
    assert np.array_equal(atlas, paint_atlas(sampled.anatomy, sampled.outfit))


@pytest.mark.parametrize("seed", range(12))
def test_meshes_have_few_faces_and_outward_unit_normals(seed: int):
    meshes = part_meshes(person(seed))
    assert tuple(meshes) == PARTS
    assert sum(len(mesh.faces) for mesh in meshes.values()) < 3500
    for name, mesh in meshes.items():
        assert np.abs(np.linalg.norm(mesh.normals, axis=1) - 1.0).max() < 1e-6, name
        assert mesh.pixels.min() >= 0.0, name
        assert mesh.pixels.max() <= ATLAS_SIZE, name
        corners = mesh.vertices[mesh.faces]
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert (corners[:, 0] * cross).sum() > 0.0, name
        agreement = (cross * mesh.normals[mesh.faces].sum(axis=1)).sum(axis=1)
        assert (agreement > -1e-9).mean() > 0.97, name
        for coarse, most, off in zip(mesh.coarse, (0.45, 0.22), (0.1, 0.2), strict=True):
            assert len(coarse) < most * len(mesh.faces), name
            ends = [(mesh.vertices[np.unique(faces)].min(axis=0), np.ptp(mesh.vertices[np.unique(faces)], axis=0))
                    for faces in (mesh.faces, coarse)]  # fmt: skip
            assert np.abs(ends[0][0] - ends[1][0]).max() < off * ends[0][1].max(), name
            assert np.abs(ends[0][1] - ends[1][1]).max() < 1.5 * off * ends[0][1].max(), name


def test_model_of_six_people():
    people = sample_people(7, 1.74, distractor=[0.4] * 3, crosser=(0.0, 0.9))
    spec = SceneSpec()
    for sampled in people:
        add_person(spec, sampled)
    model = spec.compile()
    data = mujoco.MjData(model)
    assert model.nq == 0
    assert model.nmocap == 6 * 13
    assert model.nmesh == 3 * model.nmocap, "two meshes for the distance each"
    visual, hidden = model.geom_group == PEOPLE_GROUP, model.geom_group == HIDDEN_GROUP
    assert visual.sum() == 6 * 13
    assert (visual | hidden).all()
    assert not model.geom_contype[visual].any()
    assert not model.geom_conaffinity[visual].any()
    assert (model.geom_contype[hidden] == PEOPLE_CONTYPE).all()
    assert (model.geom_conaffinity[hidden] == PEOPLE_CONAFFINITY).all()
    # No convex hulls: visual meshes never collide.
    assert (model.mesh_graphadr == -1).all()

    gait = Gait([sampled.anatomy for sampled in people], [rng(index) for index in range(6)])
    start = np.array([[1.5 * index, 0.3] for index in range(6)])
    gait.reset(start, np.zeros(6), np.full(6, 1.2))
    positions = gait.positions
    parts = part_mocap_ids(model, [sampled.name for sampled in people])
    data.mocap_pos[parts], data.mocap_quat[parts] = positions, quaternions(gait.rotations)
    mujoco.mj_forward(model, data)
    for index, sampled in enumerate(people):
        for part, name in enumerate(PARTS):
            assert np.abs(data.body(f"{sampled.name}/{name}").xpos - positions[index, part]).max() < 1e-12


def test_parts_of_a_name_that_is_not_in_the_model_are_an_error():
    spec = SceneSpec()
    add_person(spec, person(0))
    with pytest.raises(KeyError, match="targett"):
        part_mocap_ids(spec.compile(), ["targett"])


def test_adding_people_changes_no_other_person():
    few = sample_people(3, 1.7, distractor=[0.3], crosser=(0.5,))
    many = sample_people(3, 1.7, distractor=[0.3] * 4, crosser=(0.5, 0.1), passer=(0.2,))
    named = {sampled.name: sampled for sampled in many}
    distractors = [f"distractor-{number}" for number in range(1, 5)]
    assert list(named) == ["target", *distractors, "crosser-1", "crosser-2", "passer-1"]
    for sampled in few:
        assert named[sampled.name] == sampled


def test_similarity_applies_to_height_and_clothes():
    different, same = (sample_people(5, 1.9, distractor=[similarity] * 6) for similarity in (0.0, 1.0))
    assert np.mean([abs(other.anatomy.height_m - 1.9) for other in different[1:]]) > 0.05
    for other in same[1:]:
        assert abs(other.anatomy.height_m - 1.9) < 1e-9
        assert other.outfit == same[0].outfit


@pytest.mark.parametrize("seed", range(8))
def test_who_crosses_the_line_of_sight_is_as_large_as_the_target(seed: int):
    target, *crossers = sample_people(seed, 1.9, crosser=(0.0, 0.5, 1.0))
    for crosser in crossers:
        assert crosser.anatomy.height_m >= target.anatomy.height_m
        assert crosser.anatomy.girth >= target.anatomy.girth


def test_people_wear_other_clothes_in_another_place_and_wardrobe() -> None:
    def cast(name: str, wardrobe: int = 0) -> tuple[Person, ...]:
        settings = scenario.load(name, {"target.wardrobe": wardrobe, "distractors.count": 1}).resolve(3)
        return add_agents(SceneSpec(), settings, 3, {}, {})[:2]

    assert cast("plaza-walk", 2) == cast("plaza-walk", 2)
    assert cast("easy/corridor")[0] == cast("hard/corridor")[0], "one seed shows one person in all tiers of a place"
    casts = [cast("plaza-walk", wardrobe) for wardrobe in range(3)] + [cast(name) for name in ("corridor", "hall")]
    assert len({person.outfit.top for people in casts for person in people}) == 10


def test_jackets_cover_the_hips_and_hoods_stand_off_the_neck() -> None:
    someone = person(0)
    low, back = {}, {}
    for cut in ("shirt", "jacket", "hood"):
        torso = part_meshes(replace(someone, outfit=replace(someone.outfit, cut=cut, looseness=0.2)))["torso"].vertices
        low[cut], back[cut] = torso[:, 2].min(), torso[torso[:, 2] > 0.9 * torso[:, 2].max(), 0].min()
    assert low["jacket"] < low["shirt"] - 0.05
    assert low["hood"] == low["shirt"]
    assert back["hood"] < back["shirt"] - 0.01


def test_skirts_hang_below_the_hips_of_feminine_figures_that_do_not_stoop() -> None:
    someone = person(0)
    skirt = replace(someone.outfit, skirt=True)
    low = {
        figure: part_meshes(replace(someone, anatomy=replace(someone.anatomy, figure=figure), outfit=skirt))["pelvis"]
        for figure in (0.0, 1.0)
    }
    assert low[1.0].vertices[:, 2].min() < low[0.0].vertices[:, 2].min() - 0.1
    for kind, worn in (("wave", True), ("sit", False), ("crouch", False), ("bend", False)):
        actions = [{"kind": kind, "at_s": 3.0}]
        clothes = {"target.clothes.skirt": True, "target.actions": actions}
        settings = scenario.load("hall", clothes).resolve(3)
        assert add_agents(SceneSpec(), settings, 3, {}, {})[0].outfit.skirt is worn


@pytest.mark.parametrize("mirror", [1.0, -1.0])
@pytest.mark.parametrize("name", ["torso", "forearm", "ear"])
def test_normals_are_means_of_the_faces_weighted_by_area(name: str, mirror: float):
    rings = superellipse_rings(load_profile(name), 9, power=2.2) * (1.0, mirror, 1.0)
    mesh = lofted_mesh(rings, np.zeros((rings.shape[0], rings.shape[1] + 1, 2)))
    # Coinciding points, at the seam and at poles, share one normal.
    gaps = np.linalg.norm(mesh.vertices[:, None] - mesh.vertices[None], axis=2)
    welded = np.argmax(gaps < 1e-9, axis=1)
    a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    areas = np.cross(b - a, c - a)
    assert float((a * areas).sum()) > 0.0, "the faces look outwards"
    sums = np.zeros_like(mesh.vertices)
    for corner in range(3):
        np.add.at(sums, welded[mesh.faces[:, corner]], areas)
    expected = sums[welded] / np.linalg.norm(sums[welded], axis=1, keepdims=True)
    assert np.abs(mesh.normals - expected).max() < 1e-9


def test_cloth_runs_around_the_body_to_scale():
    circle = superellipse_rings(profile(z=[0.5, 0.3, 0.2], x=0.0, front=0.1, back=0.1, side=0.1), 60)
    pixels = cloth_mesh(circle, TOP, 256.0, 0.6).pixels.reshape(3, 61, 2)
    columns = 256.0 + np.linspace(-np.pi, np.pi, 61) * 0.1 / PIXEL_M
    assert np.abs(pixels[..., 0] - columns).max() < 0.5
    assert np.abs(pixels[:, 0, 1] - np.array([0.1, 0.3, 0.4]) / PIXEL_M).max() < 1e-9


def test_a_plain_garment_has_its_colour_on_average_and_its_details_their_own():
    plain = Garment((120, 60, 200), (10, 250, 30))
    shirt, jacket = Outfit(plain, plain, plain), Outfit(plain, plain, plain, cut="jacket")
    top, bottom, shoes = (cloth_texture(shirt, name).astype(float) for name in ("top", "bottom", "shoes"))
    for cloth in (top[5:-5], bottom[5:]):
        assert np.abs(cloth.mean(axis=(0, 1)) / plain.colour - 1.0).max() < 0.03
    assert top[-5:].mean() < 0.85 * top.mean(), "hem"
    assert bottom[:5].mean() < 0.5 * bottom.mean(), "belt"
    assert (shoes[-8:] == plain.accent).all(), "sole"
    buttons = np.abs(cloth_texture(jacket, "top") - top).max(axis=2) > 20.0
    assert 0.002 < buttons.mean() < 0.02
    assert np.abs(np.flatnonzero(buttons.any(axis=0)) - 256).max() < 10


def test_a_face_is_skin_in_front_and_hair_on_top():
    body = replace(sample_anatomy(rng(1)), skin=(220, 170, 140), hair=(30, 20, 15), hair_style="short", beard=0.0)
    face = paint_head(body).astype(float)
    height, width = face.shape[:2]
    assert np.abs(face[:5] - body.hair).max() < 2.0
    assert np.abs(face[height // 2, width // 2 + 26] - body.skin).max() < 12.0
    eyes = face[38:46, width // 2 - 24 : width // 2 + 24]
    assert eyes.min() < 80.0
    bearded = paint_head(replace(body, beard=1.0)).astype(float)
    assert bearded[75, width // 2].mean() < face[75, width // 2].mean() - 40.0


def test_garments_are_as_frequent_as_their_weights():
    weights = dict(asset_table("people")["garments"]["top"]["patterns"])
    worn = [sample_outfit(rng(seed)).top.pattern for seed in range(600)]
    for pattern, weight in weights.items():
        assert abs(worn.count(pattern) / 600 - weight / sum(weights.values())) < 0.07


def test_a_scenario_says_what_the_target_wears_and_the_rest_is_drawn():
    (drawn,) = sample_people(5, 1.7)
    clothes = Clothes(
        top="#a03020", shoes="#102030", cut="hood", hair="cap", skin="#c09070", girth=1.2, long_legs=False
    )
    dressed = sample_people(5, 1.7, clothes, distractor=(1.0, 1.0))
    target = dressed[0]
    assert target.outfit.top.colour == (0xA0, 0x30, 0x20)
    assert (target.outfit.top.pattern, target.outfit.cut, target.outfit.long_legs) == ("plain", "hood", False)
    assert target.outfit.bottom == drawn.outfit.bottom
    assert target.outfit.shoes.colour == (16, 32, 48)
    assert (target.anatomy.hair_style, target.anatomy.girth, target.anatomy.skin) == ("cap", 1.2, (192, 144, 112))
    assert target.anatomy.height_m == drawn.anatomy.height_m
    assert dressed[1].outfit == target.outfit, "look-alikes are like it"
    (checked,) = sample_people(5, 1.7, Clothes(pattern="checks"))
    assert (checked.outfit.top.colour, checked.outfit.top.pattern) == (drawn.outfit.top.colour, "checks")


def test_colours_are_hexadecimal():
    with pytest.raises(ValueError, match="red, green and blue in hexadecimal digits, as '#a03020'"):
        Clothes(top="red")


def test_a_child_has_a_large_head_on_short_legs() -> None:
    for seed in range(8):
        adult, child = sample_anatomy(rng(seed), 1.48), sample_anatomy(rng(seed), 1.1)
        assert 5.0 < child.height_m / (0.132 / 0.160 * child.head_m) < 6.2
        assert (child.thigh_m + child.shank_m) / 1.1 < 0.96 * (adult.thigh_m + adult.shank_m) / 1.48
        assert child.beard == 0.0
        assert child.hair_style != "bald"
        hip = child.thigh_m + child.shank_m + child.ankle_m
        assert abs(hip + child.pelvis_m + child.torso_m + child.head_m - 1.1) < 1e-9
