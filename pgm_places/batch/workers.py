"""Who does the tasks of a batch: processes of this machine, or a Dask cluster."""

from collections.abc import Callable, Iterable, Iterator
from enum import Enum
from typing import Any, Literal, Protocol, TypeVar

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
