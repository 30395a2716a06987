"""Rooms from files: where one may walk, what is drawn, and what is wrong with a file."""

from __future__ import annotations

import math
import pickle
import re
from pathlib import Path
from typing import Any

import cv2
import mujoco
import numpy as np
import pytest
from room_files import TABLE, WRITERS, scenario_of, write_glb, write_map, write_mjcf

from pftrack_sim import scenario
from pftrack_sim.agents.pedestrians.obstacle_map import ROUTE_CLEARANCE_M, ObstacleMap, VisibilityGraph
from pftrack_sim.core.errors import PftrackError, ScenarioError
from pftrack_sim.scene.build import build_stage, walkable_area
from pftrack_sim.scene.layout import HIDDEN_GROUP, SCENERY_GROUP
from pftrack_sim.scene.places import mesh_file
from pftrack_sim.scene.places.navigation import Grid, area_of, rectangles
from pftrack_sim.scene.places.place import load_room
from pftrack_sim.simulation.world import World


def resolved(kind: str, model: Path, **place: Any) -> scenario.ResolvedScenario:
    return scenario.load(scenario_of(kind, model, **place)).resolve(0)


@pytest.mark.parametrize("kind", WRITERS)
def test_walls_and_table_are_in_the_way_and_nothing_else_is(tmp_path: Path, kind: str):
    area = walkable_area(resolved(kind, WRITERS[kind](tmp_path)), 0)
    assert area.bounds_m == pytest.approx((-4.0, -3.0, 4.0, 3.0), abs=0.16)
    obstacles = ObstacleMap(area)
    rng = np.random.default_rng(0)
    points = rng.uniform((-3.4, -2.4), (3.4, 2.4), (4000, 2))
    x, y, half = TABLE
    over = np.abs(points - (x, y)) - half
    to_table = np.hypot(*np.maximum(over, 0.0).T) + np.minimum(over.max(axis=1), 0.0)
    clearance = obstacles.clearance_m(points)
    clear = np.minimum(to_table, np.minimum(3.9 - np.abs(points[:, 0]), 2.9 - np.abs(points[:, 1])))
    walked = clear > ROUTE_CLEARANCE_M
    # Rectangles are larger than what they cover by a cell at most, and the inside of the table does not matter.
    assert np.abs(clearance - clear)[walked].max() < 0.12
    assert (clearance[to_table < 0.0] <= 0.0).all()
    assert (obstacles.clearance_m(area.goals_m) >= ROUTE_CLEARANCE_M).all()
    graph = VisibilityGraph(obstacles)
    assert all(graph.shortest_route(area.goals_m[0], goal) is not None for goal in area.goals_m[1:])


@pytest.mark.parametrize("kind", WRITERS)
def test_what_is_drawn_stands_on_the_floor_and_collides_as_boxes_alone(tmp_path: Path, kind: str):
    spec, area = build_stage(resolved(kind, WRITERS[kind](tmp_path)), 0, 0.002)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    robots = np.array([model.body(body).name.startswith("robot/") for body in model.geom_bodyid])
    solid = (model.geom_contype | model.geom_conaffinity) != 0
    assert (model.geom_group[solid & ~robots] == HIDDEN_GROUP).all()
    assert not solid[model.geom_group == SCENERY_GROUP].any()
    assert model.nq == mujoco.MjModel.from_xml_path(str(Path("assets/robot.xml"))).nq
    names = [model.body(index).name for index in range(model.nbody)]
    for footprint in area.footprints:
        assert names.count(footprint.name) == 1
    # A ray down from above the table meets its top; one beside it, the floor.
    drawn = np.zeros(6, np.uint8)
    drawn[SCENERY_GROUP] = 1
    found = np.zeros(1, np.int32)
    heights = [2.0 - mujoco.mj_ray(model, data, np.array([px, py, 2.0]), np.array([0.0, 0, -1]), drawn, 1, -1, found)
               for px, py in ((1.0, 0.5), (-2.0, -1.0))]  # fmt: skip
    assert heights == pytest.approx([0.9 if kind != "map" else 2.0, 0.0], abs=1e-5) or kind == "map"


def test_a_map_turned_by_its_origin_has_its_rooms_where_ros_has_them(tmp_path: Path):
    plain = walkable_area(resolved("map", write_map(tmp_path)), 0)
    turned = walkable_area(resolved("map", write_map(tmp_path, yaw_rad=0.5)), 0)
    cosine, sine = math.cos(0.5), math.sin(0.5)
    x, y = np.array(plain.goals_m).T + np.array([[5.5], [4.5]])
    moved = np.column_stack([cosine * x - sine * y - 5.5, sine * x + cosine * y - 4.5])
    assert ObstacleMap(turned).clearance_m(moved).min() > 0.2
    outside = np.array([[7.5, 4.5], [5.5, 0.2]])
    around = np.column_stack([cosine * outside[:, 0] - sine * outside[:, 1] - 5.5,
                              sine * outside[:, 0] + cosine * outside[:, 1] - 4.5])  # fmt: skip
    assert ObstacleMap(turned).clearance_m(around)[1] < 0.0


def test_dark_is_free_where_the_map_is_negated(tmp_path: Path):
    with pytest.raises(PftrackError, match=r"no room for a person: the widest free place, at -?\d"):
        walkable_area(resolved("map", write_map(tmp_path, negate=1)), 0)


def test_the_digest_follows_the_files_that_a_file_names(tmp_path: Path):
    def digest() -> str:
        return scenario.load(scenario_of("map", tmp_path / "map.yaml")).tree["place"]["model_digest"]

    write_map(tmp_path)
    first = digest()
    assert digest() == first
    image = tmp_path / "map.pgm"
    image.write_bytes(image.read_bytes()[:-1] + b"\0")
    assert digest() != first


def test_a_model_lies_beside_the_scenario_that_names_it(tmp_path: Path):
    write_map(tmp_path)
    rest = 'duration_s = 2.0\n[robot.route]\nkind = "still"\n[camera]\n[target]\npath = "auto"\n'
    (tmp_path / "base.toml").write_text(f'title = "t"\n{rest}[place]\nkind = "map"\nmodel = "map.yaml"\n')
    (tmp_path / "below").mkdir()
    (tmp_path / "below" / "own.toml").write_text('extends = "../base.toml"\n')
    loaded = scenario.load(tmp_path / "below" / "own.toml", {"place.wall_m": 2.5})
    assert loaded.resolve(0).place.model == str(tmp_path / "map.yaml")
    assert pickle.loads(pickle.dumps(loaded)).tree == loaded.tree
    assert scenario.load(loaded.tree).tree == loaded.tree


def test_a_choice_of_models_has_their_whole_paths_and_a_digest_of_each(tmp_path: Path):
    (tmp_path / "other").mkdir()
    paths = [write_map(tmp_path), write_map(tmp_path / "other")]
    file = tmp_path / "rooms.toml"
    listed = ["map.yaml", "other/map.yaml"]

    def load() -> scenario.Scenario:
        file.write_text(
            f'title = "t"\n[robot.route]\nkind = "still"\n[target]\npath = "auto"\n[place]\nkind = "map"\n'
            f"model = {{ choice = {listed} }}\n"
        )
        return scenario.load(file)

    before = load()
    assert {before.resolve(seed).place.model for seed in range(20)} == {str(path) for path in paths}
    assert scenario.load(before.tree).tree == before.tree
    write_map(tmp_path / "other", resolution=0.06)
    assert load().tree["place"]["model_digest"] != before.tree["place"]["model_digest"]
    listed.append("absent.yaml")
    with pytest.raises(ScenarioError, match=r"place\.model: no such file: .*absent"):
        load()


@pytest.mark.parametrize("kind", WRITERS)
def test_a_missing_file_is_named(tmp_path: Path, kind: str):
    with pytest.raises(ScenarioError, match=r"place\.model: no such file: .*absent"):
        scenario.load(scenario_of(kind, tmp_path / "absent.yaml"))
    model = tmp_path / f"empty.{ {'map': 'yaml', 'mjcf': 'xml', 'mesh': 'glb'}[kind] }"
    model.write_text("")
    with pytest.raises(ScenarioError, match=r"empty\.\w+: 1 problem in this scenario\n  place\.model: "):
        walkable_area(resolved(kind, model), 0)


@pytest.mark.parametrize(
    ("kind", "write", "place", "words"),
    [
        ("map", lambda folder: write_map(folder, mode="scale"), {}, "mode trinary, as .* mode 'scale'"),
        ("map", lambda folder: write_map(folder, image="none.pgm"), {}, r"image none\.pgm cannot be read: No such"),
        (
            "map",
            lambda folder: write_map(folder, image="map.yaml"),
            {},
            r"image map\.yaml cannot be read: no PGM or PNG",
        ),
        ("map", lambda folder: write_map(folder, resolution=1.9), {}, "the map is 418 m long, at most 250 m"),
        (
            "mesh",
            lambda folder: write_glb(folder, 1000.0),
            {},
            r"is 8.*e\+03 m long, 2 to 250 m are a room: set place\.scale",
        ),
        ("mesh", lambda folder: write_glb(folder, 0.01), {}, "is 0.08.* m long, 2 to 250 m are a room"),
        ("mesh", lambda folder: write_glb(folder, floor=False), {}, "no room for a person"),
        ("mjcf", lambda folder: write_mjcf(folder, more="<frm/>"), {}, "MuJoCo cannot load it: .*unrecognized element"),
        ("mjcf", write_mjcf, {"floor_m": 2.0}, "no room for a person: the widest free place, at"),
    ],
)
def test_a_file_that_is_no_room_is_one_clear_error(
    tmp_path: Path, kind: str, write: Any, place: dict[str, Any], words: str
):
    with pytest.raises(ScenarioError, match=words):
        walkable_area(resolved(kind, write(tmp_path), **place), 0)


def test_units_of_a_mesh_are_those_that_its_scale_says(tmp_path: Path):
    area = walkable_area(resolved("mesh", write_glb(tmp_path, 1000.0), scale=0.001), 0)
    assert area.bounds_m == pytest.approx((-4.0, -3.0, 4.0, 3.0), abs=0.16)


def test_a_path_through_the_table_is_an_error_with_the_place(tmp_path: Path):
    tree = scenario_of("mjcf", write_mjcf(tmp_path)) | {"target": {"path_m": [[2.6, 0.5], [-2.0, 0.5]]}}
    with pytest.raises(ScenarioError) as caught:
        World(scenario.load(tree).resolve(0), 0, draws=False)
    (line,) = [one for one in caught.value.problems if one.startswith("target.path_m")]
    found = re.search(r"would walk through 'obstacle-\d+' at (\S+), (\S+)$", line)
    assert found is not None
    assert [float(one) for one in found.groups()] == pytest.approx([1.8, 0.5], abs=0.11)


def test_rectangles_cover_what_they_must_and_no_more_than_they_may():
    rng = np.random.default_rng(3)
    for _ in range(20):
        allowed = rng.random((12, 17)) < 0.6
        wanted = allowed & (rng.random((12, 17)) < 0.5)
        covered = np.zeros_like(allowed)
        for low, high, left, right in rectangles(wanted, allowed):
            covered[low:high, left:right] = True
        assert not (wanted & ~covered).any()
        assert not (covered & ~allowed).any()


def test_a_large_ragged_place_gets_coarser_cells_rather_than_many_rectangles():
    rng = np.random.default_rng(0)
    blocked = np.ones((400, 400), bool)
    blocked[20:380, 20:380] = rng.random((360, 360)) < 0.0002
    found = area_of(Grid(blocked, (0.0, 0.0), 0.05))
    assert 5 < len(found.footprints) <= 160
    assert found.bounds_m == pytest.approx((1.0, 1.0, 19.0, 19.0), abs=0.4)


def test_too_many_triangles_are_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(mesh_file, "MOST_TRIANGLES", 20)
    with pytest.raises(ScenarioError, match=r"has \d\d triangles, 1 to 20 are drawn; simplify it first"):
        walkable_area(resolved("mesh", write_glb(tmp_path)), 0)


def test_open_surfaces_are_drawn_from_both_sides_and_closed_ones_from_outside(tmp_path: Path):
    room = load_room(resolved("mesh", write_glb(tmp_path)).place)
    faces = {item.name: len(item.prop[0].faces) for item in room.items}
    assert faces == {"room-table": 12, "room-floor": 12, **{f"room-wall-{number}": 4 for number in range(4)}}


@pytest.mark.parametrize("degrees", [0, 7, 31, 44, 70])
def test_rectangles_lie_along_the_walls_of_a_map_that_is_askew(degrees: float):
    cosine, sine = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    turn = np.array([[cosine, -sine], [sine, cosine]])
    blocked = np.ones((400, 400), np.uint8)
    for half, value in (((140.0, 90.0), 0), ((30.0, 20.0), 1)):
        corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * half @ turn.T + 200.0
        cv2.fillConvexPoly(blocked, np.rint(corners).astype(np.int32), value)
    area = area_of(Grid(blocked > 0, (-10.0, -10.0), 0.05))
    # The middles of cells are where those of pixels are, half a cell from their corners.
    points = np.random.default_rng(0).uniform((-6.4, -3.9), (6.4, 3.9), (2000, 2))
    to_block = np.hypot(*np.maximum(np.abs(points) - (1.5, 1.0), 0.0).T)
    clear = np.minimum(to_block, np.minimum(7.0 - np.abs(points[:, 0]), 4.5 - np.abs(points[:, 1])))
    found = ObstacleMap(area).clearance_m(points @ turn.T + 0.025)
    assert len(area.footprints) <= 64  # 130 to 402 along the rows
    assert np.abs(found - clear)[clear > ROUTE_CLEARANCE_M].max() < 0.13


def test_specks_of_a_map_are_noise(tmp_path: Path):
    plain = walkable_area(resolved("map", write_map(tmp_path)), 0)
    image = cv2.imread(str(tmp_path / "map.pgm"), cv2.IMREAD_GRAYSCALE)
    image[80, 50], image[60:62, 60] = 0, 205
    cv2.imwrite(str(tmp_path / "map.pgm"), image)
    assert walkable_area(resolved("map", tmp_path / "map.yaml"), 0) == plain
    image[80:82, 50:52] = 0
    cv2.imwrite(str(tmp_path / "map.pgm"), image)
    assert walkable_area(resolved("map", tmp_path / "map.yaml"), 0) != plain


def test_a_place_that_takes_too_many_rectangles_is_refused():
    blocked = np.random.default_rng(0).random((400, 400)) < 0.004
    with pytest.raises(PftrackError, match=r"more than 600 rectangles of cells of 0\.2 m: cut a part out of it"):
        area_of(Grid(np.kron(blocked, np.ones((5, 5))) > 0, (0.0, 0.0), 0.05))
