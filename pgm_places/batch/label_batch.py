"""Labelling many maps: tasks for workers, and the files that list what became of them."""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from pgm_places.batch.found_maps import FoundMap
from pgm_places.batch.label_options import LabelOptions
from pgm_places.batch.map_task import MapTask, label_one
from pgm_places.batch.outcomes import Failure, LabelledRow, Outcome
from pgm_places.batch.overview_files import OVERVIEW, write_overview
from pgm_places.batch.ready_model import ready_model
from pgm_places.batch.workers import Workers
from pgm_places.errors import OutputError
from pgm_places.io.output_set import claim, output_set
from pgm_places.progress import Progress

__all__ = ["LabelledBatch", "duration", "label_batch"]


@dataclass(frozen=True)
class LabelledBatch:
    """What became of many maps.

    Parameters
    ----------
    rows : tuple of LabelledRow
        The maps that are labelled, by name.
    failures : tuple of Failure
        Those that could not be, by name.
    written : tuple of Path
        The files that list them all.
    """

    rows: tuple[LabelledRow, ...]
    failures: tuple[Failure, ...]
    written: tuple[Path, ...]

    def summary(self) -> str:
        """One line: how many maps were labelled, had been before, and failed."""
        n_kept = sum(row.kept for row in self.rows)
        n_all = len(self.rows) + len(self.failures)
        parts = [f"{len(self.rows) - n_kept:,} labelled"]
        parts += [f"{n_kept:,} done before"] if n_kept else []
        parts += [f"{len(self.failures):,} failed"] if self.failures else []
        return f"{n_all:,} map{'' if n_all == 1 else 's'}: {', '.join(parts)}"


def label_batch(
    maps: Sequence[FoundMap],
    out: Path,
    options: LabelOptions,
    workers: Workers,
    *,
    n_threads: int = 1,
    force: bool = False,
    progress: Progress,
) -> LabelledBatch:
    """Label maps, each into a folder of its own below ``out``; those that are done are kept.

    Raises
    ------
    OutputError
        The folder cannot be written, or the disk is full. The maps that are done stay.
    InputError
        The model is refused, or there are no workers.
    """
    sha256 = ready_model(options).sha256
    target = claim(out, force=force).absolute()
    _refuse_names_of_files(maps, out)
    tasks = [
        MapTask(item.name, item.path, target / item.name, options, sha256, n_threads, force)
        for item in maps
    ]
    outcomes = sorted(_outcomes(tasks, workers, progress), key=lambda item: item.name)
    rows = tuple(item for item in outcomes if isinstance(item, LabelledRow))
    failures = tuple(item for item in outcomes if isinstance(item, Failure))
    with output_set(out, "label maps", names=OVERVIEW, force=force, shared=True) as files:
        write_overview(files.stage, rows, failures)
    return LabelledBatch(rows, failures, tuple(files.written))


def _refuse_names_of_files(maps: Sequence[FoundMap], out: Path) -> None:
    taken = {name.casefold() for name in OVERVIEW}
    for item in maps:
        if item.name.casefold() in taken:
            raise OutputError(
                f"{item.path}: its folder would be {out / item.name}, which is reserved for the "
                "list of all maps; rename the map"
            )


def _outcomes(tasks: Sequence[MapTask], workers: Workers, progress: Progress) -> Iterator[Outcome]:
    tally = _Tally(len(tasks))
    with progress.stage("labelling maps") as stage:
        for task, result in workers.run(label_one, tasks):
            outcome = task.failure(_dead()) if result is None else result
            tally.count(outcome)
            stage.update(tally.share, tally.note())
            yield outcome


def _dead() -> OutputError:
    return OutputError(
        "its worker died each time: probably killed for memory; use fewer --jobs or a coarser map"
    )


class _Tally:
    """How far a batch is, how fast, and how long it will take."""

    def __init__(self, n_all: int) -> None:
        self._n_all, self._start = n_all, time.monotonic()
        self._n_done = self._n_kept = self._n_failed = 0

    def count(self, outcome: Outcome) -> None:
        """Take note of a map."""
        self._n_done += 1
        self._n_failed += isinstance(outcome, Failure)
        self._n_kept += isinstance(outcome, LabelledRow) and outcome.kept

    @property
    def share(self) -> float:
        """Of the maps that are done."""
        return self._n_done / max(self._n_all, 1)

    def note(self) -> str:
        """Maps, their rate without those that were done before, time left, and failures."""
        parts = [f"{self._n_done:,} of {self._n_all:,}"]
        worked = self._n_done - self._n_kept
        seconds = time.monotonic() - self._start
        if worked and seconds > 0:
            rate = worked / seconds
            parts.append(f"{rate:.1f} maps/s" if rate >= 1 else f"{60 * rate:.1f} maps/min")
            parts.append(f"{duration((self._n_all - self._n_done) / rate)} left")
        parts += [f"{self._n_failed:,} failed"] if self._n_failed else []
        return "; ".join(parts)


def duration(seconds: float) -> str:
    """A time as people say it.

    Examples
    --------
    >>> duration(42), duration(600), duration(9000)
    ('42 s', '10 min', '2.5 h')
    """
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
