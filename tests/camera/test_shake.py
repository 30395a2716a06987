import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pftrack_sim.camera.shake import CameraShake, camera_shake
from pftrack_sim.core.random_streams import stream
from pftrack_sim.scenario.axes import JitterAxis
from pftrack_sim.scenario.model import Jitter

SHAKE = Jitter(angular_rms_deg=0.4, translational_rms_mm=5.0, band_hz=(2.0, 9.0))
POSE = np.array([[0, 0, 1, 3.3], [-1, 0, 0, -0.2], [0, -1, 0, 1.25], [0, 0, 0, 1]], dtype=np.float64)


def vibration(jitter: Jitter = SHAKE, seed: int = 0) -> CameraShake:
    rms = jitter.angular_rms_deg, jitter.translational_rms_mm
    return CameraShake.band_limited(*rms, jitter.band_hz, np.random.default_rng(seed))


@pytest.mark.parametrize("seed", range(4))
def test_rms_of_each_axis(seed: int):
    rotation, translation = vibration(seed=seed).offset(np.arange(0.0, 400.0, 1 / 60))
    assert abs(np.sqrt((rotation**2).mean(axis=0)) / np.deg2rad(0.4) - 1.0).max() < 0.03
    assert abs(np.sqrt((translation**2).mean(axis=0)) / 0.005 - 1.0).max() < 0.03
    assert abs(rotation.mean(axis=0)).max() < 1e-4


def test_the_spectrum_is_flat_in_the_band_and_zero_outside():
    rotation, _ = vibration().offset(np.arange(0.0, 400.0, 1 / 60))
    windowed = rotation * np.hanning(len(rotation))[:, None]
    power = (np.abs(np.fft.rfft(windowed, axis=0)) ** 2).sum(axis=1)
    hertz = np.fft.rfftfreq(len(rotation), 1 / 60)
    assert power[(hertz < 1.95) | (hertz > 9.05)].sum() < 1e-3 * power.sum()
    sevenths, _ = np.histogram(hertz, bins=np.linspace(2.0, 9.0, 8), weights=power)
    assert abs(sevenths / sevenths.mean() - 1.0).max() < 0.2


def test_the_vibration_is_gaussian_with_independent_axes():
    rotation, translation = vibration(seed=2).offset(np.arange(0.0, 400.0, 1 / 60))
    axes = np.concatenate([rotation, translation], axis=1)
    axes = (axes - axes.mean(axis=0)) / axes.std(axis=0)
    assert abs((axes**4).mean(axis=0) - 3.0).max() < 0.2
    assert abs(np.corrcoef(axes.T) - np.eye(6)).max() < 0.05


def test_instants_may_be_evaluated_in_any_order():
    shake = vibration()
    times = np.array([[3.0, 0.5], [100.0, 2.0]])
    rotation, translation = shake.offset(times)
    assert rotation.shape == translation.shape == (2, 2, 3)
    assert abs(rotation[1, 0] - shake.offset(100.0)[0]).max() < 1e-15


def test_zero_rms_is_the_pose_to_the_bit():
    assert vibration(Jitter()).displace(POSE, 1.7).tobytes() == POSE.tobytes()
    assert camera_shake(Jitter(), JitterAxis(severity=0.0), 5, 1.2).displace(POSE, 1.7).tobytes() == POSE.tobytes()


@settings(max_examples=50)
@given(st.floats(0.0, 100.0), st.integers(0, 1000))
def test_the_pose_is_displaced_in_camera_axes(time_s: float, seed: int):
    shake = vibration(seed=seed)
    before = POSE.copy()
    moved = shake.displace(POSE, time_s)
    assert (before == POSE).all()
    assert abs(moved[:3, :3] @ moved[:3, :3].T - np.eye(3)).max() < 1e-12
    rotation, translation = shake.offset(time_s)
    relative = np.linalg.inv(POSE) @ moved
    assert abs(relative[:3, 3] - translation).max() < 1e-12
    angle = np.arccos(np.clip((np.trace(relative[:3, :3]) - 1.0) / 2.0, -1.0, 1.0))
    assert abs(angle - np.linalg.norm(rotation)) < 1e-7
    assert relative[2, 1] == pytest.approx(rotation[0], abs=3e-4)


@pytest.mark.parametrize("sources", [("wind",), ("ground",), ("wind", "ground"), ("road",)])
def test_the_axis_is_added_to_the_base_in_proportion_to_its_severity(sources: tuple[str, ...]):
    base = Jitter(angular_rms_deg=0.2)
    alone, once, thrice = (
        np.concatenate(camera_shake(base, JitterAxis(severity=severity, sources=sources), 3, 1.2).offset(1.3))
        for severity in (0.0, 1.0, 3.0)
    )
    assert abs((thrice - alone) - 3.0 * (once - alone)).max() < 1e-12
    assert (abs(once - alone).max() > 0.0) == (sources != ("road",))  # the road moves the robot, not the mount


def test_sources_are_independent_and_add_up():
    still = Jitter()
    wind, ground, both = (
        np.concatenate(camera_shake(still, JitterAxis(severity=1.0, sources=sources), 3, 1.2).offset(0.7))
        for sources in (("wind",), ("ground",), ("wind", "ground"))
    )
    assert abs(wind + ground - both).max() < 1e-15


def test_gusts_have_the_given_rms_and_spectrum():
    rotation, _ = CameraShake.gusts(0.5, 0.8, 1.2, np.random.default_rng(0)).offset(np.arange(0.0, 2000.0, 0.02))
    assert abs(np.sqrt((rotation**2).mean(axis=0)) / np.deg2rad(0.5) - 1.0).max() < 0.05
    power = (np.abs(np.fft.rfft(rotation, axis=0)) ** 2).sum(axis=1)
    hertz = np.fft.rfftfreq(len(rotation), 0.02)
    share = np.array([power[hertz < edge].sum() for edge in (0.4, 0.8, 1.6, 9.7)]) / power.sum()
    first_order = np.arctan(np.array([0.5, 1.0, 2.0, 12.0])) / np.arctan(12.0)
    assert abs(share - first_order).max() < 0.03


def test_gusts_rotate_the_camera_about_the_foot_of_the_mast():
    gusts = CameraShake.gusts(0.3, 0.8, 1.2, np.random.default_rng(1))
    foot = np.array([0.0, 1.2, 0.0, 1.0])
    for time_s in (0.0, 1.3, 7.7):
        relative = np.linalg.inv(POSE) @ gusts.displace(POSE, time_s)
        assert abs(relative @ foot - foot)[[0, 2]].max() < 2e-4  # the foot stays, to second order


def test_severity_zero_is_the_base_to_the_bit():
    base = CameraShake.band_limited(0.4, 5.0, (2.0, 9.0), stream(3, "jitter", "base")).displace(POSE, 0.4)
    assert camera_shake(SHAKE, JitterAxis(severity=0.0), 3, 1.2).displace(POSE, 0.4).tobytes() == base.tobytes()


def test_every_severity_that_a_scenario_takes_shakes_the_camera():
    axis = JitterAxis(severity=1.0, sources=("ground",), ground_rms_deg=30.0, ground_rms_mm=9000.0)
    rotation, translation = camera_shake(SHAKE, axis, 3, 1.2).offset(np.arange(0.0, 400.0, 1 / 60))
    assert np.degrees(np.sqrt((rotation**2).mean(axis=0))) == pytest.approx(30.0, rel=0.05)
    assert np.sqrt((translation**2).mean(axis=0)) == pytest.approx(9.0, rel=0.05)
    with pytest.raises(ValueError, match="at most 10000 mm RMS, got 18000 mm"):
        JitterAxis(severity=2.0, ground_rms_mm=9000.0)


def test_the_shake_is_determined_by_the_seed():
    axis = JitterAxis(severity=1.0)
    first, again, other = (camera_shake(SHAKE, axis, seed, 1.2).displace(POSE, 2.0) for seed in (1, 1, 2))
    assert first.tobytes() == again.tobytes()
    assert first.tobytes() != other.tobytes()


def test_invalid_sources_and_bands_raise():
    with pytest.raises(ValueError, match="low < high"):
        JitterAxis(ground_band_hz=(5.0, 2.0))
    with pytest.raises(ValueError, match="'wind', 'ground' or 'road'"):
        JitterAxis.model_validate({"sources": ["rain"]})
