"""The response to road roughness agrees with ISO 8608 and linear theory."""

import math
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
import pytest

from pftrack_sim.agents.robot.drive import camera_pose
from pftrack_sim.agents.robot.road import (
    LONGEST_M,
    LOOP_M,
    REFERENCE_CYCLES_M,
    ROUGHNESS_M3,
    SHORTEST_M,
    SILL_WIDTH_M,
    RoadExcitation,
    road_profile,
    sill_profile,
)
from pftrack_sim.scenario.axes import JitterAxis
from pftrack_sim.scenario.robot import Robot, Sills, StillRoute
from pftrack_sim.scene.robot_file.motorised import mast_of
from pftrack_sim.scene.robot_file.roles import Roles

# Of assets/robot.xml.
WHEEL_RADIUS_M, CASTER_ARM_M = 0.0975, 0.185
WHEEL_SPRING_N_M, WHEEL_DAMPING_NS_M, CASTER_SPRING_N_M, CASTER_DAMPING_NS_M = 11000.0, 160.0, 9000.0, 280.0
LEAD_IN_S, RUN_M = 2.0, 24.0


def predicted_acceleration(road_class: str, speed_m_s: float, sprung_kg: float) -> float:
    """RMS of vertical acceleration by linear theory [m/s^2]: one mass that heaves on four springs and dampers.

    Two independent tracks L, R under the wheels, their mean under the casters, fore and aft of the axle: the force is
    (L + R) (wheel + caster cos(2 pi n a)). The spectrum of each track in time is G_d(n_0) n_0^2 v / f^2.
    """
    f = np.linspace(speed_m_s / LONGEST_M, speed_m_s / SHORTEST_M, 20_000)
    omega = 2.0 * math.pi * f
    wheel = WHEEL_SPRING_N_M + 1j * omega * WHEEL_DAMPING_NS_M
    caster = CASTER_SPRING_N_M + 1j * omega * CASTER_DAMPING_NS_M
    force = wheel + caster * np.cos(omega / speed_m_s * CASTER_ARM_M)
    response = np.abs(force / (2.0 * (wheel + caster) - sprung_kg * omega**2)) ** 2
    density = 2.0 * ROUGHNESS_M3[road_class] * REFERENCE_CYCLES_M**2 * speed_m_s / f**2
    return math.sqrt(float(np.trapezoid(density * omega**4 * response, f)))


def vertical_acceleration(lab: Callable[..., Any], road_class: str, speed_m_s: float, severity: float = 1.0) -> float:
    """RMS measured on the simulated robot's body [m/s^2], driving straight on."""
    robot = lab()
    road = RoadExcitation(robot.model, JitterAxis(severity=severity, road_class=road_class), Sills(), seed=5)
    step_s = robot.model.opt.timestep
    run_s = RUN_M / speed_m_s if speed_m_s else 10.0
    velocities = []
    for tick in range(round((LEAD_IN_S + run_s) * 60)):
        robot.drive.command(robot.data, speed_m_s, 0.0, 0.0, 0.0, 1 / 60)
        for _ in range(robot.steps):
            road.write(robot.data)
            mujoco.mj_step(robot.model, robot.data)
            if tick >= LEAD_IN_S * 60:
                velocities.append(robot.data.qvel[2])
    acceleration = np.diff(velocities) / step_s
    return float(np.sqrt(np.mean(acceleration**2)))


@pytest.mark.parametrize("road_class", list(ROUGHNESS_M3))
def test_profile_has_the_spectrum_of_its_class(road_class: str):
    heights = road_profile(road_class, np.random.default_rng(0))
    cycles = np.fft.rfftfreq(heights.size, LOOP_M / heights.size)
    density = 2.0 * np.abs(np.fft.rfft(heights) / heights.size) ** 2 * LOOP_M
    wanted = ROUGHNESS_M3[road_class] * (np.maximum(cycles, 1e-9) / REFERENCE_CYCLES_M) ** -2.0
    inside = (cycles > 1.0 / LONGEST_M + 0.01) & (cycles < 1.0 / SHORTEST_M - 0.01)
    assert abs(density[inside] / wanted[inside] - 1.0).max() < 1e-6
    assert density[~inside & (cycles < 0.49)].max() < 1e-12


@pytest.mark.slow
def test_each_class_doubles_the_acceleration(lab: Callable[..., Any]):
    rms = [vertical_acceleration(lab, road_class, 0.8) for road_class in "ABC"]
    assert abs(np.array(rms[1:]) / rms[:-1] / 2.0 - 1.0).max() < 0.25


@pytest.mark.slow
def test_acceleration_grows_with_speed_as_linear_theory_predicts(lab: Callable[..., Any]):
    sprung_kg = mast_of(Roles.of(Robot(route=StillRoute(kind="still")))).carried_kg(0.55)
    speeds = (0.4, 0.8, 1.6)
    measured = np.array([vertical_acceleration(lab, "B", speed) for speed in speeds])
    predicted = np.array([predicted_acceleration("B", speed, sprung_kg) for speed in speeds])
    assert abs(measured / predicted - 1.0).max() < 0.25, (measured, predicted)
    assert (np.diff(measured) > 0.0).all()


def test_a_robot_at_rest_is_not_excited(lab: Callable[..., Any]):
    assert vertical_acceleration(lab, "E", 0.0) < 1e-3


def test_severity_scales_the_bumps(lab: Callable[..., Any]):
    robot = lab()
    once, twice = (
        RoadExcitation(robot.model, JitterAxis(severity=severity), Sills(), seed=5) for severity in (1.0, 2.0)
    )
    robot.data.qpos[robot.model.joint("robot/axle-left").qposadr] = 3.3
    robot.data.qvel[robot.model.joint("robot/axle-left").dofadr] = 2.0
    for single, double in zip(once.bumps(robot.data), twice.bumps(robot.data), strict=True):
        assert abs(double - 2.0 * single).max() < 1e-12
        assert abs(single).max() > 0.0


def test_a_sill_lifts_the_camera_as_far_as_its_springs_say(lab: Callable[..., Any]):
    robot = lab()
    sills = Sills(height_mm=2.0, every_m=1.0)
    road = RoadExcitation(robot.model, JitterAxis(), sills, seed=2)
    heights = road.bumps(robot.data)[0]
    assert heights.shape == (4,)
    camera_m, moved = [], []
    for _ in range(60 * 14):
        robot.drive.command(robot.data, 0.1, 0.0, 0.0, 0.0, 1 / 60)
        for _ in range(robot.steps):
            road.write(robot.data)
            mujoco.mj_step(robot.model, robot.data)
        moved.append(road.bumps(robot.data)[0][:2])
        camera_m.append(camera_pose(robot.model, robot.data)[2, 3])
    # With both wheels on a sill, wheels and casters share the lift as their springs; it is too small to lift a caster.
    wanted = 2e-3 * WHEEL_SPRING_N_M / (WHEEL_SPRING_N_M + CASTER_SPRING_N_M)
    on_top = np.array(moved).min(axis=1) > 1.99e-3
    assert on_top.any()
    lift = np.array(camera_m)[on_top].mean() - camera_m[0]
    assert abs(lift / wanted - 1.0) < 0.15


def test_sills_are_as_high_and_as_far_apart_as_asked():
    heights = sill_profile(Sills(height_mm=12.0, every_m=3.0), WHEEL_RADIUS_M, np.random.default_rng(0))
    assert abs(heights.max() - 0.012) < 1e-9
    starts = np.flatnonzero(np.diff((heights > 0.0).astype(int)) == 1)
    gaps = np.diff(starts) * LOOP_M / heights.size
    assert gaps.min() > 0.69 * 3.0
    assert gaps.max() < 1.31 * 3.0
    # Flat over the top, with a wheel's arcs on both sides.
    on_m = np.count_nonzero(heights > 0.0) / (starts.size) * LOOP_M / heights.size
    assert abs(on_m - SILL_WIDTH_M - 2.0 * math.sqrt(2.0 * WHEEL_RADIUS_M * 0.012 - 0.012**2)) < 0.01
