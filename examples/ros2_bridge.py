"""A live episode for a ROS 2 stack: what the robot senses goes out, `cmd_vel` and the head's rates come in.

    python examples/ros2_bridge.py follow/plaza --seed 3 --url ws://robot-computer:9090

It speaks to `rosbridge_server`, which every distribution of ROS 2 packages (`ros2 launch rosbridge_server
rosbridge_websocket_launch.xml`), and needs nothing of ROS here but the extra `ros2` and `websockets`. The messages are
those of a log (docs/loop.md), with `/clock`: nodes run with `use_sim_time`. Frames come at the camera's rate, or
`--speed` times as fast; a command counts from the next frame on, and the robot stops when none came for half a second.
"""

from __future__ import annotations

import argparse
import base64
import json
import math
import threading
import time
from collections.abc import Mapping
from typing import Any

import gymnasium as gym
import numpy as np
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

import pftrack_sim  # noqa: F401 - registers the environments
from pftrack_sim.logs import LogFrame, LogInfo
from pftrack_sim.logs.ros2 import Messages

DRIVE, HEAD = "/cmd_vel", "/head_velocity_controller/commands"
STALE_S = 0.5


def plain(value: Any) -> Any:
    """A message as JSON of the rosbridge protocol: bytes in base64, and null for what is not finite."""
    if isinstance(value, Mapping):
        return {key: plain(one) for key, one in value.items()}
    if isinstance(value, bytes):
        return base64.b64encode(value).decode()
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


class Commands:
    """The last command of each topic, read in a thread: forward speed [m/s], turn, pan and tilt rate [rad/s]."""

    def __init__(self, socket: Any) -> None:
        self._given = {DRIVE: (0.0, [0.0, 0.0]), HEAD: (0.0, [0.0, 0.0])}
        self._socket = socket
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        try:
            for text in self._socket:
                said = json.loads(text)
                if said.get("op") == "publish" and said["topic"] in self._given:
                    message = said["msg"]
                    head = said["topic"] == HEAD
                    values = message["data"][:2] if head else [message["linear"]["x"], message["angular"]["z"]]
                    self._given[said["topic"]] = time.monotonic(), values
        except ConnectionClosed:
            return

    def now(self) -> list[float]:
        """Zero for what is older than `STALE_S`."""
        now = time.monotonic()
        return [one for at, values in self._given.values() for one in (values if now - at < STALE_S else [0.0, 0.0])]


def run(scenario: str, seed: int, url: str, speed: float = 1.0, overrides: Mapping[str, Any] | None = None) -> str:
    """Bridge one episode; returns its outcome."""
    env = gym.make("pftrack_sim/Follow-v0", scenario=scenario, overrides=dict(overrides or {}))
    simulation = env.unwrapped.simulation
    _, info = env.reset(seed=seed)
    world, camera = simulation.world, simulation.settings.camera
    limits = world.robot.drive.limits
    error = 0.01 * simulation.settings.robot.odometry_error_percent
    messages, advertised = Messages(LogInfo(scenario, camera.rate_hz, (), tuple(limits.tolist()), error)), set[str]()
    with connect(url, max_size=None) as socket:
        for topic, kind in ((DRIVE, "geometry_msgs/Twist"), (HEAD, "std_msgs/Float64MultiArray")):
            socket.send(json.dumps({"op": "subscribe", "topic": topic, "type": kind}))
        commands, due_s = Commands(socket), time.monotonic()
        while True:
            log = LogFrame(simulation.frame, world.robot_pose(), world.proprio().astype(float), world.robot.drive)
            for topic, kind, message in messages.of(log):
                if topic not in advertised:
                    advertised.add(topic)
                    socket.send(json.dumps({"op": "advertise", "topic": topic, "type": kind}))
                socket.send(json.dumps({"op": "publish", "topic": topic, "msg": plain(message)}))
            if info.get("outcome") is not None:
                break
            due_s += 1.0 / (camera.rate_hz * speed)
            time.sleep(max(due_s - time.monotonic(), 0.0))
            *_, info = env.step(np.clip(np.array(commands.now()) / limits, -1.0, 1.0))
    env.close()
    return str(info["outcome"])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Bridge an episode to ROS 2.")
    parser.add_argument("scenario")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--url", default="ws://localhost:9090")
    parser.add_argument("--speed", type=float, default=1.0, help="times real time")
    given = parser.parse_args()
    print(run(given.scenario, given.seed, given.url, given.speed))
