"""The outcome of a drive does not depend on the camera's rate."""

from dataclasses import dataclass, field
from typing import Any

import mujoco
import numpy as np
import pytest

from pftrack_sim import scenario
from pftrack_sim.simulation.world import World

RATES_HZ = (2.0, 12.5, 25.0, 50.0)
PATH_TOLERANCE_M = 0.02
"""Ticks last from 20 ms (at 50 Hz) to 40 ms (at 25 Hz), and a speed is held for one tick: at 1.2 m/s and constant
acceleration, the distance driven differs by up to half of the difference in tick length times the speed (12 mm)."""


def world(rate_hz: float, start_x_m: float = 8.0, **keys: Any) -> World:
    """A target that walks along y = 1 m, and a robot that faces its path from y = -3 m."""
    tree = {
        "title": "crossing paths",
        "duration_s": 8.0,
        "place": {"kind": "plaza", "clutter": 0.0},
        "camera": {"width_px": 64, "height_px": 48, "rate_hz": rate_hz},
        "lights": {"shadows": False},
        "robot": {"route": {"kind": "still", "start_m": [start_x_m, -3.0], "heading_deg": 90.0}, "gaze": "forward"},
        "target": {"path_m": [[4.0, 1.0], [20.0, 1.0]], "speed_m_s": 1.2},
        "distractors": {"count": 0},
    }
    return World(scenario.load(tree | keys).resolve(0), 0)


@dataclass
class Record:
    """Robot poses at the control ticks, and the first collision: when (to the tick), with what, in which frame."""

    poses: list[tuple[float, ...]] = field(default_factory=list)
    tick_s: float | None = None
    touched: str | None = None
    frame_s: float | None = None

    def y_m(self, times_s: np.ndarray) -> np.ndarray:
        times, _, y, _ = np.array(self.poses).T
        return np.interp(times_s, times, y)


def drive(moving: World, monkeypatch: pytest.MonkeyPatch) -> Record:
    """Drive straight on until the robot has touched something."""
    record = Record()
    update, collision = moving.robot.update, moving.robot.drive.collision

    def recorded_update(dt_s: float, state: Any, *command: Any) -> None:
        record.poses.append((state.time_s, *state.robot_pose))
        update(dt_s, state, *command)

    def recorded_collision(data: mujoco.MjData) -> str | None:
        touched = collision(data)
        if touched is not None and record.tick_s is None:
            record.tick_s, record.touched = record.poses[-1][0] + moving.clock.tick_s, touched
        return touched

    monkeypatch.setattr(moving.robot, "update", recorded_update)
    monkeypatch.setattr(moving.robot.drive, "collision", recorded_collision)
    while moving.time_s < 5.0 and moving.collision() is None:
        moving.advance(np.array([1.0, 0.0, 0.0, 0.0]))
    record.frame_s = None if moving.collision() is None else moving.time_s
    return record


@pytest.mark.parametrize(
    ("start_x_m", "touched"), [(8.0, "target"), (7.0, None)], ids=["into the target", "just behind the target"]
)
def test_a_drive_ends_the_same_at_every_camera_rate(
    start_x_m: float, touched: str | None, monkeypatch: pytest.MonkeyPatch
):
    records = {rate_hz: drive(world(rate_hz, start_x_m), monkeypatch) for rate_hz in RATES_HZ}
    reference = records[50.0]
    times = np.linspace(0.0, 2.9, 30)
    for rate_hz, record in records.items():
        assert record.touched == touched, rate_hz
        assert np.abs(record.y_m(times) - reference.y_m(times)).max() < PATH_TOLERANCE_M
        if touched is not None:
            assert record.tick_s == pytest.approx(reference.tick_s, abs=0.08)
            # The frame that follows the collision reports it.
            assert record.frame_s is not None
            assert 0.0 <= record.frame_s - record.tick_s < 1.0 / rate_hz


@pytest.mark.parametrize(
    "axis", [{}, {"axes": {"occlusion": {"severity": 1.0, "end_s": 3.0}}}], ids=["people", "carts"]
)
def test_colliders_are_where_people_and_carts_are_during_a_frame(axis: dict[str, Any], monkeypatch: pytest.MonkeyPatch):
    moving = world(2.0, **axis)
    # Its commands are given to the scene, where the colliders are.
    monkeypatch.setattr(moving.robot._vicinity, "may_touch", lambda _: True)
    pelvis = moving.model.body_mocapid[moving.model.body("target/pelvis").id]
    carts = [moving.model.body_mocapid[moving.model.body(name).id] for name in ("cabinet-1",) if axis]
    command, lags_m = moving.robot.drive.command, [0.0]

    def recorded_command(data: mujoco.MjData, *speeds: float) -> None:
        lags_m.append(float(np.hypot(*(data.mocap_pos[pelvis, :2] - moving.root_poses()[0, :2, 3]))))
        for mocap, cart in zip(carts, moving.traffic.crowd.carts, strict=True):
            lags_m.append(float(np.hypot(*(data.mocap_pos[mocap, :2] - cart.position_m))))
        command(data, *speeds)

    monkeypatch.setattr(moving.robot.drive, "command", recorded_command)
    for _ in range(6):
        moving.advance()
    # A root pose is on the ground below the pelvis, which sways by a few centimetres at most.
    assert max(lags_m) < 0.05
