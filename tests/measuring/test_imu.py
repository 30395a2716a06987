"""What is told by logs of inertial sensors, and which of them are refused or doubted."""

from pathlib import Path

import numpy as np
import pytest

from pftrack_sim.core.errors import SequenceError
from pftrack_sim.core.proprioception import PROPRIO_INDEX, PROPRIO_NAMES
from pftrack_sim.core.records import Frame, Truth
from pftrack_sim.logs import LogFrame, LogInfo, log_format, log_writer
from pftrack_sim.measuring.imu import measure_imu
from pftrack_sim.measuring.imu_log import read_imu
from pftrack_sim.measuring.measured import Measured
from tests.measuring.test_measure import axes_of, shake, value_of

RATE_HZ, RMS_DEG = 100.0, 0.5
HEADS = (
    *("time_s", "gyro_x_rad_s", "gyro_y_rad_s", "gyro_z_rad_s"),
    *("accelerometer_x_m_s2", "accelerometer_y_m_s2", "accelerometer_z_m_s2"),
)


def samples(seconds: float = 16.0) -> np.ndarray:
    """`(N, 7)` times, turn rates about x (ahead), y and z (up), and accelerations of a sensor that shakes."""
    angles = shake(round(seconds * RATE_HZ), RMS_DEG, low=1.5, high=6.0, rate_hz=RATE_HZ)
    angles[:, 2] *= 3.0
    rng = np.random.default_rng(0)
    rates = RATE_HZ * np.gradient(angles, axis=0) + np.radians([0.7, -0.4, 0.2])
    felt = 9.81 * (np.array([0.0, 0.0, 1.0]) - np.cross(angles, [0.0, 0.0, 1.0]))
    noise = rng.normal(0.0, 1.0, (len(rates), 6)) * np.repeat([1e-3, 0.02], 3)
    return np.column_stack([np.arange(len(rates)) / RATE_HZ, np.column_stack([rates, felt]) + noise])


def measured(folder: Path, table: np.ndarray, *heads: str, delimiter: str = ",") -> Measured:
    file = folder / "imu.csv"
    header = delimiter.join(heads or HEADS[: table.shape[1]])
    np.savetxt(file, table, "%.12g", delimiter, header=header, comments="")
    return measure_imu(read_imu(file))


def test_a_gyroscope_tells_the_shake_of_a_scenario(tmp_path: Path):
    found = measured(tmp_path, samples())
    assert not found.doubts
    for name, rms in (("jitter", 0.5), ("pitch above 1 Hz", 0.5), ("roll above 1 Hz", 0.5), ("yaw above 1 Hz", 1.5)):
        one = value_of(found, name)
        assert abs(one.value / rms - 1.0) < 0.06
        assert one.low < rms < one.high
    axis = axes_of(found).jitter
    assert axis.physical == pytest.approx(value_of(found, "jitter").value, rel=1e-3)
    assert 1.2 < axis.ground_band_hz[0] < 2.0
    assert 5.5 < axis.ground_band_hz[1] < 7.0


@pytest.mark.parametrize(
    ("scale", "unit", "heads"),
    [
        (1e9, 1.0, "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
         "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]"),
        (1e3, 1.0, "%time,field.angular_velocity.x,field.angular_velocity.y,field.angular_velocity.z,"
         "field.linear_acceleration.x,field.linear_acceleration.y,field.linear_acceleration.z"),
        (1.0, 57.29578, "Time (s);GyroX (deg/s);GyroY (deg/s);GyroZ (deg/s);AccX (g);AccY (g);AccZ (g)"),
        (1e6, 57.29578, "time_us\tgx_dps\tgy_dps\tgz_dps\tax\tay\taz"),
    ],
)  # fmt: skip
def test_columns_and_units_are_found_by_name(tmp_path: Path, scale: float, unit: float, heads: str):
    table = samples()
    wanted = measured(tmp_path, table)
    delimiter = max(",;\t", key=heads.count)
    table *= [scale, *[unit] * 3, *[1.0 / 9.81 if "(g)" in heads else 1.0] * 3]
    found = measured(tmp_path, table, *heads.split(delimiter), delimiter=delimiter)
    assert not found.doubts
    assert value_of(found, "jitter").value == pytest.approx(value_of(wanted, "jitter").value, rel=1e-5)


@pytest.mark.parametrize(
    ("change", "heads", "said"),
    [
        ([1.0, 1000.0], "", "gyroscopes end at 35"),
        ([1e3, 1.0], "", "unit of the time is wrong"),  # milliseconds that are called seconds
        ([1e9, 1.0], "", "in ns it would be 100 a second"),
        ([0.0, 1.0], "", "times do not rise: sample 2"),
        ([1.0, 1.0], "time_s,gyro_x,gyro_y,gyro_z", "must tell one unit"),
        ([1.0, 1.0], "time_s,gyro_x_rad_s,gyro_y_deg_s,gyro_z_rad_s", "must tell one unit"),
        ([1.0, 1.0], "time_s,speed,gyro_y_rad_s,gyro_z_rad_s", "needs columns gyro_x_rad_s"),
        ([1.0, 1.0], "frame,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s", "needs a column of times"),
    ],
)
def test_wrong_units_and_columns_are_refused(tmp_path: Path, change: list[float], heads: str, said: str):
    table = samples()[:, :4] * [change[0], *[change[1]] * 3]
    with pytest.raises(SequenceError, match=said):
        measured(tmp_path, table, *heads.split(",") if heads else ())


def test_files_that_are_no_logs_are_refused(tmp_path: Path):
    for content, said in (
        (b"", "needs a column of times"),
        (b"\xff\xfe", "cannot be read as text"),
        (",".join(HEADS).encode(), "has 0 samples"),
        (",".join(HEADS).encode() + b"\n0,1,2,x,4,5,6\n", "could not convert"),
    ):
        file = tmp_path / "imu.csv"
        file.write_bytes(content)
        with pytest.raises(SequenceError, match=said):
            read_imu(file)
    with pytest.raises(SequenceError, match="No such file"):
        read_imu(tmp_path / "missing.csv")


@pytest.mark.parametrize("column", ["turns", "times"])
def test_an_accelerometer_contradicts_degrees_and_times(tmp_path: Path, column: str):
    table = samples()
    if column == "turns":
        table[:, 1:4] *= 0.2 * 57.3
        table[:, 4:6] *= 0.2
    else:
        table[:, 0] *= 5.0
    assert "unit of turns or times is wrong" in " ".join(measured(tmp_path, table).doubts)


def test_without_an_accelerometer_all_verticals_are_in_the_interval_and_it_is_said(tmp_path: Path):
    found, known = measured(tmp_path, samples()[:, :4]), measured(tmp_path, samples())
    assert "which axis points upwards is not known" in " ".join(found.doubts)
    one = value_of(found, "jitter")
    assert one.low < 0.5
    assert one.high > np.hypot(0.5, 1.5) / np.sqrt(2.0)
    assert one.value == pytest.approx(value_of(known, "jitter").value, rel=1e-2)
    still = samples()
    still[:, 4:] -= [0.0, 0.0, 9.81]
    assert "gravity is 9.81" in " ".join(measured(tmp_path, still).doubts)


def test_degrees_are_doubted_without_an_accelerometer_too(tmp_path: Path):
    table = samples()[:, :4]
    table[:, 1:] = np.degrees(0.25 * table[:, 1:])
    doubts = " ".join(measured(tmp_path, table).doubts)
    assert "deg RMS: the unit of turns may be wrong" in doubts


def test_a_sensor_may_be_mounted_in_any_way(tmp_path: Path):
    table = samples()
    wanted = value_of(measured(tmp_path, table), "jitter")
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    table[:, 1:4], table[:, 4:] = table[:, 1:4] @ turn.T, table[:, 4:] @ turn.T
    found = measured(tmp_path, table)
    assert not found.doubts
    assert value_of(found, "jitter").value == pytest.approx(wanted.value, rel=0.02)


def test_gaps_uneven_times_and_samples_that_are_no_numbers(tmp_path: Path):
    table = samples()
    gap = measured(tmp_path, np.delete(table, slice(500, 700), axis=0))
    assert value_of(gap, "jitter").low < 0.5 < value_of(gap, "jitter").high
    often = measured(tmp_path, np.delete(table, [index for index in range(1600) if index % 300 < 5], axis=0))
    assert "without a gap" in often.left_out["jitter"]
    lost = table.copy()
    lost[500:502, 1] = np.nan
    assert value_of(measured(tmp_path, lost), "jitter").low < 0.5 < value_of(measured(tmp_path, lost), "jitter").high
    most = np.concatenate([table[:450], table[650:850], table[1050:1250]])
    assert "only 4.5 of" in " ".join(measured(tmp_path, most).doubts)
    uneven = table.copy()
    uneven[:, 0] += np.random.default_rng(0).uniform(-0.004, 0.004, len(table))
    found = measured(tmp_path, uneven)
    assert "uneven times" in " ".join(found.doubts)
    one = value_of(found, "jitter")
    assert one.low < 0.5 < one.high


@pytest.mark.parametrize("step", [0.0, 0.001])
def test_a_gyroscope_at_its_limit_tells_no_shake(tmp_path: Path, step: float):
    table = samples()
    if step:
        table[:, 1:4] = step * np.rint(table[:, 1:4] / step)
    assert "jitter" not in measured(tmp_path, table).left_out
    table[:, 1:4] = table[:, 1:4].clip(-0.2, 0.2)
    assert "at its limit of 0.2 rad/s" in measured(tmp_path, table).left_out["jitter"]


def test_logs_of_the_simulator_are_measured_as_bags(tmp_path: Path):
    pytest.importorskip("mcap_ros2")
    pytest.importorskip("rosbags")
    table, path = samples(8.0), tmp_path / "walk.mcap"
    hidden = Truth("target", *[np.zeros(4)] * 4, 0.0, 0.0, "out_of_view", (), 4.0, np.eye(4), np.eye(4), np.eye(3),
                   np.zeros(5), 0.0, 0.0, 0.5)  # fmt: skip
    names = [name for name in PROPRIO_NAMES if name.startswith(("gyro", "accelerometer"))]

    class Wheels:
        track_m, range_m, beams_rad = 0.4, 5.0, np.linspace(-1.5, 1.5, 37)

        def camera_mount(self, pan_rad: float, tilt_rad: float) -> np.ndarray:
            return np.eye(4)

    with log_writer(log_format(path), path, LogInfo("walk", RATE_HZ, (), (1.0, 1.0, 1.0, 1.0), 0.0)) as add:
        for index, row in enumerate(table):
            proprio = np.zeros(len(PROPRIO_NAMES))
            proprio[[PROPRIO_INDEX[name] for name in names]] = row[1:]
            frame = Frame(index, float(row[0]), np.zeros((8, 8, 3), np.uint8), hidden, (hidden,))
            add(LogFrame(frame, (0.0, 0.0, 0.0), proprio, Wheels()))
    wanted, found = measured(tmp_path, table), measure_imu(read_imu(path))
    assert value_of(found, "jitter").value == pytest.approx(value_of(wanted, "jitter").value, rel=1e-3)
    with pytest.raises(SequenceError, match="no topic /other"):
        read_imu(path, "/other")
