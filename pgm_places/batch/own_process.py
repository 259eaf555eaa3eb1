"""OwnProcess: a process that does one task after the other, renewed where it dies or hangs."""

import gc
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor
from contextlib import contextmanager
from typing import Any, TypeVar

from pgm_places.batch.workers import OVERDUE


def start_worker(memory_bytes: int | None) -> None:
    """Prepare this process: it ends with its parent, and takes no more memory than it may."""
    # Ctrl-C reaches the whole group of processes; the parent ends its workers itself.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()
    gc.set_threshold(100_000, 50, 50)  # as on the command line
    if memory_bytes is not None:
        limit_memory(memory_bytes)


def end_with_parent() -> None:
    """End this process when the one that started it is gone, however that ended."""
    parent = os.getppid()

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(1)
        os._exit(0)

    threading.Thread(target=watch, daemon=True).start()


def limit_memory(n_bytes: int) -> None:
    """Let allocations fail beyond this many bytes, where the system can do that.

    Private memory that can be written to is counted, as Linux does for ``RLIMIT_DATA``: address
    space that libraries reserve and never use is not.
    """
    try:
        import resource
    except ImportError:  # Windows
        return
    _, most = resource.getrlimit(resource.RLIMIT_DATA)
    if most != resource.RLIM_INFINITY:
        n_bytes = min(n_bytes, most)
    resource.setrlimit(resource.RLIMIT_DATA, (n_bytes, most))


Task = TypeVar("Task")

GRACE_S = 10.0
"""So long after its limit a process is killed that has not given up its task by itself."""

_MOST_DEATHS = 3
"""A task that has taken so many processes with it is given up."""

_TAKEN_WITHIN_S = 2.0
"""A task is handed on within milliseconds; a machine that is slower than this may show an error."""

_LIBRARY_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

_SAFE_PATH = "PYTHONSAFEPATH"
"""Unless it is set, a new process looks for every library in the current folder first."""


class OwnProcess:
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
        result is ``OVERDUE``.
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
                return OVERDUE
        return None

    def end(self) -> None:
        """End the process, whatever it is doing, and take no more tasks."""
        with self._lock:
            self._ended = True
        if self._future is not None:
            _wait_until_taken(self._future)
        self._kill()

    def _submitted(self, function: Callable[[Any], Any], task: Any) -> Any:
        """The future of a task; None where the process was ended."""
        with self._lock:
            if self._ended:
                return None
            if self._executor is None:
                self._executor = self._started()
            self._future = self._executor.submit(function, task)
            return self._future

    def _kill(self) -> None:
        with self._lock:
            executor, self._executor = self._executor, None
        if executor is not None:
            executor.shutdown(wait=False, kill_workers=True)

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


def done_beside(
    function: Callable[[Task], Any], task: Task, *, limit_s: float, memory_bytes: int | None = None
) -> Any:
    """What a function makes of a task in a process beside this one, which stays for the next.

    For workers of others, which are not ours to kill: ``OVERDUE`` where it took too long, None
    where its process died each time.
    """
    process = getattr(_OF_THREAD, "process", None)
    if process is None:
        start_trackers()
        process = _OF_THREAD.process = OwnProcess(memory_bytes=memory_bytes, idle_s=_IDLE_S)
    with _may_have_children():
        return process.result(function, task, limit_s)


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
