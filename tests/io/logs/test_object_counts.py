"""Counts of objects in files and bags."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from pgm_places.errors import LogError
from pgm_places.io.logs.detection_bags import read_detection_bag
from pgm_places.io.logs.object_counts import read_object_counts
from pgm_places.vision.object_counts import ObjectCounts
from tests.io.files import write_counts


def test_counts_survive_csv(tmp_path: Path) -> None:
    counts = ObjectCounts(
        np.array([0.1, 1e9 + 1 / 3]), np.array([[0, 2], [1, 0]]), ("coffee machine", 'a "cup", red')
    )
    again = read_object_counts(write_counts(tmp_path / "counts.csv", counts))
    assert again.object_names == counts.object_names
    assert (again.times_s == counts.times_s).all()
    assert (again.counts == counts.counts).all()


def test_json_names_only_what_was_seen(tmp_path: Path) -> None:
    path = tmp_path / "counts.json"
    path.write_text('[{"t_s": 2, "counts": {"cup": 1}}, {"t_s": 1, "counts": {"chair": 2.0}}]')
    counts = read_object_counts(path)
    assert counts.object_names == ("cup", "chair")
    assert counts.times_s.tolist() == [1.0, 2.0]
    assert counts.counts.tolist() == [[0, 2], [1, 0]]


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.csv", "", "is empty"),
        ("a.csv", "time,cup\n1,2\n", "the heading must name t_s"),
        (
            "a.csv",
            "t_s,cup\n1,2\n1\n",
            "row 2 after the heading: 1 fields, but there are 2 columns",
        ),
        (
            "a.csv",
            "t_s,cup\n1,-2\n",
            "row 1: cup must be a whole number from 0 to 2147483647, got -2",
        ),
        ("a.csv", "t_s,cup\n1,x\n", "cup must be a finite number, got 'x'"),
        ("a.csv", "t_s,cup\nnan,1\n", "t_s must be a finite number"),
        ("a.json", "{", "not a JSON file"),
        ("a.json", "{}", "must hold a list of records"),
        ("a.json", '[{"t_s": 1}]', "record 1"),
        ("a.json", '[{"t_s": 1, "counts": {"cup": true}}]', "cup must be a finite number"),
        ("a.json", '[{"t_s": 1, "counts": {"cup": 0.5}}]', "cup must be a whole number from 0"),
    ],
)
def test_damage_is_said(name: str, text: str, words: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(LogError, match=words):
        read_object_counts(tmp_path / name)


def test_a_missing_or_binary_file(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="no such file; expected counts of objects"):
        read_object_counts(tmp_path / "none.csv")
    (tmp_path / "a.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(LogError, match="not UTF-8 text; expected counts"):
        read_object_counts(tmp_path / "a.csv")


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


def test_detections_of_several_cameras_are_added_up(tmp_path: Path) -> None:
    bag = detection_bag(
        tmp_path / "bag",
        [
            ("/left", 10.1, [("62", 0.9), ("62", 0.8), ("41", 0.3)]),
            ("/right", 10.2, [("62", 0.7)]),
            ("/left", 20.1, [("41", 0.6)]),
            ("/left", 20.3, [("62", 0.6)]),  # the same camera again: this one counts
        ],
    )
    counts = read_detection_bag(bag, names={"62": "monitor on"}, together_s=0.5)
    assert counts.object_names == ("monitor on",)
    assert counts.counts.tolist() == [[3], [1]]
    assert counts.times_s.tolist() == [10.25, 20.25]
    left = read_detection_bag(bag, topics=["/left"], min_score=0.0)
    assert left.object_names == ("41", "62")
    assert left.counts.tolist() == [[1, 2], [0, 1]]


def test_a_bag_without_such_a_topic(tmp_path: Path) -> None:
    bag = detection_bag(tmp_path / "bag", [("/left", 1.0, [])])
    with pytest.raises(LogError, match=r"lacks the topic /right of type .*: /left"):
        read_detection_bag(bag, topics=["/right"])
    with pytest.raises(LogError, match="together_s must be positive"):
        read_detection_bag(bag, together_s=0.0)
    assert len(read_detection_bag(bag)) == 1
