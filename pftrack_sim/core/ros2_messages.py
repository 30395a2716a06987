"""Types of ROS 2 messages that are written and read: those of Humble, and vision_msgs, which `rosbags` has not."""

from __future__ import annotations

import functools
import importlib
from typing import Any

HALF_PIXEL = 0.5
"""In ROS the centre of the first pixel is 0, where it is 0.5 in the rest of this package."""

_VISION = {
    "Point2D": "float64 x\nfloat64 y",
    "Pose2D": "vision_msgs/Point2D position\nfloat64 theta",
    "BoundingBox2D": "vision_msgs/Pose2D center\nfloat64 size_x\nfloat64 size_y",
    "ObjectHypothesis": "string class_id\nfloat64 score",
    "ObjectHypothesisWithPose": "vision_msgs/ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose",
    "Detection2D": (
        "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\nvision_msgs/BoundingBox2D bbox\n"
        "string id"
    ),
    "Detection2DArray": "std_msgs/Header header\nvision_msgs/Detection2D[] detections",
}


@functools.cache
def type_store() -> Any:
    """The store of `rosbags` with all types; raises ImportError without the library."""
    types: Any = importlib.import_module("rosbags.typesys")
    store = types.get_typestore(types.Stores.ROS2_HUMBLE)
    for name, text in _VISION.items():
        store.register(types.get_types_from_msg(text, f"vision_msgs/msg/{name}"))
    return store
