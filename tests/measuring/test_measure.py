"""What is measured in a video, and what is left out."""

import math
import tomllib
from pathlib import Path

import cv2
import numpy as np
import pytest

from pftrack_sim import scenario
from pftrack_sim.benchmark.running.sinks import video_writer
from pftrack_sim.camera.pinhole import intrinsics
from pftrack_sim.camera.trajectory import exp_so3
from pftrack_sim.core.errors import ParameterError, SequenceError
from pftrack_sim.measuring.material import camera_of, read_material
from pftrack_sim.measuring.measured import Measured, Quantity, as_toml, read_levels
from pftrack_sim.measuring.stream import jpeg_quality
from pftrack_sim.measuring.video import measure_video
from pftrack_sim.scenario.axes import Axes

WIDTH, HEIGHT, RATE_HZ = 160, 120, 25.0
K = intrinsics(WIDTH, HEIGHT, math.radians(50.0))


def texture(seed: int = 0, side: int = 400) -> np.ndarray:
    noise = np.random.default_rng(seed).uniform(0.0, 255.0, (side // 8, side // 8, 3)).astype(np.uint8)
    return cv2.GaussianBlur(cv2.resize(noise, (side, side), interpolation=cv2.INTER_NEAREST), (0, 0), 1.0)


def turned(image: np.ndarray, rotation_rad: np.ndarray) -> np.ndarray:
    """The view of a camera turned by a rotation vector, of a picture far away."""
    side = image.shape[0]
    centre = np.array([[1.0, 0.0, 0.5 * (side - WIDTH)], [0.0, 1.0, 0.5 * (side - HEIGHT)], [0.0, 0.0, 1.0]])
    to_picture = centre @ K @ exp_so3(rotation_rad) @ np.linalg.inv(K)
    return cv2.warpPerspective(image, to_picture, (WIDTH, HEIGHT), flags=cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP)


def shake(
    frames: int, rms_deg: float, low: float = 2.0, high: float = 8.0, seed: int = 0, rate_hz: float = RATE_HZ
) -> np.ndarray:
    """`(N, 3)` angles [rad]: sums of 40 cosines."""
    rng = np.random.default_rng(seed)
    hz, phase = rng.uniform(low, high, (3, 40)), rng.uniform(0.0, 2.0 * np.pi, (3, 40))
    time_s = np.arange(frames)[:, None, None] / rate_hz
    angles = np.cos(2.0 * np.pi * hz * time_s + phase).sum(axis=-1)
    return np.radians(rms_deg) * angles / np.sqrt((angles**2).mean(axis=0))


def write_images(folder: Path, images: list[np.ndarray]) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for index, image in enumerate(images, start=1):
        cv2.imwrite(str(folder / f"{index:04}.png"), image[:, :, ::-1])
    return folder


def shaken(frames: int = 150, rms_deg: float = 0.5, **more: float) -> list[np.ndarray]:
    picture = texture()
    return [turned(picture, one) for one in shake(frames, rms_deg, **more)]


def measured(folder: Path, images: list[np.ndarray], fovy_deg: float | None = 50.0) -> Measured:
    return measure_video(read_material(write_images(folder / "frames", images), RATE_HZ), fovy_deg)


def value_of(found: Measured, name: str) -> Quantity:
    return next(one for one in found.quantities if one.name == name)


def axes_of(found: Measured) -> Axes:
    """The axes of a scenario that takes what was measured."""
    return scenario.load({"extends": "corridor", "axes": tomllib.loads(as_toml(found))["axes"]}).resolve(0).axes


def with_walker(images: list[np.ndarray]) -> list[np.ndarray]:
    """The same with somebody textured who fills a third of the image and walks."""
    clothes = texture(5)[:90, :60]
    result = [image.copy() for image in images]
    for index, image in enumerate(result):
        left = (3 * index) % (WIDTH - 60)
        image[25:115, left : left + 60] = clothes
    return result


@pytest.mark.parametrize("people", [False, True])
def test_the_rms_of_a_shake_is_told_although_somebody_walks(tmp_path: Path, people: bool):
    images = shaken()
    found = measured(tmp_path, with_walker(images) if people else images)
    for name in ("jitter", "pitch above 1 Hz", "yaw above 1 Hz", "roll above 1 Hz"):
        one = value_of(found, name)
        assert abs(one.value - 0.5) < 0.08
        assert one.low < 0.5 < one.high
    assert not found.doubts


def test_slow_turns_are_taken_for_intended(tmp_path: Path):
    slow = np.zeros((150, 3))
    slow[:, 1] = np.radians(8.0) * np.sin(2.0 * np.pi * 0.3 * np.arange(150) / RATE_HZ)
    picture = texture()
    assert value_of(measured(tmp_path, [turned(picture, one) for one in slow]), "yaw above 1 Hz").value < 0.2


@pytest.mark.slow
def test_a_scenario_that_extends_the_file_has_the_measured_shake(tmp_path: Path):
    found = measured(tmp_path, shaken())
    file = tmp_path / "mine.toml"
    file.write_text(as_toml(found))
    axis = scenario.load({"extends": ["corridor", str(file)]}).resolve(0).axes.jitter
    assert axis.physical == pytest.approx(value_of(found, "jitter").value, rel=1e-3)
    low, high = axis.ground_band_hz
    assert 1.2 < low < 3.0
    assert 7.0 < high < 9.5
    assert read_levels(file)["jitter"].level == pytest.approx(axis.physical)


@pytest.mark.slow
def test_an_unknown_field_of_view_widens_the_interval_and_is_said(tmp_path: Path):
    material = read_material(write_images(tmp_path / "frames", shaken()), RATE_HZ)
    known, unknown = (measure_video(material, fovy_deg=fovy) for fovy in (50.0, None))
    assert any("field of view" in doubt for doubt in unknown.doubts)
    narrow, wide = (value_of(one, "jitter") for one in (known, unknown))
    assert wide.high - wide.low > 1.3 * (narrow.high - narrow.low)
    assert value_of(known, "roll above 1 Hz") == value_of(unknown, "roll above 1 Hz")


@pytest.mark.slow
def test_times_of_a_video_tell_lost_frames_and_its_shake(tmp_path: Path):
    kept = [index for index in range(200) if index % 20 not in (7, 8)]
    images = shaken(200)
    with video_writer(tmp_path / "look.mp4", RATE_HZ, 18) as add:
        for index in kept:
            add(images[index], index / RATE_HZ)
    found = measure_video(read_material(tmp_path / "look.mp4"), fovy_deg=50.0)
    lost = value_of(found, "lost frames")
    assert lost.value == pytest.approx(0.1, abs=0.002)
    assert lost.low < 0.1 < lost.high
    assert lost.settings["axes.stream.burst_frames"] == 2.0
    jitter = value_of(found, "jitter")
    assert jitter.low < 0.5 < jitter.high


def test_uneven_times_and_repeated_frames_are_doubted(tmp_path: Path):
    images = shaken(150)
    with video_writer(tmp_path / "look.mp4", RATE_HZ, 18) as add:
        for index, image in enumerate(images):
            add(images[index - 1] if index % 10 == 5 else image, (index + 0.3 * math.sin(index)) / RATE_HZ)
    doubts = " ".join(measure_video(read_material(tmp_path / "look.mp4"), fovy_deg=50.0).doubts)
    assert "uneven times" in doubts


def dimmed(image: np.ndarray, stops: float) -> np.ndarray:
    return np.rint(image * 2.0 ** (-stops / 2.2)).astype(np.uint8)


@pytest.mark.slow
@pytest.mark.parametrize("stops", [0.0, 0.6, 1.5])
def test_a_change_of_the_light_is_told_from_motion_and_from_none(tmp_path: Path, stops: float):
    images = [dimmed(one, stops if index >= 75 else 0.0) for index, one in enumerate(shaken())]
    found = measured(tmp_path, images)
    jitter = value_of(found, "jitter")
    assert jitter.low < 0.5 < jitter.high
    if not stops:
        assert "no change of" in found.left_out["light"]
        return
    light = value_of(found, "change of light")
    assert light.low <= stops <= light.high
    axis = axes_of(found).light
    assert axis.dim_ev == pytest.approx(light.value, rel=1e-3)
    assert axis.at_s == pytest.approx(3.0, abs=0.2)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("depth", "hz", "said"), [(0.0, 5.0, ""), (0.1, 5.0, "lamps of 120 Hz"), (0.3, 3.1, "21.9 or")]
)
def test_flicker_is_told_beside_a_change(tmp_path: Path, depth: float, hz: float, said: str):
    images = [
        dimmed(one, 0.5 + 1.0 * (index >= 75) - math.log2(1.0 + depth * math.sin(2.0 * math.pi * hz * index / RATE_HZ)))
        for index, one in enumerate(shaken())
    ]
    found = measured(tmp_path, images)
    names = [one.name for one in found.quantities]
    assert "change of light" in names
    assert ("flicker" in names) == bool(depth)
    axis = axes_of(found).light
    assert axis.parts == (("change", "flicker") if depth else ("change",))
    if depth:
        one = value_of(found, "flicker")
        assert one.low <= depth <= one.high
        assert axis.flicker_depth == pytest.approx(one.value, rel=1e-3)
        assert axis.flicker_hz == pytest.approx(hz, abs=0.05)
        assert said in " ".join(found.doubts)


@pytest.mark.slow
@pytest.mark.parametrize(("rms_deg", "readout_ms"), [(0.5, 20.0), (0.5, 0.0), (0.0, 20.0)])
def test_the_readout_of_a_rolling_shutter_is_told_where_the_camera_shakes(
    tmp_path: Path, rms_deg: float, readout_ms: float
):
    picture, often, bands = texture(), 40, 20
    angles = shake(130 * often, rms_deg, high=6.0, rate_hz=often * RATE_HZ)
    images = []
    for index in range(1, 130):
        image = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
        for band in range(bands):
            before = readout_ms * 1e-3 * (1.0 - (band + 0.5) / bands) * often * RATE_HZ
            rows = slice(band * HEIGHT // bands, (band + 1) * HEIGHT // bands)
            image[rows] = turned(picture, angles[index * often - round(before)])[rows]
        images.append(image)
    found = measured(tmp_path, images)
    if rms_deg < 0.1:
        assert "shakes too little" in found.left_out["rolling_shutter"]
    elif not readout_ms:
        assert "all rows are exposed at once" in found.left_out["rolling_shutter"]
    else:
        one = value_of(found, "readout")
        assert abs(one.value - readout_ms) < 2.0
        assert one.low < readout_ms < one.high
        axes = axes_of(found)
        assert axes.rolling_shutter.physical == pytest.approx(one.value, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rms_deg", "exposure_ms", "said"),
    [(1.0, 16.0, ""), (1.0, 30.0, ""), (1.0, 0.0, "not smeared"), (0.05, 24.0, "shakes too little")],
)
def test_the_exposure_is_told_where_the_camera_shakes(tmp_path: Path, rms_deg: float, exposure_ms: float, said: str):
    picture, often, passes = texture(), 40, 12
    angles = shake(110 * often, rms_deg, high=6.0, rate_hz=often * RATE_HZ)
    images = []
    for index in range(1, 110):
        before = np.linspace(0.0, exposure_ms * 1e-3 * often * RATE_HZ, passes if exposure_ms else 1)
        views = [turned(picture, angles[index * often - round(one)]).astype(float) for one in before]
        images.append(np.mean(views, axis=0).astype(np.uint8))
    found = measured(tmp_path, images)
    if said:
        assert said in found.left_out["blur"]
        return
    one = value_of(found, "exposure")
    assert one.value == pytest.approx(exposure_ms, rel=0.25)
    assert one.low < exposure_ms < one.high
    axes = axes_of(found)
    assert axes.blur.physical == pytest.approx(one.value, rel=1e-3)


@pytest.mark.slow
def test_nothing_is_measured_across_a_cut(tmp_path: Path):
    first, second = shaken(110), [turned(texture(3), one) for one in shake(110, 0.5, seed=2)]
    found = measured(tmp_path, first + second)
    assert any("1 cut in it (at 4.40 s)" in doubt for doubt in found.doubts)
    jitter = value_of(found, "jitter")
    assert jitter.low < 0.5 < jitter.high
    short = measured(tmp_path / "short", first[:60] + second[:60], None)
    assert "needs 4 s without a cut" in short.left_out["jitter"]


def test_without_texture_there_is_no_number(tmp_path: Path):
    flat = [np.full((HEIGHT, WIDTH, 3), 120, np.uint8)] * 120
    found = measured(tmp_path, flat, None)
    assert "too little texture" in found.left_out["jitter"]
    assert "jitter" not in {one.name for one in found.quantities}


def test_where_only_people_move_there_is_no_number(tmp_path: Path):
    wall = [np.full((HEIGHT, WIDTH, 3), 120, np.uint8) for _ in range(120)]
    for index, image in enumerate(wall):
        left = round(50 + 40 * math.sin(index / 4.0))
        image[30:110, left : left + 30] = texture(5)[:80, :30]
    found = measured(tmp_path, wall, None)
    assert "jitter" in found.left_out


def test_too_few_frames_and_unreadable_files_are_errors(tmp_path: Path):
    with pytest.raises(SequenceError, match="has 2 frames; nothing can be told"):
        read_material(write_images(tmp_path / "frames", shaken(2)))
    (tmp_path / "no.mp4").write_text("no video")
    with pytest.raises(SequenceError, match="cannot be read as a video"):
        read_material(tmp_path / "no.mp4")
    with pytest.raises(SequenceError, match="cannot be read"):
        read_material(tmp_path / "missing.mp4")


ROS = """image_width: 160
image_height: 120
camera_matrix:
  rows: 3
  cols: 3
  data: [150.5, 0., 80., 0., 151.5, 60., 0., 0., 1.]
distortion_coefficients: {rows: 1, cols: 5, data: [-0.3, 0.1, 0.0, 0.0, 0.0]}
"""


def test_calibrations_of_ros_and_opencv_are_read(tmp_path: Path):
    file = tmp_path / "camera.yaml"
    file.write_text(ROS)
    camera, shares = camera_of((160, 120), None, file)
    assert shares == (1.0, 1.0)
    assert camera.K[0, 0] == 150.5
    assert camera.distortion[0] == -0.3
    storage = cv2.FileStorage(str(file), cv2.FILE_STORAGE_WRITE)
    storage.write("camera_matrix", K)
    storage.write("distortion_coefficients", np.zeros(5))
    storage.release()
    assert np.abs(camera_of((160, 120), None, file)[0].K - K).max() < 1e-9


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a: [1,,\n b", "cannot be read"),
        ("image_width: 3", "needs camera_matrix"),
        (ROS.replace("160", "640"), "640x120"),
    ],
)
def test_a_wrong_calibration_is_said(tmp_path: Path, text: str, said: str):
    file = tmp_path / "camera.yaml"
    file.write_text(text)
    with pytest.raises(ParameterError, match=said):
        camera_of((160, 120), None, file)


@pytest.mark.parametrize("quality", [30, 75, 92])
def test_the_quality_of_a_jpeg_is_in_its_table(quality: int):
    done, coded = cv2.imencode(".jpg", texture()[:64, :64], [cv2.IMWRITE_JPEG_QUALITY, quality])
    assert done
    assert jpeg_quality(coded.tobytes()) == quality
    assert jpeg_quality(b"\x89PNG") is None


def test_files_without_levels_are_refused(tmp_path: Path):
    file = tmp_path / "x.toml"
    for text, said in (
        ("a = 1\n", "has no table"),
        ("[measured.jiter]\nlevel = 1.0\nlow = 0.5\nhigh = 2.0\nunit = 'deg'\n", "must be one of"),
        ("[measured.jitter]\nlevel = 1.0\nlow = 0.5\nhigh = 2.0\nunit = 'rad'\n", "must be in deg RMS"),
        ("[measured.jitter]\nlevel = 1.0\n", "measured.jitter.low"),
    ):
        file.write_text(text)
        with pytest.raises(ParameterError, match=said):
            read_levels(file)


@pytest.mark.slow
def test_a_rate_that_is_not_told_is_no_measurement(tmp_path: Path):
    folder = write_images(tmp_path / "frames", shaken())
    found = measure_video(read_material(folder), fovy_deg=50.0)
    assert "frames per second" not in [one.name for one in found.quantities]
    assert "rate_hz" not in as_toml(found)
    assert any("--rate-hz" in doubt for doubt in found.doubts)
    told = measure_video(read_material(folder, RATE_HZ), fovy_deg=50.0)
    assert value_of(told, "frames per second").value == pytest.approx(RATE_HZ)
