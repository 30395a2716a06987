"""Videos and logs of inertial sensors at known levels, measured back.

`python tests/measuring/closed_circle.py [NAMES]` prints the tables of the page of measuring: for each kind of material
how often the interval of each level holds it. Names: jitter, light, flicker, readout,
exposure, noise, imu; all without any.
"""

from __future__ import annotations

import itertools
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from pftrack_sim import scenario
from pftrack_sim.benchmark.running.rollout import Sample, rollout, simulated
from pftrack_sim.benchmark.running.sinks import video_writer
from pftrack_sim.camera.trajectory import log_so3
from pftrack_sim.measuring.imu import measure_imu
from pftrack_sim.measuring.imu_log import read_imu
from pftrack_sim.measuring.jitter import ABOVE_HZ
from pftrack_sim.measuring.material import read_material
from pftrack_sim.measuring.measured import Measured
from pftrack_sim.measuring.spectrum import rms_above, spectrum_of_turns
from pftrack_sim.measuring.video import measure_video
from pftrack_sim.simulation.simulation import Simulation

IMU_HZ = 200.0
LEVELS_DEG = (0.05, 0.2, 0.8, 2.5)
PLACES = ("corridor", "warehouse", "plaza-walk", "park", "hall")
SMALL = {"camera.width_px": 320, "camera.height_px": 240, "camera.rate_hz": 25.0, "camera.fovy_deg": 50.0}
STILL = {"robot.route": {"kind": "still"}, "robot.gaze": "forward", "jitter.angular_rms_deg": 0.0}


def shaking(rms_deg: float, seconds: float = 8.0, **more: Any) -> dict[str, Any]:
    """Settings of an episode that shakes by ground vibration alone."""
    axis = {"sources": ["ground"], "ground_rms_deg": rms_deg, "ground_rms_mm": 0.0, "severity": 1.0}
    return {**SMALL, "axes.jitter": axis, "duration_s": seconds, **more}


def poses_of(place: str, seed: int, settings: Mapping[str, Any], add: Any = None) -> np.ndarray:
    """`(N, 4, 4)` poses of the camera in an episode, whose images are handed to `add` with their times."""
    poses: list[np.ndarray] = []

    def sink(sample: Sample) -> None:
        assert sample.frame is not None
        poses.append(sample.frame.truth.T_world_camera)
        if add is not None:
            add(sample.image, sample.time_s)

    with Simulation(scenario.load(place, dict(settings)), image=add is not None) as simulation:
        rollout(simulated(simulation, seed), [], [sink])
    return np.array(poses)


def turns_of(poses: np.ndarray) -> np.ndarray:
    """`(N - 1, 3)` rotation vectors between successive poses, in the camera's axes."""
    return log_so3(np.swapaxes(poses[:-1, :3, :3], 1, 2) @ poses[1:, :3, :3])


def true_rms_deg(poses: np.ndarray, rate_hz: float) -> float:
    """RMS of pitch and roll above 1 Hz."""
    return rms_above(spectrum_of_turns([turns_of(poses)], [turns_of(poses)], rate_hz), ABOVE_HZ)[0].value


def measured_back(
    place: str, seed: int, settings: Mapping[str, Any], *, crf: int | None, folder: Path
) -> tuple[Measured, float]:
    """Render an episode as images without loss, or as H.264 of a rate factor, and measure it; its true shake, too."""
    path = folder / ("video.mp4" if crf is not None else "images")
    rate = scenario.load(place, dict(settings)).resolve(seed).camera.rate_hz
    if crf is not None:
        with video_writer(path, rate, crf) as add:
            poses = poses_of(place, seed, settings, add)
    else:
        path.mkdir()

        def write(image: np.ndarray, time_s: float) -> None:
            cv2.imwrite(str(path / f"{round(time_s * rate) + 1:06}.png"), image[:, :, ::-1])

        poses = poses_of(place, seed, settings, write)
    found = measure_video(read_material(path, rate if crf is None else None), fovy_deg=50.0)
    return found, true_rms_deg(poses, rate)


def write_imu(path: Path, poses: np.ndarray, seed: int, *, accelerometer: bool = True) -> Path:
    """What a sensor at the camera measures at 200 Hz, in EuRoC's columns.

    Errors are those of sensors in phones: 1 % of sensitivity, a bias of 0.7 deg/s, 0.1 deg/s of noise, 16 bits for
    500 deg/s; 0.05 and 0.02 m/s^2 of the accelerometer.
    """
    rng = np.random.default_rng(seed)
    turns, rotation, place = turns_of(poses), poses[1:-1, :3, :3], poses[:, :3, 3]
    rates = np.degrees(0.5 * (turns[1:] + turns[:-1]) * IMU_HZ) * (1.0 + rng.normal(0.0, 0.01, 3))
    rates = np.rint((rates + rng.normal(0.0, 0.7, 3) + rng.normal(0.0, 0.1, rates.shape)) / 500.0 * 2**15)
    felt = (place[2:] - 2.0 * place[1:-1] + place[:-2]) * IMU_HZ**2 + np.array([0.0, 0.0, 9.81])
    felt = np.einsum("nji,nj->ni", rotation, felt) + rng.normal(0.0, 0.05, 3) + rng.normal(0.0, 0.02, rates.shape)
    heads = ["#timestamp [ns]", *(f"w_RS_S_{axis} [rad s^-1]" for axis in "xyz")]
    columns = [np.arange(len(rates)) * 1e9 / IMU_HZ + 1.7e18, *np.radians(rates * 500.0 / 2**15).T]
    if accelerometer:
        heads, columns = [*heads, *(f"a_RS_S_{axis} [m s^-2]" for axis in "xyz")], [*columns, *felt.T]
    formats = ["%.0f", *["%.9g"] * (len(heads) - 1)]
    np.savetxt(path, np.column_stack(columns), formats, ",", header=",".join(heads), comments="")
    return path


def level_of(found: Measured, name: str, wanted: float) -> tuple[float, bool | None]:
    """Measured over true, and whether the interval holds the true level; None where it was left out."""
    one = next((one for one in found.quantities if one.name == name), None)
    return (np.nan, None) if one is None else (one.value / wanted, bool(one.low <= wanted <= one.high))


KINDS: Sequence[tuple[str, Mapping[str, Any], int | None]] = (
    ("robot stands, PNG", STILL, None),
    ("robot stands, H.264 of rate factor 28", STILL, 28),
    ("robot drives, H.264 of rate factor 28", {}, 28),
)


def row(title: str, level: str, rows: Sequence[tuple[float, bool | None]]) -> None:
    """Print a row of the table."""
    told = [ratio for ratio, held in rows if held is not None]
    held = f"{sum(held is True for _, held in rows)} of {len(told)}"
    left = f", {len(rows) - len(told)} left out" if len(told) < len(rows) else ""
    print(f"| {title} | {level} | {np.mean(told) if told else np.nan:.3f} | {held}{left} |", flush=True)  # noqa: T201


def jitter() -> None:
    """Shake from videos."""
    seeds = itertools.count()  # a seed's shake is the same in all places
    for title, more, crf in KINDS:
        for level in LEVELS_DEG:
            rows: list[tuple[float, bool | None]] = []
            for place in PLACES:
                with tempfile.TemporaryDirectory() as folder:
                    settings = shaking(level, **more)
                    found, true = measured_back(place, next(seeds), settings, crf=crf, folder=Path(folder))
                rows.append(level_of(found, "jitter", level if more else true))
            row(title, f"{level} deg RMS", rows)


Case = tuple[str, str, float, Mapping[str, Any], int | None]
"""Material, level in words, true level, settings of an episode, and rate factor of its video (None: PNG)."""


def in_words(crf: int | None) -> str:
    """How the images of a rate factor are kept."""
    return "PNG" if crf is None else f"H.264 of rate factor {crf}"


def light() -> Iterator[Case]:
    """Changes of the light."""
    for ev in (0.5, 1.0, 2.0):
        axis = {"parts": ["change"], "dim_ev": ev, "auto_exposure": False, "at_s": 2.5, "severity": 1.0}
        settings = {**SMALL, **STILL, "duration_s": 5.0, "lights.schedule": [], "axes.light": axis}
        yield "robot stands, PNG", f"light falls by {ev} EV", ev, settings, None


def flicker() -> Iterator[Case]:
    """Depth of a flicker."""
    for crf, (depth, hz) in itertools.product((None, 28), ((0.03, 6.0), (0.1, 2.3), (0.1, 8.0), (0.3, 9.1))):
        axis = {"parts": ["flicker"], "flicker_depth": depth, "flicker_hz": hz, "auto_exposure": False, "severity": 1.0}
        settings = {**SMALL, "duration_s": 5.0, "lights.schedule": [], "axes.light": axis}
        yield f"robot drives, {in_words(crf)}", f"flicker of {depth} at {hz} Hz", depth, settings, crf


def readout() -> Iterator[Case]:
    """Readout of a rolling shutter."""
    for crf, rms_deg, ms in itertools.product((None, 28), (0.2, 0.8), (10.0, 30.0, 50.0)):
        settings = shaking(rms_deg, 6.0, **{"axes.rolling_shutter": {"severity": 1.0, "readout_ms": ms}})
        yield f"robot drives, {in_words(crf)}, {rms_deg} deg RMS", f"readout of {ms:g} ms", ms, settings, crf


def exposure() -> Iterator[Case]:
    """Exposure of a frame."""
    for crf, rms_deg, ms in itertools.product((None, 28), (0.3, 0.8), (10.0, 20.0, 30.0)):
        settings = shaking(rms_deg, 5.0, **{"axes.blur": {"severity": 1.0, "exposure_ms": ms}})
        yield f"robot drives, {in_words(crf)}, {rms_deg} deg RMS", f"exposure of {ms:g} ms", ms, settings, crf


def noise() -> Iterator[Case]:
    """Gain of the sensor."""
    for title, more in (("stands", STILL), ("drives", {})):
        for gain in (1.0, 2.0, 4.0, 8.0, 16.0):
            settings = {**SMALL, **more, "duration_s": 1.2, "axes.noise": {"severity": 1.0, "gain": gain}}
            yield f"robot {title}, PNG", f"gain {gain:g}", gain, settings, None


def in_places(quantity: str, first_seed: int, cases: Iterator[Case]) -> None:
    """A quantity of each case in four places, as not every seed of the hall can be planned."""
    seeds = itertools.count(first_seed)
    for title, level, wanted, settings, crf in cases:
        rows: list[tuple[float, bool | None]] = []
        for place in PLACES[:4]:
            with tempfile.TemporaryDirectory() as folder:
                found, _ = measured_back(place, next(seeds), settings, crf=crf, folder=Path(folder))
            rows.append(level_of(found, quantity, wanted))
        row(title, level, rows)


def imu() -> None:
    """Shake from logs of an inertial sensor at the camera."""
    for accelerometer, (title, more) in itertools.product((True, False), (("stands", STILL), ("drives", {}))):
        seeds = itertools.count(100)
        for level in LEVELS_DEG:
            rows: list[tuple[float, bool | None]] = []
            for place in PLACES:
                poses = poses_of(place, seed := next(seeds), shaking(level, **{**more, "camera.rate_hz": IMU_HZ}))
                with tempfile.TemporaryDirectory() as folder:
                    file = write_imu(Path(folder) / "imu.csv", poses, seed, accelerometer=accelerometer)
                    found = measure_imu(read_imu(file))
                rows.append(level_of(found, "jitter", level if more else true_rms_deg(poses, IMU_HZ)))
            row(f"robot {title}, gyroscope{' and accelerometer' * accelerometer}", f"{level} deg RMS", rows)


if __name__ == "__main__":
    print("| material | level | measured / true, mean | held |\n| --- | --- | --- | --- |")  # noqa: T201
    circles = {
        "jitter": jitter,
        "light": lambda: in_places("change of light", 60, light()),
        "flicker": lambda: in_places("flicker", 400, flicker()),
        "readout": lambda: in_places("readout", 600, readout()),
        "exposure": lambda: in_places("exposure", 740, exposure()),
        "noise": lambda: in_places("noise", 200, noise()),
        "imu": imu,
    }
    for name in sys.argv[1:] or circles:
        circles[name]()
