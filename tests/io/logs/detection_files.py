"""Bags of detected objects, made message by message."""

from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

DEFINITIONS = {
    "vision_msgs/msg/ObjectHypothesis": "string class_id\nfloat64 score\n",
    "vision_msgs/msg/ObjectHypothesisWithPose": (
        "vision_msgs/ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose\n"
    ),
    "vision_msgs/msg/Point2D": "float64 x\nfloat64 y\n",
    "vision_msgs/msg/Pose2D": "vision_msgs/Point2D position\nfloat64 theta\n",
    "vision_msgs/msg/BoundingBox2D": "vision_msgs/Pose2D center\nfloat64 size_x\nfloat64 size_y\n",
    "vision_msgs/msg/Detection2D": (
        "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\n"
        "vision_msgs/BoundingBox2D bbox\nstring id\n"
    ),
    "vision_msgs/msg/Detection2DArray": (
        "std_msgs/Header header\nvision_msgs/Detection2D[] detections\n"
    ),
}
KIND = "vision_msgs/msg/Detection2DArray"
Seen = list[tuple[str, float]]


def detection_bag(folder: Path, messages: list[tuple[str, float, Seen]]) -> Path:
    """A bag of detections: topic, time in seconds, and class and score of each thing seen."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    for name, text in DEFINITIONS.items():
        store.register(get_types_from_msg(text, name))
    types: Any = store.types
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topics = dict.fromkeys(topic for topic, _, _ in messages)
        connections = {
            topic: writer.add_connection(topic, KIND, typestore=store) for topic in topics
        }
        for topic, time, seen in messages:
            nanoseconds = round(time * 1e9)
            stamp = types["builtin_interfaces/msg/Time"](*divmod(nanoseconds, 10**9))
            header = types["std_msgs/msg/Header"](stamp, "camera")
            detections = [detection(types, header, *thing) for thing in seen]
            message = types[KIND](header, detections)
            writer.write(connections[topic], nanoseconds, store.serialize_cdr(message, KIND))
    return folder


def detection(types: Any, header: Any, name: str, score: float) -> Any:
    def make(kind: str, *values: Any) -> Any:
        return types[kind](*values)

    pose = make(
        "geometry_msgs/msg/PoseWithCovariance",
        make(
            "geometry_msgs/msg/Pose",
            make("geometry_msgs/msg/Point", 0.0, 0.0, 0.0),
            make("geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.0, 1.0),
        ),
        np.zeros(36),
    )
    weaker = make("vision_msgs/msg/ObjectHypothesis", "something else", score / 2)
    best = make("vision_msgs/msg/ObjectHypothesis", name, score)
    results = [make("vision_msgs/msg/ObjectHypothesisWithPose", h, pose) for h in (weaker, best)]
    centre = make("vision_msgs/msg/Pose2D", make("vision_msgs/msg/Point2D", 0.0, 0.0), 0.0)
    box = make("vision_msgs/msg/BoundingBox2D", centre, 1.0, 1.0)
    return make("vision_msgs/msg/Detection2D", header, results, box, "")
