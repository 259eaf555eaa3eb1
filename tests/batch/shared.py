"""Workers and tables that tests of batches share."""

import csv
import io
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

from pgm_places.batch.label_batch import LabelledBatch
from pgm_places.batch.local_workers import LocalWorkers
from pgm_places.batch.map_task import LabelledRow
from tests.batch.tasks import hang_on

Batch = Callable[..., LabelledBatch]


class InProcessWorkers:
    """Workers that are this process."""

    def run(
        self, function: Callable[[Any], Any], tasks: Iterable[Any], **_: Any
    ) -> Iterator[tuple[Any, Any]]:
        return ((task, function(task)) for task in tasks)


class CrashingWorkers:
    """Workers that die on every task."""

    def run(
        self, function: Callable[[Any], Any], tasks: Iterable[Any], **_: Any
    ) -> Iterator[tuple[Any, Any]]:
        return ((task, None) for task in tasks)


class RecordingWorkers(InProcessWorkers):
    """This process, which remembers the maps that it labels."""

    def __init__(self) -> None:
        self.labelled: list[str] = []

    def run(
        self, function: Callable[[Any], Any], tasks: Iterable[Any], **_: Any
    ) -> Iterator[tuple[Any, Any]]:
        for done in super().run(function, tasks):
            if isinstance(done[1], LabelledRow) and not done[1].skipped:
                self.labelled.append(done[1].name)
            yield done


class Hanging(LocalWorkers):
    """Processes in which nothing of Python runs any more on one of the maps."""

    def run(self, function: Callable[[Any], Any], tasks: Iterable[Any], **more: Any) -> Any:
        return super().run(partial(hang_on, function, "floor1/map"), tasks, **more)


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def failures(folder: Path) -> dict[str, dict[str, str]]:
    path = folder / "failures.csv"
    return {row["name"]: row for row in rows(path)} if path.exists() else {}


def far_rows(bucket: Any, name: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(bucket.cat_file(f"/out/{name}").decode())))
