"""Append-only CSV table, written by several processes and sorted later."""

import csv
import io
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TypeAlias

from pgm_places.errors import OutputError
from pgm_places.io.atomic import atomic_file
from pgm_places.io.csv_table import csv_text
from pgm_places.io.output_set import is_as_written
from pgm_places.io.staging import as_output_errors

Row: TypeAlias = dict[str, str]
"""Values by column; one column is ``name``."""


class AppendOnlyCsv:
    """A CSV table with fixed columns at both ends and a growing set of columns in the middle.

    Appending and replacing hold a lock. An incomplete last line, as after a power cut, is dropped.
    """

    def __init__(self, path: Path, first: Sequence[str], last: Sequence[str] = ()) -> None:
        self.path, self._first, self._last = path, tuple(first), tuple(last)

    def check(self) -> None:
        """Check the columns of an existing file; a table of an earlier version is removed."""
        header = self._header()
        if header is None:
            return
        n_first, n_last = len(self._first), len(self._last)
        if header[:n_first] == self._first and header[len(header) - n_last :] == self._last:
            return
        if not is_as_written(self.path):
            raise OutputError(
                f"{self.path}: not a table of labelled maps; move the file away, or choose another "
                "folder"
            )
        self.path.unlink()

    def append(self, row: Mapping[str, str], middle: Sequence[str] = ()) -> None:
        """Append a row; ``middle`` are its columns between the first and the last."""
        with as_output_errors(self.path):
            header = self._header()
            if header is None or not set(middle) <= set(header):
                known = () if header is None else self._middle(header)
                more = [name for name in middle if name not in known]
                with self.replaced((*known, *more)) as write:
                    for before in self.rows():
                        write(before)
                header = self._header() or ()
            with self.path.open("r+b") as file:
                file.seek(_end_of_lines(file))
                file.truncate()
                file.write(_line(row.get(name, "") for name in header))

    def rows(self) -> Iterator[Row]:
        """The rows in file order; none without a file."""
        try:
            file = self.path.open(encoding="utf-8", errors="surrogateescape", newline="")
        except FileNotFoundError:
            return
        with file:
            complete = (line for line in file if line.endswith("\n"))
            for row in csv.DictReader(complete):
                if None not in row and None not in row.values():
                    yield row

    def middle(self) -> tuple[str, ...]:
        """The columns between the first and the last."""
        return self._middle(self._header() or ())

    @contextmanager
    def replaced(self, middle: Sequence[str]) -> Iterator[Callable[[Row], None]]:
        """Yield a writer of rows; the new table replaces this one after the block."""
        header = (*self._first, *middle, *self._last)
        with atomic_file(self.path) as temporary, temporary.open("wb") as file:
            file.write(_line(header))

            def write(row: Row) -> None:
                file.write(_line(row.get(name, "") for name in header))

            yield write

    def _header(self) -> tuple[str, ...] | None:
        try:
            with self.path.open(encoding="utf-8", errors="surrogateescape", newline="") as file:
                return tuple(next(csv.reader(file), ()))
        except FileNotFoundError:
            return None

    def _middle(self, header: Sequence[str]) -> tuple[str, ...]:
        return tuple(header[len(self._first) : len(header) - len(self._last)])


def sort_key(name: str) -> tuple[str, ...]:
    """Sort names folder by folder."""
    return tuple(name.split("/"))


def _line(values: Iterable[str]) -> bytes:
    return csv_text([values]).encode("utf-8", errors="surrogateescape")


def _end_of_lines(file: io.BufferedRandom) -> int:
    """Offset of the end of the last complete line."""
    end = file.seek(0, os.SEEK_END)
    while end:
        start = max(0, end - 4096)
        file.seek(start)
        newline = file.read(end - start).rfind(b"\n")
        if newline >= 0:
            return start + newline + 1
        end = start
    return 0
