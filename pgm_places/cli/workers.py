"""Who does the work of a command in parts: the flags, and the workers that they ask for."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from pgm_places._option_marks import Ge, Le
from pgm_places.cli.declarations import Option
from pgm_places.errors import InputError

if TYPE_CHECKING:
    from pgm_places.batch.workers import Workers

__all__ = ["Jobs", "Memory", "Scheduler", "WorkerOptions", "make_workers"]

Jobs = Annotated[
    Annotated[int, Ge(1), Le(1024)] | None,
    Option("--jobs", "-j", help="Worker processes; one per core by default."),
]
Scheduler = Annotated[
    str | None,
    Option(metavar="ADDRESS", help="Hand the work to this Dask cluster instead."),
]
Memory = Annotated[
    str | None,
    Option(metavar="SIZE", help="Memory limit of each worker, such as 4GB."),
]


@dataclass(frozen=True)
class WorkerOptions:
    """The flags; None where one was not given."""

    jobs: int | None = None
    scheduler: str | None = None
    memory: str | None = None

    @property
    def given(self) -> bool:
        """Whether any flag was given."""
        return self != WorkerOptions()


def make_workers(
    options: WorkerOptions, n_tasks: int, n_threads: int | None
) -> tuple["Workers", int]:
    """The workers that the flags ask for, and the threads of each.

    Raises
    ------
    InputError
        The flags contradict each other, or name no size.
    """
    from pgm_places.batch.dask_workers import DaskWorkers
    from pgm_places.batch.local_workers import LocalWorkers
    from pgm_places.batch.memory_size import memory_bytes
    from pgm_places.kernels.threads import resolve_threads

    memory = None if options.memory is None else memory_bytes(options.memory)
    if options.scheduler is not None:
        if options.jobs is not None:
            raise InputError("--jobs is for this machine; a cluster behind --scheduler has its own")
        return DaskWorkers(options.scheduler, memory), n_threads or 1
    cores = resolve_threads()
    jobs = min(options.jobs or cores, max(n_tasks, 1))
    threads = n_threads or max(1, cores // jobs)
    return LocalWorkers(jobs, threads, memory), threads
