"""Errors of sensors are as large as asked, the same however often they are read, and 0 unless asked for."""

from typing import Any

import numpy as np
import pytest

from pftrack_sim import scenario
from pftrack_sim.core.proprioception import PROPRIO_INDEX, RANGE_M, RANGES
from pftrack_sim.simulation.world import World

BASE: dict[str, Any] = {"duration_s": 30, "lights.shadows": False, "occluders": [], "distractors.count": 1}
GYRO = [PROPRIO_INDEX[f"gyro_{axis}_rad_s"] for axis in "xyz"]
ACCELEROMETER = [PROPRIO_INDEX[f"accelerometer_{axis}_m_s2"] for axis in "xyz"]


def readings(seed: int = 4, frames: int = 400, **sensors: float) -> np.ndarray:
    """`(N, n)` proprioception; each frame is read twice."""
    overrides = {name if "." in name else f"robot.sensors.{name}": value for name, value in sensors.items()}
    world = World(scenario.load("corridor", BASE | overrides).resolve(seed), seed, draws=False)
    rows = []
    for _ in range(frames):
        world.advance()
        rows.append(world.proprio())
        assert np.array_equal(rows[-1], world.proprio())
    return np.array(rows, dtype=np.float64)


def test_noise_and_bias_of_the_imu_are_those_asked_for():
    exact = readings()
    noisy = readings(gyro_noise_deg_s=2.0, accelerometer_noise_m_s2=0.5)
    error = noisy - exact
    assert np.degrees(error[:, GYRO].std()) == pytest.approx(2.0, rel=0.1)
    assert error[:, ACCELEROMETER].std() == pytest.approx(0.5, rel=0.1)
    others = np.setdiff1d(np.arange(error.shape[1]), GYRO + ACCELEROMETER)
    assert not error[:, others].any()
    biases = np.array([
        readings(seed, 1, gyro_bias_deg_s=1.0, accelerometer_bias_m_s2=0.2) - readings(seed, 1) for seed in range(30)
    ])[:, 0]  # fmt: skip
    assert np.degrees(biases[:, GYRO].std()) == pytest.approx(1.0, rel=0.2)
    assert biases[:, ACCELEROMETER].std() == pytest.approx(0.2, rel=0.2)
    constant = readings(gyro_bias_deg_s=1.0) - exact
    np.testing.assert_allclose(constant[:, GYRO], np.tile(constant[0, GYRO], (len(constant), 1)), atol=1e-5)


ROWS = {"odometry": slice(0, 5), "imu": slice(5, 11), "range": RANGES}


@pytest.mark.parametrize("name", ROWS)
def test_a_slow_and_late_sensor_tells_what_it_saw_then(name: str):
    """25 frames a second: ten readings a second are every second or third frame, 80 ms are two frames."""
    other = {"camera.rate_hz": 25.0, "robot.sensors.gyro_noise_deg_s": 1.0, "robot.sensors.range_noise_m": 0.02}
    plain = readings(frames=30, **other)
    frames, rows = np.arange(1, 31), ROWS[name]
    rest = np.setdiff1d(np.arange(plain.shape[1]), np.arange(plain.shape[1])[rows])
    for rate_hz, delay_ms in ((10.0, 0.0), (0.0, 80.0), (10.0, 80.0), (200.0, 0.0)):
        timed = {f"robot.sensors.{name}_rate_hz": rate_hz, f"robot.sensors.{name}_delay_ms": delay_ms}
        late = readings(frames=30, **other, **timed)
        assert np.array_equal(late[:, rest], plain[:, rest])
        then = frames - round(delay_ms / 40.0)
        if rate_hz == 10.0:
            then = np.ceil(np.floor(then * 0.4 + 1e-6) * 2.5 - 1e-6).astype(int)
        known = then >= 1
        assert known.sum() > 25
        assert np.array_equal(late[known][:, rows], plain[then[known] - 1][:, rows])
        assert rate_hz == 200.0 or not np.array_equal(late[:, rows], plain[:, rows])


def test_ranges_scatter_and_beams_are_lost():
    exact = readings()[:, RANGES]
    hit = (exact > 0.3) & (exact < 0.9 * RANGE_M)
    assert hit.sum() > 1000
    error = (readings(range_noise_m=0.03)[:, RANGES] - exact)[hit]
    assert error.std() == pytest.approx(0.03, rel=0.1)
    share = (readings(range_noise_share=0.03)[:, RANGES] - exact)[hit] / exact[hit]
    assert share.std() == pytest.approx(0.03, rel=0.1)
    lost = readings(range_lost=0.2)[:, RANGES]
    assert (lost[hit] == RANGE_M).mean() == pytest.approx(0.2, abs=0.03)
    assert np.array_equal(lost[hit & (lost < RANGE_M)], exact[hit & (lost < RANGE_M)])
