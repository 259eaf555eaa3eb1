"""Who does the tasks of a batch, how much memory they may take, and how long."""

import ctypes
import re
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from enum import Enum
from typing import Any, Literal, Protocol, TypeVar

from pgm_places.errors import InputError

Task = TypeVar("Task")


class Unfinished(Enum):
    """Why a task has no result."""

    OVERDUE = "overdue"


OVERDUE: Literal[Unfinished.OVERDUE] = Unfinished.OVERDUE
"""The result of a task that took longer than it may: its process was killed."""


class Workers(Protocol):
    """Processes that apply a function to tasks."""

    def run(
        self,
        function: Callable[[Task], Any],
        tasks: Iterable[Task],
        *,
        limit_s: float | None = None,
    ) -> Iterator[tuple[Any, Any]]:
        """Each task with what the function returned, as they come to an end.

        The result is None where every worker died on the task, ``OVERDUE`` where one was killed
        because it took too long.

        A worker that dies is replaced, and its task begun again, a few times at most. An exception
        of the function ends everything and is raised here. A task that takes ``limit_s`` and some
        seconds more is ended with its process, whatever that is doing.
        """
        ...


_LEAST = 256 * 1000**2


def memory_bytes(text: str) -> int:
    """The bytes that a text names.

    Raises
    ------
    InputError
        It is no size, or less than any map needs.

    Examples
    --------
    >>> memory_bytes("4GB"), memory_bytes("1.5 GiB")
    (4000000000, 1610612736)
    """
    found = re.fullmatch(r"([0-9]{1,15}(?:\.[0-9]{1,9})?)\s*([kmgt]?)(i?)b?", text.strip().lower())
    if found is None or (found[3] and not found[2]):
        raise InputError(f"--memory expects a size such as 4GB or 500MiB, got {text!r}")
    number, unit, binary = found.groups()
    n_bytes = int(float(number) * (1024 if binary else 1000) ** ["", *"kmgt"].index(unit))
    if n_bytes < _LEAST:
        raise InputError(
            f"--memory {text}: a worker needs at least 256MB for its libraries and a small map"
        )
    return n_bytes


class TimeIsUpError(BaseException):
    """Raised inside work that has taken too long; nothing that catches errors stops it."""


@contextmanager
def time_limit(seconds: float | None) -> Iterator[None]:
    """Raise :class:`TimeIsUpError` in this thread when the block has taken so long.

    It is raised between two steps of Python: a kernel that runs is finished first, unless its
    process is killed (:mod:`pgm_places.batch.local_workers`). It works in any thread, as a signal
    would not.
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
