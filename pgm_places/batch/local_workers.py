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
"""The result of a task that exceeded its time limit; its process was killed."""


@dataclass(frozen=True)
class Fault:
    """A result caused by a worker, not by its task; ``is_certain``: the worker fails on every task.

    ``result`` is final if no other worker succeeds; an exception is raised.
    """

    result: Any
    is_certain: bool = False


class Judge(Protocol):
    """Distinguishes faults of workers from faults of tasks."""

    def fault(self, task: Any, result: Any, worker: str) -> Fault | None:
        """The worker's fault in a result or exception, or None; called from several threads."""
        ...

    def left_out(self, worker: str, result: Any) -> None:
        """Report a worker that was excluded after this result."""
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
        """Run the tasks; yields each with the function's result, in order of completion.

        The result is None if every worker crashed on the task, ``TIMED_OUT`` after ``limit_s``. A
        crashed worker is replaced and its task repeated a few times, on another machine if a judge
        wants it. An exception of the function stops all work and is raised.
        """
        ...


GRACE_S = 10.0

_MOST_DEATHS = 3
"""Crashed processes after which a task is given up."""

_TAKEN_WITHIN_S = 2.0
"""Timeout for loky to hand a task to its process, which usually takes milliseconds."""

_LIBRARY_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

_SAFE_PATH = "PYTHONSAFEPATH"
"""Unless it is set, a new process searches the current folder first for every import."""


class WorkerProcess:
    """A process of joblib's loky for one thread, which exits after ``idle_s`` without a task.

    The process of an unfinished task is killed ``grace_s`` after the time limit.
    """

    def __init__(
        self,
        n_threads: int = 1,
        memory_bytes: int | None = None,
        idle_s: float | None = None,
        grace_s: float = GRACE_S,
    ) -> None:
        self._n_threads, self._memory_bytes, self._idle_s = n_threads, memory_bytes, idle_s
        self._grace_s = grace_s
        self._lock, self._ended = threading.Lock(), False
        self._executor: Any = None
        self._future: Any = None

    def result(
        self, function: Callable[[Task], Any], task: Task, limit_s: float | None = None
    ) -> Any:
        """A task's result, None after too many crashes, or ``TIMED_OUT`` after the time limit."""
        for _ in range(_MOST_DEATHS):
            try:
                if limit_s is not None and (ready := self._submitted(bool, 0)) is not None:
                    ready.result()  # starting a process does not count
                future = self._submitted(function, task)
                if future is None:
                    return None
                return future.result(None if limit_s is None else limit_s + self._grace_s)
            except BrokenExecutor:
                self._kill()
            except TimeoutError:
                if future.done():  # raised by the function
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
        """The future of a task; None if the process was ended."""
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
                # Settings of this process, which workers would not inherit.
                **{key: text for key, text in os.environ.items() if key.startswith("PGM_PLACES_")},
                _SAFE_PATH: "1",
            },
        )


_IDLE_S = 60.0
"""Idle time after which the subprocess of a worker exits."""

_OF_THREAD = threading.local()


def run_in_subprocess(
    function: Callable[[Task], Any],
    task: Task,
    *,
    limit_s: float | None = None,
    memory_bytes: int | None = None,
) -> Any:
    """Run a task in a reusable subprocess, for workers that may not be killed or limited (Dask's).

    The result is ``TIMED_OUT`` after the time limit, None if the subprocess crashed each time.
    """
    processes = _OF_THREAD.__dict__.setdefault("processes", {})
    if memory_bytes not in processes:
        start_trackers()
        processes[memory_bytes] = WorkerProcess(memory_bytes=memory_bytes, idle_s=_IDLE_S)
    with _may_have_children():
        return processes[memory_bytes].result(function, task, limit_s)


@contextmanager
def _may_have_children() -> Iterator[None]:
    """Let a daemon process start a subprocess; ours end by themselves with their parent."""
    config: dict[str, Any] = multiprocessing.current_process()._config  # type: ignore[attr-defined]
    before = config.get("daemon")
    config["daemon"] = False
    try:
        yield
    finally:
        config["daemon"] = before


def start_trackers() -> None:
    """Start loky's resource trackers, unless they are running, with a safe import path."""
    from joblib.externals.loky.backend import resource_tracker

    with _safe_path():
        resource_tracker.ensure_running()
        if os.name == "posix":
            from multiprocessing import resource_tracker as python_tracker

            python_tracker.ensure_running()


@contextmanager
def _safe_path() -> Iterator[None]:
    """Processes started in the block do not import from the current folder."""
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
    """Wait until loky has handed on a task; its thread fails if it is shut down earlier."""
    deadline = time.monotonic() + _TAKEN_WITHIN_S
    while not (future.running() or future.done()) and time.monotonic() < deadline:
        time.sleep(0.001)


@dataclass(frozen=True)
class LocalWorkers:
    """Processes of joblib's loky, each with its own executor: a crash affects one known task.

    The process of an unfinished task is killed ``grace_s`` after the time limit.
    """

    n_jobs: int
    n_threads: int = 1
    memory_bytes: int | None = None
    grace_s: float = GRACE_S

    def run(
        self,
        function: Callable[[Task], Any],
        tasks: Iterable[Task],
        *,
        limit_s: float | None = None,
        judge: Judge | None = None,  # noqa: ARG002  all workers are on one machine
    ) -> Generator[tuple[Any, Any], None, None]:
        """Run tasks: see :class:`pgm_places.batch.local_workers.Workers`."""
        start_trackers()
        lanes = _Dispatcher(self, function, iter(tasks), limit_s)
        with warnings.catch_warnings(), closing(lanes):
            # loky replaces a process whose memory has grown, between two tasks, with a warning.
            warnings.filterwarnings("ignore", message="A worker stopped while some jobs were given")
            yield from lanes.done()


class _Dispatcher:
    """Runs tasks on several processes, each fed by one thread."""

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
            WorkerProcess(workers.n_threads, workers.memory_bytes, grace_s=workers.grace_s)
            for _ in range(workers.n_jobs)
        ]
        self._threads = [
            threading.Thread(target=self._lane, args=(process,), daemon=True)
            for process in self._processes
        ]

    def done(self) -> Iterator[tuple[Any, Any]]:
        """The tasks with results, in order of completion; raises the first exception."""
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
        except BaseException as error:  # noqa: BLE001  raised again by done()
            self._ended.put(error)
        finally:
            self._ended.put(None)

    def _next(self) -> Any:
        """The next task; this object itself if no task is left."""
        with self._lock:
            return self if self._stopped else next(self._tasks, self)
