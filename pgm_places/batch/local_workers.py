"""Worker processes of this machine, each of which may die without harm to the others."""

import os
import queue
import threading
import time
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import BrokenExecutor
from contextlib import closing, contextmanager
from dataclasses import dataclass
from typing import Any, TypeVar

from pgm_places.batch.worker_process import start_worker
from pgm_places.batch.workers import Done

__all__ = ["LocalWorkers"]

Task = TypeVar("Task")

_MOST_DEATHS = 3
"""A task that has taken so many processes with it is given up."""

_TAKEN_WITHIN_S = 2.0
"""A task is handed on within milliseconds; a machine that is slower than this may show an error."""

_LIBRARY_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

_SAFE_PATH = "PYTHONSAFEPATH"
"""Unless it is set, a new process looks for every library in the current folder first."""


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
        self, function: Callable[[Task], Any], tasks: Iterable[Task]
    ) -> Generator[Done, None, None]:
        """The tasks with their results: see :class:`pgm_places.batch.workers.Workers`."""
        _start_trackers()
        lanes = _Lanes(self, function, iter(tasks))
        with warnings.catch_warnings(), closing(lanes):
            # loky renews a process that has grown, between two tasks, and warns of it.
            warnings.filterwarnings("ignore", message="A worker stopped while some jobs were given")
            yield from lanes.done()

    def executor(self) -> Any:
        """A process."""
        from joblib.externals.loky import ProcessPoolExecutor

        return ProcessPoolExecutor(
            max_workers=1,
            initializer=start_worker,
            initargs=(self.memory_bytes,),
            env={
                **dict.fromkeys(_LIBRARY_THREADS, str(self.n_threads)),
                **_caller_of_workers(),
                _SAFE_PATH: "1",
            },
        )


def _caller_of_workers() -> dict[str, str]:
    """Variables of this process that its workers would not get from their own start."""
    return {key: value for key, value in os.environ.items() if key.startswith("PGM_PLACES_")}


def _start_trackers() -> None:
    """Start the processes that remove what dead workers leave behind, unless they run already.

    loky would start them itself, but it gives them no environment of their own.
    """
    from joblib.externals.loky.backend import resource_tracker

    with _safe_path():
        resource_tracker.ensure_running()
        if os.name == "posix":
            from multiprocessing import resource_tracker as python_tracker

            python_tracker.ensure_running()


@contextmanager
def _safe_path() -> Iterator[None]:
    """While the block lasts, processes that start do not look in the current folder."""
    before = os.environ.get(_SAFE_PATH)
    os.environ[_SAFE_PATH] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ[_SAFE_PATH]
        else:
            os.environ[_SAFE_PATH] = before


class _Lanes:
    """A thread per process, which hands it one task after the other."""

    def __init__(
        self, workers: LocalWorkers, function: Callable[[Any], Any], tasks: Iterator[Any]
    ) -> None:
        self._workers, self._function, self._tasks = workers, function, tasks
        self._lock, self._stopped = threading.Lock(), False
        self._found: queue.SimpleQueue[Done | BaseException | None] = queue.SimpleQueue()
        self._executors: dict[int, Any] = {}
        self._running: dict[int, Any] = {}
        self._threads = [
            threading.Thread(target=self._lane, args=(number,), daemon=True)
            for number in range(workers.n_jobs)
        ]

    def done(self) -> Iterator[Done]:
        """The tasks as they end; the first exception is raised."""
        for thread in self._threads:
            thread.start()
        running = len(self._threads)
        while running:
            found = self._found.get()
            if found is None:
                running -= 1
            elif isinstance(found, BaseException):
                raise found
            else:
                yield found

    def close(self) -> None:
        """End the processes, whatever they are doing."""
        with self._lock:
            self._stopped = True
            executors, futures = list(self._executors.values()), list(self._running.values())
        for future in futures:
            _wait_until_taken(future)
        for executor in executors:
            executor.shutdown(wait=False, kill_workers=True)

    def _lane(self, number: int) -> None:
        try:
            while (task := self._next()) is not self:
                self._found.put(Done(task, self._result(number, task)))
        except BaseException as error:  # noqa: BLE001  it is raised where the results are read
            self._found.put(error)
        finally:
            self._found.put(None)

    def _next(self) -> Any:
        """The next task; this object itself when there is none."""
        with self._lock:
            return self if self._stopped else next(self._tasks, self)

    def _result(self, number: int, task: Any) -> Any:
        """What the function returns, None where too many processes die on the task."""
        for _ in range(_MOST_DEATHS):
            try:
                with self._lock:
                    if self._stopped:
                        return None
                    future = self._executor(number).submit(self._function, task)
                    self._running[number] = future
                return future.result()
            except BrokenExecutor:
                with self._lock:
                    broken = self._executors.pop(number)
                broken.shutdown(wait=False, kill_workers=True)
        return None

    def _executor(self, number: int) -> Any:
        if number not in self._executors:
            self._executors[number] = self._workers.executor()
        return self._executors[number]


def _wait_until_taken(future: Any) -> None:
    """Wait until loky has handed a task on: shut down before that, its thread fails on the task."""
    given_up = time.monotonic() + _TAKEN_WITHIN_S
    while not (future.running() or future.done()) and time.monotonic() < given_up:
        time.sleep(0.001)
