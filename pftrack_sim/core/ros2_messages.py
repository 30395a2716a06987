"""Definitions of ROS 2 messages that are written and read (common_interfaces, geometry2, vision_msgs; Humble on)."""

from __future__ import annotations

import re

_FIELDS = {
    "builtin_interfaces/Time": "int32 sec; uint32 nanosec",
    "std_msgs/Header": "builtin_interfaces/Time stamp; string frame_id",
    "geometry_msgs/Vector3": "float64 x; float64 y; float64 z",
    "geometry_msgs/Point": "float64 x; float64 y; float64 z",
    "geometry_msgs/Quaternion": "float64 x; float64 y; float64 z; float64 w",
    "geometry_msgs/Pose": "geometry_msgs/Point position; geometry_msgs/Quaternion orientation",
    "geometry_msgs/PoseWithCovariance": "geometry_msgs/Pose pose; float64[36] covariance",
    "geometry_msgs/Twist": "geometry_msgs/Vector3 linear; geometry_msgs/Vector3 angular",
    "geometry_msgs/TwistWithCovariance": "geometry_msgs/Twist twist; float64[36] covariance",
    "geometry_msgs/Transform": "geometry_msgs/Vector3 translation; geometry_msgs/Quaternion rotation",
    "geometry_msgs/TransformStamped": (
        "std_msgs/Header header; string child_frame_id; geometry_msgs/Transform transform"
    ),
    "tf2_msgs/TFMessage": "geometry_msgs/TransformStamped[] transforms",
    "nav_msgs/Odometry": (
        "std_msgs/Header header; string child_frame_id; geometry_msgs/PoseWithCovariance pose; "
        "geometry_msgs/TwistWithCovariance twist"
    ),
    "sensor_msgs/CompressedImage": "std_msgs/Header header; string format; uint8[] data",
    "sensor_msgs/Image": (
        "std_msgs/Header header; uint32 height; uint32 width; string encoding; uint8 is_bigendian; uint32 step; "
        "uint8[] data"
    ),
    "sensor_msgs/RegionOfInterest": "uint32 x_offset; uint32 y_offset; uint32 height; uint32 width; bool do_rectify",
    "sensor_msgs/CameraInfo": (
        "std_msgs/Header header; uint32 height; uint32 width; string distortion_model; float64[] d; float64[9] k; "
        "float64[9] r; float64[12] p; uint32 binning_x; uint32 binning_y; sensor_msgs/RegionOfInterest roi"
    ),
    "sensor_msgs/LaserScan": (
        "std_msgs/Header header; float32 angle_min; float32 angle_max; float32 angle_increment; "
        "float32 time_increment; float32 scan_time; float32 range_min; float32 range_max; float32[] ranges; "
        "float32[] intensities"
    ),
    "vision_msgs/Point2D": "float64 x; float64 y",
    "vision_msgs/Pose2D": "vision_msgs/Point2D position; float64 theta",
    "vision_msgs/BoundingBox2D": "vision_msgs/Pose2D center; float64 size_x; float64 size_y",
    "vision_msgs/ObjectHypothesis": "string class_id; float64 score",
    "vision_msgs/ObjectHypothesisWithPose": (
        "vision_msgs/ObjectHypothesis hypothesis; geometry_msgs/PoseWithCovariance pose"
    ),
    "vision_msgs/Detection2D": (
        "std_msgs/Header header; vision_msgs/ObjectHypothesisWithPose[] results; vision_msgs/BoundingBox2D bbox; "
        "string id"
    ),
    "vision_msgs/Detection2DArray": "std_msgs/Header header; vision_msgs/Detection2D[] detections",
}


def definition(name: str) -> str:
    """Definition of a message with those of all messages in it, as MCAP's schema encoding `ros2msg` wants them.

    Args:
        name: `"sensor_msgs/LaserScan"`.
    """
    needed = [name]
    for one in needed:  # grows while it is read
        needed += [part for part in re.findall(r"\w+/\w+", _FIELDS[one]) if part not in needed]
    texts = [_FIELDS[one].replace("; ", "\n") + "\n" for one in needed]
    parts = [f"{'=' * 80}\nMSG: {one}\n{text}" for one, text in zip(needed[1:], texts[1:], strict=True)]
    return "".join([texts[0], *parts])
