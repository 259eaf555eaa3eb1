"""Index of a batch: the table of all maps, the failures and the overview page."""

import heapq
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from functools import partial
from itertools import groupby, islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pgm_places.batch.append_only_csv import AppendOnlyCsv, Row, sort_key
from pgm_places.batch.map_task import Failure, LabelledRow
from pgm_places.batch.overview import PAGE_MARK, Overview, overview_page
from pgm_places.batch.remote_maps import RemoteIndex, remote_index
from pgm_places.errors import OutputError
from pgm_places.io.atomic import write_text
from pgm_places.io.input_file import is_address
from pgm_places.io.output_set import is_as_written
from pgm_places.io.places.result_folder import MANIFEST_FILE, detail_path
from pgm_places.io.remote_files import is_there
from pgm_places.io.staging import locked

SUMMARY_FILE, FAILURE_FILE, INDEX_FILE = "summary.csv", "failures.csv", "index.html"

LISTS = (INDEX_FILE, SUMMARY_FILE, FAILURE_FILE, "places.parquet")
"""Files of the index; no folder of a map may have these names."""

_FIRST = ("name", "map", "method", "places", "connections", "area_m2")
_LAST = ("doubt", "doubtful_m2", "check_first", "warnings", "seconds", "time", "in_input")
_FAILURE = ("name", "map", "error", "message", "time")
"""Columns of the failures; times are in UTC."""

_LEAST_PAUSE_S, _PAUSES = 30.0, 20
"""Rewrite the page after this time, and after this multiple of the time to write it."""


class BatchIndex:
    """The summary table, the table of failures and the overview page of a batch.

    Rows are appended at once, by any number of processes. Periodically and at the end, both tables
    are sorted and reduced to the newest row of each map, and the page is written. Without ``names``
    of input maps, every map whose file exists is input. ``out`` is the local copy of a ``remote``
    index.
    """

    def __init__(
        self, out: Path, names: Iterable[str] | None = None, remote: RemoteIndex | None = None
    ) -> None:
        self.out, self._remote = out, remote
        self._summary = AppendOnlyCsv(out / SUMMARY_FILE, _FIRST, _LAST)
        self._failures = AppendOnlyCsv(out / FAILURE_FILE, _FAILURE)
        self._input = None if names is None else _sorted_hashes(names)
        self._known = _sorted_hashes(())
        self._next_s, self._written_s = time.monotonic() + _LEAST_PAUSE_S, 0.0

    def begin(self, *, force: bool = False) -> None:
        """Read the existing index."""
        page = self.out / INDEX_FILE
        if page.exists() and not (force or is_as_written(page) or _is_page(page)):
            raise OutputError(
                f"{page}: pgm-places did not write it; move the file away, choose another folder, "
                "or pass --force to overwrite it"
            )
        for table in (self._summary, self._failures):
            table.check()
        self.merge_others()
        self.settle()
        rows = (row for table in (self._summary, self._failures) for row in table.rows())
        self._known = _sorted_hashes(map(_content, rows))

    def add(self, outcome: LabelledRow | Failure) -> None:
        """Append a row, unless it exists; rewrite the page if it is due."""
        if isinstance(outcome, LabelledRow):
            table, row, middle = self._summary, summary_row(outcome), _area_columns(outcome)
        else:
            values = (outcome.name, outcome.map, outcome.kind, outcome.message, _time(None))
            table, row, middle = self._failures, dict(zip(_FAILURE, values, strict=True)), ()
        if not _is_in(self._known, _content(row)):
            with locked(self.out):
                table.append(row, middle)
        if self._is_due():
            self.write_page(self.settle())

    def _is_due(self) -> bool:
        return time.monotonic() >= self._next_s

    def failed(self) -> dict[str, str]:
        """Names and files of the maps whose last run failed."""
        return {row["name"]: row["map"] for row in self._failures.rows()}

    def merge_others(self) -> None:
        """Merge new tables of other runs from the remote machine."""
        for folder in [] if self._remote is None else self._remote.others():
            theirs = BatchIndex(folder)
            with suppress(OutputError):  # tables of another version
                theirs._summary.check()
                theirs._failures.check()
                middle = dict.fromkeys((*self._summary.middle(), *theirs._summary.middle()))
                both = (
                    _tagged(table, is_row=is_row)
                    for index in (self, theirs)
                    for table, is_row in ((index._summary, True), (index._failures, False))
                )
                self._write(_merged(*both), tuple(middle), at_the_end=False)

    def write_page(self, overview: Overview) -> Path:
        """Write the page, and upload the index if the remote machine accepts it now; the path."""
        path = self._written_page(overview)
        if self._remote is not None:
            with suppress(OutputError):  # a busy server: retried later
                self._remote.put_tables(ended=False, patient=False)
                self._remote.put(patient=False)
        now = time.monotonic()
        took = now - self._written_s
        self._next_s = now + max(_LEAST_PAUSE_S, _PAUSES * took)
        return path

    def end(self, settle: Callable[[], Overview] | None = None) -> Overview:
        """Write the final index; ``settle`` sorts the tables, by default :meth:`settle`."""
        settle = settle or partial(self.settle, at_the_end=True)
        overview = settle()
        self._written_page(overview)
        if self._remote is None or self._remote.is_unchanged:
            return overview
        self._remote.put_tables(ended=True)  # before looking for the tables of other runs
        while True:
            self.merge_others()
            overview = settle()
            self._written_page(overview)
            self._remote.put()
            if not self._remote.has_others():
                break
        self._remote.put_tables(ended=True)
        self._remote.remove_merged()
        return overview

    def _written_page(self, overview: Overview) -> Path:
        here = None if self._remote else self.out
        return write_text(self.out / INDEX_FILE, overview_page(overview, here))

    def files(self) -> list[Path]:
        """The index files that exist."""
        paths = (self.out / name for name in (FAILURE_FILE, INDEX_FILE, SUMMARY_FILE))
        return [path for path in paths if path.exists()]

    def settle(self, *, at_the_end: bool = False) -> Overview:
        """Sort and count the newest rows of each map; at the end, drop rows of removed maps."""
        self._written_s = time.monotonic()
        with locked(self.out):
            both = _tagged(self._summary, is_row=True), _tagged(self._failures, is_row=False)
            return self._write(_merged(*both), self._summary.middle(), at_the_end=at_the_end)

    def rebuild(self, rows: Callable[[], Iterable[tuple[LabelledRow, float]]]) -> Overview:
        """Rewrite the tables from rows sorted by name, each with its time."""
        labels = dict.fromkeys(self._summary.middle())
        while True:
            try:
                with locked(self.out):
                    made = (
                        (True, summary_row(row, when)) for row, when in _of_labels(rows(), labels)
                    )
                    newest = _merged(made, _tagged(self._failures, is_row=False))
                    return self._write(newest, tuple(labels), at_the_end=True)
            except _FurtherLabelError as error:
                labels |= dict.fromkeys(error.columns)

    def _write(
        self, newest: Iterable[tuple[bool, Row]], middle: Sequence[str], *, at_the_end: bool
    ) -> Overview:
        overview, n_failures = Overview(tuple(name.removesuffix("_m2") for name in middle)), 0
        with (
            self._summary.replaced(middle) as write_row,
            self._failures.replaced(()) as write_failure,
        ):
            for is_row, row in newest:
                if at_the_end and not self._stays(row, is_row=is_row):
                    continue
                (write_row if is_row else write_failure)(row)
                (overview.count if is_row else overview.count_failure)(row)
                n_failures += not is_row
        if not n_failures:
            self._failures.path.unlink(missing_ok=True)
        return overview

    def _stays(self, row: Row, *, is_row: bool) -> bool:
        """Whether a row is still valid; sets its column ``in_input``."""
        is_input = self._input is not None and _is_in(self._input, row["name"])
        if self._remote is not None or is_address(row["map"]):  # a request per map would be slow
            is_input = is_input or self._input is None
            if is_row:
                row["in_input"] = "yes" if is_input else "no"
            return is_row or is_input or is_there(row["map"])
        exists = is_input or Path(row["map"]).exists()
        if not is_row:
            return exists
        row["in_input"] = "yes" if exists else "no"
        return is_input or detail_path(self.out / row["name"], MANIFEST_FILE).exists()


@contextmanager
def index_of(out: Path, names: Iterable[str] | None = None) -> Iterator[BatchIndex]:
    """The index of a local folder, or of a remote one through a local copy."""
    if not is_address(out):
        yield BatchIndex(out, names)
        return
    with remote_index(out, LISTS, (SUMMARY_FILE, FAILURE_FILE)) as remote:
        yield BatchIndex(remote.here, names, remote)


class _FurtherLabelError(Exception):
    """A row has a label column that the table lacks."""

    def __init__(self, columns: Sequence[str]) -> None:
        super().__init__()
        self.columns = columns


def _of_labels(
    rows: Iterable[tuple[LabelledRow, float]], columns: Iterable[str]
) -> Iterator[tuple[LabelledRow, float]]:
    """The rows; raises :class:`_FurtherLabelError` at the first label without a column."""
    known = set(columns)
    for row, when in rows:
        if not known.issuperset(_area_columns(row)):
            raise _FurtherLabelError(_area_columns(row))
        yield row, when


def summary_row(row: LabelledRow, when: float | None = None) -> Row:
    """A row of the summary table.

    Columns: ``name``, ``map``, ``method``, ``places``, ``connections``, ``area_m2``, the area of
    each label, ``doubt`` (expected share of wrongly labelled area), ``doubtful_m2``,
    ``check_first`` (the place with most of this area), ``warnings`` (their number), ``seconds``,
    ``time`` (UTC), and ``in_input`` (``no`` if the map was removed from the input).
    """
    known = row.doubt is not None
    return {
        "name": row.name,
        "map": row.map,
        "method": row.method,
        "places": str(row.n_places),
        "connections": str(row.n_connections),
        "area_m2": f"{row.total_m2:.3f}",
        **{f"{label}_m2": f"{area:.3f}" for label, area in row.area_m2.items()},
        "doubt": f"{row.doubt:.4f}" if known else "",
        "doubtful_m2": f"{(row.doubt or 0.0) * row.total_m2:.3f}" if known else "",
        "check_first": row.check_first,
        "warnings": str(len(row.warnings)),
        "seconds": f"{row.seconds:.3f}",
        "time": _time(when),
        "in_input": "yes",
    }


def _area_columns(row: LabelledRow) -> tuple[str, ...]:
    return tuple(f"{label}_m2" for label in row.area_m2)


def _time(when: float | None) -> str:
    moment = datetime.now(UTC) if when is None else datetime.fromtimestamp(when, UTC)
    # A small map can fail and be labelled within the same second; the order must be visible.
    return moment.isoformat(timespec="milliseconds").replace("+00:00", "Z")


def _tagged(table: AppendOnlyCsv, *, is_row: bool) -> Iterator[tuple[bool, Row]]:
    """The rows of a table, sorted; only rows out of order are held in memory."""
    last: tuple[str, ...] = ()
    n_sorted, others = 0, list[tuple[bool, Row]]()
    for row in table.rows():
        key = sort_key(row["name"])
        if others or key <= last:
            others.append((is_row, row))
        else:
            n_sorted, last = n_sorted + 1, key
    others.sort(key=_key)
    first = ((is_row, row) for row in islice(table.rows(), n_sorted))
    return heapq.merge(first, others, key=_key)


def _merged(*tables: Iterable[tuple[bool, Row]]) -> Iterator[tuple[bool, Row]]:
    """The newest row of each map; at equal times results before failures, then the later row."""
    for _, rows in groupby(heapq.merge(*tables, key=_key), key=_key):
        *earlier, newest = rows
        for row in reversed(earlier):
            if (row[1]["time"], row[0]) > (newest[1]["time"], newest[0]):
                newest = row
        yield newest


def _key(tagged: tuple[bool, Row]) -> tuple[str, ...]:
    return sort_key(tagged[1]["name"])


def _content(row: Row) -> tuple[str, ...]:
    """The values of a row that do not depend on the time of the run."""
    return tuple(value for name, value in row.items() if name not in ("time", "in_input") and value)


def _sorted_hashes(keys: Iterable[object]) -> NDArray[np.int64]:
    """Sorted hashes, a compact set: eight bytes per key instead of hundreds."""
    return np.sort(np.fromiter(map(hash, keys), np.int64))


def _is_in(hashes: NDArray[np.int64], key: object) -> bool:
    wanted = hash(key)
    at = int(np.searchsorted(hashes, wanted))
    return at < len(hashes) and int(hashes[at]) == wanted


def _is_page(path: Path) -> bool:
    with path.open("rb") as file:
        return PAGE_MARK in file.read(1 << 16)
