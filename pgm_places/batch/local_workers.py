"""Worker processes of this machine, each of which may die without harm to the others."""

import queue
import threading
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import closing
from dataclasses import dataclass
from typing import Any, TypeVar

from pgm_places.batch.own_process import OwnProcess, start_trackers

Task = TypeVar("Task")


@dataclass(frozen=True)
class LocalWorkers:
    """Processes of joblib's loky, restarted where one dies.

    Each process is an executor of its own: when it dies, it is known which task it had, and no
    other task is lost.

    Parameters
    ----------
    n_jobs : int
        Number of processes.
    n_threads : int
        Threads that numerical libraries may use in each.
    memory_bytes : int, optional
        What each may take.
    """

    n_jobs: int
    n_threads: int = 1
    memory_bytes: int | None = None

    def run(
        self,
        function: Callable[[Task], Any],
        tasks: Iterable[Task],
        *,
        limit_s: float | None = None,
    ) -> Generator[tuple[Any, Any], None, None]:
        """The tasks with their results: see :class:`pgm_places.batch.workers.Workers`."""
        start_trackers()
        lanes = _Lanes(self, function, iter(tasks), limit_s)
        with warnings.catch_warnings(), closing(lanes):
            # loky renews a process that has grown, between two tasks, and warns of it.
            warnings.filterwarnings("ignore", message="A worker stopped while some jobs were given")
            yield from lanes.done()


class _Lanes:
    """A thread per process, which hands it one task after the other."""

    def __init__(
        self,
        workers: LocalWorkers,
        function: Callable[[Any], Any],
        tasks: Iterator[Any],
        limit_s: float | None,
    ) -> None:
        self._function, self._tasks, self._limit_s = function, tasks, limit_s
        self._lock, self._stopped = threading.Lock(), False
        self._ended: queue.SimpleQueue[tuple[Any, Any] | BaseException | None] = queue.SimpleQueue()
        self._processes = [
            OwnProcess(workers.n_threads, workers.memory_bytes) for _ in range(workers.n_jobs)
        ]
        self._threads = [
            threading.Thread(target=self._lane, args=(process,), daemon=True)
            for process in self._processes
        ]

    def done(self) -> Iterator[tuple[Any, Any]]:
        """The tasks as they end; the first exception is raised."""
        for thread in self._threads:
            thread.start()
        running = len(self._threads)
        while running:
            ended = self._ended.get()
            if ended is None:
                running -= 1
            elif isinstance(ended, BaseException):
                raise ended
            else:
                yield ended

    def close(self) -> None:
        """End the processes, whatever they are doing."""
        with self._lock:
            self._stopped = True
        for process in self._processes:
            process.end()

    def _lane(self, process: OwnProcess) -> None:
        try:
            while (task := self._next()) is not self:
                self._ended.put((task, process.result(self._function, task, self._limit_s)))
        except BaseException as error:  # noqa: BLE001  it is raised where the results are read
            self._ended.put(error)
        finally:
            self._ended.put(None)

    def _next(self) -> Any:
        """The next task; this object itself when there is none."""
        with self._lock:
            return self if self._stopped else next(self._tasks, self)
