from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, get_args

import mujoco
import numpy as np
import pytest
from numpy.typing import ArrayLike

from pftrack_sim import scenario
from pftrack_sim.agents.path import Path
from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap
from pftrack_sim.agents.robot.lane import Lane
from pftrack_sim.core.random_streams import stream
from pftrack_sim.scenario.model import Lights, Place
from pftrack_sim.scene.build import build_stage
from pftrack_sim.scene.layout import (
    CONTACT_HEIGHT_M,
    CONTACT_OF_THINGS_HEIGHT_M,
    HIDDEN_GROUP,
    SCENERY_GROUP,
    WalkableArea,
)
from pftrack_sim.scene.places.place import add_place
from pftrack_sim.scene.scene_spec import SceneSpec

KINDS = get_args(Place.model_fields["kind"].annotation)
SHIPPED = ("plaza-walk", "corridor", "warehouse", "street-night", "real/pavement", "hall", "park")


@cache
def built_place(
    kind: str, seed: int = 0, clutter: float = 1.0, shadows: bool = True
) -> tuple[mujoco.MjModel, WalkableArea]:
    spec = SceneSpec()
    area = add_place(spec, Place(kind=kind, clutter=clutter), Lights(shadows=shadows), stream(seed, "place"))
    return spec.compile(), area


def body_poses(model: mujoco.MjModel) -> dict[str, np.ndarray]:
    return {
        model.body(index).name: np.concatenate([model.body_pos[index], model.body_quat[index]])
        for index in range(1, model.nbody)
    }


def clearance_m(area: WalkableArea, points: ArrayLike) -> float:
    """Least distance from `(N, 2)` points to the footprints."""
    return float(ObstacleMap(area).distances(np.transpose(points))[:, : len(area.footprints)].min())


def sampled(path: Path, from_m: float = 0.0) -> np.ndarray:
    """Points every 10 cm on a path, to its end."""
    return np.stack(path.at(np.append(np.arange(from_m, path.length_m, 0.1), path.length_m))[:2], axis=1)


def resampled(points: np.ndarray) -> np.ndarray:
    """Points every 10 cm on a polyline."""
    return sampled(Path(points, corner_m=0.0))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", [0, 1, 7])
def test_place_compiles_within_its_triangle_budget(kind: str, seed: int) -> None:
    model, _ = built_place(kind, seed)
    drawn = [index for index in range(model.ngeom) if model.geom_group[index] != HIDDEN_GROUP]
    meshes = [index for index in drawn if model.geom_type[index] == mujoco.mjtGeom.mjGEOM_MESH]
    triangles = sum(int(model.mesh_facenum[model.geom_dataid[index]]) for index in meshes)
    assert model.ngeom < 250
    assert 2_000 < triangles < 30_000
    assert model.nq == 0, "scenery has no joints"


@pytest.mark.parametrize("kind", KINDS)
def test_same_seed_gives_the_same_model_whatever_was_built_in_between(kind: str) -> None:
    first, _ = built_place(kind, 3)
    for seed, patches in ((4, 0.3), (3, 0.0)):
        spec = SceneSpec()
        add_place(spec, Place(kind=kind), Lights(patches=patches), stream(seed, "place"))
    second = spec.compile()
    fields = ("geom_pos", "geom_quat", "geom_rgba", "body_pos", "body_quat")
    for field in (*fields, "mesh_vert", "mesh_normal", "mesh_texcoord", "mesh_face", "tex_data"):
        np.testing.assert_array_equal(getattr(first, field), getattr(second, field))


@pytest.mark.parametrize("kind", KINDS)
def test_fixed_props_do_not_depend_on_the_seed(kind: str) -> None:
    bare = [built_place(kind, seed, clutter=0.0) for seed in (0, 1, 2)]
    poses = [body_poses(model) for model, _ in bare]
    fixed = {
        name
        for name in poses[0]
        if name.startswith(("house", "wall", "pillar", "rack", "tree", "lamp-post", "lockers", "kiosk", "fountain"))
    }
    assert len(fixed) >= 6
    for other in poses[1:]:
        assert poses[0].keys() == other.keys()
        for name in fixed:
            np.testing.assert_allclose(poses[0][name], other[name], rtol=0, atol=1e-12)
    assert bare[0][1] == bare[1][1] == bare[2][1], "without loose props the area does not depend on the seed"


@pytest.mark.parametrize("kind", KINDS)
def test_loose_props_depend_on_the_seed_and_clutter_sets_their_share(kind: str) -> None:
    full, half, none = (built_place(kind, 0, clutter)[1] for clutter in (1.0, 0.5, 0.0))
    assert len(none.footprints) < len(half.footprints) < len(full.footprints)
    assert full.footprints != built_place(kind, 1)[1].footprints
    names = [footprint.name for footprint in full.footprints]
    everywhere = {footprint.name: footprint for footprint in full.footprints}
    for footprint in half.footprints:
        assert footprint == everywhere[footprint.name], "a smaller share does not move the remaining props"
    assert len(set(names)) == len(names)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_goals_are_walkable(kind: str, seed: int) -> None:
    model, area = built_place(kind, seed)
    left, low, right, high = area.bounds_m
    bodies = body_poses(model)
    assert len(area.goals_m) >= 8
    assert (np.array(area.goals_m) >= (left + 0.4, low + 0.4)).all()
    assert (np.array(area.goals_m) <= (right - 0.4, high - 0.4)).all()
    assert clearance_m(area, area.goals_m) >= 0.35
    for footprint in area.footprints:
        assert footprint.name in bodies
        assert footprint.height_m > 0.0
        np.testing.assert_allclose(bodies[footprint.name][:2], footprint.centre_m, rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", SHIPPED)
@pytest.mark.parametrize("seed", [0, 1, 2, 3, 4, 5])
def test_shipped_paths_of_target_and_robot_keep_clear_of_obstacles(name: str, seed: int) -> None:
    settings = scenario.load(name).resolve(seed)
    _, area = built_place(settings.place.kind, seed)
    left, low, right, high = area.bounds_m
    path = np.array(settings.target.path_m)
    walked = resampled(path)
    heading = path[1] - path[0]
    assert abs(np.arctan2(heading[1], heading[0])) < 0.15, "paths begin along +x, the heading of the robot at start"
    length = float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
    assert length >= settings.target.speed_m_s * settings.duration_s, "the target walks until the end"
    lane = Lane.of(settings.robot, Path(path))
    assert lane is not None
    for track, margin in ((walked, 0.6), (sampled(lane.path, lane.start_m), 0.5)):
        assert (track[:, 0].min(), track[:, 1].min()) >= (left, low)
        assert track[:, 0].max() <= right - 0.5
        assert track[:, 1].max() <= high - 0.5
        assert clearance_m(area, track) >= margin


@pytest.mark.parametrize("name", scenario.names())
def test_the_target_of_every_scenario_keeps_its_shoulders_clear(name: str) -> None:
    for seed in (0, 1):
        settings = scenario.load(name).resolve(seed)
        target, place = settings.target, settings.place.model_copy(update={"clutter": 1.0})
        area = add_place(SceneSpec(), place, settings.lights, stream(seed, "place"))
        path = np.array(target.path_m)
        # What is pushed may well roll up to things.
        walked = path if target.pushed else resampled(path)[: int(10 * target.speed_m_s * settings.duration_s)]
        assert clearance_m(area, walked) > 0.25, seed


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_scenarios_resolve_for_every_seed(name: str) -> None:
    shipped = scenario.load(name)
    assert shipped.resolve(0) != shipped.resolve(1)
    assert {scenario.load(other).resolve(0).place.kind for other in SHIPPED} == set(KINDS)


@pytest.mark.parametrize("kind", KINDS)
def test_every_geom_has_a_named_body_and_collision_bits(kind: str) -> None:
    model, area = built_place(kind)
    plane = model.geom("ground/plane")
    assert model.geom_type[plane.id] == mujoco.mjtGeom.mjGEOM_PLANE
    assert model.body(model.geom_bodyid[plane.id]).name == "ground"
    assert model.body_pos[model.geom_bodyid[plane.id], 2] == 0.0
    assert int((model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE).sum()) == 1
    for index in range(model.ngeom):
        body = int(model.geom_bodyid[index])
        assert body > 0
        assert model.body(body).name
        assert "/" not in model.body(body).name, "a slash marks a part of a person or the robot"
        bits = (int(model.geom_contype[index]), int(model.geom_conaffinity[index]))
        if model.geom_group[index] == HIDDEN_GROUP:
            assert bits == (1, 2)
        else:
            assert model.geom_group[index] == SCENERY_GROUP
            assert bits == (0, 0)
    solid = {model.body(int(model.geom_bodyid[index])).name for index in np.flatnonzero(model.geom_contype == 1)}
    assert {footprint.name for footprint in area.footprints} <= solid


def distances_to_what_is_drawn(model: mujoco.MjModel) -> Callable[[Sequence[float], Sequence[float]], float]:
    """Distance from a point along a ray [m]; negative where nothing is hit."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    seen, hit = np.array([1, 0, 0, 0, 0, 0], np.uint8), np.zeros(1, np.int32)
    return lambda point, ray: mujoco.mj_ray(model, data, np.array(point), np.array(ray), seen, 1, -1, hit, None)


@pytest.mark.parametrize("kind", KINDS)
def test_drawn_ground_is_at_height_zero(kind: str) -> None:
    model, area = built_place(kind)
    distance = distances_to_what_is_drawn(model)
    for x, y in area.goals_m:
        # Slightly beside the goal: a ray along the edge of two triangles may pass between them.
        below = distance((x + 0.013, y + 0.017, 1.0), (0.0, 0.0, -1.0))
        assert abs(below - 1.0) < 0.02


@pytest.mark.parametrize("kind", KINDS)
def test_darkness_on_the_ground_lies_above_what_is_painted_on_it(kind: str) -> None:
    """At the height of a marking the two would flicker through each other."""
    model, area = built_place(kind)
    distance = distances_to_what_is_drawn(model)
    near = np.random.default_rng(0).uniform(-3.0, 3.0, (400, 2)) + np.tile(area.goals_m, (400, 1))[:400]
    heights = np.array([1.0 - distance((x, y, 1.0), (0.0, 0.0, -1.0)) for x, y in near])
    ground = heights[heights < 0.02]
    assert ground.size > 100
    assert ground.max() < CONTACT_OF_THINGS_HEIGHT_M - 0.0015
    assert CONTACT_HEIGHT_M > CONTACT_OF_THINGS_HEIGHT_M + 0.0015


@pytest.mark.parametrize("kind", KINDS)
def test_every_horizontal_ray_hits_something_drawn(kind: str) -> None:
    model, area = built_place(kind)
    distance = distances_to_what_is_drawn(model)
    turn = np.deg2rad(np.arange(0.0, 360.0, 3.0))
    for x, y in area.goals_m[:6]:
        for angle in turn:
            far = distance((x, y, 1.25), (np.cos(angle), np.sin(angle), 0.0))
            assert 0.0 < far < 110.0, (x, y, np.rad2deg(angle))


@pytest.mark.parametrize("kind", KINDS)
def test_number_of_lights_and_shadows(kind: str) -> None:
    model, _ = built_place(kind)
    names = [model.light(index).name for index in range(model.nlight)]
    assert all(name.startswith("light/") for name in names)
    assert 1 <= model.nlight <= 7, "OpenGL has eight, and the headlight is one of them"
    by_day = kind in ("plaza", "street-day", "park")
    assert int(model.light_castshadow.sum()) == int(by_day), "lamps cast no shadows"
    assert int(built_place(kind, shadows=False)[0].light_castshadow.sum()) == 0
    head = model.vis.headlight
    assert head.diffuse.max() == 0.0
    assert head.ambient.min() > 0.0
    assert head.ambient.max() < 0.7
    assert ("light/sun" in names) == by_day


def test_sun_direction_follows_the_scenario() -> None:
    spec = SceneSpec()
    lights = Lights(sun_azimuth_deg=90.0, sun_elevation_deg=30.0)
    add_place(spec, Place(kind="plaza"), lights, stream(0, "place"))
    model = spec.compile()
    towards_sun = -model.light("light/sun").dir
    np.testing.assert_allclose(towards_sun, [0.0, np.cos(np.pi / 6), 0.5], rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("changes", "pixels"),
    [
        ({}, 320),
        ({"camera.width_px": 84}, 84),
        ({"lights.shadow_pixels": 512}, 512),
        ({"lights.shadows": False}, 0),
        ({"lights.patches": 0.0}, 0),
    ],
)
def test_the_map_of_shadows_is_as_wide_as_the_image_and_absent_where_nothing_casts_one(
    changes: dict[str, Any], pixels: int
) -> None:
    lit = {"lights.patches": 0.4, "camera.width_px": 320, **changes}
    spec, _ = build_stage(scenario.load("corridor", lit).resolve(0), 0, 0.002)
    assert spec.visual.quality.shadowsize == pixels
