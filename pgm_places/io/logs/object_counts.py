"""Counts of objects from other programs: CSV and JSON files."""

import csv
import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pgm_places.errors import LogError
from pgm_places.io.text_file import read_text
from pgm_places.vision.detector import MOST
from pgm_places.vision.object_counts import ObjectCounts

__all__ = ["read_object_counts"]

TIME = "t_s"
MAX_BYTES = 256 << 20


def read_object_counts(path: Path | str) -> ObjectCounts:
    """The counts in a CSV or JSON file.

    CSV has a heading: the column ``t_s``, seconds, and a column per class of objects. JSON is a
    list of records such as ``{"t_s": 12.3, "counts": {"coffee machine": 1}}``; classes that a
    record does not name count 0. Times are on the clock of the log that they go with.

    Raises
    ------
    LogError
        The file is missing, too large or something else, or a value is not a time or a count.
    """
    source = Path(path)
    text = read_text(source, LogError, "counts of objects (CSV or JSON)", max_bytes=MAX_BYTES)
    if source.suffix.lower() == ".json":
        return _from_json(source, text)
    return _from_csv(source, text)


def _from_csv(source: Path, text: str) -> ObjectCounts:
    rows = [row for row in csv.reader(io.StringIO(text, newline=None)) if row]
    heading = [name.strip() for name in rows[0]] if rows else []
    if TIME not in heading or len(heading) < 2:
        raise LogError(
            f"{source}: the heading must name {TIME} and at least one class of objects, got "
            f"{', '.join(heading) or 'nothing'}"
        )
    names = [name for name in heading if name != TIME]
    records: list[Mapping[str, Any]] = []
    for number, row in enumerate(rows[1:], start=1):
        if len(row) != len(heading):
            raise LogError(
                f"{source}, row {number} after the heading: {len(heading)} values were expected, "
                f"got {len(row)}"
            )
        records.append(dict(zip(heading, row, strict=True)))
    return _checked(source, names, [(r[TIME], {n: r[n] for n in names}) for r in records])


def _from_json(source: Path, text: str) -> ObjectCounts:
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise LogError(f"{source} is not JSON: {error}") from None
    shape = f'a list of records such as {{"{TIME}": 12.3, "counts": {{"coffee machine": 1}}}}'
    if not isinstance(content, list):
        raise LogError(f"{source} must hold {shape}, got {type(content).__name__}")
    rows: list[tuple[Any, Mapping[str, Any]]] = []
    names: dict[str, None] = {}
    for number, record in enumerate(content, start=1):
        counts = record.get("counts") if isinstance(record, dict) else None
        if not isinstance(counts, dict) or TIME not in record:
            raise LogError(f"{source}, record {number}: the file must hold {shape}, got {record!r}")
        names.update(dict.fromkeys(counts))
        rows.append((record[TIME], counts))
    return _checked(source, list(names), rows)


def _checked(
    source: Path, names: list[str], rows: list[tuple[Any, Mapping[str, Any]]]
) -> ObjectCounts:
    times = np.zeros(len(rows))
    counts = np.zeros((len(rows), len(names)), np.int64)
    for k, (time, found) in enumerate(rows):
        where = f"{source}, row {k + 1} after the heading"
        times[k] = _number(where, TIME, time)
        for name, value in found.items():
            count = _number(where, name, value)
            if not (0 <= count < MOST and count == int(count)):
                raise LogError(f"{where}: {name} must be a whole number from 0, got {value!r}")
            counts[k, names.index(name)] = int(count)
    return ObjectCounts(times, counts, tuple(names))


def _number(where: str, name: str, value: Any) -> float:
    try:
        number = float("nan") if isinstance(value, bool) else float(value)
    except (TypeError, ValueError):
        number = float("nan")
    if not np.isfinite(number):
        raise LogError(f"{where}: {name} must be a finite number, got {value!r}")
    return number
