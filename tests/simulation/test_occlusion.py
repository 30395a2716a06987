"""Planned occlusions begin and end at the requested times."""

import math
import re
from collections.abc import Callable
from typing import Literal

import mujoco
import numpy as np
import pytest

from pftrack_sim.agents.path import Path
from pftrack_sim.agents.pedestrians.crossing import Crossing, covered_by_person
from pftrack_sim.agents.pedestrians.crowd import Crowd
from pftrack_sim.agents.pedestrians.obstacle_map import ObstacleMap
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.scenario import model, people
from pftrack_sim.scenario.axes import OcclusionAxis
from pftrack_sim.scene.layout import Footprint, WalkableArea, owner_name
from pftrack_sim.scene.occluders import CART_HALF_THICKNESS_M, Placement, add_static_occluders
from pftrack_sim.scene.scene_spec import SceneSpec
from pftrack_sim.simulation.dry_run import DryRun
from pftrack_sim.simulation.occlusion import static
from pftrack_sim.simulation.occlusion.moving import cart_height_m, plan_crossing
from pftrack_sim.simulation.occlusion.static import covered_by_box, plan_static, spans

TICK_S = 1.0 / 60.0
FRAME_S = 1.0 / 30.0
CAMERA_Z_M, HEIGHT_M = 1.25, 1.74
PATH_M = ((0.0, 0.0), (6.0, 0.5), (11.0, -1.0), (18.0, 0.0))
TARGET = people.Target(path_m=PATH_M)
HALL = WalkableArea(
    (-6.0, -9.0, 24.0, 9.0),
    (Footprint("pillar-1", (5.0, 4.0), (0.3, 0.3)), Footprint("wall-1", (12.0, -4.5), (2.0, 0.1), 0.2)),
    ((-5.0, -8.0), (-5.0, 8.0), (23.0, 8.0), (23.0, -8.0)),
)

Camera = Callable[[float, float], np.ndarray]


def camera_of(kind: str, rng: np.random.Generator) -> Camera:
    """Camera position by time and the target's arc length: still, beside the target, or behind it."""
    side, gap, phase = rng.choice((-1.0, 1.0)), rng.uniform(2.8, 4.5), rng.uniform(0.0, 6.0)
    spot = np.array([rng.uniform(2.0, 14.0), side * rng.uniform(5.5, 8.0)])
    path = Path(PATH_M)

    def camera(time_s: float, s_m: float) -> np.ndarray:
        if kind == "still":
            return spot
        if kind == "beside":
            return np.array([s_m + 0.4 * math.sin(0.4 * time_s + phase), side * gap + 0.2 * math.sin(0.5 * time_s)])
        x, y, _ = path.at(s_m - gap)
        return np.array([float(x), float(y) + 0.15 * math.sin(0.7 * time_s + phase)])

    return camera


def dry_run_of(camera: Camera, duration_s: float = 14.0) -> DryRun:
    path, times = Path(PATH_M), np.arange(round(duration_s / TICK_S)) * TICK_S
    s = np.minimum(TARGET.speed_m_s * times, path.length_m)
    x, y, _ = path.at(s)
    places = np.array([camera(t, one) for t, one in zip(times.tolist(), s.tolist(), strict=True)])
    return run_of(times, places, np.stack([x, y], axis=1))


def run_of(times_s: np.ndarray, camera_m: np.ndarray, target_m: np.ndarray) -> DryRun:
    """The run of a robot below its camera."""
    camera = np.c_[camera_m, np.full(len(times_s), CAMERA_Z_M)]
    return DryRun(times_s, camera, target_m, np.zeros(len(times_s)), camera_m, HEIGHT_M, float(times_s[-1]))


def occluder_of(kind: str, rng: np.random.Generator) -> model.Occluder:
    return model.Occluder.model_validate(
        {
            "kind": kind,
            "at_s": rng.uniform(0.5, 8.0),
            "duration_s": rng.uniform(0.25, 2.0),
            "depth": rng.uniform(0.25, 0.85),
            "share": rng.uniform(0.25, 1.0),
        }
    )


def assert_in_time(covered: np.ndarray, times_s: np.ndarray, request: model.Occluder) -> None:
    until_s = request.at_s + request.duration_s
    around = [span for span in spans(covered, times_s) if span[0] < until_s + 1.0 and span[1] > request.at_s - 1.0]
    assert len(around) == 1, around
    assert abs(around[0][0] - request.at_s) <= 2.0 * FRAME_S
    assert abs(around[0][1] - until_s) <= 2.0 * FRAME_S


def hidden_share(placement: Placement, camera: np.ndarray, target: np.ndarray) -> float:
    """Share of the target's height whose line of sight enters the box, by marching along it."""
    along = np.linspace(0.0, 1.0, 600)
    ground = camera + along[:, None] * (target - camera)
    cos, sin = np.cos(placement.yaw_rad), np.sin(placement.yaw_rad)
    local = (ground - placement.centre_m) @ np.array([(cos, -sin), (sin, cos)])
    within = (np.abs(local) <= placement.half_m).all(axis=1)
    heights = (np.arange(400) + 0.5) / 400 * HEIGHT_M
    sight = CAMERA_Z_M + along * (heights[:, None] - CAMERA_Z_M)
    return float(((sight <= placement.height_m) & within).any(axis=1).mean())


@pytest.mark.parametrize("kind", ["pillar", "wall", "boxes"])
def test_static_occluders_cover_at_the_requested_time_and_leave_the_paths_free(kind: str) -> None:
    for seed in range(56):
        rng = np.random.default_rng(seed)
        run = dry_run_of(camera_of(("still", "beside")[seed % 2], rng))
        request = occluder_of(kind, rng)
        placement = plan_static(request, run, HALL)
        frames = slice(None, None, 2)
        camera, target = run.camera_m[frames, :2], run.target_m[frames]
        covered = covered_by_box(camera, target, placement.centre_m, placement.half_m, placement.yaw_rad)
        assert_in_time(covered, run.times_s[frames], request)
        alone = ObstacleMap(WalkableArea((-99.0, -99.0, 99.0, 99.0), (placement.footprint("it"),), ()))
        assert alone.clearance_m(run.target_m).min() >= 0.45
        assert alone.clearance_m(run.robot_m).min() >= 0.5
        assert ObstacleMap(HALL).clearance_m(placement.centre_m)[0] > 0.0
        middle = np.argmin(np.abs(run.times_s - request.at_s - 0.5 * request.duration_s))
        share = hidden_share(placement, run.camera_m[middle, :2], run.target_m[middle])
        assert abs(share - (1.0 if kind == "pillar" else request.share)) <= 0.05


def test_straight_behind_the_target_a_static_occluder_is_impossible() -> None:
    times = np.arange(600) * TICK_S
    target = np.stack([1.2 * times, 0.0 * times], axis=1)
    run = run_of(times, target - (3.0, 0.0), target)
    request = model.Occluder(kind="pillar", at_s=3.0)
    with pytest.raises(ParameterError, match=r"occluders\[1\].*walker"):
        plan_static(request, run, HALL, "occluders[1]")


@pytest.mark.parametrize("once_from", [0.55, 1.0])
def test_a_place_that_covers_the_target_only_once_is_preferred(
    once_from: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At the requested depth the target is covered a second time, at others from `once_from` on it is not."""

    def fit(kind: model.Occluder, run: DryRun, rays: object, depth: float, turn_rad: float) -> Placement:
        covered_s = ((2.0, 3.0), (8.0, 8.5)) if depth < once_from else ((2.0, 3.0),)
        return Placement(kind.kind, (depth, 0.0), (0.2, 0.2), turn_rad, 2.6, depth, covered_s)

    monkeypatch.setattr(static, "_fit", fit)
    monkeypatch.setattr(static, "_objection", lambda *_: None)
    run = dry_run_of(camera_of("beside", np.random.default_rng(0)))
    asked = model.Occluder(kind="pillar", at_s=2.0, duration_s=1.0, depth=0.5)
    placed = plan_static(asked, run, HALL)
    assert (placed.depth, placed.yaw_rad) == ((0.56, 0.0) if once_from < 1.0 else (0.5, 0.0))


def test_an_occlusion_after_the_end_is_an_error() -> None:
    run = dry_run_of(camera_of("still", np.random.default_rng(0)), 5.0)
    for kind in ("wall", "walker"):
        request = occluder_of(kind, np.random.default_rng(0)).model_copy(update={"at_s": 4.5, "duration_s": 3.0})
        with pytest.raises(ParameterError, match=re.escape("end at 7.5 s")):
            (plan_crossing if kind == "walker" else plan_static)(request, run, HALL)


def test_an_error_for_an_occupied_place_suggests_a_possible_time() -> None:
    rng = np.random.default_rng(3)
    run = dry_run_of(camera_of("still", rng))
    request = model.Occluder(kind="pillar", at_s=4.0, duration_s=0.5)
    free = plan_static(request, run, HALL)
    shelf = Footprint("shelf", free.centre_m, (0.8, 4.0), free.yaw_rad)
    taken = WalkableArea(HALL.bounds_m, (shelf,), HALL.goals_m)
    with pytest.raises(ParameterError, match="something already stands there") as caught:
        plan_static(request, run, taken)
    suggestion = re.search(r"use at_s = ([\d.]+)", str(caught.value))
    assert suggestion is not None
    plan_static(request.model_copy(update={"at_s": float(suggestion[1])}), run, taken)


def walked(crowd: Crowd, camera: Camera, duration_s: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`(T,)` times, `(T, 2)` places of a robot below its camera, and `(T, P, 2)` of pedestrians."""
    times, cameras, positions = (np.arange(round(duration_s / TICK_S)) + 1) * TICK_S, [], []
    for time_s in times.tolist():
        cameras.append(camera(time_s, TARGET.speed_m_s * time_s))
        crowd.tick(TICK_S, time_s, cameras[-1], cameras[-1])
        positions.append(crowd.positions_m)
    return times, np.array(cameras), np.array(positions)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["still", "beside", "trail"])
def test_walkers_cover_at_the_requested_time_and_move_like_people(kind: str) -> None:
    fastest, hardest = [], []
    for seed in range(18):
        rng = np.random.default_rng(seed)
        camera, request = camera_of(kind, rng), occluder_of("walker", rng)
        duration_s = request.at_s + request.duration_s + 1.5
        crossing = plan_crossing(request, dry_run_of(camera, duration_s + 1.0), HALL)
        crowd = Crowd(HALL, TARGET, Path(PATH_M), people.Distractors(count=1), (crossing,), seed)
        assert crowd.names == ("target", "distractor-1", "crosser-1")
        times, cameras, places = walked(crowd, camera, duration_s)
        covered = covered_by_person(cameras, places[:, 0], places[:, 2], crossing.half_width_m)
        assert_in_time(covered[1::2], times[1::2], request)
        assert np.linalg.norm(places[:, 2] - places[:, 0], axis=-1).min() >= 0.45
        assert np.linalg.norm(places[:, 2] - places[:, 1], axis=-1).min() >= 0.45
        velocity = np.diff(places[:, 2], axis=0) / TICK_S
        fastest.append(np.linalg.norm(velocity, axis=-1).max())
        hardest.append(np.percentile(np.linalg.norm(np.diff(velocity, axis=0), axis=-1) / TICK_S, 99))
    assert max(fastest) <= 2.8
    assert np.median(fastest) <= 2.0
    assert np.median(hardest) <= 3.0


@pytest.mark.parametrize("seed", range(6))
def test_a_walker_covers_a_camera_that_has_left_the_planned_path(seed: int) -> None:
    rng = np.random.default_rng(seed)
    camera = camera_of("trail", rng)
    request = model.Occluder(kind="walker", at_s=6.0, duration_s=1.0)
    crossing = plan_crossing(request, dry_run_of(camera), HALL)
    drift = rng.uniform(-0.5, 0.5, 2)
    crowd = Crowd(HALL, TARGET, Path(PATH_M), people.Distractors(count=0), (crossing,), seed)
    off = lambda time_s, s_m: camera(time_s, s_m) + drift * min(time_s / 4.0, 1.0)  # noqa: E731
    times, cameras, places = walked(crowd, off, 8.3)
    covered = covered_by_person(cameras, places[:, 0], places[:, 1], crossing.half_width_m)
    assert_in_time(covered, times, request)


def test_crossings_do_not_change_the_draws_of_distractors() -> None:
    alone = Crowd(HALL, TARGET, Path(PATH_M), people.Distractors(count=4), (), 5)
    joined = Crowd(
        HALL, TARGET, Path(PATH_M), people.Distractors(count=4), (Crossing(3.0, 1.0, 0.6, 1, (3.0, 3.2), 2.0),), 5
    )
    assert np.array_equal(alone.positions_m, joined.positions_m[:5])


@pytest.mark.parametrize("kind", ["pillar", "wall", "boxes"])
@pytest.mark.parametrize(("half", "height", "yaw"), [((0.2, 0.15), 2.6, 0.3), ((1.4, 0.1), 0.9, -0.2)])
def test_static_occluders_fill_their_planned_box_and_block_sight_and_robot(
    kind: Literal["pillar", "wall", "boxes"], half: tuple[float, float], height: float, yaw: float
) -> None:
    name, placement = f"occluder-{kind}-1", Placement(kind, (0.3, 0.4), half, yaw, height, 0.5, ())
    spec = SceneSpec()
    ball = spec.worldbody.add_body(name="robot", pos=[0.0, -3.0, 0.5])
    ball.add_freejoint()
    ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.2, 0.0, 0.0], contype=2, conaffinity=1)
    spec.option.gravity = [0.0, 0.0, 0.0]
    add_static_occluders(spec, {name: placement})
    compiled = spec.compile()
    data = mujoco.MjData(compiled)
    mujoco.mj_forward(compiled, data)
    thing = ObstacleMap(WalkableArea((-99.0, -99.0, 99.0, 99.0), (placement.footprint(name),), ()))
    # The geoms fill the planned box, and no more than a brim beyond.
    signs = np.array(np.meshgrid(*[(-1, 1)] * 3)).reshape(3, -1)
    for geom in range(compiled.ngeom):
        if owner_name(compiled.geom(geom).name) != name:
            continue
        rotation = data.geom_xmat[geom].reshape(3, 3)
        corners = data.geom_xpos[geom] + (rotation @ (signs * compiled.geom_size[geom][:, None])).T
        assert thing.clearance_m(corners[:, :2]).max() <= 0.045
        assert corners[:, 2].min() >= -1e-6
        assert corners[:, 2].max() <= height + 1e-6
    way, exclude = np.array([[0.0, 1.0, 0.0]]), int(data.body("robot").id)
    for aside in np.linspace(-2.0, 2.0, 41):
        start = np.array([0.3 + aside, -3.0, 0.5 * height])
        many, geom = np.zeros(1), np.zeros(1, np.int32)
        hit = mujoco.mj_ray(compiled, data, start, way[0], None, 1, exclude, geom, None)
        mujoco.mj_multiRay(compiled, data, start, way[0], None, True, exclude, geom, many, None, 1, 10.0)
        blocked = thing.blocked(start[:2], (start + 7.0 * way[0])[None, :2], 0.0)[0]
        near = thing.blocked(start[:2], (start + 7.0 * way[0])[None, :2], 0.03)[0]
        assert blocked <= (hit > 0.0) <= near
        # The range finder prunes by bounding volumes: they must enclose the occluder.
        assert many[0] == pytest.approx(hit, abs=1e-9)
    data.qpos[:3] = (0.3, -2.0, 0.5)
    data.qvel[:3] = (0.0, 3.0, 0.0)
    for _ in range(600):
        mujoco.mj_step(compiled, data)
        assert data.qpos[1] < 0.4


@pytest.mark.parametrize(("x_m", "covers"), [(-1.0, False), (1.0, True), (5.0, False)])
def test_a_box_covers_only_from_between_camera_and_target(x_m: float, covers: bool) -> None:
    camera, target = np.zeros((1, 2)), np.array([[4.0, 0.0]])
    assert covered_by_box(camera, target, (x_m, 0.05), (0.2, 0.3), 0.4).tolist() == [covers]


def test_a_low_cart_hides_the_same_part_of_the_target_at_any_depth() -> None:
    times, target = np.arange(8.0), np.tile([6.0, 0.0], (8, 1))
    run = run_of(times, np.zeros((8, 2)), target)
    hidden_m: list[float] = []
    for depth in (0.35, 0.5, 0.65):
        crossing = Crossing(3.0, 1.0, depth, 1, (0.0, 3.0), 1.0)
        drop = cart_height_m(OcclusionAxis(kind="wall", share=0.5), crossing, run) - CAMERA_Z_M
        faces = (6.0 * depth - CART_HALF_THICKNESS_M, 6.0 * depth + CART_HALF_THICKNESS_M)
        hidden_m.append(max(CAMERA_Z_M + drop * 6.0 / face for face in faces))
    assert np.ptp(hidden_m) < 1e-9
    assert 0.4 < hidden_m[0] / HEIGHT_M < 0.6
