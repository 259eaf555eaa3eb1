"""Labelling a batch of maps: tasks for workers, and the index of their outcomes."""

import time
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pgm_places.batch import batch_folder
from pgm_places.batch.batch_index import BatchIndex, index_of
from pgm_places.batch.found_maps import FoundMap, FoundMaps, Shard
from pgm_places.batch.limits import TimeIsUpError
from pgm_places.batch.local_workers import Fault, Unfinished, Workers
from pgm_places.batch.map_task import (
    ClaimedByOther,
    Failure,
    LabelledRow,
    MapTask,
    NoSpaceError,
    Outcome,
)
from pgm_places.batch.overview import Overview
from pgm_places.batch.remote_maps import done_rows, is_visible, label_anywhere
from pgm_places.errors import InputError, OutputError
from pgm_places.io.input_file import is_address
from pgm_places.io.output_set import claim
from pgm_places.io.remote_files import shown_path
from pgm_places.io.staging import claimed
from pgm_places.labelling.model import LoadedModel
from pgm_places.labelling.options import LabelOptions
from pgm_places.progress import Progress, duration

_LOOK_AGAIN_S = 1.0
"""Seconds between checks whether another batch has released a map."""

_MOST_FAILURES = 5
"""Number of failed maps listed by the command."""


@dataclass(frozen=True)
class LabelledBatch:
    """The result of a batch: numbers of maps of this run, and sums over the output folder."""

    n_labelled: int
    n_skipped: int
    n_failed: int
    overview: Overview
    written: tuple[str, ...]
    failures: tuple[Failure, ...]

    def summary(self) -> str:
        """One line with the counts of labelled, skipped and failed maps."""
        counts = {
            "labelled": self.n_labelled,
            "already done": self.n_skipped,
            "failed": self.n_failed,
        }
        return _counted(counts)


def _counted(counts: Mapping[str, int]) -> str:
    """A line such as "12 maps: 9 labelled, 3 failed"; the first count is always shown."""
    n_all = sum(counts.values())
    listed = [f"{n:,} {words}" for k, (words, n) in enumerate(counts.items()) if n or not k]
    return f"{n_all:,} map{'' if n_all == 1 else 's'}: {', '.join(listed)}"


def maps_to_do(
    found: FoundMaps, lists: BatchIndex, *, shard: Shard | None = None, only_failed: bool = False
) -> list[FoundMap]:
    """The maps of a shard; with ``only_failed``, only maps whose last run failed."""
    maps = [found_map for found_map in found.maps if shard is None or shard.has(found_map.name)]
    if only_failed:
        failed = lists.failed()
        maps = [found_map for found_map in maps if found_map.name in failed]
    return maps


def label_batch(
    found: FoundMaps,
    out: Path,
    options: LabelOptions,
    workers: Workers,
    *,
    n_threads: int = 1,
    force: bool = False,
    shard: Shard | None = None,
    only_failed: bool = False,
    limit_s: float | None = None,
    progress: Progress,
) -> LabelledBatch:
    """Label maps, each into its own folder below ``out``; maps already labelled are skipped.

    Several batches may write to one folder: maps claimed by another batch are checked again when
    it releases them. ``force`` overwrites files that pgm-places did not write or that were changed
    since; ``only_failed`` labels maps whose last run failed; ``limit_s`` limits each map;
    ``n_threads`` are those of each worker.
    """
    sha256 = LoadedModel.load(options).sha256
    tally = _Tally()
    with _lists(found, out, force=force) as lists:
        maps = maps_to_do(found, lists, shard=shard, only_failed=only_failed)
        tally.n_all = len(maps)
        refused = {failure.name: failure for failure in batch_folder.names_in_the_way(found.maps)}
        for failure in (refused[found_map.name] for found_map in maps if found_map.name in refused):
            tally.count(failure)
            lists.add(failure)
        target = out if is_address(out) else lists.out
        tasks: Iterable[MapTask] = (
            MapTask(
                found_map.name,
                found_map.path,
                target / found_map.name,
                options,
                sha256,
                n_threads,
                force,
                None if is_address(out) else batch_folder.claim_of(target, found_map.name),
                limit_s,
            )
            for found_map in maps
            if found_map.name not in refused
        )
        with progress.stage("labelling maps") as stage:
            if is_address(out) or is_address(found.root / "any"):
                tasks = list(_not_done(tasks, tally, lists))
            outcomes = _outcomes(tasks, workers, tally, limit_s, _Judge(progress))
            with closing(outcomes):  # stop workers immediately, also on errors
                for outcome in outcomes:
                    tally.count(outcome)
                    lists.add(outcome)
                    stage.update(tally.share, tally.note())
        overview = lists.end()
        written = tuple(f"{shown_path(out)}/{path.name}" for path in lists.files())
    return LabelledBatch(
        tally.n_labelled,
        tally.n_skipped,
        tally.n_failed,
        overview,
        written,
        tuple(tally.failures),
    )


@contextmanager
def _lists(found: FoundMaps, out: Path, *, force: bool) -> Iterator[BatchIndex]:
    """The index of a local or remote folder, which is claimed by this run."""
    names = (found_map.name for found_map in found.maps)
    target = out if is_address(out) else claim(out, force=force).absolute()
    batch_folder.write_root(target, found.root)
    with ExitStack() as ends:
        if not is_address(out):
            batch_folder.remove_crash_leftovers(target)
            ends.callback(batch_folder.remove_crash_leftovers, target)
        lists = ends.enter_context(index_of(target, names))
        lists.begin(force=force)
        yield lists


class _Judge:
    """Distinguishes faults of a cluster's worker from faults of a map."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress

    def fault(self, task: MapTask, result: object, worker: str) -> Fault | None:
        """See :class:`pgm_places.batch.local_workers.Judge`."""
        where = f"worker {worker}"
        if isinstance(result, NoSpaceError | InputError):
            kind = NoSpaceError if isinstance(result, NoSpaceError) else InputError
            return Fault(kind(f"{result} ({where})"), is_certain=True)
        if isinstance(result, Failure) and result.of_worker:
            return Fault(replace(result, message=f"{result.message} ({where})"))
        if isinstance(result, LabelledRow) and not is_visible(task):
            message = (
                f"{shown_path(task.folder)}: {where} labelled the map, but its result does not "
                "exist here; mount the output folder on the worker"
            )
            return Fault(task.failure(OutputError(message)))
        return None

    def left_out(self, worker: str, result: Any) -> None:
        """See :class:`pgm_places.batch.local_workers.Judge`."""
        message = result.message if isinstance(result, Failure) else str(result)
        self._progress.warn(f"worker {worker} is excluded from this run: {message}")


def _not_done(tasks: Iterable[MapTask], tally: "_Tally", lists: BatchIndex) -> Iterator[MapTask]:
    """The tasks of unlabelled maps; adds the rows of labelled ones to the index."""
    for task, row in done_rows(tasks):
        if row is None:
            yield task
        else:
            tally.count(row)
            lists.add(row)


def _outcomes(
    tasks: Iterable[MapTask],
    workers: Workers,
    tally: "_Tally",
    limit_s: float | None,
    judge: _Judge,
) -> Generator[LabelledRow | Failure, None, None]:
    """The outcome of each map; maps claimed by other processes come last."""
    while True:
        others: list[MapTask] = []
        tally.n_elsewhere = 0
        for task, result in workers.run(label_anywhere, tasks, limit_s=limit_s, judge=judge):
            outcome = _outcome(task, result)
            if isinstance(outcome, ClaimedByOther):
                others.append(task)
                tally.n_elsewhere = len(others)
            else:
                yield outcome
        if not others:
            return
        _wait_for_one(others)
        tasks = others


def _outcome(task: MapTask, result: Outcome | Unfinished | None) -> Outcome:
    """The outcome of a task, including crashes and timeouts."""
    if isinstance(result, Unfinished):
        return task.failure(TimeIsUpError())
    if result is None:
        died = "its worker was killed each time, probably for lack of memory"
        return task.failure(OutputError(f"{died}; use fewer --jobs or a coarser map"))
    return result


def _wait_for_one(tasks: Sequence[MapTask]) -> None:
    """Wait until a claim of one of the maps is released."""
    while True:
        for task in tasks:
            with claimed(task.claim) as is_free:
                if is_free:
                    return
        time.sleep(_LOOK_AGAIN_S)


class _Tally:
    """Progress of a batch: counts, rate and remaining time."""

    def __init__(self) -> None:
        self._start = time.monotonic()
        self.n_all = self.n_labelled = self.n_skipped = self.n_failed = self.n_elsewhere = 0
        self.failures = list[Failure]()  # the first ones, for the last message

    def count(self, outcome: LabelledRow | Failure) -> None:
        """Count the outcome of a map."""
        if isinstance(outcome, Failure):
            self.n_failed += 1
            self.failures += [outcome] if len(self.failures) < _MOST_FAILURES else []
        else:
            self.n_skipped += outcome.skipped
            self.n_labelled += not outcome.skipped

    @property
    def _n_done(self) -> int:
        return self.n_labelled + self.n_skipped + self.n_failed

    @property
    def share(self) -> float:
        """Share of finished maps."""
        return self._n_done / max(self.n_all, 1)

    def note(self) -> str:
        """Finished maps, rate of newly labelled maps, remaining time, and failures."""
        parts = [f"{self._n_done:,} of {self.n_all:,}"]
        worked = self._n_done - self.n_skipped
        seconds = time.monotonic() - self._start
        if worked and seconds > 0:
            rate = worked / seconds
            parts.append(f"{rate:.1f} maps/s" if rate >= 1 else f"{60 * rate:.1f} maps/min")
            parts.append(f"{duration((self.n_all - self._n_done) / rate)} left")
        parts += [f"{self.n_failed:,} failed"] if self.n_failed else []
        parts += [f"{self.n_elsewhere:,} left to another batch"] if self.n_elsewhere else []
        return "; ".join(parts)


@dataclass(frozen=True)
class Plan:
    """Names of maps to label, of those the ones that failed before, labelled and colliding ones."""

    to_label: tuple[str, ...]
    again: tuple[str, ...]
    done: tuple[str, ...]
    refused: tuple[str, ...]

    def summary(self) -> str:
        """One line."""
        named = {"to label": self.to_label, "already done": self.done, "refused": self.refused}
        counts = {words: len(names) for words, names in named.items()}
        return f"{_counted(counts)}; nothing was written"

    def lists(self) -> Iterator[tuple[str, Sequence[str]]]:
        """Titles and names of the non-empty groups, except maps done before."""
        titled = {
            "to label": self.to_label,
            "of these, failed before": self.again,
            "refused because of their names": self.refused,
        }
        yield from ((title, names) for title, names in titled.items() if names)


def plan(
    found: FoundMaps,
    out: Path,
    options: LabelOptions,
    *,
    shard: Shard | None = None,
    only_failed: bool = False,
) -> Plan:
    """What :func:`label_batch` would do with the maps, without writing anything."""
    sha256 = LoadedModel.load(options).sha256
    with index_of(out) as lists:
        lists.merge_others()
        failed = lists.failed()
        maps = maps_to_do(found, lists, shard=shard, only_failed=only_failed)
    in_the_way = {failure.name for failure in batch_folder.names_in_the_way(found.maps)}
    refused = [found_map.name for found_map in maps if found_map.name in in_the_way]
    tasks = (
        MapTask(found_map.name, found_map.path, out / found_map.name, options, sha256)
        for found_map in maps
        if found_map.name not in in_the_way
    )
    done: list[str] = []
    to_label: list[str] = []
    for task, row in done_rows(tasks):
        (to_label if row is None else done).append(task.name)
    again = tuple(name for name in to_label if name in failed)
    return Plan(tuple(to_label), again, tuple(done), tuple(refused))
