"""Who does the tasks of a batch: processes of this machine, or a Dask cluster."""

from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple, Protocol, TypeVar

__all__ = ["Done", "Workers"]

Task = TypeVar("Task")


class Done(NamedTuple):
    """A task that has come to an end.

    Parameters
    ----------
    task : Any
    result : Any
        What the function returned; None where every worker died on the task.
    """

    task: Any
    result: Any


class Workers(Protocol):
    """Processes that apply a function to tasks."""

    def run(self, function: Callable[[Task], Any], tasks: Iterable[Task]) -> Iterator[Done]:
        """The tasks with their results, as they come to an end.

        A worker that dies is replaced, and its task begun again, a few times at most. An exception
        of the function ends everything and is raised here.
        """
        ...
