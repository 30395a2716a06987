"""A massless robot and a walking person: box and proprioception without a simulator."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pftrack_sim import controllers
from pftrack_sim.controllers import Controller, RobotParameters
from pftrack_sim.core.proprioception import PROPRIO_INDEX, PROPRIO_NAMES, RANGE_ANGLES_RAD, RANGE_M, RANGES
from pftrack_sim.core.records import Estimate

SIZE = (640, 480)
FOCAL_PX = 240.0 / math.tan(math.radians(25.0))
LIMITS = np.array([1.6, math.radians(90.0), math.radians(120.0), math.radians(60.0)])
WALKER_M = 0.15
HALF_VIEW_RAD = math.atan2(320.0, FOCAL_PX)


def started(name: str = "servo", **params: float) -> Controller:
    """A controller at the start of an episode."""
    controller = controllers.make(name, **params)
    controller.reset(RobotParameters(SIZE))
    return controller


class Playground:
    """Robot and person on a plane, driven by a controller with `play`.

    Args:
        target_m: Position of the person.
        height_m: Height of the person.
        posts: x, y and radius [m] of round obstacles, measured by the range finder only.
        legs: Whether the range finder measures the person.
        walkers: x, y [m] and velocity [m/s] of others who walk, measured by the range finder only.
    """

    def __init__(
        self,
        target_m: tuple[float, float],
        height_m: float = 1.72,
        posts: Sequence[tuple[float, float, float]] = (),
        legs: bool = False,
        walkers: Sequence[tuple[float, float, float, float]] = (),
    ) -> None:
        self.x = self.y = self.heading = self.pan = self.tilt = 0.0
        self.rates = np.zeros(4)
        self.target = np.array(target_m, dtype=np.float64)
        self.height_m = height_m
        self.posts = np.array(posts, dtype=np.float64).reshape(-1, 3)
        self.legs = legs
        self.walkers = np.array(walkers, dtype=np.float64).reshape(-1, 4)
        self.nearest_m = self.nearest_walker_m = math.inf
        self.nearest_to_person_m = math.inf
        self.commands: list[np.ndarray] = []

    @property
    def distance_m(self) -> float:
        return math.hypot(self.target[0] - self.x, self.target[1] - self.y)

    @property
    def bearing_rad(self) -> float:
        direction = math.atan2(self.target[1] - self.y, self.target[0] - self.x)
        return math.remainder(direction - self.heading - self.pan, 2.0 * math.pi)

    @property
    def in_view(self) -> bool:
        return abs(self.bearing_rad) < HALF_VIEW_RAD

    def box(self) -> np.ndarray:
        ahead = self.distance_m * math.cos(self.bearing_rad)
        u = 320.0 - FOCAL_PX * math.tan(self.bearing_rad)
        low = 240.0 + FOCAL_PX * math.tan(math.atan2(1.25, ahead) + self.tilt)
        high = 240.0 + FOCAL_PX * math.tan(math.atan2(1.25 - self.height_m, ahead) + self.tilt)
        low, high = np.clip([low, high], 0.0, 480.0)
        return np.array([u - 30.0, high, 60.0, low - high])

    def ranges(self) -> np.ndarray:
        angles = self.heading + RANGE_ANGLES_RAD
        beams = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        found = np.full(len(beams), RANGE_M)
        walkers = [(x, y, WALKER_M) for x, y in self.walkers[:, :2]]
        for x, y, radius in [*self.posts, *walkers, *([(*self.target, 0.12)] if self.legs else [])]:
            offset = np.array([x - self.x, y - self.y])
            along, aside = beams @ offset, beams @ np.array([-offset[1], offset[0]])
            meets = (along > 0.0) & (np.abs(aside) < radius)
            found[meets] = np.minimum(found[meets], along[meets] - np.sqrt(radius**2 - aside[meets] ** 2))
        return found

    def proprio(self) -> np.ndarray:
        values = np.zeros(len(PROPRIO_NAMES), dtype=np.float32)
        for name, value in {
            "odometry_x_m": self.x,
            "odometry_y_m": self.y,
            "odometry_heading_rad": math.remainder(self.heading, 2.0 * math.pi),
            "pan_rad": self.pan,
            "tilt_rad": self.tilt,
            "gyro_z_rad_s": self.rates[1],
            "wheel_left_m_s": self.rates[0],
            "wheel_right_m_s": self.rates[0],
        }.items():
            values[PROPRIO_INDEX[name]] = value
        values[RANGES] = self.ranges()
        return values

    def play(
        self,
        controller: Controller,
        seconds: float,
        velocity: tuple[float, float] = (0.0, 0.0),
        sure: bool = True,
    ) -> None:
        """Simulate; the tracker detects the person while in view, if `sure`. Velocity of the person [m/s]."""
        for _ in range(round(seconds * 30.0)):
            seen = sure and self.in_view
            estimate = Estimate(self.box() if seen else np.zeros(4), 1.0 if seen else 0.0, occluded=not seen)
            command = controller.act(estimate, self.proprio())
            self.commands.append(command)
            step = np.array([1.2, 4.0, 12.0, 8.0]) / 30.0
            self.rates = self.rates + np.clip(command * LIMITS - self.rates, -step, step)
            forward, turn, pan, tilt = self.rates / 30.0
            self.x += forward * math.cos(self.heading)
            self.y += forward * math.sin(self.heading)
            self.heading += turn
            self.pan += pan
            self.tilt += tilt
            self.target = self.target + np.array(velocity) / 30.0
            self.walkers[:, :2] += self.walkers[:, 2:] / 30.0
            away = np.hypot(*(self.walkers[:, :2] - (self.x, self.y)).T)
            self.nearest_walker_m = min(self.nearest_walker_m, float(away.min(initial=math.inf)) - WALKER_M)
            self.nearest_to_person_m = min(self.nearest_to_person_m, self.distance_m)
            for x, y, radius in self.posts:
                self.nearest_m = min(self.nearest_m, math.hypot(x - self.x, y - self.y) - radius)
