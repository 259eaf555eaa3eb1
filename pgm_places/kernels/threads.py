"""Parallel tasks on threads, with results that do not depend on the number of threads.

Kernels release the interpreter lock; each task writes its own part of the output, so any number of
threads gives the same bits. Python threads are used instead of a C++ pool because they work in
forked processes and obey the caller's limit.
"""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar, copy_context
from functools import partial
from itertools import count
from threading import Lock, Thread

from pgm_places.errors import InputError

_MOST = 1024  # the largest allowed number; the system would refuse more, in the middle of the work


_wanted: ContextVar[int | None] = ContextVar("wanted", default=None)


@contextmanager
def thread_limit(n_threads: int | None) -> Iterator[None]:
    """Limit work in the block to ``n_threads`` threads; None keeps the outer limit.

    Examples
    --------
    >>> with thread_limit(3):
    ...     resolve_threads()
    3
    """
    before = _wanted.set(_wanted.get() if n_threads is None else n_threads)
    try:
        yield
    finally:
        _wanted.reset(before)


def resolve_threads(n_threads: int | None = None) -> int:
    """The argument, the limit of the block, ``PGM_PLACES_NUM_THREADS``, or the number of cores."""
    if n_threads is None:
        n_threads = _wanted.get()
    if n_threads is None:
        named = os.environ.get("PGM_PLACES_NUM_THREADS")
        if named:
            try:
                n_threads = int(named)
            except ValueError:
                raise InputError(
                    f"PGM_PLACES_NUM_THREADS must be a whole number of threads, got {named!r}"
                ) from None
        elif hasattr(os, "sched_getaffinity"):
            n_threads = len(os.sched_getaffinity(0))
        else:
            n_threads = os.cpu_count() or 1
    if not 1 <= n_threads <= _MOST:
        raise InputError(f"the number of threads must be from 1 to {_MOST}, got {n_threads}")
    return n_threads


class _Worker:
    """A thread for rounds of tasks, synchronised by two locks, as pools of futures are slower."""

    def __init__(self) -> None:
        self._work: Callable[[], None] | None = None  # the end of the thread
        self._error: BaseException | None = None
        self._begun, self._ended = Lock(), Lock()
        self._begun.acquire()
        self._ended.acquire()
        self._thread = Thread(target=self._run, daemon=True)
        self._thread.start()

    def begin(self, work: Callable[[], None]) -> None:
        """Start ``work`` in the caller's context, limited to one thread inside."""
        context = copy_context()
        context.run(_wanted.set, 1)
        self._work = partial(context.run, work)
        self._begun.release()

    def end(self) -> BaseException | None:
        """Wait for the end of the work; returns its exception, if any."""
        self._ended.acquire()
        error, self._error = self._error, None
        return error

    def leave(self) -> None:
        """End the thread, also after an interrupted round."""
        self._work = None
        with suppress(RuntimeError):  # released already, but not yet awake
            self._begun.release()
        self._thread.join()

    def _run(self) -> None:
        while True:
            self._begun.acquire()
            work = self._work
            if work is None:
                return
            try:
                work()
            except BaseException as error:  # noqa: BLE001  the caller raises it
                self._error = error
            self._ended.release()


class ThreadTeam:
    """The caller's and further threads, started once for many short rounds of tasks."""

    def __init__(self, n_threads: int) -> None:
        self._most = n_threads - 1
        self._helpers: list[_Worker] = []

    def __enter__(self) -> "ThreadTeam":
        return self

    def __exit__(self, *_: object) -> None:
        for helper in self._helpers:
            helper.leave()

    def run(self, work: Callable[[int], None], n_tasks: int) -> None:
        """Call ``work(task)`` for every task in ``range(n_tasks)``, as in :func:`run_tasks`."""
        tickets = count()  # its next() is atomic
        stopped = False

        def worker() -> None:
            nonlocal stopped
            while not stopped:
                task = next(tickets)
                if task >= n_tasks:
                    return
                try:
                    work(task)
                except BaseException:
                    stopped = True
                    raise

        wanted = min(self._most, n_tasks - 1)
        while len(self._helpers) < wanted:
            self._helpers.append(_Worker())
        busy = self._helpers[: max(wanted, 0)]
        for helper in busy:
            helper.begin(worker)
        try:
            with thread_limit(1 if busy else None):
                worker()
        finally:
            stopped = True  # no tasks are left, or one has failed
            errors = [helper.end() for helper in busy]
        for error in errors:
            if error is not None:
                raise error


def run_tasks(work: Callable[[int], None], n_tasks: int, *, n_threads: int | None = None) -> None:
    """Call ``work(task)`` for every task in ``range(n_tasks)``, spread over threads in order.

    Tasks run in the caller's context; with several threads, each task uses one by default. The
    first exception stops further tasks and is raised once the running ones have ended.
    """
    with ThreadTeam(max(1, min(resolve_threads(n_threads), n_tasks))) as crew:
        crew.run(work, n_tasks)


def run_parts(
    work: Callable[[slice], None], n_items: int, size: int, *, n_threads: int | None = None
) -> None:
    """Call ``work(part)`` for slices of at most ``size`` items, as in :func:`run_tasks`."""

    def one(task: int) -> None:
        work(slice(task * size, min((task + 1) * size, n_items)))

    run_tasks(one, -(-n_items // size), n_threads=n_threads)
