import numpy as np
import pytest

from pftrack_sim.camera.noise import QUANTILES, Noise, quantile_table
from pftrack_sim.camera.sensor import Sensor
from pftrack_sim.core.photometry import DISPLAY_GAMMA
from pftrack_sim.scenario import model
from pftrack_sim.scenario.axes import Axes, NoiseAxis
from tests.fresh_process import printed

FLAT = (400, 500, 3)


def flat_field(value: int) -> np.ndarray:
    return np.full(FLAT, value, dtype=np.uint8)


def photon_transfer(noise: Noise, gains: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> tuple[float, float]:
    """Gain K [share of white per electron] and read noise [e-], measured as EMVA 1288 does: variance against mean.

    Frames are decoded to linear light; rounding to 8 bits adds the variance of a uniform, known step.
    """
    means, variances = [], []
    for index, value in enumerate((60, 75, 90, 105, 120, 140, 160, 180)):
        read = noise.read(flat_field(value), index, gains).astype(np.float64)
        assert ((read == 0) | (read == 255)).mean() < 1e-4  # clipping would make the variance low
        light = (read / 255.0) ** DISPLAY_GAMMA
        step = DISPLAY_GAMMA / 255.0 * (read / 255.0) ** (DISPLAY_GAMMA - 1.0)
        means.append(light.mean())
        variances.append(light.var() - (step**2).mean() / 12.0)
        assert light.mean() == pytest.approx((value / 255.0) ** DISPLAY_GAMMA, rel=5e-3)
    # Least squares with each level weighted by how well its variance is known.
    slope, intercept = np.polyfit(means, variances, 1, w=1.0 / np.array(variances))
    return slope, np.sqrt(intercept) / slope


@pytest.mark.parametrize(
    ("full_well_e", "read_e", "gain", "severity"),
    [(10000.0, 20.0, 4.0, 1.0), (20000.0, 12.0, 4.0, 2.0), (4000.0, 25.0, 2.0, 0.5), (1500.0, 15.0, 1.0, 1.0)],
)
def test_photon_transfer_measures_gain_and_read_noise(full_well_e: float, read_e: float, gain: float, severity: float):
    axis = NoiseAxis(severity=severity, full_well_e=full_well_e, read_noise_e=read_e, gain=gain)
    measured_gain, measured_read_e = photon_transfer(Noise(axis, 7))
    assert measured_gain == pytest.approx(severity * gain / full_well_e, rel=0.05)
    assert measured_read_e == pytest.approx(severity * read_e, rel=0.05)


def test_amplified_light_has_fewer_electrons():
    axis = NoiseAxis(severity=1.0, full_well_e=10000.0, read_noise_e=20.0, gain=1.0)
    measured_gain, measured_read_e = photon_transfer(Noise(axis, 3), gains=(4.0, 4.0, 4.0))
    assert measured_gain == pytest.approx(4.0 / 10000.0, rel=0.05)
    assert measured_read_e == pytest.approx(20.0, rel=0.05)


@pytest.mark.parametrize("read_e", [0.0, 0.7, 5.0])
@pytest.mark.parametrize("white_e", [60.0, 900.0, 3000.0, 50000.0])
def test_pixels_are_distributed_as_simulated_electrons(white_e: float, read_e: float):
    table = quantile_table(white_e, read_e)
    rng = np.random.default_rng(5)
    draws = 40_000
    for value in (0, 12, 40, 49, 55, 128, 250):
        electrons = rng.poisson(white_e * (value / 255.0) ** DISPLAY_GAMMA, draws) + rng.normal(0.0, read_e, draws)
        expected = np.round(255.0 * np.clip(electrons / white_e, 0.0, 1.0) ** (1.0 / DISPLAY_GAMMA)).astype(int)
        steps = np.arange(256)
        ours = np.searchsorted(np.sort(table[value]), steps, side="right") / QUANTILES
        theirs = np.searchsorted(np.sort(expected), steps, side="right") / draws
        assert abs(ours - theirs).max() < 0.012, value  # Kolmogorov-Smirnov: p = 1e-5 at this many draws


def test_a_dark_pixel_without_read_noise_is_never_white():
    # One electron in sixty is the largest likely output.
    assert quantile_table(60.0, 0.0)[:6].max() == quantile_table(60.0, 0.0)[6].max() < 60


def test_pixels_channels_frames_and_seeds_are_independent():
    axis = NoiseAxis(severity=1.0)
    noise = Noise(axis, 1)
    frames = [
        noise.read(flat_field(120), 0),
        noise.read(flat_field(120), 1),
        Noise(axis, 2).read(flat_field(120), 0),
    ]
    columns = np.stack([frame[..., channel].ravel() for frame in frames for channel in range(3)]).astype(np.float64)
    columns = np.concatenate([columns, np.roll(columns[:1], 1, axis=1), np.roll(columns[:1], FLAT[1], axis=1)])
    correlation = np.corrcoef(columns)
    assert abs(correlation - np.eye(len(columns))).max() < 5.0 / np.sqrt(columns.shape[1])


def test_signal_to_noise_ratio_falls_with_the_light():
    noise = Noise(NoiseAxis(severity=1.0), 0)
    to_noise = []
    for value in (200, 100, 50, 25):
        light = (noise.read(flat_field(value), 0) / 255.0) ** DISPLAY_GAMMA
        to_noise.append(light.mean() / light.std())
    assert (np.diff(to_noise) < 0.0).all()
    assert to_noise[0] > 4.0 * to_noise[-1]


def test_severity_scales_noise_and_zero_is_the_image_itself():
    deviations = []
    for severity in (0.25, 1.0, 2.0):
        read = Noise(NoiseAxis(severity=severity, read_noise_e=0.0), 0).read(flat_field(128), 0)
        deviations.append(read.std())
    assert deviations[1] / deviations[0] == pytest.approx(2.0, rel=0.1)  # the root of the photons
    assert deviations[2] / deviations[1] == pytest.approx(np.sqrt(2.0), rel=0.05)
    image = flat_field(128)
    axes = Axes(noise=NoiseAxis(severity=0.0, gain=9.0))
    sensor = Sensor(model.Sensor(psf_sigma_px=0.0, level=0.0), axes, 0)
    assert sensor.read(sensor.expose(image, 0.0), 0) is image


def test_the_argument_is_not_changed():
    image = flat_field(90)
    image.setflags(write=False)
    read = Noise(NoiseAxis(severity=1.0), 0).read(image, 4)
    assert (image == 90).all()
    assert read.flags.writeable
    assert not np.shares_memory(read, image)


@pytest.mark.slow
def test_same_bits_in_another_process():
    script = (
        "import hashlib, numpy as np\n"
        "from pftrack_sim.camera.noise import Noise\n"
        "from pftrack_sim.scenario.axes import NoiseAxis\n"
        "image = np.arange(60 * 80 * 3, dtype=np.int64).reshape(60, 80, 3).astype(np.uint8)\n"
        "print(hashlib.sha256(Noise(NoiseAxis(severity=1.0), 9).read(image, 3).tobytes()).hexdigest())\n"
    )
    assert printed(script, PYTHONHASHSEED="0") == printed(script, PYTHONHASHSEED="77")
