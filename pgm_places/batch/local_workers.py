"""Workers of a batch: local processes, restarted when they crash."""

import multiprocessing
import os
import queue
import threading
import time
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import BrokenExecutor
from contextlib import closing, contextmanager
from dataclasses import dataclass
from enum import Enum
from typing import Any, Literal, Protocol, TypeVar

from pgm_places.batch.limits import start_worker

Task = TypeVar("Task")


class Unfinished(Enum):
    """Why a task has no result."""

    TIMED_OUT = "overdue"


TIMED_OUT: Literal[Unfinished.TIMED_OUT] = Unfinished.TIMED_OUT
"""The result of a task that took longer than it may: its process was killed."""


@dataclass(frozen=True)
class Fault:
    """A result that is the fault of a worker rather than of its task.

    Parameters
    ----------
    result : object
        What the result becomes where no other worker does better; an exception is raised.
    is_certain : bool
        Whether the worker would do no better with any other task.
    """

    result: Any
    is_certain: bool = False


class Judge(Protocol):
    """Tells the faults of workers from those of tasks."""

    def fault(self, task: Any, result: Any, worker: str) -> Fault | None:
        """The worker's fault, if the result or the exception is one; asked in several threads."""
        ...

    def left_out(self, worker: str, result: Any) -> None:
        """Take note that a worker gets no more tasks after this result."""
        ...


class Workers(Protocol):
    """Processes that apply a function to tasks."""

    def run(
        self,
        function: Callable[[Task], Any],
        tasks: Iterable[Task],
        *,
        limit_s: float | None = None,
        judge: Judge | None = None,
    ) -> Iterator[tuple[Any, Any]]:
        """Each task with what the function returned, as they come to an end.

        The result is None where every worker died on the task, ``TIMED_OUT`` where one was killed
        because it took too long.

        A worker that dies is replaced, and its task begun again, a few times at most. An exception
        of the function ends everything and is raised here. A task that takes ``limit_s`` and some
        seconds more is ended with its process, whatever that is doing. Where workers are on several
        machines, a judge may send tasks from one to another.
        """
        ...


GRACE_S = 10.0
"""So long after its limit a process is killed that has not given up its task by itself."""

_MOST_DEATHS = 3
"""A task is given up once it has crashed this number of processes."""

_TAKEN_WITHIN_S = 2.0
"""A task is handed on within milliseconds; a machine that is slower than this may show an error."""

_LIBRARY_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

_SAFE_PATH = "PYTHONSAFEPATH"
"""Unless it is set, a new process looks for every library in the current folder first."""


class WorkerProcess:
    """A process of joblib's loky that one thread hands its tasks to; others may end it.

    Parameters
    ----------
    n_threads : int
        Threads that numerical libraries may use.
    memory_bytes : int, optional
        What it may take.
    idle_s : float, optional
        It ends when it has had nothing to do for so long; the next task then starts another.
    """

    def __init__(
        self, n_threads: int = 1, memory_bytes: int | None = None, idle_s: float | None = None
    ) -> None:
        self._n_threads, self._memory_bytes, self._idle_s = n_threads, memory_bytes, idle_s
        self._lock, self._ended = threading.Lock(), False
        self._executor: Any = None
        self._future: Any = None

    def result(
        self, function: Callable[[Task], Any], task: Task, limit_s: float | None = None
    ) -> Any:
        """What the function returns; None where too many processes die on the task.

        With a limit, the process is killed some seconds after it, whatever it is doing, and the
        result is ``TIMED_OUT``.
        """
        for _ in range(_MOST_DEATHS):
            try:
                if limit_s is not None and (ready := self._submitted(bool, 0)) is not None:
                    ready.result()  # starting a process does not count
                future = self._submitted(function, task)
                if future is None:
                    return None
                return future.result(None if limit_s is None else limit_s + GRACE_S)
            except BrokenExecutor:
                self._kill()
            except TimeoutError:
                if future.done():  # the function itself has raised it
                    raise
                self._kill()
                return TIMED_OUT
        return None

    def end(self) -> None:
        """Kill the process, even during a task, and accept no more tasks."""
        with self._lock:
            self._ended = True
        if self._future is not None:
            _wait_until_taken(self._future)
        self._kill(wait=True)

    def _submitted(self, function: Callable[[Any], Any], task: Any) -> Any:
        """The future of a task; None where the process was ended."""
        with self._lock:
            if self._ended:
                return None
            if self._executor is None:
                self._executor = self._started()
            self._future = self._executor.submit(function, task)
            return self._future

    def _kill(self, *, wait: bool = False) -> None:
        with self._lock:
            executor, self._executor = self._executor, None
        if executor is not None:
            executor.shutdown(wait=wait, kill_workers=True)

    def _started(self) -> Any:
        from joblib.externals.loky import ProcessPoolExecutor

        return ProcessPoolExecutor(
            max_workers=1,
            timeout=self._idle_s,
            initializer=start_worker,
            initargs=(self._memory_bytes,),
            env={
                **dict.fromkeys(_LIBRARY_THREADS, str(self._n_threads)),
                # Of this process, which workers would not get from their own start.
                **{key: text for key, text in os.environ.items() if key.startswith("PGM_PLACES_")},
                _SAFE_PATH: "1",
            },
        )


_IDLE_S = 60.0
"""A process beside a worker of others is gone so long after the last task."""

_OF_THREAD = threading.local()


def run_in_subprocess(
    function: Callable[[Task], Any],
    task: Task,
    *,
    limit_s: float | None = None,
    memory_bytes: int | None = None,
) -> Any:
    """What a function makes of a task in a process beside this one, which stays for the next.

    For workers of others, which are not ours to kill or to limit: ``TIMED_OUT`` where it took too
    long, None where its process died each time. Each limit of memory has a process of its own.
    """
    processes = _OF_THREAD.__dict__.setdefault("processes", {})
    if memory_bytes not in processes:
        start_trackers()
        processes[memory_bytes] = WorkerProcess(memory_bytes=memory_bytes, idle_s=_IDLE_S)
    with _may_have_children():
        return processes[memory_bytes].result(function, task, limit_s)


@contextmanager
def _may_have_children() -> Iterator[None]:
    """Let a daemon start a process: ours end by themselves when their parent does."""
    config: dict[str, Any] = multiprocessing.current_process()._config  # type: ignore[attr-defined]
    before = config.get("daemon")
    config["daemon"] = False
    try:
        yield
    finally:
        config["daemon"] = before


def start_trackers() -> None:
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


def _wait_until_taken(future: Any) -> None:
    """Wait until loky has handed a task on: shut down before that, its thread fails on the task."""
    given_up = time.monotonic() + _TAKEN_WITHIN_S
    while not (future.running() or future.done()) and time.monotonic() < given_up:
        time.sleep(0.001)


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
        judge: Judge | None = None,  # noqa: ARG002  all of them are on one machine
    ) -> Generator[tuple[Any, Any], None, None]:
        """The tasks with their results: see :class:`pgm_places.batch.local_workers.Workers`."""
        start_trackers()
        lanes = _Dispatcher(self, function, iter(tasks), limit_s)
        with warnings.catch_warnings(), closing(lanes):
            # loky renews a process that has grown, between two tasks, and warns of it.
            warnings.filterwarnings("ignore", message="A worker stopped while some jobs were given")
            yield from lanes.done()


class _Dispatcher:
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
            WorkerProcess(workers.n_threads, workers.memory_bytes) for _ in range(workers.n_jobs)
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
        """Kill the processes, even during a task."""
        with self._lock:
            self._stopped = True
        for process in self._processes:
            process.end()

    def _lane(self, process: WorkerProcess) -> None:
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
