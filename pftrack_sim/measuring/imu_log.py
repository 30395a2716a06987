"""Logs of inertial sensors: CSV files whose columns are found by name, and messages `sensor_msgs/Imu` of ROS 2 bags."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pftrack_sim.core.errors import SequenceError
from pftrack_sim.core.inputs import read_bytes
from pftrack_sim.core.text import one_line
from pftrack_sim.core.types import FloatArray
from pftrack_sim.formats import ros2

SUFFIXES = (".csv", ".tsv", ".txt")
_MAX_BYTES = 1 << 30
_WORD = re.compile(r"[A-Z]?[a-zµ°]+|[A-Z]+(?![a-z])|\d+")
_TIMES = {"time", "timestamp", "stamp", "t", "elapsed"}
_UNITS = {"s": "s", "sec": "s", "secs": "s", "seconds": "s", "ms": "ms", "us": "us", "µs": "us", "ns": "ns"}
_BASES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_RATES_HZ = (15.0, 10_000.0)  # Of inertial sensors: less than a factor of 1000 apart, so one base of time fits
_DEGREES, _RADIANS = {"deg", "degree", "degrees", "dps", "°"}, {"rad", "rads", "radian", "radians"}
_SENSORS = {"gyro": ("gyr", {"angular", "velocity"}, "wg"), "accelerometer": ("acc", {"linear", "acceleration"}, "a")}
_LEAST = 60
_MOST_RAD_S = 36.0  # 2000 deg/s, where common gyroscopes end, and 3 %


@dataclass(frozen=True, eq=False)
class ImuLog:
    """Samples of a gyroscope, and of the accelerometer beside it.

    Attributes:
        times_s: `(N,)` rising, the first at 0.
        turn_rates: `(N, 3)` about x, y and z [rad/s].
        accelerations: `(N, 3)` in any unit, gravity included; None without an accelerometer.
    """

    name: str
    times_s: FloatArray
    turn_rates: FloatArray
    accelerations: FloatArray | None


def is_imu(path: Path) -> bool:
    """Whether a path names a log of an inertial sensor, by its name alone."""
    return path.suffix.lower() in SUFFIXES or ros2.find(path) is not None


def read_imu(path: Path, topic: str | None = None) -> ImuLog:
    """A log of an inertial sensor.

    Args:
        path: CSV with a header that names the columns and the unit of the turn rates, or a ROS 2 bag.
        topic: Of a bag that has several of `sensor_msgs/Imu`.

    Raises:
        SequenceError: It cannot be read; a column or unit is missing; times do not rise, or are in another base than
            the header says; or no gyroscope measures such turn rates.
        RunError: The library for bags is missing.
    """
    if ros2.find(path) is not None:
        (stamps, turns, found), base = ros2.read_imu(path, [topic] if topic else []), "s"
    else:
        stamps, base, turns, found = _read_csv(path)
    good = np.isfinite(stamps) & np.isfinite(turns).all(axis=1)
    stamps, turns, found = stamps[good], turns[good], found[good] if found is not None else None
    if len(stamps) < _LEAST:
        raise SequenceError(f"{path}: has {len(stamps)} samples; nothing can be told from fewer than {_LEAST}")
    if not (np.diff(stamps) > 0.0).all():
        at = int(np.argmin(np.diff(stamps) > 0.0)) + 1
        raise SequenceError(f"{path}: times do not rise: sample {at + 1} is at {stamps[at]:g} after {stamps[at - 1]:g}")
    step = float(np.median(np.diff(stamps)))
    fits = [unit for unit, scale in _BASES.items() if _RATES_HZ[0] <= 1.0 / (scale * step) <= _RATES_HZ[1]]
    if not fits or base not in (None, fits[0]):
        said = f"times in {base}" if base else "times"
        hint = f"; in {fits[0]} it would be {1.0 / (_BASES[fits[0]] * step):.0f} a second" if fits else ""
        raise SequenceError(
            f"{path}: {said} that rise by {step:g} are {1.0 / (_BASES[base or 's'] * step):.3g} samples a second, and "
            f"an inertial sensor gives {_RATES_HZ[0]:g} to {_RATES_HZ[1]:g}{hint}: the unit of the time is wrong"
        )
    most = float(np.abs(turns).max())
    if most > _MOST_RAD_S:
        raise SequenceError(
            f"{path}: turns at up to {most:.3g} rad/s, and gyroscopes end at 35 (2000 deg/s): if these are degrees "
            "per second, name the columns so (gyro_x_deg_s)"
        )
    return ImuLog(path.name, _BASES[fits[0]] * (stamps - stamps[0]), turns, found)


def _read_csv(path: Path) -> tuple[FloatArray, str | None, FloatArray, FloatArray | None]:
    """Times and their unit if the header tells, turn rates [rad/s] and accelerations."""
    try:
        lines = read_bytes(path, _MAX_BYTES).decode().splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise SequenceError(f"{path}: cannot be read as text: {getattr(error, 'strerror', None) or error}") from None
    first = next((index for index, line in enumerate(lines) if line.strip()), 0)
    head = lines[first] if lines else ""
    delimiter = max(",;\t", key=head.count)
    names = next(csv.reader([head], delimiter=delimiter))
    words = [[word.lower() for word in _WORD.findall(name)] for name in names]
    time = next((index for index, own in enumerate(words) if _TIMES & {*own}), None)
    gyro, accelerometer = (_columns(words, *_SENSORS[kind]) for kind in ("gyro", "accelerometer"))
    if time is None or len(gyro) < 3:
        missing = "a column of times" if time is None else "columns gyro_x_rad_s, gyro_y_rad_s, gyro_z_rad_s"
        raise SequenceError(
            f"{path}: needs {missing} (or such names as EuRoC's and ROS'), its first line is {one_line(head, 120)!r}"
        )
    units = {word for index in gyro for word in words[index]}
    degrees = bool(units & _DEGREES)
    radians = bool(units & _RADIANS) or (not degrees and units >= {"angular", "velocity"})  # ROS' are in rad/s
    if degrees == radians:
        raise SequenceError(
            f"{path}: the names of the gyroscope's columns must tell one unit, such as gyro_x_rad_s or gyro_x_deg_s; "
            f"got {', '.join(names[index].strip() for index in gyro)}"
        )
    wanted, rows = [time, *gyro, *(accelerometer if len(accelerometer) == 3 else [])], lines[first + 1 :]
    try:
        table = np.loadtxt(rows, delimiter=delimiter, usecols=wanted, ndmin=2) if rows else np.zeros((0, len(wanted)))
    except (ValueError, IndexError) as error:
        raise SequenceError(f"{path}: after its header {one_line(str(error), 120)}") from None
    base = next((_UNITS[word] for word in words[time] if word in _UNITS), None)
    turns = np.radians(table[:, 1:4]) if degrees else table[:, 1:4]
    return table[:, 0], base, turns, table[:, 4:] if len(wanted) == 7 else None


def _columns(words: Sequence[Sequence[str]], starts: str, long: set[str], letters: str) -> list[int]:
    """Columns of x, y and z of a sensor: `gyro_x`, `GyroX`, `angular_velocity.x`, `wx`, or EuRoC's `w_RS_S_x`."""

    def fits(own: Sequence[str], axis: str) -> bool:
        named = any(one.startswith(starts) for one in own) or {*own} >= long or letters[0] in own
        return (named and axis in own) or any(letter + axis in own for letter in letters)

    found = [next((index for index, own in enumerate(words) if fits(own, axis)), None) for axis in "xyz"]
    return [one for one in found if one is not None]
