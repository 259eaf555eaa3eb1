"""Counts of objects from the detections in a ROS bag (``vision_msgs/Detection2DArray``)."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pgm_places.errors import LogError
from pgm_places.io.logs.bag_access import open_bag, stamp_s
from pgm_places.vision.object_counts import ObjectCounts

KINDS = ("vision_msgs/msg/Detection2DArray",)


def read_detection_bag(
    path: Path | str,
    *,
    topics: Sequence[str] = (),
    min_score: float = 0.5,
    names: Mapping[str, str] | None = None,
    together_s: float = 0.5,
) -> ObjectCounts:
    """Detections counted by class: each by its best hypothesis, if that is good enough.

    Several cameras make one panorama: messages of all topics whose stamps fall into the same
    ``together_s`` seconds are added up, each topic's last message only.

    Parameters
    ----------
    path : path
        A ROS 1 bag, a ROS 2 bag (sqlite3 or MCAP).
    topics : sequence of str, optional
        Which topics to take; all of that type by default.
    min_score : float
        Detections whose best score is lower do not count.
    names : mapping of str to str, optional
        What the classes of the detector are called here; others keep their id.
    together_s : float
        Length of an observation, positive.

    Raises
    ------
    LogError
        The bag cannot be read, has no such topic, or does not say what its messages hold.
    InputError
        The extra ``bags`` is not installed.
    """
    if not together_s > 0:
        raise LogError(f"together_s must be a positive time in seconds, got {together_s}")
    observations: dict[int, dict[str, dict[str, int]]] = {}
    with open_bag(path) as bag:
        chosen = _connections(path, bag, topics)
        for connection, recorded_ns, raw in bag.messages(connections=chosen):
            message = _message(path, bag, connection, raw)
            slot = int(stamp_s(message, recorded_ns) // together_s)
            counted = _count(message, min_score, names or {})
            observations.setdefault(slot, {})[connection.topic] = counted
    return _gathered(observations, together_s)


def _connections(path: Path | str, bag: Any, topics: Sequence[str]) -> list[Any]:
    there = [item for item in bag.connections if item.msgtype in KINDS]
    listed = ", ".join(sorted({item.topic for item in there})) or "none"
    missing = sorted(set(topics) - {item.topic for item in there})
    if missing or not there:
        wanted = f"the topic {missing[0]}" if missing else "a topic"
        raise LogError(f"{path} lacks {wanted} of type {KINDS[0]}; topics of that type: {listed}")
    return [item for item in there if not topics or item.topic in topics]


def _message(path: Path | str, bag: Any, connection: Any, raw: bytes) -> Any:
    try:
        return bag.deserialize(raw, connection.msgtype)
    except KeyError:
        raise LogError(
            f"{path} does not define {connection.msgtype}, as is common in older sqlite3 bags; "
            "convert it to MCAP with 'ros2 bag convert'"
        ) from None


def _count(message: Any, min_score: float, names: Mapping[str, str]) -> dict[str, int]:
    counted: dict[str, int] = {}
    for detection in message.detections:
        # ROS 1 and early ROS 2 have id and score in the result itself, later ones a level below.
        results = [getattr(result, "hypothesis", result) for result in detection.results]
        if not results:
            continue
        best = max(results, key=lambda result: result.score)
        if best.score < min_score:
            continue
        code = str(best.class_id if hasattr(best, "class_id") else best.id)
        name = names.get(code, code)
        counted[name] = counted.get(name, 0) + 1
    return counted


def _gathered(
    observations: Mapping[int, Mapping[str, Mapping[str, int]]], together_s: float
) -> ObjectCounts:
    names = sorted({n for by in observations.values() for found in by.values() for n in found})
    counts = np.zeros((len(observations), len(names)), np.int64)
    slots = sorted(observations)
    for row, slot in enumerate(slots):
        for found in observations[slot].values():
            for name, count in found.items():
                counts[row, names.index(name)] += count
    times = (np.array(slots, np.float64) + 0.5) * together_s
    return ObjectCounts(times, counts, tuple(names))
