"""Work spread over threads so that results never depend on the number of threads.

Kernels release the interpreter lock; each task writes its own part of the output, so any number of
threads gives the same bits. Threads of this process are used, not numba's own pool, because they
compile faster, work in forked processes, and are bounded by the caller.
"""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from itertools import count

from pgm_places.errors import InputError

__all__ = ["Crew", "resolve_threads", "run_tasks"]


_MOST = 1024
"""More is a slip: the system would refuse them, after some of the work is done."""


def resolve_threads(n_threads: int | None = None) -> int:
    """How many threads to use: the argument, else ``PGM_PLACES_NUM_THREADS``, else the cores."""
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


class Crew:
    """Threads that stay for many rounds of tasks, as starting them costs more than a short round.

    The caller's own thread is one of them.

    Parameters
    ----------
    n_threads : int
    """

    def __init__(self, n_threads: int) -> None:
        self._helpers = n_threads - 1
        self._pool = ThreadPoolExecutor(self._helpers) if self._helpers else None

    def __enter__(self) -> "Crew":
        return self

    def __exit__(self, *_: object) -> None:
        if self._pool is not None:
            self._pool.shutdown()

    def run(self, work: Callable[[int], None], n_tasks: int) -> None:
        """Call ``work(task)`` for every task in ``range(n_tasks)``, as :func:`run_tasks` does."""
        if not self._helpers:
            for task in range(n_tasks):
                work(task)
            return
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

        helpers = min(self._helpers, n_tasks - 1)
        others = [self._pool.submit(worker) for _ in range(helpers)] if self._pool else []
        try:
            worker()
            for other in others:
                other.result()
        finally:
            stopped = True
            wait(others)


def run_tasks(work: Callable[[int], None], n_tasks: int, *, n_threads: int | None = None) -> None:
    """Call ``work(task)`` for every task in ``range(n_tasks)``, spread over threads.

    Tasks are handed out in order to whichever thread is free. The first exception stops the
    handing out and is raised here once the running tasks have ended.
    """
    with Crew(max(1, min(resolve_threads(n_threads), n_tasks))) as crew:
        crew.run(work, n_tasks)
