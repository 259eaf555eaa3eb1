"""Reading object counts: CSV and JSON files, and detections in ROS bags."""

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import plain_names
from pgm_places.errors import LogError, escape_control, quoted
from pgm_places.features.object_counts import MOST, ObjectCounts
from pgm_places.io.csv_table import MAX_VALUES, open_table
from pgm_places.io.input_file import read_json, user_path
from pgm_places.io.logs.bag_access import open_bag, stamp_s
from pgm_places.options import Positive, check_option

TIME = "t_s"
MAX_CSV_BYTES, MAX_JSON_BYTES = 256 << 20, 32 << 20
_WANTED = "counts of objects (CSV or JSON)"


def read_object_counts(path: Path | str) -> ObjectCounts:
    """The counts in a CSV or JSON file.

    CSV has a header: the column ``t_s``, seconds, and a column per class of objects. JSON is a
    list of records such as ``{"t_s": 12.3, "counts": {"coffee machine": 1}}``; classes that a
    record does not name count 0. Times are on the clock of the log.

    Raises
    ------
    LogError
        The file is missing, too large or of another format, or a value is not a time or a count.
    """
    source = user_path(path, LogError)
    if source.suffix.lower() == ".json":
        return _from_json(source)
    return _from_csv(source)


def _from_csv(source: Path) -> ObjectCounts:
    with open_table(source, LogError, _WANTED, max_bytes=MAX_CSV_BYTES) as table:
        time = table.index(TIME)
        if time is None or len(table.names) < 2:
            raise LogError(
                f"{source}: the header must name {TIME} and at least one class of objects, got "
                f"{quoted(table.names)}"
            )
        others = [column for column in range(len(table.names)) if column != time]
        numbers, _ = table.read([time, *others])
    names = tuple(table.names[column] for column in others)
    return _checked(f"{source}, row", names, numbers[:, 0], numbers[:, 1:])


def _from_json(source: Path) -> ObjectCounts:
    content = read_json(source, LogError, _WANTED, max_bytes=MAX_JSON_BYTES)
    shape = f'a list of records such as {{"{TIME}": 12.3, "counts": {{"coffee machine": 1}}}}'
    if not isinstance(content, list):
        raise LogError(f"{source} must hold {shape}, got {type(content).__name__}")
    columns: dict[str, int] = {}
    for row_number, record in enumerate(content, start=1):
        counts = record.get("counts") if isinstance(record, dict) else None
        if not isinstance(counts, dict) or TIME not in record:
            raise LogError(
                f"{source}, record {row_number}: the file must hold {shape}, got {quoted(record)}"
            )
        for name in counts:
            columns.setdefault(name, len(columns))
    if len(content) * len(columns) > MAX_VALUES:
        raise LogError(
            f"{source} has {len(content)} records and {len(columns)} classes: more than "
            f"{MAX_VALUES} values; split it"
        )
    times, table = np.zeros(len(content)), np.zeros((len(content), len(columns)))
    for row, record in enumerate(content):
        where = f"{source}, record {row + 1}"
        times[row] = _number(where, TIME, record[TIME])
        for name, value in record["counts"].items():
            table[row, columns[name]] = _number(where, name, value)
    return _checked(f"{source}, record", tuple(columns), times, table)


def _checked(
    where: str, names: tuple[str, ...], times: NDArray[np.float64], values: NDArray[np.float64]
) -> ObjectCounts:
    plain_names(f"{where}s: classes of objects", names, LogError)
    wrong = np.argwhere((values < 0) | (values >= MOST) | (values != np.floor(values)))
    if len(wrong):
        row, column = wrong[0]
        raise LogError(
            f"{where} {row + 1}: {names[column]} must be a whole number from 0 to {MOST - 1}, got "
            f"{values[row, column]:g}"
        )
    return ObjectCounts(times, values.astype(np.int64), names)


def _number(where: str, name: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise LogError(
            f"{where}: {escape_control(name)} must be a finite number, got {quoted(value)}"
        )
    return float(value)


KINDS = ("vision_msgs/msg/Detection2DArray",)


def read_detection_bag(
    path: Path | str,
    *,
    topics: Sequence[str] = (),
    min_score: float = 0.5,
    names: Mapping[str, str] | None = None,
    together_s: float = 0.5,
) -> ObjectCounts:
    """Detections counted by class: each by its best hypothesis, if its score is high enough.

    Several cameras form one panorama: messages of all topics whose stamps are within the same
    ``together_s`` seconds are added up, only the last message of each topic.

    Parameters
    ----------
    path : path
        A ROS 1 bag, a ROS 2 bag (sqlite3 or MCAP).
    topics : sequence of str, optional
        Topics to read; all of the type by default.
    min_score : float
        Detections with a lower best score are ignored.
    names : mapping of str to str, optional
        Names of the detector's classes; other classes keep their id.
    together_s : float
        Length of an observation, positive.

    Raises
    ------
    LogError
        The bag cannot be read, lacks the topic, or does not define its messages.
    InputError
        The extra ``bags`` is not installed.
    """
    check_option("together_s", Positive, together_s)
    observations: dict[int, dict[str, Counter[str]]] = {}
    with open_bag(path) as bag:
        chosen = _connections(path, bag, topics)
        for connection, recorded_ns, raw in bag.messages(connections=chosen):
            message = _message(path, bag, connection, raw)
            slot = int(stamp_s(message, recorded_ns) // together_s)
            counted = _count(message, min_score, names or {})
            observations.setdefault(slot, {})[connection.topic] = counted
    return _gathered(observations, together_s)


def _connections(path: Path | str, bag: Any, topics: Sequence[str]) -> list[Any]:
    there = [connection for connection in bag.connections if connection.msgtype in KINDS]
    listed = ", ".join(sorted({connection.topic for connection in there})) or "none"
    missing = sorted(set(topics) - {connection.topic for connection in there})
    if missing or not there:
        wanted = f"the topic {missing[0]}" if missing else "a topic"
        raise LogError(f"{path} lacks {wanted} of type {KINDS[0]}; topics of that type: {listed}")
    return [connection for connection in there if not topics or connection.topic in topics]


def _message(path: Path | str, bag: Any, connection: Any, raw: bytes) -> Any:
    try:
        return bag.deserialize(raw, connection.msgtype)
    except KeyError:
        raise LogError(
            f"{path} does not define {connection.msgtype}, as is common in older sqlite3 bags; "
            "convert it to MCAP with 'ros2 bag convert'"
        ) from None


def _count(message: Any, min_score: float, names: Mapping[str, str]) -> Counter[str]:
    counted: Counter[str] = Counter()
    for detection in message.detections:
        # ROS 1 and early ROS 2 have id and score in the result itself, later ones a level below.
        results = [getattr(result, "hypothesis", result) for result in detection.results]
        if not results:
            continue
        best = max(results, key=lambda result: result.score)
        if best.score < min_score:
            continue
        code = str(best.class_id if hasattr(best, "class_id") else best.id)
        counted[names.get(code, code)] += 1
    return counted


def _gathered(
    observations: Mapping[int, Mapping[str, Counter[str]]], together_s: float
) -> ObjectCounts:
    slots = sorted(observations)
    totals = [sum(observations[slot].values(), Counter[str]()) for slot in slots]
    names = sorted(set().union(*totals))
    counts = np.array([[total[name] for name in names] for total in totals], np.int64)
    counts = counts.reshape(len(slots), len(names))
    times = (np.array(slots, np.float64) + 0.5) * together_s
    return ObjectCounts(times, counts, tuple(names))
