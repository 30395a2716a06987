"""Truth against brute force, and against MuJoCo's own segmentation."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, get_args

import cv2
import mujoco
import numpy as np
import pytest
from observing import box_of, finer_ids, mujocos_renderer, observed
from render_stage import FOVY, HEIGHT, NEAR, WIDTH, K, Stage, build, looking, new_spec, random_view
from room_files import WRITERS, scenario_of, write_toy

from pftrack_sim import scenario
from pftrack_sim.camera.distortion import Lens
from pftrack_sim.core import boxes
from pftrack_sim.core.records import Truth
from pftrack_sim.render.capture.frame_capture import CapturedFrame
from pftrack_sim.render.culling import PixelRect, View
from pftrack_sim.render.segmentation import Segmenter
from pftrack_sim.render.triangles import Detail
from pftrack_sim.scenario.mobility import USUAL_SPEED_M_S, Mobility
from pftrack_sim.scene.layout import PEOPLE_GROUP, body_owners
from pftrack_sim.simulation.simulation import Simulation
from pftrack_sim.truth.observer import TruthObserver


def brute_force(stage: Stage, pose: np.ndarray) -> dict[str, dict[str, Any]]:
    """Truth from two full segmentations per person: of everything, and of the person alone."""
    segmenter, image = Segmenter(stage.model), PixelRect(0, 0, WIDTH, HEIGHT)
    view = View(stage.data.geom_xpos, stage.data.geom_xmat, pose, K, NEAR)
    everything = segmenter.segment(view, image).ids
    owners = [stage.owner(geom) for geom in range(stage.model.ngeom)]
    found: dict[str, dict[str, Any]] = {}
    for name in stage.people:
        own = np.array([owner == name for owner in owners])
        amodal = segmenter.segment(view, image, np.flatnonzero(own & segmenter.drawn)).ids >= 0
        visible = np.append(own, False)[everything]
        covering = Counter(owners[geom] for geom in everything[amodal & ~visible])
        found[name] = {
            "amodal": int(amodal.sum()),
            "fraction": visible.sum() / amodal.sum() if amodal.any() else 0.0,
            "visible": visible,
            "occluders": [owner for owner, _ in sorted(covering.items(), key=lambda item: (-item[1], item[0]))],
        }
    return found


def single(kind: mujoco.mjtGeom, size: list[float], mesh: np.ndarray | None = None) -> Stage:
    """One person that is one finely tessellated geom."""
    spec = new_spec(slices=96)
    body = spec.worldbody.add_body(name="target/pelvis", mocap=True)
    spec.worldbody.add_camera(name="eye", fovy=float(np.rad2deg(FOVY)))
    if mesh is not None:
        spec.add_mesh(name="own", uservert=mesh.ravel())
        body.add_geom(type=kind, meshname="own", group=PEOPLE_GROUP)
    else:
        body.add_geom(type=kind, size=size, group=PEOPLE_GROUP)
    model = spec.compile()
    return Stage(model, mujoco.MjData(model), ("target",), {"target/pelvis": np.zeros(3)})


def turn(data: mujoco.MjData, rng: np.random.Generator) -> None:
    quaternion = rng.normal(size=4)
    data.mocap_quat[0] = quaternion / np.linalg.norm(quaternion)


SOLIDS = {
    "sphere": (mujoco.mjtGeom.mjGEOM_SPHERE, [0.3, 0, 0]),
    "capsule": (mujoco.mjtGeom.mjGEOM_CAPSULE, [0.15, 0.5, 0]),
    "ellipsoid": (mujoco.mjtGeom.mjGEOM_ELLIPSOID, [0.15, 0.3, 0.6]),
    "cylinder": (mujoco.mjtGeom.mjGEOM_CYLINDER, [0.2, 0.5, 0]),
    "box": (mujoco.mjtGeom.mjGEOM_BOX, [0.15, 0.3, 0.6]),
    "mesh": (mujoco.mjtGeom.mjGEOM_MESH, []),
}


@pytest.mark.parametrize("solid", SOLIDS)
def test_amodal_boxes_are_the_extents_of_rendered_pixels(solid: str):
    kind, size = SOLIDS[solid]
    rng = np.random.default_rng(sum(map(ord, solid)))
    # Blunt: a tip thinner than a pixel reaches farther than any pixel that shows it.
    directions = rng.normal(size=(300, 3))
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    vertices = unit * (0.25, 0.3, 0.5) if solid == "mesh" else None
    stage = single(kind, size, vertices)
    observer = TruthObserver(stage.model, stage.people, K, (WIDTH, HEIGHT))
    compared = 0
    with mujocos_renderer(stage.model) as renderer:
        for _ in range(300):
            depth = float(np.exp(rng.uniform(np.log(1.6), np.log(40.0))))
            at = np.array([depth, *rng.uniform(-0.6, 0.6, 2) * (depth - 0.6) * 0.6])
            stage.data.mocap_pos[0] = at
            turn(stage.data, rng)
            mujoco.mj_forward(stage.model, stage.data)
            pose = looking((0.0, 0.0, 0.0), (1.0, *rng.normal(size=2) * 0.05), rng.normal() * 0.2)
            (truth,) = observer.observe(stage.data, pose, None, 0.0, stage.roots())
            seen = box_of(renderer.ids(stage.data, pose) >= 0)
            if np.isnan(seen).any():
                assert truth.state == "out_of_view"
                continue
            assert np.array_equal(truth.box, boxes.clip(truth.amodal_box, WIDTH, HEIGHT))
            short = np.concatenate([seen[:2] - truth.box[:2], (truth.box - seen)[:2] + (truth.box - seen)[2:]])
            # Never past the box; and up to it, unless the edge of the image cuts off what reaches farthest.
            assert short.min() >= -1.0
            if truth.truncation == 0.0:
                compared += 1
                assert short.max() <= 1.0
    assert compared >= 200


@pytest.mark.parametrize("seed", range(30))
def test_truth_agrees_with_brute_force(seed: int):
    rng = np.random.default_rng(100 + seed)
    stage = build(seed, people=int(rng.integers(1, 6)), pillars=int(rng.integers(0, 6)), ground=seed % 3 > 0)
    for _ in range(3):
        pose = random_view(rng)
        truths, expected = observed(stage, pose), brute_force(stage, pose)
        assert set(truths) == {name for name in stage.people if expected[name]["amodal"]} | {"target"}
        for name, truth in truths.items():
            wanted = expected[name]
            # Not only within 0.01: both are drawn by the same numbers.
            assert truth.visible_fraction == wanted["fraction"]
            assert np.array_equal(truth.visible_box, box_of(wanted["visible"]), equal_nan=True)
            assert list(truth.occluders) == wanted["occluders"]
            state = "visible" if wanted["fraction"] else "occluded" if wanted["amodal"] else "out_of_view"
            assert truth.state == state
            assert truth.scored == (state == "visible")


SIZE = {"camera.width_px": WIDTH, "camera.height_px": HEIGHT, "lights.shadows": False}
INSTANT = SIZE | {f"axes.{name}.severity": 0.0 for name in ("blur", "rolling_shutter", "distortion", "jitter")}
LEA = {"name": "lea", "path_m": [[5.0, -2.4], [9.0, -1.4], [13.0, 1.6]], "clothes": {"top": "#a03020"}}
SEVERAL = {"extends": "plaza-walk", "targets": [LEA, {"name": "distractor-1"}], "distractors": {"count": 8}}
BESIDE = {
    "robot.route": {"kind": "beside", "distance_m": 2.8, "side": "left"},
    "target.actions": [],
    "target.path_m": [[3.0, 0.0], [13.0, 0.0]],
}
USING: dict[Mobility, float] = {"wheelchair": 1.4, "bicycle": 4.6, "scooter": 4.7, "pram": 4.9, "crutches": 5.2}
PARTLY_HIDDEN = [
    ("warehouse", {}, "target", 9.8),
    ("station", {}, "target", 4.3),
    ("real/market", {}, "target", 5.3),
    ("hard/plaza", {}, "target", 13.0),
    ("objects/ball", {}, "target", 7.1),
    ("objects/car", {}, "target", 13.5),
    ("objects/kicked-ball", {}, "target", 6.7),
    ("warehouse", {"target.height_m": 1.1}, "target", 9.8),  # a child
    ("warehouse", {"cameras": [{"name": "left", "left_m": 0.3, "tilt_deg": 2.0}], "viewed": "left"}, "target", 9.8),
    (SEVERAL, {}, "lea", 3.7),
    (SEVERAL, {}, "distractor-1", 0.3),
    *(
        ("plaza-walk", BESIDE | {"target.uses": kind, "target.speed_m_s": USUAL_SPEED_M_S.get(kind, 1.35)}, "target",
         USING[kind])
        for kind in get_args(Mobility)
    ),
]  # fmt: skip
"""Scenario, changes, name of a person, and time from which that one is partly hidden at seed 1."""


@pytest.mark.parametrize(("name", "changes", "who", "from_s"), PARTLY_HIDDEN)
def test_the_truth_of_who_is_partly_hidden_is_that_of_an_independent_segmentation(
    name: scenario.ScenarioLike, changes: dict[str, Any], who: str, from_s: float
):
    assert_truth_is_that_of_an_independent_segmentation(scenario.load(name, INSTANT | changes), from_s, who)


def test_so_it_is_of_a_thing_from_a_file(tmp_path: Path):
    toy = {"target.thing.model": str(write_toy(tmp_path)), "target.thing.height_m": 0.3}
    assert_truth_is_that_of_an_independent_segmentation(scenario.load("objects/car", INSTANT | toy), 13.5)


@pytest.mark.parametrize("kind", WRITERS)
def test_so_it_is_in_a_room_from_a_file(tmp_path: Path, kind: str):
    loaded = scenario.load(scenario_of(kind, WRITERS[kind](tmp_path)))
    assert_truth_is_that_of_an_independent_segmentation(loaded, 2.2 if kind == "map" else 2.4)


def assert_truth_is_that_of_an_independent_segmentation(
    loaded: scenario.Scenario, from_s: float, name: str = "target"
) -> None:
    with Simulation(loaded, image=False) as simulation:
        simulation.reset(1)
        for _ in range(round(from_s * simulation.settings.camera.rate_hz)):
            simulation.world.advance()
        world, compared = simulation.world, 0
        own = np.array([one == name for one in body_owners(world.model)])[world.model.geom_bodyid]
        camera = simulation.settings.camera
        with mujocos_renderer(world.model, camera.width_px, camera.height_px) as renderer:
            detail = Detail(world.model)
            for _ in range(12):
                truth = next(one for one in simulation.advance().people if one.name == name)
                view = View(world.data.geom_xpos, world.data.geom_xmat, truth.T_world_camera, truth.K, NEAR)
                world.model.geom_dataid[:] = detail.meshes.ravel()[detail.shapes(view, np.arange(world.model.ngeom))]
                whole = renderer.ids(world.data, truth.T_world_camera, own) >= 0
                visible = np.append(own, False)[renderer.ids(world.data, truth.T_world_camera)]
                assert abs(truth.visible_fraction - visible.sum() / whole.sum()) < 0.01
                # A tip thinner than a pixel reaches farther than any pixel that shows it.
                for box, mask, most in ((truth.visible_box, visible, 1.0), (truth.box, whole, 2.0)):
                    off = box - box_of(mask)
                    assert np.abs([*off[:2], *(off[:2] + off[2:])]).max() <= most if mask.any() else np.isnan(box).all()
                compared += 0.05 < truth.visible_fraction < 0.95
                world.advance()
    assert compared >= 4


# Seconds from the start of seed 1 at which the target is partly hidden, by scenario, with stress axes and severities.
LENS = {"distortion": 1.0, "occlusion": 2.0}
ROLLING = {**LENS, "rolling_shutter": 1.0, "jitter": 1.0, "stream": 1.0}
FAST = {"rolling_shutter": 4.0, "jitter": 4.0, "distortion": 1.0, "occlusion": 2.0}
SHAKEN = {"rolling_shutter": 2.0, "jitter": 2.0, "distortion": 1.0, "stream": 1.0, "occlusion": 2.0}
FISHEYE = {"equidistant": 1.0}  # no axis, but a lens
HIDDEN_ROWS = [
    ("warehouse", 1, 9.6, LENS),
    ("warehouse", 1, 9.8, ROLLING),
    ("station", 1, 12.3, ROLLING),
    ("corridor", 5, 4.24, FAST),
    ("hall", 5, 2.3, FAST),
    ("station", 5, 4.1, {**FAST, "stream": 1.0, "blur": 1.0}),
    ("station", 11, 12.56, SHAKEN),
    ("corridor", 13, 4.24, SHAKEN),
    ("warehouse", 1, 9.6, {**FISHEYE, "occlusion": 2.0}),
    ("hall", 5, 2.3, {**FISHEYE, **FAST, "distortion": 0.0}),
]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "seed", "from_s", "severities"), HIDDEN_ROWS)
def test_pixels_of_a_partly_hidden_target_are_those_that_its_rays_meet_when_their_row_is_exposed(
    monkeypatch: pytest.MonkeyPatch, name: str, seed: int, from_s: float, severities: dict[str, float]
):
    """Slivers of it, too, that are thinner than a pixel."""
    taken: list[CapturedFrame] = []
    observe = TruthObserver.observe_captured

    def kept(self: TruthObserver, captured: CapturedFrame, *more: Any) -> Sequence[Truth]:
        taken.append(captured)
        return observe(self, captured, *more)

    monkeypatch.setattr(TruthObserver, "observe_captured", kept)
    axes = {f"axes.{axis}.severity": severity for axis, severity in severities.items() if axis != "equidistant"}
    if "equidistant" in severities:  # 120 degrees across
        lens = {"fx": 153.0, "fy": 153.0, "cx": 161.0, "cy": 117.0, "distortion": [0.01, -0.005, 0.001, 0.0]}
        axes["camera.calibrated"] = {**lens, "width_px": WIDTH, "height_px": HEIGHT}
    compared = 0
    with Simulation(scenario.load(name, INSTANT | axes), image=False) as simulation:
        simulation.reset(seed)
        for _ in range(round(from_s * simulation.settings.camera.rate_hz)):
            simulation.world.advance()
        for _ in range(2):
            simulation.advance()
        own = np.array([one == "target" for one in body_owners(simulation.world.model)])
        segmenter = Segmenter(simulation.world.model)
        own = own[simulation.world.model.geom_bodyid] & segmenter.drawn
        for _ in range(6):
            truth = simulation.advance().truth
            silhouette = simulation.silhouettes["target"]
            seen = np.zeros((HEIGHT, WIDTH), dtype=bool)
            seen[silhouette.rect.slices] = silhouette.visible
            at_centres, somewhere, everywhere, whole = pixels_by_rows(taken[-1], segmenter, own, silhouette.rect)
            assert not (seen & ~somewhere).any()
            assert not (everywhere & ~seen).any()
            assert np.array_equal(truth.visible_box, box_of(seen), equal_nan=True)
            assert abs(truth.visible_fraction - at_centres.sum() / whole.sum()) <= max(0.005, 3.0 / whole.sum())
            compared += 0.0 < truth.visible_fraction < 1.0
    assert compared >= 3


@pytest.mark.slow
@pytest.mark.parametrize(("focal_px", "off_axis_deg"), [(153.0, 50.0), (99.0, 65.0)])
def test_people_far_off_the_axis_of_an_equidistant_lens_are_those_of_an_independent_segmentation(
    focal_px: float, off_axis_deg: float
):
    """By MuJoCo's own renderer, through a pinhole that looks at each of them: of 120 degrees across, and of 185."""
    K = np.array([[focal_px, 0.0, 161.5], [0.0, focal_px, 117.5], [0.0, 0.0, 1.0]])
    lens = Lens(K, [0.01, -0.005, 0.001, 0.0], (320, 240))
    calibrated = {"fx": focal_px, "fy": focal_px, "cx": 161.0, "cy": 117.0, "distortion": lens.coefficients.tolist()}
    overrides = {
        "camera.calibrated": {**calibrated, "width_px": 320, "height_px": 240},
        "camera.width_px": 320,
        "camera.height_px": 240,
        "distractors.count": 12,
        "robot.gaze": "forward",
        "robot.route": {"kind": "still", "heading_deg": 40.0},
    }
    rows, columns = np.mgrid[:240, :320] + 0.5
    rays = lens.rays(np.dstack([columns, rows]))
    angles, on_seams = list[float](), 0
    turning = np.array([0.0, 0.0, -0.3, 0.0]) if lens.wide else None  # so that everybody comes to the edge
    with Simulation(scenario.load("plaza-walk", INSTANT | overrides), image=False) as simulation:
        simulation.reset(1)
        world = simulation.world
        owners = body_owners(world.model)
        segmenter = Segmenter(world.model)
        triangles, drawn = segmenter.triangles, segmenter.drawn & (world.model.geom_group == PEOPLE_GROUP)
        world.model.vis.global_.offwidth = world.model.vis.global_.offheight = 960
        with mujocos_renderer(world.model, 960, 960) as renderer:
            focal = 480.0 / np.tan(0.5 * np.deg2rad(world.model.cam_fovy[0]))
            detail, meshes = Detail(world.model), world.model.geom_dataid.copy()
            for _ in range(8):
                for _ in range(15):
                    frame = simulation.advance(turning)
                pose = frame.truth.T_world_camera
                view = View(world.data.geom_xpos, world.data.geom_xmat, pose, frame.truth.K, NEAR)
                shown = detail.meshes.ravel()[detail.shapes(view, np.arange(world.model.ngeom))]
                for truth in frame.people:
                    middle = truth.T_world_target[:3, 3] + (0.0, 0.0, 0.9)
                    towards = looking(tuple(pose[:3, 3]), tuple(middle))
                    seen = rays @ (towards[:3, :3].T @ pose[:3, :3]).T
                    places = np.floor(focal * seen[..., :2] / seen[..., 2:] + 480.0).astype(int)
                    inside = (seen[..., 2] > 0.0) & (places >= 0).all(axis=-1) & (places < 960).all(axis=-1)
                    if truth.state != "visible" or not 2.5 < truth.distance_m < 12.0 or truth.truncation:
                        continue
                    own = np.array([one == truth.name for one in owners])[world.model.geom_bodyid]
                    world.model.geom_dataid[:] = shown
                    ids = [renderer.ids(world.data, towards, *geoms) for geoms in ((), (own,))]
                    world.model.geom_dataid[:] = meshes
                    right, down = places.clip(0, 959).transpose(2, 0, 1)
                    visible, whole = (np.append(own, False)[one[down, right]] & inside for one in ids)
                    assert abs(truth.visible_fraction - visible.sum() / whole.sum()) < 0.01 + 2.0 / whole.sum()
                    for box, mask in ((truth.visible_box, visible), (truth.box, whole)):
                        off = box - box_of(mask)
                        # Slivers of them are thinner than a pixel.
                        assert np.abs([*off[:2], *(off[:2] + off[2:])]).max() <= (2.5 if lens.wide else 2.0)
                    off = truth.amodal_box - box_of_points(points_of(world, triangles, own & drawn, pose), K, lens)
                    assert np.abs([*off[:2], *(off[:2] + off[2:])]).max() < 0.05
                    local = pose[:3, :3].T @ (middle - pose[:3, 3])
                    angles.append(float(np.rad2deg(np.arccos(local[2] / np.linalg.norm(local)))))
                    # A body is half a metre wide: its middle is this near to where two faces of the cube meet.
                    on_seams += abs(abs(local[0]) - local[2]) < 0.25
    assert len(angles) > 20
    assert np.sort(angles)[-10] > off_axis_deg
    assert not lens.wide or (on_seams >= 2 and max(angles) > 90.0)


def points_of(world: Any, triangles: Any, geoms: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """`(N, 3)` vertices of geoms in the axes of the camera [m]."""
    starts, data = triangles.vertex_starts, world.data
    placed = [
        triangles.vertices[starts[geom] : starts[geom + 1]] @ data.geom_xmat[geom].reshape(3, 3).T
        + data.geom_xpos[geom]
        for geom in np.flatnonzero(geoms)
    ]
    return (np.concatenate(placed) - pose[:3, 3]) @ pose[:3, :3]


def box_of_points(points: np.ndarray, K: np.ndarray, lens: Lens) -> np.ndarray:
    """`(4,)` extent of points through an equidistant lens, up to where an image height is a polynomial of an angle."""
    across = np.hypot(points[:, 0], points[:, 1])
    angles = np.arctan2(across, points[:, 2])
    scales = angles * np.polynomial.polynomial.polyval(angles**2, [1.0, *lens.coefficients]) / across
    pixels = points[:, :2] * scales[:, None] * K[0, 0] + K[:2, 2]
    return np.concatenate([pixels.min(axis=0), np.ptp(pixels, axis=0)])


def pixels_by_rows(
    captured: CapturedFrame, segmenter: Segmenter, own: np.ndarray, around: PixelRect
) -> tuple[np.ndarray, ...]:
    """`(H, W)` pixels of the target, each row of its own scene, drawn 81 times finer.

    Those at whose centre it is visible, within 0.13 px of whose centre it is, and where it is at all of the 361 places
    there; and those at whose centre it would be if nothing occluded it. Meshes are those of the frame's middle.
    """
    finer, reach, lens, shutter = 81, 9, captured.capture.lens, captured.capture.shutter
    middle = captured.capture.scene_at(shutter.middle_s)
    view = View(middle.geom_xpos, middle.geom_xmat, captured.T_world_camera, lens.K, segmenter.near_m)
    shapes = [segmenter.detail.shapes(view, np.flatnonzero(geoms)) for geoms in (segmenter.drawn, own)]
    masks = np.zeros((4, *lens.size[::-1]), dtype=bool)
    columns = np.arange(max(around.left - 5, 0), min(around.left + around.width + 5, lens.size[0]))
    for row in range(max(around.top - 5, 0), min(around.top + around.height + 5, lens.size[1])):
        when_s = float(shutter.row_s(row + 0.5))
        scene = captured.capture.scene_at(when_s)
        centres = np.column_stack([columns, np.full(columns.size, row)]) + 0.5
        undistort = cv2.fisheye.undistortPoints if lens.equidistant else cv2.undistortPoints
        rays = undistort(centres[:, None], lens.K, lens.coefficients).reshape(-1, 2)
        places = np.floor(finer * (rays * lens.K[(0, 1), (0, 1)] + lens.K[:2, 2])).astype(int)
        low, high = places.min(axis=0) - reach, places.max(axis=0) + reach + 1
        rect = PixelRect(*low.tolist(), *(high - low).tolist())
        view = View(scene.geom_xpos, scene.geom_xmat, captured.trajectory.at(when_s), lens.K, segmenter.near_m)
        across, down = (places - low).T
        visible, whole = (np.append(own, False)[finer_ids(segmenter, view, rect, drawn, finer)] for drawn in shapes)
        near = [visible[down + y, across + x] for y, x in itertools.product(range(-reach, reach + 1), repeat=2)]
        masks[:, row, columns] = visible[down, across], np.any(near, axis=0), np.all(near, axis=0), whole[down, across]
    return tuple(masks)


@pytest.mark.parametrize("seed", range(10))
def test_boxes_are_nested_and_values_are_in_range(seed: int):
    rng = np.random.default_rng(200 + seed)
    stage = build(seed, people=5, slices=64)
    pose = random_view(rng)
    for name, truth in observed(stage, pose).items():
        assert 0.0 <= truth.visible_fraction <= 1.0
        assert 0.0 <= truth.truncation <= 1.0
        assert (truth.box[:2] >= 0).all()
        assert (truth.box[:2] + truth.box[2:] <= (WIDTH, HEIGHT)).all()
        pelvis = stage.data.body(f"{name}/pelvis").xpos
        assert truth.distance_m == pytest.approx(np.linalg.norm(pelvis - pose[:3, 3]))
        assert np.array_equal(truth.T_world_camera, pose)
        assert np.array_equal(truth.K, K)
        assert np.array_equal(truth.distortion, np.zeros(5))
        if truth.state == "visible":
            assert (truth.visible_box[:2] >= truth.amodal_box[:2] - 1).all()
            ends = truth.visible_box[:2] + truth.visible_box[2:]
            assert (ends <= truth.amodal_box[:2] + truth.amodal_box[2:] + 1).all()
