"""Lens, exposure and readout, measured in frames and boxes."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import mujoco
import numpy as np
import pytest
from observing import box_of
from render_stage import HEIGHT, NEAR, WIDTH, K, facing, new_spec

from pftrack_sim import scenario
from pftrack_sim.camera.distortion import Lens
from pftrack_sim.camera.shake import CameraShake
from pftrack_sim.camera.shutter import Shutter
from pftrack_sim.core.records import Frame
from pftrack_sim.render.capture.frame_capture import FrameCapture
from pftrack_sim.render.culling import PixelRect, View
from pftrack_sim.render.gl.rasteriser import Rasteriser
from pftrack_sim.render.segmentation import Segmenter
from pftrack_sim.scenario.axes import DistortionAxis
from pftrack_sim.scene.layout import PEOPLE_GROUP, SCENERY_GROUP
from pftrack_sim.simulation.world import World
from pftrack_sim.truth.observer import TruthObserver

FRAME_S = 0.04
NO_LENS = (0.0, 0.0, 0.0, 0.0, 0.0)
DISTORTED = DistortionAxis(severity=1.0, k1=-0.3, k2=0.09).coefficients
WIDE = np.array([[153.0, 0.0, 161.5], [0.0, 153.0, 117.5], [0.0, 0.0, 1.0]])
CAMERAS = {
    "barrel": (K, DISTORTED, ((0.0, 0.0), (1.2, 0.5), (-1.4, -0.8), (-1.0, 0.9))),
    "185 degrees": (
        np.array([[99.0, 0.0, 161.5], [0.0, 99.0, 117.5], [0.0, 0.0, 1.0]]),
        (0.01, -0.005, 0.001, 0.0),
        ((0.3, 0.1), (4.0, 0.2), (0.1, 4.0), (-30.0, -1.5), (-5.0, 6.0)),  # two of them on seams
    ),
    "equidistant": (WIDE, (0.01, -0.005, 0.001, 0.0), ((0.3, 0.1), (3.5, 1.6), (-5.2, -1.5), (-2.0, 2.6))),
}
"""Camera matrix, coefficients, and places of a ball in view, to the left and up, 4 m ahead."""
POLES = {"pole": [4.0, 0.0, 0.0], "ball": [-9.0, 0.0, 0.0], "both": [2.5, 0.05, 0.0]}
STILL = CameraShake.band_limited(0.0, 0.0, (1.0, 12.0), np.random.default_rng(0))


class Studio:
    """A white sphere (the target) or pole in front of a black wall, uniformly lit; a frame every FRAME_S."""

    def __init__(self, kind: str, shutter: Shutter, lens: tuple[float, ...], K: np.ndarray = K) -> None:
        spec = new_spec(slices=96)
        spec.worldbody.add_light(
            pos=[0, 0, 9],
            dir=[0, 0, -1],
            type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
            castshadow=False,
            ambient=[1.0] * 3,
            diffuse=[0.0] * 3,
            specular=[0.0] * 3,
        )
        wall = spec.worldbody.add_body(name="wall")
        wall.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[0.1, 200.0, 200.0],
            pos=[100.0, 0, 0],
            rgba=[0, 0, 0, 1],
            group=SCENERY_GROUP,
        )
        pole = spec.worldbody.add_body(name="pole", pos=POLES[kind])
        pole.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.05, 0.05, 9.0], rgba=[1, 1, 1, 1], group=SCENERY_GROUP)
        ball = spec.worldbody.add_body(name="target/pelvis", mocap=True, pos=[4.0, 0.0, 0.0])
        ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.4, 0, 0], rgba=[1, 1, 1, 1], group=PEOPLE_GROUP)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.shutter = shutter
        self.capture = FrameCapture(self.model, Lens(K, lens, (WIDTH, HEIGHT)), shutter, STILL)
        self.renderer = Rasteriser(self.model, *self.capture.render_size)
        self.truth = TruthObserver(self.model, ("target",), K, (WIDTH, HEIGHT))
        self.frames = 0

    def shoot(self, ball: tuple[float, float, float], pose: np.ndarray) -> Frame:
        self.data.mocap_pos[0] = ball
        mujoco.mj_forward(self.model, self.data)
        root = np.eye(4)[None]
        time_s = self.frames * FRAME_S
        self.capture.record(self.data, time_s, pose, root)
        captured = self.capture.capture(self.renderer)
        (truth,) = self.truth.observe_captured(captured, captured.image, time_s)
        self.frames += 1
        return Frame(self.frames - 1, time_s, captured.image, truth, (truth,))


@pytest.fixture
def studio() -> Iterator:
    opened: list[Studio] = []

    def make(kind: str, *, exposure_s: float = 0.0, readout_s: float = 0.0, lens: tuple[float, ...] = NO_LENS, **more):
        opened.append(Studio(kind, Shutter(exposure_s, readout_s, HEIGHT), lens, **more))
        return opened[-1]

    yield make
    for one in opened:
        one.renderer.close()


def lit(image: np.ndarray) -> np.ndarray:
    """`(H, W)` share of white, in linear light."""
    codes = image[:, :, 1] / image.max()
    return np.where(codes <= 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4)


def sphere_extent(centre: np.ndarray, radius: float, lens: tuple[float, ...], K: np.ndarray = K) -> np.ndarray:
    """Left, top, right, bottom of a ball's outline by OpenCV; the camera at the origin, OpenCV's axes."""
    distance = np.linalg.norm(centre)
    axis = centre / distance
    side = np.cross(axis, (0.3, 0.9, 0.1))
    side /= np.linalg.norm(side)
    other = np.cross(axis, side)
    # Tangents touch the ball on a circle.
    near, across = (distance**2 - radius**2) / distance, radius * np.sqrt(1.0 - (radius / distance) ** 2)
    angle = np.linspace(0.0, 2.0 * np.pi, 4000)[:, None]
    outline = near * axis + across * (np.cos(angle) * side + np.sin(angle) * other)
    project = cv2.fisheye.projectPoints if len(lens) == 4 else cv2.projectPoints
    seen = project(outline[:, None], np.zeros(3), np.zeros(3), K, np.array(lens))[0].reshape(-1, 2)
    return np.concatenate([seen.min(axis=0), seen.max(axis=0)])


def sides(box: np.ndarray) -> np.ndarray:
    return np.concatenate([box[:2], box[:2] + box[2:]])


@pytest.mark.parametrize("camera", CAMERAS)
def test_the_box_of_a_sphere_is_that_of_its_outline_projected_by_opencv(studio, camera: str):
    K, lens, places = CAMERAS[camera]
    scene = studio("ball", lens=lens, K=K)
    for y, z in places:
        truth = scene.shoot((4.0, y, z), facing()).truth
        expected = sphere_extent(np.array([-y, -z, 4.0]), 0.4, lens, K)
        assert np.abs(sides(truth.amodal_box) - expected).max() < 1.0
        assert np.abs(sides(truth.visible_box) - expected).max() < 1.5
        assert np.array_equal(truth.distortion, np.array(lens))
        assert np.array_equal(truth.swept_box, truth.amodal_box)
        assert truth.visible_fraction == 1.0


@pytest.mark.parametrize("camera", CAMERAS)
def test_the_image_agrees_with_the_box_through_the_lens(studio, camera: str):
    K, lens, places = CAMERAS[camera]
    scene = studio("ball", lens=lens, K=K)
    for y, z in places:
        frame = scene.shoot((4.0, y, z), facing())
        seen = box_of(lit(frame.image) > 0.5)
        assert np.abs(sides(frame.truth.visible_box) - sides(seen)).max() <= 1.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("camera", "at"),
    [
        ("barrel", (0.15, 0.5, 0.1)),
        ("barrel", (0.3, 0.2, -0.35)),
        ("equidistant", (0.3, 0.2, -0.35)),
        ("equidistant", (0.2, 0.9, 0.0)),
    ],
)
def test_the_box_of_a_body_that_the_near_plane_cuts_encloses_its_pixels(
    studio, camera: str, at: tuple[float, float, float]
):
    K, lens, _ = CAMERAS[camera]
    scene = studio("both", lens=lens, K=K)
    scene.model.body("pole").pos[0] = -9.0
    frame = scene.shoot(at, facing())
    assert at[0] - 0.4 < NEAR < at[0]
    left, top, right, bottom = sides(frame.truth.box) - sides(box_of(lit(frame.image) > 0.1))
    assert max(left, top) <= 1.0
    assert min(right, bottom) >= -1.0


def test_every_corner_of_a_distorted_image_is_rendered(studio):
    scene = studio("ball", lens=DISTORTED)
    assert (scene.shoot((9.0, 40.0, 0.0), facing()).image.min(axis=2) < 40).all()  # the wall, not the sky beyond
    assert scene.renderer.width_px > WIDTH


def middles(image: np.ndarray) -> np.ndarray:
    """`(H,)` where the pole's middle is in each row [px]."""
    share = lit(image)
    return (share * (np.arange(WIDTH) + 0.5)).sum(axis=1) / share.sum(axis=1)


@pytest.mark.parametrize(("way", "height_m"), [("pan", 0.0), ("drive", 0.0), ("drive", 1.2), ("thing", 0.0)])
def test_a_pole_slants_by_speed_times_readout(studio, way: str, height_m: float):
    """As the camera pans to the left, or drives past, or the pole moves."""
    readout_s, turn, speed = 0.03, 1.2, 2.0
    scene = studio("pole", readout_s=readout_s)
    for moved_s in (-FRAME_S, 0.0):
        scene.model.body("pole").pos[1] = -speed * moved_s * (way == "thing")
        pose = facing(turn * moved_s * (way == "pan"), (0.0, speed * moved_s * (way == "drive"), height_m))
        found = middles(scene.shoot((-9.0, 0.0, 0.0), pose).image)
    # It was farther to the left before; the pole's front is at 3.95 m.
    before = readout_s * (1.0 - (np.arange(HEIGHT) + 0.5) / HEIGHT)
    ahead = np.tan(turn * before) if way == "pan" else speed * before / 3.95
    assert np.abs(found - (K[0, 2] - K[0, 0] * ahead)).max() < (0.5 if way == "pan" else 1.0)
    slant = np.polyfit(np.arange(HEIGHT), found, 1)[0] * HEIGHT
    assert abs(slant - K[0, 0] * readout_s * (turn if way == "pan" else speed / 3.95)) < 1.0


@pytest.mark.parametrize("lens", [NO_LENS, DISTORTED])
@pytest.mark.parametrize("way", ["person", "pan", "drive"])
def test_boxes_are_those_at_each_rows_mid_exposure(studio, lens, way: str):
    readout_s = 0.03
    scene = studio("ball", readout_s=readout_s, lens=lens)
    for index in (-1, 0):
        moved = FRAME_S * index
        ball = (4.0, 0.6 + 2.0 * moved * (way == "person"), 0.5)
        pose = facing(0.8 * moved * (way == "pan"), (0.0, 2.0 * moved * (way == "drive"), 0.0))
        frame = scene.shoot(ball, pose)

    def where(before: float) -> np.ndarray:
        y = 0.6 - 2.0 * before * (way == "person") + 2.0 * before * (way == "drive")
        yaw = -0.8 * before * (way == "pan")
        local = np.array([4.0, y, 0.5]) @ facing(yaw)[:3, :3]
        return sphere_extent(local, 0.4, lens)

    # Left and right of a ball are reached at its middle row, top and bottom at their own.
    expected = np.zeros(4)
    for side in range(4):
        before = 0.5 * readout_s
        for _ in range(6):
            now = where(before)
            row = now[side] if side % 2 else 0.5 * (now[1] + now[3])
            before = readout_s * (1.0 - row / HEIGHT)
        expected[side] = where(before)[side]
    assert np.abs(sides(frame.truth.amodal_box) - expected).max() < 1.0
    seen = sides(box_of(lit(frame.image) > 0.5))
    assert np.abs(sides(frame.truth.visible_box) - seen).max() <= 1.0
    assert np.abs(sides(frame.truth.amodal_box) - seen).max() < 1.5


@pytest.mark.parametrize("way", ["person", "pan"])
def test_a_moving_edge_is_as_wide_as_speed_times_exposure(studio, way: str):
    exposure_s = 0.03
    scene = studio("ball", exposure_s=exposure_s)
    for index in (-1, 0):
        moved = FRAME_S * index
        pose = facing(0.75 * moved * (way == "pan"))
        frame = scene.shoot((4.0, 3.0 * moved * (way == "person") + 0.045 * (way == "person"), 0.0), pose)
    row = lit(frame.image)[HEIGHT // 2]
    width = K[0, 0] * (0.75 if way == "pan" else 3.0 / 4.0) * exposure_s
    # The spread of a ramp's steps is its width over the root of 12.
    steps = np.diff(row[: WIDTH // 2])
    at = np.arange(steps.size)
    spread = np.sqrt((steps * at**2).sum() / steps.sum() - ((steps * at).sum() / steps.sum()) ** 2)
    assert abs(np.sqrt(12.0) * spread - width) < 1.0
    truth = frame.truth
    assert abs((truth.swept_box[2] - truth.amodal_box[2]) - width) < 1.0
    assert np.abs(sides(truth.swept_box) - sides(box_of(lit(frame.image) > 0.02))).max() < 1.5
    assert np.abs(sides(truth.amodal_box) - sides(box_of(lit(frame.image) > 0.5))).max() < 1.5


def test_a_static_scene_does_not_depend_on_the_exposure(studio):
    instant = studio("ball", readout_s=0.02).shoot((4.0, 0.4, 0.2), facing())
    second = studio("ball", exposure_s=0.03, readout_s=0.02)
    for _ in range(2):
        long = second.shoot((4.0, 0.4, 0.2), facing())
    assert np.array_equal(long.image, instant.image)
    assert np.array_equal(long.truth.visible_box, instant.truth.visible_box)
    assert np.abs(long.truth.swept_box - long.truth.amodal_box).max() < 1e-9


@pytest.mark.parametrize("lens", [NO_LENS, DISTORTED])
@pytest.mark.parametrize(("exposure_s", "height_m"), [(0.0, 0.0), (0.02, 0.0), (0.0, 1.2)])
def test_visible_pixels_are_those_at_each_rows_mid_exposure(studio, lens, exposure_s, height_m):
    scene = studio("both", exposure_s=exposure_s, readout_s=0.02, lens=lens)
    renderer, capture = scene.renderer, scene.capture
    for index in (-1, 0):
        moved = FRAME_S * index
        scene.data.mocap_pos[0] = (4.0, 0.3 + 1.5 * moved, 0.5)
        mujoco.mj_forward(scene.model, scene.data)
        pose = facing(0.9 * moved, (0.5 * moved, 0.8 * moved, height_m))
        capture.record(scene.data, scene.frames * FRAME_S, pose, np.eye(4)[None])
        captured = capture.capture(renderer)
        (truth,) = scene.truth.observe_captured(captured, captured.image, scene.frames * FRAME_S)
        scene.frames += 1
    # Row by row: the whole scene as it was just then, looked at along each pixel's ray.
    K_wide = np.array(K)
    K_wide[:2, 2] = renderer.width_px / 2, renderer.height_px / 2
    segmenter = Segmenter(scene.model)
    visible = np.zeros((HEIGHT, WIDTH), dtype=bool)
    ball = scene.model.body("target/pelvis").geomadr[0]
    for row in range(HEIGHT):
        when = float(scene.shutter.row_s(row + 0.5))
        if not truth.amodal_box[1] - 3 < row < truth.amodal_box[1] + truth.amodal_box[3] + 3:
            continue
        now = capture.scene_at(when)
        view = View(now.geom_xpos, now.geom_xmat, captured.trajectory.at(when), K_wide, NEAR)
        ids = segmenter.segment(view, PixelRect(0, 0, *capture.render_size)).ids
        pixels = np.column_stack([np.arange(WIDTH) + 0.5, np.full(WIDTH, row + 0.5)])
        at = np.floor(capture.lens.to_normalized(pixels) * K[(0, 1), (0, 1)] + K_wide[:2, 2]).astype(int)
        visible[row] = ids[at[:, 1], at[:, 0]] == ball
    assert 0.2 < truth.visible_fraction < 0.9
    assert truth.occluders == ("pole",)
    assert np.abs(sides(truth.visible_box) - sides(box_of(visible))).max() <= 1.0


@pytest.mark.parametrize("edge", [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)])
def test_an_image_of_185_degrees_has_no_seams(edge: tuple[float, float]):
    """Along an edge of the cube about the camera it is what a pinhole shows that looks at that edge."""
    lens = Lens([[198.0, 0.0, 325.0], [0.0, 199.0, 236.0], [0.0, 0.0, 1.0]], (0.01, -0.004, 0.001, 0.0), (640, 480))
    world = World(scenario.load("plaza-walk", {"lights.shadows": False}).resolve(0), 0)
    pose, capture = world.camera_pose(), FrameCapture(world.model, lens, Shutter(0.0, 0.0, 480), STILL)
    capture.record(world.data, 0.0, pose, world.root_poses())
    with Rasteriser(world.model, *capture.render_size) as faces, Rasteriser(world.model, 800, 800) as renderer:
        image = capture.capture(faces).image.astype(float)
        ahead = np.array([*edge, 1.0]) / np.sqrt(2.0)
        right = np.cross((0.0, 1.0, 0.0), ahead) if edge[0] else np.array([1.0, 0.0, 0.0])
        right /= np.linalg.norm(right)
        turn = np.eye(4)
        turn[:3, :3] = np.stack([right, np.cross(ahead, right), ahead], axis=1)
        K = np.array([[400.0, 0.0, 400.0], [0.0, 400.0, 400.0], [0.0, 0.0, 1.0]])
        single = renderer.color(world.data, pose @ turn, K)
    seen = capture.pixel_rays @ turn[:3, :3]
    places = (400.0 * seen[..., :2] / np.maximum(seen[..., 2:], 0.1) + 399.5).astype(np.float32)
    wanted = cv2.remap(single, places, None, cv2.INTER_AREA).astype(float)
    # Differences of rays from the edge, across it, of length 1: a pixel is 1 / 198.
    off = (capture.pixel_rays[..., :2] @ np.array(edge) - capture.pixel_rays[..., 2]) / np.sqrt(2.0)
    inside = (places > 5).all(axis=-1) & (places < 794).all(axis=-1)
    gaps = np.abs(image - wanted).mean(axis=-1)
    on, beside = (float(gaps[inside & near].mean()) for near in (np.abs(off) < 3 / 198, np.abs(off) > 20 / 198))
    assert (inside & (np.abs(off) < 3 / 198)).sum() > 500
    assert on < max(1.3 * beside, 2.0) < 8.0, (on, beside)
