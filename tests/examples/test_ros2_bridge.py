"""The bridge to ROS 2, against a server that speaks the rosbridge protocol."""

import json
import math
import runpy
import threading
from typing import Any

import pytest

SMALL = {"camera.width_px": 64, "camera.height_px": 48, "camera.rate_hz": 10, "duration_s": 4, "lights.shadows": False}


def test_what_is_sensed_goes_out_and_commands_come_in():
    pytest.importorskip("rosbags")
    server = pytest.importorskip("websockets.sync.server")
    said: list[dict[str, Any]] = []

    def answer(socket: Any) -> None:
        for text in socket:
            said.append(json.loads(text))
            if said[-1].get("topic") == "/odom" and said[-1]["op"] == "publish":
                drive = {"linear": {"x": 0.5}, "angular": {"z": 0.0}}
                for topic, message in (("/cmd_vel", drive), ("/head_velocity_controller/commands", {"data": [0.3, 0]})):
                    socket.send(json.dumps({"op": "publish", "topic": topic, "msg": message}))

    bridge = runpy.run_path("examples/ros2_bridge.py")
    with server.serve(answer, "localhost", 0, max_size=None) as listening:
        thread = threading.Thread(target=listening.serve_forever)
        thread.start()
        port = listening.socket.getsockname()[1]
        outcome = bridge["run"]("follow/plaza", 3, f"ws://localhost:{port}", 4.0, SMALL)
        listening.shutdown()
        thread.join()
    assert outcome in ("finished", "collision")
    assert {one["topic"] for one in said if one["op"] == "subscribe"} == {
        "/cmd_vel",
        "/head_velocity_controller/commands",
    }
    kinds = {one["topic"]: one["type"] for one in said if one["op"] == "advertise"}
    assert kinds["/clock"] == "rosgraph_msgs/Clock"
    published = {
        topic: [one["msg"] for one in said if one["op"] == "publish" and one["topic"] == topic] for topic in kinds
    }
    assert len(published["/tf_static"]) == 1
    times = [one["clock"]["sec"] + 1e-9 * one["clock"]["nanosec"] for one in published["/clock"]]
    assert times == pytest.approx([0.1 * index for index in range(len(times))])
    assert published["/camera/image/compressed"][0]["data"].startswith("/9j/"), "a JPEG in base64"
    assert all(one is None or math.isfinite(one) for one in published["/scan"][0]["ranges"])
    way = [one["pose"]["pose"]["position"]["x"] for one in published["/odom"]]
    assert way[-1] > 0.5
    pan = [one["position"][0] for one in published["/joint_states"]]
    assert pan[-1] > pan[0] + 0.2
