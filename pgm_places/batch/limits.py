"""Limits of a worker: memory, time, and the life of its parent process."""

import ctypes
import errno
import gc
import os
import re
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

from pgm_places.errors import InputError

LEAST_MEMORY = 256 * 1000**2
"""Bytes for a worker's libraries and a small map; each further thread may take as many."""


def memory_bytes(text: str) -> int:
    """Parse a size.

    Examples
    --------
    >>> memory_bytes("4GB"), memory_bytes("1.5 GiB")
    (4000000000, 1610612736)
    """
    match = re.fullmatch(r"([0-9]{1,15}(?:\.[0-9]{1,9})?)\s*([kmgt]?)(i?)b?", text.strip().lower())
    if match is None or (match[3] and not match[2]):
        raise InputError(f"--memory expects a size such as 4GB or 500MiB, got {text!r}")
    number, unit, binary = match.groups()
    n_bytes = int(float(number) * (1024 if binary else 1000) ** ["", *"kmgt"].index(unit))
    if n_bytes < LEAST_MEMORY:
        raise InputError(
            f"--memory {text}: a worker needs at least 256MB for its libraries and a small map"
        )
    return n_bytes


class TimeIsUpError(BaseException):
    """Raised in work that exceeds its time limit; a BaseException, so that no handler stops it."""


@contextmanager
def time_limit(seconds: float | None) -> Iterator[None]:
    """Raise :class:`TimeIsUpError` in this thread when the block exceeds the time limit.

    Unlike a signal, this works in any thread; a running kernel finishes first.
    """
    if seconds is None:
        yield
        return
    thread, lock, over = threading.get_ident(), threading.Lock(), False

    def interrupt() -> None:
        with lock:
            if not over:
                error = ctypes.py_object(TimeIsUpError)
                ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread), error)

    timer = threading.Timer(seconds, interrupt)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        with lock:
            over = True
        timer.cancel()


def start_worker(memory_bytes: int | None) -> None:
    """Prepare a worker process: it ends with its parent and has a memory limit."""
    # Ctrl-C reaches the process group; the parent stops its workers itself.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()
    gc.set_threshold(100_000, 50, 50)  # as on the command line
    if memory_bytes is not None:
        limit_memory(memory_bytes)


def end_with_parent() -> None:
    """Exit this process when its parent process has ended."""
    parent = os.getppid()

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(1)
        os._exit(0)

    threading.Thread(target=watch, daemon=True).start()


def limit_memory(n_bytes: int) -> None:
    """Let allocations of private memory beyond ``n_bytes`` fail (Linux: ``RLIMIT_DATA``)."""
    try:
        import resource
    except ImportError:  # Windows
        return
    _, most = resource.getrlimit(resource.RLIMIT_DATA)
    if most != resource.RLIM_INFINITY:
        n_bytes = min(n_bytes, most)
    resource.setrlimit(resource.RLIMIT_DATA, (n_bytes, most))


def causes_of_system(error: BaseException) -> Iterator[OSError]:
    """The system errors in the chain of causes of an error."""
    step: BaseException | None = error
    while step is not None:
        if isinstance(step, OSError):
            yield step
        step = step.__cause__ or step.__context__


def is_full(error: BaseException) -> bool:
    """Whether an error was caused by a full disk or quota."""
    return any(cause.errno in (errno.ENOSPC, errno.EDQUOT) for cause in causes_of_system(error))
