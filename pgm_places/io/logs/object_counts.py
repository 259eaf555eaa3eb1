"""Counts of objects from other programs: CSV and JSON files."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import plain_names
from pgm_places.errors import LogError, printable, shown
from pgm_places.io.csv_table import MAX_VALUES, open_table
from pgm_places.io.input_file import user_path
from pgm_places.io.text_file import read_json
from pgm_places.vision.object_counts import MOST, ObjectCounts

TIME = "t_s"
MAX_CSV_BYTES, MAX_JSON_BYTES = 256 << 20, 32 << 20
_WANTED = "counts of objects (CSV or JSON)"


def read_object_counts(path: Path | str) -> ObjectCounts:
    """The counts in a CSV or JSON file.

    CSV has a header: the column ``t_s``, seconds, and a column per class of objects. JSON is a
    list of records such as ``{"t_s": 12.3, "counts": {"coffee machine": 1}}``; classes that a
    record does not name count 0. Times are on the clock of the log that they go with.

    Raises
    ------
    LogError
        The file is missing, too large or something else, or a value is not a time or a count.
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
                f"{shown(table.names)}"
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
    for number, record in enumerate(content, start=1):
        counts = record.get("counts") if isinstance(record, dict) else None
        if not isinstance(counts, dict) or TIME not in record:
            raise LogError(
                f"{source}, record {number}: the file must hold {shape}, got {shown(record)}"
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


def _number(where: str, name: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise LogError(f"{where}: {printable(name)} must be a finite number, got {shown(value)}")
    return float(value)
